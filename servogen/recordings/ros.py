"""ROS `trajectory_msgs/JointTrajectory`: positions of joints in radians, each at its time_from_start.

joint_names: [j1, j2]                  the message alone, or inside a goal or a display of a trajectory;
points:                                times as {secs, nsecs} (ROS 1), {sec, nanosec} (ROS 2)
- positions: [0.0, 1.57]               or a number of seconds; with velocities (and accelerations)
  velocities: [0.0, 0.0]               the joints follow cubics (quintics) between the points, as ROS's
  time_from_start: {sec: 1}            joint_trajectory_controller does
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from servogen.errors import Location
from servogen.recordings.documents import number, numbers, table, wrong
from servogen.recordings.recording import Floats, RecordedMotion, recording

AROUND = ("goal", "trajectory", "joint_trajectory", "request")
"""The keys of the messages that a trajectory may be inside of."""

MAX_JOINTS = 64
"""The most joints of a recording, several robots' worth: more must be another kind of file."""


def joint_trajectory(document: Any, file: str) -> RecordedMotion:
    """Return the recording in a message. Raises InputError with the key."""
    message, key = _message(document, file)
    names = message["joint_names"]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise wrong(file, f"{key}joint_names", "must be a list of names")
    if len(names) > MAX_JOINTS:
        raise wrong(file, f"{key}joint_names", f"has {len(names)} names: at most {MAX_JOINTS}")
    points = message.get("points")
    if not isinstance(points, list):
        raise wrong(file, f"{key}points", "must be a list of points")
    samples = []
    extra: dict[str, list[list[float]]] = {"velocities": [], "accelerations": []}
    for index, value in enumerate(points):
        here = f"{key}points[{index}]"
        point = table(value, file, here)
        time = _seconds(point.get("time_from_start"), file, f"{here}.time_from_start")
        positions = numbers(point.get("positions"), len(names), file, f"{here}.positions")
        samples.append((time, positions, Location(file, key=here)))
        for order, rows in extra.items():
            if point.get(order):
                rows.append(numbers(point[order], len(names), file, f"{here}.{order}"))
    made = recording(file, names, ["rad"] * len(names), samples)
    speeds = _each(extra["velocities"], len(points))
    accelerations = _each(extra["accelerations"], len(points))
    return replace(
        made, of_joints=True, speeds=speeds, accelerations=accelerations if speeds is not None else None
    )


def _each(rows: list[list[float]], points: int) -> Floats | None:
    """Return the rows if every point has one."""
    return np.array(rows) if rows and len(rows) == points else None


def _message(document: Any, file: str) -> tuple[Mapping[str, Any], str]:
    """Return the message that has joint_names, and the key before its own."""
    key = ""
    for _ in range(len(AROUND) + 1):
        if isinstance(document, list) and len(document) == 1:
            document, key = document[0], f"{key.removesuffix('.')}[0]."
        if not isinstance(document, Mapping):
            break
        if "joint_names" in document:
            return document, key
        inside = next((name for name in AROUND if name in document), None)
        if inside is None:
            break
        document, key = document[inside], f"{key}{inside}."
    raise wrong(
        file,
        key.removesuffix(".") or "joint_names",
        "has no joint_names",
        "a JointTrajectory has joint_names and points, an export of Blender Servo Animation fps and servos",
    )


def _seconds(value: Any, file: str, key: str) -> float:
    """Return a duration in seconds."""
    if not isinstance(value, Mapping):
        return number(value, file, key)
    whole, parts = value.get("sec", value.get("secs", 0)), value.get("nanosec", value.get("nsecs", 0))
    return number(whole, file, key) + number(parts, file, key) / 1e9
