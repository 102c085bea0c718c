"""`verify_capture`: checks whether captured pulses are the scheduled ones within given tolerances.

In: the schedule's edges and a capture: a trace whose cycles are the time steps of the analyser or of its
file, which may begin and end anywhere. Out: a `CaptureVerdict`. The capture differs from the schedule in
three ways that it reveals itself: where in the schedule it begins, the error of the crystal, and the sampling
grid.

    true edge       │      ╭──────
    samples     ·   ·   ·  │   ·   ·      an edge is seen at the first sample behind it,
                           ╰──▶n          so that a width is right to less than one sample

A file may hold several captures. Each is judged separately, with its own phase, because the time between two
is not known; `merge_verdicts` makes one verdict of all.

    piece 1              piece 2
    __┌┐____┌┐____┊  ?  ┊__┌┐____┌┐____┊     no period is measured across a seam
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS, UNDRIVEN, EdgeTrace, Expected, edge_chunk, join
from servogen.errors import Diagnostic, InputError
from servogen.pulses import Pulses, pulses
from servogen.units import Cycles
from servogen.verify.capture.alignment import FittedLine, PairedSignals, align, whole_frames
from servogen.verify.capture.judge import Judged, TimeScale, judge
from servogen.verify.capture.verdict import (
    CapturedChannel,
    CapturePiece,
    CaptureVerdict,
    Mismatch,
    Spread,
    Tolerances,
    with_reasons,
)
from servogen.verify.compare import whole_motion
from servogen.verify.coverage import coverage, join_coverages
from servogen.verify.pulses import (
    FramedPulses,
    Levels,
    cut_pulses,
    framed_pulses,
    overlap,
    together,
    without_glitches,
)
from servogen.verify.sampling import NOTATION_US, Sampling, sampling
from servogen.verify.start import StrayCount
from servogen.verify.verdict import StrayPin
from servogen.verify.windows import Edges, Ints, Windows, expected_edges, observed_edges

CAP_US = 50.0
"""The maximum error of one pulse in the search for the phase."""

MAX_GUESS_US = 1.0
"""A longer sample is used only if it is stated, because otherwise it may be a coincidence of the edges."""

MAX_FRAMES = 1_000_000
"""The longest capture, five hours at 50 Hz, because its scheduled edges are held in memory."""

MAX_CYCLES_RATIO = 1.03
"""The maximum ratio of a capture's cycles to those of a chip with the nominal clock."""


@dataclass(frozen=True, slots=True)
class _Setup:
    """Both sides, converted to one form."""

    expected: Expected
    allowed: Tolerances
    end: int
    step_us: float
    cycle_us: float
    connected: frozenset[int]
    level: Levels
    """The levels at the first sample."""
    captured: Edges
    scheduled: Edges
    signals: PairedSignals
    glitches: tuple[int, ...]


def verify_capture(
    expected: Expected,
    captured: EdgeTrace,
    tolerances: Tolerances | None = None,
    sample: float | None = None,
    pieces: Sequence[tuple[int, int]] = (),
) -> CaptureVerdict:
    """Compare a capture with the schedule.

    `captured.clock` is such that one of its cycles is one time step of the capture; `sample` is the number of
    steps from one sample to the next. By default it is the largest that divides the time of every edge, but
    no more than a microsecond. Levels at time 0 are initial levels, not edges; a pin without any was not
    connected. `pieces` are the beginning and end (in steps) of each of several captures in one trace, whose
    distance in time is not known: each is judged separately, and `expected.chunks` is read for each.

    Raises InputError if a sample is longer than the tolerances allow. If `sample` is not given and the edges
    are evidence of one that is longer, the capture does not agree.
    """
    allowed = tolerances or Tolerances()
    captured = captured.without(expected.others).stored()
    sampled = sampling(captured, sample)
    if sampled.stated:
        sampled.check(allowed.glitch_us)
    if pieces:
        verdicts = [_verdict(expected, piece, allowed, sampled) for piece in split(captured, pieces)]
        step_us = float(captured.clock.cycle_us)
        verdict = merge_verdicts(verdicts, [begin * step_us for begin, _ in pieces])
    else:
        verdict = with_reasons(_verdict(expected, captured, allowed, sampled))
    if sampled.too_slow(allowed.glitch_us) and not _exact(verdict, float(captured.clock.cycle_us)):
        verdict = verdict.but(sampled.words(allowed.glitch_us))
    return replace(verdict, plan_error=expected.plan_error)


