"""Pulses, pairs, glitches, overlaps and windows agree with a slow second formulation of each."""

from __future__ import annotations

from itertools import combinations, pairwise, product
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.edges import HIGH, LOW, PINS, EdgeTrace, Expected, ExpectedChannel, edge_chunk
from servogen.errors import InputError
from servogen.pulses import pulses as read_pulses
from servogen.units import Clock, Cycles
from servogen.verify.compare import verify
from servogen.verify.coverage import compared_frames, coverage
from servogen.verify.diagnose import PinHistory
from servogen.verify.pulses import (
    FramedPulses,
    OverlapCount,
    cut_pulses,
    framed_pulses,
    nearest,
    overlap,
    pair,
    together,
    without_glitches,
)
from servogen.verify.sampling import TYPICAL_HZ, Sampling, rate_words, sampling
from servogen.verify.start import StrayCount
from servogen.verify.windows import Edges, Windows
from tests.verify.pulses import pulses

MHZ4 = Clock(4_000_000)
LOWS = np.zeros(len(PINS), dtype=np.uint8)
Row = tuple[int, int, int]


def edges(rows: list[Row], frames: list[int] | None = None) -> Edges:
    columns = edge_chunk(*zip(*rows, strict=True)) if rows else edge_chunk((), (), ())
    return Edges(*columns, np.array(frames or [-1] * len(rows), dtype=np.int64))


def bounds(given: FramedPulses) -> list[tuple[int, int]]:
    return list(zip(given.rise.tolist(), given.fall.tolist(), strict=True))


def test_the_nearest_of_two_equally_near_is_the_earlier() -> None:
    among = np.array([10, 20, 30])
    for time in range(41):
        wanted = min(range(3), key=lambda row: (abs(int(among[row]) - time), row))
        assert nearest(np.array([time]), among).tolist() == [wanted], time


@pytest.mark.parametrize("farthest", [0, 3, 4])
def test_pulses_are_paired_if_each_is_the_others_nearest_and_near_enough(farthest: int) -> None:
    for one, two, three in combinations(range(0, 13, 2), 3):
        for seen in combinations(range(1, 13, 3), 2):
            scheduled = np.array([one, two, three])
            wanted = []
            for row, time in enumerate(scheduled.tolist()):
                best = min(range(2), key=lambda index: (abs(seen[index] - time), index))
                back = min(range(3), key=lambda index: (abs(int(scheduled[index]) - seen[best]), index))
                if back == row and abs(seen[best] - time) <= farthest:
                    wanted.append((row, best))
            rows, partners = pair(scheduled, np.array(seen), farthest)
            assert list(zip(rows.tolist(), partners.tolist(), strict=True)) == wanted


def test_nothing_is_paired_with_nothing() -> None:
    nothing, something = np.zeros(0, dtype=np.int64), np.array([5])
    for one, other in ((nothing, something), (something, nothing), (nothing, nothing)):
        rows, partners = pair(one, other, 9)
        assert len(rows) == len(partners) == 0


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


def test_pulses_begin_before_a_stretch_and_end_with_it() -> None:
    stretch = edges([(3, 5, LOW), (5, 6, HIGH), (9, 5, HIGH), (12, 5, LOW), (15, 5, HIGH)], [7, 7, 8, 8, 9])
    found = framed_pulses(stretch, 5, 18, open_rise=1, open_frame=6)
    assert bounds(found) == [(1, 3), (9, 12), (15, 18)]
    assert found.frame.tolist() == [6, 8, 9]
    assert found.width.tolist() == [2, 3, 3]
    assert bounds(framed_pulses(stretch, 6, 18)) == [(5, 18)]
    assert bounds(framed_pulses(stretch, 7, 18)) == []
    begun = framed_pulses(stretch, 7, 18, open_rise=2)
    assert (bounds(begun), begun.frame.tolist()) == ([(2, 18)], [-1])


