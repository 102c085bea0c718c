"""Diagnoses a stretch of edges that differs from the schedule.

In: the scheduled and the observed edges of the stretch, in cycles of the schedule, and what was seen before
it, which was as scheduled. Out: the first difference, each channel's pulses compared, overlaps, stray pins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PINS, Expected, ExpectedChannel
from servogen.units import Cycles
from servogen.verify.pulses import FramedPulses, framed_pulses, overlap, pair, together, without_glitches
from servogen.verify.start import StrayCount
from servogen.verify.verdict import ChannelVerdict, Difference, Overlap, StrayPin, Worst
from servogen.verify.windows import Edges, Ints

ALL_PINS = np.arange(len(PINS), dtype=np.uint8)


@dataclass(slots=True)
class PinHistory:
    """The state after the windows that were as scheduled, by pin: rises, the last rise, and the level."""

    rises: Ints
    last_rise: Ints
    last_frame: Ints
    level: npt.NDArray[np.uint8]
    together: set[tuple[int, int]]
    """Pairs of pins that were high together."""
    frame: int = 0

    @classmethod
    def at_start(cls) -> PinHistory:
        """Return the state before the first edge: all pins are low."""
        rises, last_rise, last_frame = np.zeros((3, len(PINS)), dtype=np.int64)
        return cls(rises, last_rise, last_frame, np.zeros(len(PINS), dtype=np.uint8), set())

    def add(self, edges: Edges) -> None:
        """Update the state with `edges`; if a pin has several, NumPy's assignment keeps the last."""
        if not len(edges.cycle):
            return
        self.together |= together(edges, self.level, ALL_PINS)
        rising = edges.level == HIGH
        pins = edges.pin[rising]
        self.rises += np.bincount(pins, minlength=len(PINS))
        self.last_rise[pins] = edges.cycle[rising]
        self.last_frame[pins] = edges.frame[rising]
        self.level[edges.pin] = edges.level
        self.frame = int(edges.frame[-1])


@dataclass(frozen=True, slots=True)
class TraceStretch:
    """Edges from `begin` to `end` in times of the schedule, whose time zero is cycle `start` of the trace."""

    scheduled: Edges
    observed: Edges
    begin: int
    end: int
    start: int
    seen: PinHistory

    def cycle(self, time: int) -> Cycles:
        """Return the trace's cycle at a time of the schedule."""
        return Cycles(self.start + int(time))


@dataclass(frozen=True, slots=True)
class Diagnosis:
    difference: Difference
    channels: tuple[ChannelVerdict, ...]
    overlap: Overlap | None
    stray: tuple[StrayPin, ...]


def diagnose(stretch: TraceStretch, expected: Expected, glitch: int) -> Diagnosis:
    """Return everything that is wrong in `stretch`; pulses of fewer than `glitch` cycles are glitches."""
    pins = np.array([channel.pin for channel in expected.channels], dtype=np.uint8)
    unscheduled = ~np.isin(stretch.observed.pin, pins)
    stray = StrayCount()
    stray.add(stretch.observed.cycle[unscheduled] + stretch.start, stretch.observed.pin[unscheduled])
    level = stretch.seen.level
    allowed = stretch.seen.together | together(stretch.scheduled, level, pins)
    overlapping = overlap(stretch.observed, allowed, level, pins, stretch.end)
    return Diagnosis(
        first_difference(stretch, expected),
        tuple(_channel(stretch, channel, expected.period, glitch) for channel in expected.channels),
        overlapping
        and Overlap(
            overlapping.count, overlapping.longest, stretch.cycle(overlapping.first), overlapping.pins
        ),
        stray.pins(),
    )


