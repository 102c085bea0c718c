"""The legs of a walking robot: footholds -> joint angles at each frame of one segment.

In: the robot, its gait and posture, one `Segment`. Out: `Frames`: angles, feet, which are on the ground, and
the corrections that their springs must give.

    side view of a foot          β lifts it by a bump that is flat at both ends;
         ___                     α goes from where the foot left the ground to where it lands,
     ___╱   ╲___  ground         beginning and ending with the speed of the stance
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError
from servogen.kinematics.leg import Leg
from servogen.motion.gait.phases import Gait
from servogen.motion.gait.steps import SAME_M, SAME_TIME, Points, Progress, Segment, Steps, start_ramp, steps
from servogen.motion.trajectory import Floats
from servogen.robot.model import Hexapod, Mount

MOST_CYCLES = 8
"""A walk without an end is steady by then, or never."""


@dataclass(frozen=True, slots=True)
class Posture:
    """How the robot stands and lifts its feet; metres.

    None: the body as high as the legs reach; feet as wide apart as needs the least correction.
    """

    body_height: float | None = None
    """Of the body's frame above the ground."""
    stance_width: float | None = None
    """From the left feet to the right feet, in the middle of their stance."""
    lift: float = 0.02
    beta_sign: int = 1
    """Which of the two β is used: with 1 a lifted foot goes towards the rear, with -1 to the front."""


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """A row a frame, a column a leg: `angles` (…, 2), `feet` (…, 3), `ground`, `corrections` (…, 3)."""

    angles: Floats
    feet: Floats
    ground: npt.NDArray[np.bool_]
    corrections: Floats

    def part(self, first: int, end: int) -> Frames:
        rows = slice(first, end)
        return Frames(self.angles[rows], self.feet[rows], self.ground[rows], self.corrections[rows])


def joined(parts: Sequence[Frames]) -> Frames:
    """One after the other."""
    return Frames(
        np.concatenate([part.angles for part in parts]),
        np.concatenate([part.feet for part in parts]),
        np.concatenate([part.ground for part in parts]),
        np.concatenate([part.corrections for part in parts]),
    )


@dataclass(frozen=True, slots=True)
class Footwork:
    """What is fixed for the whole walk: `beta` of the stance, `lifted` at the top of a swing."""

    robot: Hexapod
    leg: Leg
    gait: Gait
    stance_width: float | None
    beta: float
    lifted: float

    def frames(self, segment: Segment, count: int) -> Frames:
        """One segment at `count` frames a cycle, from standstill; to standstill, or for `MOST_CYCLES`."""
        way = segment.cycles
        if way is not None and way <= 0:
            raise InputError("out-of-range", f"a segment of {way:g} cycles: it has more than none")
        progress = Progress(start_ramp(self.gait), way)
        until = MOST_CYCLES if way is None else progress.stop + 1
        mounts = self.robot.mounts
        legs = [
            steps(self.gait, each.name, segment, progress, self._neutral(segment, each), until)
            for each in mounts
        ]
        landed = max(float(leg.lands.max(initial=0.0)) for leg in legs)
        end = float(MOST_CYCLES) if way is None else max(progress.stop, landed)
        time = np.arange(math.ceil(end * count - SAME_TIME) + (way is not None)) / count
        parts = [self._leg(mount, leg, time) for mount, leg in zip(mounts, legs, strict=True)]
        angles, feet, ground, corrections = (np.stack(column, axis=1) for column in zip(*parts, strict=True))
        return Frames(angles, feet, ground, corrections)

    def _leg(
        self, mount: Mount, leg: Steps, time: Floats
    ) -> tuple[Floats, Floats, npt.NDArray[np.bool_], Floats]:
        """One leg's angles, feet, ground and corrections."""
        swing = leg.swing_at(time)
        wanted = leg.standing(time)
        angles = np.stack([self._alpha(mount, wanted), np.full(len(time), self.beta)], axis=1)
        for number in np.unique(swing[swing >= 0]).tolist():
            mine = swing == number
            angles[mine] = self._swing(mount, leg, number, time[mine])
        feet = to_body(mount, self.leg.fk(angles[:, 0], angles[:, 1]))
        ground = swing < 0
        correction = np.stack([wanted.real, wanted.imag, feet[:, 2]], axis=1) - feet
        return angles, feet, ground, np.where(ground[:, None], correction, 0.0)

    def _neutral(self, segment: Segment, mount: Mount) -> complex:
        """Where the foot stands in the middle of its stance, in the body's frame.

        A straight stance of length c is nearest to the circle of radius ρ with its middle c² / 16ρ inside.
        """
        rho = math.hypot(self.leg.r, self.leg.bc * math.sin(self.beta))
        stroke = abs(complex(segment.forward, segment.left)) * float(self.gait.duty)
        out = rho - stroke**2 / (16 * rho)
        if self.stance_width is not None:
            out = (self.stance_width / 2 - abs(mount.y)) / math.cos(mount.heading)
        point = to_body(mount, np.array([0.0, out, 0.0]))
        return complex(point[0], point[1])

    def _alpha(self, mount: Mount, foot: Points) -> Floats:
        """α that turns the foot to the direction of a point of the body's frame, with β of the stance."""
        body = np.stack([foot.real, foot.imag, np.full(len(foot), mount.z)], axis=1)
        local = to_leg(mount, body)
        s = self.leg.bc * math.sin(self.beta)
        return np.asarray(np.arctan2(local[:, 1], local[:, 0]) - math.atan2(self.leg.r, -s))

    def _swing(self, mount: Mount, leg: Steps, number: int, time: Floats) -> Floats:
        """(n, 2) angles of one swing."""
        start, end = float(leg.lifts[number]), float(leg.lands[number])
        span = end - start
        before = leg.seen(leg.holds[number], np.array([start, start - SMALL]))
        after = leg.seen(leg.holds[number + 1], np.array([end, end + SMALL]))
        first, earlier = self._alpha(mount, before).tolist()
        last, later = self._alpha(mount, after).tolist()
        u = (time - start) / span
        rates = (first - earlier) * span / SMALL, (later - last) * span / SMALL
        bump = 16 * u**2 * (1 - u) ** 2
        beta = self.beta + (self.lifted - self.beta) * bump
        return np.stack([_quintic(first, last, *rates, u), beta], axis=1)


