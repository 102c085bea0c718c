"""The legs of a walking robot: footholds -> joint angles at each frame of one segment.

In: the robot, its gait and posture, the segments of its route. Out: `Frames`: angles, feet, which of them are
on the ground, and the corrections that their springs must yield.

    side view of a foot          it is lifted by a bump that is flat at both ends, while
         ___                     the joints go from where the foot left the ground to where it lands,
     ___╱   ╲___  ground         by one law that begins and ends with the speed of the stance

    the body is at rest while its feet step, once each, to their places at the beginning of the walk; feet
    that are in the air at that moment rise in place. After the walk they come down in place and step again

After a reversal a servo does not follow the first part of a movement, its dead band and the backlash of its
gear. A swing therefore overshoots the foothold and comes back, so far that the joint follows the stance when
the foot lands (`Footwork.reach_beyond`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError
from servogen.kinematics.protocol import BodyMotion, Posture, Stance, WalkingRobot
from servogen.kinematics.stance import level_centre
from servogen.motion.gait.lean import STILL, Complexes, Lean, least_rest, offset_over, one_at_a_time
from servogen.motion.gait.phases import Gait
from servogen.motion.gait.steps import SAME_M, Segment, Steps, cruise_of, steps
from servogen.motion.trajectory import Floats

SAME_RAD = 1e-9
"""Angles closer than this (radians) are equal, so that rounding does not make a foot step."""

MAX_BEYOND = 0.15
"""The largest share of a swing's way by which it goes beyond its foothold to take up lost motion."""

BEND_PEAK = 5**-2.5
"""The maximum of u² (1 - u)² (2u - 1), at u = ½ + 1/√20."""

BEYOND_SAMPLES = 201
"""The number of samples of the second half of a swing, in which its farthest point is looked for."""

SAME_SHARE = 1e-6
"""The tolerance of a share of a swing's way."""

FOUR_LEGS_M = {True: 0.01, False: 0.005}
"""The margin for which a body on four legs leans unless another is stated, by whether its feet follow freely:
three feet alone hardly carry it, and feet of legs of two joints slip when it leans.
"""

RISE_SAMPLES = 2001
"""The number of samples of a foot's rise, from which its sideways movement meanwhile is computed."""


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """`angles` (frames, legs, k), `feet` and `corrections` (frames, legs, 3), `ground` (frames, legs).

    `lean` (frames,) is the offset of the body, x + iy, from where its route has it.
    """

    angles: Floats
    feet: Floats
    ground: npt.NDArray[np.bool_]
    corrections: Floats
    lean: Complexes

    @property
    def first(self) -> Frames:
        """Return the first frame alone."""
        return self._part(slice(0, 1))

    @property
    def last(self) -> Frames:
        """Return the last frame alone."""
        return self._part(slice(-1, None))

    @property
    def begun(self) -> Frames:
        """Return all frames but the last."""
        return self._part(slice(0, -1))

    @property
    def holds(self) -> Complexes:
        """Return where the feet of the first frame stand (legs,), as the route has the body."""
        stands = self.feet[0] + self.corrections[0]
        return np.asarray(stands[:, 0] + 1j * stands[:, 1] + self.lean[0])

    def _part(self, rows: slice) -> Frames:
        return Frames(
            self.angles[rows], self.feet[rows], self.ground[rows], self.corrections[rows], self.lean[rows]
        )


def join_frames(parts: Sequence[Frames]) -> Frames:
    """Return the frames of all parts, one part after the other."""
    return Frames(
        np.concatenate([part.angles for part in parts]),
        np.concatenate([part.feet for part in parts]),
        np.concatenate([part.ground for part in parts]),
        np.concatenate([part.corrections for part in parts]),
        np.concatenate([part.lean for part in parts]),
    )


@dataclass(frozen=True, slots=True)
class HeldBack:
    """A foot that joint limits keep from its best foothold: segment (from 0), leg, angle (radians), and
    whether the body turns.
    """

    segment: int
    leg: str
    angle: float
    turns: bool = True

    def text(self) -> str:
        """Return the fact in words."""
        return (
            f"the limits of the joints of {self.leg} keep its foot {math.degrees(self.angle):.1f}° "
            "off the line " + ("from the centre of rotation" if self.turns else "across the way")
        )


