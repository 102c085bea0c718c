"""The pulses of a page: what was planned, simulated and captured, channel by channel, in µs of the chip.

In: a schedule and traces. Out: `Signal`s, each with its pulses as numbers for the page's viewer; and
`FrameView`s, the distinct frames that it can be sent to.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS, EdgeTrace
from servogen.job import PlannedJob
from servogen.pulse import PulseSchedule, Run
from servogen.pulses import pulses
from servogen.report.drawing import PALETTE
from servogen.verify import CaptureVerdict

Floats = npt.NDArray[np.float64]

MAX_FRAMES = 2000
"""The number of frames up to which a motion is drawn."""

MAX_VIEWS = 6
"""The number of frames that are shown, unless there are more poses."""

SAME_DIGITS = 9
"""The number of decimals of radians to which angles are compared."""

SPARE, BEFORE = 1.06, 0.04
"""How much longer than a frame's pulses the shown span is, and how much of that lies before the frame."""


@dataclass(frozen=True, slots=True)
class Signal:
    """One row: a channel on a pin as planned, simulated or captured. Times in µs, tenths at most."""

    channel: str
    pin: str
    kind: str
    colour: str
    rise: tuple[float, ...]
    width: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class FrameView:
    """A frame that the viewer can show: its first beginning in words, and the span of time around it."""

    title: str
    start_us: float
    end_us: float


def shown_us(schedule: PulseSchedule) -> float:
    """Return the time that is drawn, in µs: the lead-in and the loop once, or their beginning."""
    frames = min(MAX_FRAMES, schedule.lead_in_frames + schedule.loop_frames)
    return float(schedule.clock.us(frames * schedule.period))


def planned(schedule: PulseSchedule) -> tuple[Signal, ...]:
    """Return the schedule's own pulses; time zero is the beginning of its first frame."""
    us, runs = float(schedule.clock.cycle_us), (*schedule.lead_in, *schedule.loop)
    lengths = np.array([run.frames for run in runs])
    span = shown_us(schedule)
    signals = []
    for number, channel in enumerate(schedule.channels):
        pulses = [run.pulses[number] for run in runs]
        width = np.repeat([pulse.width if pulse else 0 for pulse in pulses], lengths)
        offset = np.repeat([pulse.rise if pulse else 0 for pulse in pulses], lengths)
        rise = np.arange(len(width)) * schedule.period + offset
        there = width > 0
        signals.append(
            _signal(channel.name, channel.pin, "planned", number, rise[there] * us, width[there] * us, span)
        )
    return tuple(signals)


def simulated(schedule: PulseSchedule, trace: EdgeTrace) -> tuple[Signal, ...]:
    """Return a program's pulses, with its first edge at the time of the schedule's first."""
    us, zero = float(schedule.clock.cycle_us), first_edge(schedule)
    trains = _pulses(trace, schedule)
    first = min((float(rise[0]) for rise, _ in trains if len(rise)), default=0.0)
    span = shown_us(schedule)
    return tuple(
        _signal(channel.name, channel.pin, "simulated", number, (rise - first + zero) * us, width * us, span)
        for number, (channel, (rise, width)) in enumerate(zip(schedule.channels, trains, strict=True))
    )


def captured(schedule: PulseSchedule, trace: EdgeTrace, verdict: CaptureVerdict) -> tuple[Signal, ...]:
    """Return captured pulses in the chip's time, at their place in the schedule if that is known."""
    chip = float(trace.clock.cycle_us) * (1 + (verdict.ppm or 0.0) / 1e6)
    trains = [(rise * chip, width * chip) for rise, width in _pulses(trace, schedule)]
    shift = _shift(schedule, trains, verdict.first_frame)
    frame_us = float(schedule.clock.us(schedule.period))
    loop, lead_in = schedule.loop_frames * frame_us, schedule.lead_in_frames * frame_us
    first = min((float(rise[0]) for rise, _ in trains if len(rise)), default=0.0)
    rows = []
    for number, (channel, (rise, width)) in enumerate(zip(schedule.channels, trains, strict=True)):
        once = rise < first + loop - frame_us / 2  # what comes around again lies on what is there already
        time, width = rise[once] + shift, width[once]
        time = np.where(time < lead_in, time, lead_in + (time - lead_in) % loop)
        rows.append(_signal(channel.name, channel.pin, "captured", number, time, width, shown_us(schedule)))
    return tuple(rows)


