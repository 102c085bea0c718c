"""The facts of a planned job: its frames, the demands on each servo, the paths of its ends and their errors.

In: a planned job and its pulses. Out: `PlanFacts` and its `ServoFacts`, in metres, radians and seconds.

    an angle that lasts one frame, or that the servo reaches within one, is part of a ramp, which has a speed
    an angle that lasts longer is a step: the servo goes there at its own speed and needs a time
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from servogen.job import PlannedJob
from servogen.kinematics.protocol import WalkingRobot
from servogen.motion.gait.quasistatic import rigid_body_path
from servogen.motion.loads import MIN_LEGS
from servogen.motion.trajectory import Floats
from servogen.pulse import PulsePlan
from servogen.report.tracks import EndError, Track, end_errors, end_tracks, largest_error, standing_feet
from servogen.robot.servo import Servo

if TYPE_CHECKING:
    from servogen.answers import EndAnswer, PlanFactsAnswer, ServoFactsAnswer, WayAnswer

Ints = npt.NDArray[np.int64]

SAME_RAD = 1e-9
"""Angles within this are equal: the difference is due to floating point."""


@dataclass(frozen=True, slots=True)
class ServoFacts:
    """Radians and seconds; of a continuous-rotation servo, whose angles are speeds, only the range.

    `speed` is the steepest ramp's and `speed_frame` the frame that it leads to; `step` the greatest step, for
    which the servo has `step_s` seconds. None: there is none.
    """

    servo: Servo
    minimum: float
    maximum: float
    speed: float | None
    speed_frame: int | None
    step: float | None
    step_s: float | None

    @property
    def step_needs_s(self) -> float | None:
        """Return the seconds that the servo needs for its largest step."""
        if self.step is None or self.servo.model.speed is None:
            return None
        return self.step / self.servo.model.speed

    def to_json(self) -> ServoFactsAnswer:
        servo = self.servo
        return {
            "name": servo.name,
            "pin": servo.pin,
            "model": servo.model.name,
            "continuous": servo.model.continuous,
            "minimum_deg": math.degrees(self.minimum),
            "maximum_deg": math.degrees(self.maximum),
            "lower_limit_deg": math.degrees(servo.limits[0]),
            "upper_limit_deg": math.degrees(servo.limits[1]),
            "peak_speed_deg_s": in_degrees(self.speed),
            "peak_speed_frame": self.speed_frame,
            "speed_limit_deg_s": in_degrees(servo.model.speed),
            "largest_step_deg": in_degrees(self.step),
            "step_needs_s": self.step_needs_s,
            "step_has_s": self.step_s,
        }


def in_degrees(angle: float | None) -> float | None:
    """Return an angle, or an angle a second, in degrees; None if it is not known."""
    return None if angle is None else math.degrees(angle)


def servo_facts(job: PlannedJob) -> tuple[ServoFacts, ...]:
    """Return facts in the order of the servos, without those that never have a pulse."""
    trajectory = job.trajectory
    frame_s = float(trajectory.clock.seconds(trajectory.period))
    return tuple(
        _of_servo(servo, column, trajectory.loop_start, frame_s)
        for servo, column in zip(job.servos, trajectory.angles.T, strict=True)
        if not np.isnan(column).all()
    )


def _of_servo(servo: Servo, angles: Floats, loop_start: int, frame_s: float) -> ServoFacts:
    minimum, maximum = float(np.nanmin(angles)), float(np.nanmax(angles))
    if servo.model.continuous:
        return ServoFacts(
            servo=servo,
            minimum=minimum,
            maximum=maximum,
            speed=None,
            speed_frame=None,
            step=None,
            step_s=None,
        )
    frames, changes, lengths = _runs(angles, loop_start)
    reach = (servo.model.speed or 0.0) * frame_s
    ramp = (lengths == 1) | (np.abs(changes) <= reach)
    speed = frame = step = step_s = None
    if ramp.any():
        at = int(np.argmax(np.where(ramp, np.abs(changes), -1.0)))
        speed, frame = float(abs(changes[at])) / frame_s, int(frames[at])
    if not ramp.all():
        at = int(np.argmax(np.where(ramp, -1.0, np.abs(changes))))
        step, step_s = float(abs(changes[at])), float(lengths[at]) * frame_s
    return ServoFacts(
        servo=servo,
        minimum=minimum,
        maximum=maximum,
        speed=speed,
        speed_frame=frame,
        step=step,
        step_s=step_s,
    )


def _runs(angles: Floats, loop_start: int) -> tuple[Ints, Floats, Ints]:
    """Return for each change of angle the frame, its size, and how many frames the new angle lasts.

    The loop is gone around twice, so that what leads from its end to its beginning is seen; frames without
    a pulse are omitted, as the servo stays where it was.
    """
    number = np.concatenate((np.arange(len(angles)), np.arange(loop_start, len(angles))))
    pulsed = ~np.isnan(angles[number])
    number, around = number[pulsed], angles[number][pulsed]
    starts = np.flatnonzero(np.abs(np.diff(around)) > SAME_RAD) + 1
    lengths = np.diff(np.append(starts, len(around)))
    loop = angles[loop_start:]
    if not np.isnan(loop).all() and np.nanmax(loop) - np.nanmin(loop) > SAME_RAD:
        # The last run is cut off; the loop has shown it whole before.
        starts, lengths = starts[:-1], lengths[:-1]
    return number[starts], around[starts] - around[starts - 1], lengths


@dataclass(frozen=True, slots=True)
class PlanFacts:
    """The facts of one plan; `ends` are the errors of the pulses at the feet, the tool or the base."""

    job: PlannedJob
    plan: PulsePlan
    servos: tuple[ServoFacts, ...]
    tracks: tuple[Track, ...]
    ends: tuple[EndError, ...]
    rigid_legs_end: tuple[float, float, float] | None = None
    """Where rigid legs take a walking body in each loop, or in the whole of a motion that ends: x, y, yaw;
    None: it does not walk.
    """
    engine: bool = False
    """Whether `plan` is the job's engine's, which may be farther from the motion than whole cycles."""

    def seconds(self, frames: int) -> float:
        """Return how long a number of frames lasts."""
        schedule = self.plan.schedule
        return float(schedule.clock.seconds(frames * schedule.period))

    @property
    def worst(self) -> EndError | None:
        """Return the end whose error is greatest; None if the job has no ends."""
        return largest_error(self.ends) if self.ends else None

    def extent(self, end: EndError) -> tuple[list[float], list[float]]:
        """Return the least and the greatest planned x, y, z of an end."""
        track = next(track for track in self.tracks if track.name == end.name)
        return np.nanmin(track.planned, axis=0).tolist(), np.nanmax(track.planned, axis=0).tolist()

    def to_json(self) -> PlanFactsAnswer:
        schedule = self.plan.schedule
        return {
            "job": self.job.name,
            "device": self.job.device.name,
            "clock_hz": self.job.clock.hz,
            "period_s": self.seconds(1),
            "lead_in_frames": schedule.lead_in_frames,
            "loop_frames": schedule.loop_frames,
            "lead_in_s": self.seconds(schedule.lead_in_frames),
            "loop_s": self.seconds(schedule.loop_frames),
            "servos": [servo.to_json() for servo in self.servos],
            "error_of": "engine" if self.engine else "rounding",
            "ends": [self._end(end) for end in self.ends],
            "rigid_legs_end": self._rigid_legs_end(),
        }

    def _rigid_legs_end(self) -> WayAnswer | None:
        if self.rigid_legs_end is None:
            return None
        forward, left, turn = self.rigid_legs_end
        return {"forward_m": forward, "left_m": left, "turn_deg": math.degrees(turn)}

    def _end(self, end: EndError) -> EndAnswer:
        minimum, maximum = self.extent(end)
        return {
            "name": end.name,
            "kind": end.kind,
            "minimum_m": minimum,
            "maximum_m": maximum,
            "error": {**end.to_json(), "time_s": self.seconds(end.frame)},
        }


def plan_facts(job: PlannedJob, plan: PulsePlan, engine: bool = False) -> PlanFacts:
    """Return the facts of a job whose pulses are `plan`, rounded by whole cycles or by its `engine`."""
    tracks = end_tracks(job, plan.schedule)
    return PlanFacts(
        job=job,
        plan=plan,
        servos=servo_facts(job),
        tracks=tracks,
        ends=end_errors(tracks),
        rigid_legs_end=rigid_legs_end(job),
        engine=engine,
    )


def rigid_legs_end(job: PlannedJob) -> tuple[float, float, float] | None:
    """Return where rigid legs take the body of a walk (`motion.gait.quasistatic`) in each loop, or in the
    whole of a motion that ends; None for other jobs.
    """
    ends = job.ends
    angles, loop = job.trajectory.angles, job.trajectory.angles[job.trajectory.loop_start :]
    if len(loop) > 1:
        angles = np.concatenate((loop, loop[:1]))
    if not isinstance(job.robot, WalkingRobot) or len(ends) < MIN_LEGS or np.isnan(angles).any():
        return None
    x, y, yaw = rigid_body_path(*standing_feet(job, angles)).pose[-1].tolist()
    return x, y, yaw
