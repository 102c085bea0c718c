"""The binding of a joint to a servo: the servo's angle as a linear function of the joint's position.

In: joint positions, radians or metres. Out: servo angles in radians, and back; the limits that the joint and
the servo have in common.

    servo angle = zero + ratio * joint position
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servogen.errors import InputError, Location
from servogen.robot.model import Joint
from servogen.robot.servo import TOLERANCE_RAD, Servo


@dataclass(frozen=True, slots=True)
class Binding:
    """`zero` is the servo's angle at joint position 0, `ratio` the servo's radians per unit of the joint's
    position.
    """

    joint: str
    servo: str
    zero: float = 0.0
    ratio: float = 1.0

    def servo_angle(self, position: ArrayLike) -> NDArray[np.float64]:
        """Return the servo's angles in radians at joint positions."""
        return np.asarray(self.zero + self.ratio * np.asarray(position, float))

    def position(self, servo_angle: ArrayLike) -> NDArray[np.float64]:
        """Return the joint positions at servo angles in radians."""
        return np.asarray((np.asarray(servo_angle, float) - self.zero) / self.ratio)

    def within_both(self, joint: Joint, servo: Servo, place: Location | None = None) -> tuple[Joint, Servo]:
        """Return the joint and its servo, both with the limits that both allow: wherever an angle is
        commanded, these limits apply.

        A continuous joint has the limits of its servo. Raises InputError at `place` if there are none.
        """
        low, high = sorted(self.position(servo.limits).tolist())
        lower = low if joint.continuous else max(joint.lower, low)
        upper = high if joint.continuous else min(joint.upper, high)
        if upper < lower + TOLERANCE_RAD:
            shown = (joint.shown(end) for end in (joint.lower, joint.upper, low, high))
            limits = "its limits are {} to {}, the servo turns it from {} to {}".format(*shown)
            raise InputError(
                "servo-range",
                f"{servo.name} cannot turn the joint {joint.name} within its limits: {limits}",
                place,
                "change zero_deg to how the servo is mounted",
            )
        ends = sorted(self.servo_angle((lower, upper)).tolist())
        inner = max(servo.limits[0], ends[0]), min(servo.limits[1], ends[1])
        if max(inner[0] - servo.limits[0], servo.limits[1] - inner[1]) > TOLERANCE_RAD:
            allowed = f"{joint.shown(joint.lower)} to {joint.shown(joint.upper)}"
            servo = replace(servo, limits=inner, limited_by=f"the joint {joint.name} allows {allowed}")
        return replace(joint, lower=lower, upper=upper), servo


def joint_positions(bindings: Sequence[Binding], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the joint positions (n, k) at the angles (n, k), in radians, of the servos of `bindings`."""
    columns = [binding.position(column) for binding, column in zip(bindings, angles.T, strict=True)]
    return np.stack(columns, axis=1)
