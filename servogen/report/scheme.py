"""The kinematic scheme of an arm: its joints by their usual symbols, from the side and from above.

In: an `Arm`. Out: a PNG, SVG or PDF file. A turning joint is a circle seen along its axis, else a bar along
it; a sliding joint is a square with its axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from servogen.kinematics.forward import link_frames
from servogen.motion.trajectory import Floats
from servogen.report.pictures import check_suffix, new_figure, save
from servogen.report.sticks import stick
from servogen.robot.model import Arm

ALONG = 0.7
"""The cosine from which on a joint is seen along its axis: 45°."""


def scheme_plot(arm: Arm, path: Path) -> None:
    """Draw an arm at home. Raises InputError for an unknown ending, ToolError without matplotlib."""
    check_suffix(path)
    figure = new_figure(9, 4.8, f"{arm.name} at home")
    panes: Any = figure.subplots(1, 2)
    home = np.array([[joint.home for joint in arm.joints]])
    corners = 1000 * stick(arm, home)[0]
    size = float(np.ptp(corners, axis=0).max()) or 1.0
    reach = 0 if np.ptp(corners[:, 0]) >= np.ptp(corners[:, 1]) else 1
    views = ("from the side", (reach, 2)), ("from above", (0, 1))
    for pane, (title, (right, up)) in zip(panes, views, strict=True):
        names: dict[tuple[float, float], list[str]] = {}
        pane.plot(corners[:, right], corners[:, up], color="0.35", lw=2, zorder=1)
        pane.plot(corners[-1, right], corners[-1, up], "k>", ms=7, zorder=3)
        for name, kind, at, axis in joint_axes(arm, home):
            x, y = 1000 * at[[right, up]]
            end = 0.05 * size * axis[[right, up]]
            if kind == "sliding":
                pane.plot([x - 2 * end[0], x + 2 * end[0]], [y - 2 * end[1], y + 2 * end[1]], "C1", lw=1)
                pane.plot(x, y, "s", mfc="w", mec="C1", ms=11, zorder=2)
            elif np.hypot(*axis[[right, up]]) < ALONG:
                pane.plot(x, y, "o", mfc="w", mec="C0", ms=11, zorder=2)
            else:
                pane.plot([x - end[0], x + end[0]], [y - end[1], y + end[1]], "C0", lw=8, zorder=2)
            names.setdefault((round(float(x)), round(float(y))), []).append(name)
        for place, together in names.items():  # joints behind each other
            text = ", ".join(together)
            pane.annotate(text, place, xytext=(8, 8), textcoords="offset points", fontsize=9)
        pane.set_title(title, fontsize=10)
        pane.set_xlabel(f"{'xyz'[right]}, mm")
        pane.set_ylabel(f"{'xyz'[up]}, mm")
        pane.set_aspect("equal", adjustable="datalim")
        pane.margins(0.15)
    save(figure, path)


def joint_axes(arm: Arm, joints: Floats) -> Iterator[tuple[str, str, Floats, Floats]]:
    """Yield the name, the kind, a point (3,) and the direction (3,) of each joint's axis, in metres.

    It is the z axis of the frame before its row, in the modified convention that of the frame behind it.
    """
    frames = link_frames(arm, joints)[0]
    for index, row in enumerate(arm.rows):
        if row.joint is not None:
            frame = frames[index + (arm.convention == "modified")]
            joint = arm.joints[row.joint]
            yield joint.name, joint.kind, frame[:3, 3], frame[:3, 2]
