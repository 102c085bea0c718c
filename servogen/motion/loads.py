"""The static loads of a walking robot's legs, frame by frame, and the warning about loads that are too heavy.

In: a `WalkingRobot` with a mass and its `Walk`. Out: the force at each foot, and the torque at each leg's
lifting joint; for any joint's torques and its servo model, a warning if they exceed the model's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from servogen.errors import Diagnostic, Location
from servogen.kinematics.protocol import WalkingRobot
from servogen.kinematics.statics import GRAVITY, foot_forces
from servogen.motion.gait.walk import Walk
from servogen.motion.trajectory import Floats
from servogen.robot.servo import ServoModel

SAME_DIGITS = 9
"""Digits of N·m to which torques are compared, so that every machine names the same frame."""

MIN_LEGS = 3
"""A robot with fewer legs is assumed to be held by something else."""


@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """`forces` (N) and `torques` (N·m, of the lifting joints) are (frames, legs), NaN where the
    robot falls.
    """

    legs: tuple[str, ...]
    weight_n: float
    forces: Floats
    torques: Floats
    equal_torques: Floats
    """The torques that would result if all feet on the ground carried equal shares of the weight."""

    @property
    def worst(self) -> tuple[int, int] | None:
        """Return the leg and the frame of the maximum torque; None if the robot never stands."""
        if np.isnan(self.torques).all():
            return None
        at = int(np.nanargmax(np.round(self.torques, SAME_DIGITS)))
        frame, leg = divmod(at, len(self.legs))
        return leg, frame

    def detail(self, leg: int, frame: int) -> str:
        """Return the load of a leg in a frame in words."""
        return (
            f"its foot carries {self.forces[frame, leg]:z.1f} of {self.weight_n:z.1f} N "
            f"({self.equal_torques[frame, leg]:z.2f} N·m if all standing feet shared it equally)"
        )


def walk_loads(robot: WalkingRobot, walk: Walk) -> Loads | None:
    """Return the loads of a walk; None for a robot without a stated mass or with too few legs."""
    if robot.mass is None or len(robot.limbs) < MIN_LEGS:
        return None
    weight = robot.mass * GRAVITY
    stand = (walk.feet + walk.corrections)[:, :, :2]
    forces = foot_forces(stand, walk.ground, np.array([walk.centre.real, walk.centre.imag]), weight)
    angles = walk.leg_angles
    standing = np.maximum(walk.ground.sum(axis=1, keepdims=True), 1)
    return Loads(
        legs=walk.legs,
        weight_n=weight,
        forces=forces,
        torques=robot.torques(angles, forces),
        equal_torques=robot.torques(angles, np.where(walk.ground, weight / standing, 0.0)),
    )


def check_loads(loads: Loads | None, joint: str, model: ServoModel) -> tuple[Diagnostic, ...]:
    """Return a warning if a leg's lifting joint, `joint`, needs more torque than `model` has, for the worst
    leg and frame.
    """
    if loads is None or loads.worst is None:
        return ()
    leg, _ = loads.worst
    torque = loads.torques[:, leg]
    return check_torque(model, f"{loads.legs[leg]}_{joint}", torque, detail=partial(loads.detail, leg))


def check_torque(
    model: ServoModel,
    joint: str,
    torque_nm: Floats,
    *,
    servo: str | None = None,
    place: Location | None = None,
    detail: Callable[[int], str] | None = None,
) -> tuple[Diagnostic, ...]:
    """Return a warning if the static torque (frames,) of a joint exceeds the servo's, for the worst frame.

    NaN: no torque is needed. A model without a stated torque is not checked. `servo` is its name in the job;
    `detail` returns what to add about a frame.
    """
    rated = model.torque_nm
    if rated is None or np.isnan(torque_nm).all():
        return ()
    frame = int(np.nanargmax(np.round(torque_nm, SAME_DIGITS)))
    needed = float(torque_nm[frame])
    if needed <= rated * (1 + 1e-9):
        return ()
    text = (
        f"{'' if servo is None else f'{servo}: '}holding {joint} in place needs {needed:z.2f} N·m in frame "
        f"{frame}, a {model.title} is rated {rated:g} N·m"
    )
    if detail is not None:
        text += f"; {detail(frame)}"
    return (Diagnostic("warning", "too-heavy", text, place),)
