"""Robots steered by commands: a walking robot walks and turns, a base rolls, any other goes to its poses.

In: a planned job, commands. Out: `Steering`, an endless motion. The protocols of a robot's kind determine
which of the three it is (`kinematics.protocol`). A chip with the stream engine also jogs: `Jog` moves one
servo at a time in steps, and states in one line the servo, its goal, the pulse for the goal, and the step.

    WalkController: the gait of each direction as start, cycle and stop, so that no foot ever slips

    standing ─▶ start ─▶ cycle ─▶ cycle … ─▶ stop ─▶ standing     a new command waits for the end of the
       ▲ all directions start and stop standing alike ◀─┘         cycle, and for the feet to stand
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from servogen.drive.commands import (
    BACK,
    COARSER,
    FINER,
    FORWARD,
    LEFT,
    LESS,
    MORE,
    NEXT,
    PREVIOUS,
    RIGHT,
    SIDEWAYS_LEFT,
    SIDEWAYS_RIGHT,
    STOP,
)
from servogen.drive.motions import find_pose, frame_at
from servogen.errors import InputError, Location, did_you_mean
from servogen.job import PlannedJob, plan_job
from servogen.kinematics.protocol import DrivingRobot, WalkingRobot
from servogen.motion.gait.steps import Segment
from servogen.motion.trajectory import Floats

DIRECTIONS: Mapping[str, tuple[int, int, int]] = {
    FORWARD: (1, 0, 0),
    BACK: (-1, 0, 0),
    LEFT: (0, 0, 1),
    RIGHT: (0, 0, -1),
    SIDEWAYS_LEFT: (0, 1, 0),
    SIDEWAYS_RIGHT: (0, -1, 0),
}
"""The motion of the body for each command: along x, along y, about z."""


@dataclass(frozen=True, slots=True)
class Rates:
    """The distances of a walking robot per cycle, or a base per second; None: the job's, or the default."""

    distance_mm: float | None = None
    turn_deg: float | None = None


class Steering(Protocol):
    """An endless `AngleFunction` that takes commands."""

    @property
    def commands(self) -> tuple[str, ...]:
        """Return the accepted commands."""

    def command(self, command: str) -> None:
        """Carry out a command. Raises InputError for an unknown one."""

    def at(self, seconds: float) -> Floats | None:
        """Return the angle of every servo (servos,) in radians."""


def job_steering(job: PlannedJob, rates: Rates) -> Steering:
    """Return the steering of a job's robot.

    Raises InputError for a robot that can go in none of the directions, and for one that cannot be steered.
    """
    if isinstance(job.robot, WalkingRobot) and not job.poses:
        return _walk_controller(job, job.robot, rates)
    if job.base is not None:
        return _base_controller(job, job.base, rates)
    if job.stream is not None:
        return Jog(job, PoseController(job))
    if job.poses:
        return PoseController(job)
    raise InputError(
        "nothing-to-drive",
        "nothing can be steered: commands need a walking robot, a base on wheels, or poses of [motion]",
        Location(job.file),
    )


def _unknown(command: str, known: Iterable[str]) -> InputError:
    return InputError("bad-command", f"unknown command '{command}'", hint=did_you_mean(command, known))


DEFAULT_SPEED_RAD_S = 1.0
"""The speed assumed for a servo whose model does not state one."""


@dataclass(slots=True, eq=False)
class PoseController:
    """Goes to poses of the job as fast as the slowest servo allows; all servos arrive together."""

    job: PlannedJob
    _start: Floats = field(init=False)
    _goal: Floats = field(init=False)
    _now: Floats = field(init=False)
    _since: float = 0.0
    _moment: float = 0.0

    def __post_init__(self) -> None:
        self._start = self._goal = self._now = np.array([servo.neutral for servo in self.job.servos])

    @property
    def commands(self) -> tuple[str, ...]:
        """Return the numbers and names of the poses, and `stop`; `servo=degrees,…` is accepted too."""
        names = [pose.name for pose in self.job.poses if pose.name]
        return (*(str(index + 1) for index in range(len(self.job.poses))), *names, STOP)

    @property
    def goal(self) -> Floats:
        """Return the target angles of the servos."""
        return self._goal

    def command(self, command: str) -> None:
        """Go to a pose from the present angles, or stop at these."""
        if command not in self.commands and "=" not in command:
            raise _unknown(command, self.commands)
        goal = self._now if command == STOP else find_pose(self.job, command)
        # From where the servos are now, also in the middle of a move.
        self._start, self._since = self._now, self._moment
        self._goal = np.where(np.isnan(goal), self._goal, goal)

    def at(self, seconds: float) -> Floats | None:
        """Return the angles on the straight line, in joint space, to the pose."""
        self._moment = seconds
        takes = max(
            abs(angle) / (servo.model.speed or DEFAULT_SPEED_RAD_S)
            for angle, servo in zip((self._goal - self._start).tolist(), self.job.servos, strict=True)
        )
        share = 1.0 if takes == 0 else min(1.0, (seconds - self._since) / takes)
        self._now = self._start + share * (self._goal - self._start)
        return self._now


