"""[program] of a job -> the servos' trajectory: an arm, its hand, and a file of the arm command language.

In: the job, its validated table, the limits of each servo. Out: `PlannedPoses`. The arm's joints are limited
to the travel of their servos, so that a position that a servo cannot reach is refused at its program line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from servogen.errors import Diagnostic, InputError
from servogen.job.job import Job
from servogen.job.schema import ProgramTable
from servogen.job.tip import ArmTip
from servogen.motion import JointTrajectory, Part, PlannedPoses, bound
from servogen.motion.limits import JointLimits
from servogen.movemaster import Budget, Hand, Manipulator, ProgramRun, input_of, manipulator, read, run
from servogen.robot.binding import Binding
from servogen.robot.model import Arm
from servogen.robot.servo import Servo
from servogen.toml.file import Document, exact

HAND = "the hand"
"""The hand's column of a run; not a valid name of a joint."""

SLACK = 1e-9
"""The distance (radians, metres) by which rounding may take a home beyond a limit."""


def plan_program(
    job: Job,
    table: ProgramTable,
    limits: Sequence[JointLimits],
) -> PlannedPoses:
    """Return the motion of the program; `limits` has one entry per servo.

    Raises InputError, with locations in the job or in the program.
    """
    document, robot, bindings, servos = job.document, job.robot, job.bindings, job.servos
    if not isinstance(robot, Arm):
        raise document.error(
            "missing-robot", ("program",), "a program moves an arm", 'add [robot] name = "rv-m1"'
        )
    hand = _hand(document, table, servos, bindings)
    arm = _on_servos(job, robot)
    source = read(Path(document.file).parent / table.file)
    program_run = run(
        source,
        _manipulator(document, arm, bindings, servos, limits),
        job.frame.period.cycles,
        job.clock,
        hand=hand,
        inputs=tuple(
            input_of(text, document.place("program", "inputs", index))
            for index, text in enumerate(table.inputs)
        ),
        repeat=table.repeat,
        budget=Budget(table.max_commands, exact(table.max_s)),
    )
    return PlannedPoses(
        _of_servos(document, program_run, table, bindings, servos),
        program_run.warnings,
        _notes(document, program_run),
        tuple(Part(f"line {step.statement.number}", step.frame) for step in program_run.steps if step.frames),
    )


def _hand(
    document: Document, table: ProgramTable, servos: Sequence[Servo], bindings: Sequence[Binding]
) -> Hand | None:
    """Return the hand of [program], None if it has none. Raises InputError."""
    if table.hand is None:
        return None
    by_name = {servo.name: servo for servo in servos}
    name, key = table.hand.servo, ("program", "hand", "servo")
    document.check_known("unknown-servo", key, name, by_name, f"there is no servo '{name}'")
    if name in [binding.servo for binding in bindings]:
        raise document.error("joint-binding", key, f"'{name}' already turns a joint of the arm")
    if by_name[name].model.continuous:
        raise document.error("wrong-servo-kind", key, f"'{name}' turns continuously: a hand needs angles")
    opened, closed = math.radians(table.hand.open_deg), math.radians(table.hand.closed_deg)
    for end, angle in (("open_deg", opened), ("closed_deg", closed)):
        by_name[name].check(angle, document.place("program", "hand", end))
    return Hand(HAND, opened, closed, by_name[name].model.speed)


def _on_servos(job: Job, arm: Arm) -> Arm:
    """Return the arm with its joints' limits narrowed to those of their servos. Raises InputError for a joint
    without a servo, and for a home that a servo does not reach.
    """
    document, by_joint = job.document, {binding.joint: binding for binding in job.bindings}
    for joint in arm.joints:
        if joint.name not in by_joint:
            raise document.error(
                "joint-binding",
                ("program",),
                f"no servo turns the joint '{joint.name}'",
                f'add joint = "{joint.name}" to a servo',
            )
    assert isinstance(job.tip, ArmTip)
    joints = []
    for joint in job.tip.on_servos.joints:
        if not joint.lower - SLACK <= joint.home <= joint.upper + SLACK:
            servo = by_joint[joint.name].servo
            raise document.error(
                "servo-limit",
                ("servo", [job_servo.name for job_servo in job.servos].index(servo), "zero_deg"),
                f"{servo} cannot bring {joint.name} to its home of {joint.shown(joint.home)}: "
                f"it reaches {joint.shown(joint.lower)} to {joint.shown(joint.upper)}",
                "a program begins at home: change zero_deg or ratio",
            )
        ends = min(joint.lower, joint.home), max(joint.upper, joint.home)
        joints.append(replace(joint, lower=ends[0], upper=ends[1]))
    return replace(arm, joints=tuple(joints))


def _manipulator(
    document: Document,
    arm: Arm,
    bindings: Sequence[Binding],
    servos: Sequence[Servo],
    limits: Sequence[JointLimits],
) -> Manipulator:
    """Return the arm with the maximum speeds that both its joints and their servos allow."""
    by_servo = {servo.name: limit.speed for servo, limit in zip(servos, limits, strict=True)}
    by_joint = {binding.joint: by_servo[binding.servo] / abs(binding.ratio) for binding in bindings}
    speeds = tuple(None if math.isinf(by_joint[joint.name]) else by_joint[joint.name] for joint in arm.joints)
    try:
        return manipulator(arm, speeds)
    except InputError as error:
        raise error.at(document.place("program")) from error


def _of_servos(
    document: Document,
    program_run: ProgramRun,
    table: ProgramTable,
    bindings: Sequence[Binding],
    servos: Sequence[Servo],
) -> JointTrajectory:
    """Return the trajectory of the servos, in their order, from that of the joints, released at the end if
    the job says so.
    """
    by_servo = {binding.servo: binding for binding in bindings}
    if table.hand is not None:
        by_servo[table.hand.servo] = Binding(HAND, table.hand.servo)
    for index, servo in enumerate(servos):
        if servo.name not in by_servo:
            raise document.error(
                "joint-binding",
                ("servo", index),
                f"{servo.name} turns no joint of the arm",
                'state the joint: joint = …, or make it the hand: [program] hand = { servo = "…", … }',
            )
    motion = bound(program_run.trajectory, [by_servo[servo.name] for servo in servos])
    if table.end == "release":
        motion.angles[-1] = np.nan
    return motion


def _notes(document: Document, program_run: ProgramRun) -> tuple[Diagnostic, ...]:
    place = document.place("program")
    trajectory = program_run.trajectory
    seconds = float(trajectory.clock.seconds(len(trajectory.angles) * trajectory.period))
    notes = [
        Diagnostic(
            "note", "program", f"the program takes {len(trajectory.angles)} frames, {seconds:g} s", place
        )
    ]
    if program_run.outputs:
        text = (
            f"the program writes its output port {len(program_run.outputs)} times: firmware only makes pulses"
        )
        notes.append(Diagnostic("note", "output-port", text, place))
    return tuple(notes)