def first_difference(stretch: TraceStretch, expected: Expected) -> Difference:
    """Return the first edge present on one side only, with its counterpart: the next edge of the same pin on
    the other side.
    """
    ours, theirs = stretch.scheduled, stretch.observed
    size = min(len(ours.cycle), len(theirs.cycle))
    unlike = (
        (ours.cycle[:size] != theirs.cycle[:size])
        | (ours.pin[:size] != theirs.pin[:size])
        | (ours.level[:size] != theirs.level[:size])
    )
    index = int(np.argmax(unlike)) if unlike.any() else size
    heads = [
        (int(side.cycle[index]), int(side.pin[index])) for side in (ours, theirs) if len(side.cycle) > index
    ]
    time, pin = min(heads)
    wanted, got = (_next_edge(side, pin, index) for side in (ours, theirs))
    side, row = (ours, wanted) if wanted is not None else (theirs, got)
    frame = _frame_at(stretch, index) if wanted is None else int(ours.frame[wanted])
    # The counterpart is that far away only where the edge itself is the one too many: then the frame around
    # it counts.
    if wanted is not None and int(ours.cycle[wanted]) - time > expected.period // 2:
        frame = _frame_at(stretch, index)
    names = {channel.pin: channel.name for channel in expected.channels}
    return Difference(
        pin=pin,
        channel=names.get(pin),
        frame=frame if pin in names else None,
        level=int(side.level[row]),
        expected=None if wanted is None else stretch.cycle(ours.cycle[wanted]),
        observed=None if got is None else stretch.cycle(theirs.cycle[got]),
    )


def _next_edge(side: Edges, pin: int, index: int) -> int | None:
    rows = np.flatnonzero(side.pin[index:] == pin)
    return index + int(rows[0]) if len(rows) else None


def _frame_at(stretch: TraceStretch, index: int) -> int:
    """Return the frame of the last scheduled edge before row `index`."""
    return int(stretch.scheduled.frame[index - 1]) if index else stretch.seen.frame


def _channel(stretch: TraceStretch, channel: ExpectedChannel, period: int, glitch: int) -> ChannelVerdict:
    """Return the verdict on a channel, whose pulses are paired by their rises and compared."""
    seen, pin = stretch.seen, channel.pin
    opened = int(seen.last_rise[pin]) if seen.level[pin] else None
    frame = int(seen.last_frame[pin])
    wanted = framed_pulses(stretch.scheduled, pin, stretch.end, opened, frame)
    got = framed_pulses(stretch.observed, pin, stretch.end, opened, frame)
    before = int(seen.rises[pin]) - (opened is not None)
    whole, glitches = without_glitches(got, wanted, glitch)
    rows, partners = pair(wanted.rise, whole.rise, period // 2)
    ours, theirs = wanted.take(rows), whole.take(partners)
    return ChannelVerdict(
        name=channel.name,
        pin=pin,
        scheduled=before + len(wanted.rise),
        observed=before + len(got.rise),
        missing=len(wanted.rise) - len(rows),
        extra=len(whole.rise) - len(rows),
        glitches=glitches,
        width=_worst(stretch, theirs.width - ours.width, ours.frame, theirs.rise),
        period=_worst_period(stretch, ours, theirs, rows, pin, opened is None and before > 0),
        edge=_worst_edge(stretch, ours, theirs),
    )


def _worst_period(
    stretch: TraceStretch, ours: FramedPulses, theirs: FramedPulses, rows: Ints, pin: int, known: bool
) -> Worst:
    """Return the worst error from rise to next rise; the pulse before the stretch, if `known`, is as
    scheduled.
    """
    our_rise, their_rise, frame, row = ours.rise, theirs.rise, ours.frame, rows
    if known:
        last = stretch.seen.last_rise[pin : pin + 1]
        our_rise, their_rise = np.concatenate((last, our_rise)), np.concatenate((last, their_rise))
        frame = np.concatenate((stretch.seen.last_frame[pin : pin + 1], frame))
        row = np.concatenate(([-1], row))
    follows = np.diff(row) == 1
    error = (np.diff(their_rise) - np.diff(our_rise))[follows]
    return _worst(stretch, error, frame[1:][follows], their_rise[1:][follows])


def _worst_edge(stretch: TraceStretch, ours: FramedPulses, theirs: FramedPulses) -> Worst:
    error = np.concatenate((theirs.rise - ours.rise, theirs.fall - ours.fall))
    return _worst(
        stretch, error, np.concatenate((ours.frame, ours.frame)), np.concatenate((theirs.rise, theirs.fall))
    )


def _worst(stretch: TraceStretch, error: Ints, frame: Ints, time: Ints) -> Worst:
    wrong = int(np.count_nonzero(error))
    if not wrong:
        return Worst()
    row = int(np.argmax(np.abs(error)))
    return Worst(int(error[row]), wrong, int(frame[row]), stretch.cycle(time[row]))
