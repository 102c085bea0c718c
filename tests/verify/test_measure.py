"""What a HEX does on its pins is measured to the cycle, without a schedule."""

import json
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import groupby, pairwise
from random import Random

import pytest

from servogen.edges import HIGH, LOW, PINS, EdgeTrace, edge_chunk
from servogen.units import Clock, Cycles
from servogen.verify import Measurement, PinMeasurement, measure, measurement_lines
from servogen.verify import measurement as measuring
from servogen.verify.measurement import FrameKind, Pause, PulseRun
from servogen.verify.verdict import Overlap

MHZ4 = Clock(4_000_000)
RB0, RB1 = PINS.index("RB0"), PINS.index("RB1")
Pulse = tuple[int, int, int]  # rise, width, pin


def measured(pulses: list[Pulse], end: int, clock: Clock = MHZ4) -> Measurement:
    edges = [(rise, pin, HIGH) for rise, _, pin in pulses]
    edges += [(rise + width, pin, LOW) for rise, width, pin in pulses]
    inside = sorted(edge for edge in edges if edge[0] < end)
    chunks = (edge_chunk(*zip(*inside, strict=True)),) if inside else ()
    return measure(EdgeTrace(clock, chunks, Cycles(end)))


def pin_of(measurement: Measurement, pin: int) -> PinMeasurement:
    return next(found for found in measurement.pins if found.pin == pin)


def lab8(turns: int) -> tuple[list[Pulse], int]:
    """100 pulses of 1 ms with 18 ms low, 5 s, 100 of 2 ms, 5 s; over and over."""
    now, pulses = 20, []
    for _ in range(turns):
        for width in (1000, 2000):
            for _ in range(100):
                pulses.append((now, width, RB0))
                now += width + 18_000
            now += 5_000_000
    return pulses, now


def lab9(turns: int) -> tuple[list[Pulse], int]:
    """20 frames of 1500 + 1250 + 40 000 µs, 20 of 500 + 1250 + 41 150 µs."""
    now, pulses = 20, []
    for _ in range(turns):
        for width, low in ((1500, 40_000), (500, 41_150)):
            for _ in range(20):
                pulses += [(now, width, RB0), (now + width, 1250, RB1)]
                now += width + 1250 + low
    return pulses, now


def test_lab_8_is_two_kinds_of_run_with_pauses_of_five_seconds() -> None:
    found = pin_of(measured(*lab8(2)), RB0)
    assert (found.pulses, found.first) == (400, 20)
    assert found.widths == {1000: 200, 2000: 200}
    # The 100th pulse of each run is followed by the pause, the very last by nothing.
    assert found.periods == {19_000: 198, 20_000: 198}
    assert found.kinds == (FrameKind(1000, 198, 19_000), FrameKind(2000, 198, 20_000))
    assert found.frame_difference == 1000
    assert [(run.pulses, run.width, run.shortest_period, run.longest_period) for run in found.runs] == [
        (100, 1000, 19_000, 19_000),
        (100, 2000, 20_000, 20_000),
    ] * 2
    assert [pause.length for pause in found.pauses] == [5_018_000] * 3
    assert found.pauses[0].begin == 20 + 99 * 19_000 + 1000
    assert found.open_rise is None


def test_lab_9_has_two_kinds_of_frame_that_differ_by_150_us() -> None:
    measurement = measured(*lab9(3))
    vertical, horizontal = measurement.pins
    assert vertical.widths == {500: 60, 1500: 60}
    assert vertical.kinds == (FrameKind(500, 59, 42_900), FrameKind(1500, 60, 42_750))
    assert vertical.frame_difference == 150
    assert horizontal.widths == {1250: 120}
    assert horizontal.frame_difference == 0
    assert vertical.pauses == horizontal.pauses == ()
    assert measurement.overlap is None  # the second begins on the edge that ends the first
    lines = measurement_lines(measurement)
    assert (
        "  frames differ by 150 µs: 42.9 ms with pulses of 500 µs, 42.75 ms with pulses of 1500 µs" in lines
    )


def test_widths_in_order_are_one_a_pulse() -> None:
    pulses, end = lab9(1)
    widths = pin_of(measured(pulses, end), RB0).widths_in_order()
    assert widths == [width for _, width, pin in pulses if pin == RB0]


def test_a_ramp_is_a_run_for_each_width() -> None:
    pulses = [(frame * 20_000, 1000 + frame, RB0) for frame in range(50)]
    found = pin_of(measured(pulses, 10**6), RB0)
    assert found.runs[:2] == (PulseRun(0, 1, 1000, None, None), PulseRun(20_000, 1, 1001, None, None))
    assert (len(found.runs), found.periods) == (50, {20_000: 49})


