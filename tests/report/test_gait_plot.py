"""The picture of a walk: its panels, words and styles, and a walk of a few frames made by hand."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.report import gait_plot
from servogen.report.gait_facts import diagram
from tests.report.legible import check_legible

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
def two_legs(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A robot with a leg at the left and one at the right, its centre of mass 3 mm forward."""
    mounts = [SimpleNamespace(x=0.1, y=0.02), SimpleNamespace(x=0.1, y=-0.02)]
    monkeypatch.setattr(gait_plot, "mounts_of", lambda robot: mounts)
    return SimpleNamespace(name="biped", centre_of_mass=(0.003, 0.0, 0.0))


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
