"""A moving picture of a robot: GIF through Pillow, MP4 through ffmpeg.

In: a `Scene`. Out: a file. It runs as fast as the robot.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from servogen.errors import ToolError
from servogen.outputs import write_bytes
from servogen.report.pictures import check_suffix, new_figure
from servogen.report.scenes import Scene

SUFFIXES = (".gif", ".mp4")
DOTS_PER_INCH = 80
ROOM = 0.08
"""Free space around the robot, as a share of its size."""

ZOOM = 0.9
"""So that the labels of tall and of wide robots are inside of the picture."""


def film(scene: Scene, path: Path) -> None:
    """Writes the film. Raises InputError for an unknown ending, ToolError without matplotlib or ffmpeg."""
    check_suffix(path, SUFFIXES, "film")
    figure = new_figure(6.4, 5.2, scene.title)
    from matplotlib import animation

    kind = path.suffix.lower()
    if kind == ".mp4" and not animation.FFMpegWriter.isAvailable():
        raise ToolError(
            "tool-missing", "an MP4 needs ffmpeg, which is not here", hint="install ffmpeg, or write a .gif"
        )
    figure.set_layout_engine("none")
    axes: Any = figure.add_axes((0.02, 0.03, 0.96, 0.92), projection="3d")
    lines = _set_up(axes, scene)
    clock = figure.text(0.99, 0.01, "", ha="right", fontsize=9)

    def show(frame: int) -> list[Any]:
        for line, part in zip(lines, scene.parts, strict=True):
            line.set_data_3d(*(1000 * part.frames[frame]).T)
        clock.set_text(f"{frame * scene.picture_s:.2f} s")
        return [*lines, clock]

    made = animation.FuncAnimation(figure, show, frames=scene.count, init_func=lambda: lines)
    rate: Any = 1 / scene.picture_s
    writer: Any = animation.PillowWriter(fps=rate) if kind == ".gif" else animation.FFMpegWriter(fps=rate)
    with tempfile.TemporaryDirectory() as folder:
        # The writers take a name, not a file: the film is whole before it takes the name that was asked for.
        file = Path(folder) / f"film{kind}"
        made.save(str(file), writer=writer, dpi=DOTS_PER_INCH)
        write_bytes(path, file.read_bytes())


def _set_up(axes: Any, scene: Scene) -> list[Any]:
    """Empty lines in a box that holds all frames, with the same scale in all directions."""
    different = {id(corners): corners for part in scene.parts for corners in part.frames}
    points = 1000 * np.vstack(list(different.values()))
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    size = np.maximum(high - low, 0.05 * (high - low).max())
    middle = (low + high) / 2
    for setter, centre, extent in zip(
        (axes.set_xlim, axes.set_ylim, axes.set_zlim), middle, size * (0.5 + ROOM), strict=True
    ):
        setter(centre - extent, centre + extent)
    axes.set_box_aspect(tuple(size), zoom=ZOOM)
    axes.view_init(*scene.view)
    axes.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm")
    axes.tick_params(labelsize=7)
    if scene.view[0] == 90:
        axes.set(zlabel="", zticks=[])
    return [
        axes.plot([], [], [], "-o" if part.marks else "-", color=part.colour, lw=part.width, ms=3)[0]
        for part in scene.parts
    ]
