"""Contours of a base on wheels -> the speeds of its wheels, frame by frame.

In: a `DrivingRobot`, its `Stretch`es, a speed. Out: `PlannedDrive`; the columns of its `JointTrajectory` are
wheel speeds in radians per second, which a continuous-rotation servo takes in place of an angle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from servogen.errors import InputError
from servogen.kinematics.protocol import DrivingRobot, Stretch
from servogen.motion.trajectory import MAX_FRAMES, Floats, JointTrajectory
from servogen.units import Clock, Cycles


@dataclass(frozen=True, slots=True, eq=False)
class PlannedDrive:
    """The stretches, the frames of each without the pause after it, and the wheel speeds of all frames."""

    stretches: tuple[Stretch, ...]
    frames: tuple[int, ...]
    trajectory: JointTrajectory


def drive(
    stretches: Sequence[Stretch],
    speed: float,
    period: Cycles,
    clock: Clock,
    *,
    wheels: tuple[str, ...],
    pause_s: Fraction = Fraction(0),
    ramp_s: Fraction = Fraction(0),
    repeat: bool = True,
) -> PlannedDrive:
    """Return the drive along the stretches in turn, at up to `speed` (m/s), each in whole frames.

    A stretch speeds up and slows down for `ramp_s` each; then the wheels stop for `pause_s`. Its speed is
    reduced so that it takes whole frames and its length is exact. Without `repeat` the wheels stop at the
    end.
    Raises InputError for a speed that is not positive and for a drive that is too long.
    """
    period_s = clock.seconds(period)
    pause, ramp = (round(seconds / period_s) for seconds in (pause_s, ramp_s))
    if not speed * float(period_s) > 0:
        raise InputError("out-of-range", f"the speed must be more than 0, not {speed:g} m/s")
    asked = [stretch.length / (speed * float(period_s)) for stretch in stretches]
    if sum(asked) + len(asked) * (2 * ramp + pause + 1) > MAX_FRAMES:
        raise InputError(
            "too-many-frames", f"the drive is more than {MAX_FRAMES} frames long", hint="raise its speed"
        )
    blocks, counts = [], []
    for stretch, frames in zip(stretches, asked, strict=True):
        shape = _shape(frames, ramp)
        turns = np.outer(shape / (shape.sum() * float(period_s)), stretch.wheel_angles)
        blocks += [turns, np.zeros((pause, len(wheels)))]
        counts.append(len(shape))
    if not repeat:
        blocks.append(np.zeros((1, len(wheels))))
    speeds = np.concatenate(blocks) + 0.0  # no negative zeros
    loop_start = 0 if repeat else len(speeds) - 1
    return PlannedDrive(
        tuple(stretches),
        tuple(counts),
        JointTrajectory(joints=wheels, clock=clock, period=period, angles=speeds, loop_start=loop_start),
    )


def _shape(frames: float, ramp: int) -> Floats:
    """Return the speed in each frame as a share of the maximum; the shares add up to at least `frames`."""
    # Rounding must not add a frame to a whole number of them, here and below.
    count = max(1, math.ceil(frames - 1e-9))
    while True:
        middle = np.arange(count) + 0.5
        shape = np.ones(count)
        if ramp:
            shape = np.minimum(1.0, np.minimum(middle, count - middle) / ramp)
        # Ramps cover less than full speed does: frames are added until the distance is covered.
        missing = frames - float(shape.sum())
        if missing <= 1e-9:
            return shape
        count += max(1, math.ceil(missing - 1e-9))


def positions(base: DrivingRobot, speeds: Floats, period_s: float) -> Floats:
    """Return the pose of the base (frames + 1, 3): x, y in metres and its heading, starting at (0, 0, 0).

    `speeds` (frames, wheels) are held for `period_s` each, so that each frame is exactly an arc of a circle.
    """
    vx, vy, turn = np.moveaxis(base.body_speed(speeds), -1, 0) * period_s
    heading = np.concatenate(([0.0], np.cumsum(turn)))
    # An arc of angle t has the chord sin(t/2) / (t/2) of its length, in the direction of its middle; numpy's
    # sinc(x) is sin(πx) / πx.
    chord, middle = np.sinc(turn / (2 * np.pi)), heading[:-1] + turn / 2
    steps = np.stack(
        [
            chord * (vx * np.cos(middle) - vy * np.sin(middle)),
            chord * (vx * np.sin(middle) + vy * np.cos(middle)),
        ],
        axis=1,
    )
    corners = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return np.column_stack([corners, heading])