STEPS_DEG = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
FIRST_STEP = STEPS_DEG.index(1.0)
"""The steps that can be chosen, and the one at the beginning."""


@dataclass(slots=True)
class Jog:
    """Takes the commands of `poser`, names of servos, and steps of the selected servo."""

    job: PlannedJob
    poser: PoseController
    selected: int = 0
    step: int = FIRST_STEP
    _at_limit: bool = False

    @property
    def commands(self) -> tuple[str, ...]:
        """Return the poses, the servos' names, and the commands that select and move a servo."""
        names = (servo.name for servo in self.job.servos)
        return (*self.poser.commands, *names, NEXT, PREVIOUS, MORE, LESS, FINER, COARSER)

    def command(self, command: str) -> None:
        """Carry out a command. Raises InputError for an unknown one."""
        names = [servo.name for servo in self.job.servos]
        self._at_limit = False
        if command in self.poser.commands or "=" in command:
            self.poser.command(command)
        elif command in (NEXT, PREVIOUS):
            self.selected = (self.selected + (1 if command == NEXT else -1)) % len(names)
        elif command in (FINER, COARSER):
            self.step = min(max(self.step + (1 if command == COARSER else -1), 0), len(STEPS_DEG) - 1)
        elif command in (MORE, LESS):
            self._move(STEPS_DEG[self.step] * (1 if command == MORE else -1))
        elif command in names:
            self.selected = names.index(command)
        else:
            raise _unknown(command, self.commands)

    def at(self, seconds: float) -> Floats | None:
        """Return the angle of every servo (servos,) in radians."""
        return self.poser.at(seconds)

    def state(self) -> str:
        """Return the selected servo, its goal with its pulse, and the step."""
        servo = self.job.servos[self.selected]
        unit = "°/s" if servo.model.continuous else "°"
        angle = float(self.poser.goal[self.selected])
        limit = ", at its limit" if self._at_limit else ""
        return (
            f"{servo.name}: {math.degrees(angle):z.1f}{unit}, {servo.width_us(angle):.0f} µs{limit}; "
            f"step {STEPS_DEG[self.step]:g}{unit}"
        )

    def _move(self, degrees: float) -> None:
        """Move the selected servo by `degrees`, but not beyond its limits."""
        servo = self.job.servos[self.selected]
        goal = math.degrees(float(self.poser.goal[self.selected])) + degrees
        try:
            self.poser.command(f"{servo.name}={goal:.6f}")
        except InputError as error:
            if error.code != "servo-limit":
                raise
            self._at_limit = True


RAMP_S = 0.2
"""The time in which the base changes from one speed to another."""

DEFAULT_TURN_DEG_S = 45.0
"""The speed at which a base turns on the spot if --turn-deg is not given."""


def _base_controller(job: PlannedJob, base: DrivingRobot, rates: Rates) -> BaseController:
    """Return the controller with the directions that the base and its servos allow, at least one of them."""
    columns = job.wheel_columns
    moving = base.body_speed(np.nan_to_num(job.trajectory.angles[:, columns]))
    speed = float(np.hypot(moving[:, 0], moving[:, 1]).max())
    if rates.distance_mm is not None:
        speed = rates.distance_mm / 1000
    turn = math.radians(DEFAULT_TURN_DEG_S if rates.turn_deg is None else rates.turn_deg)
    speeds, refused = {}, None
    for command, (x, y, z) in DIRECTIONS.items():
        wheels = np.zeros(len(job.servos))
        try:
            wheels[columns] = base.wheel_speeds((x * speed, y * speed, z * turn))
            for servo, wheel in zip(job.servos, wheels.tolist(), strict=True):
                servo.width_us(wheel)
            speeds[command] = wheels
        except InputError as error:
            refused = refused or error
    if refused and not speeds:
        raise refused
    return BaseController({**speeds, STOP: np.zeros(len(job.servos))})


@dataclass(slots=True, eq=False)
class BaseController:
    """Turns the wheels at the speeds of the command, which are reached after `RAMP_S`."""

    speeds: Mapping[str, Floats]
    commanded: str = STOP
    _before: Floats = field(init=False)
    _now: Floats = field(init=False)
    _since: float | None = None
    _moment: float = 0.0

    def __post_init__(self) -> None:
        self._before = self._now = self.speeds[STOP]

    @property
    def commands(self) -> tuple[str, ...]:
        """Return the directions that the base can go in, and `stop`."""
        return tuple(self.speeds)

    def command(self, command: str) -> None:
        """Change from the present speeds to those of the command."""
        if command not in self.speeds:
            raise _unknown(command, self.commands)
        self.commanded, self._before, self._since = command, self._now, self._moment

    def at(self, seconds: float) -> Floats | None:
        """Return the speeds of the wheels."""
        self._moment = seconds
        share = 1.0 if self._since is None else min(1.0, (seconds - self._since) / RAMP_S)
        self._now = self._before + share * (self.speeds[self.commanded] - self._before)
        return self._now


