"""The picture of a walk: its panels, words and styles, and a walk of a few frames made by hand."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from servogen.errors import InputError
from servogen.report import gait_plot
from servogen.report.gait_facts import diagram
from tests.report.legible import check_legible, check_marks

FEET = np.array(  # (frames, legs, xyz) in metres: L steps forward in frames 1 and 2, R stands
    [
        [[0.05, 0.03, -0.10], [0.05, -0.03, -0.10]],
        [[0.06, 0.03, -0.08], [0.04, -0.03, -0.10]],
        [[0.07, 0.03, -0.08], [0.03, -0.03, -0.10]],
        [[0.08, 0.03, -0.10], [0.02, -0.03, -0.10]],
    ]
)
DOWN = np.array([[True, True], [False, True], [False, True], [True, True]])


def steps(**others: Any) -> Any:
    """A walk of four frames, of which the last three repeat."""
    corrections = np.zeros_like(FEET)
    corrections[2, 1] = [0.0003, 0.0, 0.0004]
    given = {
        "legs": ("L", "R"),
        "feet": FEET,
        "ground": DOWN,
        "corrections": corrections,
        "margins": np.array([0.010, 0.004, math.inf, 0.012]),
        "largest_correction_m": 0.0005,
        "frames_per_cycle": 2,
        "centre": 0.003 + 0j,  # of mass, 3 mm forward
        "trajectory": SimpleNamespace(angles=np.zeros((4, 4)), loop_start=1),
    }
    return SimpleNamespace(**{**given, **others})


def facts(**others: Any) -> Any:
    return SimpleNamespace(**{"cycle_s": 0.04, "margin": 0.004, "margin_frame": 1, **others})


TIMES = np.array([0.0, 0.02, 0.04, 0.06, 0.08])


@pytest.fixture
def axes() -> Any:
    return Figure().add_subplot()


def test_stretches_on_the_ground_begin_and_end_with_their_frames() -> None:
    for frames, expected in (
        ([True, False, False, True], [(0.0, 0.02), (0.06, 0.02)]),
        ([False, True, True, False], [(0.02, 0.04)]),
        ([True] * 4, [(0.0, 0.08)]),
        ([False] * 4, []),
    ):
        assert gait_plot._stretches(np.array(frames), TIMES) == [pytest.approx(each) for each in expected]


def test_the_diagram_has_a_row_for_each_leg_from_the_first_at_the_top(axes: Any) -> None:
    gait_plot._draw_diagram(axes, steps(), TIMES)
    bars = [[path.get_extents().bounds for path in each.get_paths()] for each in axes.collections]
    whole, left, _, right = bars
    assert [tuple(bounds) for bounds in whole] == [pytest.approx((0, -0.35, 0.08, 0.7))]
    assert [tuple(bounds) for bounds in left] == [
        pytest.approx((0, -0.35, 0.02, 0.7)),
        pytest.approx((0.06, -0.35, 0.02, 0.7)),
    ]
    assert [tuple(bounds) for bounds in right] == [pytest.approx((0, 0.65, 0.08, 0.7))]
    colours = [each.get_facecolor()[0] for each in axes.collections]
    assert all(same_color(one, other) for one, other in zip(colours, ("0.88", "0.25") * 2, strict=True))
    assert axes.get_ylim() == (1.5, -0.5)
    assert axes.get_yticks().tolist() == [0, 1]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["L", "R"]
    assert axes.get_title() == "gait diagram: dark on the ground, light in the air"


def test_the_margin_is_a_curve_with_its_least_point_and_a_gap_without_feet(axes: Any) -> None:
    gait_plot._draw_margin(axes, steps(), facts(), TIMES)
    curve, worst, zero = axes.lines
    assert curve.get_xdata() == pytest.approx(TIMES)
    assert curve.get_ydata() == pytest.approx([10, 4, math.nan, 12, 12], nan_ok=True)
    assert (curve.get_drawstyle(), curve.get_color()) == ("steps-post", "tab:blue")
    assert (list(worst.get_xdata()), list(worst.get_ydata())) == ([0.02], [4.0])
    assert (worst.get_marker(), worst.get_color()) == ("o", "tab:red")
    assert list(zero.get_ydata()) == [0, 0]
    check_marks(axes)
    assert axes.get_title() == "centre of mass inside the support polygon: at least 4.0 mm in frame 1"
    assert axes.get_ylabel() == "stability margin, mm"


def test_fewer_than_three_legs_have_no_curve(axes: Any) -> None:
    gait_plot._draw_margin(axes, steps(), facts(margin=None), TIMES)
    assert (len(axes.lines), len(axes.get_yticks())) == (0, 0)
    assert axes.get_title() == "fewer than three legs: something else must hold the robot"


def test_springs_are_curves_of_their_length_in_millimetres(axes: Any) -> None:
    """0.3 mm and 0.4 mm at a right angle are 0.5 mm."""
    gait_plot._draw_springs(axes, steps(), TIMES)
    left, right = axes.lines
    assert left.get_ydata() == pytest.approx([0] * 5)
    assert right.get_ydata() == pytest.approx([0, 0, 0.5, 0, 0])
    assert left.get_linewidth() > right.get_linewidth()  # equal curves: the one beneath is seen
    assert [line.get_label() for line in axes.lines] == ["L", "R"]
    assert [line.get_color() for line in axes.lines] == ["C0", "C1"]
    assert {line.get_drawstyle() for line in axes.lines} == {"steps-post"}
    assert axes.get_title() == "deflection of the springs: at most 0.50 mm"
    assert axes.get_ylim()[0] == 0
    check_marks(axes)


def test_a_foots_round_begins_with_the_loop_and_ends_where_it_began() -> None:
    around = gait_plot._round(steps(), 1)
    assert around == pytest.approx(FEET[[1, 2, 3, 1], 1])


def test_the_side_shows_the_first_foots_round_with_dots_of_two_colours(axes: Any) -> None:
    gait_plot._draw_side(axes, steps())
    path, down, up = axes.lines
    assert path.get_xdata() == pytest.approx([60, 70, 80, 60])
    assert path.get_ydata() == pytest.approx([-80, -80, -100, -80])
    assert path.get_linestyle() == "-"
    assert (down.get_xdata().tolist(), up.get_xdata().tolist()) == (
        pytest.approx([80]),
        pytest.approx([60, 70, 60]),
    )
    assert [(line.get_marker(), line.get_label()) for line in (down, up)] == [
        ("o", "on the ground"),
        ("o", "in the air"),
    ]
    assert not same_color(down.get_color(), up.get_color())
    assert axes.get_legend() is not None
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (forward), mm", "z, mm")
    assert axes.get_title() == "the foot of L from the side"


@pytest.fixture
def two_legs(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A robot with a leg at the left and one at the right, its centre of mass 3 mm forward."""
    mounts = [SimpleNamespace(x=0.1, y=0.02), SimpleNamespace(x=0.1, y=-0.02)]
    monkeypatch.setattr(gait_plot, "mounts_of", lambda robot: mounts)
    return SimpleNamespace(name="biped", centre_of_mass=(0.003, 0.0, 0.0))


