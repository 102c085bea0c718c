"""A picture of a walk: gait diagram, stability, springs, support polygon, foot paths.

In: a robot, its gait and `Walk`. Out: a PNG, SVG or PDF file.

    ┌ gait diagram ────┬ from above: feet, support polygon ┐
    ├ stability margin ┤ where the margin is least         │
    ├ springs ─────────┼ a foot's path from the side ──────┤
    └──────────────────┴───────────────────────────────────┘
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from servogen.kinematics.protocol import WalkingRobot, mounts_of
from servogen.motion.gait.phases import Gait
from servogen.motion.gait.stability import support_polygon
from servogen.motion.gait.walk import Walk
from servogen.motion.trajectory import Floats
from servogen.report.gait_facts import GaitFacts
from servogen.report.pictures import check_suffix, new_figure, plane, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GROUND, AIR = "0.25", "0.88"


def gait_plot(robot: WalkingRobot, gait: Gait, planned: Walk, facts: GaitFacts, path: Path) -> None:
    """Draw a walk to `path`. Raises InputError for an unknown ending, ToolError without matplotlib."""
    check_suffix(path)
    figure = new_figure(13, 8, f"{robot.name}: the gait '{gait.name}', duty factor {gait.duty}")
    panes: Any = figure.subfigures(1, 2, width_ratios=[1.2, 1])
    left, right = panes
    frames = len(planned.trajectory.angles)
    times = facts.cycle_s / planned.frames_per_cycle * np.arange(frames + 1, dtype=np.float64)
    rows = left.subplots(3, 1, sharex=True)
    _draw_diagram(rows[0], planned, times)
    _draw_margin(rows[1], planned, facts, times)
    _draw_springs(rows[2], planned, times)
    for axes in rows:
        axes.set_xlim(0, times[-1])
        if planned.trajectory.loop_start:
            axes.axvline(times[planned.trajectory.loop_start], color="tab:red", ls="--", lw=1)
    again = " (repeats from the red line on)" if planned.trajectory.loop_start else ""
    rows[-1].set_xlabel(f"time, s{again}")
    above, side = right.subplots(2, 1, height_ratios=[1.6, 1])
    _draw_above(above, robot, planned, facts)
    _draw_side(side, planned)
    save(figure, path)


def _draw_diagram(axes: Axes, planned: Walk, times: Floats) -> None:
    """Draw one bar per leg: dark on the ground, light in the air."""
    for row in range(len(planned.legs)):
        axes.broken_barh([(0.0, float(times[-1]))], (row - 0.35, 0.7), color=AIR)
        axes.broken_barh(_stretches(planned.ground[:, row], times), (row - 0.35, 0.7), color=GROUND)
    axes.set_yticks(range(len(planned.legs)), planned.legs)
    axes.set_ylim(len(planned.legs) - 0.5, -0.5)
    axes.set_title("gait diagram: dark on the ground, light in the air", fontsize=10)


def _stretches(
    down: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], times: Floats
) -> list[tuple[float, float]]:
    """Return (start, length) of each stretch of frames on the ground."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], down, [False])).astype(int)))
    return [(float(times[a]), float(times[b] - times[a])) for a, b in edges.reshape(-1, 2).tolist()]


def _draw_margin(axes: Axes, planned: Walk, facts: GaitFacts, times: Floats) -> None:
    axes.set_ylabel("stability margin, mm")
    if facts.margin is None:
        axes.set_yticks([])
        axes.set_title("fewer than three legs: something else must hold the robot", fontsize=10)
        return
    finite = np.where(np.isinf(planned.margins), np.nan, 1000 * planned.margins)
    axes.step(times, np.append(finite, finite[-1]), where="post", color="tab:blue")
    worst = float(times[facts.margin_frame])
    if math.isfinite(facts.margin):
        axes.plot(worst, 1000 * facts.margin, "o", color="tab:red", ms=5)
    axes.axhline(0, color="0.5", lw=1)
    axes.margins(y=0.15)
    axes.grid(alpha=0.3)
    minimum = (
        f"at least {1000 * facts.margin:z.1f} mm" if math.isfinite(facts.margin) else "no foot on the ground"
    )
    axes.set_title(
        f"centre of mass inside the support polygon: {minimum} in frame {facts.margin_frame}", fontsize=10
    )


