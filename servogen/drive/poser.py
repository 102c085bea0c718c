"""A robot under orders to go to the poses of its job.

In: a job with [motion] poses. Out: `Poser`, which goes straight from pose to pose.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from servogen.drive.commands import STOP, unknown
from servogen.drive.motions import pose_of
from servogen.job import PlannedJob
from servogen.motion.trajectory import Floats

SLOW_RAD_S = 1.0
"""For a servo whose model does not say how fast it is."""


@dataclass(slots=True, eq=False)
class Poser:
    """Goes to poses of the job, each servo as fast as its model can and all of them in the same time."""

    job: PlannedJob
    _from: Floats = field(init=False)
    _to: Floats = field(init=False)
    _now: Floats = field(init=False)
    _since: float = 0.0
    _moment: float = 0.0

    def __post_init__(self) -> None:
        self._from = self._to = self._now = np.array([servo.neutral for servo in self.job.servos])

    @property
    def words(self) -> tuple[str, ...]:
        names = [pose.name for pose in self.job.poses if pose.name]
        return (*(str(index + 1) for index in range(len(self.job.poses))), *names, STOP)

    def order(self, word: str) -> None:
        if word not in self.words and "=" not in word:
            raise unknown(word, self.words)
        asked = self._now if word == STOP else pose_of(self.job, word)
        self._from, self._since = self._now, self._moment
        self._to = np.where(np.isnan(asked), self._to, asked)

    def at(self, seconds: float) -> Floats | None:
        self._moment = seconds
        takes = max(
            abs(way) / (servo.model.speed or SLOW_RAD_S)
            for way, servo in zip((self._to - self._from).tolist(), self.job.servos, strict=True)
        )
        share = 1.0 if takes == 0 else min(1.0, (seconds - self._since) / takes)
        self._now = self._from + share * (self._to - self._from)
        return self._now
