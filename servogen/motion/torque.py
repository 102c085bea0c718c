"""The torques that moving masses need: of an arm whose file states masses, with the torques of its servos.

In: the servos' angles along a course, or in frames. Out: the rows of a time-optimal course's limits, and how
much too fast a move is.

Masses are points, so a joint's torque follows from their places p alone, and along a course p(s) from the
course's speed and acceleration:

    τ = Σ m ∂p/∂qᵀ (p̈ + g)        p̈ = p'(s) s̈ + p''(s) ṡ²
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from servogen.kinematics.statics import GRAVITY, moving_masses
from servogen.motion.limits import at_rest
from servogen.motion.trajectory import Floats
from servogen.robot.binding import Binding, joint_positions
from servogen.robot.model import Arm


@dataclass(frozen=True, slots=True, eq=False)
class TorqueLimits:
    """The servos of an arm, in the order of its joints: the columns of their angles and their torques, N·m.

    A torque that is not stated is infinite.
    """

    arm: Arm
    bindings: tuple[Binding, ...]
    columns: tuple[int, ...]
    maximum: Floats

    def levers(self, angles: Floats) -> tuple[Floats, Floats]:
        """Return the places (n, 3k) of the masses and m ∂p/∂angle (n, 3k, servos) at servo angles."""
        q = joint_positions(self.bindings, angles[:, list(self.columns)])
        masses, places, slopes = moving_masses(self.arm, q)
        ratios = np.array([binding.ratio for binding in self.bindings])
        weighted = masses[:, None, None] * slopes / ratios
        return places.reshape(len(q), -1), weighted.reshape(len(q), -1, len(ratios))

    def held(self, levers: Floats) -> tuple[Floats, Floats]:
        """Return the torques (n, servos) of the weight, and those that the servos have.

        A servo that cannot hold the weight somewhere is not limited: it has a warning of its own.
        """
        weight = GRAVITY * levers[:, 2::3].sum(axis=1)
        weak = np.abs(weight).max(axis=0) >= self.maximum
        return weight, np.where(weak, math.inf, self.maximum)

    def stretch(self, angles: Floats, step_s: float) -> float:
        """Return the factor by which samples between two rests must be slowed down, as `limits.stretch`."""
        places, levers = self.levers(at_rest(angles))
        weight, maximum = self.held(levers)
        pushed = np.einsum("nps,np->ns", levers[1:-1], np.diff(places, 2, axis=0) / step_s**2)
        room = maximum - np.sign(pushed) * weight[1:-1]
        return math.sqrt(float((np.abs(pushed) / room).max(initial=0.0)))