def _exact(verdict: CaptureVerdict, step_us: float) -> bool:
    """Return whether every captured edge is where it is scheduled, to a time step that may be a sample's."""
    worst = max((abs(channel.edge.worst_us) for channel in verdict.channels), default=0.0)
    return verdict.agrees and step_us > NOTATION_US and worst <= step_us * (1 + 1e-6)


def _verdict(
    expected: Expected, captured: EdgeTrace, allowed: Tolerances, sampled: Sampling
) -> CaptureVerdict:
    """Return the verdict on one continuous capture."""
    setup = set_up(expected, captured, allowed, sampled)
    line = align(setup.signals)
    if line is None:
        return _facts(setup, None, {})
    scale = TimeScale(
        line=line,
        quantum=setup.signals.quantum,
        step_us=setup.step_us,
        cycle_us=setup.cycle_us,
        end=setup.end,
    )
    judged = {
        number: judge(setup.signals, scale, number, channel, setup.allowed, expected)
        for number, channel in enumerate(expected.channels)
        if channel.pin in setup.connected
    }
    return _facts(setup, line, judged)


def set_up(expected: Expected, captured: EdgeTrace, allowed: Tolerances, sampled: Sampling) -> _Setup:
    end = int(captured.end)
    step_us, cycle_us = float(captured.clock.cycle_us), float(expected.clock.cycle_us)
    nominal = cycle_us / step_us
    level, changes, connected = _changes(captured)
    longest_us = sampled.sample_us if sampled.stated else min(sampled.sample_us, MAX_GUESS_US)
    quantum = max(1.0, longest_us / step_us)
    reach = int(end / nominal * MAX_CYCLES_RATIO)
    frames = reach // expected.period
    if frames > MAX_FRAMES:
        raise InputError(
            "file-too-large",
            f"the capture is {frames} frames of the schedule long: at most {MAX_FRAMES} are compared",
            hint="cut it, or capture for a shorter time",
        )
    candidates = whole_motion(expected, 2)
    # A capture may begin anywhere in the lead-in and two loops, and is followed for its whole length from
    # there.
    scheduled = Windows(expected_edges(chunk) for chunk in expected.chunks).until(candidates + reach)
    found = pulses(captured)
    ours, theirs, cut, glitches = [], [], [], []
    for channel in expected.channels:
        wanted = framed_pulses(scheduled, channel.pin, candidates + reach)
        in_steps = FramedPulses(
            _whole_cycles(wanted.rise * nominal), _whole_cycles(wanted.fall * nominal), wanted.frame
        )
        mine = found.of(channel.pin)
        seen, number = without_glitches(_whole(mine), in_steps, int(allowed.glitch_us / step_us))
        ours.append(wanted)
        theirs.append(seen)
        cut.append(cut_pulses(mine, end))
        glitches.append(number)
    signals = PairedSignals(
        captured=tuple(theirs),
        scheduled=tuple(ours),
        nominal=nominal,
        quantum=quantum,
        period=int(expected.period),
        cap=CAP_US / cycle_us,
        candidates=int(candidates),
        cut=tuple(cut),
        length=end,
    )
    return _Setup(
        expected=expected,
        allowed=allowed,
        end=end,
        step_us=step_us,
        cycle_us=cycle_us,
        connected=connected,
        level=level,
        captured=changes,
        scheduled=scheduled,
        signals=signals,
        glitches=tuple(glitches),
    )


def _whole_cycles(values: npt.ArrayLike) -> Ints:
    return np.rint(values).astype(np.int64)


def _changes(captured: EdgeTrace) -> tuple[Levels, Edges, frozenset[int]]:
    """Return the levels at time 0, the changes after it, and the pins that were connected."""
    stored = captured.stored()
    connected = frozenset(np.unique(join(stored.chunks).pin).tolist())
    driven = observed_edges(join(stored.driven()), 0)
    first = int(np.searchsorted(driven.cycle, 1))
    level: Levels = np.zeros(16, dtype=np.uint8)
    level[driven.pin[:first]] = driven.level[:first]
    return level, driven.take(slice(first, None)), connected


def _whole(seen: Pulses) -> FramedPulses:
    """Return the complete pulses, whose frames are not known yet."""
    whole = seen.whole()
    return FramedPulses(whole.rise, whole.fall, np.full(len(whole.rise), -1, dtype=np.int64))


