"""Judges one channel of a capture against its schedule, once phase and clock are known.

In: the channel's pulses, captured and scheduled, and the line that relates their times. Out: the channel's
statistics and each problem with its time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from servogen.edges import PINS, Expected, ExpectedChannel
from servogen.errors import Diagnostic
from servogen.verify.capture.alignment import FittedLine, Floats, PairedSignals, end_errors, partners
from servogen.verify.capture.verdict import CapturedChannel, Mismatch, Spread, Tolerances
from servogen.verify.pulses import FramedPulses
from servogen.verify.verdict import frame_words
from servogen.verify.windows import Ints


@dataclass(frozen=True, slots=True)
class TimeScale:
    """The line, and the lengths of a capture step, a sample (`quantum` steps) and a cycle."""

    line: FittedLine
    quantum: float
    step_us: float
    cycle_us: float
    end: int

    @property
    def sample_us(self) -> float:
        """Return the distance of two samples in µs of the chip's nominal clock."""
        return self.quantum / self.line.b * self.cycle_us


@dataclass(frozen=True, slots=True)
class Judged:
    channel: CapturedChannel
    mismatches: tuple[Mismatch, ...]
    frames: tuple[int, ...]
    """The first and the last frame of a pulse that is paired."""
    paired: int


@dataclass(frozen=True, slots=True)
class _Errors:
    """Errors in µs with the time (steps) and frame of each, and the tolerance."""

    noun: str
    error: Floats
    wanted: Floats
    time: Ints
    frame: Ints
    limit: float

    def spread(self) -> Spread:
        """Return the worst error, the mean, and the number of errors beyond the tolerance."""
        if not len(self.error):
            return Spread()
        worst = self.error[np.argmax(np.abs(self.error))]
        wrong = int(np.count_nonzero(np.abs(self.error) > self.limit))
        return Spread(float(worst), float(self.error.mean()), wrong)


def judge(
    signals: PairedSignals,
    scale: TimeScale,
    number: int,
    channel: ExpectedChannel,
    allowed: Tolerances,
    expected: Expected,
) -> Judged:
    """Return the channel's verdict; its glitches are counted elsewhere."""
    wanted, got = signals.scheduled[number], signals.captured[number]
    rows, matches = partners(signals, scale.line, number)
    ours, theirs = wanted.take(rows), got.take(matches)
    kinds = (
        _widths(ours, theirs, scale, allowed),
        _periods(ours, theirs, rows, matches, scale, allowed),
        _edges(ours, theirs, scale, allowed),
    )
    missing = np.setdiff1d(np.flatnonzero(_due(wanted, scale, kinds[2])), rows)
    extra = np.setdiff1d(np.arange(len(got.rise)), matches)
    width, period, edge = (kind.spread() for kind in kinds)
    problems = [
        *(problem for kind in kinds[:2] for problem in _wrong(kind, channel, scale, expected)),
        *_missing(wanted.take(missing), channel, scale, expected),
        *_extra(got.take(extra), channel, scale),
    ]
    # One wrong width tilts the line and shifts every edge, so edge errors count only without other problems.
    problems = problems or list(_wrong(kinds[2], channel, scale, expected))
    problems = problems or list(_cut(signals, number, scale, channel, allowed))
    late = kinds[2].error[: len(rows)]
    periods_us = np.diff(theirs.rise)[np.diff(ours.frame) == 1] / scale.line.b * scale.cycle_us
    return Judged(
        CapturedChannel(
            name=channel.name,
            pin=channel.pin,
            connected=True,
            scheduled=len(rows) + len(missing),
            captured=len(got.rise),
            missing=len(missing),
            extra=len(extra),
            glitches=0,
            width=width,
            period=period,
            edge=edge,
            mean_period_us=float(periods_us.mean()) if len(periods_us) else None,
            jitter_us=float(late.std()) if len(late) else 0.0,
        ),
        tuple(problems),
        (int(ours.frame[0]), int(ours.frame[-1])) if len(rows) else (),
        len(rows),
    )


