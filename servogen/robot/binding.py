"""The binding of a joint to a servo: the servo's angle as a linear function of the joint's position.

In: joint positions, radians or metres. Out: servo angles in radians, and back.

    servo angle = zero + ratio * joint position
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


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
