"""A `Job` -> `PlannedJob`: the poses, walk, program or drive of its servos, frame by frame.

In: the validated values of a job file and, for a walk, optionally another route. Out: the servos' trajectory.
The job file is not read again. Every error names the line and the key that cannot be satisfied.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace

import numpy as np

from servogen.errors import Diagnostic, InputError
from servogen.job.drives import plan_drive
from servogen.job.followers import followed, unlike_mirrors
from servogen.job.job import Job, NamedPose, PlannedJob
from servogen.job.poses import read_poses
from servogen.job.schema import SECTIONS, DriveTable, MotionTable, ProgramTable, Section, WalkTable
from servogen.job.segments import commanded_segments
from servogen.job.walks import plan_walk, walk_on_command
from servogen.kinematics.statics import gravity_torques, has_masses
from servogen.motion import JointTrajectory, Motion, PlannedPoses, trajectory
from servogen.motion.gait.commands import CommandedDirection
from servogen.motion.gait.steps import Segment
from servogen.motion.limits import JointLimits
from servogen.motion.loads import check_torque
from servogen.motion.torque import TorqueLimits
from servogen.motion.trajectory import MAX_FRAMES, Floats
from servogen.robot.binding import joint_positions
from servogen.robot.model import Arm
from servogen.robot.servo import TRAVEL, Servo
from servogen.toml import file as toml_file
from servogen.units import Clock, Cycles


def plan_job(
    job: Job, segment: Mapping[str, float] | None = None, others: Sequence[Segment] = ()
) -> PlannedJob:
    """Return the job with the trajectory of its servos. Raises InputError, or another ServogenError for a
    motion that the robot cannot make.

    With `segment`, which has the keys of one segment of [walk] route, the robot walks that instead of the
    job's route; without `cycles` the walk never ends. `others` are the segments that the robot may walk next
    without taking another stance.
    """
    whole, job = job, replace(job, servos=job.leading)
    section = job.section if segment is None else _walking(job, segment)
    planned, poses, directions = _motion(whole, job, section, others)
    _check_travel(job, section, planned.trajectory.angles)
    for direction in directions:
        _check_travel(job, section, direction.angles)
    _check_soft_start(job, planned)
    values = {field.name: getattr(whole, field.name) for field in fields(Job)}
    mirrors = unlike_mirrors(whole.servos, whole.followers)
    return PlannedJob(
        **{**values, "section": section},
        trajectory=_whole_motion(whole, planned.trajectory),
        poses=tuple(
            replace(pose, angles=tuple(_all_angles(whole, np.array(pose.angles)).tolist())) for pose in poses
        ),
        warnings=(*planned.warnings, *_overloads(whole, job, planned), *_unlike_their_side(job), *mirrors),
        notes=(*(whole.robot.notes if isinstance(whole.robot, Arm) else ()), *planned.notes),
        directions=tuple(replace(each, angles=_all_angles(whole, each.angles)) for each in directions),
        parts=planned.parts,
    )


def _all_angles(job: Job, angles: Floats) -> Floats:
    """Return the angles (…, servos) of all servos; those given are without the servos that follow another."""
    return followed(angles, job.servos, job.followers) if job.followers else angles


def _whole_motion(job: Job, motion: JointTrajectory) -> JointTrajectory:
    """Return the motion of all servos, from that of those which follow none."""
    if not job.followers:
        return motion
    names = tuple(servo.name for servo in job.servos)
    return replace(motion, joints=names, angles=_all_angles(job, motion.angles))


SIDE = 3
"""The fewest servos of a side of which one may differ from the others."""


def _unlike_their_side(job: Job) -> Iterator[Diagnostic]:
    """Yield a warning for a leg's servo that turns its joint the other way than all others of its side do."""
    servos = {servo.name: servo for servo in job.servos}
    by_joint = {binding.joint: binding for binding in job.bindings}
    sides: dict[tuple[bool, str], list[tuple[Servo, bool]]] = {}
    for limb in job.limbs:
        mount = limb.mount
        if mount is None or not mount.y:
            continue
        for name in limb.joints:
            if name in by_joint:
                servo, ratio = servos[by_joint[name].servo], by_joint[name].ratio
                side = mount.y < 0, name.removeprefix(f"{mount.name}_")
                sides.setdefault(side, []).append((servo, servo.reverse != (ratio < 0)))
    for (right, joint), members in sides.items():
        for servo, reverses in members:
            others = [other for other, its in members if its != reverses]
            if len(members) >= SIDE and len(others) == len(members) - 1:
                named = " and ".join(other.name for other in others)
                yield Diagnostic(
                    "warning",
                    "reverse-differs",
                    f"{servo.name} has {'no ' if others[0].reverse else ''}reverse, unlike {named}, "
                    f"which turn {joint} on the {'right' if right else 'left'} side too",
                    servo.place,
                    "a servo that is mounted like the others of its side has the same reverse",
                )


