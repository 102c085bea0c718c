"""The curves of the pictures: what is drawn is what the plan says, in the units of the axes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.job import load, plan_job
from servogen.pulse.plan import plan
from servogen.report import calibration_plot, drawing, motion_plot
from servogen.report.drawing import Axis, path_chart, time_chart
from servogen.report.html import path_charts
from servogen.report.tracks import Kind, Track, end_tracks
from servogen.robot.calibration import Reading, fit
from tests.report.test_html import job_file

JOBS = Path(__file__).parents[2] / "jobs"
Caught = Callable[[Any], list[Any]]


@pytest.fixture
def caught(monkeypatch: pytest.MonkeyPatch) -> Caught:
    """`caught(module)`: the list to which the module's figures go instead of to a file."""

    def catch(module: Any) -> list[Any]:
        figures: list[Any] = []
        monkeypatch.setattr(module, "save", lambda figure, path: figures.append(figure))
        return figures

    return catch


@pytest.fixture
def axes() -> Any:
    from matplotlib.figure import Figure

    return Figure().add_subplot()


def curve(line: Any) -> tuple[list[float], list[float]]:
    return line.get_xdata().tolist(), line.get_ydata().tolist()


def test_angles_and_widths_are_drawn_over_seconds(caught: Caught, tmp_path: Path) -> None:
    """Five frames of 20 ms at 0° (1 ms) and five at 90° (1.5 ms); the last is held to its end."""
    figures = caught(motion_plot)
    job = plan_job(load(job_file(tmp_path)))
    schedule = plan(job.trajectory, job.servos, job.frame).schedule
    motion_plot.motion_plot(job, schedule, end_tracks(job, schedule), Path("a.png"))
    angles, widths = figures[0].axes
    times = pytest.approx([0.02 * frame for frame in range(11)])
    x, y = curve(angles.lines[0])
    assert (x, y) == (times, pytest.approx([0] * 5 + [90] * 6))
    x, y = curve(widths.lines[0])
    assert (x, y) == (times, pytest.approx([1000] * 5 + [1500] * 6))
    assert {line.get_drawstyle() for line in (angles.lines[0], widths.lines[0])} == {"steps-post"}
    assert angles.get_xlim() == pytest.approx((-0.002, 0.202))
    assert (angles.get_ylabel(), widths.get_ylabel()) == ("servo angle, °", "pulse width, µs")


@pytest.mark.parametrize("name", ["hexapod-tripod", "scara-pick", "omni-square"])
def test_paths_are_drawn_in_millimetres_and_lead_back_to_the_loops_beginning(
    caught: Caught, name: str
) -> None:
    figures = caught(motion_plot)
    job = plan_job(load(JOBS / f"{name}.toml"))
    schedule = plan(job.trajectory, job.servos, job.frame).schedule
    tracks = end_tracks(job, schedule)
    motion_plot.motion_plot(job, schedule, tracks, Path("a.png"))
    frames, start = len(job.trajectory.angles), job.trajectory.loop_start
    _, _, error, above, *side = figures[0].axes
    assert len(side) == (0 if tracks[0].kind == "base" else 1)
    for each, line in zip(tracks, error.lines, strict=False):
        x, y = curve(line)
        assert x == pytest.approx([0.02 * frame for frame in range(frames + 1)])
        off = 1000 * np.sqrt(((each.made - each.planned) ** 2).sum(axis=1))
        assert y == pytest.approx([*off, off[-1]], nan_ok=True)
    for panel, column in ((above, 1), *((axes, 2) for axes in side)):
        for index, track in enumerate(tracks):
            x, y = curve(panel.lines[2 * index])
            assert len(x) == frames + 1
            assert x == pytest.approx([*1000 * track.planned[:, 0], 1000 * track.planned[start, 0]])
            assert y == pytest.approx([*1000 * track.planned[:, column], 1000 * track.planned[start, column]])
            x, y = curve(panel.lines[2 * index + 1])
            assert x == pytest.approx((1000 * track.made[:, 0]).tolist())
    legend = [text.get_text() for text in above.get_legend().get_texts()]
    assert legend == [*(track.name for track in tracks), "with whole cycles"]  # which is said once
    verticals = [line for axes in figures[0].axes[:3] for line in axes.lines if line.get_ls() == "--"]
    marks = {line.get_xdata()[0] for line in verticals if line.get_xdata()[0] == line.get_xdata()[1]}
    assert marks == ({pytest.approx(0.02 * start)} if start else set())


def test_a_dashed_line_shows_where_the_loop_begins(caught: Caught, tmp_path: Path) -> None:
    figures = caught(motion_plot)
    job = plan_job(load(job_file(tmp_path)))
    schedule = plan(job.trajectory, job.servos, job.frame).schedule
    motion_plot.motion_plot(job, schedule, (), Path("a.png"))
    later = replace(job, trajectory=replace(job.trajectory, loop_start=3))
    motion_plot.motion_plot(later, schedule, (), Path("a.png"))
    once, marked = ([axes.lines[1:] for axes in figure.axes] for figure in figures)
    assert once == [[], []]
    for (mark,) in marked:
        assert list(mark.get_xdata()) == pytest.approx([0.06, 0.06])
    assert figures[0].axes[1].get_xlabel() == "time, s"
    assert figures[1].axes[1].get_xlabel() == "time, s (repeats from the dashed line on)"