@pytest.mark.parametrize(
    ("rise", "fall", "high", "cut"),
    [
        ([], [], False, (False, None, None)),
        ([], [], True, (True, None, None)),  # high throughout: neither edge is in the capture
        ([], [4], True, (True, 4, None)),
        ([6], [4], True, (True, 4, 6)),
        ([6], [4, 8], True, (True, 4, None)),
        ([6], [8], False, (False, None, None)),
        ([6], [], False, (False, None, 6)),
        ([6, 9], [8], False, (False, None, 9)),
    ],
)
def test_the_pulses_that_the_ends_of_a_capture_cut(
    rise: list[int], fall: list[int], high: bool, cut: tuple[bool, int | None, int | None]
) -> None:
    rows = [(0, 5, HIGH)] if high else []
    rows += sorted([(cycle, 5, HIGH) for cycle in rise] + [(cycle, 5, LOW) for cycle in fall])
    columns = zip(*rows, strict=True) if rows else ((), (), ())
    seen = EdgeTrace(MHZ4, (edge_chunk(*columns),), Cycles(20))
    assert tuple(cut_pulses(read_pulses(seen), 20)) == cut


USED = (0, 5, 12)
PULSES = st.lists(st.tuples(st.sampled_from(USED), st.integers(1, 6), st.integers(1, 6)), max_size=8)


def simultaneous(rows: list[Row], end: int) -> list[tuple[int, frozenset[int]]]:
    """Return, cycle by cycle, the pins that are high."""
    high: set[int] = set()
    found = []
    for cycle in range(end):
        for at, pin, level in rows:
            if at == cycle:
                (high.add if level == HIGH else high.discard)(pin)
        found.append((cycle, frozenset(high)))
    return found


def rows_of(drawn: list[tuple[int, int, int]]) -> list[Row]:
    now = dict.fromkeys(USED, 0)
    rows = []
    for pin, gap, width in drawn:
        rise = now[pin] + gap
        rows += [(rise, pin, HIGH), (rise + width, pin, LOW)]
        now[pin] = rise + width
    return sorted(rows)


def stretches(high: list[tuple[int, bool]]) -> list[tuple[int, int]]:
    found: list[tuple[int, int]] = []
    for (_, before), (cycle, now) in pairwise([(-1, False), *high]):
        if now and not before:
            found.append((cycle, 1))
        elif now:
            found[-1] = (found[-1][0], found[-1][1] + 1)
    return found


@settings(derandomize=True, deadline=None, max_examples=30)
@given(PULSES, st.integers(1, 9), st.integers(0, 3))
def test_pins_that_are_high_together_are_those_of_looking_at_every_cycle(
    drawn: list[tuple[int, int, int]], window: int, tail: int
) -> None:
    rows = rows_of(drawn)
    # The end is after the last edge: without one, nothing is high.
    end = (rows[-1][0] if rows else 0) + 1 + tail
    high = simultaneous(rows, end)
    pairs = {pair for _, pins in high for pair in combinations(sorted(pins), 2)}
    assert together(edges(rows), LOWS, np.array(USED, dtype=np.uint8)) == pairs
    counter = OverlapCount()
    for begin in range(0, end, window):
        counter.add(edges([row for row in rows if begin <= row[0] < begin + window]))
    many = stretches([(cycle, len(pins) > 1) for cycle, pins in high])
    found = counter.finish(end)
    assert (found is None) == (not many)
    if found:
        assert (found.count, found.longest) == (len(many), max(length for _, length in many))
        assert found.first == many[0][0]
        assert found.pins == min(combinations(sorted(dict(high)[many[0][0]]), 2))
    allowed = {(0, 5)}
    wrong = stretches([(cycle, bool(set(combinations(sorted(pins), 2)) - allowed)) for cycle, pins in high])
    judged = overlap(edges(rows), allowed, LOWS, np.array(USED, dtype=np.uint8), end)
    assert (judged is None) == (not wrong)
    if judged:
        assert (judged.count, judged.longest) == (len(wrong), max(length for _, length in wrong))
        assert judged.first == wrong[0][0]