def _due(
    wanted: FramedPulses, scale: TimeScale, edges: _Errors
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which scheduled pulses lie completely in the capture, at least two samples from its ends.

    If edges come too late or too early, the margin grows by that amount: a pulse there is wrong, not missing.
    """
    begin, end = scale.line.steps(wanted.rise), scale.line.steps(wanted.fall)
    wrong = float(np.abs(edges.error).max(initial=0.0)) / scale.cycle_us * scale.line.b
    margin = 2 * scale.quantum + wrong
    return np.asarray((begin > margin) & (end < scale.end - margin))


def _us(steps: Ints, scale: TimeScale) -> Floats:
    """Return captured times in µs of the chip's nominal clock."""
    return steps / scale.line.b * scale.cycle_us


def _widths(ours: FramedPulses, theirs: FramedPulses, scale: TimeScale, allowed: Tolerances) -> _Errors:
    wanted = ours.width.astype(np.float64) * scale.cycle_us
    error = _us(theirs.width, scale) - wanted
    return _Errors(
        noun="width",
        error=error,
        wanted=wanted,
        time=theirs.rise,
        frame=ours.frame,
        limit=scale.sample_us + allowed.width_us,
    )


def _periods(
    ours: FramedPulses,
    theirs: FramedPulses,
    rows: Ints,
    matches: Ints,
    scale: TimeScale,
    allowed: Tolerances,
) -> _Errors:
    follows = (np.diff(rows) == 1) & (np.diff(matches) == 1)
    wanted = np.diff(ours.rise)[follows].astype(np.float64) * scale.cycle_us
    error = _us(np.diff(theirs.rise)[follows], scale) - wanted
    limit = scale.sample_us + allowed.period_us
    return _Errors(
        noun="period",
        error=error,
        wanted=wanted,
        time=theirs.rise[1:][follows],
        frame=ours.frame[1:][follows],
        limit=limit,
    )


def _edges(ours: FramedPulses, theirs: FramedPulses, scale: TimeScale, allowed: Tolerances) -> _Errors:
    wanted = np.concatenate((ours.rise, ours.fall)).astype(np.float64)
    time = np.concatenate((theirs.rise, theirs.fall))
    error = (scale.line.cycles(time) - wanted) * scale.cycle_us
    frame = np.concatenate((ours.frame, ours.frame))
    limit = scale.sample_us + allowed.edge_us
    return _Errors(
        noun="edge", error=error, wanted=wanted * scale.cycle_us, time=time, frame=frame, limit=limit
    )


def _wrong(
    errors: _Errors, channel: ExpectedChannel, scale: TimeScale, expected: Expected
) -> Iterator[Mismatch]:
    """Yield the first error that exceeds the tolerance; the others are counted."""
    rows = np.flatnonzero(np.abs(errors.error) > errors.limit)
    if not len(rows):
        return
    row = int(rows[np.argmin(errors.time[rows])])
    error, wanted = float(errors.error[row]), float(errors.wanted[row])
    code, property_name = {
        "width": ("wrong-pulse", f"a pulse of {wanted + error:z.2f} µs where {wanted:z.2f} µs are scheduled"),
        "period": (
            "wrong-pulse",
            f"{wanted + error:z.2f} µs from the rise before where {wanted:z.2f} µs are scheduled",
        ),
        "edge": ("wrong-pulse", "an edge that is not where it is scheduled"),
    }[errors.noun]
    text = f"{property_name} ({error:+z.2f} µs, allowed ±{errors.limit:z.2f} µs)"
    yield _mismatch(float(errors.time[row]), int(errors.frame[row]), channel, scale, expected, code, text)


def _missing(
    pulses: FramedPulses, channel: ExpectedChannel, scale: TimeScale, expected: Expected
) -> Iterator[Mismatch]:
    if len(pulses.rise):
        time = float(scale.line.steps(pulses.rise[:1])[0])
        yield _mismatch(
            time, int(pulses.frame[0]), channel, scale, expected, "missing-pulse", "a pulse is missing"
        )


def _extra(pulses: FramedPulses, channel: ExpectedChannel, scale: TimeScale) -> Iterator[Mismatch]:
    if len(pulses.rise):
        width = float(_us(pulses.width[:1], scale)[0])
        time = float(pulses.rise[0]) * scale.step_us
        text = f"{PINS[channel.pin]} ({channel.name}): a pulse of {width:z.2f} µs that is not scheduled"
        yield Mismatch(
            time_us=time,
            pin=channel.pin,
            channel=channel.name,
            frame=None,
            diagnostic=Diagnostic("error", "extra-pulse", text),
        )


def _cut(
    signals: PairedSignals, number: int, scale: TimeScale, channel: ExpectedChannel, allowed: Tolerances
) -> Iterator[Mismatch]:
    """Yield the problems of the pulses that the capture's ends cut."""
    line = scale.line
    # Four standard errors of the fitted clock or, without a fit, what a crystal may be off.
    ppm = allowed.crystal_ppm if line.b_error is None else 4e6 * line.b_error / line.b
    drift_us = scale.end * scale.step_us * ppm / 1e6
    limit = (scale.sample_us + allowed.edge_us + drift_us) / scale.cycle_us
    begin = np.array([float(line.cycles(0))])
    cut, wanted = signals.cut[number], signals.scheduled[number]
    first, last = end_errors(cut, wanted, begin, line.b, scale.end)
    for error, step, edge, verb in (
        (first, 0, cut.first_fall, "ends"),
        (last, scale.end, cut.last_rise, "begins"),
    ):
        if float(error[0]) > limit:
            text = f"a pulse {verb} where none is scheduled to"
            if edge is None:
                text = (
                    "it is high where no pulse is scheduled"
                    if cut.high_throughout
                    else "a pulse that it cuts is missing"
                )
            place = "beginning" if step == 0 else "end"
            where = f"{PINS[channel.pin]} ({channel.name}), at the capture's {place}"
            time_us = (step if edge is None else edge) * scale.step_us
            diagnostic = Diagnostic("error", "wrong-pulse", f"{where}: {text}")
            yield Mismatch(
                time_us=time_us, pin=channel.pin, channel=channel.name, frame=None, diagnostic=diagnostic
            )


def _mismatch(
    time: float,
    frame: int,
    channel: ExpectedChannel,
    scale: TimeScale,
    expected: Expected,
    code: str,
    text: str,
) -> Mismatch:
    where = frame_words(frame, expected.lead_in, expected.loop)
    words = f"{PINS[channel.pin]} ({channel.name}), {where}: {text}"
    return Mismatch(
        time_us=time * scale.step_us,
        pin=channel.pin,
        channel=channel.name,
        frame=frame,
        diagnostic=Diagnostic("error", code, words),
    )
