"""The answers of the commands robots, fk, ik, jacobian, mobility, transform and orientation, for JSON.

In: names and numbers as a user types them (degrees and millimetres). Out: dicts in metres and radians.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, radians
from typing import Any

import numpy as np

from servogen.errors import InputError, Location, did_you_mean
from servogen.kinematics import catalogue
from servogen.kinematics.forward import fk, fk_position, joint_array
from servogen.kinematics.inverse.solve import ik_all
from servogen.kinematics.jacobian import FrameName, jacobian, manipulability, singularity
from servogen.kinematics.orientation import (
    ORDERS,
    from_angles,
    from_axis_angle,
    from_quaternion,
    orientation_matrix,
    orientation_names,
    to_angles,
    to_axis_angle,
    to_quaternion,
)
from servogen.kinematics.protocol import Answer, DrivingRobot
from servogen.kinematics.registry import KINDS
from servogen.kinematics.symbolic import symbolic_fk, symbolic_jacobian, text_of
from servogen.kinematics.transforms import Floats, apply, is_rotation, parse, to_body
from servogen.robot.model import Arm, Robot


def robot_list() -> list[Answer]:
    """Return the short name, title, kind and number of driven joints of every robot in the catalogue."""
    robots = ((name, catalogue.robot(name)) for name in catalogue.names())
    return [
        {
            "name": name,
            "title": robot.title,
            "kind": robot.kind,
            "joints": _driven(robot),
            "dimensions": robot.dimensions,
            "source": robot.source,
        }
        for name, robot in robots
    ]


def _driven(robot: Robot) -> int:
    wheels = robot.wheel_count if isinstance(robot, DrivingRobot) else 0
    return wheels + sum(len(limb.joints) for limb in robot.limbs)


def robot_details(name: str) -> Answer:
    """Return all facts of a robot: those of every robot, and those of its kind."""
    robot = catalogue.robot(name)
    common: Answer = {
        "name": robot.name,
        "title": robot.title,
        "kind": robot.kind,
        "dimensions": robot.dimensions,
        "source": robot.source,
    }
    return common | KINDS[robot.kind].details(robot)


def joint_values(arm: Arm, values: Sequence[float]) -> Floats:
    """Return joint positions in radians and metres, given in degrees and millimetres."""
    array = joint_array(arm, _finite(values))
    return np.array(
        [
            radians(value) if joint.turning else value / 1000
            for joint, value in zip(arm.joints, array.tolist(), strict=True)
        ]
    )


def fk_answer(name: str, values: Sequence[float]) -> Answer:
    """Return the pose of an arm's tool, or the feet of a walking robot, at positions in degrees and mm."""
    robot = catalogue.robot(name)
    if any(limb.mount for limb in robot.limbs):
        return _feet_answer(robot, values)
    arm = catalogue.arm(name)
    q = joint_values(arm, values)
    pose = fk(arm, q)
    return {
        "position_m": _plain(pose[:3, 3]),
        "rotation": _plain(pose[:3, :3]),
        "beyond_limits": _beyond(arm, q),
    }


def _feet_answer(robot: Robot, values: Sequence[float]) -> Answer:
    counts = [len(limb.joints) for limb in robot.limbs]
    if len(values) != sum(counts):
        names = ", ".join(joint.name for joint in robot.limbs[0].arm.joints)
        raise InputError(
            "wrong-count",
            f"{robot.name} has {sum(counts)} joints, not {len(values)}",
            hint=f"{names} of each leg",
        )
    feet, first = {}, 0
    for limb, count in zip(robot.limbs, counts, strict=True):
        foot = fk_position(limb.arm, joint_values(limb.arm, values[first : first + count]))
        feet[limb.name] = _plain(to_body(limb.mount, foot) if limb.mount else foot)
        first += count
    return {"feet_m": feet}


def _finite(values: Sequence[float]) -> Floats:
    array = np.asarray(values, float)
    if not np.isfinite(array).all():
        raise InputError(
            "not-a-number", f"{', '.join(f'{value:zg}' for value in values)}: every number must be finite"
        )
    return array


def _beyond(arm: Arm, q: Floats) -> list[str]:
    """Return the joints beyond their limits, for which forward kinematics answers as well."""
    return [
        joint.name
        for joint, value in zip(arm.joints, q.tolist(), strict=True)
        if not joint.lower - 1e-9 <= value <= joint.upper + 1e-9
    ]


def fk_symbolic(name: str, style: str = "text") -> Answer:
    """Return the link matrices, their product and the position in symbols, as text, LaTeX or C."""
    chosen = _style(style)
    symbols = symbolic_fk(catalogue.arm(name))
    return {
        "links": [text_of(link, chosen, f"A{index}") for index, link in enumerate(symbols.links, 1)],
        "product": text_of(symbols.product, chosen, "T"),
        "position": text_of(symbols.position, chosen, "p"),
    }


def _style(style: str) -> Any:
    if style not in ("text", "latex", "c"):
        raise InputError("bad-option", f"unknown style '{style}'", hint="text, latex or c")
    return style


def ik_answer(name: str, values: Sequence[float], everything: bool = False) -> Answer:
    """Return the joint positions that reach x, y, z in mm and, if given, an orientation in degrees."""
    arm = catalogue.arm(name)
    names = ("x", "y", "z", *orientation_names(arm))
    if len(values) not in (3, len(names)):
        wanted = "x y z" + (f" or {' '.join(names)}" if len(names) > 3 else "")
        raise InputError(
            "wrong-count", f"{arm.name} takes {wanted}, not {len(values)} numbers", Location(key="target")
        )
    position = np.asarray(values[:3], float) / 1000
    turn = orientation_matrix(arm, position, np.radians(_finite(values[3:]))) if len(values) > 3 else None
    solutions = ik_all(arm, position, turn)
    return {
        "solutions": _plain(solutions if everything else solutions[:1]),
        "joints": [joint.name for joint in arm.joints],
        "found": len(solutions),
    }


