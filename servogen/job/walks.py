"""[walk] of a job -> the servos' trajectory.

In: the job and its validated table. Out: `PlannedPoses`, with warnings and notes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from servogen.errors import Diagnostic, InputError, Location
from servogen.job.job import Job
from servogen.job.schema import CommandsTable, SegmentTable, WalkTable
from servogen.kinematics.protocol import Posture, WalkingRobot, mounts_of
from servogen.motion import JointTrajectory, Part, PlannedPoses, bound
from servogen.motion.gait.commands import STRAIGHT, TURN, CommandedDirection, commanded_direction
from servogen.motion.gait.phases import Gait, custom, gait
from servogen.motion.gait.steps import SAME_M, Segment
from servogen.motion.gait.walk import MIN_SWING, Walk, walk
from servogen.motion.limits import JointLimits
from servogen.motion.loads import check_torque, walk_loads
from servogen.robot.binding import Binding
from servogen.robot.servo import Servo
from servogen.toml.file import Document, exact
from servogen.units import Clock, Cycles


def plan_walk(
    job: Job,
    table: WalkTable,
    limits: tuple[JointLimits, ...],
    others: Sequence[Segment] = (),
) -> PlannedPoses:
    """Return the walk; `limits` has one entry per binding. Raises InputError.

    `others` are segments of other walks that share the stance of this one.
    """
    document = job.document
    if not table.route:
        raise document.error(
            "missing-key", ("walk",), "a walk needs a route", "add route = [{ forward_mm = 40 }], or commands"
        )
    endless = table.route[-1].cycles is None
    if endless and not table.repeat:
        raise document.error(
            "endless-motion",
            ("walk", "repeat"),
            "a route whose last segment has no cycles never ends",
            "add cycles = … to its last segment",
        )
    walker = _walker(job, table, limits)
    segments = [_segment(row.forward_mm, row.left_mm, row.turn_deg, row.cycles) for row in table.route]
    planned = walker.walk(segments, others, walker.frames)
    trajectory = _with_end(_to_servos(document, planned.trajectory, job.bindings), table)
    heavy = tuple(_overloads(walker.robot, planned, job.bindings, job.servos))
    return PlannedPoses(
        trajectory,
        warnings=(*heavy, *_walk_warnings(document, planned)),
        notes=tuple(_notes(job, planned)),
        parts=tuple(
            Part(f"segment {number} ({_segment_text(row)})", begin)
            for number, (row, begin) in enumerate(zip(table.route, planned.begins, strict=True), 1)
        ),
    )


def _segment_text(row: SegmentTable) -> str:
    """Return the keys of a segment of a route that are not 0."""
    moves = (("forward_mm", row.forward_mm), ("left_mm", row.left_mm), ("turn_deg", row.turn_deg))
    return ", ".join(f"{key} = {value:g}" for key, value in moves if value) or "standing"


MAX_COMMANDED_CYCLES = 12
"""The number of cycles after which a walk is certainly steady."""


def walk_on_command(
    job: Job, table: WalkTable, commands: CommandsTable, limits: tuple[JointLimits, ...]
) -> tuple[PlannedPoses, tuple[CommandedDirection, ...]]:
    """Return the stance of a walk on command, and its directions. Raises InputError."""
    document, key = job.document, ("walk", "commands")
    for name in ("route", "end"):
        if name in document.data["walk"]:
            raise document.error(
                "conflicting-keys",
                ("walk", name),
                f"a walk on command has no {name}",
                "remove it, or commands",
            )
    pairs = []
    if commands.forward_mm is not None:
        pairs.append((STRAIGHT, _segment(commands.forward_mm, 0, 0, None)))
    if commands.turn_deg is not None:
        pairs.append((TURN, _segment(0, 0, commands.turn_deg, None)))
    if not pairs:
        raise document.error(
            "missing-key", key, "the walk has no direction", "add forward_mm = 40, turn_deg = 20, or both"
        )
    walker = _walker(job, table, limits)
    segments = [segment for _, segment in pairs]
    directions: list[CommandedDirection] = []
    heavy: list[Diagnostic] = []
    notes: list[Diagnostic] = []
    for names, segment in pairs:
        others = [other for other in segments if other is not segment]
        endless = walker.even_walk(segment, others)
        count = endless.frames_per_cycle
        walks_of_cycles = (
            _to_servos(
                document,
                walker.walk([replace(segment, cycles=float(cycles))], others, count).trajectory,
                job.bindings,
            )
            # A generator, because the shortest walk that contains a start, a cycle and a stop is enough.
            for cycles in range(1, MAX_COMMANDED_CYCLES)
        )
        planned = _to_servos(document, endless.trajectory, job.bindings)
        try:
            direction = commanded_direction(
                names[0], planned.angles, planned.loop_start, (walked.angles for walked in walks_of_cycles)
            )
        except InputError as error:
            raise error.at(document.place(*key)) from error
        directions += [direction, direction.reversed(names[1])]
        heavy += _overloads(walker.robot, endless, job.bindings, job.servos)
        heavy += _walk_warnings(document, endless)
        last = len(direction.angles) - 1
        text = f"{names[0]} and {names[1]}: " + ", ".join(
            f"{phase} of {count} frames"
            for phase, count in (
                ("a start", direction.first),
                ("a cycle", direction.end - direction.first),
                ("a stop", last - direction.end),
            )
        )
        notes += [
            Diagnostic("note", "command", text, document.place(*key)),
            *_notes(job, endless),
        ]
    first = directions[0]
    stance = JointTrajectory(
        joints=tuple(servo.name for servo in job.servos),
        clock=job.clock,
        period=job.frame.period.cycles,
        angles=first.angles[:1],
        loop_start=0,
    )
    unique = tuple(dict.fromkeys(heavy))
    return PlannedPoses(stance, warnings=unique, notes=tuple(dict.fromkeys(notes))), tuple(directions)


@dataclass(frozen=True, slots=True)
class _Walker:
    """A job's robot with its gait and posture; `frames` per cycle, None: as few as the limits allow."""

    job: Job
    table: WalkTable
    robot: WalkingRobot
    gait: Gait
    limits: tuple[JointLimits, ...]
    """Those of each joint of the robot's legs."""
    frames: int | None
    lost: float
    """The angle (radians) that the servos lose when a joint turns round, if it is compensated."""

    def walk(self, segments: Sequence[Segment], others: Sequence[Segment], frames: int | None) -> Walk:
        """Return the walk along `segments`, in cycles of at least `frames`. Raises InputError."""
        spring_mm = self.table.spring_mm
        try:
            return walk(
                self.robot,
                self.gait,
                segments,
                read_posture(self.table),
                self.job.frame.period.cycles,
                self.job.clock,
                frames_per_cycle=frames,
                limits=self.limits,
                spring_m=None if spring_mm is None else spring_mm / 1000,
                allow_falling=self.table.allow_falling,
                others=others,
                lost=self.lost,
                gap=self.table.gap_mm / 1000,
            )
        except InputError as error:
            raise error.at(self.job.document.place("walk")) from error

    def even_walk(self, segment: Segment, others: Sequence[Segment]) -> Walk:
        """Return the endless walk whose swings have even numbers of frames.

        The middle of every swing is then at a frame, even if the walk is played backward.
        """
        walk = self.walk([segment], others, self.frames)
        # A multiple of the grain has whole swings, an even multiple even ones.
        grain = 2 * self.gait.grain
        even = -(-walk.frames_per_cycle // grain) * grain
        if even == walk.frames_per_cycle:
            return walk
        return replace(self.walk([segment], others, even), needed_frames=walk.needed_frames)


def _walker(job: Job, table: WalkTable, limits: tuple[JointLimits, ...]) -> _Walker:
    """Return the walking robot with its gait and posture. Raises InputError."""
    document, robot = job.document, job.robot
    if table.law is not None and table.cycle_s is not None:
        raise document.error(
            "conflicting-keys",
            ("walk", "cycle_s"),
            'law = "fastest" finds the time of a cycle itself',
            "remove cycle_s, or law",
        )
    if not isinstance(robot, WalkingRobot):
        raise document.error(
            "missing-robot", ("walk",), "a walk needs a walking robot", 'add [robot] name = "hexapod"'
        )
    whole = robot
    if table.leg is not None:
        names = [mount.name for mount in mounts_of(robot)]
        document.check_known(
            "unknown-name", ("walk", "leg"), table.leg, names, f"{robot.name} has no leg '{table.leg}'"
        )
        robot = robot.with_leg(table.leg)
    gait = _gait(document, table, whole, robot)
    frames = _frames(table, job.frame.period.cycles, job.clock)
    by_joint = {binding.joint: limit for binding, limit in zip(job.bindings, limits, strict=True)}
    return _Walker(
        job=job,
        table=table,
        robot=robot,
        gait=gait,
        limits=tuple(by_joint.get(name, limits[0]) for leg in robot.limbs for name in leg.joints),
        frames=frames,
        lost=_lost_motion(job) if table.compensate else 0.0,
    )


def _lost_motion(job: Job) -> float:
    """Return the largest angle (radians) that a servo loses when its joint reverses."""
    servos = {servo.name: servo for servo in job.servos}
    return max(
        (
            # In radians of the joint.
            servo.model.lost_motion(servo.calibration) / abs(binding.ratio)
            for binding in job.bindings
            for servo in (servos[binding.servo],)
        ),
        default=0.0,
    )


def _gait(document: Document, table: WalkTable, whole: WalkingRobot, robot: WalkingRobot) -> Gait:
    """Return the gait of the job's legs; a named gait is that of the whole robot. Raises InputError."""
    key = "lifts" if table.lifts is not None else "gait" if table.duty is None else "duty"
    try:
        if table.lifts is not None:
            if table.duty is None:
                raise InputError("missing-key", "a custom gait also needs a duty factor", hint="add duty = …")
            return custom("own", table.duty, table.lifts, robot)
        if table.duty is not None:
            raise InputError(
                "missing-key",
                "a custom gait also needs the phase of each leg",
                hint="add lifts = { L1 = 0.0, … }",
            )
        named = gait(table.gait, whole)
    except InputError as error:
        raise error.at(document.place("walk", key)) from error
    # One leg on the bench keeps its phase in the whole robot's gait.
    mine = {mount.name for mount in mounts_of(robot)}
    return Gait(named.name, named.duty, tuple(lift for lift in named.lifts if lift[0] in mine))


def _frames(table: WalkTable, period: Cycles, clock: Clock) -> int | None:
    return None if table.cycle_s is None else math.ceil(exact(table.cycle_s) / clock.seconds(period))


def _segment(forward_mm: float, left_mm: float, turn_deg: float, cycles: float | None) -> Segment:
    return Segment(forward_mm / 1000, left_mm / 1000, math.radians(turn_deg), cycles)


def read_posture(table: WalkTable) -> Posture:
    """Return how [walk] has the robot stand."""
    height, width, margin = (
        None if length is None else length / 1000
        for length in (table.body_height_mm, table.stance_width_mm, table.margin_mm)
    )
    forward, left = table.body_shift_mm or (0.0, 0.0)
    roll, pitch = table.body_tilt_deg or (0.0, 0.0)
    return Posture(
        height,
        width,
        table.lift_mm / 1000,
        1 if table.beta_sign == "positive" else -1,
        margin=margin,
        shift=complex(forward, left) / 1000,
        yaw=math.radians(table.body_yaw_deg or 0.0),
        roll=math.radians(roll),
        pitch=math.radians(pitch),
    )


def _to_servos(
    document: Document, trajectory: JointTrajectory, bindings: tuple[Binding, ...]
) -> JointTrajectory:
    missing = [joint for joint in trajectory.joints if joint not in [binding.joint for binding in bindings]]
    if missing:
        raise document.error(
            "joint-binding",
            ("walk",),
            f"no servo turns the joint '{missing[0]}'",
            f'add joint = "{missing[0]}" to a servo',
        )
    try:
        return bound(trajectory, bindings)
    except InputError as error:
        raise error.at(document.place("walk")) from error


def _with_end(trajectory: JointTrajectory, table: WalkTable) -> JointTrajectory:
    """Return a walk that does not repeat with its end: the robot stands, or its servos are released."""
    if table.repeat:
        return trajectory
    last = trajectory.angles[-1:] * (np.nan if table.end == "release" else 1.0)
    angles = np.concatenate((trajectory.angles, last))
    return JointTrajectory(
        joints=trajectory.joints,
        clock=trajectory.clock,
        period=trajectory.period,
        angles=angles,
        loop_start=len(trajectory.angles),
    )


def _notes(job: Job, planned: Walk) -> list[Diagnostic]:
    document = job.document
    place = document.place("walk")
    seconds = float(planned.trajectory.clock.seconds(planned.trajectory.period)) * planned.frames_per_cycle
    notes = [
        Diagnostic(
            "note",
            "cycle",
            f"a cycle takes {planned.frames_per_cycle} frames, {seconds:.6g} s{planned.stretched_text()}"
            f"{_limit_text(document, planned, job.bindings)}",
            place,
        ),
        *(Diagnostic("note", "phase", change.text(), place) for change in planned.changes),
        *_turns(document, planned),
        *_yielding(planned, place),
        Diagnostic("note", "slip", planned.slip.text(), place),
        *_lost_motion_notes(document, planned, job.servos),
        Diagnostic("note", "lift", f"the feet rise {1000 * planned.lift_m:z.1f} mm", place),
    ]
    if math.isfinite(planned.minimum_margin_m):
        text = f"the centre of mass is always {1000 * planned.minimum_margin_m:z.1f} mm inside the feet"
        if planned.minimum_margin_m < 0:
            text = f"the robot falls: {-1000 * planned.minimum_margin_m:z.1f} mm outside its feet at worst"
        notes.append(Diagnostic("note", "stability", text, place))
    return notes


def _yielding(planned: Walk, place: Location) -> Iterator[Diagnostic]:
    """Yield how far a stance is from the circles on which feet of two joints move; none with three."""
    if planned.largest_correction_m > SAME_M:
        text = (
            f"the legs' springs, or their feet, yield by up to {1000 * planned.largest_correction_m:z.2f} mm"
        )
        yield Diagnostic("note", "spring", text, place)


def _limit_text(document: Document, planned: Walk, bindings: Sequence[Binding]) -> str:
    """Return in words what holds the shortest cycle back; empty if the job states a time."""
    if planned.tightest is None or "cycle_s" in document.data["walk"]:
        return ""
    joint, limit = planned.tightest
    servo = next(binding.servo for binding in bindings if binding.joint == joint)
    if planned.frames_per_cycle == planned.least_frames:
        swing = f"the shortest, as a foot takes {MIN_SWING} frames through the air"
        return f", {swing}; the servos could go faster: {servo}, the busiest, is at {limit.text}"
    return f", the shortest, because of {servo}: it is at {limit.text}"


def _lost_motion_notes(document: Document, planned: Walk, servos: Sequence[Servo]) -> Iterator[Diagnostic]:
    """Yield a note on how the swings take up the servos' lost motion, and on what is assumed about it."""
    text = planned.lost_motion_text()
    if text is None:
        return
    keys = ("dead_band_us", "backlash_deg")
    assumed = sorted({key for key in keys for servo in servos if key in servo.model.motor.assumed})
    text += f" (assumed: {', '.join(assumed)})" if assumed else ""
    yield Diagnostic("note", "lost-motion", text, document.place("walk"))


def _turns(document: Document, planned: Walk) -> Iterator[Diagnostic]:
    """Yield notes with the centre of rotation of each turn, and with the feet whose joint limits keep them
    off the line from that centre.
    """
    texts = [*planned.centre_texts(), *((foot.segment, foot.text()) for foot in planned.held_back)]
    for index, text in sorted(texts):
        place = document.place("walk", "route", index)
        yield Diagnostic("note", "turn", f"segment {index + 1}: {text}", place)


def _overloads(
    robot: WalkingRobot, walk: Walk, bindings: Sequence[Binding], servos: Sequence[Servo]
) -> Iterator[Diagnostic]:
    """Yield a warning for each servo of a walking robot whose weight needs more than its torque."""
    loads = walk_loads(robot, walk)
    if loads is None:
        return
    by_joint = {binding.joint: binding for binding in bindings}
    by_name = {servo.name: servo for servo in servos}
    for index, leg in enumerate(loads.legs):
        binding = by_joint[f"{leg}_{robot.lifting_joint}"]
        torque = loads.torques[:, index] / abs(binding.ratio)
        servo = by_name[binding.servo]
        yield from check_torque(
            servo.model,
            binding.joint,
            torque,
            servo=servo.name,
            place=servo.place,
            detail=partial(loads.detail, index),
        )


def _walk_warnings(document: Document, planned: Walk) -> Iterator[Diagnostic]:
    """Yield a warning if the robot stands at the full height of its legs."""
    text = planned.full_height()
    if text is not None:
        yield Diagnostic("warning", "full-height", text, document.place("walk", "body_height_mm"))
