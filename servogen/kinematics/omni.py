"""The three-wheel omnidirectional base: body speed from wheel speeds and back, its 27 motions, its encoders.

In: an `OmniBase`; wheel speeds (..., 3) in rad/s, body speeds (..., 3) as vx, vy in m/s and Ω in rad/s.
Body frame: x at 0°, z up, Ω > 0 counter-clockwise; a wheel's ω > 0 is the source's "clockwise".

        ▲ y  1        wheel 1 at  60° drives towards -30°     r ω1 =  (√3/2) vx - vy/2 - l Ω
        │  ╱          wheel 2 at 300° drives towards 210°     r ω2 = -(√3/2) vx - vy/2 - l Ω
    3 ──┼─────▶ x     wheel 3 at 180° drives towards  90°     r ω3 =               vy  - l Ω
        │  ╲
             2
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import hypot, pi, sin
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.kinematics.transforms import Floats
from servogen.robot.model import OmniBase

_HALF_ROOT = float(np.sqrt(3) / 2)
SIGN_NAMES: Mapping[int, str] = MappingProxyType({1: "clockwise", 0: "stop", -1: "counter-clockwise"})


def wheel_speeds(base: OmniBase, body: ArrayLike) -> Floats:
    """ω1, ω2, ω3 (..., 3) that give the body speed (vx, vy, Ω) (..., 3)."""
    vx, vy, turn = np.moveaxis(np.asarray(body, float), -1, 0)
    spin = base.wheel_distance * turn
    one, two, three = _HALF_ROOT * vx - vy / 2 - spin, -_HALF_ROOT * vx - vy / 2 - spin, vy - spin
    return np.stack([one, two, three], axis=-1) / base.wheel_radius


def body_speed(base: OmniBase, wheels: ArrayLike) -> Floats:
    """(vx, vy, Ω) (..., 3) of the wheel speeds ω1, ω2, ω3 (..., 3)."""
    one, two, three = np.moveaxis(np.asarray(wheels, float), -1, 0)
    r = base.wheel_radius
    vx = r * (one - two) / np.sqrt(3)
    vy = r * (-one - two + 2 * three) / 3
    turn = -r * (one + two + three) / (3 * base.wheel_distance)
    return np.stack([vx, vy, turn], axis=-1)


@dataclass(frozen=True, slots=True)
class OmniMotion:
    """One row of table 10.1: the wheels' signs and the motion that follows.

    `direction_deg` is the direction of the centre at the start, None if it stands; `radius` is in wheel
    distances l; `turning` is the sign of Ω (1 counter-clockwise).
    """

    signs: tuple[int, int, int]
    kind: Literal["stop", "translation", "turning", "circle"]
    direction_deg: int | None
    turning: int
    radius: int | None
    size: Literal["small", "medium", "large"] | None


_SIZES: dict[int, Literal["small", "medium", "large"]] = {1: "small", 2: "medium", 4: "large"}


def motion_of(signs: tuple[int, int, int]) -> OmniMotion:
    """The motion for wheels at equal speed with these signs: 1 clockwise, 0 stop, -1 counter-clockwise."""
    if len(signs) != 3 or any(sign not in SIGN_NAMES for sign in signs):
        raise InputError(
            "bad-option", f"{signs} are no wheel signs", hint="three of 1 (clockwise), 0 (stop), -1"
        )
    # with r = 1 and l = 1 the speed of the centre over |Ω| is the radius in wheel distances
    vx, vy, turn = body_speed(OmniBase("", "", 1.0, 1.0, 1.0, 1), signs).tolist()
    speed, total = hypot(vx, vy), sum(signs)
    moving = speed > 1e-9
    direction = round(float(np.degrees(np.arctan2(vy, vx)))) % 360 if moving else None
    turning = -1 if total > 0 else 1 if total < 0 else 0
    if not moving:
        return OmniMotion(signs, "turning" if turning else "stop", None, turning, None, None)
    if not turning:
        return OmniMotion(signs, "translation", direction, 0, None, None)
    radius = round(speed / abs(turn))
    return OmniMotion(signs, "circle", direction, turning, radius, _SIZES[radius])


@cache
def table() -> tuple[OmniMotion, ...]:
    """Table 10.1: all 27 combinations of clockwise, stop and counter-clockwise."""
    return tuple(motion_of((one, two, three)) for one, two, three in product((1, 0, -1), repeat=3))


@cache
def directions() -> Mapping[int, tuple[int, int, int]]:
    """The six directions in degrees in which the base goes without turning, and the wheels' signs."""
    found = {row.direction_deg: row.signs for row in table() if row.kind == "translation"}
    return MappingProxyType({angle: signs for angle, signs in sorted(found.items()) if angle is not None})


@dataclass(frozen=True, slots=True)
class Travel:
    """What the driven wheels do while the base goes a way along one of the six directions."""

    distance_m: float
    wheel_m: float
    motor_turns: float
    counts: float

    @property
    def whole_counts(self) -> int:
        return round(self.counts)

    @property
    def rounding_m(self) -> float:
        """How much farther than asked the base goes with whole counts."""
        return self.distance_m * (self.whole_counts / self.counts - 1) if self.counts else 0.0


def circumference(base: OmniBase) -> float:
    """The way of a wheel in one turn, metres."""
    return 2 * pi * base.wheel_radius


def travel(base: OmniBase, distance_m: float) -> Travel:
    """Wheel way L sin 60°, motor turns and encoder counts for a way L along one of the six directions."""
    wheel = distance_m * sin(pi / 3)
    turns = base.gear * wheel / circumference(base)
    return Travel(distance_m, wheel, turns, base.counts_per_turn * turns)


def wheel_counts(base: OmniBase, displacement: ArrayLike) -> Floats:
    """Encoder counts (..., 3) of a straight displacement (x, y, angle) (..., 3): metres and radians."""
    turns = wheel_speeds(base, displacement) * base.gear / (2 * pi)
    return np.asarray(turns * base.counts_per_turn)


def sensor_angles(base: OmniBase) -> tuple[float, ...]:
    """The directions of the distance sensors, radians from the x axis (the camera's), evenly spread."""
    return tuple(2 * pi * index / base.sensors for index in range(base.sensors))