def test_a_pulse_that_the_trace_cuts_off_is_not_counted_but_said() -> None:
    found = pin_of(measured([(0, 1500, RB0), (20_000, 1500, RB0), (40_000, 1500, RB0)], 41_000), RB0)
    assert (found.pulses, found.open_rise, found.periods) == (2, 40_000, {20_000: 2})


def test_single_pulses_with_equal_pauses_are_a_run_of_their_own() -> None:
    pulses = [(frame * 20_000, 1500, RB0) for frame in range(10)]
    pulses += [(10**6 * turn, 1500, RB0) for turn in range(1, 5)]
    found = pin_of(measured(pulses, 5 * 10**6), RB0)
    assert found.pauses == (Pause(181_500, 818_500), Pause(1_001_500, 998_500, 3))
    assert [(run.first, run.pulses, run.longest_period) for run in found.runs] == [
        (0, 10, 20_000),
        (10**6, 3, 10**6),
        (4 * 10**6, 1, None),
    ]


def test_two_pins_high_at_once_are_an_overlap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "WINDOW", 333)  # an overlap may lie across windows
    pulses = [(100, 1000, RB0), (1050, 1000, RB1), (5000, 1000, RB0), (5200, 300, RB1)]
    whole = measured(pulses, 9000)
    assert whole.overlap is not None
    overlap = whole.overlap
    assert (overlap.count, overlap.longest, overlap.first, overlap.pins) == (2, 300, 1050, (RB0, RB1))
    open_end = measured([(100, 10**4, RB0), (200, 10**4, RB1)], 5000).overlap
    assert open_end is not None
    assert open_end.longest == 4800


def test_a_chip_that_does_nothing_has_no_pins() -> None:
    measurement = measured([], 10**6)
    assert (measurement.pins, measurement.overlap, measurement.complete) == ((), None, True)
    assert measurement_lines(measurement)[-1] == "no pin has a pulse"


