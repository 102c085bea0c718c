"""A three-wheel base under orders.

In: a job with [drive]. Out: `Roller`, wheel speeds that go over from one order's to the next one's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from servogen.drive.commands import STOP, WAYS, Rates, unknown
from servogen.errors import InputError
from servogen.job import PlannedJob
from servogen.kinematics.protocol import DrivingRobot
from servogen.motion.trajectory import Floats

RAMP_S = 0.2
"""From one speed of the base to another."""

DEFAULT_TURN_DEG_S = 45.0


def roller(job: PlannedJob, base: DrivingRobot, rates: Rates) -> Roller:
    """The ways that the wheels' servos allow; at least one of them."""
    columns = job.wheel_columns
    moving = base.body_speed(np.nan_to_num(job.trajectory.angles[:, columns]))
    speed = float(np.hypot(moving[:, 0], moving[:, 1]).max())
    if rates.way_mm is not None:
        speed = rates.way_mm / 1000
    turn = math.radians(DEFAULT_TURN_DEG_S if rates.turn_deg is None else rates.turn_deg)
    speeds, refused = {}, None
    for word, (x, y, z) in WAYS.items():
        wheels = np.zeros(len(job.servos))
        try:
            wheels[columns] = base.wheel_speeds((x * speed, y * speed, z * turn))
            for servo, each in zip(job.servos, wheels.tolist(), strict=True):
                servo.width_us(each)
            speeds[word] = wheels
        except InputError as error:
            refused = refused or error
    if refused and not speeds:
        raise refused
    return Roller(job, {**speeds, STOP: np.zeros(len(job.servos))})


@dataclass(slots=True, eq=False)
class Roller:
    """Wheel speeds that go over into those of the order in `RAMP_S`."""

    job: PlannedJob
    speeds: Mapping[str, Floats]
    wanted: str = STOP
    _before: Floats = field(init=False)
    _now: Floats = field(init=False)
    _since: float | None = None
    _moment: float = 0.0

    def __post_init__(self) -> None:
        self._before = self._now = self.speeds[STOP]

    @property
    def words(self) -> tuple[str, ...]:
        return tuple(self.speeds)

    def order(self, word: str) -> None:
        if word not in self.speeds:
            raise unknown(word, self.words)
        self.wanted, self._before, self._since = word, self._now, self._moment

    def at(self, seconds: float) -> Floats | None:
        self._moment = seconds
        share = 1.0 if self._since is None else min(1.0, (seconds - self._since) / RAMP_S)
        self._now = self._before + share * (self.speeds[self.wanted] - self._before)
        return self._now