def _walking(job: Job, segment: Mapping[str, float]) -> WalkTable:
    """Return the job's [walk] with a route of this segment alone.

    Raises InputError if something else moves the servos.
    """
    if job.section is not None and not isinstance(job.section, WalkTable):
        moving = _key(job.section)
        raise job.document.error(
            "nothing-to-drive", (moving,), f"the job does not walk: [{moving}] moves its servos"
        )
    written = job.document.data.get("walk", {})
    # `end` and `commands` contradict an endless route.
    walk = {key: value for key, value in written.items() if key not in ("end", "commands")}
    walk |= {"route": (dict(segment),), "repeat": "cycles" not in segment}
    return toml_file.validate(
        replace(job.document, data={**job.document.data, "walk": walk}), WalkTable, ("walk",)
    )


def _key(section: Section) -> str:
    """Return the key of a section in the job file."""
    return next(key for key, kind in SECTIONS.items() if isinstance(section, kind))


def _motion(
    whole: Job, job: Job, section: Section | None, others: Sequence[Segment]
) -> tuple[PlannedPoses, tuple[NamedPose, ...], tuple[CommandedDirection, ...]]:
    """Return the motion of the section, its poses if it has any, and the directions of a walk on command."""
    period = job.frame.period.cycles
    limits = _limits(whole, job)
    match section:
        case None:
            return PlannedPoses(_still(job.servos, period, job.clock)), (), ()
        case MotionTable():
            _check_poses(job, section)
            poses = read_poses(job.document, section, job.servos, job.tip)
            names = tuple(servo.name for servo in job.servos)
            motion = Motion(
                joints=names,
                poses=poses,
                repeat=section.repeat,
                release_at_end=section.end == "release",
                limits=limits,
                torque=_torque(whole, job),
            )
            rows = zip(section.poses, poses, strict=True)
            named = tuple(NamedPose(row.name, pose.angles) for row, pose in rows)
            planned = trajectory(motion, period, job.clock)
            if section.commands is None:
                return planned, named, ()
            rest, segments = commanded_segments(job.document, section.commands, planned)
            return rest, named, segments
        case WalkTable():
            if section.commands is not None:
                walk, directions = walk_on_command(job, section, section.commands, _joint_limits(job, limits))
                return walk, (), directions
            return plan_walk(job, section, _joint_limits(job, limits), others), (), ()
        case ProgramTable():
            from servogen.job.programs import plan_program  # a language of its own, which few jobs use

            return plan_program(job, section, limits), (), ()
        case DriveTable():
            return plan_drive(job, section), (), ()


def _check_poses(job: Job, section: MotionTable) -> None:
    """Raise InputError for a pose that places a servo which follows another."""
    leaders = {follower.name: follower.leader for follower in job.followers}
    for index, row in enumerate(section.poses):
        for key in row.model_extra or ():
            name = key.removesuffix("_s").removesuffix("_deg").removesuffix("_us")
            if name in leaders and name != key:
                raise job.document.error(
                    "conflicting-keys",
                    ("motion", "poses", index, key),
                    f"{name} follows {leaders[name]}: its angle is not its own",
                    f"place {leaders[name]}",
                )


def _still(servos: Sequence[Servo], period: Cycles, clock: Clock) -> JointTrajectory:
    """Return the motion of a stream job that has none: the neutral pose."""
    names = tuple(servo.name for servo in servos)
    angles = np.array([[servo.neutral for servo in servos]])
    return JointTrajectory(joints=names, clock=clock, period=period, angles=angles, loop_start=0)


def _joint_limits(job: Job, limits: tuple[JointLimits, ...]) -> tuple[JointLimits, ...]:
    """Return the limits of each bound joint. Raises InputError for a servo that turns no joint."""
    by_name = dict(zip([servo.name for servo in job.servos], limits, strict=True))
    joints = tuple(
        JointLimits(limit.speed / abs(binding.ratio), limit.acceleration / abs(binding.ratio))
        for binding in job.bindings
        for limit in (by_name[binding.servo],)
    )
    order = [binding.servo for binding in job.bindings]
    rows = [row["name"] for row in job.document.data["servo"]]
    for servo in job.servos:
        if servo.name not in order:
            raise job.document.error(
                "joint-binding",
                ("servo", rows.index(servo.name)),
                f"{servo.name} turns no joint of the robot",
                "state the joint: joint = …",
            )
    return joints