def test_a_chart_of_the_page_has_steps_at_the_pixels_of_its_axes() -> None:
    """960 pixels wide: time 0 at the left end of the axis, the end of the last frame at the right."""
    chart = time_chart(np.array([0.0, 1.0, 2.0]), np.array([[0.0], [10.0]]), ["arm"], "angle", 1.0)
    left, top, width, height = map(float, chart.frame)
    assert left + width == float(chart.width) - drawing.RIGHT
    assert top + height == float(chart.height) - drawing.BOTTOM  # the time's numbers are below it
    (line,) = chart.lines
    numbers = [float(each) for each in re.findall(r"-?[\d.]+", line.path)]
    start, low, middle, high, end = numbers
    assert (start, middle, end) == pytest.approx((left, left + width / 2, left + width), abs=0.11)
    assert top <= high < low <= top + height  # SVG's y points down
    assert chart.mark is not None
    assert float(chart.mark) == pytest.approx(left + width / 2, abs=0.11)
    assert [tick.label for tick in chart.x_ticks][-1] == "2"


def test_a_path_has_one_scale_both_ways() -> None:
    """A rectangle of 200 by 100 mm."""
    corners = np.array([[0.0, 0], [200, 0], [200, 100], [0, 100]])
    chart = path_chart([("foot", corners, corners)], "x", "y")
    line = chart.lines[0]
    x0, y0, x1, y1, x2, y2, *_ = (float(each) for each in re.findall(r"-?[\d.]+", line.path))
    assert y0 == y1
    assert x1 == x2
    assert (x1 - x0) / (y1 - y2) == pytest.approx(2, rel=0.01)
    assert y2 < y1
    points = [re.findall(r"[\d.]+ [\d.]+", each.path) for each in chart.lines]
    assert points[0] == [each.removesuffix("h0") for each in points[1]]


def test_a_narrow_chart_has_no_more_labels_than_it_has_room_for() -> None:
    """Two pixels to a millimetre, 90 pixels wide: room for the label of one multiple of 50 mm."""
    corners = np.array([[-5.0, -89.2857], [5.0, 89.2857]])  # with the room around it 200 mm high
    chart = path_chart([("foot", corners, corners)], "x", "y")
    assert chart.frame[2:] == ("90", "400")
    assert [tick.label for tick in chart.x_ticks] == ["0"]
    assert [tick.label for tick in chart.y_ticks] == [str(mm) for mm in range(-80, 81, 20)]


def test_an_axis_is_linear_between_its_ends() -> None:
    axis = Axis(10.0, 20.0, 100.0, 300.0)
    assert axis.at([10, 12.5, 20]).tolist() == [100, 150, 300]


def test_a_calibration_is_drawn_in_degrees_and_microseconds(caught: Caught, tmp_path: Path) -> None:
    """Readings on 1000 + 5 µs/° but for the middle one, which is 0.6° high: the line is moved by 0.2°."""
    figures = caught(calibration_plot)
    servo = load(job_file(tmp_path)).servos[0]
    readings = [
        Reading(1000.0 + 5 * degrees, math.radians(degrees + off))
        for degrees, off in ((0, 0.0), (90, 0.6), (180, 0.0))
    ]
    calibration_plot.calibration_plot(fit(readings), servo, Path("a.png"))
    above, below = figures[0].axes
    line, before, read = above.lines
    assert curve(read) == (pytest.approx([0, 90.6, 180]), pytest.approx([1000, 1450, 1900]))
    x, y = curve(line)
    assert x == pytest.approx([0.2, 180.2]), "between the shortest and the longest width that was read"
    assert y == pytest.approx([1000, 1900])
    x, y = curve(before)  # the catalogue's servo: 1 ms at 0°, 0.5 ms more at 90°
    assert y == pytest.approx([1000, 1900])
    assert x == pytest.approx([0, 162])
    assert curve(below.lines[-1])[1] == pytest.approx([-0.2, 0.4, -0.2])
    assert list(below.lines[0].get_ydata()) == [0, 0]
    stems = np.array(below.collections[0].get_segments())  # each residual stands on the line of the fit
    assert stems[:, :, 0] == pytest.approx(np.array([[0, 0], [90.6, 90.6], [180, 180]]))
    assert stems[:, :, 1] == pytest.approx(np.array([[0, -0.2], [0, 0.4], [0, -0.2]]))
    assert below.get_ylim() == pytest.approx((-0.6, 0.6))


@pytest.mark.parametrize(("kind", "views"), [("foot", 2), ("base", 1)])
def test_the_page_shows_paths_from_above_and_from_the_side(kind: Kind, views: int) -> None:
    """200 mm forward, then 100 mm to the left while rising 50 mm, and back to where the loop begins."""
    points = np.array([[-0.1, 0.3, 0.2], [0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0.05]])
    charts = dict(path_charts([Track("end", kind, points, points, np.zeros((4, 3)))], 1))
    assert list(charts) == ["from above", "from the side"][:views]
    for title, rise in (("from above", 100), ("from the side", 50)):
        if title not in charts:
            continue
        line, dots = charts[title].lines
        numbers = [float(each) for each in re.findall(r"-?[\d.]+", line.path)]
        lead, start, forward, left, back = zip(numbers[::2], numbers[1::2], strict=True)
        scale = (forward[0] - start[0]) / 200
        assert start[1] == forward[1]
        assert forward[1] - left[1] == pytest.approx(rise * scale, abs=0.2)  # SVG's y points down
        assert (left[0], back) == (forward[0], start)
        assert start[0] - lead[0] == pytest.approx(100 * scale, abs=0.2)
        assert dots.path.count("h0") == 4
        assert charts[title].x_label == "x, mm"
    assert charts["from above"].y_label == "y, mm"
