"""The picture of a walk: what is drawn is the walk, in the units of the axes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.kinematics.catalogue import robot
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.protocol import Posture
from servogen.motion.gait.phases import gait
from servogen.motion.gait.stability import support_polygon
from servogen.motion.gait.steps import Segment
from servogen.motion.gait.walk import Walk, walk
from servogen.report import gait_plot
from servogen.report.film import walk_scene
from servogen.report.gait_facts import GaitFacts, diagram, walk_facts
from servogen.units import Clock, Cycles

PERIOD_S = 0.02


def walked(found: Hexapod, cycles: float | None) -> Walk:
    clock = Clock(4_000_000)
    way = Segment(0.04, 0.0, 0.0, cycles)
    return walk(found, gait("tripod", found), [way], Posture(), Cycles(20_000), clock, frames_per_cycle=20)


def drawn(
    monkeypatch: pytest.MonkeyPatch, found: Hexapod, made: Walk, facts: GaitFacts | None = None
) -> list[Any]:
    """Return the axes: diagram, margin, springs, from above, from the side."""
    figures: list[Any] = []
    monkeypatch.setattr(gait_plot, "save", lambda figure, path: figures.append(figure))
    shown = facts or walk_facts(found, made)
    gait_plot.gait_plot(found, gait("tripod", found), made, shown, Path("a.png"))
    return list(figures[0].axes)


@pytest.fixture(scope="module")
def hexapod() -> Hexapod:
    """The catalogue's, its centre of mass 3 mm forward and 1 mm to the right."""
    found = robot("hexapod")
    assert isinstance(found, Hexapod)
    return replace(found, centre_of_mass=(0.003, -0.001, 0.0))


@pytest.fixture(scope="module")
def made(hexapod: Hexapod) -> Walk:
    return walked(hexapod, None)


def test_the_bars_are_the_frames_on_the_ground(
    monkeypatch: pytest.MonkeyPatch, hexapod: Hexapod, made: Walk
) -> None:
    diagram = drawn(monkeypatch, hexapod, made)[0]
    end = PERIOD_S * len(made.ground)
    bars = [[path.get_extents() for path in each.get_paths()] for each in diagram.collections]
    for row in range(6):
        (whole,), dark = bars[2 * row : 2 * row + 2]
        assert (whole.x0, whole.x1) == pytest.approx((0, end))
        for bar in (whole, *dark):
            assert (bar.y0, bar.y1) == pytest.approx((row - 0.35, row + 0.35))
        for frame, down in enumerate(made.ground[:, row]):
            middle = PERIOD_S * (frame + 0.5)
            assert any(bar.x0 < middle < bar.x1 for bar in dark) == down
    assert [label.get_text() for label in diagram.get_yticklabels()] == list(made.legs)
    assert diagram.get_ylim() == (5.5, -0.5)
    assert diagram.get_xlim() == pytest.approx((0, end))


def test_margin_and_springs_are_in_millimetres_over_seconds(
    monkeypatch: pytest.MonkeyPatch, hexapod: Hexapod, made: Walk
) -> None:
    _, margin, springs, *_ = drawn(monkeypatch, hexapod, made)
    times = [PERIOD_S * frame for frame in range(len(made.margins) + 1)]
    curve, worst, zero = margin.lines[:3]
    assert curve.get_xdata() == pytest.approx(times)
    assert curve.get_ydata() == pytest.approx([*1000 * made.margins, 1000 * made.margins[-1]])
    least = int(np.argmin(np.round(made.margins, 9)))
    assert (worst.get_xdata()[0], worst.get_ydata()[0]) == pytest.approx(
        (PERIOD_S * least, 1000 * made.margins[least])
    )
    assert list(zero.get_ydata()) == [0, 0]
    assert f"at least {1000 * made.margins.min():.1f} mm in frame {least}" in margin.get_title()
    *curves, _ = springs.lines
    assert len(curves) == 6
    for index, line in enumerate(curves):
        given = 1000 * np.sqrt((made.corrections[:, index] ** 2).sum(axis=1))
        assert line.get_xdata() == pytest.approx(times)
        assert line.get_ydata() == pytest.approx([*given, given[-1]])
        assert line.get_linewidth() == pytest.approx(3.0 - 1.8 * index / 5)  # the first still shows
    assert (margin.get_ylabel(), springs.get_ylabel()) == ("stability margin, mm", "spring's correction, mm")
    assert springs.get_ylim()[0] == 0


def test_feet_polygon_and_centre_of_mass_are_seen_from_above_in_millimetres(
    monkeypatch: pytest.MonkeyPatch, hexapod: Hexapod, made: Walk
) -> None:
    above = drawn(monkeypatch, hexapod, made)[3]
    *paths, stand, centre = above.lines
    start = made.trajectory.loop_start
    for index, line in enumerate(paths):
        around = 1000 * np.vstack((made.feet[start:, index], made.feet[start : start + 1, index]))
        assert line.get_xdata() == pytest.approx(around[:, 0].tolist())
        assert line.get_ydata() == pytest.approx(around[:, 1].tolist())
    assert (centre.get_xdata()[0], centre.get_ydata()[0]) == pytest.approx((3, -1))
    least = int(np.argmin(np.round(made.margins, 9)))
    feet = 1000 * (made.feet + made.corrections)[least][made.ground[least], :2]
    assert stand.get_xdata() == pytest.approx(feet[:, 0].tolist())
    body, polygon = above.patches
    assert polygon.get_xy()[:-1] == pytest.approx(support_polygon(feet))
    mounts = 1000 * np.array([[leg.mount.x, leg.mount.y] for leg in hexapod.limbs if leg.mount])
    assert body.get_xy()[:-1] == pytest.approx(support_polygon(mounts))
    labels = {text.get_text(): text for text in above.texts}
    assert list(labels) == list(made.legs)
    for index, (leg, text) in enumerate(labels.items()):
        path = 1000 * made.feet[start:, index, :2]
        left = mounts[index, 1] > 0  # the labels stand outside the paths
        outer = path[:, 1].max() if left else path[:, 1].min()
        assert text.xy[1] == pytest.approx(outer), leg
        assert text.xyann == (0, 4 if left else -4)
        assert text.get_va() == ("bottom" if left else "top")
    shown = np.concatenate([*(line.get_ydata() for line in paths), body.get_xy()[:, 1]])
    room = 0.1 * np.ptp(shown)  # for the labels
    assert above.get_ylim()[0] < shown.min() - room < shown.max() + room < above.get_ylim()[1]