def mobility_answer(name: str) -> Answer:
    """Return the elements, joints, mobility M and manoeuvrability M - 6 of a robot."""
    robot = catalogue.robot(name)
    mobility = KINDS[robot.kind].mobility(robot)
    return {
        "elements": mobility.elements,
        "joints": list(mobility.joints),
        "passive_joints": mobility.passive,
        "mobility": mobility.mobility,
        "manoeuvrability": mobility.manoeuvrability,
        "verdict": mobility.verdict,
        "note": mobility.note,
    }


def transform_answer(text: str, point: Sequence[float] = ()) -> Answer:
    """Return the matrix of a product of transforms and, if `point` is given, where it moves that point."""
    if len(point) not in (0, 3):
        raise InputError(
            "wrong-count", f"a point has three coordinates, not {len(point)}", Location(key="point")
        )
    matrix = parse(text)
    answer: Answer = {"matrix": _plain(matrix)}
    return answer | {"point": _plain(apply(matrix, _finite(point)))} if len(point) else answer


ORIENTATION_FORMS = {
    **dict.fromkeys(ORDERS, 3),
    "RPY": 3,
    "AXIS-ANGLE": 4,
    "QUATERNION": 4,
    "MATRIX": 9,
}
"""The ways to give an orientation, and how many numbers each takes. RPY is another name of ZYX."""


def orientation_answer(form: str, values: Sequence[float]) -> Answer:
    """Return an orientation in every form: angles in radians in all twelve orders, both solutions of the
    first two, axis and angle, the quaternion (scalar first), the matrix.

    `values` are degrees for angles, plain numbers otherwise. A matrix is given row by row.
    """
    name = form.upper().replace("_", "-")
    if name not in ORIENTATION_FORMS:
        known = [each.lower() for each in ORIENTATION_FORMS]
        raise InputError(
            "unknown-name",
            f"'{form}' is not a form of an orientation",
            hint=did_you_mean(form.lower(), known),
        )
    if len(values) != ORIENTATION_FORMS[name]:
        raise InputError(
            "wrong-count",
            f"{form} takes {ORIENTATION_FORMS[name]} numbers, not {len(values)}",
            Location(key=form),
        )
    rotation = _rotation_of(name, _finite(values))
    axis, angle = to_axis_angle(rotation)
    return {
        "angles": {order: _plain(to_angles(rotation, order)) for order in ORDERS},
        "second": {order: _plain(to_angles(rotation, order, second=True)) for order in ORDERS},
        "axis": _plain(axis),
        "angle": float(angle),
        "quaternion": _plain(to_quaternion(rotation)),
        "matrix": _plain(rotation),
    }


def _rotation_of(name: str, values: Floats) -> Floats:
    if name == "MATRIX":
        matrix = values.reshape(3, 3)
        if not is_rotation(matrix, MATRIX_TOLERANCE):
            raise InputError(
                "bad-rotation",
                "the matrix is not a rotation: its columns must be orthogonal unit vectors, right-handed",
                Location(key="matrix"),
            )
        return from_quaternion(to_quaternion(matrix))  # digits that were left out do not remain
    if name == "QUATERNION":
        return from_quaternion(values)
    if name == "AXIS-ANGLE":
        return from_axis_angle(values[:3], np.radians(values[3]))
    return from_angles(np.radians(values), "ZYX" if name == "RPY" else name)


MATRIX_TOLERANCE = 1e-3
"""Of a matrix that is typed with three or four digits."""


def jacobian_answer(name: str, values: Sequence[float], frame: FrameName = 0) -> Answer:
    """Return the geometric Jacobian at positions in degrees and mm, and how well the arm moves there."""
    arm = catalogue.arm(name)
    q = joint_values(arm, values)
    singular = singularity(arm, q)
    return {
        "frame": frame,
        "jacobian": _plain(jacobian(arm, q, frame)),
        "manipulability": float(manipulability(arm, q)),
        "rank": singular.rank,
        "singular": singular.singular,
        "lost_directions": [list(each) for each in singular.lost],
    }


def jacobian_symbolic(name: str, frame: FrameName = 0, style: str = "text") -> Answer:
    """Return the geometric Jacobian in symbols, in the frame of the base (0) or the tool ("n")."""
    if frame not in (0, "n"):
        raise InputError(
            "unknown-name",
            f"the symbolic Jacobian is in the frame 0 or n, not {frame}",
            Location(key="frame"),
        )
    matrix = symbolic_jacobian(catalogue.arm(name), "n" if frame == "n" else "0")
    return {"frame": frame, "jacobian": text_of(matrix, _style(style), "J")}


def joint_text(arm: Arm, q: Sequence[float]) -> str:
    """Return joint positions as text: the joints' names, degrees and millimetres."""
    parts = []
    for joint, value in zip(arm.joints, q, strict=True):
        shown = round(degrees(value) if joint.turning else 1000 * value, 3)
        parts.append(f"{joint.name} {shown:z.3f}" + ("°" if joint.turning else " mm"))
    return "  ".join(parts)


def _plain(array: Floats) -> Any:
    """Return nested lists of floats, with rounding noise around 0 replaced by 0."""
    return (np.where(np.abs(array) < 1e-15, 0.0, array) + 0.0).tolist()
