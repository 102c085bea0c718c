"""Bent calibrations: each servo that turns a leg has two straight lines, which meet at a knee.

In: servos and the widths that they use, in cycles. Out: `Knees`; the widths as if the first line went on,
between which the player's laws are as straight as between the angles.

    width │        ╱   beyond the knee the chip adds bend/256 of what lies beyond it
          │      ╱ ╱
     knee │    ●
          │  ╱
          └──────────── angle
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from servogen.engines.player.arithmetic import Whole
from servogen.motion.trajectory import Floats
from servogen.robot.servo import Servo
from servogen.units import Clock

MAX_BEND = 31
"""The greatest bend, in 256ths: five bits."""
STEPS = (2, 4, 8)
"""The cycles of a byte's step for which the chip knows knees."""


@dataclass(frozen=True, slots=True, eq=False)
class Knees:
    """For each channel the width at its knee, in cycles, and by how many 256ths it is steeper beyond it; a
    bend of 0: the channel is straight.
    """

    widths: Floats
    bends: Whole

    def straightened(self, rows: Floats) -> Floats:
        """Return widths (frames, channels) as they would be without the bends."""
        beyond = np.maximum(rows - self.widths, 0.0)
        return np.asarray(rows - beyond + beyond / (1 + self.bends / 256))


def knees_of(servos: Sequence[Servo], turns: Sequence[int], rows: Floats, clock: Clock) -> Knees:
    """Return the knees of the channels `turns` whose widths are `rows`, in cycles."""
    widths, bends = np.zeros(rows.shape[1]), np.zeros(rows.shape[1], dtype=np.int64)
    cycle_us = float(clock.cycle_us)
    for channel in turns:
        used = cycle_us * rows[:, channel]
        width_us, bend = _knee(servos[channel], float(np.nanmin(used)), float(np.nanmax(used)))
        widths[channel] = width_us / cycle_us
        bends[channel] = min(max(round(256 * bend), -MAX_BEND), MAX_BEND)
    return Knees(widths, bends)


def _knee(servo: Servo, low: float, high: float) -> tuple[float, float]:
    """Return where (µs) two lines from `low` to `high` meet that are closest to all points of a servo's
    calibration, and by which share the second is steeper.
    """
    points = sorted(point.width_us + servo.trim_us for point in servo.calibration.points)
    inside = [width for width in points if low < width < high]
    best, closest = (low, 0.0), math.inf
    for knee in inside:
        corners = [low, knee, high]
        turned = [abs(servo.angle(width) - servo.angle(low)) for width in corners]
        away = max(
            abs(float(np.interp(abs(servo.angle(width) - servo.angle(low)), turned, corners)) - width)
            for width in inside
        )
        if away < closest:
            before, beyond = (knee - low) / turned[1], (high - knee) / (turned[2] - turned[1])
            best, closest = (knee, beyond / before - 1), away
    return best