def test_the_first_foot_is_seen_from_the_side_with_a_dot_for_each_frame(
    monkeypatch: pytest.MonkeyPatch, hexapod: Hexapod, made: Walk
) -> None:
    side = drawn(monkeypatch, hexapod, made)[4]
    path, down, up = side.lines
    start = made.trajectory.loop_start
    around = [*range(start, len(made.feet)), start]
    foot, on = 1000 * made.feet[around, 0], made.ground[around, 0]
    for line, shown in ((path, foot), (down, foot[on]), (up, foot[~on])):
        assert line.get_xdata() == pytest.approx(shown[:, 0].tolist())
        assert line.get_ydata() == pytest.approx(shown[:, 2].tolist())
    assert 0 < on.sum() < len(on)
    assert side.get_title() == "the foot of L1 from the side"


def test_a_red_line_shows_where_the_walk_repeats(
    monkeypatch: pytest.MonkeyPatch, hexapod: Hexapod, made: Walk
) -> None:
    start = made.trajectory.loop_start
    assert start > 0
    rows = drawn(monkeypatch, hexapod, made)[:3]
    for axes in rows:
        (mark,) = [line for line in axes.lines if line.get_linestyle() == "--"]
        assert list(mark.get_xdata()) == pytest.approx([start * PERIOD_S] * 2)
    assert rows[-1].get_xlabel() == "time, s (repeats from the red line on)"
    whole = drawn(monkeypatch, hexapod, walked(hexapod, 1))  # starts and stops: all of it repeats
    assert whole[2].get_xlabel() == "time, s"
    assert not [line for line in whole[0].lines if line.get_linestyle() == "--"]


def test_a_robot_without_a_margin_has_no_curve_of_it(
    monkeypatch: pytest.MonkeyPatch, hexapod: Hexapod, made: Walk
) -> None:
    alone = replace(walk_facts(hexapod, made), margin=None)
    _, margin, _, above, _ = drawn(monkeypatch, hexapod, made, alone)
    assert [line.get_linestyle() for line in margin.lines] == ["--"]
    assert len(margin.get_yticks()) == 0  # there are no millimetres to read
    assert margin.get_title() == "fewer than three legs: something else must hold the robot"
    assert len(above.lines) == 6  # the feet, neither polygon nor centre
    assert above.get_title() == "from above: the foot's path"
    lifted = replace(walk_facts(hexapod, made), margin=-math.inf)
    _, margin, *_ = drawn(monkeypatch, hexapod, made, lifted)
    assert "no foot on the ground" in margin.get_title()
    assert not [line for line in margin.lines if line.get_marker() == "o"]


def test_a_film_shows_the_polygon_of_the_corrected_feet(hexapod: Hexapod, made: Walk) -> None:
    scene = walk_scene(hexapod, made)
    start = made.trajectory.loop_start
    assert scene.count == len(made.ground) - start
    (polygon,) = [part for part in scene.parts if part.colour == "tab:green"]
    for shown, frame in zip(polygon.frames, range(start, len(made.ground)), strict=True):
        feet = (made.feet + made.corrections)[frame][made.ground[frame]]
        corners = support_polygon(feet[:, :2])
        assert shown[:, :2] == pytest.approx(np.vstack((corners, corners[:1])))
        assert shown[:, 2] == pytest.approx(feet[:, 2].mean())
    assert np.abs(made.corrections).max() > 1e-5
    flying = replace(made, ground=np.zeros_like(made.ground))
    (nothing,) = [part for part in walk_scene(hexapod, flying).parts if part.colour == "tab:green"]
    assert {len(shown) for shown in nothing.frames} == {0}  # no foot is on the ground


@pytest.mark.parametrize(
    ("name", "legs"),
    [
        ("tripod", {"L1": "▔▔▔▁▁▁", "R1": "▁▁▁▔▔▔"}),
        ("ripple", {"L1": "▁▁▁▁▔▔", "L2": "▁▁▔▔▁▁", "R1": "▁▔▔▁▁▁", "R2": "▔▁▁▁▁▔"}),  # R2: past the end
        ("wave", {"L3": "▔▁▁▁▁▁", "R1": "▁▁▁▁▁▔"}),
    ],
)
def test_the_diagram_in_text_is_that_of_the_gait(hexapod: Hexapod, name: str, legs: dict[str, str]) -> None:
    """Each sixth of the cycle is several columns, all of which are alike."""
    rows = diagram(gait(name, hexapod))
    assert sorted(rows) == ["L1", "L2", "L3", "R1", "R2", "R3"]
    for leg, sixths in legs.items():
        each = len(rows[leg]) // 6
        assert each * 6 == len(rows[leg])
        assert rows[leg] == "".join(mark * each for mark in sixths), leg
