"""Job files to start from: `starters/*.toml`, a whole job for each kind of robot.

In: the kind, the servo that turns its joints. Out: the text of a job file, planned before it is returned.
"""

from __future__ import annotations

import json
import math
import os
import re
from importlib.resources import files
from pathlib import Path

from servogen.errors import InputError, ServogenError, check_known
from servogen.job.chips import motion_part
from servogen.job.plan import plan_job
from servogen.job.reader import loads
from servogen.kinematics.catalogue import robot
from servogen.pulse import plan
from servogen.robot import servo_models
from servogen.robot.model import Robot
from servogen.robot.servo import ServoModel

KINDS = (
    "servo",
    "arm",
    "leg",
    "hexapod",
    "hexapod-hip-lift",
    "hexapod-coxa-femur-tibia",
    "quadruped-hip-lift",
    "quadruped-coxa-femur-tibia",
    "omni",
    "stream",
)
"""The kinds of robots, from one servo on a pin to positions over a serial line; of several whose names begin
alike, the one with fewer servos first.
"""

MODEL = re.compile(r'^model = "([^"]*)"', re.MULTILINE)
LEG_JOINT = re.compile(r'^(joint = "[A-Z].*)$', re.MULTILINE)
"""The joint of a leg, named behind it (`L1_coxa`), whose servo's zero the templates leave out."""

LEGGED = ("hexapod", "quadruped")
EXAMPLE = re.compile(r'^(# EXAMPLE dimensions.*\n)?\[robot\]\nname = "([^"]*)"', re.MULTILINE)
HEIGHT = re.compile(r"^(?=body_height_mm)", re.MULTILINE)
"""The height of an example's body, which is not that of another robot."""

ZERO = re.compile(r"^((?:alpha|beta)_zero_deg = )90", re.MULTILINE)
ANGLE = re.compile(r"\b((?:arm|min|max)_deg = )(\d+)")
USUAL_DEG = 180.0
"""The travel of the servos that the templates are written for."""


def template(kind: str = KINDS[0]) -> str:
    """Return the commented job file of a kind, with the servos it was written for. Raises InputError.

    The beginning of a name is enough: "quadruped" is the first kind that begins with it.
    """
    kind = next((each for each in KINDS if f"{each}-".startswith(f"{kind}-")), kind)
    check_known("unknown-name", kind, KINDS, f"there is no job to start from for '{kind}'")
    return (files("servogen.job") / "starters" / f"{kind}.toml").read_text(encoding="utf-8")


def usual_servo(kind: str) -> str:
    """Return the catalogue's servo that a kind's template names. Raises InputError."""
    return next(MODEL.finditer(template(kind)))[1]


def kind_of(name: str) -> str:
    """Return a kind in any case of letters, or the one whose job turns the joints of the legged robot in the
    file of that name. Raises InputError.
    """
    if not name.endswith(servo_models.FILE_ENDING):
        return name.lower()
    own, legs = robot(name), []
    for kind in KINDS:
        named = EXAMPLE.search(template(kind))
        example = robot(named[2]) if named and kind.startswith(LEGGED) else None
        if example is not None and _legs(example) == _legs(own):
            return kind
        if example is not None:
            legs.append(f"{kind}: {' '.join(limb.name for limb in example.limbs)}")
    raise InputError(
        "unknown-name",
        f"there is no job to start from for the joints of '{name}'",
        hint=f"those of legs that the robot's file names, left and right, as {'; '.join(legs)}",
    )


def _legs(robot: Robot) -> list[tuple[object, ...]]:
    """Return the joints of each leg, and whether it is mirrored."""
    return [(*limb.joints, limb.mount is not None and limb.mount.mirrored) for limb in robot.limbs]


def starter(kind: str, servo: str, file: Path) -> str:
    """Return the text of a job file that turns every joint of a kind of robot with one model of servo.

    `kind` may be the path of a legged robot's file. `servo` is a model of the catalogue in any usual
    spelling, or the path of a servo's file; `file` is where the job will be written. Raises InputError if
    there is no such kind or servo, or the servo does not fit.
    """
    own = kind if kind.endswith(servo_models.FILE_ENDING) else None
    kind = kind_of(kind)
    text = template(kind)
    if own is not None:
        named = f"[robot]\nname = {_beside(own, file)}"
        text = HEIGHT.sub("# ", EXAMPLE.sub(lambda _: named, text, count=1))
    name = servo_models.catalogued_as(servo)
    model = servo_models.servo_model(name)
    usual = servo_models.servo_model(usual_servo(kind))
    fits = f"{usual_servo(kind)} fits; `servogen servos` lists the others"
    if model.continuous != usual.continuous:
        wrong = "turns continuously" if model.continuous else "has angles"
        needs = "a servo with angles" if model.continuous else "continuous-rotation servos"
        raise InputError("wrong-servo-kind", f"'{kind}' needs {needs}: {model.title} {wrong}", hint=fits)
    quoted = _beside(name, file) if name.endswith(servo_models.FILE_ENDING) else json.dumps(name)
    text = _for_travel(MODEL.sub(lambda _: f"model = {quoted}", text), model)
    try:
        job = plan_job(loads(text, str(file)))
        for names in [chip.servos for chip in job.chips] or [job.trajectory.joints]:
            servos = [each for each in job.servos if each.name in names]
            plan(motion_part(job.trajectory, names), servos, job.frame)
    except ServogenError as error:
        message = f"{model.title} does not fit '{own or kind}': {error.first.message}"
        if own is not None:
            fits = f"or start from --robot {kind}, name your robot in that job, and change its [walk]"
        raise InputError(error.first.code, message, hint=fits) from error
    return text


def _beside(name: str, file: Path) -> str:
    """Return the path of a file as the job in `file` names it, in quotes."""
    return json.dumps(Path(os.path.relpath(name, file.parent)).as_posix(), ensure_ascii=False)


def _for_travel(text: str, model: ServoModel) -> str:
    """Return a template, which is written for 180°, for another travel: the horns of legs are in its middle,
    and servos' own angles at the same shares of it.
    """
    if model.continuous:
        return text
    low, high = (math.degrees(end) for end in model.travel)
    if (low, high) == (0, USUAL_DEG):
        return text
    middle = (low + high) / 2
    text = LEG_JOINT.sub(rf"\1\nzero_deg = {middle:g} # the middle of its travel", text)
    text = ZERO.sub(rf"\g<1>{middle:g}", text)
    return ANGLE.sub(lambda end: f"{end[1]}{round(low + int(end[2]) * (high - low) / USUAL_DEG)}", text)
