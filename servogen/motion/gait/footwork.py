"""The legs of a walking robot: footholds -> joint angles at each frame of one segment.

In: the robot, its gait and posture, the segments of its way. Out: `Frames`: angles, feet, which are on the
ground, and the corrections that their springs must give.

    side view of a foot          it is lifted by a bump that is flat at both ends, while
         ___                     the joints go from where the foot left the ground to where it lands,
     ___╱   ╲___  ground         by one law that begins and ends with the speed of the stance
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError
from servogen.kinematics.protocol import BodyMotion, Posture, Stance, WalkingRobot
from servogen.motion.gait.phases import Gait
from servogen.motion.gait.steps import SAME_TIME, Segment, Steps, progress_of, steps
from servogen.motion.trajectory import Floats

SAME_RAD = 1e-9
"""Angles nearer than this are equal: a foot does not step for what rounding adds."""

RISE_SAMPLES = 2001
"""Of a foot's rise to the top of its lift, for the way that it moves sideways meanwhile."""

MAX_CYCLES = 8
"""The cycles after which a walk without an end is steady, or never will be."""


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
class HeldBack:
    """A foot that joint limits keep from its best foothold: the segment (from 0), the leg, the angle."""

    segment: int
    leg: str
    angle: float

    def text(self) -> str:
        """Return the fact as a sentence."""
        return (
            f"the limits of the joints of {self.leg} keep its foot {math.degrees(self.angle):.1f}° "
            "off the line from the centre of rotation"
        )


@dataclass(frozen=True, slots=True)
class Footwork:
    """The legs' work in a gait: `stance` is fixed for the whole walk."""

    legs: tuple[str, ...]
    stance: Stance
    gait: Gait

    def motion(self, segment: Segment) -> BodyMotion:
        """Return what the body does in a cycle of a segment."""
        return body_motion(segment, self.gait)

    def held_back(self, segments: Sequence[Segment]) -> Iterator[HeldBack]:
        """Return which feet the limits of their joints keep from their best footholds."""
        for number, segment in enumerate(segments):
            for index, name in enumerate(self.legs):
                angle = self.stance.held_back(index, self.motion(segment))
                if angle > SAME_RAD:
                    yield HeldBack(number, name, angle)

    def first_way_m(self, height: float) -> float:
        """Return how far a foot moves sideways until it has risen by `height`, or by a lower lift."""
        share = np.linspace(0.0, 1.0, RISE_SAMPLES)
        here = self._footing(Segment())[0]
        stands = np.repeat(self.stance.angles(0, np.array([here])), RISE_SAMPLES, axis=0)
        feet = self.stance.feet(0, self.stance.lifted(0, stands, share))
        risen = feet[:, 2] - feet[0, 2]
        ways = np.abs(feet[:, 0] - feet[0, 0] + 1j * (feet[:, 1] - feet[0, 1]))
        return float(np.interp(height, risen, ways))

    def frames_of_way(self, segments: Sequence[Segment], count: int) -> list[Frames]:
        """Return the frames of all segments, from rest and, unless the last has no end, back to rest.

        A segment for which the feet stand elsewhere than for the one before begins with a step on the spot.
        """
        rest = self._footing(Segment())
        parts, here = [], rest
        for segment in segments:
            there = self._footing(segment)
            parts += [*self._on_the_spot(here, there, count), self.frames(segment, count)]
            here = there
        return parts if segments[-1].cycles is None else [*parts, *self._on_the_spot(here, rest, count)]

    def _footing(self, segment: Segment) -> tuple[complex, ...]:
        """Return where each foot stands in the middle of its stance, in the body's frame."""
        motion = self.motion(segment)
        return tuple(self.stance.neutral(index, motion) for index in range(len(self.legs)))

    def _on_the_spot(
        self, here: Sequence[complex], there: Sequence[complex], count: int
    ) -> tuple[Frames, ...]:
        """Return the frames in which feet step once from one footing to another while the body is at rest.

        A foot that its joints would put where it is already does not step. No frames: none steps.
        """
        still = progress_of(self.gait, None)
        legs = []
        for index, ((_, first), old, new) in enumerate(zip(self.gait.lifts, here, there, strict=True)):
            angles = self.stance.angles(index, np.array([old, new]))
            steps_over = np.abs(angles[1] - angles[0]).max() > SAME_RAD
            lifts = np.array([float(first)] if steps_over else [])
            holds = np.array([old, new] if steps_over else [new])
            legs.append(Steps(Segment(), still, lifts, lifts + float(self.gait.swing), holds))
        end = max(float(leg.lands.max(initial=0.0)) for leg in legs)
        if not end:
            return ()
        return (self._placed(legs, np.arange(math.ceil(end * count - SAME_TIME) + 1) / count),)

    def frames(self, segment: Segment, count: int) -> Frames:
        """Return one segment at `count` frames per cycle, from standstill.

        It ends in standstill, or after `MAX_CYCLES` if the segment has no end. Raises InputError for a
        segment of no cycles.
        """
        cycles = segment.cycles
        if cycles is not None and cycles <= 0:
            raise InputError("out-of-range", f"a segment has {cycles:g} cycles: it needs more than 0")
        progress = progress_of(self.gait, cycles)
        until = MAX_CYCLES if cycles is None else progress.stop + 1
        legs = [
            steps(self.gait, name, segment, progress, neutral, until)
            for name, neutral in zip(self.legs, self._footing(segment), strict=True)
        ]
        landed = max(float(leg.lands.max(initial=0.0)) for leg in legs)
        end = float(MAX_CYCLES) if cycles is None else max(progress.stop, landed)
        time = np.arange(math.ceil(end * count - SAME_TIME) + (cycles is not None)) / count
        return self._placed(legs, time)

    def _placed(self, legs: Sequence[Steps], time: Floats) -> Frames:
        """Return the frames of all legs at these times."""
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
        first, last = (
            self.stance.angles(index, leg.seen(leg.holds[hold], np.array([at])))
            for hold, at in ((number, start), (number + 1, end))
        )
        u = (time - start) / (end - start)
        share = swing_share(u, float(self.gait.swing / self.gait.duty))
        return self.stance.lifted(index, first + (last - first) * share[:, None], bump(u))


def footwork(robot: WalkingRobot, gait: Gait, posture: Posture, segments: Sequence[Segment]) -> Footwork:
    """Return the footwork of a robot for segments in one posture.

    Raises InputError for a posture that its legs cannot take.
    """
    motions = [body_motion(segment, gait) for segment in segments]
    return Footwork(tuple(leg.name for leg in robot.limbs), robot.stance(posture, motions), gait)


def body_motion(segment: Segment, gait: Gait) -> BodyMotion:
    """Return what the body does in a cycle of a segment."""
    return BodyMotion(complex(segment.forward, segment.left), segment.turn, float(gait.duty))


def swing_share(u: Floats, rate: float) -> Floats:
    """Return the share of a swing's way at shares `u` of its time.

    A quintic that begins and ends with the stance's speed, `rate` ways backward in a swing's time, and
    without acceleration. It is the same for every swing, even for a step on the spot, so that the player
    needs one table for all of them; its second half mirrors its first.
    """
    a3, a4, a5 = 10 + 10 * rate, -15 - 15 * rate, 6 + 6 * rate
    return np.asarray(u * (-rate + u**2 * (a3 + u * (a4 + u * a5))))


def bump(u: Floats) -> Floats:
    """Return the share of the lift at shares `u` of a swing's time: 1 in the middle, flat at both ends."""
    return np.asarray(16 * u**2 * (1 - u) ** 2)