def _facts(setup: _Setup, line: FittedLine | None, judged: Mapping[int, Judged]) -> CaptureVerdict:
    """Return all findings; `with_reasons` adds the reasons why the capture does not agree."""
    mismatches = [mismatch for channel in judged.values() for mismatch in channel.mismatches]
    ppm, ppm_error = _clock(setup, line)
    frames = [frame for channel in judged.values() for frame in channel.frames]
    whole = None
    if line is not None:
        whole = whole_frames(
            setup.scheduled, line, setup.signals.quantum, setup.end, int(setup.expected.period)
        )
    stray = _stray(setup)
    for pin in stray:
        text = f"{PINS[pin.pin]} changes, which the schedule does not drive"
        diagnostic = Diagnostic("error", "stray-edge", text)
        mismatches.append(
            Mismatch(
                time_us=pin.first * setup.step_us, pin=pin.pin, channel="", frame=None, diagnostic=diagnostic
            )
        )
    return CaptureVerdict(
        passed=False,
        reasons=(),
        tolerances=setup.allowed,
        sample_us=setup.signals.quantum * setup.step_us,
        duration_us=setup.end * setup.step_us,
        ppm=ppm,
        ppm_error=ppm_error,
        first_frame=min(frames) if frames else None,
        frames=max(frames) - min(frames) + 1 if frames else 0,
        channels=tuple(_channel(setup, number, judged.get(number)) for number in range(len(setup.glitches))),
        first_mismatch=min(mismatches, key=lambda mismatch: (mismatch.time_us, mismatch.pin), default=None),
        stray=stray,
        overlap_us=_overlap_us(setup, line),
        paired=sum(channel.paired for channel in judged.values()),
        whole=whole,
        line=line,
        coverage=coverage(setup.scheduled, setup.expected, whole.frames if whole else range(0)),
    )


def _channel(setup: _Setup, number: int, judged: Judged | None) -> CapturedChannel:
    """Return the judged channel or, without a phase, what is known of it; with its glitches."""
    channel = setup.expected.channels[number]
    glitches = setup.glitches[number]
    if judged is not None:
        return replace(judged.channel, glitches=glitches)
    captured = len(setup.signals.captured[number].rise)
    connected = channel.pin in setup.connected
    return CapturedChannel(channel.name, channel.pin, connected, captured=captured, glitches=glitches)


def _clock(setup: _Setup, line: FittedLine | None) -> tuple[float | None, float | None]:
    """Return the crystal's error in ppm and its standard error; a faster chip needs fewer steps per cycle."""
    if line is None or line.b_error is None:
        return None, None
    return (setup.signals.nominal / line.b - 1) * 1e6, line.b_error / line.b * 1e6


def _overlap_us(setup: _Setup, line: FittedLine | None) -> float:
    """Return how long pins are high together that never are in the schedule; 0 if a sample may account for
    it.
    """
    pins = np.array([channel.pin for channel in setup.expected.channels], dtype=np.uint8)
    allowed = together(setup.scheduled, np.zeros(16, dtype=np.uint8), pins)
    overlapping = overlap(setup.captured, allowed, setup.level, pins, setup.end)
    if overlapping is None or line is None:
        return 0.0
    longest = overlapping.longest * setup.step_us
    return longest if longest > setup.signals.quantum * setup.step_us + setup.allowed.width_us else 0.0


def _stray(setup: _Setup) -> tuple[StrayPin, ...]:
    pins = [channel.pin for channel in setup.expected.channels]
    unscheduled = ~np.isin(setup.captured.pin, pins)
    stray = StrayCount()
    stray.add(setup.captured.cycle[unscheduled], setup.captured.pin[unscheduled])
    return stray.pins()


def split(captured: EdgeTrace, pieces: Sequence[tuple[int, int]]) -> Iterator[EdgeTrace]:
    """Yield a trace of each piece, whose time 0 is the beginning of the piece."""
    edges = join(captured.chunks)
    for begin, end in pieces:
        at_begin = int(np.searchsorted(edges.cycle, begin, side="right"))
        until = int(np.searchsorted(edges.cycle, end))
        level = dict(zip(edges.pin[:at_begin].tolist(), edges.level[:at_begin].tolist(), strict=True))
        rows = [(0, pin, value) for pin, value in level.items() if value != UNDRIVEN]
        inside = zip(
            (edges.cycle[at_begin:until] - begin).tolist(),
            edges.pin[at_begin:until].tolist(),
            edges.level[at_begin:until].tolist(),
            strict=True,
        )
        rows += inside
        columns = zip(*rows, strict=True) if rows else ((), (), ())
        yield EdgeTrace(captured.clock, (edge_chunk(*columns),), Cycles(end - begin))


