"""What a motion asks of each servo, against what the servo can: range, speed, steps.

In: a servo's angles frame by frame. Out: `ServoFacts`.

    an angle that lasts one frame, or that the servo reaches within one, is part of a ramp: its speed is asked
    an angle that lasts longer is a step: the servo goes there at its own speed and needs a time
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.job import PlannedJob
from servogen.motion.trajectory import Floats
from servogen.robot.servo import Servo

Ints = npt.NDArray[np.int64]

SAME_RAD = 1e-9
"""Angles nearer than this are one: what floating point leaves."""


@dataclass(frozen=True, slots=True)
class ServoFacts:
    """Radians and seconds; of a continuous-rotation servo, whose angles are speeds, only the range.

    `speed` is the steepest ramp's and `speed_frame` the frame that it leads to; `step` the greatest step, for
    which the servo has `step_s` seconds. None: there is none.
    """

    servo: Servo
    least: float
    greatest: float
    speed: float | None
    speed_frame: int | None
    step: float | None
    step_s: float | None

    @property
    def step_needs_s(self) -> float | None:
        """The seconds that the servo takes for its greatest step."""
        if self.step is None or self.servo.model.speed is None:
            return None
        return self.step / self.servo.model.speed

    def to_json(self) -> dict[str, object]:
        servo = self.servo
        return {
            "name": servo.name,
            "pin": servo.pin,
            "model": servo.model.name,
            "continuous": servo.model.continuous,
            "least": self.least,
            "greatest": self.greatest,
            "lower_limit": servo.limits[0],
            "upper_limit": servo.limits[1],
            "peak_speed": self.speed,
            "peak_speed_frame": self.speed_frame,
            "speed_limit": servo.model.speed,
            "largest_step": self.step,
            "step_needs_s": self.step_needs_s,
            "step_has_s": self.step_s,
        }


def facts_of(job: PlannedJob) -> tuple[ServoFacts, ...]:
    """One a servo, in their order; a servo that never has a pulse has no range and is left out."""
    made = job.trajectory
    frame_s = float(made.clock.seconds(made.period))
    return tuple(
        _facts(servo, column, made.loop_start, frame_s)
        for servo, column in zip(job.servos, made.angles.T, strict=True)
        if not np.isnan(column).all()
    )


def _facts(servo: Servo, angles: Floats, loop_start: int, frame_s: float) -> ServoFacts:
    least, greatest = float(np.nanmin(angles)), float(np.nanmax(angles))
    if servo.model.continuous:
        return ServoFacts(servo, least, greatest, None, None, None, None)
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
    return ServoFacts(servo, least, greatest, speed, frame, step, step_s)


def _runs(angles: Floats, loop_start: int) -> tuple[Ints, Floats, Ints]:
    """Of each change of angle: the frame it leads to, its size, and how many frames the new angle lasts.

    The loop is gone around twice, so that what leads from its end to its beginning is seen; frames without
    a pulse are left out, as the servo stays where it was.
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