@dataclass(frozen=True, slots=True)
class Footwork:
    """Computes the legs' motion in a gait; `stance` is fixed for the whole walk."""

    legs: tuple[str, ...]
    stance: Stance
    gait: Gait
    beyond: float = 0.0
    """The share of its way by which a swing of a walking body goes farther beyond its foothold."""
    centre: complex = 0j
    """The centre of mass, seen from above."""
    margin: float | None = None
    """How far inside the other feet the body leans before a foot lifts, metres; None: it does not lean."""

    def motion(self, segment: Segment) -> BodyMotion:
        """Return the body's motion in a cycle of a segment."""
        return body_motion(segment, self.gait, self.beyond)

    def reach_beyond(self, segments: Sequence[Segment], count: int, lost: float) -> float:
        """Return the share `beyond` for joints that lose `lost` radians when they reverse.

        Before a foot lands, its joint comes back by what is lost and by what the stance moves it in one of
        the `count` frames of a cycle, the time until the servo receives the next pulse. All swings have one
        law: the share is that of the swing with the shortest way, at most `MAX_BEYOND`.
        """
        if lost <= 0:
            return 0.0
        rate, stance_frames = float(self.gait.swing / self.gait.duty), float(self.gait.duty) * count
        way = min((way for segment in segments for way in self._swing_angles(segment)), default=0.0)
        wanted = lost + way / stance_frames
        # The second half is enough: the first mirrors it.
        u = np.linspace(0.5, 1.0, BEYOND_SAMPLES)

        def comes_back(beyond: float) -> float:
            return way * (float(swing_share(u, rate, beyond).max()) - 1)

        if way <= SAME_RAD or comes_back(0.0) >= wanted:
            return 0.0
        if comes_back(MAX_BEYOND) <= wanted:
            return MAX_BEYOND
        # `comes_back` rises with `beyond`, so bisection finds the smallest sufficient one; `high` always
        # suffices.
        low, high = 0.0, MAX_BEYOND
        while high - low > SAME_SHARE:
            middle = (low + high) / 2
            low, high = (low, middle) if comes_back(middle) >= wanted else (middle, high)
        return high

    def _swing_angles(self, segment: Segment) -> Iterator[float]:
        """Yield the angle (radians) by which each leg's joints turn in a swing of the steady walk."""
        cruise = cruise_of(self.gait, None)
        for index, (name, neutral) in enumerate(zip(self.legs, self._footing(segment), strict=True)):
            leg = steps(self.gait, name, segment, cruise, neutral)
            for number in range(len(leg.lifts)):
                first, last = (self.stance.angles(index, foothold) for foothold in leg.ends(number))
                yield float(np.abs(last - first).max())

    def held_back(self, segments: Sequence[Segment]) -> Iterator[HeldBack]:
        """Yield the feet that the limits of their joints keep from their best footholds."""
        for number, segment in enumerate(segments):
            for index, name in enumerate(self.legs):
                angle = self.stance.held_back(index, self.motion(segment))
                if angle > SAME_RAD:
                    yield HeldBack(number, name, angle, bool(segment.turn))

    def liftoff_slide_m(self, height: float) -> float:
        """Return how far, in metres, a foot moves sideways until it has risen by `height`, or to its lift."""
        share = np.linspace(0.0, 1.0, RISE_SAMPLES)
        here = self._footing(Segment())[0]
        stands = np.repeat(self.stance.angles(0, np.array([here])), RISE_SAMPLES, axis=0)
        feet = self.stance.feet(0, self.stance.lifted(0, stands, share))
        risen = feet[:, 2] - feet[0, 2]
        ways = np.abs(feet[:, 0] - feet[0, 0] + 1j * (feet[:, 1] - feet[0, 1]))
        return float(np.interp(height, risen, ways))

    def frames_of_route(
        self, segments: Sequence[Segment], count: int
    ) -> tuple[list[Frames], tuple[int, ...]]:
        """Return the frames of all segments, from rest and, unless the last one is endless, back to rest; and
        the frame at which each segment begins.

        Between segments the feet step on the spot to where the next segment has them. The last part of an
        endless walk is one cycle and its lead-in.
        """
        rest = self._at_rest()
        parts: list[Frames] = []
        begins, here = [], rest
        for segment in segments:
            begins.append(sum(len(part.angles) for part in parts))
            made = self.frames(segment, count)
            parts += [
                *self._on_the_spot(here, made.first, count),
                made if segment.cycles is None else made.begun,
            ]
            here = made.last
        if segments[-1].cycles is not None:
            parts += [*self._on_the_spot(here, rest, count), rest]
        return parts, tuple(begins)

    def _footing(self, segment: Segment) -> tuple[complex, ...]:
        """Return where each foot stands in the middle of its stance, in the body's frame."""
        motion = self.motion(segment)
        return tuple(self.stance.neutral(index, motion) for index in range(len(self.legs)))

    def _at_rest(self) -> Frames:
        """Return the frame in which the robot stands."""
        still = Segment()
        footing = self._footing(still)
        legs = [
            steps(self.gait, name, still, cruise_of(self.gait, None), neutral)
            for name, neutral in zip(self.legs, footing, strict=True)
        ]
        return self._frames_at(legs, np.zeros(1))

    def _on_the_spot(self, here: Frames, there: Frames, count: int) -> tuple[Frames, ...]:
        """Return the frames in which feet step once from one footing to another while the body is at rest.

        A foot that is already where its joints and its spring would put it does not step; the result is empty
        if no foot steps. The last frame, in which all feet stand, belongs to the next part.
        """
        old, new = here.angles[0], there.angles[0]
        stepping = np.abs(new - old).max(axis=1) > SAME_RAD
        stepping |= np.abs(there.corrections[0] - here.corrections[0]).max(axis=1) > SAME_M
        if self.margin is not None:
            return self._leaning_on_the_spot(here, there, count)
        if not stepping.any():
            return ()
        lifts = np.array([float(lift) for _, lift in self.gait.lifts])
        swing = float(self.gait.swing)
        # Without the time before the first foot that steps.
        first = lifts[stepping].min()
        time = np.arange(round((lifts[stepping].max() - first + swing) * count)) / count
        share = np.clip((time[:, None] - (lifts - first)) / swing, 0.0, 1.0)
        # Lifts are whole frames: rounding must not take a foot off the ground, or keep it there.
        share = np.where(stepping, np.round(share * swing * count) / (swing * count), 0.0)
        angles = old + (new - old) * swing_share(share, 0.0)[:, :, None]
        feet = np.empty((len(time), len(self.legs), 3))
        for index in range(len(self.legs)):
            angles[:, index] = self.stance.lifted(index, angles[:, index], bump(share[:, index]))
            feet[:, index] = self.stance.feet(index, angles[:, index])
        ground = (share == 0) | (share == 1)
        corrections = np.where((share == 1)[:, :, None], there.corrections[0], here.corrections[0])
        still = np.zeros(len(time), complex)
        return (Frames(angles, feet, ground, np.where(ground[:, :, None], corrections, 0.0), still),)

    def _leaning_on_the_spot(self, here: Frames, there: Frames, count: int) -> tuple[Frames, ...]:
        """Return the frames in which feet step from one footing to another, the body leaning before each."""
        old, new = here.holds, there.holds
        stepping = np.abs(new - old) > SAME_M
        if not stepping.any() and abs(there.lean[0] - here.lean[0]) <= SAME_M:
            return ()
        swing, rest = float(self.gait.swing), float(least_rest(self.gait))
        order = sorted(np.flatnonzero(stepping).tolist(), key=lambda leg: self.gait.lifts[leg][1])
        times, offsets, holds = [0.0], [complex(here.lean[0])], old.copy()
        for leg in order:
            others = np.delete(holds, leg)
            offset = offset_over([others], self.centre, self.margin or 0.0, along_x=not self.stance.free)
            times += [times[-1] + rest, times[-1] + rest + swing]
            offsets += [offset, offset]
            holds[leg] = new[leg]
        lean = Lean(np.array([*times, times[-1] + rest]), np.array([*offsets, complex(there.lean[0])]))
        time = np.arange(round(lean.times[-1] * count)) / count
        moved = lean.at(time)
        parts = []
        for leg in range(len(self.legs)):
            lifts = times[1 + 2 * order.index(leg)] if leg in order else math.inf
            share = np.clip((time - lifts) / swing, 0.0, 1.0)
            share = np.round(share * swing * count) / (swing * count)
            stands = np.where(share < 1, old[leg], new[leg]) - moved
            angles = self.stance.angles(leg, stands)
            flying = (share > 0) & (share < 1)
            if flying.any():
                first, last = self.stance.angles(
                    leg, np.array([old[leg], new[leg]]) - lean.at(np.array([lifts]))
                )
                way = first + (last - first) * swing_share(share[flying], 0.0)[:, None]
                angles[flying] = self.stance.lifted(leg, way, bump(share[flying]))
            feet = self.stance.feet(leg, angles)
            correction = np.stack([stands.real, stands.imag, feet[:, 2]], axis=1) - feet
            parts.append((angles, feet, ~flying, np.where(flying[:, None], 0.0, correction)))
        angles, feet, ground, corrections = (np.stack(column, axis=1) for column in zip(*parts, strict=True))
        return (Frames(angles, feet, ground, corrections, moved),)

    def _lean(self, segment: Segment, begin: float, end: float) -> Lean:
        """Return how the body leans in a segment: as in the steady walk, at every lift from begin to end."""
        if self.margin is None:
            return STILL
        motion, duty, swing = self.motion(segment), float(self.gait.duty), float(self.gait.swing)
        neutral = np.array([self.stance.neutral(index, motion) for index in range(len(self.legs))])
        lifts = np.array([float(lift) for _, lift in self.gait.lifts])
        rows = []
        for leg, lift in enumerate(lifts):
            polygons = []
            for time in (lift, lift + swing):
                # Since the middle of each stance, in cycles; a foot is where the body has left it since.
                since = (time - (lifts - duty / 2) + 0.5) % 1 - 0.5
                position, heading = segment.travelled(since)
                polygons.append(np.delete((neutral - position) * np.exp(-1j * heading), leg))
            offset = offset_over(polygons, self.centre, self.margin, along_x=not self.stance.free)
            for cycle in range(math.floor(begin) - 1, math.ceil(end) + 2):
                rows += [(cycle + lift, offset), (cycle + lift + swing, offset)]
        times, offsets = zip(*sorted(rows, key=lambda row: row[0]), strict=True)
        return Lean(np.array(times), np.array(offsets))

    def frames(self, segment: Segment, count: int) -> Frames:
        """Return one segment at `count` frames per cycle, from the last frame in which all feet stand.

        It ends when all feet stand after its stop, or after one cycle if it is endless. Raises InputError for
        a segment of zero cycles.
        """
        cycles = segment.cycles
        if cycles is not None and cycles <= 0:
            raise InputError("out-of-range", f"a segment needs more than 0 cycles, not {cycles:g}")
        cruise = cruise_of(self.gait, cycles)
        legs = [
            steps(self.gait, name, segment, cruise, neutral)
            for name, neutral in zip(self.legs, self._footing(segment), strict=True)
        ]
        # A foot in the air at time 0 lifted before it: the segment begins with that lift, while the body is
        # at rest.
        begin = min(float(leg.lifts.min(initial=0.0)) for leg in legs)
        if cycles is None:
            return self._frames_at(
                legs, np.arange(round(begin * count), count) / count, self._lean(segment, begin, 1.0)
            )
        end = max(float(leg.lands.max(initial=cruise.stop)) for leg in legs)
        time = np.arange(round(begin * count), round(end * count) + 1) / count
        return self._frames_at(legs, time, self._lean(segment, begin, end))

    def _frames_at(self, legs: Sequence[Steps], time: Floats, lean: Lean = STILL) -> Frames:
        """Return the frames of all legs at these times."""
        parts = [self._leg(index, leg, time, lean) for index, leg in enumerate(legs)]
        angles, feet, ground, corrections = (np.stack(column, axis=1) for column in zip(*parts, strict=True))
        return Frames(angles, feet, ground, corrections, lean.at(time))

    def _leg(
        self, index: int, leg: Steps, time: Floats, lean: Lean
    ) -> tuple[Floats, Floats, npt.NDArray[np.bool_], Floats]:
        """Return one leg's angles, feet, ground and corrections."""
        swing = leg.swing_at(time)
        footholds = leg.standing(time) - lean.at(time)
        angles = self.stance.angles(index, footholds)
        in_place = np.zeros(time.shape, dtype=bool)
        for number in range(len(leg.lifts)):
            cut = leg.cut(number, time)
            mine = cut | (swing == number)
            angles[mine] = self._swing(index, leg, number, time[mine], lean)
            # A foot that a cut swing has put in place stands where its joints put it, without a correction.
            in_place |= cut
        feet = self.stance.feet(index, angles)
        ground = swing < 0
        correction = np.stack([footholds.real, footholds.imag, feet[:, 2]], axis=1) - feet
        return angles, feet, ground, np.where((ground & ~in_place)[:, None], correction, 0.0)

    def _swing(self, index: int, leg: Steps, number: int, time: Floats, lean: Lean) -> Floats:
        """Return the angles (n, k) of one swing, whose turn progresses only while the body moves."""
        start, end = float(leg.lifts[number]), float(leg.lands[number])
        first, last = (
            self.stance.angles(index, foothold - lean.at(np.array([when])))
            for foothold, when in zip(leg.ends(number), (start, end), strict=True)
        )
        # The foot moves over the ground only while the body moves, but it rises and comes down in any case.
        turned = (np.clip(time, 0.0, leg.cruise.stop) - start) / (end - start)
        share = swing_share(turned, float(self.gait.swing / self.gait.duty), self.beyond)
        risen = np.clip((time - start) / (end - start), 0.0, 1.0)
        return self.stance.lifted(index, first + (last - first) * share[:, None], bump(risen))


