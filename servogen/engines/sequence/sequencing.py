"""A schedule as a program of port writes and delays.

In: a `PulseSchedule` and the `Overheads` of a compiler. Out: a `Sequence` with every delay computed.

The paths back to the same frame and on to the next step differ in cycles; a position's `gap` ends `MARGIN`
before the shorter one, and `again` and the step's own wait make up the rest of each. A run longer than a byte
counts is a loop of calls, whose path back has its own wait (`turn`).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

from servogen.engines.sequence.programs import (
    START,
    DelayPath,
    Edge,
    FrameEdges,
    FrameFunction,
    Hold,
    Overheads,
    Sequence,
    SilentStep,
)
from servogen.errors import InputError
from servogen.pulse import PulseSchedule, Run
from servogen.units import Cycles, counted

MARGIN = Cycles(64)
"""A number of cycles larger than any compiler's loop, return and call take between two frames."""

MAX_COUNTED = 255
"""The maximum count of frames or calls: one byte, so that the cycles do not depend on its value."""

FEW_FRAMES_A_CALL = 100
"""The smallest number of frames per call of a long run, if it can be divided into equal calls."""


def sequence(schedule: PulseSchedule, overheads: Overheads) -> Sequence:
    """Return the program of a schedule. Raises InputError if the schedule leaves a delay no time."""
    lead_in, loop = _split(schedule.lead_in), _split(schedule.loop)
    parts = (*lead_in, *loop)
    runs = tuple(part.run for part in parts)
    pulsed = [run for run in runs if _pulsed(run)]
    if not pulsed:
        raise InputError("no-pulses", "the schedule has no pulse")
    often = Counter(run.pulses for run in pulsed)
    shared = dict.fromkeys(run.pulses for run in pulsed if run.frames > 1 or often[run.pulses] > 1)
    numbers = {pulses: number for number, pulses in enumerate(shared, 1)}
    owners = [numbers.get(run.pulses, -step) for step, run in enumerate(runs)]
    frames = [
        _frame(schedule, run, owner, overheads) if _pulsed(run) else None
        for run, owner in zip(runs, owners, strict=True)
    ]
    exits = _exits(schedule, frames, len(lead_in))
    positions = {
        number: _position(schedule, number, frames, owners, exits, overheads) for number in numbers.values()
    }
    steps = tuple(
        SilentStep(part.run.frames, Cycles(part.run.frames * schedule.period))
        if frame is None
        else _hold(schedule, step, part, frame, positions.get(owners[step]), exits[step], overheads)
        for step, (part, frame) in enumerate(zip(parts, frames, strict=True))
    )
    start = _delay(schedule.period, START, overheads, "from reset to the first edge")
    return Sequence(schedule, start, tuple(positions.values()), steps[: len(lead_in)], steps[len(lead_in) :])


@dataclass(frozen=True, slots=True)
class _Part:
    """A run that is repeated `turns` times."""

    run: Run
    turns: int = 1


def _split(runs: tuple[Run, ...]) -> tuple[_Part, ...]:
    """Return the same frames in parts whose frames and turns are counted in one byte each."""
    parts: list[_Part] = []
    for run in runs:
        if not _pulsed(run):
            parts.append(_Part(run))
            continue
        left = run.frames
        while left > MAX_COUNTED:
            size, turns = _equal_calls(left)
            parts.append(_Part(Run(size, run.pulses), turns))
            left -= size * turns
        parts += [_Part(Run(left, run.pulses))] if left else []
    return tuple(parts)


