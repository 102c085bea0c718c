"""A schedule from measured edges: what a program without a job does, for `prove --against`.

In: an `EdgeTrace`. Out: a `PulseSchedule` whose frames are all one period apart, from the first rise on; what
repeats at the end of the trace is its loop.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby, pairwise

import numpy as np

from servogen.edges import PINS, EdgeTrace
from servogen.errors import InputError, Location
from servogen.motion.trajectory import MAX_FRAMES
from servogen.pulse.schedule import Channel, Pulse, PulseSchedule, Run
from servogen.pulses import pulses as read_pulses
from servogen.units import Cycles

UNKNOWN_SERVO = "unknown"
Frame = tuple[Pulse | None, ...]
Trains = Mapping[int, Sequence[tuple[int, int]]]
"""By pin: (rise, width), in order."""


def measured_schedule(
    observed: EdgeTrace, file: str, servos: Mapping[str, str], device: str | None = None
) -> PulseSchedule:
    """Return the schedule of the pulses in `observed`, the content of `file`; `servos` has models by pin.

    Raises InputError if the pulses do not lie in frames of one length, or do not repeat.
    """
    pulses = _trains(observed)
    if not pulses:
        raise InputError("no-schedule", "no pin has a pulse", Location(file))
    begin = min(train[0][0] for train in pulses.values())
    period = _period(pulses, begin, file)
    pins = sorted(pulses)
    count = (int(observed.end) - begin) // period
    if count > MAX_FRAMES:
        most = float(observed.clock.seconds(MAX_FRAMES * period))
        raise InputError(
            "no-schedule", f"{count} frames are too many", Location(file), f"--seconds: at most {most:g}"
        )
    rows: list[list[Pulse | None]] = [[None] * len(pins) for _ in range(count)]
    for column, pin in enumerate(pins):
        for rise, width in pulses[pin]:
            frame, offset = divmod(rise - begin, period)
            if frame >= count:
                continue
            if offset + width >= period or rows[frame][column] is not None:
                message = f"{PINS[pin]} has a pulse at cycle {rise} that is not the only one in a frame of "
                raise InputError("no-schedule", f"{message}{period} cycles", Location(file))
            rows[frame][column] = Pulse(Cycles(offset), Cycles(width))
    frames = [tuple(row) for row in rows]
    lead_in, loop = _repeat(frames, file)
    return PulseSchedule(
        clock=observed.clock,
        period=Cycles(period),
        channels=tuple(Channel(PINS[p], PINS[p], servos.get(PINS[p], UNKNOWN_SERVO)) for p in pins),
        lead_in=tuple(_runs(lead_in)),
        loop=tuple(_runs(loop)),
        device=device,
    )


def _trains(observed: EdgeTrace) -> Trains:
    """Return the complete pulses of each pin that has one."""
    trains: dict[int, list[tuple[int, int]]] = {}
    pin, rise, width, _ = read_pulses(observed).whole()
    for number, *pulse in zip(pin.tolist(), rise.tolist(), width.tolist(), strict=True):
        trains.setdefault(number, []).append((pulse[0], pulse[1]))
    return trains


def _period(pulses: Trains, begin: int, file: str) -> int:
    """Return the length of the frames: the shortest time between two rises of the pin that rises first."""
    pin, train = next((pin, train) for pin, train in sorted(pulses.items()) if train[0][0] == begin)
    if len(train) < 2:
        raise InputError("no-schedule", f"{PINS[pin]} has one pulse only", Location(file))
    period = min(after[0] - before[0] for before, after in pairwise(train))
    for (rise, _), (after, _) in pairwise(train):
        if (after - rise) % period:
            message = (
                f"{PINS[pin]} rises {after - rise} cycles after cycle {rise}, other frames take {period}"
            )
            raise InputError("no-schedule", f"the frames are not of one length: {message}", Location(file))
    return period


def _repeat(frames: Sequence[Frame], file: str) -> tuple[Sequence[Frame], Sequence[Frame]]:
    """Return what comes once, and what repeats, at least twice, to the end."""
    numbers: dict[Frame, int] = {}
    row = np.array([numbers.setdefault(frame, len(numbers)) for frame in frames])
    best: tuple[int, int, int] | None = None
    for length in range(1, len(row) // 2 + 1):
        differs = np.flatnonzero(row[:-length] != row[length:])
        lead = int(differs[-1]) + 1 if len(differs) else 0
        if lead + 2 * length <= len(row) and (best is None or lead + length < best[0]):
            best = lead + length, lead, length
    if best is None:
        message = f"nothing repeats in {len(row)} frames"
        raise InputError("no-schedule", message, Location(file), "measure longer: --seconds")
    _, lead, length = best
    return frames[:lead], frames[lead : lead + length]


def _runs(frames: Sequence[Frame]) -> Iterator[Run]:
    for frame, equal in groupby(frames):
        yield Run(len(list(equal)), frame)