def _draw_springs(axes: Axes, planned: Walk, times: Floats) -> None:
    springs = 1000 * np.linalg.norm(planned.corrections, axis=2)
    count = len(planned.legs)
    for index, leg in enumerate(planned.legs):
        column = np.append(springs[:, index], springs[-1, index])
        width = 3.0 - 1.8 * index / max(1, count - 1)
        axes.step(times, column, where="post", color=f"C{index}", lw=width, label=leg)
    axes.set_ylabel("spring's correction, mm")
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
    axes.set_title(
        f"deflection of the springs: at most {1000 * planned.largest_correction_m:z.2f} mm", fontsize=10
    )


def _draw_above(axes: Axes, robot: WalkingRobot, planned: Walk, facts: GaitFacts) -> None:
    """Draw foot paths, the body, and the support polygon of the frame with the smallest margin."""
    mounts = mounts_of(robot)
    body = 1000 * support_polygon(np.array([[mount.x, mount.y] for mount in mounts]))
    axes.fill(*body.T, facecolor="0.93", edgecolor="0.6", zorder=0)
    for index, leg in enumerate(planned.legs):
        path = 1000 * _round(planned, index)[:, :2]
        axes.plot(*path.T, color=f"C{index}", lw=1.5)
        x, left = float(path[:, 0].mean()), mounts[index].y > 0
        y, away = (path[:, 1].max(), 4) if left else (path[:, 1].min(), -4)
        axes.annotate(
            leg,
            (x, float(y)),
            (0, away),
            textcoords="offset points",
            ha="center",
            va="bottom" if left else "top",
            color=f"C{index}",
            fontsize=9,
        )
    axes.margins(y=0.12)
    plane(
        axes,
        "x (forward)",
        "y (left)",
        "from above: foot paths and the support polygon with the smallest margin",
    )
    if facts.margin is None:
        axes.set_title("from above: the foot's path", fontsize=10)
        return
    stand = (
        1000
        * (planned.feet + planned.corrections)[facts.margin_frame, planned.ground[facts.margin_frame], :2]
    )
    if len(stand):
        corners = support_polygon(stand)
        axes.fill(*corners.T, facecolor="tab:green", alpha=0.2, edgecolor="tab:green", zorder=1)
        axes.plot(
            *stand.T, "o", color="tab:green", ms=6, label=f"on the ground in frame {facts.margin_frame}"
        )
    centre = 1000 * np.array([planned.centre.real, planned.centre.imag])
    axes.plot(*centre, "k+", ms=12, mew=2, label="centre of mass")
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, frameon=False)


def _draw_side(axes: Axes, planned: Walk) -> None:
    """Draw the first foot's path in the body's frame, with a dot for each frame."""
    points = 1000 * _round(planned, 0)
    axes.plot(points[:, 0], points[:, 2], "-", color="C0", lw=1.5)
    down = planned.ground[planned.trajectory.loop_start :, 0]
    down = np.append(down, down[0])
    axes.plot(points[down, 0], points[down, 2], "o", color=GROUND, ms=4, label="on the ground")
    axes.plot(points[~down, 0], points[~down, 2], "o", color="tab:orange", ms=4, label="in the air")
    plane(axes, "x (forward)", "z", f"the foot of {planned.legs[0]} from the side")
    axes.legend(fontsize=8, loc="upper right")


def _round(planned: Walk, leg: int) -> Floats:
    """Return the points (n, 3) of a foot over one round of the loop, back to its beginning."""
    start = planned.trajectory.loop_start
    return np.vstack((planned.feet[start:, leg], planned.feet[start : start + 1, leg]))
