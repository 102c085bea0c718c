"""The kinematic scheme of a robot: its joints by their usual symbols, from the side and from above.

In: a `Robot`: an arm, a body with its legs, or a base on wheels, which is drawn from above. Out: a PNG, SVG
or PDF file. A turning joint is a circle seen along its axis, else a bar along it; a sliding joint is a square
with its axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from servogen.kinematics.forward import link_frames
from servogen.kinematics.protocol import DrivingRobot, mounts_of
from servogen.kinematics.transforms import apply, mount_matrix
from servogen.motion.trajectory import Floats
from servogen.report.pictures import check_suffix, new_figure, save
from servogen.report.sticks import stick
from servogen.robot.model import Arm, Robot

ALONG = 0.7
"""The cosine from which on a joint is seen along its axis: 45°."""


def scheme_plot(robot: Robot, path: Path) -> None:
    """Draw a robot at home. Raises InputError for an unknown ending, ToolError without matplotlib."""
    check_suffix(path)
    figure = new_figure(9, 4.8, f"{robot.name} at home")
    lines, axes, ends = _parts(robot)
    corners = np.concatenate(lines)
    size = float(np.ptp(corners, axis=0).max()) or 1.0
    reach = 0 if np.ptp(corners[:, 0]) >= np.ptp(corners[:, 1]) else 1
    views = [("from above", (0, 1))]
    if np.ptp(corners[:, 2]) > 0:
        views.insert(0, ("from the front" if reach else "from the side", (reach, 2)))
    panes: Any = figure.subplots(1, len(views), squeeze=False)[0]
    for pane, (title, (right, up)) in zip(panes, views, strict=True):
        names: dict[tuple[float, float], list[str]] = {}
        for line in lines:
            pane.plot(line[:, right], line[:, up], color="0.35", lw=2, zorder=1)
        for name, end in ends:
            pane.plot(end[right], end[up], "k>" if not name else "k.", ms=7, zorder=3)
            if name:
                names.setdefault((round(float(end[right])), round(float(end[up]))), []).append(name)
        for axis in axes:
            x, y = _joint(pane, axis, (right, up), size)
            if axis.name:
                names.setdefault((round(x), round(y)), []).append(axis.name)
        for place, together in names.items():  # joints behind each other
            text = ", ".join(together)
            pane.annotate(text, place, xytext=(8, 8), textcoords="offset points", fontsize=9)
        pane.set_title(title, fontsize=10)
        pane.set_xlabel(f"{'xyz'[right]}, mm")
        pane.set_ylabel(f"{'xyz'[up]}, mm")
        pane.set_aspect("equal", adjustable="datalim")
        pane.margins(0.15)
    save(figure, path)


class DrawnJoint(NamedTuple):
    """A joint's name and kind, a point (3,) of its axis in metres, and its direction (3,).

    Of legs that are the same only the first one's joints have names.
    """

    name: str
    kind: str
    at: Floats
    direction: Floats


Parts = tuple[list[Floats], list[DrawnJoint], list[tuple[str, Floats]]]
"""Lines (corners, 3) in mm, the joints, and where each limb ends, in mm, with its name if it has one."""


def _parts(robot: Robot) -> Parts:
    """Return what is drawn of a robot: an arm, a body and its legs, or the outline of a base."""
    if isinstance(robot, DrivingRobot):
        flat = [
            1000 * np.stack([line.real, line.imag, np.zeros(len(line))], axis=1) for line in robot.outline()
        ]
        wheels = flat[-robot.wheel_count :]
        return flat, [], [(f"wheel {number}", line.mean(axis=0)) for number, line in enumerate(wheels, 1)]
    lines: list[Floats] = []
    axes: list[DrawnJoint] = []
    ends: list[tuple[str, Floats]] = []
    for limb in robot.limbs:
        home = np.array([[joint.home for joint in limb.arm.joints]])
        place = np.eye(4) if limb.mount is None else mount_matrix(limb.mount)
        lines.append(1000 * (stick(limb.arm, home)[0] @ place[:3, :3].T + place[:3, 3]))
        ends.append((limb.name if limb.mount else "", lines[-1][-1]))
        axes += [
            DrawnJoint(
                "" if len(lines) > 1 else axis.name,
                axis.kind,
                apply(place, axis.at),
                place[:3, :3] @ axis.direction,
            )
            for axis in joint_axes(limb.arm, home)
        ]
    mounts = sorted(mounts_of(robot), key=lambda mount: math.atan2(mount.y, mount.x))
    if len(mounts) > 1:
        lines.append(1000 * np.array([(mount.x, mount.y, mount.z) for mount in (*mounts, mounts[0])]))
    return lines, axes, ends


def _joint(pane: Any, axis: DrawnJoint, view: tuple[int, int], size: float) -> tuple[float, float]:
    """Draw a joint's symbol where it is in a view, and return that place in mm."""
    x, y = 1000 * axis.at[[*view]]
    end = 0.05 * size * axis.direction[[*view]]
    if axis.kind == "sliding":
        pane.plot([x - 2 * end[0], x + 2 * end[0]], [y - 2 * end[1], y + 2 * end[1]], "C1", lw=1)
        pane.plot(x, y, "s", mfc="w", mec="C1", ms=11, zorder=2)
    elif np.hypot(*axis.direction[[*view]]) < ALONG:
        pane.plot(x, y, "o", mfc="w", mec="C0", ms=11, zorder=2)
    else:
        pane.plot([x - end[0], x + end[0]], [y - end[1], y + end[1]], "C0", lw=8, zorder=2)
    return float(x), float(y)


def joint_axes(arm: Arm, joints: Floats) -> Iterator[DrawnJoint]:
    """Yield the axis of each joint.

    It is the z axis of the frame before its row, in the modified convention that of the frame behind it.
    """
    frames = link_frames(arm, joints)[0]
    for index, row in enumerate(arm.rows):
        if row.joint is not None:
            frame = frames[index + (arm.convention == "modified")]
            joint = arm.joints[row.joint]
            yield DrawnJoint(joint.name, joint.kind, frame[:3, 3], frame[:3, 2])
