"""A job file -> `Job`. Every error names the line, the key, the value and what is allowed.

In: the path (or the text) of a job file. Out: the frozen `Job`, with what had to be rounded as warnings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from servogen.engines.player.layout import layout
from servogen.errors import InputError, Place
from servogen.job.buttons import buttons_of
from servogen.job.drives import drive_of
from servogen.job.job import Firmware, Job, NamedPose
from servogen.job.model import JobTable, MotionTable, WalkTable
from servogen.job.poses import poses_of
from servogen.job.programs import program_of
from servogen.job.robots import Rig, rig_of
from servogen.job.servos import servos_of
from servogen.job.streams import still, stream_of
from servogen.job.tip import ArmTip
from servogen.job.torques import arm_torques
from servogen.job.walks import walk_of
from servogen.motion import Motion, Planned, trajectory
from servogen.motion.limits import Limits
from servogen.motion.trajectory import MAX_FRAMES
from servogen.pic.device import Device, device
from servogen.pulse.slots import Frame, rises
from servogen.robot.model import Arm, Hexapod
from servogen.robot.servo import Servo
from servogen.toml import file as toml_file
from servogen.toml.file import Document, exact
from servogen.units import Clock, Cycles

LEAST_CLOCK_HZ = 32_000
"""A watch's crystal has 32768 Hz (DS35007, table of crystal capacitors, mode LP)."""

LEAST_PERIOD_US = 1000.0
"""As long as a servo's pulse is."""

PARTS = ("motion", "walk", "program", "drive")
"""The sections that say what the servos do."""


def load(path: str | Path) -> Job:
    """The job in the file at `path`. Raises InputError."""
    return _job(toml_file.read(path))


def load_walking(path: str | Path, way: Mapping[str, float]) -> Job:
    """The job at `path`, its [walk] going that one way instead. Raises InputError.

    `way` has the keys of one of [walk] way; without cycles it never ends.
    """
    document = toml_file.read(path)
    walk = {key: value for key, value in document.data.get("walk", {}).items() if key != "end"}
    walk |= {"way": (dict(way),), "repeat": "cycles" not in way}
    return _job(replace(document, data={**document.data, "walk": walk}))


def load_calibrated(path: str | Path, servo: str, file: str) -> Job:
    """The job at `path`, that servo having the calibration in `file`, beside the job. Raises InputError."""
    document = toml_file.read(path)
    rows = [
        {**{key: value for key, value in row.items() if key != "points"}, "calibration": file}
        if row.get("name") == servo
        else row
        for row in document.data["servo"]
    ]
    return _job(replace(document, data={**document.data, "servo": tuple(rows)}))


def loads(text: str, file: str) -> Job:
    """The job that `text` is; `file` is its name in errors. Raises InputError."""
    return _job(toml_file.parse(text, file))


def _job(document: Document) -> Job:
    table = toml_file.validate(document, JobTable)
    chip, clock = _chip(document, table)
    servos = servos_of(document, table.servo)
    rig = rig_of(document, table, servos)
    frame = _frame(document, table, clock)
    stream = stream_of(document, table, servos, clock)
    if stream is None:
        _check_frame(table.firmware.engine, servos, frame, clock)
    if stream is not None and not any(part in document.data for part in PARTS):
        planned, poses = Planned(still(servos, frame.period.cycles, clock)), tuple[NamedPose, ...]()
    else:
        planned, poses = _motion(document, table, servos, rig, frame, clock)
    _check_travel(document, planned, servos)
    _check_soft_start(document, table, planned)
    heavy = arm_torques(rig.tip, planned.trajectory.angles, servos) if isinstance(rig.tip, ArmTip) else ()
    return Job(
        _name(document),
        document.file,
        chip,
        clock,
        servos,
        rig.bindings,
        rig.robot,
        rig.tip,
        table.drive.wheels if table.drive else (),
        frame,
        Firmware(
            table.firmware.dialect,
            table.firmware.engine,
            exact(table.firmware.soft_start_s),
            buttons_of(document, table.firmware, servos),
        ),
        stream,
        planned.trajectory,
        poses,
        (*planned.warnings, *heavy),
        planned.notes,
    )


def _check_soft_start(document: Document, table: JobTable, planned: Planned) -> None:
    """Refuse a soft start that makes the motion too long: the neutral pose, and the way to the first one."""
    motion = planned.trajectory
    asked_s = exact(table.firmware.soft_start_s)
    frames = 2 * round(asked_s / motion.clock.seconds(motion.period)) + len(motion.angles)
    if frames > MAX_FRAMES:
        raise document.error(
            ("firmware", "soft_start_s"),
            f"the motion and a soft start of {float(asked_s):g} s are {frames} frames long",
            f"at most {MAX_FRAMES} frames, {float(MAX_FRAMES * motion.clock.seconds(motion.period)):g} s",
        )


def _name(document: Document) -> str:
    """Returns the name of the job: of a folder in `build/`, and in comments of the C."""
    name = Path(document.file).stem
    if name in (".", "..") or any(ord(sign) < ord(" ") for sign in name):
        raise InputError(
            f"the file's name makes the job's name {name!r}, which cannot be a folder",
            Place(document.file),
            "name the file after the job, as arm.toml",
        )
    return name


