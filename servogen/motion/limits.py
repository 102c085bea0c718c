"""Limits of joints, and the shortest time in which a law stays within them.

In: the travel of each joint and its limits. Out: a law and a duration for all joints together. The joints are
synchronised: all follow the same law in the same time, so that they start and stop together on a straight
line through joint space.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from servogen.errors import InputError
from servogen.motion.laws import BEND, Law, law
from servogen.motion.trajectory import Floats

SAME_DIGITS = 9
"""Digits to which shares of limits are compared."""

STILL = 1e-9
"""A travel below this (radians, metres) takes no time."""


@dataclass(frozen=True, slots=True)
class JointLimits:
    """A joint's maximum speed, acceleration and jerk in radians (or metres) and seconds; inf: not stated."""

    speed: float = math.inf
    acceleration: float = math.inf
    jerk: float = math.inf


@dataclass(frozen=True, slots=True)
class TimedLaw:
    """A law and its duration in seconds."""

    law: Law
    duration: float


def fastest(name: str, travel: Sequence[float], limits: Sequence[JointLimits]) -> TimedLaw:
    """Return the law `name` in the shortest time in which no joint exceeds its limits over its `travel`.

    For a path parameter from 0 to 1 the limits are those of each joint divided by its travel, and the
    smallest applies. Raises InputError if a joint moves that nothing limits.
    """
    used = [
        (abs(distance), limit)
        for distance, limit in zip(travel, limits, strict=True)
        if abs(distance) > STILL
    ]
    if not used:
        return TimedLaw(law(name), 0.0)
    speed = min(limit.speed / distance for distance, limit in used)
    acceleration = min(limit.acceleration / distance for distance, limit in used)
    jerk = min(limit.jerk / distance for distance, limit in used)
    if math.isinf(speed) and math.isinf(acceleration):
        raise InputError(
            "no-speed",
            "the speed of this move is not known",
            hint="state its time, or use a servo with a stated speed, or an acceleration limit",
        )
    shaped = _ramped_law(name, speed, acceleration, jerk)
    return TimedLaw(shaped, _shortest(shaped, speed, acceleration, jerk))


def _shortest(shaped: Law, speed: float, acceleration: float, jerk: float) -> float:
    """Return the shortest time in seconds in which the peaks of `shaped`, over a path of 1, keep the
    limits.
    """
    return max(
        shaped.peak(1) / speed,
        # The speed of the linear law jumps at its ends, so no acceleration limit could hold; none is applied.
        math.sqrt(shaped.peak(2) / acceleration),
        math.pow(shaped.peak(3) / jerk, 1 / 3),
    )


def _ramped_law(name: str, speed: float, acceleration: float, jerk: float) -> Law:
    """Return the law with the ramps that make it fastest over a path of 1."""
    if name not in ("trapezoid", "s-curve") or math.isinf(acceleration):
        return law(name)
    if name == "trapezoid":
        return law(name, _trapezoid(speed, acceleration))
    if math.isinf(jerk):
        return law(name, _trapezoid(speed, acceleration * (1 - BEND)), BEND)
    return law(name, *_s_curve(speed, acceleration, jerk))


def _trapezoid(speed: float, acceleration: float) -> float:
    """Return the share of a ramp in the time of a path of 1; two ramps cover speed² / acceleration."""
    if speed * speed >= acceleration:
        return 0.5
    ramp = speed / acceleration
    return ramp / (1 / speed + ramp)


def _s_curve(speed: float, acceleration: float, jerk: float) -> tuple[float, float]:
    """Return the share of a ramp in the time of a path of 1, and that of the acceleration's rise in a ramp.

    A ramp up to `speed` takes v/a + a/j if the acceleration is reached (v j ≥ a²), else 2 √(v/j); two ramps
    cover v times that. If this exceeds 1, the speed is not reached, and the ramps fill the path.
    """
    reached = speed * jerk >= acceleration**2
    rise = acceleration / jerk if reached else math.sqrt(speed / jerk)
    ramp = rise + speed / acceleration if reached else 2 * rise
    if speed * ramp <= 1:
        return ramp / (1 / speed + ramp), rise / ramp
    # The two ramps fill the path. With jerk alone each has a peak acceleration of ∛(j² / 2), if that is
    # within the limit.
    if 2 * acceleration**3 <= jerk**2:
        rise = acceleration / jerk
        return 0.5, rise / (rise / 2 + math.sqrt((rise / 2) ** 2 + 1 / acceleration))
    return 0.5, 0.5


def at_rest(angles: Floats) -> Floats:
    """Return samples between two of rest: the first and the last frame of a move are accelerated, too."""
    return np.concatenate((angles[:1], angles, angles[-1:]))


class Tightest(NamedTuple):
    """The limit that samples come nearest to, or exceed most: `factor` is 1 where they just keep it."""

    factor: float
    joint: int
    order: int
    """Of the derivative: 1 for speed, 2 for acceleration, 3 for jerk."""

    @property
    def text(self) -> str:
        """Return the share of the limit that is used, in words."""
        kind = ("speed", "acceleration", "jerk")[self.order - 1]
        return f"{100 * self.factor**self.order:.0f} % of its {kind}"


def tightest(angles: Floats, step_s: float, limits: Sequence[JointLimits]) -> Tightest:
    """Return the limit that samples (n, joints) `step_s` apart come nearest to, and the factor by which they
    must be slowed down to keep it, up to 1 if they do already.

    A duration k times as long divides speeds by k, accelerations by k² and jerks by k³; only the acceleration
    from rest at once to a speed falls with k, so that a longer duration must be examined again.
    """
    found = [Tightest(0.0, 0, 1)]
    for joint, (column, limit) in enumerate(zip(angles.T, limits, strict=True)):
        for order, most in ((1, limit.speed), (2, limit.acceleration), (3, limit.jerk)):
            if len(column) > order and not math.isinf(most):
                peak = float(np.abs(np.diff(column, order)).max()) / step_s**order
                found.append(Tightest((peak / most) ** (1 / order), joint, order))
    # Of equal ones the first, on every machine.
    return max(found, key=lambda each: round(each.factor, SAME_DIGITS))


def stretch(angles: Floats, step_s: float, limits: Sequence[JointLimits]) -> float:
    """Return the factor of the `tightest` limit."""
    return tightest(angles, step_s, limits).factor
