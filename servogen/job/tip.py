"""The end of a robot in a job: from points of its foot or tool to servo angles, and back.

In: points in metres. Out: the angles of the servos that move it. `LegTip` is the two-joint leg on two servos,
`ArmTip` any arm of which each joint has a servo.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from servogen.errors import InputError, Location
from servogen.kinematics import catalogue
from servogen.kinematics.forward import fk_position
from servogen.kinematics.inverse.solve import ik_typed, solutions_near, solve, why_unreachable
from servogen.kinematics.inverse.unreachable import Unreachable, in_mm
from servogen.kinematics.leg import Leg
from servogen.kinematics.orientation import orientation_matrix, rotations_between
from servogen.motion.trajectory import Floats
from servogen.robot.binding import Binding, joint_positions
from servogen.robot.model import Arm, Limb
from servogen.robot.servo import Servo


class Tip(Protocol):
    """The end of a job's robot; `servos` move it, and are the columns of all arrays of angles."""

    @property
    def key(self) -> str:
        """Return the key of a pose that states its position."""

    @property
    def limb(self) -> Limb:
        """Return the leg or arm with its Denavit–Hartenberg rows."""

    @property
    def bindings(self) -> tuple[Binding, ...]:
        """Return the joints that the servos turn, in the order of the limb's joints."""

    @property
    def servos(self) -> tuple[Servo, ...]:
        """Return the servos of `bindings`, in the same order."""

    def choices(self, point: Floats, orientation: Floats | None, before: Floats, place: Location) -> Floats:
        """Return the servo angles (s, k) that reach one point, nearest to `before` first. Raises
        InputError.
        """

    def solutions(
        self, points: Floats, shares: Floats, turn: tuple[Floats, Floats] | None, near: Floats
    ) -> Floats:
        """Return all servo angles (n, solutions, k) for points (n, 3), NaN where there is no solution.

        The orientations are those at shares (n,) of the rotation between the two of `turn`. `near` are the
        expected servo angles (n, k), which decide between whole turns of a joint.
        """

    def where(self, angles: Floats) -> Floats:
        """Return the points (n, 3) at servo angles (n, k)."""


@dataclass(frozen=True, slots=True)
class LegTip:
    """A leg; `bindings` are those of α and β.

    `tolerance` is the maximum distance, in metres, of a foot from the surface that two joints can reach. It
    allows for rounding in the job and for the leg's spring. `beta_sign` is the required sign of β, 1 or -1,
    or 0 for either.
    """

    leg: Leg
    bindings: tuple[Binding, Binding]
    servos: tuple[Servo, Servo]
    beta_sign: int
    tolerance: float

    @property
    def key(self) -> str:
        """Return "foot_mm"."""
        return "foot_mm"

    @property
    def limb(self) -> Limb:
        """Return the leg."""
        leg = self.leg
        arm = catalogue.arm("leg").with_lengths(ab=leg.ab, bc=leg.bc, cd=leg.cd, df=leg.df)
        return Limb("foot", "foot", arm)

    def choices(self, point: Floats, orientation: Floats | None, before: Floats, place: Location) -> Floats:
        """Return the servo angles (s, 2) that reach one point, the nearest to `before` first. Raises
        `Unreachable` if there are none, InputError if the servos allow none.
        """
        near = np.array(self.leg.nearest(point))
        if float(np.linalg.norm(near - point)) > self.tolerance:
            try:
                self.leg.ik(point)
            except Unreachable as error:
                raise error.at(place) from error
        return _allowed_solutions(self._angles_at(near[None])[0], self.servos, before, point, place)

    def solutions(
        self, points: Floats, shares: Floats, turn: tuple[Floats, Floats] | None, near: Floats
    ) -> Floats:
        """Return all servo angles (n, solutions, 2) for points (n, 3), NaN where there is no solution."""
        reached = np.array([self.leg.nearest(point) for point in points])
        angles = self._angles_at(reached)
        angles[np.linalg.norm(reached - points, axis=1) > self.tolerance] = np.nan
        return _within(angles, self.servos)

    def where(self, angles: Floats) -> Floats:
        """Return the feet (n, 3) at servo angles (n, 2)."""
        alpha, beta = (
            binding.position(column) for binding, column in zip(self.bindings, angles.T, strict=True)
        )
        return self.leg.fk(alpha, beta)

    def _angles_at(self, points: Floats) -> Floats:
        joints = self.leg.solve(points, NEAR_SURFACE_M)
        joints[self.beta_sign * joints[..., 1] < 0] = np.nan
        return np.stack(
            [binding.servo_angle(joints[..., column]) for column, binding in enumerate(self.bindings)],
            axis=-1,
        )


