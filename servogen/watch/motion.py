"""The motion of a job for the page: its angles frame by frame, and where each pose is in it and in the text.

In: a planned job. Out: values that JSON can hold; angles in radians, frames from 0 on.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import zip_longest
from typing import Any

import numpy as np

from servogen.job import PlannedJob
from servogen.job.schema import MotionTable

MAX_RUNS = 4000
"""The maximum number of different frames in a row of a motion that is sent to the page."""
DIGITS = 4
"""The decimals of an angle in radians."""


def motion_runs(job: PlannedJob) -> Mapping[str, Any] | None:
    """Return the frames of a job, equal ones counted together; None: too many differ, or nothing moves."""
    motion = job.trajectory
    if job.section is None or not len(motion.angles):
        return None
    angles = np.round(motion.angles, DIGITS)
    alike = (angles[1:] == angles[:-1]) | (np.isnan(angles[1:]) & np.isnan(angles[:-1]))
    begins = np.concatenate(([0], np.flatnonzero(~alike.all(axis=1)) + 1))
    if len(begins) > MAX_RUNS:
        return None
    counts = np.diff(np.append(begins, len(angles)))
    rows = [[None if np.isnan(angle) else float(angle) for angle in angles[begin]] for begin in begins]
    return {
        "servos": [servo.name for servo in job.servos],
        "period_s": float(motion.clock.seconds(motion.period)),
        "frames": len(angles),
        "loop_start": motion.loop_start,
        "runs": [[int(count), row] for count, row in zip(counts, rows, strict=True)],
    }


def pose_begins(job: PlannedJob) -> list[tuple[int, int]]:
    """Return (the number of a pose of [motion], from 0 on; the frame that it begins in), in order."""
    if not isinstance(job.section, MotionTable):
        return []
    return [(int(part.name.removeprefix("pose ")) - 1, part.begin) for part in job.parts]


def pose_lines(job: PlannedJob) -> list[tuple[int, int]]:
    """Return for each pose the line of the text that it begins in, and the number of its lines."""
    places = [job.document.place("motion", "poses", index).line or 1 for index in range(len(job.poses))]
    return [(line, max(1, after - line)) for line, after in zip_longest(places, places[1:], fillvalue=0)]
