"""The static loads of a walking robot's legs, frame by frame.

In: a `WalkingRobot` with a mass and its `Walk`. Out: the force at each foot, and the torque at the joint of
each leg that lifts it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from servogen.errors import Diagnostic
from servogen.kinematics.protocol import WalkingRobot
from servogen.kinematics.statics import GRAVITY, foot_forces
from servogen.motion.gait.walk import Walk
from servogen.motion.trajectory import Floats
from servogen.robot.servo import ServoModel

SAME_DIGITS = 9
"""Digits of N·m to which torques are compared, so that every machine names the same frame."""

MIN_LEGS = 3
"""A robot with fewer legs is held by something else."""


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
    """The torques if the feet on the ground carried equal shares of the weight."""

    @property
    def worst(self) -> tuple[int, int] | None:
        """Return the leg and the frame of the greatest torque; None if the robot never stands."""
        if np.isnan(self.torques).all():
            return None
        at = int(np.nanargmax(np.round(self.torques, SAME_DIGITS)))
        frame, leg = divmod(at, len(self.legs))
        return leg, frame

    def detail(self, leg: int, frame: int) -> str:
        """Return in words what a leg carries in a frame."""
        return (
            f"its foot carries {self.forces[frame, leg]:z.1f} of {self.weight_n:z.1f} N "
            f"({self.equal_torques[frame, leg]:z.2f} N·m if all standing feet carried alike)"
        )


def loads_of(robot: WalkingRobot, walk: Walk) -> Loads | None:
    """Return the loads of a walk; None for a robot without a stated mass or with too few legs."""
    if robot.mass is None or len(robot.limbs) < MIN_LEGS:
        return None
    weight = robot.mass * GRAVITY
    stand = (walk.feet + walk.corrections)[:, :, :2]
    forces = foot_forces(stand, walk.ground, np.array(robot.centre_of_mass[:2]), weight)
    angles = walk.leg_angles
    standing = np.maximum(walk.ground.sum(axis=1, keepdims=True), 1)
    return Loads(
        legs=walk.legs,
        weight_n=weight,
        forces=forces,
        torques=robot.torques(angles, forces),
        equal_torques=robot.torques(angles, np.where(walk.ground, weight / standing, 0.0)),
    )


def too_heavy(loads: Loads | None, joint: str, model: ServoModel) -> list[Diagnostic]:
    """Return a warning where standing asks the servo for more than its torque."""
    if loads is None or loads.worst is None or model.torque_nm is None:
        return []
    leg, frame = loads.worst
    asked = float(loads.torques[frame, leg])
    if asked <= model.torque_nm:
        return []
    text = (
        f"holding {loads.legs[leg]}_{joint} still asks for {asked:z.2f} N·m in frame {frame}, "
        f"a {model.title} is rated {model.torque_nm:g} N·m; {loads.detail(leg, frame)}"
    )
    return [Diagnostic("warning", "too-heavy", text)]
