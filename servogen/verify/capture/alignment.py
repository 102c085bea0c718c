"""Aligns a capture with its schedule: where it begins, the speed of the chip's clock, and the frames in it.

    captured:   t  =  a + b · s        t: time steps of the capture;  s: the schedule's time in cycles
                                       b: steps per cycle, nominal / (1 + ppm / 10⁶)

In: the pulses of each channel, captured (in steps) and scheduled (in cycles). Out: a and b. The phase is
the one at which the largest number of complete pulses matches a scheduled one in width; then a line through
all edges gives both. Where several phases fit equally well, the pulses that the ends of the capture cut
decide:

        begin                                    end
    ┌─────┊───┐          ┌───────┐          ┌─────┊───┐
    │     ┊   │          │       │          │     ┊   │
    ┘     ┊   └──────────┘       └──────────┘     ┊   └──
              first fall                    last rise
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor

import numpy as np
import numpy.typing as npt

from servogen.verify.pulses import CutPulses, FramedPulses, nearest, pair
from servogen.verify.windows import Edges, Ints

Floats = npt.NDArray[np.float64]


def end_errors(
    cut: CutPulses, wanted: FramedPulses, begin: Floats, slope: float, length: int
) -> tuple[Floats, Floats]:
    """Return the errors at the beginning and at the end, in cycles, for each time at which it may `begin`.

    `begin` is in cycles of the schedule; the capture has `length` steps, at `slope` steps per cycle.
    """
    end = begin + length / slope
    fall, rise = cut.first_fall, cut.last_rise
    first = _outside(wanted, begin, cut.high) if fall is None else _away(wanted.fall, begin + fall / slope)
    last = (
        _outside(wanted, end, cut.high_throughout)
        if rise is None
        else _away(wanted.rise, begin + rise / slope)
    )
    return first, last


def _away(edges: Ints, time: Floats) -> Floats:
    """Return how far each time is from the nearest of `edges`; infinite if there is none."""
    return np.abs(edges[nearest(time, edges)] - time) if len(edges) else np.full(len(time), np.inf)


def _outside(wanted: FramedPulses, time: Floats, high: bool) -> Floats:
    """Return how far each time is from one at which the pin is scheduled to be `high`, or to be low."""
    row = np.searchsorted(wanted.rise, time, side="right")
    fall = np.concatenate(([-np.inf], wanted.fall))[row]
    since_rise = time - np.concatenate(([-np.inf], wanted.rise))[row]
    if high:
        until_rise = np.concatenate((wanted.rise, [np.inf]))[row] - time
        return np.asarray(np.minimum(until_rise, np.maximum(time - fall, 0.0)))
    return np.asarray(np.maximum(np.minimum(since_rise, fall - time), 0.0))


ANCHORS = 3
"""The number of first pulses that are tried as one that the schedule certainly contains."""

FIRST_PULSES = 48
"""The pulses with which every phase is tried; the best ones are tried with four times as many, and so on."""

KEPT = 64
MAX_DRIFT = 0.02
"""A clock with a larger relative error is taken for a wrong period."""

MAX_SLOPE_ERROR = 20e-6
"""If the slope is less accurate, as within one frame, the nominal one is used."""

SHORT_GAP = 20.0
"""Frames between two pulses that are counted correctly even with a clock error of `MAX_DRIFT`: less than half
a frame.
"""

MAX_CELLS = 1 << 22
"""The numbers in a table of (phases, pulses) at a time: 32 MB."""


@dataclass(frozen=True, slots=True)
class FittedLine:
    """The line t = a + b·s, and the standard error of b; None if there are too few edges to determine the
    slope.
    """

    a: float
    b: float
    b_error: float | None

    def cycles(self, steps: npt.ArrayLike) -> Floats:
        """Return the schedule's cycles for times in steps of the capture."""
        return (np.asarray(steps, dtype=np.float64) - self.a) / self.b

    def steps(self, cycles: npt.ArrayLike) -> Floats:
        """Return the times in steps of the capture for the schedule's cycles."""
        return self.a + self.b * np.asarray(cycles, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class PairedSignals:
    """The same channels, captured and scheduled; `nominal` is in steps per cycle, `quantum` in steps per
    sample.
    """

    captured: tuple[FramedPulses, ...]
    scheduled: tuple[FramedPulses, ...]
    nominal: float
    quantum: float
    period: int
    cap: float
    """The maximum error of one pulse, in cycles, so that one pulse cannot outweigh all others."""
    candidates: int
    """Scheduled time, in cycles, up to which a capture may begin."""
    cut: tuple[CutPulses, ...]
    """The pulses of each channel that the capture's ends cut."""
    length: int
    """The length of the capture in steps."""


def align(signals: PairedSignals) -> FittedLine | None:
    """Return the line, or None if no captured pulse belongs to the schedule."""
    main = max(range(len(signals.captured)), key=lambda channel: len(signals.captured[channel].rise))
    # The first pulse may be a glitch that no schedule contains: then the second or the third fits.
    anchors = signals.captured[main].rise[:ANCHORS]
    slope = _slope(signals)
    best = min(
        (phase for anchor in anchors.tolist() if (phase := _phase(signals, main, anchor, slope))),
        default=None,
    )
    if best is None:
        return None
    *_, a = best
    # The first fit pairs the pulses by a slope that is only estimated, which may go wrong far from the
    # anchor. The second one pairs them by the fitted slope.
    line = _fit(signals, FittedLine(a, slope, None))
    return line and (_fit(signals, line) or line)


def partners(
    signals: PairedSignals, line: FittedLine, channel: int
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return the rows of a channel's scheduled and captured pulses that belong together."""
    times = np.rint(line.cycles(signals.captured[channel].rise)).astype(np.int64)
    return pair(signals.scheduled[channel].rise, times, signals.period // 2)


def _slope(signals: PairedSignals) -> float:
    """Return the steps per cycle from the frames between each channel's first and last pulse, weighted by
    their number.
    """
    frames = steps = 0.0
    for pulses in signals.captured:
        gaps = np.diff(pulses.rise) / (signals.nominal * signals.period)
        gaps = gaps[gaps < SHORT_GAP]
        frames += float(np.rint(gaps).sum())
        steps += float(gaps.sum())
    ratio = steps / frames if frames else 1.0
    return signals.nominal * (ratio if abs(ratio - 1) < MAX_DRIFT else 1.0)


def _phase(
    signals: PairedSignals, main: int, anchor: int, slope: float
) -> tuple[float, float, float, float] | None:
    """Return (cost, error of the cut pulses, the anchor's scheduled time, a) of the phase that fits best.

    If pulses fit equally well at several phases, as in a pause of the motion, those cut off by the ends
    decide.
    """
    rises = signals.scheduled[main].rise
    phases = rises[rises < signals.candidates].astype(np.float64)
    if not len(phases):
        return None
    total = sum(len(pulses.rise) for pulses in signals.captured)
    look = FIRST_PULSES
    while True:
        cost = _cost(signals, anchor, slope, phases, look)
        if look >= total:
            lowest = float(cost.min())
            phases = phases[cost == lowest]
            errors = _end_errors(signals, anchor, slope, phases)
            best = int(np.argmin(errors))
            return lowest, float(errors[best]), float(phases[best]), anchor - slope * float(phases[best])
        order = np.argsort(cost, kind="stable")
        near = np.count_nonzero(cost <= cost[order[0]])
        # Never fewer than all that are equally good: further pulses, or the cut ones, have to decide between
        # them.
        phases = np.sort(phases[order[: max(KEPT, int(near))]])
        look *= 4


def _end_errors(signals: PairedSignals, anchor: int, slope: float, phases: Floats) -> Floats:
    """Return, for each phase, the error in cycles of the pulses that the capture's ends cut."""
    begin = phases - anchor / slope
    total = np.zeros(len(phases))
    for cut, wanted in zip(signals.cut, signals.scheduled, strict=True):
        first, last = end_errors(cut, wanted, begin, slope, signals.length)
        total += np.minimum(first, signals.cap) + np.minimum(last, signals.cap)
    return total.round(3)


def _cost(signals: PairedSignals, anchor: int, slope: float, phases: Floats, look: int) -> Floats:
    """Return, for each phase, the error in cycles of the first `look` captured pulses of each channel."""
    # A bounded table of (phases, pulses) at a time.
    size = max(1, MAX_CELLS // look)
    parts = [
        sum(
            (
                _channel_cost(signals, channel, anchor, slope, phases[start : start + size], look)
                for channel in range(len(signals.captured))
            ),
            np.zeros(len(phases[start : start + size])),
        )
        for start in range(0, len(phases), size)
    ]
    # Rounded, so that phases that fit equally well compare equal and the earliest is taken.
    return np.concatenate(parts).round(6)


def _channel_cost(
    signals: PairedSignals, channel: int, anchor: int, slope: float, phases: Floats, look: int
) -> Floats:
    wanted, got = signals.scheduled[channel], signals.captured[channel]
    rise, width = got.rise[:look], got.width[:look]
    if not len(wanted.rise):
        return np.full(len(phases), signals.cap * len(rise))
    away = (rise - anchor) / slope
    time = phases[:, None] + away
    near = nearest(time, wanted.rise)
    sample = signals.quantum / slope
    late = np.abs(wanted.rise[near] - time)
    wrong = np.maximum(np.abs(wanted.width[near] - width / slope) - sample, 0)
    # A sample of tolerance, and more with the distance from the anchor, because the slope is only estimated.
    moved = np.maximum(late - sample - 1e-3 * np.abs(away), 0)
    fits = late < signals.period / 4
    cost = np.where(fits, np.minimum(wrong + moved, signals.cap), signals.cap).sum(axis=1)
    # A pulse that should have been captured before the last of these, but was not, is an error too.
    begin = phases - anchor / slope + signals.period / 4
    end = time[:, -1] + signals.period / 4 if len(rise) else begin
    due = np.searchsorted(wanted.rise, end) - np.searchsorted(wanted.rise, begin)
    return np.asarray(cost + signals.cap * np.maximum(due - fits.sum(axis=1), 0))


def _fit(signals: PairedSignals, line: FittedLine) -> FittedLine | None:
    """Return the line through all edges that belong together, without outliers."""
    times: list[Floats] = []
    steps: list[Ints] = []
    for channel, (wanted, got) in enumerate(zip(signals.scheduled, signals.captured, strict=True)):
        rows, seen_rows = partners(signals, line, channel)
        times += [wanted.rise[rows].astype(np.float64), wanted.fall[rows].astype(np.float64)]
        steps += [got.rise[seen_rows], got.fall[seen_rows]]
    s, t = np.concatenate(times), np.concatenate(steps).astype(np.float64)
    if not len(s):
        return None
    residual = t - line.steps(s)
    away = np.abs(residual - np.median(residual))
    good = away <= max(2 * signals.quantum, 5 * float(np.median(away)))
    return regression(s[good], t[good], signals)


def regression(s: Floats, t: Floats, signals: PairedSignals) -> FittedLine:
    middle, height = float(s.mean()), float(t.mean())
    spread = float(((s - middle) ** 2).sum())
    if len(s) > 2 and spread > 0:
        b = float(((s - middle) * (t - height)).sum()) / spread
        squares = float(((t - height - b * (s - middle)) ** 2).sum())
        # Rounding to samples alone sets a lower bound on the error.
        error = float(np.sqrt(max(squares / (len(s) - 2), signals.quantum**2 / 12) / spread))
        if error < MAX_SLOPE_ERROR * b:
            return FittedLine(height - b * middle, b, error)
    return FittedLine(height - signals.nominal * middle, signals.nominal, None)


MARGIN = 2
"""The minimum number of samples between a whole frame's edges and the ends of the capture."""


@dataclass(frozen=True, slots=True)
class WholeFrames:
    """`count` frames from `first` on, and the steps of the capture between which they can be cut out."""

    first: int
    count: int
    begin: int
    end: int

    @property
    def frames(self) -> range:
        """Return the numbers of the frames."""
        return range(self.first, self.first + self.count)


def whole_frames(
    scheduled: Edges, line: FittedLine, quantum: float, end: int, period: int
) -> WholeFrames | None:
    """Return the frames all of whose edges are in a capture of `end` steps; None if there are none.

    Frames without edges at either end are included if the capture contains their whole `period`.
    """
    frames, first, last = _extents(scheduled)
    rise, fall = line.steps(first), line.steps(last)
    rows = np.flatnonzero((rise > MARGIN * quantum) & (fall < end - MARGIN * quantum))
    if not len(rows):
        return None
    first_row, last_row = int(rows[0]), int(rows[-1])
    # A frame without edges begins at the time of the earliest edge of the other frames.
    zero = int((first - frames * period).min())
    inside = (line.cycles(np.array([0.0, float(end)])) - zero) / period
    begin_frame = max(ceil(float(inside[0])), int(frames[first_row - 1]) + 1 if first_row else 0)
    end_frame = floor(float(inside[1]))
    if last_row + 1 < len(frames):
        end_frame = min(end_frame, int(frames[last_row + 1]))
    from_frame = min(int(frames[first_row]), begin_frame)
    to_frame = max(int(frames[last_row]) + 1, end_frame)
    before = float(fall[first_row - 1]) if first_row else 0.0
    after = float(rise[last_row + 1]) if last_row + 1 < len(rise) else float(end)
    begin = line.steps(from_frame * period + zero) if from_frame < frames[first_row] else rise[first_row]
    until = line.steps(to_frame * period + zero) if to_frame > frames[last_row] + 1 else fall[last_row]
    return WholeFrames(
        from_frame,
        to_frame - from_frame,
        int((before + float(begin)) / 2) if before > 0 else 0,
        ceil((float(until) + after) / 2) if after < end else end,
    )


def _extents(scheduled: Edges) -> tuple[Ints, Ints, Ints]:
    """Return each frame that has edges, and the cycles of its first and its last."""
    order = np.argsort(scheduled.frame, kind="stable")
    frames, starts = np.unique(scheduled.frame[order], return_index=True)
    cycle = scheduled.cycle[order]
    ends = np.append(starts[1:], len(cycle)) - 1
    return frames, cycle[starts], cycle[ends]
