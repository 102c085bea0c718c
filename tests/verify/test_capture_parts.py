"""Captures in parts: how they are cut apart and put together, and the line through their edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from servogen.edges import PINS, EdgeTrace, edge_chunk
from servogen.errors import Diagnostic
from servogen.units import Clock, Cycles
from servogen.verify.capture.alignment import FittedLine, PairedSignals, align
from servogen.verify.capture.check import merged, split
from servogen.verify.capture.verdict import CapturedChannel, CaptureVerdict, Mismatch, Spread, Tolerances
from servogen.verify.coverage import Coverage
from servogen.verify.pulses import CutPulses, FramedPulses
from servogen.verify.verdict import StrayPin

RB0, RB1 = PINS.index("RB0"), PINS.index("RB1")
HZ = Clock(4_000_000)
Row = tuple[int, int, int]


def rows(trace: EdgeTrace) -> list[Row]:
    return [row for chunk in trace.chunks for row in zip(*(column.tolist() for column in chunk), strict=True)]


def test_a_piece_has_the_levels_at_its_beginning_and_the_edges_before_its_end() -> None:
    edges = [(0, RB0, 0), (0, RB1, 1), (10, RB0, 1), (20, RB1, 2), (30, RB0, 0), (40, RB1, 1)]
    trace = EdgeTrace(HZ, (edge_chunk(*zip(*edges, strict=True)),), Cycles(50))
    found = list(split(trace, [(0, 10), (10, 30), (15, 41), (20, 20), (25, 31)]))
    assert [int(piece.end) for piece in found] == [10, 20, 26, 0, 6]
    assert [sorted(rows(piece)) for piece in found] == [
        [(0, RB0, 0), (0, RB1, 1)],
        [(0, RB0, 1), (0, RB1, 1), (10, RB1, 2)],
        [(0, RB0, 1), (0, RB1, 1), (5, RB1, 2), (15, RB0, 0), (25, RB1, 1)],
        [(0, RB0, 1)],
        [(0, RB0, 1), (5, RB0, 0)],
    ]
    (nothing,) = split(EdgeTrace(HZ, (edge_chunk((), (), ()),), Cycles(50)), [(1, 5)])
    assert rows(nothing) == []


def verdict(**changes: object) -> CaptureVerdict:
    given = CaptureVerdict(
        passed=True,
        reasons=(),
        tolerances=Tolerances(),
        sample_us=0.5,
        duration_us=1000.0,
        ppm=100.0,
        ppm_error=1.0,
        first_frame=3,
        frames=4,
        channels=(),
        paired=5,
        coverage=Coverage(frozenset({0, 1}), frozenset({0}), loop_frames=2),
    )
    return replace(given, **changes)  # type: ignore[arg-type]


def channel(pulses: int, **changes: object) -> CapturedChannel:
    return replace(CapturedChannel("arm", RB0, True, captured=pulses), **changes)  # type: ignore[arg-type]


def test_counts_of_pieces_are_added_and_means_weighted_by_their_pulses() -> None:
    one = channel(
        10,
        scheduled=11,
        missing=1,
        extra=2,
        glitches=3,
        width=Spread(-2.0, 1.0, 4),
        period=Spread(1.0, 0.5, 1),
        edge=Spread(0.25, 0.125, 0),
        mean_period_us=20_000.0,
        jitter_us=3.0,
    )
    two = channel(
        30,
        scheduled=32,
        missing=2,
        extra=3,
        glitches=4,
        width=Spread(1.5, 2.0, 5),
        period=Spread(-3.0, -0.5, 2),
        edge=Spread(-0.5, 0.25, 6),
        mean_period_us=20_004.0,
        jitter_us=1.0,
    )
    found = merged([verdict(channels=(one,)), verdict(channels=(two,))], [0.0, 5000.0])
    (joint,) = found.channels
    assert (joint.scheduled, joint.captured, joint.missing, joint.extra, joint.glitches) == (43, 40, 3, 5, 7)
    assert joint.width == Spread(-2.0, 1.75, 9)
    assert joint.period == Spread(-3.0, -0.25, 3)
    assert joint.edge == Spread(-0.5, 0.21875, 6)
    assert joint.mean_period_us == pytest.approx(20_003)
    assert joint.jitter_us == pytest.approx(((9 * 10 + 30) / 40) ** 0.5)
    assert joint.connected
    apart = merged([verdict(channels=(one,)), verdict(channels=(replace(two, connected=False),))], [0.0, 1.0])
    assert not apart.channels[0].connected
    silent = channel(0)
    still = merged([verdict(channels=(silent,)), verdict(channels=(silent,))], [0.0, 1.0]).channels[0]
    assert (still.mean_period_us, still.jitter_us, still.width) == (None, 0.0, Spread())
    single = channel(1, width=Spread(2.0, 2.0, 1), mean_period_us=20_000.0)
    alone = merged([verdict(channels=(single,)), verdict(channels=(silent,))], [0.0, 1.0]).channels[0]
    assert (alone.mean_period_us, alone.width) == (20_000.0, Spread(2.0, 2.0, 1))


def test_the_verdict_on_all_pieces_has_their_sums_and_the_first_mismatch_in_the_file() -> None:
    wrong = Mismatch(20.0, RB0, "arm", 7, Diagnostic("error", "wrong-pulse", "wrong"))
    seen = Coverage(frozenset({0, 1}), frozenset({1}), loop_frames=2)
    parts = [
        verdict(stray=(StrayPin(RB1, 2, Cycles(9)),)),
        verdict(
            sample_us=0.25,
            duration_us=3000.0,
            ppm=104.0,
            first_frame=9,
            first_mismatch=wrong,
            stray=(StrayPin(RB1, 3, Cycles(1)), StrayPin(0, 1, Cycles(4))),
            overlap_us=7.0,
            coverage=seen,
        ),
    ]
    found = merged(parts, [0.0, 5000.0])
    assert (found.sample_us, found.duration_us, found.frames, found.paired) == (0.5, 4000.0, 8, 10)
    assert (found.ppm, found.first_frame, found.overlap_us) == (pytest.approx(102), None, 7.0)
    assert found.first_mismatch == replace(wrong, time_us=5020.0)
    assert [(stray.pin, stray.edges) for stray in found.stray] == [(0, 1), (RB1, 5)]
    assert found.coverage.complete
    assert [(each.begin_us, each.duration_us, each.first_frame, each.ppm) for each in found.pieces] == [
        (0.0, 1000.0, 3, 100.0),
        (5000.0, 3000.0, 9, 104.0),
    ]
    assert not found.passed
    line = FittedLine(1.0, 2.0, None)
    assert merged([verdict(line=line)], [0.0]).line == line
    assert merged([verdict(line=line)] * 2, [0.0, 9.0]).line is None


def pulses(*bounds: tuple[float, float]) -> FramedPulses:
    rise, fall = (np.array([round(each[side]) for each in bounds], dtype=np.int64) for side in (0, 1))
    return FramedPulses(rise, fall, np.arange(len(bounds), dtype=np.int64))


SCHEDULED = [(20_000 * frame, 20_000 * frame + 1000 + 10 * (frame * frame % 41)) for frame in range(40)]


def signals(captured: list[tuple[float, float]], nominal: float) -> PairedSignals:
    return PairedSignals(
        captured=(pulses(*captured),),
        scheduled=(pulses(*SCHEDULED),),
        nominal=nominal,
        quantum=1.0,
        period=20_000,
        cap=50.0,
        candidates=40 * 20_000,
        cut=(CutPulses(False, None, None),),
        length=round(captured[-1][1]) + 9000,
    )


@pytest.mark.parametrize("nominal", [1.0, 8.0])
@pytest.mark.parametrize("ratio", [1.0, 1.0001, 0.9997, 1.015])
@pytest.mark.parametrize("first", [0, 5, 12])
def test_a_capture_is_aligned_wherever_it_begins_and_however_fast_the_chip_is(
    nominal: float, ratio: float, first: int
) -> None:
    """The line of the captured edges, which are rounded to steps, is that from which they were made."""
    a, b = 777.0 - nominal * ratio * SCHEDULED[first][0], nominal * ratio
    captured = [(a + b * rise, a + b * fall) for rise, fall in SCHEDULED[first : first + 20]]
    line = align(signals(captured, nominal))
    assert line is not None
    assert line.b == pytest.approx(b, rel=2e-6)
    assert line.a + line.b * SCHEDULED[first][0] == pytest.approx(777, abs=1)
    assert line.b_error is not None
    # Rounding alone: a twelfth of a step squared, over the spread of the forty times.
    times = np.array(SCHEDULED[first : first + 20]).ravel().astype(float)
    bound = (1 / 12 / ((times - times.mean()) ** 2).sum()) ** 0.5
    assert bound <= line.b_error * (1 + 1e-9) < 3 * bound


def test_one_pulse_does_not_measure_the_clock() -> None:
    line = align(signals([(500.0, 1500.0)], 1.0))
    assert line is not None
    assert (line.b, line.b_error) == (1.0, None)
    assert align(replace(signals([(500.0, 1500.0)], 1.0), candidates=0)) is None
    slow = [(500 + 1.05 * rise, 500 + 1.05 * rise + fall - rise) for rise, fall in SCHEDULED]
    far = align(signals(slow, 1.0))
    assert far is None or far.b != pytest.approx(1.05, rel=1e-4), "a wrong period is not a slow clock"


def test_of_phases_that_fit_equally_well_the_earliest_is_taken() -> None:
    same = [(20_000 * frame, 20_000 * frame + 1000 + 100 * (frame % 7)) for frame in range(40)]
    seen = signals([(777 + rise, 777 + fall) for rise, fall in same[:5]], 1.0)
    line = align(replace(seen, scheduled=(pulses(*same),)))
    assert line is not None
    assert line.a == pytest.approx(777, abs=1)