NEAR_SURFACE_M = 1e-7
"""The accuracy of the nearest point of the surface."""


@dataclass(frozen=True, slots=True)
class ArmTip:
    """An arm, and the same with its joints' limits narrowed to what their servos allow; `bindings` and
    `servos` are in the order of its joints.
    """

    arm: Arm
    on_servos: Arm
    bindings: tuple[Binding, ...]
    servos: tuple[Servo, ...]

    @property
    def key(self) -> str:
        """Return "tip_mm"."""
        return "tip_mm"

    @property
    def limb(self) -> Limb:
        """Return the arm."""
        return self.arm.limbs[0]

    def choices(self, point: Floats, orientation: Floats | None, before: Floats, place: Location) -> Floats:
        """Return the servo angles (s, k) that reach one point, the nearest to `before` first. Raises
        `Unreachable` if there are none, InputError if the servos allow none.
        """
        near = joint_positions(self.bindings, before[None])[0]
        try:
            joints, _ = ik_typed(self.on_servos, point, orientation, near)
        except Unreachable:
            turn = None if orientation is None else orientation_matrix(self.arm, point, orientation)
            joints = solve(self.arm, point, turn).q
            if np.isnan(joints).any(axis=1).all():
                raise why_unreachable(self.arm, point, turn).at(place) from None
        except InputError as error:
            raise error.at(place) from error
        return _allowed_solutions(self._to_servos(joints), self.servos, before, point, place)

    def solutions(
        self, points: Floats, shares: Floats, turn: tuple[Floats, Floats] | None, near: Floats
    ) -> Floats:
        """Return all servo angles (n, solutions, k) for points (n, 3), NaN where there is no solution."""
        rotations = None if turn is None else rotations_between(self.arm, points, *turn, shares)
        angles = solutions_near(self.on_servos, points, rotations, joint_positions(self.bindings, near))
        return _within(self._to_servos(angles), self.servos)

    def where(self, angles: Floats) -> Floats:
        """Return the positions of the tool (n, 3) at servo angles (n, k)."""
        return fk_position(self.arm, joint_positions(self.bindings, angles))

    def _to_servos(self, joints: Floats) -> Floats:
        return np.stack(
            [binding.servo_angle(joints[..., column]) for column, binding in enumerate(self.bindings)],
            axis=-1,
        )


def _within(angles: Floats, servos: Sequence[Servo]) -> Floats:
    """Return `angles` (…, k) with NaN where a servo's limits do not allow it."""
    allowed = np.ones(angles.shape[:-1], dtype=bool)
    for column, servo in enumerate(servos):
        allowed &= servo.allows_each(angles[..., column])
    return np.where(allowed[..., None], angles, np.nan)


def _allowed_solutions(
    angles: Floats, servos: Sequence[Servo], before: Floats, point: Floats, place: Location
) -> Floats:
    """Return the solutions (s, k) that the servos allow, sorted by the largest move of any servo."""
    allowed = _within(angles, servos)
    allowed = allowed[~np.isnan(allowed).any(axis=1)]
    if not len(allowed):
        shown = " or ".join(
            ", ".join(
                f"{servo.name} {math.degrees(angle):z.1f}°" for servo, angle in zip(servos, row, strict=True)
            )
            for row in angles[~np.isnan(angles).any(axis=1)].tolist()
        )
        raise InputError(
            "servo-limit",
            f"the position {in_mm(point.tolist())} needs angles outside the servos' travel: {shown}",
            place,
            "move it, or change the servos' angles at which the joints are 0 to how they are mounted",
        )
    return np.asarray(allowed[np.argsort(np.abs(allowed - before).max(axis=1), kind="stable")])
