"""The legs of the field against pinocchio, which builds its own model from lengths, axes and masses.

`python -m tests.kinematics.against_pinocchio [POSES]` prints, for each kind, the largest differences in the
foot's place (m), its Jacobian (m, rad), the torques of gravity and of a force at the foot (N·m), and of the
inverse solutions: the foot that pinocchio has for each of them (m), and the poses without all of them.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk_position
from servogen.kinematics.inverse.solve import solve
from servogen.kinematics.jacobian import jacobian, static_torques
from servogen.kinematics.statics import GRAVITY, gravity_torques
from servogen.robot.model import Arm

FORCE = np.array([1.3, -0.7, 4.1])
POSES = 5000


def model_of(kind: str, lengths: dict[str, float], masses: list[float]) -> tuple[Any, Any, int]:
    """Return pinocchio's leg: y outwards, the hip about z, all others about x; masses at the links' ends."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    out = np.array([0.0, 1.0, 0.0])
    coxa, femur, tibia = (
        lengths["coxa"] * out,
        lengths["femur"] * out,
        np.array([0.0, 0.0, -lengths["tibia"]]),
    )
    if kind == "hip-lift":
        chain = [(pin.JointModelRZ(), 0 * out, coxa), (pin.JointModelRX(), coxa, femur + tibia)]
    else:
        chain = [
            (pin.JointModelRZ(), 0 * out, coxa),
            (pin.JointModelRX(), coxa, femur),
            (pin.JointModelRX(), femur, tibia),
        ]
    parent, end = 0, out
    for number, ((joint, place, end), mass) in enumerate(zip(chain, masses, strict=True)):
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), place), f"j{number}")
        model.appendBodyToJoint(parent, pin.Inertia(mass, end, np.zeros((3, 3))), pin.SE3.Identity())
    foot = model.addFrame(pin.Frame("foot", parent, 0, pin.SE3(np.eye(3), end), pin.FrameType.OP_FRAME))
    return model, model.createData(), foot


def drawn(kind: str, chance: np.random.Generator) -> tuple[Arm, Any]:
    """Return a random leg, its masses at the ends of its links, and the lengths and masses themselves."""
    model = arm(kind)
    lengths = {name: float(chance.uniform(0.02, 0.15)) for name in model.length}
    masses = chance.uniform(0.005, 0.05, len(model.joints)).tolist()
    joints = [
        replace(joint, lower=-math.pi, upper=math.pi, mass=mass)
        for joint, mass in zip(model.joints, masses, strict=True)
    ]
    if kind == "hip-lift":
        # The frame after the lift's row is at the end of the femur, its x along it and its y up.
        joints[1] = replace(joints[1], centre=(0.0, -lengths["tibia"], 0.0))
    return replace(model.with_lengths(**lengths), joints=tuple(joints)), (lengths, masses)


def branches(kind: str, lengths: dict[str, float], foot: np.ndarray) -> int:
    """Return the number of solutions: one, or two knees for each turn of the coxa that reaches."""
    if kind == "hip-lift":
        return 1  # of the two lifts at a height only one is as far from the hip
    femur, tibia, out = lengths["femur"], lengths["tibia"], math.hypot(foot[0], foot[1])
    away = [math.hypot(side * out - lengths["coxa"], foot[2]) for side in (1, -1)]
    return 2 * sum(abs(femur - tibia) <= far <= femur + tibia for far in away)


def differences(kind: str, poses: int, wrong: float = 0.0) -> dict[str, float]:
    """Return the largest differences over random legs, ten poses each; `wrong` is added to pinocchio's
    femur.
    """
    chance = np.random.default_rng(2026)
    worst = dict.fromkeys(("foot", "jacobian", "gravity", "force", "inverse", "missing"), 0.0)
    for _ in range(-(-poses // 10)):
        leg, (lengths, masses) = drawn(kind, chance)
        model, data, foot = model_of(kind, lengths | {"femur": lengths["femur"] + wrong}, masses)
        for q in chance.uniform(-math.pi, math.pi, (10, len(masses))):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            theirs = pin.getFrameJacobian(model, data, foot, pin.LOCAL_WORLD_ALIGNED)
            gravity = pin.computeGeneralizedGravity(model, data, q)
            ours, place = jacobian(leg, q), fk_position(leg, q)
            wrench = np.concatenate([FORCE, np.zeros(3)])
            found = {
                "foot": place - data.oMf[foot].translation,
                "jacobian": ours - theirs,
                "gravity": gravity_torques(leg, q) - gravity,
                "force": np.abs(static_torques(leg, q, FORCE, np.zeros(3))) - np.abs(theirs.T @ wrench),
            }
            back = []
            for each in solve(leg, place).q:
                if not np.isnan(each).any():
                    pin.framesForwardKinematics(model, data, each)
                    back.append(data.oMf[foot].translation - place)
            found["inverse"] = np.array(back)
            worst["missing"] += len(back) != branches(kind, lengths, place)
            for what, difference in found.items():
                worst[what] = max(worst[what], float(np.abs(difference).max()))
    return worst


if __name__ == "__main__":
    for kind in ("hip-lift", "coxa-femur-tibia"):
        print(kind, differences(kind, int(sys.argv[1]) if len(sys.argv) > 1 else POSES))