SMALL = 1e-7
"""Cycles over which the speed of a stance is taken."""


def footwork(robot: Hexapod, gait: Gait, posture: Posture) -> Footwork:
    """Raises InputError for a posture that the legs cannot take."""
    leg = Leg.of(robot.leg.length)
    heights = {mount.z for mount in robot.mounts}
    if len(heights) > 1:
        raise InputError(
            "mounting-heights",
            f"{robot.name}'s legs are mounted at different heights: one β cannot serve them all",
        )
    foot = -leg.bc - leg.df if posture.body_height is None else -posture.body_height - heights.pop()
    if posture.lift <= 0:
        raise InputError(
            "out-of-range", f"a lift of {1000 * posture.lift:g} mm does not take the foot off the ground"
        )
    try:
        beta, lifted = _beta_at(leg, foot), _beta_at(leg, foot + posture.lift)
    except InputError as error:
        stands, lifts = (f"{1000 * length:g} mm" for length in (-foot, posture.lift))
        least, most = (f"{1000 * length:g}" for length in (leg.df - leg.bc, leg.df + leg.bc))
        raise InputError(
            "out-of-reach",
            f"the legs cannot stand {stands} high and lift their feet by {lifts}",
            hint=f"their feet are {least} to {most} mm below the body's joints",
        ) from error
    sign = 1 if posture.beta_sign >= 0 else -1
    return Footwork(robot, leg, gait, posture.stance_width, sign * beta, sign * lifted)


def _beta_at(leg: Leg, height: float) -> float:
    """As `leg.beta_at`; a height that is the lowest but for floating point is the lowest."""
    return 0.0 if abs(height + leg.bc + leg.df) < SAME_M else leg.beta_at(height)


def _quintic(start: float, end: float, speed0: float, speed1: float, u: Floats) -> Floats:
    """From start to end with these speeds (a share of u) and without acceleration at both ends."""
    way = end - start
    a3 = 10 * way - 6 * speed0 - 4 * speed1
    a4 = -15 * way + 8 * speed0 + 7 * speed1
    a5 = 6 * way - 3 * (speed0 + speed1)
    return np.asarray(start + u * (speed0 + u**2 * (a3 + u * (a4 + u * a5))))


def to_body(mount: Mount, points: Floats) -> Floats:
    """Leg points (..., 3) in the body's frame: Trans(x, y, z) Rot(z, heading) diag(1, ±1, 1)."""
    c, s = math.cos(mount.heading), math.sin(mount.heading)
    mirrored = points * np.array([1.0, -1.0 if mount.mirrored else 1.0, 1.0])
    turned = mirrored @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turned + np.array([mount.x, mount.y, mount.z]))


def to_leg(mount: Mount, points: Floats) -> Floats:
    """Body points (..., 3) in the leg's frame."""
    c, s = math.cos(mount.heading), math.sin(mount.heading)
    away = points - np.array([mount.x, mount.y, mount.z])
    turned = away @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turned * np.array([1.0, -1.0 if mount.mirrored else 1.0, 1.0]))
