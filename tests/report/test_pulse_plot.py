"""A picture of pulses shows what the trace has: channels, distinct frames, pulses that overlap."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, EdgeChunk, EdgeTrace
from servogen.errors import InputError
from servogen.pulse import Channel, Pulse, PulseSchedule, Run
from servogen.report import pulse_plot as pulse_plot_module
from servogen.report.drawing import PALETTE
from servogen.report.pulse_plot import (
    MAX_FRAMES_SHOWN,
    PlottedFrame,
    PlottedPulses,
    distinct_frames,
    observed_pulses,
    pulse_figure,
    pulse_plot,
)
from servogen.units import Clock, Cycles
from tests.report.legible import check_legible

CLOCK = Clock(8_000_000)  # a cycle is half a microsecond


def trace(*pulses: tuple[str, int, int], end: int = 100_000) -> EdgeTrace:
    """(pin, rise, width) in cycles; both pins are driven low at cycle 10."""
    rows = [(10, PINS.index(pin), LOW) for pin in dict.fromkeys(pulse[0] for pulse in pulses)]
    for pin, rise, width in pulses:
        rows += [(rise, PINS.index(pin), HIGH), (rise + width, PINS.index(pin), LOW)]
    cycle, pin_, level = np.array(sorted(rows)).T
    chunk = EdgeChunk(cycle.astype(np.int64), pin_.astype(np.uint8), level.astype(np.uint8))
    return EdgeTrace(CLOCK, (chunk,), Cycles(end))


def channel(*pulses: tuple[float, float]) -> PlottedPulses:
    rise, width = np.array(pulses, dtype=float).T
    return PlottedPulses("x", "C0", rise, width)


def test_without_a_schedule_every_pin_that_pulses_is_a_channel() -> None:
    found = observed_pulses(trace(("RB1", 300, 40), ("RA2", 200, 20)), 10_000, None)
    assert [each.label for each in found] == ["RA2", "RB1"]
    assert [(each.rise.tolist(), each.width.tolist()) for each in found] == [([0], [10]), ([50], [20])]


def test_a_pulse_that_the_trace_or_the_span_cuts_off_is_not_drawn() -> None:
    edges = trace(("RB0", 100, 20), ("RB0", 300, 20), ("RB0", 500, 20))
    (found,) = observed_pulses(edges.until(510), 10_000, None)
    assert found.rise.tolist() == [0, 100]
    (found,) = observed_pulses(edges, 150, None)
    assert found.rise.tolist() == [0]


def test_each_set_of_widths_is_shown_once() -> None:
    frames = distinct_frames([channel((0, 1), (20, 1), (40, 2), (60, 1))], np.array([0.0, 20, 40, 60]), 20)
    assert frames == [PlottedFrame(0, 20), PlottedFrame(40, 60)]


def test_of_many_frames_the_first_and_the_last_are_shown_and_some_between() -> None:
    many = channel(*((20.0 * number, 1.0 + number) for number in range(101)))
    frames = distinct_frames([many], many.rise, 20)
    assert [frame.start for frame in frames] == [0, 400, 800, 1200, 1600, 2000]
    assert len(frames) == MAX_FRAMES_SHOWN


def test_a_trace_without_pulses_is_no_picture(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no pulses to draw"):
        pulse_plot(trace(("RB0", 10, 5)).until(12), 100, tmp_path / "p.png", "none")
    assert not list(tmp_path.iterdir())


def test_below_the_widths_there_is_one_panel_for_each_distinct_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(pulse_plot_module, "save", lambda figure, path: figures.append(figure))
    found = trace(("RB1", 300, 2000), ("RB1", 40_300, 3000), ("RB1", 80_300, 2000))
    pulse_plot(found, 100_000, Path("a.png"), "two widths")
    widths, *frames = figures[0].axes
    assert len(frames) == 2
    assert widths.get_ylabel() == "pulse width, µs"
    assert [text.get_text() for axes in frames for text in axes.texts] == ["1000 µs", "1500 µs"]
    assert [axes.get_xlabel() for axes in frames] == ["", "time in the frame, ms"]


def figure_of(*pulses: tuple[str, int, int], schedule: PulseSchedule | None = None) -> Any:
    return pulse_figure(trace(*pulses), 100_000, "title", schedule)


def test_only_whole_pulses_that_rise_after_the_first_edge_are_read() -> None:
    """RB0 is high at first, so that its fall belongs to no pulse; RB1 rises in the last cycle of the span."""
    rows = [(0, 0, HIGH), (100, 0, LOW), (100, 1, LOW), (200, 0, HIGH), (240, 0, LOW)]
    rows += [(500, 1, HIGH), (520, 1, LOW)]
    numbers = [PINS.index("RB0"), PINS.index("RB1")]
    cycle, pin, level = np.array([(at, numbers[pin], level) for at, pin, level in rows]).T
    chunk = EdgeChunk(cycle.astype(np.int64), pin.astype(np.uint8), level.astype(np.uint8))
    edges = EdgeTrace(CLOCK, (chunk,), Cycles(1000))
    first, second = observed_pulses(edges, 501, None)
    assert (first.rise.tolist(), first.width.tolist()) == ([100], [20])
    assert (second.rise.tolist(), second.width.tolist()) == ([250], [10])
    assert [each.label for each in observed_pulses(edges, 500, None)] == ["RB0"]
    assert observed_pulses(edges.until(0), 500, None) == []


def test_a_schedule_names_its_channels_even_without_pulses() -> None:
    """In the schedule's order, with the pin beside a name that is not the pin's; colours as on the page."""
    channels = (Channel("arm", "RB1", ""), Channel("RB0", "RB0", ""), Channel("hand", "RA0", ""))
    run = Run(1, (Pulse(Cycles(0), Cycles(1)), None, None))
    schedule = PulseSchedule(CLOCK, Cycles(40_000), channels, (), (run,))
    found = observed_pulses(trace(("RB0", 300, 40), ("RB1", 200, 20)), 10_000, schedule)
    assert [each.label for each in found] == ["arm (RB1)", "RB0", "hand (RA0)"]
    assert [each.colour for each in found] == list(PALETTE[:3])
    assert [each.rise.tolist() for each in found] == [[0], [50], []]
    free = observed_pulses(trace(("RB1", 300, 40), ("RA2", 200, 20)), 10_000, None)
    assert [each.colour for each in free] == list(PALETTE[:2])


@pytest.mark.parametrize(
    ("start", "end", "found"),
    [
        (0, 10, (0, 1)),
        (0.5, 10, None),
        (0.5, 10.001, (10, 2)),
        (10, 11, (10, 2)),
        (10.5, 99, None),
        (-5, 0, None),
    ],
)
def test_the_first_pulse_of_a_time_begins_in_it(
    start: float, end: float, found: tuple[float, float] | None
) -> None:
    assert channel((0, 1), (10, 2)).within(start, end) == found


def test_a_frame_ends_with_its_period_or_with_the_next_frame() -> None:
    """Frames at 0, 15 and 40 with a period of 20: the first is cut short, the second is not stretched."""
    pulses = [channel((0, 1), (15, 2), (40, 3))]
    frames = distinct_frames(pulses, np.array([0.0, 15, 40]), 20)
    assert frames == [PlottedFrame(0, 15), PlottedFrame(15, 35), PlottedFrame(40, 60)]
    six = channel(*((20.0 * number, 1.0 + number) for number in range(6)))
    assert len(distinct_frames([six], six.rise, 20)) == 6
    seven = channel(*((20.0 * number, 1.0 + number) for number in range(7)))
    shown = [frame.start / 20 for frame in distinct_frames([seven], seven.rise, 20)]
    assert shown == [0, 1, 2, 4, 5, 6]  # sixths of 6 × 0, 1/5 … 1: 1.2, 2.4, 3.6, 4.8


def test_widths_are_alike_within_half_a_nanosecond_and_a_missing_pulse_is_not() -> None:
    alike = channel((0, 1), (20, 1.0004), (40, 1.0006), (80, 1))
    frames = distinct_frames([alike], np.array([0.0, 20, 40, 60, 80]), 20)
    assert [frame.start for frame in frames] == [0, 40, 60]


def test_all_frames_have_the_time_of_the_longest_and_rows_for_overlapping_pulses() -> None:
    """Two channels overlap in both frames; the longest frame ends after 2 ms, 4 % are free on either side."""
    found = figure_of(
        *(("RB0", 300, 2000), ("RB1", 1300, 2000), ("RB0", 40_300, 2000), ("RB1", 41_300, 3000)),
    )
    widths, one, two = found.axes
    assert tuple(found.get_size_inches()) == pytest.approx((9, 3.0 + 2 * (0.45 + 0.3 * 2)))
    assert found.get_suptitle() == "title"
    assert widths.get_gridspec().get_height_ratios() == pytest.approx([2.6, 1.05, 1.05])
    for axes in (one, two):
        assert axes.get_xlim() == pytest.approx((-0.08, 2.08))
        assert axes.get_ylim() == pytest.approx((-0.15 - 1.4, 1.25))
        assert len(axes.get_yticks()) == 0
        label = axes.yaxis.label
        assert (label.get_rotation(), label.get_ha(), label.get_va()) == (0, "right", "center")
    assert [axes.get_ylabel() for axes in (one, two)] == ["0 s", "0.02 s"]
    assert [axes.xaxis.get_tick_params()["labelbottom"] for axes in (one, two)] == [False, True]
    assert [axes.get_xlabel() for axes in found.axes] == ["time, s", "", "time in the frame, ms"]


def test_the_rows_of_a_frame_have_a_line_at_low_level_and_numbers_in_the_pulses() -> None:
    _, axes = figure_of(("RB0", 300, 2000), ("RB1", 1300, 2001)).axes
    *ground, first, second = axes.lines
    assert sorted(line.get_ydata()[0] for line in ground) == pytest.approx([-1.4, 0])
    for line in ground:
        assert line.get_zorder() < first.get_zorder()
        assert line.get_ydata()[0] == line.get_ydata()[1]
    assert [line.get_color() for line in (first, second)] == list(PALETTE[:2])
    assert [text.get_text() for text in axes.texts] == ["1000 µs", "1000.5 µs"]
    assert [text.get_position()[1] for text in axes.texts] == pytest.approx([0.45, 0.45 - 1.4])
    assert [text.get_position()[0] for text in axes.texts] == pytest.approx([0.5, 0.5 + 0.50025])
    assert first.get_xdata() == pytest.approx([0, 0, 1, 1])
    assert first.get_ydata() == pytest.approx([0, 1, 1, 0])
    assert second.get_xdata() == pytest.approx([0.5, 0.5, 1.5005, 1.5005])
    assert second.get_ydata() == pytest.approx([-1.4, -0.4, -0.4, -1.4])
    for text in axes.texts:
        assert (text.get_ha(), text.get_va()) == ("center", "center")


def test_the_legend_stands_above_the_widths_in_at_most_four_columns() -> None:
    figure = figure_of(*((f"RB{number}", 300, 2000) for number in range(6)))
    check_legible(figure)
    widths = figure.axes[0]
    legend = widths.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == [f"RB{number}" for number in range(6)]
    places = [text.get_window_extent() for text in legend.get_texts()]
    assert legend.get_window_extent().y0 >= widths.bbox.y1 - 1
    assert len({round(place.x0) for place in places}) == 4
    assert {line.get_drawstyle() for line in widths.lines} == {"steps-post"}
    assert widths.xaxis.get_gridlines()[0].get_visible()


def test_a_picture_without_a_schedule_takes_the_period_of_its_pulses_and_one_with_it_its_own() -> None:
    """20 ms apart, in a schedule of 40 ms: every second pulse begins no frame."""
    pulses = [("RB0", 300 + 40_000 * number, 2000 + 20 * (number % 2)) for number in range(2)]
    channels = (Channel("arm", "RB0", ""),)
    run = Run(1, (Pulse(Cycles(0), Cycles(2000)),))
    slow = PulseSchedule(CLOCK, Cycles(80_000), channels, (), (run,))
    assert [axes.get_ylabel() for axes in figure_of(*pulses).axes[1:]] == ["0 s", "0.02 s"]
    assert [axes.get_ylabel() for axes in figure_of(*pulses, schedule=slow).axes[1:]] == ["0 s"]


def test_a_picture_is_refused_before_anything_is_drawn(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'\.txt' is not a picture that can be written"):
        pulse_plot(trace(("RB0", 10, 5)).until(12), 100, tmp_path / "p.txt", "none")


def test_an_axis_of_widths_shows_whole_numbers() -> None:
    """No offset and no power of ten beside the axis: 1,500,000 µs stay readable."""
    widths = figure_of(("RB0", 300, 90_000)).axes[0]
    formatter = widths.yaxis.get_major_formatter()
    formatter.set_locs([1_500_000, 1_500_001])
    assert (formatter.get_offset(), formatter.get_useOffset()) == ("", False)
