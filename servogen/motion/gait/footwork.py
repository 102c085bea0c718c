"""The legs of a walking robot: footholds -> joint angles at each frame of one segment.

In: the robot, its gait and posture, one `Segment`. Out: `Frames`: angles, feet, which are on the ground, and
the corrections that their springs must give.

    side view of a foot          it is lifted by a bump that is flat at both ends, while
         ___                     the joints go from where the foot left the ground to where it lands,
     ___╱   ╲___  ground         beginning and ending with the speed of the stance
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError
from servogen.kinematics.protocol import Posture, Stance, WalkingRobot
from servogen.motion.gait.phases import Gait
from servogen.motion.gait.steps import SAME_TIME, Progress, Segment, Steps, start_ramp, steps
from servogen.motion.trajectory import Floats

MAX_CYCLES = 8
"""By then a walk without an end is steady, or it never will be."""


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """`angles` (frames, legs, k), `feet` and `corrections` (frames, legs, 3), `ground` (frames, legs)."""

    angles: Floats
    feet: Floats
    ground: npt.NDArray[np.bool_]
    corrections: Floats

    def part(self, first: int, end: int) -> Frames:
        """Return the frames from `first` up to `end`."""
        rows = slice(first, end)
        return Frames(self.angles[rows], self.feet[rows], self.ground[rows], self.corrections[rows])


def joined(parts: Sequence[Frames]) -> Frames:
    """Return the frames of all parts, one part after the other."""
    return Frames(
        np.concatenate([part.angles for part in parts]),
        np.concatenate([part.feet for part in parts]),
        np.concatenate([part.ground for part in parts]),
        np.concatenate([part.corrections for part in parts]),
    )


@dataclass(frozen=True, slots=True)
class Footwork:
    """The legs' work in a gait: `stance` is fixed for the whole walk."""

    legs: tuple[str, ...]
    stance: Stance
    gait: Gait

    def frames(self, segment: Segment, count: int) -> Frames:
        """Return one segment at `count` frames per cycle, from standstill.

        It ends in standstill, or after `MAX_CYCLES` if the segment has no end. Raises InputError for a
        segment of no cycles.
        """
        cycles = segment.cycles
        if cycles is not None and cycles <= 0:
            raise InputError("out-of-range", f"a segment has {cycles:g} cycles: it needs more than 0")
        progress = Progress(start_ramp(self.gait), cycles)
        until = MAX_CYCLES if cycles is None else progress.stop + 1
        stroke = abs(complex(segment.forward, segment.left)) * float(self.gait.duty)
        legs = [
            steps(self.gait, name, segment, progress, self.stance.neutral(index, stroke), until)
            for index, name in enumerate(self.legs)
        ]
        landed = max(float(leg.lands.max(initial=0.0)) for leg in legs)
        end = float(MAX_CYCLES) if cycles is None else max(progress.stop, landed)
        time = np.arange(math.ceil(end * count - SAME_TIME) + (cycles is not None)) / count
        parts = [self._leg(index, leg, time) for index, leg in enumerate(legs)]
        angles, feet, ground, corrections = (np.stack(column, axis=1) for column in zip(*parts, strict=True))
        return Frames(angles, feet, ground, corrections)

    def _leg(
        self, index: int, leg: Steps, time: Floats
    ) -> tuple[Floats, Floats, npt.NDArray[np.bool_], Floats]:
        """Return one leg's angles, feet, ground and corrections."""
        swing = leg.swing_at(time)
        footholds = leg.standing(time)
        angles = self.stance.angles(index, footholds)
        for number in np.unique(swing[swing >= 0]).tolist():
            mine = swing == number
            angles[mine] = self._swing(index, leg, number, time[mine])
        feet = self.stance.feet(index, angles)
        ground = swing < 0
        correction = np.stack([footholds.real, footholds.imag, feet[:, 2]], axis=1) - feet
        return angles, feet, ground, np.where(ground[:, None], correction, 0.0)

    def _swing(self, index: int, leg: Steps, number: int, time: Floats) -> Floats:
        """Return the angles (n, k) of one swing."""
        start, end = float(leg.lifts[number]), float(leg.lands[number])
        span = end - start
        before = leg.seen(leg.holds[number], np.array([start, start - SMALL]))
        after = leg.seen(leg.holds[number + 1], np.array([end, end + SMALL]))
        first, earlier = self.stance.angles(index, before)
        last, later = self.stance.angles(index, after)
        u = (time - start) / span
        rates = (first - earlier) * span / SMALL, (later - last) * span / SMALL
        share = 16 * u**2 * (1 - u) ** 2
        return self.stance.lifted(index, _quintic(first, last, *rates, u[:, None]), share)


SMALL = 1e-7
"""Cycles over which the speed at either end of a stance is measured."""


def footwork(robot: WalkingRobot, gait: Gait, posture: Posture) -> Footwork:
    """Return the footwork of a robot. Raises InputError for a posture that its legs cannot take."""
    return Footwork(tuple(leg.name for leg in robot.limbs), robot.stance(posture), gait)


def _quintic(start: Floats, end: Floats, speed0: Floats, speed1: Floats, u: Floats) -> Floats:
    """Return a course (n, k) from start to end with these speeds (per u) and no acceleration at both ends."""
    change = end - start
    a3 = 10 * change - 6 * speed0 - 4 * speed1
    a4 = -15 * change + 8 * speed0 + 7 * speed1
    a5 = 6 * change - 3 * (speed0 + speed1)
    return np.asarray(start + u * (speed0 + u**2 * (a3 + u * (a4 + u * a5))))
