"""[leg] and [robot] of a job -> the joints that servos turn, and the end of the leg or arm.

In: the validated tables and the servos. Out: `Rig`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from servogen.errors import InputError, did_you_mean
from servogen.job.schema import JobTable, LegTable
from servogen.job.servos import bindings_of
from servogen.job.tip import ArmTip, LegTip, Tip
from servogen.kinematics import catalogue
from servogen.kinematics.leg import Leg
from servogen.robot.binding import Binding
from servogen.robot.model import Arm, Robot
from servogen.robot.servo import Servo
from servogen.toml.file import Document

SIGNS = {"nearest": 0, "positive": 1, "negative": -1}


@dataclass(frozen=True, slots=True)
class Rig:
    """What the servos move. `tip` is None if it cannot be positioned: no robot, or joints without servos."""

    robot: Robot | None
    bindings: tuple[Binding, ...]
    tip: Tip | None


def rig_of(document: Document, table: JobTable, servos: tuple[Servo, ...]) -> Rig:
    """Return what the servos of a job move. Raises InputError."""
    if table.leg is not None:
        if table.robot is not None:
            raise document.error(
                "conflicting-keys", ("robot",), "[leg] is a robot of its own", "remove one of the two"
            )
        bindings_of(document, table.servo, {})
        tip = _leg(document, table.leg, servos)
        return Rig(None, tip.bindings, tip)
    if table.robot is None:
        return Rig(None, bindings_of(document, table.servo, {}), None)
    robot = _robot(document, table.robot.name)
    joints = {name: not joint.turning for limb in robot.limbs for name, joint in limb.joints.items()}
    bindings = bindings_of(document, table.servo, joints)
    return Rig(robot, bindings, _tip(robot, bindings, servos))


def _robot(document: Document, name: str) -> Robot:
    beside = Path(document.file).parent / name
    own = name.lower().endswith((catalogue.TOML, catalogue.URDF))
    if own and not beside.is_file():
        raise document.error("unknown-robot", ("robot", "name"), f"there is no robot file '{beside}'")
    try:
        return catalogue.robot(str(beside) if own else name)
    except InputError as error:
        if error.location is not None and error.location.file and error.location.file != document.file:
            raise
        raise error.at(document.place("robot", "name")) from error


def _tip(robot: Robot, bindings: tuple[Binding, ...], servos: tuple[Servo, ...]) -> ArmTip | None:
    """Return the tip of an arm whose joints all have a servo; None for other robots."""
    if not isinstance(robot, Arm):
        return None
    by_joint = {binding.joint: binding for binding in bindings}
    by_name = {servo.name: servo for servo in servos}
    if any(joint.name not in by_joint for joint in robot.joints):
        return None
    mine = tuple(by_joint[joint.name] for joint in robot.joints)
    return ArmTip(robot, mine, tuple(by_name[binding.servo] for binding in mine))


def _leg(document: Document, table: LegTable, servos: tuple[Servo, ...]) -> LegTip:
    by_name = {servo.name: servo for servo in servos}
    for key in ("alpha", "beta"):
        name = getattr(table, key)
        if name not in by_name:
            raise document.error(
                "unknown-servo", ("leg", key), f"there is no servo '{name}'", did_you_mean(name, by_name)
            )
    if table.alpha == table.beta:
        raise document.error("joint-binding", ("leg", "beta"), f"'{table.beta}' is both joints' servo")
    if table.ab_mm + table.cd_mm <= 0:
        raise document.error("bad-length", ("leg", "cd_mm"), "ab_mm and cd_mm are both 0: a leg has a reach")
    lengths = (table.ab_mm, table.bc_mm, table.cd_mm, table.df_mm)
    return LegTip(
        Leg(*(length / 1000 for length in lengths)),
        (
            Binding("alpha", table.alpha, math.radians(table.alpha_zero_deg)),
            Binding("beta", table.beta, math.radians(table.beta_zero_deg)),
        ),
        (by_name[table.alpha], by_name[table.beta]),
        SIGNS[table.beta_sign],
        table.tolerance_mm / 1000,
    )
