"""The first pulses after power-up: the neutral pose, and from there to the beginning of the motion.

In: a trajectory of the servos. Out: the same with a lead-in before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from servogen.motion.trajectory import Floats, JointTrajectory
from servogen.robot.servo import Servo
from servogen.units import Clock

SAME_RAD = 1e-3
"""A motion that begins this near to the neutral pose (0.06°) needs no movement from there."""


def with_soft_start(
    motion: JointTrajectory, servos: Sequence[Servo], clock: Clock, soft_start_s: Fraction
) -> tuple[JointTrajectory, tuple[int, ...]]:
    """Return the motion with its soft start, and the frames at which the parts of that end."""
    frames = round(soft_start_s / clock.seconds(motion.period))
    begun = soft_start(motion, servos, frames)
    soft = len(begun.angles) - len(motion.angles)
    return begun, tuple(range(frames, soft + 1, frames)) if soft else ()


def soft_start(trajectory: JointTrajectory, servos: Sequence[Servo], frames: int) -> JointTrajectory:
    """Return the trajectory with `frames` frames in the neutral pose before it and, if it begins elsewhere,
    as many frames of movement.
    """
    angles = trajectory.angles
    pulsed = angles[~np.isnan(angles).any(axis=1)]
    if not frames or not len(pulsed):
        return trajectory
    first, neutral = pulsed[0], np.array([servo.neutral for servo in servos])
    if np.abs(first - neutral).max() < SAME_RAD:
        before = np.tile(first, (frames, 1))
    else:
        shares: Floats = np.arange(frames)[:, None] / frames
        before = np.vstack((np.tile(neutral, (frames, 1)), neutral + (first - neutral) * shares))
    return JointTrajectory(
        trajectory.joints,
        trajectory.clock,
        trajectory.period,
        np.vstack((before, angles)),
        trajectory.loop_start + len(before),
    )