def first_edge(schedule: PulseSchedule) -> int:
    """Return the cycle of the schedule's first edge, from the beginning of its first frame."""
    frame = 0
    for run in (*schedule.lead_in, *schedule.loop):
        rises = [pulse.rise for pulse in run.pulses if pulse]
        if rises:
            return frame * schedule.period + min(rises)
        frame += run.frames
    return 0


def _shift(
    schedule: PulseSchedule, pulses: Sequence[tuple[Floats, Floats]], first_frame: int | None
) -> float:
    """Return the offset from the capture's time to the schedule's, µs."""
    firsts = [(float(rise[0]), number) for number, (rise, _) in enumerate(pulses) if len(rise)]
    if first_frame is None or not firsts:
        return 0.0
    seen, number = min(firsts)
    frame = first_frame
    for run in _endless(schedule):
        if frame < run.frames:
            pulse = run.pulses[number]
            cycles = first_frame * schedule.period + (pulse.rise if pulse else 0)
            return float(schedule.clock.us(cycles)) - seen
        frame -= run.frames
    return 0.0


def _endless(schedule: PulseSchedule) -> Iterator[Run]:
    yield from schedule.lead_in
    while True:
        yield from schedule.loop


def _pulses(trace: EdgeTrace, schedule: PulseSchedule) -> list[tuple[Floats, Floats]]:
    """Return (rises, widths) of each channel's whole pulses, in the trace's cycles."""
    seen = pulses(trace).whole()
    channels = [seen.of(PINS.index(channel.pin)) for channel in schedule.channels]
    return [(own.rise.astype(np.float64), own.width.astype(np.float64)) for own in channels]


def _signal(
    channel: str, pin: str, kind: str, number: int, rise: Floats, width: Floats, span: float
) -> Signal:
    order = np.argsort(rise, kind="stable")
    rise, width = np.round(rise[order], 1), np.round(width[order], 1)
    inside = rise + width <= span
    rise, width = rise[inside], width[inside]
    colour = PALETTE[number % len(PALETTE)]
    return Signal(
        channel=channel,
        pin=pin,
        kind=kind,
        colour=colour,
        rise=tuple(rise.tolist()),
        width=tuple(width.tolist()),
    )


def frames_to_show(schedule: PulseSchedule, poses: Sequence[int] = ()) -> tuple[FrameView, ...]:
    """Return the distinct frames of all `poses` (frames of the motion) and a few others, spread over it."""
    us = float(schedule.clock.cycle_us)
    seen: dict[tuple[int, ...], int] = {}
    first_alike = []
    frame = 0
    for run in (*schedule.lead_in, *schedule.loop):
        widths = tuple(pulse.width if pulse else 0 for pulse in run.pulses)
        first_alike += [seen.setdefault(widths, frame)] * run.frames
        frame += run.frames
    starts = [start for widths, start in seen.items() if any(widths)]
    chosen = {first_alike[pose] for pose in poses} & set(starts)
    others = [start for start in starts if start not in chosen]
    room = max(0, MAX_VIEWS - len(chosen))
    if len(others) > room:
        others = [others[len(others) * number // room] for number in range(room)]
    return tuple(_view(schedule, start, us) for start in sorted({*chosen, *others}))


def pose_frames(job: PlannedJob) -> tuple[int, ...]:
    """Return for each pose of a job the first frame of its motion that is nearest to it.

    A pose without pulses, and a motion whose servos never have pulses together, have none.
    """
    angles = job.trajectory.angles
    starts = []
    for pose in job.poses:
        away = np.abs(angles - np.array(pose.angles)).max(axis=1)
        if not np.isnan(away).all():
            starts.append(int(np.nanargmin(np.round(away, SAME_DIGITS))))
    return tuple(starts)


def _view(schedule: PulseSchedule, frame: int, us: float) -> FrameView:
    runs = (*schedule.lead_in, *schedule.loop)
    last = SPARE * max(pulse.rise + pulse.width for run in runs for pulse in run.pulses if pulse)
    begin = frame * float(schedule.clock.us(schedule.period))
    return FrameView(f"from {begin / 1e6:g} s", begin - BEFORE * last * us, begin + last * us)
