"""The answers of the commands about robots and kinematics, for JSON.

In: names and numbers as a user types them (degrees and millimetres). Out: dicts whose keys end with the unit:
metres and degrees; joint positions, each with its own unit, as they are typed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import atan2, degrees, hypot, radians
from typing import TYPE_CHECKING, Any

import numpy as np

from servogen.errors import InputError, Location, did_you_mean
from servogen.kinematics import catalogue
from servogen.kinematics.forward import fk, fk_position, joint_array
from servogen.kinematics.inverse.checked_forms import has_closed_form
from servogen.kinematics.inverse.closed_forms import cosine_sine_sum
from servogen.kinematics.inverse.configuration import (
    configuration_of,
    free_of_configuration,
    has_roll,
    ik_of_configuration,
)
from servogen.kinematics.inverse.solve import free_joints, ik_typed
from servogen.kinematics.jacobian import (
    FrameName,
    analytic_jacobian,
    change,
    differential,
    jacobian,
    manipulability,
    motion_of,
    seen_from,
    singularity,
    static_torques,
)
from servogen.kinematics.mobility import Mobility, of_mechanism
from servogen.kinematics.orientation import (
    ORDERS,
    from_angles,
    from_axis_angle,
    from_quaternion,
    orientation_names,
    to_angles,
    to_axis_angle,
    to_quaternion,
)
from servogen.kinematics.protocol import Answer, DrivingRobot
from servogen.kinematics.registry import KINDS
from servogen.kinematics.statics import gravity_torques, has_masses
from servogen.kinematics.symbolic import symbolic_fk, symbolic_jacobian, text_of
from servogen.kinematics.transforms import (
    MAX_NUMBER,
    Floats,
    apply,
    is_rotation,
    mount_matrix,
    parse,
    to_body,
)
from servogen.robot.model import Arm, Limb, Robot

if TYPE_CHECKING:
    from servogen.answers import EquationAnswer, MobilityAnswer, OrientationAnswer, RobotEntry


def robot_list() -> list[RobotEntry]:
    """Return the short name, title, kind and number of driven joints of every robot in the catalogue."""
    robots = ((name, catalogue.robot(name)) for name in catalogue.names())
    return [
        {
            "name": name,
            "title": robot.title,
            "kind": robot.kind,
            "joints": _degrees_of_freedom(robot),
            "dimensions": robot.dimensions,
            "source": robot.source,
        }
        for name, robot in robots
    ]


def _degrees_of_freedom(robot: Robot) -> int:
    wheels = robot.wheel_count if isinstance(robot, DrivingRobot) else 0
    return wheels + sum(len(limb.joints) for limb in robot.limbs)


def robot_details(name: str) -> Answer:
    """Return the facts of a robot: those that every robot has, and those of its kind."""
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
    """Return the pose of an arm's tool or the feet of a walking robot at positions in degrees and mm, or the
    speed of a base on wheels whose speeds are given in degrees per second.
    """
    robot = catalogue.robot(name)
    if isinstance(robot, DrivingRobot):
        return _body_speed_answer(robot, values)
    if any(limb.mount for limb in robot.limbs):
        return _feet_answer(robot, values)
    arm = catalogue.arm(name)
    q = joint_values(arm, values)
    pose = fk(arm, q)
    return {
        "position_m": _plain(pose[:3, 3]),
        "rotation": _plain(pose[:3, :3]),
        "configuration_vector": _plain(configuration_of(arm, q)) if has_roll(arm) else None,
        "beyond_limits": _beyond(arm, q),
    }


def _body_speed_answer(base: DrivingRobot, values: Sequence[float]) -> Answer:
    """Return the body speed of wheel speeds given in degrees per second."""
    if len(values) != base.wheel_count:
        raise InputError(
            "wrong-count",
            f"{base.name} has {base.wheel_count} wheels, not {len(values)}",
            hint="the speed of each wheel in degrees per second",
        )
    vx, vy, turn = (float(speed) for speed in _plain(base.body_speed(np.radians(_finite(values)))))
    speed = hypot(vx, vy)
    standing, straight = speed < STILL, abs(turn) < STILL
    return {
        "vx_m_s": vx,
        "vy_m_s": vy,
        "turn_deg_s": degrees(turn),
        "speed_m_s": speed,
        "direction_deg": None if standing else degrees(atan2(vy, vx)),
        "radius_m": None if straight else speed / abs(turn),
    }


STILL = 1e-12
"""Metres or radians per second that are rounding noise."""


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
    beyond = next((value for value in values if abs(value) > MAX_NUMBER), None)
    if beyond is not None:
        raise InputError("out-of-range", f"{beyond:g} is not a number from -{MAX_NUMBER:g} to {MAX_NUMBER:g}")
    return array


def _beyond(arm: Arm, q: Floats) -> list[str]:
    """Return the names of the joints that are beyond their limits, which forward kinematics accepts."""
    return [
        joint.name for joint, value in zip(arm.joints, q.tolist(), strict=True) if not joint.allows(value)
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
    """Return the joint positions that reach x, y, z in mm and, if given, an orientation in degrees, or the
    wheel speeds that give a base on wheels a speed in mm and degrees per second.
    """
    robot = catalogue.robot(name)
    if isinstance(robot, DrivingRobot):
        return _wheel_speed_answer(robot, values)
    arm = catalogue.arm(name)
    names = ("x", "y", "z", *orientation_names(arm))
    if len(values) not in (3, len(names)):
        wanted = "x y z" + (f" or {' '.join(names)}" if len(names) > 3 else "")
        raise InputError(
            "wrong-count", f"{arm.name} takes {wanted}, not {len(values)} numbers", Location(key="target")
        )
    position = _finite(values[:3]) / 1000
    angles = np.radians(_finite(values[3:]))
    solutions, missed = ik_typed(arm, position, angles if len(angles) else None)
    free = free_joints(arm, solutions, oriented=bool(len(angles)))
    return _solutions_answer(arm, solutions, everything, free, missed, oriented=bool(len(angles)))


def _solutions_answer(
    arm: Arm, solutions: Floats, everything: bool, free: Sequence[str], missed: float, *, oriented: bool
) -> Answer:
    return {
        "solutions": [positions_of(arm, q) for q in (solutions if everything else solutions[:1])],
        "found": len(solutions),
        "free": list(free),
        "complete": not free and has_closed_form(arm, oriented),
        "missed_m": missed,
    }


def _wheel_speed_answer(base: DrivingRobot, values: Sequence[float]) -> Answer:
    """Return the wheel speeds of a body speed given in mm and degrees per second."""
    if len(values) != 3:
        raise InputError(
            "wrong-count",
            f"{base.name} takes vx vy turn, not {len(values)} numbers",
            Location(key="target"),
            "millimetres per second and degrees per second",
        )
    vx, vy, turn = _finite(values)
    speeds = base.wheel_speeds((vx / 1000, vy / 1000, radians(turn)))
    of_kind = KINDS[base.kind].wheel_details(base, speeds)
    return {"wheel_speeds_deg_s": _plain(np.degrees(speeds))} | {
        key: _plain(value) for key, value in of_kind.items()
    }


def configuration_answer(name: str, vector: Sequence[float], everything: bool = False) -> Answer:
    """Return the joint positions with the configuration vector W = (p, e^{θ/π} a), its p in mm."""
    arm = catalogue.arm(name)
    if len(vector) != 6:
        raise InputError(
            "wrong-count",
            f"a configuration vector has six numbers, not {len(vector)}",
            Location(key="target"),
            "x y z in mm, then the approach vector times e^(roll/π)",
        )
    wanted = _finite(vector) / ([1000.0] * 3 + [1.0] * 3)
    solutions = ik_of_configuration(arm, wanted)
    missed = np.linalg.norm(configuration_of(arm, solutions[0])[:3] - wanted[:3])
    free = free_of_configuration(arm, solutions)
    return _solutions_answer(arm, solutions, everything, free, float(missed), oriented=True)


def mobility_answer(name: str) -> MobilityAnswer:
    """Return the elements, joints, mobility M and manoeuvrability M - 6 of a robot."""
    robot = catalogue.robot(name)
    return _mobility_facts(KINDS[robot.kind].mobility(robot))


MAX_JOINTS = 1000
"""The maximum number of joints of one kind; a greater one is a typing error."""
MAX_DIGITS = 6


def mechanism_answer(elements: int, joints: Sequence[str], *, plane: bool = False) -> MobilityAnswer:
    """Return the same facts of a mechanism with `elements` elements, including the base, and joints given as
    "kind" or "kind:count".
    """
    kinds: list[str] = []
    for text in joints:
        kind, _, count = text.partition(":")
        if count and not (count.isascii() and count.isdigit()):
            raise InputError(
                "bad-option", f"'{text[:60]}' is not a kind of joint and its number", hint="turning:4"
            )
        number = int(count[:MAX_DIGITS] or 1)  # the first digits say that it is too great
        if not 1 <= number <= MAX_JOINTS:
            raise InputError(
                "out-of-range", f"'{text[:60]}' is not 1 to {MAX_JOINTS} joints", Location(key="--joint")
            )
        kinds += [kind.strip().lower()] * number
    return _mobility_facts(of_mechanism(elements, kinds, plane=plane))


def _mobility_facts(mobility: Mobility) -> MobilityAnswer:
    return {
        "elements": mobility.elements,
        "joints": list(mobility.joints),
        "closed_loops": mobility.closed_loops,
        "passive_joints": mobility.passive,
        "mobility": mobility.mobility,
        "manoeuvrability": mobility.manoeuvrability,
        "verdict": mobility.verdict,
        "note": mobility.note,
    }


def transform_answer(text: str, point: Sequence[float] = ()) -> Answer:
    """Return the matrix of a product of transforms and, if `point` is given, where it moves that point: three
    coordinates, or four homogeneous ones (X, Y, Z, W), of which W = 0 is a direction.
    """
    if len(point) not in (0, 3, 4):
        raise InputError(
            "wrong-count",
            f"a point has three coordinates, or four homogeneous ones, not {len(point)}",
            Location(key="point"),
        )
    matrix = parse(text)
    answer: Answer = {"matrix": _plain(matrix)}
    if len(point) == 4:
        return answer | {"point": _plain(matrix @ _finite(point))}
    return answer | {"point": _plain(apply(matrix, _finite(point)))} if len(point) else answer


def differential_answer(
    text: str, d: Sequence[float], delta: Sequence[float], *, moving: bool = False
) -> Answer:
    """Return how the frame T of a product changes by a small translation d, in the product's unit of length,
    and a small rotation δ in radians: Δ, dT = Δ T, and the motion in both frames.

    d and δ are about the fixed axes, or with `moving` about those of T.
    """
    frame = parse(text)
    small, turned = _finite(d), _finite(delta)
    if moving:
        small, turned = motion_of(frame @ differential(small, turned), frame)
    own_d, own_delta = seen_from(frame, small, turned)
    return {
        "matrix": _plain(frame),
        "delta": _plain(differential(small, turned)),
        "change": _plain(change(frame, small, turned)),
        "fixed": {"translation": _plain(small), "rotation_rad": _plain(turned)},
        "moving": {"translation": _plain(own_d), "rotation_rad": _plain(own_delta)},
    }


def equation_answer(a: float, b: float, c: float) -> EquationAnswer:
    """Return every x in (-180°, 180°] with a cos x + b sin x + c = 0, in ascending order.

    a cos x + b sin x is √(a² + b²) cos(x - atan2(b, a)): there are two where |c| < √(a² + b²), one where both
    are equal to rounding, else none. With a = b = 0 the equation says nothing of x: every x solves it if
    c = 0, else none.
    """
    cosine, sine, constant = _finite((a, b, c)).tolist()
    amplitude = hypot(cosine, sine)
    both = np.degrees(cosine_sine_sum(cosine, sine, -constant))
    if amplitude == 0.0 or abs(constant) > amplitude * (1 + SAME_AMPLITUDE):
        both = both[:0]
    elif abs(constant) >= amplitude * (1 - SAME_AMPLITUDE):
        both = both[:1]
    within = both - 360 * np.ceil((both - 180) / 360)
    return {
        "amplitude": amplitude,
        "solutions_deg": _plain(np.sort(within)),
        "every_angle": amplitude == constant == 0.0,
    }


SAME_AMPLITUDE = 1e-14
"""The relative difference of c and √(a² + b²) that is rounding."""

ORIENTATION_FORMS = {
    **dict.fromkeys(ORDERS, 3),
    "RPY": 3,
    "AXIS-ANGLE": 4,
    "QUATERNION": 4,
    "MATRIX": 9,
}
"""The ways to give an orientation, and how many numbers each takes. RPY is another name of ZYX."""


def orientation_answer(form: str, values: Sequence[float]) -> OrientationAnswer:
    """Return an orientation in every form: angles in degrees in all twelve orders, both solutions of the
    first two, axis and angle, the quaternion (scalar first), the matrix.

    `values` are degrees for angles, plain numbers otherwise. A matrix is given row by row.
    """
    name = form.upper().replace("_", "-")
    if name not in ORIENTATION_FORMS:
        known = [form.lower() for form in ORIENTATION_FORMS]
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
        "angles_deg": {order: _plain(np.degrees(to_angles(rotation, order))) for order in ORDERS},
        "second_deg": {
            order: _plain(np.degrees(to_angles(rotation, order, second=True))) for order in ORDERS
        },
        "axis": _plain(axis),
        "angle_deg": degrees(angle),
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
"""The tolerance of a matrix that is typed with three or four digits."""


def jacobian_answer(
    name: str,
    values: Sequence[float],
    frame: FrameName = 0,
    rates: Sequence[float] = (),
    analytic: str | None = None,
) -> Answer:
    """Return the geometric Jacobian at positions in degrees and mm, and how well the arm moves there; with
    the `rates` of the joints, in degrees and mm per second, the velocity of the tool.

    With `analytic`, an order of three angles, it is the analytic one: rates of x, y, z and of these angles.

    For a base on wheels it has the rows vx, vy, Ω and a column for each wheel.
    """
    robot = catalogue.robot(name)
    if isinstance(robot, DrivingRobot):
        return _base_jacobian_answer(robot, values, frame, rates, analytic)
    if analytic is not None and frame != 0:
        place = Location(key="--analytic")
        raise InputError("conflicting-options", "angles are those in the base's frame", place, "omit --frame")
    arm = catalogue.arm(name)
    q = joint_values(arm, values)
    singular = singularity(arm, q)
    matrix = jacobian(arm, q, frame)
    velocity = matrix @ joint_values(arm, rates) if len(rates) else None
    moved: Answer = {}
    if velocity is not None:
        moved = {
            "velocity_m_s": _plain(velocity[:3]),
            "angular_velocity_deg_s": _plain(np.degrees(velocity[3:])),
        }
    return {
        "frame": frame,
        "jacobian": _plain(matrix if analytic is None else analytic_jacobian(arm, q, analytic)),
        **moved,
        "manipulability": float(manipulability(arm, q)),
        "rank": singular.rank,
        "singular": singular.singular,
        "lost_directions": [list(direction) for direction in singular.lost],
    }


def _base_jacobian_answer(
    base: DrivingRobot,
    values: Sequence[float],
    frame: FrameName,
    rates: Sequence[float],
    analytic: str | None,
) -> Answer:
    """Return the matrix from wheel speeds to body speeds, and its inverse."""
    if len(values) or len(rates) or frame != 0 or analytic:
        raise InputError(
            "bad-option",
            f"the Jacobian of {base.name} is the same everywhere: it takes no positions, frame or angles",
            hint="servogen fk gives the speed of the base for wheel speeds",
        )
    matrix = base.body_speed(np.eye(base.wheel_count)).T
    return {
        "frame": frame,
        "jacobian": _plain(matrix),
        "inverse": _plain(np.asarray(np.linalg.pinv(matrix), float)),
        "rank": int(np.linalg.matrix_rank(matrix)),
    }


def statics_answer(
    name: str,
    values: Sequence[float],
    force: Sequence[float],
    moment: Sequence[float],
    leg: str | None = None,
) -> Answer:
    """Return the loads τ = Jᵀ (F, M) that a force (N) and a moment (N·m) on the tool or foot put on the
    joints, at positions in degrees and mm, and what the motors must give to hold still.

    Force and moment are in the universal frame or, for a `leg` of a walking robot, in that of its body. If
    the robot's file states masses, the motors hold their weight too.
    """
    robot = catalogue.robot(name)
    limb = _limb(robot, leg)
    arm = catalogue.arm(name) if limb is None else limb.arm
    push, twist = _finite(force), _finite(moment)
    if limb is not None and limb.mount is not None:
        turn = mount_matrix(limb.mount)[:3, :3]
        push, twist = turn.T @ push, np.linalg.det(turn) * (turn.T @ twist)
    if not has_masses(arm) and not push.any() and not twist.any():
        raise InputError(
            "missing-option",
            f"nothing loads {robot.name}",
            hint="give a force or a moment, or masses in its file",
        )
    q = joint_values(arm, values)
    loads = static_torques(arm, q, push, twist)
    weights = gravity_torques(arm, q) if has_masses(arm) else np.zeros(len(arm.joints))
    joints = []
    for joint, load, weight in zip(arm.joints, _plain(loads), _plain(weights), strict=True):
        unit = "nm" if joint.turning else "n"
        joints.append(
            {
                "name": joint.name,
                f"load_{unit}": load,
                f"weight_{unit}": weight,
                f"motor_{unit}": weight - load,
            }
        )
    return {"joints": joints, "beyond_limits": _beyond(arm, q)}


def _limb(robot: Robot, leg: str | None) -> Limb | None:
    """Return the leg of that name of a walking robot, None for an arm. Raises InputError."""
    legs = {limb.name: limb for limb in robot.limbs if limb.mount is not None}
    if leg is None and not legs:
        return None
    if leg is None:
        raise InputError(
            "missing-option",
            f"{robot.name} has {len(legs)} legs: name one",
            hint=f"--leg {next(iter(legs))}",
        )
    if leg not in legs:
        hint = did_you_mean(leg, legs) if legs else "it has no legs: omit --leg"
        raise InputError("unknown-name", f"{robot.name} has no leg '{leg}'", hint=hint)
    return legs[leg]


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


def positions_of(arm: Arm, q: Floats) -> dict[str, float]:
    """Return joint positions by name and unit, as `joint_values` takes them: `q1_deg`, `q3_mm`."""
    return {
        f"{joint.name}_{'deg' if joint.turning else 'mm'}": degrees(value) if joint.turning else 1000 * value
        for joint, value in zip(arm.joints, _plain(q), strict=True)
    }


def joint_text(positions: Mapping[str, float]) -> str:
    """Return joint positions with their units in their names as text: the joints, degrees and millimetres."""
    parts = []
    for key, value in positions.items():
        name, _, unit = key.rpartition("_")
        parts.append(f"{name} {round(value, 3):z.3f}" + ("°" if unit == "deg" else " mm"))
    return "  ".join(parts)


def _plain(array: Floats) -> Any:
    """Return nested lists of floats, with rounding noise around 0 replaced by 0."""
    return (np.where(np.abs(array) < 1e-15, 0.0, array) + 0.0).tolist()