@pytest.mark.parametrize(("rows", "end"), [(49, 3000), (50, 3600), (59, 3600), (60, 4200), (1000, 6000)])
def test_what_never_repeats_is_cut_and_said(rows: int, end: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each pulse is a row of its own, counted when the next one rises: ten of them in a window."""
    monkeypatch.setattr(measuring, "MAX_ROWS", rows)
    monkeypatch.setattr(measuring, "WINDOW", 600)
    measurement = measured([(60 * number, 10 + number % 7, RB0) for number in range(101)], 6000)
    assert (measurement.end, measurement.complete) == (end, end == 6000)
    lines = measurement_lines(measurement)
    assert lines[0] == f"measured {end} cycles ({end} µs) from reset"
    stopped = "stopped there: the pulses repeat too little to be kept any longer"
    assert (lines[1] == stopped) is (end < 6000)


def test_other_clocks_say_cycles_and_time() -> None:
    pulses = [(frame * 100_000, 7500, RB0) for frame in range(5)]
    lines = measurement_lines(measured(pulses, 500_000, Clock(20_000_000)))
    assert "  widths: 7500 cycles (1500 µs) × 5" in lines
    assert "  periods: 100000 cycles (20 ms) × 4" in lines


def test_the_json_has_every_number_under_its_name() -> None:
    run, pause = PulseRun(11, 12, 13, 14, 15), Pause(16, 17, 18)
    kinds = (FrameKind(19, 20, 21), FrameKind(22, 23, 24))
    pin = PinMeasurement(RB1, 1, 2, {3: 4}, {5: 6}, 7, kinds, (pause,), (run,), 8)
    overlap = Overlap(31, 32, 33, (RB0, RB1))
    found = Measurement(Clock(8_000_000), 9, (pin,), overlap, complete=False)
    assert found.us(9) == Fraction(9, 2)
    assert json.loads(json.dumps(found.to_json())) == {
        "clock_hz": 8_000_000,
        "end_cycle": 9,
        "complete": False,
        "pins": [
            {
                "pin": "RB1",
                "pulses": 1,
                "first_cycle": 2,
                "widths": [{"cycles": 3, "pulses": 4}],
                "periods": [{"cycles": 5, "frames": 6}],
                "period_cycles": 7,
                "frame_kinds": [
                    {"width_cycles": 19, "frames": 20, "period_cycles": 21},
                    {"width_cycles": 22, "frames": 23, "period_cycles": 24},
                ],
                "frame_difference_cycles": 3,
                "pauses": [{"begin_cycle": 16, "length_cycles": 17, "count": 18}],
                "runs": [
                    {
                        "first_cycle": 11,
                        "pulses": 12,
                        "width_cycles": 13,
                        "shortest_period_cycles": 14,
                        "longest_period_cycles": 15,
                    }
                ],
                "open_rise_cycle": 8,
            }
        ],
        "overlap": overlap.to_json(),
    }
    assert replace(found, overlap=None).to_json()["overlap"] is None
    assert replace(pin, kinds=()).frame_difference == 0


@pytest.mark.parametrize(("number", "more"), [(12, ""), (13, " and 1 more"), (15, " and 3 more")])
def test_twelve_kinds_of_frame_are_listed(number: int, more: str) -> None:
    now, pulses = 0, []
    for index in range(number):
        for _ in range(2):
            pulses.append((now, 100 + index, RB0))
            now += 1000 + index
    (line,) = [
        line for line in measurement_lines(measured([*pulses, (now, 50, RB0)], now + 60)) if "differ" in line
    ]
    listed = ", ".join(f"{1000 + index} µs with pulses of {100 + index} µs" for index in range(12))
    assert line == f"  frames differ by {number - 1} µs: {listed}{more}"


def test_every_number_is_that_of_counting_pulse_by_pulse(monkeypatch: pytest.MonkeyPatch) -> None:
    random = Random(8)
    for _ in range(150):
        monkeypatch.setattr(measuring, "WINDOW", random.randint(1, 40))
        lows, widths = random.choice(((1, 2, 3, 4), (1, 4, 4, 30))), random.choice(((1, 2, 3, 4), (2, 2, 5)))
        now, pulses = 0, []
        for _ in range(random.randint(1, 40)):
            pulses.append((now, random.choice(widths), RB1))
            now += pulses[-1][1] + random.choice(lows)
        end = now + random.randint(0, 5) if random.random() < 0.7 else random.randint(6, max(7, now))
        found = measured(pulses, end)
        whole = [(rise, width) for rise, width, _ in pulses if rise + width < end]
        begun = [rise for rise, width, _ in pulses if rise < end <= rise + width]
        if whole:
            compare(pin_of(found, RB1), whole, begun[0] if begun else None)
        else:
            assert found.pins == ()


def compare(found: PinMeasurement, pulses: list[tuple[int, int]], open_rise: int | None) -> None:
    """Compare a measurement with pulses as (rise, width), counted one by one."""
    rises = [rise for rise, _ in pulses] + ([open_rise] if open_rise is not None else [])
    widths = [width for _, width in pulses]
    periods = [after - before for before, after in pairwise(rises)]
    median = sorted(periods)[(len(periods) - 1) // 2] if periods else None
    pause = [period > 3 * (median or 0) for period in periods]
    steady = [
        (width, period) for width, period, long in zip(widths, periods, pause, strict=False) if not long
    ]
    assert (found.pulses, found.first, found.open_rise) == (len(pulses), pulses[0][0], open_rise)
    assert found.widths == Counter(widths) and list(found.widths) == sorted(found.widths)
    assert found.widths_in_order() == widths
    assert found.period == median
    assert found.periods == Counter(period for _, period in steady)
    assert list(found.periods) == sorted(found.periods)
    kinds = []
    for width in sorted(set(widths)):
        own = Counter(period for each, period in steady if each == width)
        if own.total() > 1:
            kinds.append(FrameKind(width, own.total(), min(own, key=lambda period: (-own[period], period))))
    assert list(found.kinds) == kinds
    # Pulses of one width and period that follow each other have pauses of one length.
    rows = [list(row) for _, row in groupby(range(len(pulses)), lambda at: (widths[at], [*periods, -1][at]))]
    paused = [row[0] < len(pause) and pause[row[0]] for row in rows]
    assert list(found.pauses) == [
        Pause(sum(pulses[row[0]]), periods[row[0]] - widths[row[0]], len(row))
        for row, long in zip(rows, paused, strict=True)
        if long
    ]
    runs = [rows[0]]
    for before, after in pairwise(range(len(rows))):
        apart = paused[before] or (paused[after] and len(rows[after]) > 1)
        if apart or widths[rows[before][0]] != widths[rows[after][0]]:
            runs.append(rows[after])
        else:
            runs[-1] = runs[-1] + rows[after]
    for run, shown in zip(runs, found.runs, strict=True):
        inside = periods[run[0] : run[-1]]
        shortest, longest = (min(inside), max(inside)) if inside else (None, None)
        assert shown == PulseRun(rises[run[0]], len(run), widths[run[0]], shortest, longest)


def test_years_without_an_edge_are_passed_over() -> None:
    """Pulses thirty years apart at 4 MHz, and as long again without one: the time between costs nothing."""
    years = 10**15
    found = measured([(0, 1500, RB0), (years, 1500, RB0)], 2 * years)
    assert pin_of(found, RB0).widths == {1500: 2}
    assert pin_of(found, RB0).periods == {years: 1}
    assert found.end == 2 * years


@pytest.mark.parametrize(
    ("cycles", "clock", "words"),
    [
        (0, MHZ4, "0 µs"),
        (9_999, MHZ4, "9999 µs"),
        (10_000, MHZ4, "10 ms"),
        (999_999, MHZ4, "999.999 ms"),
        (1_000_000, MHZ4, "1 s"),
        (1_234_567, MHZ4, "1.234567 s"),
        (19_999, Clock(8_000_000), "9999.5 µs"),
        (20_000, Clock(8_000_000), "10 ms"),
    ],
)
def test_a_time_is_in_the_unit_that_keeps_it_short(cycles: int, clock: Clock, words: str) -> None:
    assert measuring.time_words(cycles, clock) == words
    assert measuring.both(cycles, clock) == (words if clock is MHZ4 else f"{cycles} cycles ({words})")


def test_a_gap_of_three_periods_is_not_a_pause_and_one_cycle_more_is() -> None:
    regular = [(1000 * number, 100, RB0) for number in range(6)]
    for gap, pauses in ((3000, ()), (3001, (Pause(Cycles(5100), Cycles(2901)),))):
        found = pin_of(measured([*regular, (5000 + gap, 100, RB0)], 5000 + gap + 101), RB0)
        assert found.period == 1000
        assert found.pauses == pauses
        assert found.periods == ({1000: 5} if pauses else {1000: 5, 3000: 1})
        assert len(found.runs) == 1 + len(pauses)


def test_the_lines_list_twelve_values_and_runs_and_count_the_others() -> None:
    """Widths of 100, 110, …: each comes once, but the last of all twice."""
    for number in (12, 13, 14):
        widths = [100 + 10 * index for index in range(number)]
        pulses = [(5 + 1000 * index, width, RB0) for index, width in enumerate([*widths, widths[-1]])]
        lines = measurement_lines(measured(pulses, 5 + 1000 * len(pulses)))
        end = 5 + 1000 * len(pulses)
        assert lines[:2] == [
            f"measured {end} cycles ({end / 1000:.10g} ms) from reset",
            f"RB0: {number + 1} pulses, the first at cycle 5",
        ]
        shown = [f"{width} µs × 1" for width in widths[: 11 if number > 12 else -1]]
        listed = ", ".join([*shown, f"{widths[-1]} µs × 2"])
        more = f" and {number - 12} more, from 100 µs to {widths[-1]} µs" if number > 12 else ""
        assert lines[2] == f"  widths: {listed}{more}"
        runs = [line for line in lines if line.startswith("  from cycle")]
        assert len(runs) == 12
        assert runs[1] == "  from cycle 1005: 1 pulse of 110 µs"
        tail = {12: None, 13: "  and 1 further run", 14: "  and 2 further runs"}[number]
        assert [line for line in lines if "further" in line] == ([tail] if tail else [])


def test_the_lines_say_pauses_overlaps_and_what_stays_high() -> None:
    pulses = [(1000 * number, 100, RB0) for number in range(5)] + [(9000, 100, RB0), (9050, 500, RB1)]
    lines = measurement_lines(measured(pulses, 9300))
    assert lines == [
        "measured 9300 cycles (9300 µs) from reset",
        "RB0: 6 pulses, the first at cycle 0",
        "  widths: 100 µs × 6",
        "  periods: 1000 µs × 4",
        "  pauses without pulses: 4900 µs × 1",
        "  from cycle 0: 5 pulses of 100 µs every 1000 µs",
        "  from cycle 9000: 1 pulse of 100 µs",
        "two pins are high at once 1 time, first RB0 and RB1 at cycle 9050, for at most 50 µs",
    ]
    open_line = measurement_lines(measured([*pulses, (9200, 500, RB0)], 9300))
    assert "  at the end high since cycle 9200" in open_line
    assert measurement_lines(measured([], 9300)) == [
        "measured 9300 cycles (9300 µs) from reset",
        "no pin has a pulse",
    ]


def test_frames_of_two_widths_differ_by_their_most_frequent_periods() -> None:
    now, pulses = 0, []
    for width, period in ((100, 1000), (100, 1000), (100, 900), (200, 1300), (200, 1300), (300, 1000)):
        pulses.append((now, width, RB0))
        now += period
    found = pin_of(measured([*pulses, (now, 100, RB0)], now + 200), RB0)
    assert found.kinds == (FrameKind(Cycles(100), 3, Cycles(1000)), FrameKind(Cycles(200), 2, Cycles(1300)))
    assert found.frame_difference == 300
    lines = measurement_lines(measured([*pulses, (now, 100, RB0)], now + 200))
    assert "  frames differ by 300 µs: 1000 µs with pulses of 100 µs, 1300 µs with pulses of 200 µs" in lines
    assert "  from cycle 0: 3 pulses of 100 µs every 1000 µs" in lines