def footwork(robot: WalkingRobot, gait: Gait, posture: Posture, segments: Sequence[Segment]) -> Footwork:
    """Return the footwork of a robot for segments in one posture.

    Raises InputError for a posture that its legs cannot take.
    """
    motions = [body_motion(segment, gait) for segment in segments]
    names, (x, y) = tuple(leg.name for leg in robot.limbs), level_centre(posture, robot.centre_of_mass)
    stance, margin = robot.stance(posture, motions), posture.margin
    if margin is None and len(names) == 4:
        margin = FOUR_LEGS_M[stance.free]
    if not margin:
        margin = None
    elif not one_at_a_time(gait):
        if posture.margin is not None:
            raise InputError(
                "conflicting-keys",
                f"the gait '{gait.name}' leaves no time in which the body could lean before a foot lifts",
                hint="a gait that lifts one foot after the other, and some time later, as crawl does",
            )
        margin = None
    return Footwork(names, stance, gait, 0.0, complex(x, y), margin)


def body_motion(segment: Segment, gait: Gait, beyond: float = 0.0) -> BodyMotion:
    """Return the body's motion in a cycle of a segment."""
    return BodyMotion(complex(segment.forward, segment.left), segment.turn, float(gait.duty), beyond)


def swing_share(u: Floats, rate: float, beyond: float = 0.0) -> Floats:
    """Return the share of a swing's path at shares `u` of its time.

    The law is a quintic that begins and ends at the speed of the stance: `rate` path lengths backward per
    duration of the swing, 0 on the spot. Its second half mirrors the first. With `beyond` = 0 it begins and
    ends without acceleration; otherwise it goes beyond both ends of the path, by up to `beyond` more.
    """
    a3, a4, a5 = 10 + 10 * rate, -15 - 15 * rate, 6 + 6 * rate
    plain = u * (-rate + u**2 * (a3 + u * (a4 + u * a5)))
    if not beyond:
        return np.asarray(plain)
    return np.asarray(plain + beyond / BEND_PEAK * u**2 * (1 - u) ** 2 * (2 * u - 1))


def bump(u: Floats) -> Floats:
    """Return the share of the lift at shares `u` of a swing's time: 1 in the middle, flat at both ends."""
    return np.asarray(16 * u**2 * (1 - u) ** 2)
