"""The bodies of a watched robot for the page: the physics follows the chip, or the capture, of one window.

In: a subject with a job whose servos move a robot, the place in it, the moment that is shown. Out: a message
with what stays the same, and one for each moment: lines through the bodies, the pose of the body, the forces
under its feet. The physics has its own time, which is in each message: it may be behind the chip's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Any

import numpy as np
import numpy.typing as npt

from servogen.debug.time_machine import TimeMachine
from servogen.errors import InputError
from servogen.twin.live import LiveTwin
from servogen.twin.verdict import TOUCH_N
from servogen.watch.recording import Recording
from servogen.watch.subject import Subject

SLICE_S = 0.025
"""The time that the physics calculates between two pictures; the rest is for the chip and the page."""


class LiveBodies:
    """The physics of one window."""

    def __init__(self, subject: Subject, place: TimeMachine | Recording) -> None:
        """Raise InputError for a subject that moves no robot, ToolError where MuJoCo is missing."""
        if subject.job is None:
            raise InputError("nothing-to-show", "only a job has bodies: a program says nothing about a robot")
        if subject.wanted and subject.placed is None:
            raise InputError(
                "nothing-to-show",
                "the time between the pieces of this capture is unknown, and the bodies move in it",
            )
        self._clock = subject.clock
        self._place = place
        self._twin = LiveTwin(subject.job, subject.clock, place.edges, shown=subject.shown)
        self._height = float(self._twin.moment().pose[2])
        self._sent: tuple[int, bool] | None = None
        self._sensors = subject.image is not None and bool(subject.job.sensors)

    def model(self) -> dict[str, Any]:
        """Return what stays the same while the bodies move."""
        twin, self._sent = self._twin, None  # whoever asks has no moment yet
        lines = twin.moment().lines
        ends = list(accumulate(len(line.frames[0]) for line in lines))
        return {
            "lines": [
                {"colour": line.colour, "width": line.width, "count": len(line.frames[0])} for line in lines
            ],
            "legs": twin.legs,
            "feet": [end - 1 for end in ends[len(lines) - len(twin.legs) :]],
            "touch": TOUCH_N,
            "floating": twin.floating,
            "height": self._height,
            "ground": twin.settings.ground.text(),
            "sensors": self._sensors,
        }

    def follow(self, seconds: float = SLICE_S) -> Iterator[dict[str, Any]]:
        """Go on toward the moment of the place; yield the bodies if they have changed since the last time."""
        now = int(self._place.now)
        there = self._twin.history.follow(now, seconds)
        state = (self._twin.history.step, there)
        if state == self._sent:
            return
        self._sent = state
        moment = self._twin.moment()
        x, y, z, yaw = moment.pose
        behind = 0.0 if there else float(self._clock.seconds(now - self._twin.history.cycle))
        yield {
            "is": "bodies",
            "seconds": round(moment.seconds, 6),
            "behind": round(behind, 3),
            "points": _tenths_of_mm([line.frames[0] for line in moment.lines]),
            "force": np.round(moment.force, 1).tolist(),
            "pose": [
                *_tenths_of_mm([np.array([x, y, z - self._twin.settings.ground.level])]),
                round(float(yaw), 4),
            ],
        }

    def forget(self, cycle: int) -> None:
        """Drop everything from a cycle on, because the chip's inputs changed there."""
        self._twin.history.forget(cycle)


def _tenths_of_mm(metres: Sequence[npt.NDArray[np.float64]]) -> list[int]:
    """Return lengths in tenths of a millimetre, one after the other."""
    flat = np.concatenate([np.zeros(0), *(np.asarray(array).ravel() for array in metres)])
    return list(np.rint(1e4 * flat).astype(int).tolist())