def _limits(whole: Job, job: Job) -> tuple[JointLimits, ...]:
    """Return the limits of each servo, narrowed to those of the joint that it turns and of its followers."""
    limbs = job.robot.limbs if job.robot else ()
    joints = {name: joint.speed for limb in limbs for name, joint in limb.joints.items()}
    bound = {binding.servo: binding for binding in job.bindings}
    limits = []
    for servo in job.servos:
        models = [each.model for each in whole.together(servo.name)]
        speed = min(math.inf if model.speed is None else model.speed for model in models)
        binding = bound.get(servo.name)
        top = joints.get(binding.joint) if binding else None
        if binding and top is not None:
            speed = min(speed, top * abs(binding.ratio))
        limits.append(JointLimits(speed, min(model.acceleration or math.inf for model in models)))
    return tuple(limits)


def _torque(whole: Job, job: Job) -> TorqueLimits | None:
    """Return the torques of an arm's servos; None if no mass or no torque is known."""
    tip = job.tip
    if tip is None or not has_masses(tip.limb.arm):
        return None
    stated = np.array(
        [sum(each.model.torque_nm or math.inf for each in whole.together(servo.name)) for servo in tip.servos]
    )
    if np.isinf(stated).all():
        return None
    columns = tuple(job.servos.index(servo) for servo in tip.servos)
    return TorqueLimits(tip.limb.arm, tip.bindings, columns, stated)


def _overloads(whole: Job, job: Job, planned: PlannedPoses) -> Iterator[Diagnostic]:
    """Yield a warning for each servo of an arm whose links and payload need more than its torque; servos on
    one joint share it equally.

    An arm without stated masses is not checked. A servo that turns `ratio` radians per unit of its joint
    must supply 1 / ratio of the joint's torque; a frame without pulses (NaN) needs none.
    """
    tip = job.tip
    if tip is None or not has_masses(tip.limb.arm):
        return
    columns = [job.servos.index(servo) for servo in tip.servos]
    angles = planned.trajectory.angles[:, columns]
    pulsed = np.flatnonzero(~np.isnan(angles).any(axis=1))
    if not len(pulsed):
        return
    # A motion repeats most of its poses: each different one is calculated once.
    distinct, back = np.unique(angles[pulsed], axis=0, return_inverse=True)
    torques = gravity_torques(tip.limb.arm, joint_positions(tip.bindings, distinct))[back.reshape(-1)]
    for index, (binding, servo) in enumerate(zip(tip.bindings, tip.servos, strict=True)):
        torque = np.full(len(angles), np.nan)
        # By the power balance: the servo turns `ratio` times as fast as its joint.
        group = whole.together(servo.name)
        torque[pulsed] = np.abs(torques[:, index] / binding.ratio) / len(group)
        for each in group:
            yield from check_torque(each.model, binding.joint, torque, servo=each.name, place=each.place)


def _check_travel(job: Job, section: Section | None, angles: Floats) -> None:
    """Raise InputError if a spline or a walk takes a servo beyond its limits although no pose does."""
    place = job.document.place(_key(section) if section else "motion")
    for servo, column in zip(job.servos, angles.T, strict=True):
        if not np.isnan(column).all():
            ends = float(np.nanmin(column)), float(np.nanmax(column))
            try:
                for angle in ends:
                    servo.check(angle, place)
            except InputError as error:
                if not isinstance(section, WalkTable):
                    raise
                # The legs' joints are within their own limits: it is the servo's travel that ends.
                first = error.first
                raise InputError(first.code, first.message, place, _travel_hint(servo, ends)) from error


def _travel_hint(servo: Servo, used: tuple[float, float]) -> str:
    """Return what mends a walk beyond a servo's travel: another tooth of its spline, or less motion."""
    spans = [
        servo.model.travel,
        servo.calibration.angles,
        *([servo.limits] if servo.limited_by == TRAVEL else []),
    ]
    needed, travel = math.degrees(used[1] - used[0]), math.degrees(min(high - low for low, high in spans))
    if needed <= travel:
        return (
            f"the {needed:.0f}° that it moves are within its travel if its horn is put on another tooth: "
            "servogen plan JOB --fit writes zero_deg"
        )
    return (
        f"it would move {needed:.0f}° of {travel:.0f}°: shorten the stride or the turn, lift the feet less, "
        f"or change the body's height; {TRAVEL}"
    )


def _check_soft_start(job: Job, planned: PlannedPoses) -> None:
    """Raise InputError if the motion is too long with its soft start, which moves from the neutral pose to
    the first one.
    """
    motion, asked_s = planned.trajectory, job.firmware.soft_start_s
    # Once for the neutral pose, once for the move to the first pose.
    frames = 2 * round(asked_s / motion.clock.seconds(motion.period)) + len(motion.angles)
    if frames > MAX_FRAMES:
        raise job.document.error(
            "too-many-frames",
            ("firmware", "soft_start_s"),
            f"the motion and a soft start of {float(asked_s):g} s are {frames} frames long",
            f"at most {MAX_FRAMES} frames, {float(MAX_FRAMES * motion.clock.seconds(motion.period)):g} s",
        )