def test_from_above_there_are_feet_names_polygon_and_centre(axes: Any, two_legs: Any) -> None:
    gait_plot._draw_above(axes, two_legs, steps(), facts(margin_frame=2))
    left, right, stand, centre = axes.lines
    assert [line.get_color() for line in (left, right)] == ["C0", "C1"]
    assert (stand.get_xdata().tolist(), stand.get_ydata().tolist()) == ([pytest.approx(30.3)], [-30.0])
    assert stand.get_marker() == "o"
    assert (centre.get_xdata().tolist(), centre.get_ydata().tolist()) == ([3.0], [0.0])
    assert centre.get_marker() == "+"
    names = [(text.get_text(), text.xy, text.xyann, text.get_va()) for text in axes.texts]
    assert names == [
        ("L", (pytest.approx(67.5), 30.0), (0, 4), "bottom"),  # the mean of 60, 70, 80, 60
        ("R", (pytest.approx(32.5), -30.0), (0, -4), "top"),
    ]
    assert [(text.get_color(), text.get_ha(), text.anncoords) for text in axes.texts] == [
        ("C0", "center", "offset points"),
        ("C1", "center", "offset points"),
    ]
    body, polygon = axes.patches
    assert body.get_zorder() < polygon.get_zorder() < left.get_zorder()
    assert 0 < polygon.get_alpha() < 0.5
    legend = axes.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["on the ground in frame 2", "centre of mass"]
    check_marks(axes)
    assert axes.get_title() == "from above: foot paths and the support polygon with the smallest margin"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (forward), mm", "y (left), mm")


