"""A job's robot as plain numbers, from which a page draws it at any angles of its servos.

In: a planned job, or a schedule, which knows its servos only. Out: a value that JSON can hold, in metres and
radians: the servos' calibrations, the rows or lengths of each leg or arm, the body or the base.
`templates/watch/robot.js` calculates the points.
"""

from __future__ import annotations

import math

import numpy as np

from servogen.edges import PINS
from servogen.job import PlannedJob
from servogen.job.ends import End
from servogen.kinematics.protocol import DrivingRobot
from servogen.kinematics.transforms import frame_matrix
from servogen.pulse import PulseSchedule
from servogen.report.drawing import PALETTE
from servogen.robot.servo import Servo, servo
from servogen.robot.servo_models import names
from servogen.robot.servo_models import servo_model as catalogue_model

UNLIMITED = 1000.0
"""The speed, in radians per second, of a servo whose model states none."""


def robot_model(job: PlannedJob, shown: int = 0) -> dict[str, object]:
    """Return the servos and what they move; of two chips `shown` is the one whose pins come first."""
    mounts = [limb.mount for limb in job.limbs if limb.mount is not None]
    order = sorted(mounts, key=lambda mount: math.atan2(mount.y, mount.x))
    return {
        "servos": [
            {**servo_model(servo, index), "pin": pin}
            for index, (servo, pin) in enumerate(zip(job.servos, job.pin_numbers(shown), strict=True))
        ],
        "ends": [_end(end) for end in job.ends],
        "body": [[mount.x, mount.y, mount.z] for mount in order],
        "base": None if job.base is None else _base(job, job.base),
    }


def schedule_model(schedule: PulseSchedule) -> dict[str, object] | None:
    """Return the servos of a schedule, calibrated as their models are; None if the catalogue lacks a model.

    A servo's own calibration, trim and mounting, and what it moves, are in its job.
    """
    if not {channel.servo for channel in schedule.channels} <= set(names()):
        return None
    servos = [
        servo_model(servo(channel.name, channel.pin, catalogue_model(channel.servo)), index)
        for index, channel in enumerate(schedule.channels)
    ]
    return {"servos": servos, "ends": [], "body": [], "base": None}


def servo_model(servo: Servo, index: int) -> dict[str, object]:
    """Return a servo; its `widths_us` rise and contain its trim, and `angles` are those of the shaft."""
    points = sorted(
        (point.width_us + servo.trim_us, servo.mounted(point.angle)) for point in servo.calibration.points
    )
    return {
        "name": servo.name,
        "pin": PINS.index(servo.pin),
        "colour": PALETTE[index % len(PALETTE)],
        "widths_us": [width for width, _ in points],
        "angles": [angle for _, angle in points],
        "speed": servo.model.speed or UNLIMITED,
        "neutral": servo.neutral,
        "limits": list(servo.limits),
        "continuous": servo.model.continuous,
    }


def _end(end: End) -> dict[str, object]:
    """Return a leg or an arm; `joints` say how the positions of its joints follow from the servos' angles."""
    arm, lengths = end.arm, end.arm.length
    joints = zip(end.bindings, end.columns, strict=True)
    shape: dict[str, object]
    if arm.closed_form == "pantograph":
        shape = {"leg": {name: lengths[name] for name in ("ab", "bc", "cd", "df")}}
    else:
        shape = {
            "modified": arm.convention == "modified",
            "base": frame_matrix(arm.base).ravel().tolist(),
            "tool": frame_matrix(arm.tool).ravel().tolist(),
            "rows": [
                {
                    "theta": row.theta,
                    "d": row.d.value(lengths),
                    "a": row.a.value(lengths),
                    "alpha": row.alpha,
                    "joint": row.joint,
                    "ratio": row.ratio,
                    "turning": row.joint is None or arm.joints[row.joint].turning,
                }
                for row in arm.rows
            ],
        }
    return {
        "name": end.name,
        "kind": end.kind,
        "place": np.asarray(end.place).ravel().tolist(),
        "joints": [
            {"servo": column, "zero": binding.zero, "ratio": binding.ratio} for binding, column in joints
        ],
        **shape,
    }


def _base(job: PlannedJob, base: DrivingRobot) -> dict[str, object]:
    """Return a base; `speeds` is the matrix from the wheels' speeds to its own: vx, vy, turn."""
    wheels = job.wheel_columns
    return {
        "wheels": wheels,
        "speeds": base.body_speed(np.eye(len(wheels))).T.tolist(),
        "outline": [
            [[float(point.real), float(point.imag)] for point in shape.ravel()] for shape in base.outline()
        ],
    }