def _equal_calls(frames: int) -> tuple[int, int]:
    """Return (frames per call, calls) for all of `frames`, or for as many as possible."""
    # Equal calls are one loop; a remainder would need a call of its own.
    for size in range(MAX_COUNTED, FEW_FRAMES_A_CALL, -1):
        if frames % size == 0 and frames // size <= MAX_COUNTED:
            return size, frames // size
    return MAX_COUNTED, min(frames // MAX_COUNTED, MAX_COUNTED)


def _pulsed(run: Run) -> bool:
    return any(run.pulses)


def _frame(schedule: PulseSchedule, run: Run, owner: int, overheads: Overheads) -> FrameEdges:
    """Return the port writes of one frame and the delays between them."""
    changes: dict[int, list[tuple[int, int]]] = {}
    for channel, pulse in enumerate(run.pulses):
        if pulse:
            changes.setdefault(pulse.rise, []).append((channel, 1))
            changes.setdefault(pulse.rise + pulse.width, []).append((channel, 0))
    times = sorted(changes)
    ports = {"A": 0, "B": 0}
    edges = []
    for index, cycle in enumerate(times):
        touched = {schedule.channels[channel].pin[1] for channel, _ in changes[cycle]}
        if len(touched) > 1:
            raise InputError(
                "edges-too-close",
                f"edges of both ports fall on cycle {cycle} of a frame",
                hint="one write reaches one port: move one servo to the other's port or to another slot",
            )
        (port,) = touched
        for channel, level in changes[cycle]:
            mask = 1 << int(schedule.channels[channel].pin[2])
            ports[port] = ports[port] | mask if level else ports[port] & ~mask
        wait = Cycles(0)
        if index + 1 < len(times):
            path = DelayPath("in", owner, index)
            wait = _delay(times[index + 1] - cycle, path, overheads, f"after cycle {cycle} of a frame")
        edges.append(Edge(Cycles(cycle), port, ports[port], tuple(changes[cycle]), wait))
    return FrameEdges(tuple(edges), run)


def _exits(
    schedule: PulseSchedule, frames: list[FrameEdges | None], lead_in: int
) -> dict[int, Cycles | None]:
    """Return for each step with pulses the cycles from its last edge to the next step's first, without
    pauses.

    None if no pulse follows.
    """
    order = [step for step, frame in enumerate(frames) if frame]
    following = dict(pairwise(order))
    around = [step for step in order if step >= lead_in]
    if around:
        following[order[-1]] = around[0]
    exits: dict[int, Cycles | None] = dict.fromkeys(order)
    for step, after in following.items():
        here, there = frames[step], frames[after]
        if here and there:
            exits[step] = Cycles(schedule.period - here.last + there.first)
    return exits


def _position(
    schedule: PulseSchedule,
    number: int,
    frames: list[FrameEdges | None],
    owners: list[int],
    exits: dict[int, Cycles | None],
    overheads: Overheads,
) -> FrameFunction:
    mine = [step for step, owner in enumerate(owners) if owner == number]
    frame = next(frame for step in mine if (frame := frames[step]))
    around = _around(schedule, frame)
    gap = _checked(
        min([around, *(leave for step in mine if (leave := exits[step]))]) - MARGIN, "between frames"
    )
    again = _delay(around - gap, DelayPath("again", number), overheads, "between frames")
    return FrameFunction(number, frame, gap, again)


def _around(schedule: PulseSchedule, frame: FrameEdges) -> Cycles:
    """Return the cycles from a frame's last edge to the first edge of the same frame repeated."""
    return Cycles(schedule.period - frame.last + frame.first)


def _hold(
    schedule: PulseSchedule,
    step: int,
    part: _Part,
    frame: FrameEdges,
    position: FrameFunction | None,
    leave: Cycles | None,
    overheads: Overheads,
) -> Hold:
    gap = position.gap if position else 0
    turn = after = Cycles(0)
    if part.turns > 1:
        turn = _delay(_around(schedule, frame) - gap, DelayPath("turn", step), overheads, "between frames")
    if leave is not None:
        after = _delay(leave - gap, DelayPath("after", step), overheads, "between frames")
    return Hold(step, frame, position, part.run.frames, part.turns, turn, after)


def _delay(cycles: int, path: DelayPath, overheads: Overheads, where: str) -> Cycles:
    return _checked(cycles - overheads.of(path), where)


def _checked(cycles: int, where: str) -> Cycles:
    if cycles < 0:
        raise InputError(
            "edges-too-close",
            f"two edges are too close {where}: "
            f"the statements between them take {counted(-cycles, 'cycle')} too many",
            hint="lengthen the period, or give the servos slots that are further apart",
        )
    return Cycles(cycles)