def _chip(document: Document, table: JobTable) -> tuple[Device, Clock]:
    try:
        chip = device(table.chip.device)
    except InputError as error:
        raise document.error(("chip", "device"), error.message, error.hint) from error
    if table.chip.clock_hz > chip.max_clock_hz:
        raise document.error(
            ("chip", "clock_hz"),
            f"{table.chip.clock_hz} Hz is above the {chip.name}'s limit of {chip.max_clock_hz} Hz",
            "the PIC16F84 runs at up to 10 MHz, the PIC16F84A at up to 20 MHz",
        )
    if table.chip.clock_hz < LEAST_CLOCK_HZ:
        raise document.error(
            ("chip", "clock_hz"),
            f"{table.chip.clock_hz} Hz is slower than any crystal: at least {LEAST_CLOCK_HZ} Hz",
            "4 MHz are 4_000_000",
        )
    return chip, Clock(table.chip.clock_hz)


def _frame(document: Document, table: JobTable, clock: Clock) -> Frame:
    if table.frame.period_us < LEAST_PERIOD_US:
        raise document.error(
            ("frame", "period_us"),
            f"{table.frame.period_us:g} µs is no longer than a pulse",
            "20 ms are 20_000 µs",
        )
    return Frame(
        clock.round_us(exact(table.frame.period_us)),
        exact(table.frame.gap_us),
        None if table.frame.slot_us is None else exact(table.frame.slot_us),
        table.frame.per_slot,
        table.frame.most_together,
        document.place("frame", "period_us"),
    )


def _check_frame(engine: str, servos: tuple[Servo, ...], frame: Frame, clock: Clock) -> None:
    """The pulses fit a frame in the slots of the job's engine; of `auto`, in those of one of them."""
    if engine == "player":
        layout(servos, frame, clock)
        return
    try:
        rises(servos, frame, clock)
    except InputError as refused:
        if engine == "sequence":
            raise
        try:
            layout(servos, frame, clock)
        except InputError:
            raise refused from None


def _motion(
    document: Document, table: JobTable, servos: tuple[Servo, ...], rig: Rig, frame: Frame, clock: Clock
) -> tuple[Planned, tuple[NamedPose, ...]]:
    """The one section that says what the servos do, and its poses if it has any."""
    given = [part for part in PARTS if getattr(table, part) is not None]
    if len(given) != 1:
        raise document.error(
            (given[1],) if given else (),
            "a job has one of " + ", ".join(f"[{part}]" for part in PARTS),
            None if given else "add [motion] poses = [ … ]",
        )
    part = given[0]
    if document.data[part].get("repeat", True) and "end" in document.data[part]:
        raise document.error(
            (part, "end"), "a motion that repeats has no end", "write repeat = false, or leave end away"
        )
    limits, period = _limits(servos, rig), frame.period.cycles
    if table.motion is not None:
        motion = _poses(document, table.motion, servos, rig, limits)
        rows = zip(table.motion.poses, motion.poses, strict=True)
        named = tuple(NamedPose(row.name, pose.angles) for row, pose in rows)
        return trajectory(motion, period, clock), named
    if table.walk is not None:
        return _walk(document, table.walk, servos, rig, limits, period, clock), ()
    if table.program is not None:
        return program_of(document, table.program, rig.robot, rig.bindings, servos, limits, period, clock), ()
    if table.drive is not None:
        return drive_of(document, table.drive, rig.robot, servos, period, clock), ()
    raise document.error((), "the job has no motion")


def _walk(
    document: Document,
    table: WalkTable,
    servos: tuple[Servo, ...],
    rig: Rig,
    limits: tuple[Limits, ...],
    period: Cycles,
    clock: Clock,
) -> Planned:
    by_name = dict(zip([servo.name for servo in servos], limits, strict=True))
    joints = tuple(
        Limits(limit.speed / abs(each.ratio), limit.acceleration / abs(each.ratio))
        for each in rig.bindings
        for limit in (by_name[each.servo],)
    )
    order = [each.servo for each in rig.bindings]
    for index, servo in enumerate(servos):
        if servo.name not in order:
            raise document.error(
                ("servo", index), f"{servo.name} turns no joint of the robot", "say which: joint = …"
            )
    return walk_of(document, table, rig.robot, rig.bindings, joints, servos, period, clock)


def _poses(
    document: Document, table: MotionTable, servos: tuple[Servo, ...], rig: Rig, limits: tuple[Limits, ...]
) -> Motion:
    return Motion(
        tuple(servo.name for servo in servos),
        poses_of(document, table, servos, rig.tip),
        table.repeat,
        table.end == "release",
        limits,
    )


def _limits(servos: tuple[Servo, ...], rig: Rig) -> tuple[Limits, ...]:
    """What each servo can do, and what the joint that it turns allows."""
    joints = {}
    if isinstance(rig.robot, Arm):
        joints = {joint.name: joint.speed for joint in rig.robot.joints}
    elif isinstance(rig.robot, Hexapod):
        joints = {
            f"{mount.name}_{joint.name}": joint.speed
            for mount in rig.robot.mounts
            for joint in rig.robot.leg.joints
        }
    bound = {each.servo: each for each in rig.bindings}
    found = []
    for servo in servos:
        speed = math.inf if servo.model.speed is None else servo.model.speed
        binding = bound.get(servo.name)
        top = joints.get(binding.joint) if binding else None
        if binding and top is not None:
            speed = min(speed, top * abs(binding.ratio))
        found.append(Limits(speed, servo.model.acceleration or math.inf))
    return tuple(found)


def _check_travel(document: Document, planned: Planned, servos: tuple[Servo, ...]) -> None:
    """A spline or a walk may lead a servo beyond its limits though no pose does."""
    part = next((part for part in PARTS if part in document.data), "motion")
    for servo, column in zip(servos, planned.trajectory.angles.T, strict=True):
        if not np.isnan(column).all():
            for angle in (float(np.nanmin(column)), float(np.nanmax(column))):
                servo.width_us(angle, document.place(part))
