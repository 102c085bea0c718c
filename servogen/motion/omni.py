"""Drives of the three-wheel base without turning -> the speeds of its wheels, frame by frame.

In: an `OmniBase`, corners of a contour in metres, a speed. Out: `Stretch`es, each a translation with its
motor turns, encoder counts and time, and a `JointTrajectory` whose columns are wheel speeds in radians a
second, what a continuous-rotation servo takes for an angle.

         120°   60°        Six directions need two wheels only, at equal and opposite speeds (table 10.1).
            ╲   ╱          A stretch in one of them is a routine of lab 10; any other is driven with three
    180° ────●──── 0°      wheels (inverse kinematics), or in two routines, those beside it:
            ╱   ╲
         240°   300°       L at φ beyond 60° k  =  L sin(60° - φ)/sin 60° along 60° k
                                                 + L sin φ/sin 60° along 60° (k + 1)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Literal

import numpy as np

from servogen.errors import InputError, did_you_mean
from servogen.kinematics.omni import Travel, body_speed, directions, travel, wheel_speeds
from servogen.motion.trajectory import MAX_FRAMES, Floats, JointTrajectory
from servogen.robot.model import OmniBase
from servogen.units import Clock, Cycles

Directions = Literal["any", "six"]
SIXTH = math.pi / 3
_SAME_DIRECTION = 1e-9
"""Radians within which a stretch has one of the six directions: what floating point leaves."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """A translation by `way` (x, y in metres).

    `direction_deg`, the wheels' `signs` and the driven wheels' `travel` are those of a routine, in one of the
    six directions; None where three wheels drive.
    """

    way: tuple[float, float]
    direction_deg: int | None
    signs: tuple[int, int, int] | None
    travel: Travel | None

    @property
    def length(self) -> float:
        return math.hypot(*self.way)


def stretch(base: OmniBase, way: Sequence[float]) -> Stretch:
    """The straight stretch by `way`."""
    x, y = (float(value) for value in way)
    sixths = math.atan2(y, x) / SIXTH
    if abs(sixths - round(sixths)) * SIXTH > _SAME_DIRECTION:
        return Stretch((x, y), None, None, None)
    direction = 60 * (round(sixths) % 6)
    return Stretch((x, y), direction, directions()[direction], travel(base, math.hypot(x, y)))


def routine(base: OmniBase, direction_deg: int, distance: float) -> Stretch:
    """The routine of lab 10 for one of the six directions. Raises InputError for another direction."""
    if direction_deg not in directions():
        known = [str(each) for each in directions()]
        raise InputError(
            "unknown-direction",
            f"{direction_deg}° is none of the six directions",
            hint=did_you_mean(str(direction_deg), known),
        )
    if distance < 0:
        raise InputError(
            "out-of-range", f"a distance is not negative: {distance:g} m", hint="take the opposite direction"
        )
    angle = math.radians(direction_deg)
    way = distance * math.cos(angle), distance * math.sin(angle)
    return Stretch(way, direction_deg, directions()[direction_deg], travel(base, distance))


def decomposed(base: OmniBase, way: Sequence[float]) -> tuple[Stretch, ...]:
    """`way` as at most two routines, along the six directions on either side of it."""
    one = stretch(base, way)
    if one.length == 0.0:
        return ()
    if one.direction_deg is not None:
        return (one,)
    angle = math.atan2(one.way[1], one.way[0])
    sixth = math.floor(angle / SIXTH)
    beyond = angle - sixth * SIXTH
    first = one.length * math.sin(SIXTH - beyond) / math.sin(SIXTH)
    second = one.length * math.sin(beyond) / math.sin(SIXTH)
    return routine(base, 60 * (sixth % 6), first), routine(base, 60 * ((sixth + 1) % 6), second)


def contour(
    base: OmniBase, corners: Sequence[Sequence[float]], using: Directions = "any"
) -> tuple[Stretch, ...]:
    """The stretches from corner to corner and back to the first (metres); corners at one place count once."""
    closed = [*corners, corners[0]]
    ways = [(end[0] - start[0], end[1] - start[1]) for start, end in pairwise(closed)]
    moving = [way for way in ways if math.hypot(*way) > 0]
    if not moving:
        raise InputError("no-motion", "the contour has no length", hint="give at least two different corners")
    if using == "any":
        return tuple(stretch(base, way) for way in moving)
    return tuple(part for way in moving for part in decomposed(base, way))


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """The stretches, the frames of each without the pause after it, and the wheel speeds of all frames."""

    stretches: tuple[Stretch, ...]
    frames: tuple[int, ...]
    trajectory: JointTrajectory


def drive(
    base: OmniBase,
    stretches: Sequence[Stretch],
    speed: float,
    period: Cycles,
    clock: Clock,
    *,
    wheels: tuple[str, str, str] = ("wheel1", "wheel2", "wheel3"),
    pause_s: Fraction = Fraction(0),
    ramp_s: Fraction = Fraction(0),
    repeat: bool = True,
) -> Drive:
    """Drives the stretches one after the other at `speed` (m/s) at most, each in whole frames.

    A stretch speeds up and slows down for `ramp_s` each; then the wheels stop for `pause_s`. The speed is
    lowered by as much as makes its frames whole, so that the way is exact. Without `repeat` they stop at the
    end.
    """
    period_s = clock.seconds(period)
    pause, ramp = (round(seconds / period_s) for seconds in (pause_s, ramp_s))
    if not speed * float(period_s) > 0:
        raise InputError("out-of-range", f"a speed is more than 0, not {speed:g} m/s")
    asked = [each.length / (speed * float(period_s)) for each in stretches]
    if sum(asked) + len(asked) * (2 * ramp + pause + 1) > MAX_FRAMES:
        raise InputError(
            "too-many-frames", f"the drive is more than {MAX_FRAMES} frames long", hint="raise its speed"
        )
    blocks, counts = [], []
    for each, frames in zip(stretches, asked, strict=True):
        shape = _shape(frames, ramp)
        turns = np.outer(shape / (shape.sum() * float(period_s)), _wheel_angles(base, each))
        blocks += [turns, np.zeros((pause, 3))]
        counts.append(len(shape))
    if not repeat:
        blocks.append(np.zeros((1, 3)))
    speeds = np.concatenate(blocks) + 0.0  # no negative zeros
    loop_start = 0 if repeat else len(speeds) - 1
    return Drive(tuple(stretches), tuple(counts), JointTrajectory(wheels, clock, period, speeds, loop_start))


def _wheel_angles(base: OmniBase, each: Stretch) -> Floats:
    """How far each wheel turns over the stretch, radians; in a routine the idle wheel not at all."""
    if each.signs is None or each.travel is None:
        return wheel_speeds(base, (*each.way, 0.0))
    return np.array(each.signs) * each.travel.wheel_m / base.wheel_radius


def _shape(frames: float, ramp: int) -> Floats:
    """The speed of each frame as a share of the greatest; the shares add up to at least `frames`."""
    count = max(1, math.ceil(frames - 1e-9))
    while True:
        middle = np.arange(count) + 0.5
        shape = np.ones(count)
        if ramp:
            shape = np.minimum(1.0, np.minimum(middle, count - middle) / ramp)
        missing = frames - float(shape.sum())
        if missing <= 1e-9:
            return shape
        count += max(1, math.ceil(missing))


def positions(base: OmniBase, speeds: Floats, period_s: float) -> Floats:
    """Where the base is, (frames + 1, 3): x, y in metres and its turn in radians, from (0, 0, 0) on.

    `speeds` (frames, 3) are held for `period_s` each; each frame is a piece of a circle, exactly.
    """
    vx, vy, turn = np.moveaxis(body_speed(base, speeds), -1, 0) * period_s
    heading = np.concatenate(([0.0], np.cumsum(turn)))
    chord, middle = np.sinc(turn / (2 * np.pi)), heading[:-1] + turn / 2
    steps = np.stack(
        [
            chord * (vx * np.cos(middle) - vy * np.sin(middle)),
            chord * (vx * np.sin(middle) + vy * np.cos(middle)),
        ],
        axis=1,
    )
    at = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return np.column_stack([at, heading])
