"""What the commands robots, fk, ik, mobility, transform and jacobian answer, as values that JSON can hold.

In: names and numbers as a user types them (degrees and millimetres). Out: dicts in metres and radians.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, radians
from typing import Any

import numpy as np

from servogen.errors import InputError, Location
from servogen.kinematics import mobility, named, omni
from servogen.kinematics.forward import fk, joint_array
from servogen.kinematics.hexapod import feet
from servogen.kinematics.inverse.solve import ik_all
from servogen.kinematics.jacobian import FrameName, jacobian, manipulability, singularity
from servogen.kinematics.tool_orientation import orientation_matrix, orientation_names
from servogen.kinematics.transform_text import parse
from servogen.kinematics.transforms import Floats, apply
from servogen.robot import robots
from servogen.robot.model import Arm, Frame, Hexapod, Length, Robot

Answer = dict[str, Any]


def robot_list() -> list[Answer]:
    """Short name, title, kind and joints of every robot of the catalogue."""
    found = ((name, robots.robot(name)) for name in robots.names())
    return [
        {
            "name": name,
            "title": each.title,
            "kind": _kind(each),
            "joints": len(each.joints) if isinstance(each, Arm) else _driven(each),
            "dimensions": each.dimensions,
            "source": each.source,
        }
        for name, each in found
    ]


def _kind(robot: Robot) -> str:
    return "arm" if isinstance(robot, Arm) else "hexapod" if isinstance(robot, Hexapod) else "omni"


def _driven(robot: Robot) -> int:
    return len(robot.mounts) * len(robot.leg.joints) if isinstance(robot, Hexapod) else 3


def robot_details(name: str) -> Answer:
    """All there is to a robot: joints with limits, rows, lengths; mounts; wheels."""
    robot = named.robot(name)
    common: Answer = {
        "name": robot.name,
        "title": robot.title,
        "kind": _kind(robot),
        "dimensions": robot.dimensions,
        "source": robot.source,
    }
    if isinstance(robot, Arm):
        return common | _arm_details(robot)
    if isinstance(robot, Hexapod):
        mounts = [
            {
                "name": mount.name,
                "position_m": [mount.x, mount.y, mount.z],
                "heading_rad": mount.heading,
                "mirrored": mount.mirrored,
            }
            for mount in robot.mounts
        ]
        return common | {
            "mounts": mounts,
            "centre_of_mass_m": list(robot.centre_of_mass),
            "leg": _arm_details(robot.leg),
        }
    return common | {
        "wheel_radius_m": robot.wheel_radius,
        "wheel_distance_m": robot.wheel_distance,
        "gear": robot.gear,
        "counts_per_turn": robot.counts_per_turn,
        "sensor_angles_rad": list(omni.sensor_angles(robot)),
        "table": [
            {
                "wheels": [omni.SIGN_NAMES[sign] for sign in row.signs],
                "motion": row.kind,
                "direction_deg": row.direction_deg,
                "turning": row.turning,
                "radius_in_wheel_distances": row.radius,
                "size": row.size,
            }
            for row in omni.table()
        ],
    }


def _arm_details(arm: Arm) -> Answer:
    return {
        "convention": arm.convention,
        "closed_form": arm.closed_form,
        "target": ["x", "y", "z", *orientation_names(arm)],
        "lengths_m": arm.length,
        "joints": [
            {
                "name": joint.name,
                "kind": joint.kind,
                "lower": joint.lower,
                "upper": joint.upper,
                "home": joint.home,
                "speed": joint.speed,
            }
            for joint in arm.joints
        ],
        "rows": [
            {
                "joint": None if row.joint is None else arm.joints[row.joint].name,
                "ratio": row.ratio,
                "theta": row.theta,
                "d": length_text(row.d),
                "a": length_text(row.a),
                "alpha": row.alpha,
            }
            for row in arm.rows
        ],
        "base": _frame(arm.base),
        "tool": _frame(arm.tool),
    }


def _frame(frame: Frame) -> Answer:
    return {"position_m": [frame.x, frame.y, frame.z], "rz_ry_rx_rad": [frame.rz, frame.ry, frame.rx]}


def length_text(length: Length) -> str:
    """A length as written in a robot's file: 'l2 + l3', '-l2', '40 mm'."""
    parts = [("- " if factor < 0 else "+ ") + name for name, factor in length.terms]
    if length.constant or not parts:
        parts.append(f"{'- ' if length.constant < 0 else '+ '}{1000 * abs(length.constant):g} mm")
    text = " ".join(parts).removeprefix("+ ")
    return "-" + text[2:] if text.startswith("- ") else text


def joint_values(arm: Arm, values: Sequence[float]) -> Floats:
    """Joint positions in radians and metres from degrees and millimetres."""
    array = joint_array(arm, _finite(values))
    return np.array(
        [
            radians(value) if joint.turning else value / 1000
            for joint, value in zip(arm.joints, array.tolist(), strict=True)
        ]
    )


