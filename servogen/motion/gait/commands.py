"""Walks on command: the directions of a walking robot, each as start, cycle and stop, from stance to stance.

In: walks as frames. Out: `CommandedDirection`, which `job` plans and the player puts on the chip.

    stance ─▶ start ─▶ cycle ─▶ cycle … ─▶ stop ─▶ stance      backward: the same angles, the last first
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from servogen.errors import InputError
from servogen.motion.trajectory import Floats

STRAIGHT, TURN = ("forward", "back"), ("left", "right")
"""The names of the directions: each pair is one walk, played forward and backward."""

SAME_RAD = 1e-6
"""Angles of two walks that differ by less are equal."""


@dataclass(frozen=True, slots=True, eq=False)
class CommandedDirection:
    """`angles` (frames + 1, servos) from the stance back to the stance, which is the last row.

    Rows `first` up to `end` are one cycle; the rows before are the start, those after the stop.
    """

    name: str
    angles: Floats
    first: int
    end: int

    def reversed(self, name: str) -> CommandedDirection:
        """Return the direction walked backward: feet that lifted land, and vice versa."""
        last = len(self.angles) - 1
        return CommandedDirection(name, self.angles[::-1], last - self.end, last - self.first)


def commanded_direction(
    name: str, endless: Floats, loop_start: int, walks: Iterable[Floats]
) -> CommandedDirection:
    """Return a direction made from an endless walk and `walks` of 1, 2, … cycles, frames by servos.

    Raises InputError if none of the walks begins as the endless one does.
    """
    for angles in walks:
        last = len(angles) - 1
        while last and np.allclose(angles[last - 1], angles[-1], atol=SAME_RAD):
            last -= 1
        whole = angles[: last + 1]
        if len(whole) > len(endless) and np.allclose(whole[: len(endless)], endless, atol=SAME_RAD):
            # Between a step on the spot and a walk the robot stands for one frame, which is omitted.
            moves = np.append(True, np.abs(np.diff(whole, axis=0)).max(axis=1) > SAME_RAD)
            first, end = (int(moves[1 : row + 1].sum()) for row in (loop_start, len(endless)))
            return CommandedDirection(name, whole[moves], first, end)
    raise InputError("endless-motion", "the walk cannot be stopped: its gait leaves a leg behind")
