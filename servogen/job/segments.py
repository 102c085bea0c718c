"""[motion] commands of a job: segments of the motion that inputs choose among.

In: the frames of the motion, the times of each segment. Out: `CommandedDirection`s from the motion's first
frame, the rest, back to it.

    once      rest ─▶ the segment ─▶ its last frame … ─▶ rest
    repeat    rest ─▶ the segment ─▶ the segment … ─▶ its first frame ─▶ rest
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from servogen.job.schema import ChosenSegmentTable, MotionCommandsTable
from servogen.motion import PlannedPoses
from servogen.motion.gait.commands import CommandedDirection
from servogen.motion.trajectory import Floats
from servogen.toml.file import Document, exact

KEY = ("motion", "commands")


def commanded_segments(
    document: Document, table: MotionCommandsTable, planned: PlannedPoses
) -> tuple[PlannedPoses, tuple[CommandedDirection, ...]]:
    """Return the rest, and the segments of the motion. Raises InputError."""
    if "end" in document.data["motion"]:
        raise document.error(
            "conflicting-keys",
            ("motion", "end"),
            "a motion whose segments are commanded has no end",
            "remove it, or commands",
        )
    if not document.data["motion"].get("repeat", True):
        raise document.error(
            "conflicting-keys",
            ("motion", "repeat"),
            "a motion whose segments are commanded waits for commands without end",
            "remove it: each segment has a repeat of its own",
        )
    motion = planned.trajectory
    rest = replace(motion, angles=motion.angles[:1], loop_start=0)
    return replace(planned, trajectory=rest, parts=()), tuple(_segments(document, table, planned))


def _segments(
    document: Document, table: MotionCommandsTable, planned: PlannedPoses
) -> Iterator[CommandedDirection]:
    rest = planned.trajectory.angles[:1]
    for index, row in enumerate(table.segments):
        angles = _frames(document, index, row, planned)
        once, again = (angles, angles[-1:]) if not row.repeat else (angles[:1], np.roll(angles, -1, axis=0))
        whole = np.vstack((once, again, rest, rest))
        yield CommandedDirection(row.name, whole, len(once), len(once) + len(again))


def _frames(document: Document, index: int, row: ChosenSegmentTable, planned: PlannedPoses) -> Floats:
    """Return the frames between the times of a segment. Raises InputError if there is none."""
    motion = planned.trajectory
    frame_s = motion.clock.seconds(motion.period)
    first, end = (round(exact(seconds) / frame_s) for seconds in (row.from_s, row.to_s))
    key, last = (*KEY, "segments", index, "to_s"), len(motion.angles)
    if not first < end <= last:
        raise document.error(
            "out-of-range",
            key,
            f"{row.name} ends at {row.to_s:g} s",
            f"at least a frame after from_s, and at most {float(last * frame_s):g} s, where the motion ends",
        )
    angles = motion.angles[first:end]
    if np.isnan(angles).any() or np.isnan(motion.angles[0]).any():
        raise document.error(
            "no-pulses",
            key,
            f"{row.name}, or the rest before it, has frames without pulses",
            "release no servo in a motion whose segments are commanded",
        )
    return angles
