"""Several captures in one trace: each is judged by itself, and the time between two counts for nothing."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from servogen.edges import UNDRIVEN, EdgeTrace, Expected, ExpectedChunk, edge_chunk, join
from servogen.units import Cycles
from servogen.verify import CaptureVerdict, capture_lines, verify_capture
from servogen.verify.capture.check import joint_clock
from tests.verify import test_capture as one

GAP = 1000


@dataclass(frozen=True)
class Anew:
    """The schedule's chunks, anew for each reader."""

    def __iter__(self) -> Iterator[ExpectedChunk]:
        return iter(one.schedule().chunks)


def schedule() -> Expected:
    return replace(one.schedule(), chunks=Anew())


def in_one(parts: Sequence[EdgeTrace]) -> tuple[EdgeTrace, list[tuple[int, int]]]:
    """The captures one behind the other, and where each is."""
    chunks, pieces, now = [], [], 0
    for part in parts:
        chunk = join(part.chunks)
        chunks.append(chunk._replace(cycle=chunk.cycle + now))
        pieces.append((now, now + part.end))
        wired = np.unique(chunk.pin)
        now += part.end
        chunks.append(edge_chunk(np.full(len(wired), now), wired, np.full(len(wired), UNDRIVEN)))
        now += GAP
    return EdgeTrace(parts[0].clock, (join(chunks),), Cycles(now)), pieces


def verdict_on(
    begins_us: Sequence[float], pulses: list[one.Pulse] | None = None, ppm: float = 180.0
) -> CaptureVerdict:
    """Of captures of half a second that begin there."""
    edges = one.edges_of(one.pulses() if pulses is None else pulses)
    trace, pieces = in_one([one.capture(edges, begin, 0.5, ppm) for begin in begins_us])
    return verify_capture(schedule(), trace, pieces=pieces)


BEGINS = (-500.0, 433_333.3, 1_871_000.7, 640_000.2)
"""The last one goes back in time: nothing tells in which order the pieces were."""


def test_pieces_of_a_motion_are_proven_with_its_clock_and_no_period_across_a_seam() -> None:
    verdict = verdict_on(BEGINS)
    assert verdict.reasons == ()
    assert verdict.passed
    assert verdict.ppm == pytest.approx(180, abs=2)
    assert [piece.first_frame for piece in verdict.pieces] == [0, 22, 94 - one.LOOP, 32]
    assert all(piece.ppm == pytest.approx(180, abs=8) for piece in verdict.pieces)
    assert all(abs(channel.period.worst_us) < 1.1 for channel in verdict.channels)
    assert verdict.frames == sum(piece.frames for piece in verdict.pieces)
    assert "stitched from 4 captures" in capture_lines(verdict)[2]


def test_the_same_samples_taken_for_one_record_are_not_proven() -> None:
    trace, _ = in_one([one.capture(one.edges_of(one.pulses()), begin, 0.5) for begin in BEGINS])
    assert not verify_capture(schedule(), trace).passed


def test_numbers_are_those_of_all_pieces() -> None:
    edges = one.edges_of(one.pulses())
    each = [verify_capture(one.schedule(), one.capture(edges, begin, 0.5, 180.0)) for begin in BEGINS]
    verdict = verdict_on(BEGINS)
    for number, channel in enumerate(verdict.channels):
        assert channel.captured == sum(single.channels[number].captured for single in each)
        worst = max((single.channels[number].width.worst_us for single in each), key=abs)
        assert channel.width.worst_us == pytest.approx(worst)
    assert verdict.coverage.seen == frozenset().union(*(single.coverage.seen for single in each))
    assert verdict.duration_us == pytest.approx(2e6)


@pytest.mark.parametrize(("frame", "piece"), [(7, 1), (30, 2), (101, 3)])
def test_a_pulse_that_is_two_microseconds_too_wide_is_found_in_whatever_piece_it_is(
    frame: int, piece: int
) -> None:
    verdict = verdict_on(BEGINS[:3], one.wider(frame, 2))
    assert not verdict.passed
    assert f"(piece {piece}), RB0 (arm), frame {frame % one.LOOP}:" in verdict.reasons[0]
    assert verdict.channels[0].width.wrong == 1


@pytest.mark.parametrize(("frame", "piece"), [(7, 1), (30, 2), (101, 3)])
def test_a_missing_pulse_is_found_in_whatever_piece_it_is(frame: int, piece: int) -> None:
    verdict = verdict_on(BEGINS[:3], one.without(frame))
    assert not verdict.passed
    assert verdict.channels[0].missing == 1
    assert f"(piece {piece})" in verdict.reasons[0]


def test_a_piece_without_pulses_proves_nothing() -> None:
    edges = one.edges_of(one.pulses())
    trace, pieces = in_one([one.capture(edges, -500.0, 0.5), one.capture(edges, 10_000.0, 0.005)])
    verdict = verify_capture(schedule(), trace, pieces=pieces)
    assert verdict.reasons == ("piece 2 holds none of the schedule's pulses",)


def test_a_piece_with_another_clock_is_told() -> None:
    """Periods that are 60 ppm too long in one stretch look, by themselves, like a slower crystal."""
    edges = one.edges_of(one.pulses())
    parts = [
        one.capture(edges, begin, 1.0, ppm) for begin, ppm in ((-500.0, 0.0), (-500.0, 0.0), (-500.0, -60.0))
    ]
    trace, pieces = in_one(parts)
    verdict = verify_capture(schedule(), trace, pieces=pieces)
    assert not verdict.passed
    assert any("by piece 3 alone the chip's clock is off by -" in reason for reason in verdict.reasons)


@pytest.mark.parametrize(
    ("known", "joint"),
    [
        ([(100.0, 1.0)], (100.0, 1.0)),
        ([(100.0, 1.0), (104.0, 1.0)], (102.0, 0.5**0.5)),
        ([(100.0, 1.0), (104.0, 2.0), (None, None)], (100.8, 0.8**0.5)),  # weights of 1 and 1/4
        ([(None, None)], (None, None)),
    ],
)
def test_the_clock_of_several_captures_is_their_weighted_mean(
    known: list[tuple[float | None, float | None]], joint: tuple[float | None, float | None]
) -> None:
    verdicts = [SimpleNamespace(ppm=ppm, ppm_error=error) for ppm, error in known]
    assert joint_clock(verdicts) == pytest.approx(joint)  # type: ignore[arg-type]
