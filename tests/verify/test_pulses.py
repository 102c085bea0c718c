"""Glitches, frames and samples: at what length, count and rate each begins."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, EdgeTrace, Expected, ExpectedChannel, edge_chunk
from servogen.errors import InputError
from servogen.units import Clock, Cycles
from servogen.verify.compare import verify
from servogen.verify.coverage import compared_frames, coverage
from servogen.verify.pulses import FramedPulses, without_glitches
from servogen.verify.sampling import TYPICAL_HZ, Sampling, rate_words, sampling
from servogen.verify.windows import Edges
from tests.verify.pulses import pulses

MHZ4 = Clock(4_000_000)
Row = tuple[int, int, int]


def edges(rows: list[Row], frames: list[int] | None = None) -> Edges:
    columns = edge_chunk(*zip(*rows, strict=True)) if rows else edge_chunk((), (), ())
    return Edges(*columns, np.array(frames or [-1] * len(rows), dtype=np.int64))


def bounds(given: FramedPulses) -> list[tuple[int, int]]:
    return list(zip(given.rise.tolist(), given.fall.tolist(), strict=True))


@pytest.mark.parametrize(
    ("seen", "scheduled", "left", "count"),
    [
        ([(0, 10), (20, 30)], [(0, 50)], [(0, 10), (20, 30)], 0),  # pulses and gaps of exactly the limit
        ([(0, 9), (20, 30)], [(0, 50)], [(20, 30)], 1),
        ([(0, 10), (19, 30)], [(0, 50)], [(0, 30)], 1),  # the gap of 9 is one: both are one pulse
        ([(0, 3), (4, 6), (8, 10)], [(0, 50)], [(0, 10)], 2),
        ([(0, 3)], [(0, 50)], [], 1),
        ([(0, 9), (20, 30)], [(0, 9)], [(0, 9), (20, 30)], 0),  # the schedule has such pulses
        ([(0, 9), (20, 30)], [(0, 10)], [(20, 30)], 1),
        ([(0, 10), (19, 30)], [(0, 50), (59, 99)], [(0, 10), (19, 30)], 0),  # and such gaps
        ([(0, 10), (19, 30)], [(0, 50), (60, 99)], [(0, 30)], 1),
        ([], [(0, 50)], [], 0),
    ],
)
def test_a_glitch_is_shorter_than_the_limit_and_than_all_that_is_scheduled(
    seen: list[tuple[int, int]],
    scheduled: list[tuple[int, int]],
    left: list[tuple[int, int]],
    count: int,
) -> None:
    found, number = without_glitches(pulses(*seen), pulses(*scheduled), 10)
    assert (bounds(found), number) == (left, count)


# A schedule of 6 frames of 100 cycles: frame 0 and 1 are of the lead-in, 2 to 5 the loop; frame 4 is quiet.
SCHEDULED = edges(
    [
        (at + edge, 5, level)
        for frame, width in enumerate((10, 10, 20, 30, 0, 20))
        if width
        for at, edge, level in ((100 * frame, 0, HIGH), (100 * frame, width, LOW))
    ],
    [0, 0, 1, 1, 2, 2, 3, 3, 5, 5],
)
LOOPED = Expected(MHZ4, Cycles(100), (ExpectedChannel("arm", 5),), 2, 4, ())


@pytest.mark.parametrize(
    ("compared", "frames"),
    [
        *((0, 0), (10, 0), (11, 1), (100, 1), (110, 1), (111, 2), (230, 3), (331, 4), (399, 4)),
        *((400, 4), (499, 4), (500, 5), (501, 5), (520, 5), (521, 6), (600, 6), (699, 6), (700, 7)),
    ],
)
def test_a_frame_was_compared_when_its_last_edge_was_or_its_time_has_passed(
    compared: int, frames: int
) -> None:
    assert compared_frames(SCHEDULED, LOOPED, compared) == range(frames)


def test_without_edges_no_frame_was_compared() -> None:
    assert compared_frames(edges([]), LOOPED, 1000) == range(0)


@pytest.mark.parametrize(
    ("frames", "seen", "lead_in", "places"),
    [
        (range(0), set(), set(), set()),
        (range(1), set(), {0}, set()),
        (range(2, 4), {2, 3}, set(), {0, 1}),
        (range(1, 3), {2}, {0}, {0}),
        (range(5, 7), {2}, set(), {0, 3}),  # frame 6 is frame 2 again
        (range(4, 20), {2, 3, 4}, set(), {0, 1, 2, 3}),
        (range(9, 10), {2}, set(), {3}),
    ],
)
def test_frames_are_seen_by_their_place_in_the_loop(
    frames: range, seen: set[int], lead_in: set[int], places: set[int]
) -> None:
    covered = coverage(SCHEDULED, LOOPED, frames)
    assert covered.different == {2, 3, 4}
    assert covered.lead_in == {0}
    assert (covered.seen, covered.lead_in_seen, covered.loop_seen) == (seen, lead_in, places)
    assert covered.loop_frames == 4
    assert not covered.once


def test_a_trace_of_zero_cycles_has_nothing_to_show() -> None:
    silent = EdgeTrace(MHZ4, (), Cycles(0))
    verdict = verify(LOOPED, silent)
    assert verdict.reasons == (
        "the trace ends at cycle 0, 1000 cycles (0.001 s) before the end of the check",  # 2 + 2·4 frames
    )
    assert verify(LOOPED, silent, Cycles(0)).passed
    short = EdgeTrace(MHZ4, (), Cycles(250))
    partly = verify(LOOPED, short, Cycles(300))
    assert not partly.passed
    assert (partly.span.asked, partly.span.compared, partly.span.frames) == (300, 250, 2)
    assert (partly.span.lead_in_frames, partly.span.loop_repeats) == (2, 0)
    longer = verify(LOOPED, EdgeTrace(MHZ4, (), Cycles(1100)), Cycles(1100)).span
    assert (longer.frames, longer.lead_in_frames, longer.loop_repeats) == (11, 2, 2)


def test_a_sample_may_be_as_long_as_the_shortest_pulse_that_counts() -> None:
    assert not Sampling(10.0, True).too_slow(10.0)
    assert not Sampling(10.0 * (1 + 1e-12), True).too_slow(10.0)
    assert Sampling(10.0 * (1 + 1e-8), True).too_slow(10.0)
    Sampling(10.0, True).check(10.0)
    with pytest.raises(InputError) as stated:
        Sampling(12.5, True).check(10.0)
    assert stated.value.message == (
        "sampled every 12.5 µs (80 kHz), too slow to show anything: at least 100 kHz is needed"
    )
    assert stated.value.hint == (
        "a sample may be no longer than 10 µs, the shortest pulse or gap that counts"
    )
    with pytest.raises(InputError) as guessed:
        Sampling(2500.0, False).check(0.5)
    assert guessed.value.message == (
        "does not state its sampling rate, and all its edges are on a grid of every 2500 µs (400 Hz): "
        "at least 2 MHz is needed"
    )
    assert guessed.value.hint == (
        "a sample may be no longer than 0.5 µs, the shortest pulse or gap that counts; "
        "if it was sampled more often, state the rate: --rate"
    )


@pytest.mark.parametrize(
    ("sample_us", "words"),
    [(0.1, "10 MHz"), (1.0, "1 MHz"), (1.25, "800 kHz"), (1000.0, "1 kHz"), (1250.0, "800 Hz")],
)
def test_a_rate_is_in_the_unit_that_keeps_it_at_one_or_more(sample_us: float, words: str) -> None:
    assert rate_words(sample_us) == words


def captured(cycles: list[int], clock: Clock = MHZ4) -> EdgeTrace:
    levels = [HIGH, LOW] * len(cycles)
    chunk = edge_chunk(cycles, [5] * len(cycles), levels[: len(cycles)])
    return EdgeTrace(clock, (chunk,), Cycles(cycles[-1] + 1))


@pytest.mark.parametrize(
    ("sample", "found"),
    [(None, (3.0, False)), (2.0, (2.0, True)), (1.0, (1.0, True)), (0.25, (1.0, True))],
)
def test_the_sample_is_what_is_stated_or_else_what_divides_every_edge(
    sample: float | None, found: tuple[float, bool]
) -> None:
    # A step of 4 MHz is 1 µs; all edges are at multiples of 3 µs, which no usual rate has.
    chosen = sampling(captured([3 * number for number in (7, 11, 12, 17, 19, 23, 29, 100)]), sample)
    assert (chosen.sample_us, chosen.stated) == found
    # At 8 MHz a step is half a microsecond.
    assert sampling(captured([21, 33, 300], Clock(8_000_000)), 2.0).sample_us == 1.0


def test_a_rate_whose_samples_are_no_whole_number_of_steps_is_recognised() -> None:
    # 96 kHz: a sample every 10.41666 µs, written in whole microseconds.
    times = [round(number * 1e6 / 96_000) for number in (7, 20, 33, 61, 115, 116, 250, 999, 1000)]
    assert sampling(captured(times), None).sample_us == pytest.approx(1e6 / 96_000)
    # One edge that is a microsecond beside its sample rules that grid out.
    beside = sorted([*times[:4], times[4] + 2, *times[5:]])
    assert sampling(captured(beside), None).sample_us < 10
    assert sampling(captured([0]), None) == Sampling(1.0, False)


def test_the_slowest_rate_that_explains_the_edges_is_found_first() -> None:
    assert all(slower < faster for slower, faster in pairwise(TYPICAL_HZ))
