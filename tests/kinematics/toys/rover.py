"""The kind `rover`: two wheels on one axle, each turned by a servo, and a castor, which cannot go sideways.

In: its file; wheel speeds (..., 2), left and right, in rad/s, forward positive. Out: `Rover`.

    left  ▮──┬──▮ right     vx = r (ωl + ωr) / 2      Ω = r (ωr - ωl) / b      vy = 0
             ▲ x            a route turns on the spot at each corner, the shorter way round
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from servogen.errors import InputError
from servogen.kinematics.mobility import Mobility, manoeuvrability
from servogen.kinematics.protocol import Answer, Directions, RobotKind, Routine, Stretch
from servogen.kinematics.transforms import Complexes, Floats
from servogen.robot.arm_file import Find, RobotKeys
from servogen.robot.model import Dimensions, Limb
from servogen.toml.file import Document, Table

SMALL = 1e-12


@dataclass(frozen=True, slots=True)
class Rover:
    kind: ClassVar[str] = "rover"

    name: str
    title: str
    wheel_radius: float
    track: float
    dimensions: Dimensions = "user"
    source: str = ""

    @property
    def limbs(self) -> tuple[Limb, ...]:
        return ()

    @property
    def wheel_count(self) -> int:
        return 2

    def wheel_speeds(self, body: ArrayLike) -> Floats:
        vx, vy, turn = np.moveaxis(np.asarray(body, float), -1, 0)
        if np.abs(vy).max() > SMALL:
            raise InputError("unknown-name", f"{self.name} cannot go sideways")
        spin = turn * self.track / 2
        return np.stack([vx - spin, vx + spin], axis=-1) / self.wheel_radius

    def body_speed(self, wheels: ArrayLike) -> Floats:
        left, right = np.moveaxis(np.asarray(wheels, float) * self.wheel_radius, -1, 0)
        return np.stack([(left + right) / 2, np.zeros_like(left), (right - left) / self.track], axis=-1)

    def route(
        self, corners: Sequence[Sequence[float]], directions: Directions = "any"
    ) -> tuple[Stretch, ...]:
        if directions != "any":
            raise InputError("unknown-name", f"{self.name} has no six directions")
        heading, stretches = 0.0, []
        for start, end in pairwise([*corners, corners[0]]):
            x, y = end[0] - start[0], end[1] - start[1]
            if x or y:
                stretches += [*self._turn(math.atan2(y, x) - heading), self._ahead(math.hypot(x, y))]
                heading = math.atan2(y, x)
        return (*stretches, *self._turn(-heading))

    def routine(self, routine: Routine, directions: Directions = "any") -> tuple[Stretch, ...]:
        if routine.name != "ahead" or routine.distance is None:
            raise InputError("unknown-name", f"{self.name} knows no routine but 'ahead', with a distance")
        return (self._ahead(routine.distance),)

    def _turn(self, angle: float) -> list[Stretch]:
        angle = math.remainder(angle, 2 * math.pi)
        arc = angle * self.track / 2
        wheels = (-arc / self.wheel_radius, arc / self.wheel_radius)
        return (
            [Stretch(abs(arc), wheels, f"turn by {math.degrees(angle):.0f}°")] if abs(angle) > SMALL else []
        )

    def _ahead(self, distance: float) -> Stretch:
        return Stretch(distance, (distance / self.wheel_radius,) * 2, f"{1000 * distance:.0f} mm ahead")

    def outline(self) -> tuple[Complexes, ...]:
        axle = np.array([-0.5j, 0.5j]) * self.track
        return (
            axle,
            axle[0] + np.array([-1, 1]) * self.wheel_radius,
            axle[1] + np.array([-1, 1]) * self.wheel_radius,
        )


class RoverTable(RobotKeys, Table):
    wheel_diameter_mm: float = Field(gt=0)
    track_mm: float = Field(gt=0)


def _read(document: Document, table: RoverTable, find: Find) -> Rover:
    return Rover(table.name, table.title, table.wheel_diameter_mm / 2000, table.track_mm / 1000)


def _details(rover: Rover) -> Answer:
    return {"wheel_radius_m": rover.wheel_radius, "track_m": rover.track}


def _mobility(rover: Rover) -> Mobility:
    return Mobility(
        4, ("turning", "turning"), 0, 2, manoeuvrability(2), "in the plane: ahead, and about its axle"
    )


ROVER = RobotKind("rover", RoverTable, _read, _details, _mobility)
