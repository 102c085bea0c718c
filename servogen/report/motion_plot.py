"""A picture of a planned motion: angles, pulses, paths of feet, tool or base, and the error of whole cycles.

In: a `PlannedJob`, its schedule and tracks. Out: a PNG, SVG or PDF file.

    ┌ angles ───────────────┬ from above ┐
    ├ pulse widths ─────────┤            │   the right column and the error only where
    ├ error of the pulses ──┼ from side  ┤   the servos move a foot, a tool or the base
    └───────────────────────┴────────────┘
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from servogen.job import PlannedJob
from servogen.motion.trajectory import Floats
from servogen.pulse import PulseSchedule
from servogen.report.motion_table import widths_us
from servogen.report.pictures import check_suffix, new_figure, plane, save
from servogen.report.tracks import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

THINNEST, WIDEST = 1.2, 3.0
"""Widths of lines, in points."""

COLOURS = 10
"""Colours of matplotlib's cycle; servos beyond them are dashed."""


def motion_plot(job: PlannedJob, schedule: PulseSchedule, tracks: Sequence[Track], path: Path) -> None:
    """Draw a motion to `path`. Raises InputError for an unknown ending, ToolError without matplotlib."""
    check_suffix(path)
    shown = [track for track in tracks if not np.isnan(track.planned).all()]
    figure = new_figure(13 if shown else 9, 8 if shown else 5.5, f"{job.name}: the planned motion")
    panes: Any = figure.subfigures(1, 2, width_ratios=[1.7, 1]) if shown else (figure,)
    left = panes[0]
    frame_s = float(schedule.clock.seconds(schedule.period))
    times = frame_s * np.arange(len(job.trajectory.angles) + 1, dtype=np.float64)
    rows = left.subplots(3 if shown else 2, 1, sharex=True)
    speeds = all(servo.model.continuous for servo in job.servos)
    _draw_servos(rows[0], job, times, np.degrees(job.trajectory.angles))
    rows[0].set_ylabel("wheel speed, °/s" if speeds else "servo angle, °")
    _draw_servos(rows[1], job, times, widths_us(schedule))
    rows[1].set_ylabel("pulse width, µs")
    if shown:
        _draw_error(rows[2], shown, times)
        _draw_planes(panes[1], shown, job.trajectory.loop_start)
    for axes in rows:
        axes.grid(alpha=0.3)
        axes.set_xlim(-0.01 * times[-1], 1.01 * times[-1])
        if job.trajectory.loop_start:
            axes.axvline(job.trajectory.loop_start * frame_s, color="0.5", ls="--", lw=1)
    rows[-1].set_xlabel(
        "time, s" + (" (repeats from the dashed line on)" if job.trajectory.loop_start else "")
    )
    handles, labels = rows[0].get_legend_handles_labels()
    left.legend(handles, labels, loc="outside lower center", ncols=6, frameon=False, fontsize=8)
    save(figure, path)


def _draw_servos(axes: Axes, job: PlannedJob, times: Floats, values: Floats) -> None:
    """Draw one line per servo; those of one leg have one colour."""
    ends = job.ends
    groups = len(ends) if len(ends) > 1 else len(job.servos)
    for index, servo in enumerate(job.servos):
        number, colour, dash = index, f"C{index % COLOURS}", "--" if index >= COLOURS else "-"
        for position, end in enumerate(ends):
            if len(ends) > 1 and index in end.columns:
                number, colour, dash = (
                    position,
                    f"C{position}",
                    ("-", "--", ":")[end.columns.index(index) % 3],
                )
        # The last value is held to the end of its frame.
        column = np.append(values[:, index], values[-1, index])
        width = _width(number, groups)
        axes.step(times, column, dash, where="post", color=colour, label=servo.name, lw=width)
    axes.margins(y=0.1)


def _width(index: int, count: int) -> float:
    """Return a line's width: the first is the widest, so that it still shows beside one drawn over it."""
    return THINNEST + (WIDEST - THINNEST) * (1 - index / max(1, count - 1)) if count > 1 else THINNEST


def _draw_error(axes: Axes, tracks: Sequence[Track], times: Floats) -> None:
    for index, track in enumerate(tracks):
        error = 1000 * track.error
        width = _width(index, len(tracks))
        axes.step(times, np.append(error, error[-1]), where="post", color=f"C{index}", lw=width)
    axes.set_ylabel("error of the pulses, mm")
    axes.set_ylim(bottom=0)


def _draw_planes(figure: SubFigure, tracks: Sequence[Track], loop_start: int) -> None:
    """Draw the paths from above and, unless they are in the ground plane, from the side."""
    flat = all(track.kind == "base" for track in tracks)
    panels = figure.subplots(1 if flat else 2, 1, squeeze=False, height_ratios=None if flat else [1.6, 1])[
        :, 0
    ]
    views = (("x", "y", "from above"), ("x", "z", "from the side"))
    for axes, (x, y, title) in zip(panels, views, strict=False):
        columns = ["xyz".index(x), "xyz".index(y)]
        for index, track in enumerate(tracks):
            # The loop's end leads back to its beginning.
            around = np.vstack((track.planned, track.planned[loop_start : loop_start + 1]))
            planned, achieved = (1000 * points[:, columns] for points in (around, track.made))
            axes.plot(*planned.T, "-", color=f"C{index}", lw=1.5, label=track.name)
            label = "with whole cycles" if index == len(tracks) - 1 else None
            axes.plot(*achieved.T, ".", color="k", ms=2, zorder=3, label=label)
        plane(axes, x, y, title)
    panels[0].legend(fontsize=8, loc="best")
