"""Aligns a capture with its schedule: where it begins, and the speed of the chip's clock (phase and ppm).

    captured:   t  =  a + b · s        t: time steps of the capture;  s: the schedule's time in cycles
                                       b: steps a cycle, nominal / (1 + ppm / 10⁶)

In: whole pulses of each channel, captured (in steps) and scheduled (in cycles). Out: a and b. The phase is
the one at which the largest number of pulses matches a scheduled one in width; then a line\nthrough all edges
gives both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.verify.capture_ends import end_errors
from servogen.verify.pulses import CutPulses, Pulses, nearest, pair
from servogen.verify.windows import Ints

Floats = npt.NDArray[np.float64]

ANCHORS = 3
"""So many first pulses are tried as the one that is surely scheduled."""

FIRST_LOOK = 48
"""Pulses that every phase is tried with; the best ones are tried with four times as many, and so on."""

KEPT = 64
MOST_DRIFT = 0.02
"""A clock that is off by more is taken for a wrong period."""

MOST_SLOPE_ERROR = 20e-6
"""Where the slope is known no better, as within one frame, the nominal one is nearer."""

SHORT_GAP = 20.0
"""Frames between two pulses that are counted rightly even by a clock as wrong as that."""

MOST_CELLS = 1 << 22


@dataclass(frozen=True, slots=True)
class Line:
    """The line t = a + b·s, and the standard error of b; None if there are too few edges to determine the
    slope.
    """

    a: float
    b: float
    b_error: float | None

    def cycles(self, steps: npt.ArrayLike) -> Floats:
        return (np.asarray(steps, dtype=np.float64) - self.a) / self.b

    def steps(self, cycles: npt.ArrayLike) -> Floats:
        return self.a + self.b * np.asarray(cycles, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Signals:
    """The same channels, captured and scheduled; `nominal` is in steps per cycle, `quantum` in steps per
    sample.
    """

    captured: tuple[Pulses, ...]
    scheduled: tuple[Pulses, ...]
    nominal: float
    quantum: float
    period: int
    cap: float
    """In cycles: a pulse that is wrong by more counts no more, so that one cannot outweigh all others."""
    candidates: int
    """Scheduled time, in cycles, up to which a capture may begin."""
    cut: tuple[CutPulses, ...]
    """Of each channel the pulses that the capture's ends cut."""
    length: int
    """Steps of the capture."""


def align(signals: Signals) -> Line | None:
    """Return the line, or None if no captured pulse belongs to the schedule."""
    main = max(range(len(signals.captured)), key=lambda channel: len(signals.captured[channel].rise))
    anchors = signals.captured[main].rise[:ANCHORS]
    slope = _slope(signals)
    best = min(
        (found for anchor in anchors.tolist() if (found := _phase(signals, main, anchor, slope))),
        default=None,
    )
    if best is None:
        return None
    *_, a = best
    line = _fit(signals, Line(a, slope, None))
    return line and (_fit(signals, line) or line)


def partners(signals: Signals, line: Line, channel: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return the rows of a channel's scheduled and captured pulses that belong together."""
    times = np.rint(line.cycles(signals.captured[channel].rise)).astype(np.int64)
    return pair(signals.scheduled[channel].rise, times, signals.period // 2)


def _slope(signals: Signals) -> float:
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
    return signals.nominal * (ratio if abs(ratio - 1) < MOST_DRIFT else 1.0)


def _phase(
    signals: Signals, main: int, anchor: int, slope: float
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
    look = FIRST_LOOK
    while True:
        cost = _cost(signals, anchor, slope, phases, look)
        if look >= total:
            lowest = float(cost.min())
            phases = phases[cost == lowest]
            errors = _end_errors(signals, anchor, slope, phases)
            at = int(np.argmin(errors))
            return lowest, float(errors[at]), float(phases[at]), anchor - slope * float(phases[at])
        order = np.argsort(cost, kind="stable")
        near = np.count_nonzero(cost <= cost[order[0]])
        phases = np.sort(phases[order[: max(KEPT, int(near))]])
        look *= 4


def _end_errors(signals: Signals, anchor: int, slope: float, phases: Floats) -> Floats:
    """Return, for each phase, the error in cycles of the pulses that the capture's ends cut."""
    begin = phases - anchor / slope
    total = np.zeros(len(phases))
    for cut, wanted in zip(signals.cut, signals.scheduled, strict=True):
        first, last = end_errors(cut, wanted, begin, slope, signals.length)
        total += np.minimum(first, signals.cap) + np.minimum(last, signals.cap)
    return total.round(3)


def _cost(signals: Signals, anchor: int, slope: float, phases: Floats, look: int) -> Floats:
    """Return, for each phase, the error in cycles of the first `look` captured pulses of each channel."""
    size = max(1, MOST_CELLS // look)
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
    signals: Signals, channel: int, anchor: int, slope: float, phases: Floats, look: int
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
    moved = np.maximum(late - sample - 1e-3 * np.abs(away), 0)
    fits = late < signals.period / 4
    cost = np.where(fits, np.minimum(wrong + moved, signals.cap), signals.cap).sum(axis=1)
    # A pulse that should have been captured before the last of these, but was not, is an error too.
    begin = phases - anchor / slope + signals.period / 4
    end = time[:, -1] + signals.period / 4 if len(rise) else begin
    due = np.searchsorted(wanted.rise, end) - np.searchsorted(wanted.rise, begin)
    return np.asarray(cost + signals.cap * np.maximum(due - fits.sum(axis=1), 0))


def _fit(signals: Signals, line: Line) -> Line | None:
    """Return the line through all edges that belong together, without outliers."""
    times: list[Floats] = []
    steps: list[Ints] = []
    for channel, (wanted, got) in enumerate(zip(signals.scheduled, signals.captured, strict=True)):
        rows, others = partners(signals, line, channel)
        times += [wanted.rise[rows].astype(np.float64), wanted.fall[rows].astype(np.float64)]
        steps += [got.rise[others], got.fall[others]]
    s, t = np.concatenate(times), np.concatenate(steps).astype(np.float64)
    if not len(s):
        return None
    residual = t - line.steps(s)
    away = np.abs(residual - np.median(residual))
    good = away <= max(2 * signals.quantum, 5 * float(np.median(away)))
    return _regression(s[good], t[good], signals)


def _regression(s: Floats, t: Floats, signals: Signals) -> Line:
    middle, height = float(s.mean()), float(t.mean())
    spread = float(((s - middle) ** 2).sum())
    if len(s) > 2 and spread > 0:
        b = float(((s - middle) * (t - height)).sum()) / spread
        squares = float(((t - height - b * (s - middle)) ** 2).sum())
        # Rounding to samples alone sets a lower bound on the error.
        error = float(np.sqrt(max(squares / (len(s) - 2), signals.quantum**2 / 12) / spread))
        if error < MOST_SLOPE_ERROR * b:
            return Line(height - b * middle, b, error)
    return Line(height - signals.nominal * middle, signals.nominal, None)
