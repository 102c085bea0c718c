"""The request for a drive, and what it means for a job's robot.

In: a planned job and a `DriveRequest`. Out: a `Course`: the motion, the function that takes commands, the
pose that ends the drive.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from servogen.drive.motions import AngleFunction, Limited, Played, Still, find_pose
from servogen.drive.steering import Jog, Rates, job_steering
from servogen.errors import InputError, Location
from servogen.job import PlannedJob
from servogen.motion.trajectory import Floats

HOLD, NEUTRAL, OFF = "hold", "neutral", "off"
"""The ways in which a drive can end, besides a pose."""


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """A pose, steering, or the job's motion if neither is requested."""

    pose: str | None = None
    """A pose as `find_pose` reads it."""
    steer: bool = False
    single_keys: bool = False
    """Whether the commands are keys; keys without a meaning for this robot are ignored."""
    rates: Rates = field(default_factory=Rates)
    """The distances by which a command moves a walking robot or a base."""
    seconds: float | None = None
    """The duration; None: until it is interrupted, except for a pose that the robot keeps by itself."""
    stop: str | None = None
    """`HOLD`, `NEUTRAL`, `OFF` or a pose; None: wheels stop and other servos hold."""
    rehearsal: bool = False
    """Whether this is a dry run, which sends nothing and plays a motion once."""


@dataclass(frozen=True, slots=True)
class Course:
    """A drive that is ready to start."""

    motion: AngleFunction
    on_command: Callable[[str], None]
    """Takes the commands."""
    stop: Floats | None
    """The pose that ends the drive; None: the servos hold the last one."""
    seconds: float
    """The duration of the motion; infinite if only an interrupt ends it."""
    state: Callable[[], str] | None = None
    """Returns the state that a command has changed, in one line; None if there is no such line."""


def plan_course(job: PlannedJob, request: DriveRequest) -> Course:
    """Return the course that `request` defines for the job's robot. Raises InputError."""
    if request.pose is not None and request.steer:
        raise InputError("conflicting-options", "--pose is one pose, --keys is many: use one of the two")
    stop = _stop_pose(job, request.stop)
    if request.steer:
        steering = job_steering(job, request.rates)
        seconds = math.inf if request.seconds is None else request.seconds

        def known_keys(command: str) -> None:
            if command in steering.commands:
                steering.command(command)

        on_command = known_keys if request.single_keys else steering.command
        state = steering.state if isinstance(steering, Jog) else None
        return Course(
            motion=Limited(steering, seconds), on_command=on_command, stop=stop, seconds=seconds, state=state
        )
    motion: AngleFunction
    if request.pose is not None:
        motion, seconds = Still(find_pose(job, request.pose)), _pose_seconds(job, request)
    else:
        motion, seconds = Played(job.trajectory), _motion_seconds(job, request)
    return Course(Limited(motion, seconds), lambda command: None, stop, seconds)


def _motion_seconds(job: PlannedJob, request: DriveRequest) -> float:
    if request.seconds is not None:
        return request.seconds
    planned = job.trajectory
    once = float(planned.clock.seconds(planned.period) * len(planned.angles))
    return once if request.rehearsal else math.inf


def _pose_seconds(job: PlannedJob, request: DriveRequest) -> float:
    """Return how long a pose is sent: 0 if the robot keeps it, else infinity, for wheels that turn and for a
    pose that the chip's fail-safe would end.
    """
    if request.seconds is not None:
        return request.seconds
    turns = any(servo.model.continuous for servo in job.servos)
    ends = job.stream is not None and job.stream.fail_safe != HOLD
    return math.inf if (turns or ends) and not request.rehearsal else 0.0


def _stop_pose(job: PlannedJob, text: str | None) -> Floats | None:
    """Return the pose that ends the drive; None if the servos hold the last one sent."""
    neutral = np.array([servo.neutral for servo in job.servos])
    wheels = [servo.model.continuous for servo in job.servos]
    if text is None and any(wheels):
        return np.where(wheels, neutral, np.nan)
    if text == OFF and (job.stream is None or job.stream.fail_safe != OFF):
        raise InputError(
            "engine-unsupported",
            "Mini SSC cannot switch pulses off: only the stream engine's fail-safe does",
            Location(job.file),
            'write fail_safe = "off" in [stream]',
        )
    if text is None or text in (HOLD, OFF):
        return None
    return neutral if text == NEUTRAL else find_pose(job, text)