def merge_verdicts(verdicts: Sequence[CaptureVerdict], begins_us: Sequence[float]) -> CaptureVerdict:
    """Return the verdict on all pieces, from the verdict on each and its beginning."""
    ppm, ppm_error = joint_clock(verdicts)
    mismatches = [
        replace(verdict.first_mismatch, time_us=verdict.first_mismatch.time_us + begin)
        for verdict, begin in zip(verdicts, begins_us, strict=True)
        if verdict.first_mismatch
    ]
    pieces = tuple(
        CapturePiece(
            begin_us=begin,
            duration_us=verdict.duration_us,
            first_frame=verdict.first_frame,
            frames=verdict.frames,
            ppm=verdict.ppm,
            ppm_error=verdict.ppm_error,
            paired=verdict.paired,
        )
        for verdict, begin in zip(verdicts, begins_us, strict=True)
    )
    return with_reasons(
        replace(
            verdicts[0],
            sample_us=max(verdict.sample_us for verdict in verdicts),
            duration_us=sum(verdict.duration_us for verdict in verdicts),
            ppm=ppm,
            ppm_error=ppm_error,
            first_frame=None,
            frames=sum(verdict.frames for verdict in verdicts),
            channels=tuple(
                _joint_channel(verdict)
                for verdict in zip(*(verdict.channels for verdict in verdicts), strict=True)
            ),
            first_mismatch=mismatches[0] if mismatches else None,
            stray=_joint_stray(verdicts),
            overlap_us=max(verdict.overlap_us for verdict in verdicts),
            paired=sum(verdict.paired for verdict in verdicts),
            whole=verdicts[0].whole if len(verdicts) == 1 else None,
            line=verdicts[0].line if len(verdicts) == 1 else None,
            coverage=join_coverages(verdict.coverage for verdict in verdicts),
            pieces=pieces,
        )
    )


def joint_clock(verdicts: Iterable[CaptureVerdict]) -> tuple[float | None, float | None]:
    """Return the mean of the clock errors, weighted by their standard errors."""
    known = [
        (verdict.ppm, verdict.ppm_error)
        for verdict in verdicts
        if verdict.ppm is not None and verdict.ppm_error
    ]
    if not known:
        return None, None
    total = sum(1 / error**2 for _, error in known)
    return sum(ppm / error**2 for ppm, error in known) / total, sqrt(1 / total)


def _joint_channel(parts: Sequence[CapturedChannel]) -> CapturedChannel:
    """Return one channel over all pieces: counts are sums, means are weighted by the number of pulses."""
    pulses = [part.captured for part in parts]
    periods = [(part.mean_period_us, part.captured) for part in parts if part.mean_period_us is not None]
    return replace(
        parts[0],
        connected=all(part.connected for part in parts),
        scheduled=sum(part.scheduled for part in parts),
        captured=sum(pulses),
        missing=sum(part.missing for part in parts),
        extra=sum(part.extra for part in parts),
        glitches=sum(part.glitches for part in parts),
        width=_joint_spread([part.width for part in parts], pulses),
        period=_joint_spread([part.period for part in parts], pulses),
        edge=_joint_spread([part.edge for part in parts], pulses),
        mean_period_us=_mean(periods) if periods else None,
        jitter_us=sqrt(_mean([(part.jitter_us**2, part.captured) for part in parts])),
    )


def _joint_spread(parts: Sequence[Spread], pulses: Sequence[int]) -> Spread:
    worst = max((part.worst_us for part in parts), key=abs)
    mean = _mean([(part.mean_us, number) for part, number in zip(parts, pulses, strict=True)])
    return Spread(worst, mean, sum(part.wrong for part in parts))


def _mean(values: Iterable[tuple[float, int]]) -> float:
    pairs = list(values)
    return sum(value * weight for value, weight in pairs) / max(1, sum(weight for _, weight in pairs))


def _joint_stray(verdicts: Iterable[CaptureVerdict]) -> tuple[StrayPin, ...]:
    counts: dict[int, StrayPin] = {}
    for verdict in verdicts:
        for stray in verdict.stray:
            known = counts.get(stray.pin)
            counts[stray.pin] = replace(known, edges=known.edges + stray.edges) if known else stray
    return tuple(counts[pin] for pin in sorted(counts))