def test_pins_that_were_high_before_count_and_those_that_end_open_end_with_the_trace() -> None:
    high = LOWS.copy()
    high[5] = 1
    used = np.array(USED, dtype=np.uint8)
    found = overlap(edges([(10, 12, HIGH), (14, 12, LOW), (20, 0, HIGH)]), set(), high, used, 29)
    assert found is not None
    assert (found.count, found.longest, found.first, found.pins) == (2, 9, 10, (5, 12))
    assert overlap(edges([(10, 12, HIGH)]), {(5, 12)}, high, used, 29) is None
    counter = OverlapCount()
    counter.add(edges([(1, 5, HIGH), (2, 0, HIGH)]))
    counter.add(edges([]))
    ended = counter.finish(40)
    assert ended is not None
    assert (ended.count, ended.longest, ended.first, ended.pins) == (1, 38, 2, (0, 5))


def test_windows_take_every_edge_once_in_the_order_of_cycles_and_pins() -> None:
    rows = [(0, 12, HIGH), (0, 3, HIGH), (4, 3, LOW), (4, 3, HIGH), (5, 1, HIGH), (9, 0, HIGH)]
    for sizes in product((1, 2, 6), repeat=2):
        cuts = [0, *np.cumsum(sizes).tolist(), 99]
        windows = Windows(edges(rows[begin:end]) for begin, end in pairwise(cuts))
        assert windows.first() == 0
        assert windows.ahead(5).cycle.tolist() == [0, 0, 4, 4]
        early = windows.until(5)
        assert list(zip(early.cycle.tolist(), early.pin.tolist(), strict=True)) == [
            (0, 3),
            (0, 12),
            (4, 3),
            (4, 3),
        ]
        assert early.level.tolist() == [HIGH, HIGH, LOW, HIGH]
        assert windows.first() == 5
        assert windows.until(9).cycle.tolist() == [5]
        assert windows.until(9).cycle.tolist() == []
        assert windows.until(10).cycle.tolist() == [9]
        assert windows.first() is None
        assert windows.ahead(100).cycle.tolist() == []


def test_windows_read_no_further_than_the_limit_requires() -> None:
    read = []

    def chunks() -> object:
        for cycle in (3, 5, 7, 9):
            read.append(cycle)
            yield edges([(cycle, 0, HIGH)])

    windows = Windows(chunks())  # type: ignore[arg-type]
    assert windows.until(5).cycle.tolist() == [3]
    assert read == [3, 5]
    assert windows.until(6).cycle.tolist() == [5]
    assert read == [3, 5, 7]


def test_what_is_known_of_the_windows_before_a_difference() -> None:
    """After each window, as counted edge by edge."""
    random = Random(2)
    seen = PinHistory.at_start()
    now, level = 0, [LOW] * len(PINS)
    rises, last, frames = ([0] * len(PINS) for _ in range(3))
    pairs: set[tuple[int, int]] = set()
    for window in range(30):
        rows, numbers = [], []
        for _ in range(random.randint(0, 5)):
            now += random.randint(1, 9)
            pin = random.choice((0, 5, 6, 12))
            level[pin] = LOW if level[pin] == HIGH else HIGH
            rows.append((now, pin, level[pin]))
            numbers.append(window // 3)
            if level[pin] == HIGH:
                rises[pin], last[pin], frames[pin] = rises[pin] + 1, now, window // 3
            high = [each for each in range(len(PINS)) if level[each] == HIGH]
            pairs |= set(combinations(high, 2))
        seen.add(edges(rows, numbers))
        assert (seen.rises.tolist(), seen.last_rise.tolist()) == (rises, last)
        assert (seen.last_frame.tolist(), seen.level.tolist()) == (frames, level)
        assert seen.together == pairs
        assert not numbers or seen.frame == numbers[-1]


def test_stray_edges_are_counted_from_the_first_on() -> None:
    stray = StrayCount()
    assert stray.pins() == ()
    for rows in ([(7, 3), (8, 3), (9, 1)], [(11, 3), (12, 0)]):
        cycle, pin = zip(*rows, strict=True)
        stray.add(np.array(cycle, dtype=np.int64), np.array(pin, dtype=np.uint8))
    assert [(each.pin, each.edges, each.first) for each in stray.pins()] == [(0, 1, 12), (1, 1, 9), (3, 3, 7)]


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
