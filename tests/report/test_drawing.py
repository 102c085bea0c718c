"""Charts as numbers: axes, ticks, paths and the places of labels, against geometry."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from servogen.edges import PINS
from servogen.report.drawing import (
    PALETTE,
    Axis,
    Chart,
    dots_path,
    nice,
    path_chart,
    points_path,
    px,
    steps_path,
    time_chart,
)
from tests.report.svg_paths import numbers


def places(path: str) -> np.ndarray:
    return np.array(numbers(path)).reshape(-1, 2)


def test_there_is_a_colour_for_each_pin() -> None:
    assert len(set(PALETTE)) == len(PALETTE) == len(PINS)
    assert all(re.fullmatch(r"#[0-9a-f]{6}", colour) for colour in PALETTE)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (-0.04, "0"),
        (0.04, "0"),
        (0.1, "0.1"),
        (12.0, "12"),
        (12.25, "12.2"),
        (12.26, "12.3"),
        (-3.5, "-3.5"),
        (100.0, "100"),
    ],
)
def test_a_coordinate_has_one_decimal_at_most(value: float, text: str) -> None:
    assert px(value) == text


@pytest.mark.parametrize("power", range(-4, 5))
@pytest.mark.parametrize("share", [1.0, 1.3, 2.0, 2.01, 4.99, 5.0, 5.01, 9.99])
def test_a_step_is_the_smallest_round_number_that_is_not_less(power: int, share: float) -> None:
    """Of all 1, 2, 5 × 10ⁿ; what differs by rounding only is equal."""
    step = share * 10.0**power
    steps = [factor * 10.0**n for n in range(-6, 8) for factor in (1, 2, 5)]
    assert nice(step) == pytest.approx(min(each for each in steps if each > step * (1 - 1e-12)), rel=1e-12)


def test_steps_of_nothing_are_one() -> None:
    assert [nice(0.0), nice(-2.0)] == [1.0, 1.0]
    assert nice(0.3 - 0.1) == pytest.approx(0.2)  # 0.19999999999999998
    assert nice(1.1 + 2.2 - 1.3) == pytest.approx(2)  # 2.0000000000000004
    assert nice(math.nextafter(1, 2)) == pytest.approx(1)


@pytest.mark.parametrize(
    ("low", "high", "count"),
    [(0, 1, 10), (0.1, 0.7, 6), (-0.3, 0.3, 6), (-17.5, 12.5, 6), (3, 1000, 12), (-2, -1, 4), (0.2, 5.8, 3)],
)
def test_ticks_are_all_multiples_of_their_step_on_the_axis(low: float, high: float, count: int) -> None:
    """Counted in whole steps, so that one at an end is not lost to rounding."""
    axis = Axis(low, high, 50, 850)
    ticks = axis.ticks(count)
    step = nice((high - low) / count)
    wanted = [n * step for n in range(-2000, 2000) if low - 1e-6 * step <= n * step <= high + 1e-6 * step]
    assert [float(tick.label) for tick in ticks] == pytest.approx(wanted, abs=1e-9)
    assert len(ticks) <= count + 1
    pixels = [50 + 800 * (value - low) / (high - low) for value in wanted]
    assert [float(tick.at) for tick in ticks] == pytest.approx(pixels, abs=0.051)


def test_the_ends_of_an_axis_have_ticks_even_if_rounding_moves_them() -> None:
    """0.1 × 3 is more than 0.3, and 0.3 / 0.1 less than 3."""
    assert [tick.label for tick in Axis(0.1 * 3, 0.9, 0, 100).ticks(6)] == [f"0.{n}" for n in range(3, 10)]
    assert [tick.label for tick in Axis(-0.1 * 3, 0.1 * 3, 0, 100).ticks(6)][::6] == ["-0.3", "0.3"]
    assert [tick.label for tick in Axis(0.0, 0.3, 0, 100).ticks(3)] == ["0", "0.1", "0.2", "0.3"]


@pytest.fixture(scope="module")
def chart() -> Chart:
    """Three frames of half a second; two servos, of which one has no pulse in the second frame."""
    columns = np.array([[10.0, 110.0], [20.0, np.nan], [30.0, 60.0]])
    return time_chart(np.array([0, 0.5, 1.0, 1.5]), columns, ["a", "b"], "angle", 0.5)


def test_the_area_of_a_chart_leaves_room_for_its_labels(chart: Chart) -> None:
    """58 pixels at the left, 12 at the right, 10 above, 34 below of 960 by 220."""
    assert (chart.width, chart.height) == ("960", "220")
    assert chart.frame == ("58", "10", "890", "176")
    assert chart.middle == ("503", "98")  # 58 + 890 / 2, 10 + 176 / 2
    assert (chart.x_label, chart.y_label) == ("time, s", "angle")
    low = time_chart(np.array([0.0, 1]), np.array([[1.0]]), ["a"], "angle", None, height=144)
    assert (low.height, low.frame, low.middle, low.mark) == (
        "144",
        ("58", "10", "890", "100"),
        ("503", "60"),
        None,
    )


def test_a_chart_over_time_has_each_value_at_its_pixel(chart: Chart) -> None:
    """The values from 10 to 110 have 6 % of their range free below and above them."""

    def x(seconds: float) -> float:
        return 58 + 890 * seconds / 1.5

    def y(value: float) -> float:
        return 186 - 176 * (value - 4) / 112

    a, b = chart.lines
    steps = [x(0), y(10), x(0.5), y(20), x(1), y(30), x(1.5)]
    assert numbers(a.path) == pytest.approx(steps, abs=0.051)
    assert re.sub(r"[\d.]+", "", a.path) == "M HVHVH"
    gap = [x(0), y(110), x(0.5), x(1), y(60), x(1.5)]
    assert numbers(b.path) == pytest.approx(gap, abs=0.051)
    assert re.sub(r"[\d.]+", "", b.path) == "M HM H"
    assert [(each.label, each.colour, each.kind) for each in chart.lines] == [
        ("a", PALETTE[0], "line"),
        ("b", PALETTE[1], "line"),
    ]
    assert chart.mark is not None
    assert float(chart.mark) == pytest.approx(x(0.5), abs=0.051)
    assert [tick.label for tick in chart.x_ticks] == ["0", "0.2", "0.4", "0.6", "0.8", "1", "1.2", "1.4"]
    assert [tick.label for tick in chart.y_ticks] == ["20", "40", "60", "80", "100"]
    assert [float(tick.at) for tick in chart.y_ticks] == pytest.approx(
        [y(value) for value in range(20, 101, 20)], abs=0.051
    )


def test_a_chart_has_no_more_ticks_than_it_has_room_for() -> None:
    """About twelve over time and six beside it, whatever the range."""
    for end in (0.9, 1, 1.19, 1.21, 2.4, 5.9, 6.1, 60):
        chart = time_chart(np.array([0, end]), np.array([[0.0]]), ["a"], "y", None)
        assert 4 <= len(chart.x_ticks) <= 13, end
        wide = time_chart(np.array([0.0, 1, 2]), np.array([[0.0], [end]]), ["a"], "y", None)
        assert 2 <= len(wide.y_ticks) <= 7, end
    twelve = time_chart(np.array([0.0, 12]), np.array([[0.0]]), ["a"], "y", None)
    assert len(twelve.x_ticks) == 13
    more = time_chart(np.array([0.0, 12.5]), np.array([[0.0]]), ["a"], "y", None)
    assert [tick.label for tick in more.x_ticks] == ["0", "2", "4", "6", "8", "10", "12"]
    wider = time_chart(np.array([0.0, 1, 2]), np.array([[0.0], [6.5 / 1.12]]), ["a"], "y", None)
    assert [tick.label for tick in wider.y_ticks] == ["0", "2", "4", "6"]
    six = time_chart(np.array([0.0, 1, 2]), np.array([[0.0], [6 / 1.12]]), ["a"], "y", None)
    assert len(six.y_ticks) == 6  # of six steps of 1 from -0.32 to 5.68: 0 to 5


def test_the_fourteenth_line_has_the_first_colour_again() -> None:
    chart = time_chart(np.array([0.0, 1]), np.zeros((1, 14)), [str(n) for n in range(14)], "y", None)
    assert [line.colour for line in chart.lines] == [*PALETTE, PALETTE[0]]
    point = np.zeros((2, 2))
    paths = path_chart([(str(n), point, point) for n in range(14)], "x", "y")
    assert [line.colour for line in paths.lines[::2]] == [*PALETTE, PALETTE[0]]
    assert [line.colour for line in paths.lines[1::2]] == [*PALETTE, PALETTE[0]]


def test_paths_have_planned_lines_and_dots_where_they_were_made() -> None:
    """100 by 50 mm; with 6 % around each the wider way is 400 pixels: 400 / 112 a millimetre."""
    planned = np.array([[0.0, 0], [100, 0], [100, 50], [0, 0]])
    made = planned[:3] + np.array([1.0, 2.0])
    chart = path_chart([("foot", planned[:, :2], planned[:, :2]), ("other", planned, made)], "x, mm", "y, mm")
    first, dots, second, others = chart.lines
    assert (first.label, first.kind, dots.label, dots.kind) == ("foot", "line", "", "dots")
    assert (second.label, others.label, others.kind) == ("other", "", "dots")
    assert first.colour == dots.colour == PALETTE[0]
    assert second.colour == others.colour == PALETTE[1]
    low_x, low_y = -0.06 * 101, -0.06 * 52  # made reaches 101 and 52
    scale = 400 / (1.12 * 101)
    height = 1.12 * 52 * scale

    def pixels(points: np.ndarray) -> np.ndarray:
        return np.column_stack(
            [58 + scale * (points[:, 0] - low_x), 10 + height - scale * (points[:, 1] - low_y)]
        )

    assert places(first.path) == pytest.approx(pixels(planned), abs=0.051)
    assert np.delete(np.array(numbers(others.path)).reshape(-1, 3), 2, 1) == pytest.approx(
        pixels(made), abs=0.051
    )
    assert (float(chart.width), float(chart.height)) == pytest.approx((470, 10 + height + 34), abs=0.051)
    assert [float(each) for each in chart.frame] == pytest.approx((58, 10, 400, height), abs=0.051)
    assert [float(each) for each in chart.middle] == pytest.approx((258, 10 + height / 2), abs=0.051)
    assert (chart.x_label, chart.y_label, chart.mark) == ("x, mm", "y, mm", None)
    assert [tick.label for tick in chart.x_ticks] == ["0", "50", "100"]  # five: one per 70 pixels
    assert [tick.label for tick in chart.y_ticks] == ["0", "20", "40"]  # five: one per 40 pixels


@pytest.mark.parametrize("across", [0, 1])
def test_a_narrow_path_has_ninety_pixels_and_is_in_their_middle(across: int) -> None:
    """A line of 100 mm, 1 mm wide: the scale is that of its length."""
    points = np.zeros((2, 2))
    points[1, 1 - across], points[1, across] = 100, 1
    chart = path_chart([("a", points, points)], "x", "y")
    area = [float(each) for each in chart.frame]
    assert area[2 + across] == 90
    assert area[3 - across] == 400
    middle = places(chart.lines[0].path).mean(axis=0)
    assert middle == pytest.approx([area[0] + area[2] / 2, area[1] + area[3] / 2], abs=0.11)
    lengths = np.abs(np.diff(places(chart.lines[0].path), axis=0))[0]
    assert lengths[1 - across] == pytest.approx(400 / 1.12, abs=0.11)
    assert lengths[across] == pytest.approx(4 / 1.12, abs=0.11)


def test_a_small_chart_has_ticks_for_at_least_two_and_three_steps() -> None:
    """90 pixels have room for one label of 70 and two of 40, which would be too few to read a scale."""
    point = np.array([[0.0, 0.0], [0.0, 0.0]])
    chart = path_chart([("a", point, point)], "x", "y", largest=90.0)
    assert chart.frame[2:] == ("90", "90")
    assert [tick.label for tick in chart.x_ticks] == ["-1", "0", "1"]
    assert [tick.label for tick in chart.y_ticks] == ["-1", "0", "1"]


def test_a_step_that_goes_on_is_one_command() -> None:
    times = np.array([0.0, 1, 2, 3, 4, 5])
    assert steps_path(times, np.array([5.0, 5, 5, 6, 6])) == "M0 5H3V6H5"
    assert steps_path(times, np.array([np.nan, 5, 5, np.nan, 5])) == "M1 5H3M4 5H5"
    assert steps_path(times[:2], np.array([np.nan])) == ""


def test_points_with_one_coordinate_are_left_out() -> None:
    x, y = np.array([0.0, np.nan, 2, 3, 4]), np.array([0.0, 1, np.nan, 3, 4])
    assert points_path(x, y) == "M0 0M3 3L4 4"
    assert dots_path(x, y) == "M0 0h0M3 3h0M4 4h0"


@pytest.mark.parametrize(
    ("span", "largest", "across", "up"),
    [
        (2.2, 90.0, ["0", "2"], ["0", "1", "2"]),  # two steps of 1.1, three of 0.73
        (3.3, 90.0, ["0", "2"], ["0", "2"]),  # three of 1.1 as well
        (5.5, 420.0, ["0", "1", "2", "3", "4", "5"], None),  # six of 0.92: one label per 70 pixels
        (9.5, 400.0, None, [str(number) for number in range(9)]),  # ten of 0.95: one per 40
    ],
)
def test_the_ticks_of_a_path_are_as_many_as_its_pixels_allow(
    span: float, largest: float, across: list[str] | None, up: list[str] | None
) -> None:
    corners = np.array([[0.0, 0], [span / 1.12, span / 1.12]])
    chart = path_chart([("a", corners, corners)], "x", "y", largest)
    assert across in (None, [tick.label for tick in chart.x_ticks])
    assert up in (None, [tick.label for tick in chart.y_ticks])


def test_times_and_values_that_do_not_belong_together_are_refused() -> None:
    two, three = (np.arange(count, dtype=float) for count in (2, 3))
    for wrong in (
        lambda: steps_path(three, three),
        lambda: points_path(two, three),
        lambda: dots_path(two, three),
    ):
        with pytest.raises(ValueError, match=r"shorter|longer"):
            wrong()