def test_without_feet_on_the_ground_there_is_a_centre_and_no_polygon(axes: Any, two_legs: Any) -> None:
    gait_plot._draw_above(axes, two_legs, steps(ground=np.zeros((4, 2), bool)), facts(margin=-math.inf))
    assert (len(axes.patches), len(axes.lines)) == (1, 3)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["centre of mass"]


def test_without_a_margin_there_are_paths_only(axes: Any, two_legs: Any) -> None:
    gait_plot._draw_above(axes, two_legs, steps(), facts(margin=None))
    assert (len(axes.patches), len(axes.lines), axes.get_legend()) == (1, 2, None)
    assert axes.get_title() == "from above: the foot's path"


@pytest.mark.parametrize(("start", "words"), [(0, "time, s"), (1, "time, s (repeats from the red line on)")])
def test_the_whole_picture_has_three_rows_over_time_and_two_views(
    monkeypatch: pytest.MonkeyPatch, two_legs: Any, start: int, words: str
) -> None:
    """A cycle of two frames lasts 40 ms, four frames 80 ms."""
    figures: list[Any] = []
    monkeypatch.setattr(gait_plot, "save", lambda figure, path: figures.append(figure))
    walk = steps(trajectory=SimpleNamespace(angles=np.zeros((4, 4)), loop_start=start))
    rhythm: Any = SimpleNamespace(name="own", duty=0.75)
    gait_plot.gait_plot(two_legs, rhythm, walk, facts(), Path("a.svg"))
    (figure,) = figures
    check_legible(figure)
    assert figure.get_suptitle() == f"{two_legs.name}: the gait 'own', duty factor 0.75"
    left, right = figure.subfigs
    assert left.bbox.width > right.bbox.width
    assert (len(left.axes), len(right.axes)) == (3, 2)
    above, side = right.axes[0].get_gridspec().get_height_ratios()
    assert above > side
    assert right.axes[0].get_legend().get_window_extent().y1 < right.axes[0].bbox.y0, "it covers no foot"
    assert all(left.axes[0].get_shared_x_axes().joined(left.axes[0], each) for each in left.axes)
    assert left.axes[1].lines[0].get_xdata() == pytest.approx(TIMES)
    assert [each.get_xlabel() for each in left.axes] == ["", "", words]
    for each in left.axes:
        assert each.get_xlim() == pytest.approx((0, 0.08))
        marks = [
            line for line in each.lines if line.get_color() == "tab:red" and line.get_linestyle() == "--"
        ]
        assert [list(line.get_xdata()) for line in marks] == [[0.02, 0.02]] * start
    with pytest.raises(InputError, match=r"'\.txt' is not a picture"):
        gait_plot.gait_plot(two_legs, rhythm, walk, facts(), Path("a.txt"))


@pytest.mark.parametrize(
    ("grain", "columns"), [(1, 12), (2, 12), (5, 10), (6, 12), (7, 7), (12, 12), (13, 13), (24, 24), (25, 12)]
)
def test_a_diagram_has_about_twelve_columns_of_which_each_lift_has_one(grain: int, columns: int) -> None:
    """As many as fit of the gait's own steps; up to twice as many where it has more."""
    lifts = (("A", 0.0), ("B", 1 / grain))
    rhythm: Any = SimpleNamespace(grain=grain, swing=1 / grain, lifts=lifts)
    rows = diagram(rhythm)
    assert {len(row) for row in rows.values()} == {columns}
    up = round(columns / grain) if columns % grain == 0 else 1
    assert rows["A"] == "▔" * (up if grain > 1 else columns) + "▁" * (columns - up)
    if columns % grain == 0:
        each = columns // grain
        assert rows["B"] == rows["A"][-each:] + rows["A"][:-each]