def fk_answer(name: str, values: Sequence[float]) -> Answer:
    """The tool's pose at joint positions in degrees and millimetres; for the six-legged robot its feet."""
    robot = named.robot(name)
    if isinstance(robot, Hexapod):
        return _feet_answer(robot, values)
    arm = named.arm(name)
    q = joint_values(arm, values)
    pose = fk(arm, q)
    return {
        "position_m": _plain(pose[:3, 3]),
        "rotation": _plain(pose[:3, :3]),
        "beyond_limits": _beyond(arm, q),
    }


def _feet_answer(robot: Hexapod, values: Sequence[float]) -> Answer:
    count = 2 * len(robot.mounts)
    if len(values) != count:
        raise InputError(
            "wrong-count",
            f"{robot.name} has {count} joints, not {len(values)}",
            hint="alpha, beta of each leg",
        )
    points = feet(robot, np.radians(_finite(values)).reshape(-1, 2))
    return {"feet_m": {mount.name: _plain(point) for mount, point in zip(robot.mounts, points, strict=True)}}


def _finite(values: Sequence[float]) -> Floats:
    array = np.asarray(values, float)
    if not np.isfinite(array).all():
        raise InputError(
            "not-a-number", f"{', '.join(f'{value:zg}' for value in values)}: every number must be finite"
        )
    return array


def _beyond(arm: Arm, q: Floats) -> list[str]:
    """The joints that are not within their limits: forward kinematics says what would be, all the same."""
    return [
        joint.name
        for joint, value in zip(arm.joints, q.tolist(), strict=True)
        if not joint.lower - 1e-9 <= value <= joint.upper + 1e-9
    ]


def fk_symbolic(name: str, style: str = "text") -> Answer:
    """Link matrices, product and position in symbols, as text, LaTeX or C."""
    from servogen.kinematics.symbolic import symbolic_fk, text_of

    chosen = _style(style)
    found = symbolic_fk(named.arm(name))
    return {
        "links": [text_of(link, chosen, f"A{index}") for index, link in enumerate(found.links, 1)],
        "product": text_of(found.product, chosen, "T"),
        "position": text_of(found.position, chosen, "p"),
    }


def _style(style: str) -> Any:
    if style not in ("text", "latex", "c"):
        raise InputError("bad-option", f"'{style}' is no style", hint="text, latex or c")
    return style


def ik_answer(name: str, values: Sequence[float], everything: bool = False) -> Answer:
    """The joint positions for a target x, y, z in millimetres and, if given, its orientation in degrees."""
    arm = named.arm(name)
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
    """Elements, joints, mobility M and manoeuvrability M - 6."""
    found = mobility.of_robot(named.robot(name))
    return {
        "elements": found.elements,
        "joints": list(found.joints),
        "passive_joints": found.passive,
        "mobility": found.mobility,
        "manoeuvrability": found.manoeuvrability,
        "verdict": found.verdict,
        "note": found.note,
    }


def transform_answer(text: str, point: Sequence[float] = ()) -> Answer:
    """The matrix of a product of transforms and, if a point is given, where it is moved to (same unit)."""
    if len(point) not in (0, 3):
        raise InputError(
            "wrong-count", f"a point has three coordinates, not {len(point)}", Location(key="point")
        )
    matrix = parse(text)
    answer: Answer = {"matrix": _plain(matrix)}
    return answer | {"point": _plain(apply(matrix, _finite(point)))} if len(point) else answer


def jacobian_answer(name: str, values: Sequence[float], frame: FrameName = 0) -> Answer:
    """The geometric Jacobian at joint positions in degrees and millimetres; how well the arm moves there."""
    arm = named.arm(name)
    q = joint_values(arm, values)
    found = singularity(arm, q)
    return {
        "frame": frame,
        "jacobian": _plain(jacobian(arm, q, frame)),
        "manipulability": float(manipulability(arm, q)),
        "rank": found.rank,
        "singular": found.singular,
        "lost_directions": [list(each) for each in found.lost],
    }


def jacobian_symbolic(name: str, frame: FrameName = 0, style: str = "text") -> Answer:
    """The geometric Jacobian in symbols, in the base's frame (0) or the tool's ("n")."""
    from servogen.kinematics.symbolic import symbolic_jacobian, text_of

    if frame not in (0, "n"):
        raise InputError(
            "unknown-frame", f"in symbols the frame is 0 or n, not {frame}", Location(key="frame")
        )
    matrix = symbolic_jacobian(named.arm(name), "n" if frame == "n" else "0")
    return {"frame": frame, "jacobian": text_of(matrix, _style(style), "J")}


def joint_text(arm: Arm, q: Sequence[float]) -> str:
    """Joint positions for people: degrees and millimetres with the joints' names."""
    parts = []
    for joint, value in zip(arm.joints, q, strict=True):
        shown = round(degrees(value) if joint.turning else 1000 * value, 3)
        parts.append(f"{joint.name} {shown:z.3f}" + ("°" if joint.turning else " mm"))
    return "  ".join(parts)


def _plain(array: Floats) -> Any:
    """Nested lists of floats, rounding noise around 0 taken as 0."""
    return (np.where(np.abs(array) < 1e-15, 0.0, array) + 0.0).tolist()
