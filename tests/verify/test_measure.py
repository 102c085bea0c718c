"""What a HEX does on its pins is measured to the cycle, without a schedule."""

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.edges import HIGH, LOW, PINS, EdgeTrace, edge_chunk
from servogen.units import Clock, Cycles
from servogen.verify import Measurement, PinMeasurement, measure, measurement_lines
from servogen.verify import measurement as measuring
from servogen.verify.measurement import FrameKind, Pause, PulseRun

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


def test_what_never_repeats_is_cut_and_said() -> None:
    number = np.arange(140_000)
    rise = 60 * number + number**2 % 11
    cycle = np.stack((rise, rise + 10 + number % 7), axis=1).ravel()
    chunk = edge_chunk(cycle, np.full(len(cycle), RB0), np.tile([HIGH, LOW], len(number)))
    measurement = measure(EdgeTrace(MHZ4, (chunk,), Cycles(100_000_000)))
    assert not measurement.complete
    assert measurement.end < 100_000_000
    assert "stopped there" in measurement_lines(measurement)[1]


def test_other_clocks_say_cycles_and_time() -> None:
    pulses = [(frame * 100_000, 7500, RB0) for frame in range(5)]
    lines = measurement_lines(measured(pulses, 500_000, Clock(20_000_000)))
    assert "  widths: 7500 cycles (1500 µs) × 5" in lines
    assert "  periods: 100000 cycles (20 ms) × 4" in lines


def test_the_json_is_plain() -> None:
    data = json.loads(json.dumps(measured(*lab9(1)).to_json()))
    assert data["clock_hz"] == 4_000_000
    assert data["pins"][0]["pin"] == "RB0"
    assert data["pins"][0]["frame_difference_cycles"] == 150
    assert data["pins"][0]["widths"] == [{"cycles": 500, "pulses": 20}, {"cycles": 1500, "pulses": 20}]


STEPS = st.lists(st.tuples(st.integers(1, 4), st.integers(1, 4)), min_size=1, max_size=60)


@settings(derandomize=True, deadline=None, max_examples=300)
@given(steps=STEPS, window=st.integers(1, 40), tail=st.integers(0, 5))
def test_every_number_is_that_of_counting_pulse_by_pulse(
    steps: list[tuple[int, int]], window: int, tail: int
) -> None:
    now, pulses = 0, []
    for width, low in steps:
        pulses.append((now, width, RB1))
        now += width + low
    before, measuring.WINDOW = measuring.WINDOW, window
    try:
        found = pin_of(measured(pulses, now + tail), RB1)
    finally:
        measuring.WINDOW = before
    widths = [width for _, width, _ in pulses]
    periods = [b - a for (a, _, _), (b, _, _) in pairwise(pulses)]
    assert found.widths == {value: widths.count(value) for value in sorted(set(widths))}
    assert found.widths_in_order() == widths
    if periods:
        median = sorted(periods)[(len(periods) - 1) // 2]
        steady = [period for period in periods if period <= 3 * median]
        assert found.period == median
        assert found.periods == {value: steady.count(value) for value in sorted(set(steady))}
        assert sum(pause.count for pause in found.pauses) == len(periods) - len(steady)
    assert sum(run.pulses for run in found.runs) == len(pulses)


def test_years_without_an_edge_are_passed_over() -> None:
    """Pulses thirty years apart at 4 MHz, and as long again without one: the time between costs nothing."""
    years = 10**15
    found = measured([(0, 1500, RB0), (years, 1500, RB0)], 2 * years)
    assert pin_of(found, RB0).widths == {1500: 2}
    assert pin_of(found, RB0).periods == {years: 1}
    assert found.end == 2 * years
