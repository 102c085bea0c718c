"""Films: what each picture shows, how many there are, and how they are written, worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib import animation

from servogen.errors import InputError, ToolError
from servogen.job import load, plan_job
from servogen.report import film as film_module
from servogen.report.film import FilmPart, FilmScene, film, job_scene, walk_scene
from tests.report.legible import check_legible

JOBS = Path(__file__).parents[2] / "jobs"


def limb(x: float, y: float, z: float = 0.0) -> Any:
    return SimpleNamespace(mount=SimpleNamespace(x=x, y=y, z=z))


def scene(kind: str = "three pictures") -> FilmScene:
    moving = [np.array([[0, 0, 0.01], [0.1, 0.1, 0.02 * each]]) for each in range(3)]
    return FilmScene(kind, (FilmPart(moving, "C0"),), 0.25)


def test_a_part_is_a_dotted_line_of_two_points_and_a_scene_is_seen_from_the_front_right() -> None:
    """28° above the ground, 60° to the right of the x axis: the standard view of the films."""
    part = scene().parts[0]
    assert (part.width, part.marks) == (2.0, True)
    assert (scene().view, scene().count) == ((28.0, -60.0), 3)


class Recorded:
    """Stands for matplotlib's animation: keeps what it is given, and writes a few bytes."""

    taken: dict[str, Any]

    def __init__(self, figure: Any, show: Any, frames: int, init_func: Any) -> None:
        Recorded.taken = {"figure": figure, "show": show, "frames": frames, "lines": init_func()}

    def save(self, path: str, writer: Any, dpi: int) -> None:
        Recorded.taken |= {"name": Path(path).name, "writer": writer, "dpi": dpi}
        Path(path).write_bytes(b"film")


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> type[Recorded]:
    monkeypatch.setattr(animation, "FuncAnimation", Recorded)
    return Recorded


def test_a_film_has_four_pictures_a_second_where_one_lasts_a_quarter(
    recorded: type[Recorded], tmp_path: Path
) -> None:
    """512 by 416 pixels: 6.4 by 5.2 inches at 80 dots; MP4 needs even numbers of both."""
    film(scene(), tmp_path / "A.GIF")
    taken = recorded.taken
    assert (tmp_path / "A.GIF").read_bytes() == b"film"
    assert (taken["name"], taken["writer"].fps, taken["frames"]) == ("film.gif", 4, 3)
    assert isinstance(taken["writer"], animation.PillowWriter)
    width, height = (taken["figure"].get_size_inches() * taken["dpi"]).tolist()
    assert (width, height) == (pytest.approx(512), pytest.approx(416))
    assert (width % 2, height % 2) == (pytest.approx(0), pytest.approx(0))
    assert taken["figure"].get_suptitle() == "three pictures"
    (axes,) = taken["figure"].axes
    assert taken["lines"] == list(axes.lines)
    (clock,) = taken["figure"].texts[-1:]
    assert taken["show"](2)[-1] is clock
    assert (clock.get_text(), clock.get_position()) == ("0.50 s", (0.99, 0.01))
    assert clock.get_ha() == "right"
    check_legible(taken["figure"])


@pytest.mark.parametrize("available", [True, False])
def test_an_mp4_is_written_by_ffmpeg_where_it_is_installed(
    recorded: type[Recorded], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, available: bool
) -> None:
    monkeypatch.setattr(animation.FFMpegWriter, "isAvailable", lambda: available)
    monkeypatch.setattr(animation.FFMpegWriter, "__init__", lambda self, fps: setattr(self, "fps", fps))
    if available:
        film(scene(), tmp_path / "a.mp4")
        assert (recorded.taken["name"], recorded.taken["writer"].fps) == ("film.mp4", 4)
        assert isinstance(recorded.taken["writer"], animation.FFMpegWriter)
        return
    with pytest.raises(ToolError, match="ffmpeg, which is not installed"):
        film(scene(), tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())
    film(scene(), tmp_path / "a.gif")


def test_a_film_is_a_gif_or_an_mp4(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'\.png' is not a film that can be written"):
        film(scene(), tmp_path / "a.png")


def test_a_motion_that_ends_is_filmed_from_its_beginning() -> None:
    """Its loop is its last frame; with two frames of loop only these are shown."""
    job = plan_job(load(JOBS / "lab9-exercise.toml"))
    angles = job.trajectory.angles[:20]
    for start, count in ((19, 20), (18, 2), (0, 20), (10, 10)):
        cut = replace(job, trajectory=replace(job.trajectory, angles=angles, loop_start=start))
        assert job_scene(cut).count == count
        assert job_scene(cut).picture_s == pytest.approx(0.02)


def test_a_base_is_filmed_from_above_on_its_path() -> None:
    found = job_scene(plan_job(load(JOBS / "omni-square.toml")))
    trace, *outline = found.parts
    assert found.view == (90.0, -90.0)
    assert trace.colour == "0.6"
    assert {(part.colour, part.marks) for part in outline} == {("tab:blue", False)}
    assert np.abs(trace.frames[0][:, 2]).max() == 0
    assert np.ptp(trace.frames[0][:, :2], axis=0) == pytest.approx([0.3, 0.3], abs=1e-3)  # its square
    assert {len(part.frames) for part in found.parts} == {found.count}


@pytest.mark.parametrize(("legs", "polygons"), [(2, 0), (3, 1)])
def test_a_walk_of_three_legs_has_a_polygon(
    monkeypatch: pytest.MonkeyPatch, legs: int, polygons: int
) -> None:
    """Eight frames of 20 ms, of which the last six repeat."""
    monkeypatch.setattr(film_module, "leg_sticks", lambda robot, planned: [np.zeros((8, 5, 3))] * legs)
    clock = SimpleNamespace(seconds=lambda cycles: 0.02)
    feet = np.zeros((8, legs, 3))
    walk: Any = SimpleNamespace(
        ground=np.ones((8, legs), bool),
        feet=feet,
        corrections=feet,
        trajectory=SimpleNamespace(loop_start=2, clock=clock, period=20_000),
    )
    limbs = [limb(math.cos(angle), math.sin(angle)) for angle in range(legs)]
    found = walk_scene(SimpleNamespace(name="robot", limbs=limbs), walk)  # type: ignore[arg-type]
    assert (found.title, found.picture_s, found.count) == ("robot, x forward", 0.02, 6)
    assert [part.colour for part in found.parts] == [
        "0.35",
        *["tab:green"] * polygons,
        *(f"C{leg}" for leg in range(legs)),
    ]
    assert [part.width for part in found.parts] == [3.0, *[1.5] * polygons, *[2.0] * legs]
    assert {len(part.frames) for part in found.parts} == {6}
