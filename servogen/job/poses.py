"""[motion] poses of a job -> `motion.Pose` values: servo angles from `<servo>_deg` and from `foot_mm`.

In: the checked table, the servos and the leg. Out: one pose each, with every servo's angle in radians.
"""

from __future__ import annotations

import math

import numpy as np

from servogen.errors import InputError, nearest
from servogen.job.job import LegBinding
from servogen.job.model import MotionTable, PoseTable
from servogen.kinematics.unreachable import Unreachable, in_mm
from servogen.motion import Pose
from servogen.robot.servo import Servo
from servogen.toml_places import Key
from servogen.tomlfile import Document, exact, shown, unknown_key

ANGLE = "_deg"


def poses_of(
    document: Document, table: MotionTable, servos: tuple[Servo, ...], leg: LegBinding | None
) -> tuple[Pose, ...]:
    """All poses; a servo that a pose does not name stays where it was. Raises InputError."""
    poses: list[Pose] = []
    before: dict[str, float] = {}
    for index, row in enumerate(table.poses):
        key: Key = ("motion", "poses", index)
        angles = before | _angles(document, key, row, servos, leg, before)
        missing = [servo.name for servo in servos if servo.name not in angles]
        if missing:
            raise document.error(
                key,
                f"the first pose does not say where {missing[0]} is",
                f"add {missing[0]}{ANGLE} = … (later poses may leave it away: it stays)",
            )
        if row.release and not row.pause_s:
            raise document.error(
                (*key, "release"), "release = true without a pause", "say how long: pause_s = …"
            )
        poses.append(
            Pose(
                tuple(angles[servo.name] for servo in servos),
                exact(row.move_s),
                exact(row.hold_s),
                exact(row.pause_s),
                row.release,
                document.place(*key),
            )
        )
        before = angles
    return tuple(poses)


def _angles(
    document: Document,
    key: Key,
    row: PoseTable,
    servos: tuple[Servo, ...],
    leg: LegBinding | None,
    before: dict[str, float],
) -> dict[str, float]:
    """The angles that one pose names."""
    by_key = {servo.name + ANGLE: servo for servo in servos}
    angles: dict[str, float] = {}
    for word, value in (row.model_extra or {}).items():
        here = (*key, word)
        if word not in by_key:
            raise _unknown(document, here, word, by_key)
        servo, angle = by_key[word], _angle(document, here, value)
        servo.width_us(angle, document.place(*here))
        angles[servo.name] = angle
    if row.foot_mm is not None:
        here = (*key, "foot_mm")
        if leg is None:
            raise document.error(
                here, "a foot position needs a leg", "add the section [leg] with its lengths"
            )
        for name in (leg.alpha, leg.beta):
            if name in angles:
                raise document.error(
                    (*key, name + ANGLE),
                    f"{name}'s angle follows from foot_mm already",
                    "give one of the two",
                )
        angles |= _foot(document, here, row.foot_mm, servos, leg, before)
    return angles


def _angle(document: Document, key: Key, value: object) -> float:
    """Radians of a finite number of degrees."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            degrees = float(value)
        except OverflowError:
            degrees = math.inf
        if math.isfinite(degrees):
            return math.radians(degrees)
    raise document.error(key, f"{shown(value)} is not an angle", f"a finite number: {key[-1]} = 90")


def _unknown(document: Document, key: Key, word: str, by_key: dict[str, Servo]) -> InputError:
    fields = [*PoseTable.model_fields, *by_key]
    if word.endswith(ANGLE):
        names = [servo.name for servo in by_key.values()]
        name = word[: -len(ANGLE)]
        return document.error(key, f"there is no servo '{name}'", nearest(name, names))
    return unknown_key(document, key, fields)


def _foot(
    document: Document,
    key: Key,
    foot_mm: tuple[float, float, float],
    servos: tuple[Servo, ...],
    binding: LegBinding,
    before: dict[str, float],
) -> dict[str, float]:
    """The servo angles that put the foot there: inside the limits, and nearest to the pose before."""
    leg = binding.leg
    target = np.array(foot_mm) / 1000
    place = document.place(*key)
    nearest_point = np.array(leg.nearest(target))
    # A position in a file has few digits: it is taken to mean the point of the surface that is nearest to it.
    if float(np.linalg.norm(nearest_point - target)) > binding.tolerance:
        try:
            leg.ik(target)
        except Unreachable as error:
            raise error.at(place) from error
    by_name = {servo.name: servo for servo in servos}
    alpha, beta = by_name[binding.alpha], by_name[binding.beta]
    solutions = [
        (binding.alpha_zero + a, binding.beta_zero + b)
        for a, b in leg.ik(nearest_point).tolist()
        if binding.beta_sign * b >= 0
    ]
    allowed = [each for each in solutions if alpha.allows(each[0]) and beta.allows(each[1])]
    if not allowed:
        shown = " or ".join(
            f"{alpha.name} {math.degrees(a):.1f}°, {beta.name} {math.degrees(b):.1f}°" for a, b in solutions
        )
        raise InputError(
            f"the foot position {in_mm(target.tolist())} needs angles outside of the servos' travel: {shown}",
            place,
            "move the foot, or change alpha_zero_deg and beta_zero_deg to how the servos are mounted",
        )
    start = (
        before.get(alpha.name, binding.alpha_zero),
        before.get(beta.name, binding.beta_zero),
    )
    best = min(allowed, key=lambda each: max(abs(each[0] - start[0]), abs(each[1] - start[1])))
    return {alpha.name: best[0], beta.name: best[1]}
