"""[drive] of a job -> the wheel servos' trajectory: a contour of a robot on wheels, or its routines.

In: the job and its validated table. Out: `PlannedPoses`; its notes describe the stretches, and how far from
its plan a round ends when the pulses are whole cycles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from servogen.errors import Diagnostic, InputError
from servogen.job.job import Job
from servogen.job.schema import DriveTable
from servogen.kinematics.protocol import DrivingRobot, Routine, Stretch
from servogen.motion import JointTrajectory, PlannedPoses
from servogen.motion.drive import PlannedDrive, drive, positions
from servogen.motion.trajectory import Floats
from servogen.robot.servo import Servo
from servogen.toml.file import Document, exact
from servogen.units import Clock, counted


def plan_drive(
    job: Job,
    table: DriveTable,
) -> PlannedPoses:
    """Return the drive along the contour or by the routines. Raises InputError."""
    document, robot, servos = job.document, job.robot, job.servos
    period, clock = job.frame.period.cycles, job.clock
    if not isinstance(robot, DrivingRobot):
        raise document.error(
            "missing-robot", ("drive",), "a drive needs a robot on wheels", 'add [robot] name = "omni"'
        )
    wheels = _wheels(document, table, robot, servos)
    stretches = _stretches(document, table, robot)
    try:
        planned = drive(
            stretches,
            table.speed_mm_s / 1000,
            period,
            clock,
            wheels=table.wheels,
            pause_s=exact(table.pause_s),
            ramp_s=exact(table.ramp_s),
            repeat=table.repeat,
        )
    except InputError as error:
        raise error.at(document.place("drive", _source(table))) from error
    _check_speeds(document, table, planned, wheels)
    ending = _ending(document, table, robot, planned, wheels, clock)
    notes = (*_stretch_notes(document, table, planned), ending)
    order = [table.wheels.index(servo.name) for servo in servos]
    angles = planned.trajectory.angles[:, order]
    if table.end == "release":
        angles[-1] = np.nan
    names = tuple(servo.name for servo in servos)
    return PlannedPoses(
        JointTrajectory(
            joints=names, clock=clock, period=period, angles=angles, loop_start=planned.trajectory.loop_start
        ),
        notes=notes,
    )


def _source(table: DriveTable) -> str:
    """Return the key that says where the base goes."""
    return "corners_mm" if table.corners_mm is not None else "routines"


def _stretches(document: Document, table: DriveTable, robot: DrivingRobot) -> tuple[Stretch, ...]:
    """Return the stretches of the contour, or of the routines one after the other. Raises InputError."""
    if table.corners_mm is None and table.routines is None:
        raise document.error("missing-key", ("drive",), "a drive needs corners_mm or routines")
    if table.corners_mm is not None and table.routines is not None:
        raise document.error(
            "conflicting-keys",
            ("drive",),
            "a drive has either corners_mm or routines",
            "remove one of the two",
        )
    if table.corners_mm is not None:
        try:
            return robot.route([(x / 1000, y / 1000) for x, y in table.corners_mm], table.directions)
        except InputError as error:
            raise error.at(document.place("drive", "corners_mm")) from error
    stretches: list[Stretch] = []
    for index, row in enumerate(table.routines or ()):
        routine = Routine(
            row.name,
            None if row.direction_deg is None else math.radians(row.direction_deg),
            None if row.distance_mm is None else row.distance_mm / 1000,
            None if row.turn_deg is None else math.radians(row.turn_deg),
        )
        try:
            stretches += robot.routine(routine, table.directions)
        except InputError as error:
            raise error.at(document.place("drive", "routines", index)) from error
    return tuple(stretches)


def _wheels(
    document: Document, table: DriveTable, robot: DrivingRobot, servos: Sequence[Servo]
) -> tuple[Servo, ...]:
    """Return the servos of the wheels 1, 2, …: one for each wheel, continuous, and together all of the
    job's.
    """
    if len(table.wheels) != robot.wheel_count:
        raise document.error(
            "wrong-count",
            ("drive", "wheels"),
            f"{robot.name} has {robot.wheel_count} wheels, not {len(table.wheels)}",
        )
    by_name = {servo.name: servo for servo in servos}
    for index, name in enumerate(table.wheels):
        key = ("drive", "wheels", index)
        document.check_known("unknown-servo", key, name, by_name, f"there is no servo '{name}'")
        if name in table.wheels[:index]:
            raise document.error("joint-binding", key, f"'{name}' is the servo of two wheels")
        if not by_name[name].model.continuous:
            raise document.error(
                "wrong-servo-kind",
                key,
                f"'{name}' is not a continuous-rotation servo",
                'a wheel needs a continuous-rotation servo, such as model = "continuous"',
            )
    for index, servo in enumerate(servos):
        if servo.name not in table.wheels:
            raise document.error(
                "joint-binding",
                ("servo", index),
                f"{servo.name} turns no wheel: {robot.name} has {robot.wheel_count}",
            )
    return tuple(by_name[name] for name in table.wheels)


def _check_speeds(
    document: Document, table: DriveTable, planned: PlannedDrive, wheels: Sequence[Servo]
) -> None:
    """Raise InputError if a wheel is faster than its servo, naming the wheel that exceeds its limit most."""
    asked = [
        (servo, speed, servo.limits[0 if speed < 0 else 1])
        for servo, column in zip(wheels, planned.trajectory.angles.T, strict=True)
        for speed in (float(column.min()), float(column.max()))
        if not servo.allows(speed)
    ]
    if not asked:
        return
    servo, speed, _ = min(asked, key=lambda row: row[2] / row[1])
    low, high = (servo.model.shown(end) for end in servo.limits)
    # At the full speed: rounding a stretch up to whole frames makes its wheels slower than that.
    fastest = min(
        stretch.length * wheel.limits[0 if angle < 0 else 1] / angle
        for stretch in planned.stretches
        for wheel, angle in zip(wheels, stretch.wheel_angles, strict=True)
        if angle
    )
    raise document.error(
        "servo-limit",
        ("drive", "speed_mm_s"),
        f"{servo.name} would have to turn at {math.degrees(speed):z.0f}°/s: its speeds are {low} to {high}",
        f"at most {math.floor(1000 * fastest)} mm/s on this "
        + ("contour" if table.corners_mm is not None else "drive"),
    )


def _stretch_notes(document: Document, table: DriveTable, planned: PlannedDrive) -> list[Diagnostic]:
    """Return a note for each stretch: its direction, how far the wheels turn, its time."""
    period_s = float(planned.trajectory.clock.seconds(planned.trajectory.period))
    notes = []
    for index, (stretch, frames) in enumerate(zip(planned.stretches, planned.frames, strict=True)):
        text = f"stretch {index + 1}: {stretch.text}, {counted(frames, 'frame')}, {frames * period_s:g} s"
        text += f"; {stretch.remark}" if stretch.remark else ""
        notes.append(Diagnostic("note", "stretch", text, document.place("drive", _source(table))))
    return notes


def _ending(
    document: Document,
    table: DriveTable,
    base: DrivingRobot,
    planned: PlannedDrive,
    wheels: Sequence[Servo],
    clock: Clock,
) -> Diagnostic:
    """Return a note about how far a round with pulses of whole cycles ends from where it should.

    A contour should end where it began, routines where they lead.
    """
    columns = zip(wheels, planned.trajectory.angles.T, strict=True)
    speeds = np.stack([_achieved_speeds(servo, column, clock) for servo, column in columns], axis=1)
    period_s = float(clock.seconds(planned.trajectory.period))
    asked = positions(base, planned.trajectory.angles, period_s)[-1]
    end = positions(base, speeds, period_s)[-1]
    x, y, turn = (end if table.corners_mm is not None else end - asked).tolist()
    missed = f"{1000 * math.hypot(x, y):z.2f} mm and {math.degrees(turn):z.3f}° from "
    text = f"with pulses of whole cycles, a round ends {missed}its start"
    if table.corners_mm is None:
        to_x, to_y, heading = asked.tolist()
        text = (
            f"a round leads to x {1000 * to_x:z.1f}, y {1000 * to_y:z.1f} mm, heading "
            f"{math.degrees(heading):z.1f}°; with pulses of whole cycles it ends {missed}there"
        )
    return Diagnostic("note", "closing", text, document.place("drive"))


def _achieved_speeds(servo: Servo, speeds: Floats, clock: Clock) -> Floats:
    """Return the speeds in rad/s that result from pulses of whole cycles."""
    distinct, back = np.unique(speeds, return_inverse=True)
    given = [
        servo.angle(float(clock.round_us(servo.width_us(speed)).achieved_us)) for speed in distinct.tolist()
    ]
    return np.array(given)[back]