DEFAULT_STRIDE_MM, DEFAULT_TURN_DEG = 40.0, 8.0
"""The step and the turn of a walking robot per cycle if --step-mm and --turn-deg are not given."""

MAX_CYCLES = 12
"""The number of cycles after which a walk is certainly steady."""

SAME_RAD = 1e-6
"""The tolerance (radians) between equal frames of two walks, far below the resolution of a pulse."""


@dataclass(frozen=True, slots=True, eq=False)
class GaitFrames:
    """Frames (n, servos): from standing to walking, one cycle, and back to standing."""

    start: Floats
    cycle: Floats
    stop: Floats


def _walk_controller(job: PlannedJob, robot: WalkingRobot, rates: Rates) -> WalkController:
    """Return the controller with the directions that the legs allow, at least one of them."""
    stride = DEFAULT_STRIDE_MM if rates.distance_mm is None else rates.distance_mm
    angle = DEFAULT_TURN_DEG if rates.turn_deg is None else rates.turn_deg
    rows = {
        command: {"forward_mm": x * stride, "left_mm": y * stride, "turn_deg": turn * angle}
        for command, (x, y, turn) in DIRECTIONS.items()
        if robot.sidesteps or not y
    }
    segments = [_segment(row) for row in rows.values()]
    gaits, refused = {}, None
    for command, row in rows.items():
        try:
            gaits[command] = gait_frames(job, row, segments)
        except InputError as error:
            refused = refused or error
    if refused and not gaits:
        raise refused
    return WalkController(job, gaits)


def _segment(row: Mapping[str, float]) -> Segment:
    """Return the body's motion in a cycle."""
    return Segment(row["forward_mm"] / 1000, row["left_mm"] / 1000, math.radians(row["turn_deg"]))


def gait_frames(job: PlannedJob, row: Mapping[str, float], others: Sequence[Segment]) -> GaitFrames:
    """Return one direction as start, cycle and stop, with the stance of all directions at both ends.

    Raises InputError if the legs cannot walk in it.
    """
    endless = plan_job(job, row, others).trajectory
    angles, loop = endless.angles, endless.loop_start
    cycle = len(angles) - loop
    # A walk of few cycles may stop before it is steady. The first one that begins as the endless walk does
    # has its stop after the cycle.
    for cycles in range(-(-loop // cycle) + 1, MAX_CYCLES):
        whole = plan_job(job, {**row, "cycles": float(cycles)}, others).trajectory.angles
        if len(whole) > len(angles) and np.allclose(whole[: len(angles)], angles, atol=SAME_RAD):
            return GaitFrames(angles[:loop], angles[loop:], whole[len(angles) :])
    raise InputError(
        "endless-motion", "the walk cannot be stopped: its gait leaves a leg behind", Location(job.file)
    )


@dataclass(slots=True, eq=False)
class WalkController:
    """Walks cycle by cycle; `walking` is the direction of the current cycle, None while the robot stands."""

    job: PlannedJob
    gaits: Mapping[str, GaitFrames]
    commanded: str = STOP
    walking: str | None = None
    _block: Floats = field(init=False)
    _row: int = 0
    _frame: int = 0

    def __post_init__(self) -> None:
        self._block = next(iter(self.gaits.values())).start[:1]

    @property
    def commands(self) -> tuple[str, ...]:
        """Return the directions that the legs can walk in, and `stop`."""
        return (*self.gaits, STOP)

    def command(self, command: str) -> None:
        """Change to the command's direction at the end of the cycle."""
        if command not in self.commands:
            raise _unknown(command, self.commands)
        self.commanded = command

    def at(self, seconds: float) -> Floats | None:
        """Return the angles of the frame at that moment."""
        frame = frame_at(self.job.trajectory, seconds)
        for _ in range(frame - self._frame):
            self._step()
        self._frame = frame
        return np.asarray(self._block[self._row])

    def _step(self) -> None:
        self._row += 1
        if self._row < len(self._block):
            return
        last, self._row = self._block[-1], 0
        if self.walking is not None and self.commanded == self.walking:
            self._block = self.gaits[self.walking].cycle
        elif self.walking is not None:
            self._block, self.walking = self.gaits[self.walking].stop, None
        elif self.commanded == STOP:
            self._block = last[None]
        else:
            self._block, self.walking = self.gaits[self.commanded].start, self.commanded
