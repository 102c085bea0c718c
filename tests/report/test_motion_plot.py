"""The picture of a motion: its panels, lines and words, for a robot and for servos that move none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import same_color

from servogen.errors import InputError
from servogen.job import PlannedJob
from servogen.pulse import PulseSchedule
from servogen.report import motion_plot
from servogen.report.tracks import Track
from tests.report.legible import check_legible
from tests.report.planned import planned

JOBS = Path(__file__).parents[2] / "jobs"
Draw = Callable[..., Any]


@pytest.fixture
def draw(monkeypatch: pytest.MonkeyPatch) -> Draw:
    """`draw(job, schedule, tracks)`: the figure, which goes to no file."""
    figures: list[Any] = []
    monkeypatch.setattr(motion_plot, "save", lambda figure, path: figures.append(figure))

    def drawn(job: PlannedJob, schedule: PulseSchedule, tracks: tuple[Track, ...]) -> Any:
        motion_plot.motion_plot(job, schedule, tracks, Path("a.png"))
        return figures[-1]

    return drawn


@pytest.fixture(scope="module")
def scara() -> tuple[PlannedJob, PulseSchedule, tuple[Track, ...]]:
    return planned("scara-pick")


def test_a_robot_has_five_panels_and_servos_alone_two(draw: Draw, scara: Any) -> None:
    figure = draw(*scara)
    check_legible(figure)
    assert figure.get_suptitle() == "scara-pick: the planned motion"
    left, right = figure.subfigs
    assert left.bbox.width > right.bbox.width
    assert [len(part.axes) for part in (left, right)] == [3, 2]
    above, side = right.axes
    assert above.bbox.height > side.bbox.height
    alone = draw(*scara[:2], ())
    check_legible(alone)
    assert np.all(alone.get_size_inches() < figure.get_size_inches())
    assert (len(alone.subfigs), len(alone.axes)) == (0, 2)
    for rows in (left.axes, alone.axes):
        assert all(rows[0].get_shared_x_axes().joined(rows[0], axes) for axes in rows)
        assert [axes.get_xlabel() != "" for axes in rows] == [False] * (len(rows) - 1) + [True]


def test_a_track_without_pulses_has_no_panel(draw: Draw, scara: Any) -> None:
    job, schedule, (track,) = scara
    nothing = np.full_like(track.planned, np.nan)
    silent = replace(track, planned=nothing, made=nothing, shift=nothing)
    assert len(draw(job, schedule, (silent,)).axes) == 2
    partly = replace(track, planned=np.where(np.arange(len(nothing))[:, None] > 2, track.planned, np.nan))
    assert len(draw(job, schedule, (partly,)).axes) == 5


def test_the_panels_of_a_robot_have_their_units_grids_and_ranges(draw: Draw, scara: Any) -> None:
    job = scara[0]
    figure = draw(*scara)
    angles, widths, error, above, side = figure.axes
    end = 0.02 * len(job.trajectory.angles)
    for axes in (angles, widths, error):
        assert axes.get_xlim() == pytest.approx((-0.01 * end, 1.01 * end))
    assert all(axes.xaxis.get_gridlines()[0].get_visible() for axes in figure.axes)
    labels = ["servo angle, °", "pulse width, µs", "error of the pulses, mm", "y, mm", "z, mm"]
    assert [axes.get_ylabel() for axes in figure.axes] == labels
    assert [axes.get_xlabel() for axes in (above, side)] == ["x, mm", "x, mm"]
    assert [axes.get_title() for axes in (above, side)] == ["from above", "from the side"]
    assert {axes.get_aspect() for axes in (above, side)} == {1.0}  # millimetres are as long both ways
    assert {axes.get_adjustable() for axes in (above, side)} == {"datalim"}
    assert error.get_ylim()[0] == 0
    shown = np.array([line.get_ydata()[:-1] for line in angles.lines[: len(job.servos)]]).T
    assert shown == pytest.approx(np.degrees(job.trajectory.angles), nan_ok=True)


def test_the_legend_is_below_the_curves_and_names_each_servo_once(draw: Draw, scara: Any) -> None:
    figure = draw(*scara)
    left, right = figure.subfigs
    (legend,) = left.legends
    names = [servo.name for servo in scara[0].servos]
    assert [text.get_text() for text in legend.get_texts()] == names
    assert legend.get_window_extent().y1 < left.axes[-1].bbox.y0
    above, side = right.axes
    assert above.get_legend() is not None
    assert side.get_legend() is None
    for panel in (above, side):
        path, dots = panel.lines
        assert (path.get_linestyle(), dots.get_marker()) == ("-", ".")
        assert not same_color(dots.get_color(), path.get_color())
        assert dots.get_zorder() > path.get_zorder()
        assert dots.get_linestyle() == "None"


def test_paths_and_errors_of_several_feet_have_colours_and_one_name_for_the_dots(draw: Draw) -> None:
    found = planned("hexapod-tripod")
    _, _, error, above, side = draw(*found).axes
    for panel in (above, side):
        assert [line.get_color() for line in panel.lines[::2]] == [f"C{leg}" for leg in range(6)]
        labels = [line.get_label() for line in panel.lines[1::2]]
        assert [label.startswith("_") for label in labels[:-1]] == [True] * 5  # not in the legend
        assert labels[-1] == "with whole cycles"
    curves = error.lines[:6]
    assert [line.get_color() for line in curves] == [f"C{leg}" for leg in range(6)]
    widths = [line.get_linewidth() for line in curves]
    assert np.all(np.diff(widths) < 0)  # where curves are equal, those beneath are seen
    assert np.diff(widths) == pytest.approx([widths[1] - widths[0]] * 5)
    assert {line.get_drawstyle() for line in curves} == {"steps-post"}


def test_servos_of_a_leg_differ_in_their_dashes_and_of_a_single_leg_in_colour(draw: Draw) -> None:
    angles = draw(*planned("hexapod-tripod")).axes[0]
    curves = angles.lines[:12]
    assert sorted({line.get_linestyle() for line in curves}) == ["-", "--"]
    by_colour = {line.get_color(): line.get_linewidth() for line in curves}
    assert list(by_colour) == [f"C{leg}" for leg in range(6)]
    assert np.all(np.diff(list(by_colour.values())) < 0)
    one = draw(*planned("lab9-exercise")).axes[0].lines[:2]
    assert [(line.get_color(), line.get_linestyle()) for line in one] == [("C0", "-"), ("C1", "-")]
    assert one[0].get_linewidth() > one[1].get_linewidth()


def test_a_base_is_seen_from_above_only(draw: Draw) -> None:
    figure = draw(*planned("omni-square"))
    *_, above = figure.axes
    assert len(figure.axes) == 4
    assert above.get_ylabel() == "y, mm"
    assert figure.axes[0].get_ylabel() == "wheel speed, °/s"
    job, schedule, _ = planned("omni-square")
    servo = job.servos[0]
    mixed = (replace(servo, model=replace(servo.model, continuous=False)), *job.servos[1:])
    assert draw(replace(job, servos=mixed), schedule, ()).axes[0].get_ylabel() == "servo angle, °"


def test_the_mark_of_the_loop_is_a_dashed_line_at_its_first_frame(draw: Draw, scara: Any) -> None:
    job, schedule, tracks = scara
    later = replace(job, trajectory=replace(job.trajectory, loop_start=3))
    for axes in draw(later, schedule, tracks).axes[:3]:
        mark = axes.lines[-1]
        assert list(mark.get_xdata()) == pytest.approx([0.06, 0.06])
        assert mark.get_linestyle() == "--"


def test_an_unknown_ending_is_refused_before_anything_is_drawn(scara: Any) -> None:
    with pytest.raises(InputError, match=r"'\.txt' is not a picture"):
        motion_plot.motion_plot(*scara, Path("a.txt"))
