"""How legs stand and walk: footholds of a body -> joint angles, for each leg by its own mount.

In: the legs' mounts and lengths, a posture, the body's motions. Out: `CircleStance` of legs of two joints,
whose feet move on circles about their first axes, and `FreeStance` of legs of three, which put
a foot anywhere.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.kinematics.protocol import BodyMotion, Posture
from servogen.kinematics.serial_legs import CoxaFemurTibia
from servogen.kinematics.transforms import Complexes, Floats, rot, to_body, to_leg
from servogen.robot.model import Arm, Joint, Mount

SAME_M = 1e-9
"""Points closer than this are one: floating-point noise."""


class TwoJointLeg(Protocol):
    """A leg whose first joint turns it about a vertical axis and whose second one lifts the foot."""

    @property
    def heights(self) -> tuple[float, float]:
        """Return the lowest and the highest Z of the foot, in metres."""

    @property
    def rest_height(self) -> float:
        """Return Z of the foot unless a posture says otherwise."""

    def radius(self, lift: float) -> float:
        """Return the foot's distance from the first axis."""

    def ahead(self, lift: float) -> float:
        """Return the direction of the foot from that axis, from x', while the first joint is at 0."""

    def lifts_at(self, height_m: float) -> tuple[float, ...]:
        """Return the second joint's angles with the foot at a height; the same branches in the same order
        at every height. Raises InputError if there are none.
        """

    def fk(self, turn: ArrayLike, lift: ArrayLike) -> Floats:
        """Return the foot (..., 3) in the leg's frame."""


OVERSHOOT = 0.15
"""The maximum of u - 10u³ + 15u⁴ - 6u⁵, rounded up: how far a short swing overshoots, in units of v."""

SAME_RAD = 1e-9
"""Angles nearer than this are equal: rounding does not decide which of its lifts a leg uses."""


@dataclass(frozen=True, slots=True)
class LegStance:
    """How one leg of two joints stands: its mount, its lengths, its joint α, the angle of its second one.

    a turn about c, from above        A foot moves on a circle of radius ρ about its leg's axis of α, while
                                      the ground requires a circle about c. The foot needs the least
         F ● foot                     correction where the two circles touch: on the line from c through
          ╱                           the axis.
      A  ○ axis of α
        ╱                                 c = i v / ω        F = A + ρ (A - c) / |A - c|
       ╱
    c ×                               Of the two points at the distance ρ on that line, the outer one is
                                      taken, since a foot does not reach under the body. A straight walk has
                                      c at infinity: the line is across its way.
    """

    mount: Mount
    leg: TwoJointLeg
    joint: Joint
    lift: float
    raised: float = 0.0
    """The second joint's angle at the top of a swing."""

    @property
    def radius(self) -> float:
        """Return ρ, the foot's distance from the axis of α."""
        return self.leg.radius(self.lift)

    @property
    def axis(self) -> complex:
        """Return the axis of α in the body's frame."""
        return complex(self.mount.x, self.mount.y)

    @property
    def outward(self) -> complex:
        """Return the direction of the leg's y' axis in the body's frame."""
        return cmath.exp(1j * self.mount.heading) * (-1j if self.mount.mirrored else 1j)

    def direction(self, motion: BodyMotion) -> complex:
        """Return the unit vector from the axis to the foothold; straight out where c lies on the axis, and if
        the body does not move.
        """
        away = 1j * motion.step if motion.centre is None else self.axis - motion.centre
        if abs(away) < SAME_M:
            return self.outward
        # With a centre of rotation beyond the leg, the line runs through the body: the foot takes its other
        # end.
        unit = away / abs(away)
        return unit if (unit * self.outward.conjugate()).real >= 0 else -unit

    def bend(self, motion: BodyMotion) -> float:
        """Return the angle of α from its middle, from -π to π, with the foot in that direction."""
        # In the leg's frame, whose y' axis is 1j; a mirrored leg's frame is mirrored at that axis.
        local = self.direction(motion) / self.outward * 1j
        if self.mount.mirrored:
            local = -local.conjugate()
        return math.remainder(cmath.phase(local) - self.leg.ahead(self.lift) - self._middle, math.tau)

    def held_back(self, motion: BodyMotion, reach: float) -> float:
        """Return the angle by which the limits of α turn the foot, `reach` from the axis, off the line.

        The stance sweeps α by half of its range to both sides. A swing begins and ends with the speed of the
        stance and so goes beyond that, by less than `OVERSHOOT` of what the stance sweeps in a swing's time,
        and by the share `motion.beyond` of its way.
        """
        if not motion.moves:
            return 0.0
        foot, centre = reach * self.direction(motion), motion.centre
        # Seen from the body, the standing foot turns about the centre of rotation, but its leg turns about
        # another point, the axis of α: the sweep is the angle between its first and last place from there.
        if centre is None:
            first, last = (foot + side * motion.step * motion.duty / 2 for side in (1, -1))
        else:
            turned = cmath.exp(0.5j * motion.turn * motion.duty)
            first, last = (
                (self.axis + foot - centre) * turn + centre - self.axis
                for turn in (turned, turned.conjugate())
            )
        sweep = abs(cmath.phase(last / first))
        # Half of the sweep to each side, and the overshoots of the swing; the speed of the stance, in sweeps
        # per swing, is (1 - duty) / duty.
        reserve = sweep * (0.5 + OVERSHOOT * (1 - motion.duty) / motion.duty + motion.beyond)
        free = max(self.joint.upper - self._middle - reserve, 0.0)
        bend = self.bend(motion)
        return bend - min(max(bend, -free), free)

    def foothold(self, motion: BodyMotion, reach: float) -> complex:
        """Return where the foot is in the middle of its stance, `reach` from the axis.

        It is on the line from the centre of rotation, or as near to it as the limits of α allow.
        """
        back = self.held_back(motion, reach)
        # A mirrored leg's α turns the other way.
        turn = cmath.exp(1j * (back if self.mount.mirrored else -back))
        return self.axis + reach * self.direction(motion) * turn

    @property
    def _middle(self) -> float:
        """Return the middle of the range of α."""
        return (self.joint.lower + self.joint.upper) / 2


def least_bent(stances: Sequence[LegStance], motions: Sequence[BodyMotion]) -> LegStance:
    """Return, of the stances of one leg with different lifts, the one whose α stays nearest to its middle.

    If two are equal, the first is returned. One lift serves the whole walk: to change it the foot would have
    to pass the leg's full height, which is below the ground.
    """
    left = list(stances)
    # Straight ahead both lifts of a pantograph bend α alike; then the turns decide.
    for some in ([motion for motion in motions if motion.moves], [one for one in motions if one.turn]):
        bends = [max((abs(stance.bend(motion)) for motion in some), default=0.0) for stance in left]
        left = [stance for stance, bend in zip(left, bends, strict=True) if bend <= min(bends) + SAME_RAD]
    return left[0]


def circle_stance(
    leg: TwoJointLeg, arm: Arm, mounts: Sequence[Mount], posture: Posture, motions: Sequence[BodyMotion]
) -> CircleStance:
    """Return the stance of legs of two joints; each leg's lift is the one that suits these motions best.

    Raises InputError for a posture that they cannot take.
    """
    if posture.roll or posture.pitch or posture.yaw or posture.shift:
        raise InputError(
            "out-of-reach",
            "legs of two joints cannot tilt, turn or shift the body over its feet: each foot has one circle "
            "at a height, and stands where that follows the way best",
            hint='legs of three joints can: leg = "coxa-femur-tibia"',
        )
    height = posture.body_height
    if height is None:
        height = min(-leg.rest_height - mount.z for mount in mounts)
    return CircleStance(
        posture.stance_width,
        tuple(least_bent(_stances(leg, arm, mount, height, posture), motions) for mount in mounts),
    )


def _stances(leg: TwoJointLeg, arm: Arm, mount: Mount, height: float, posture: Posture) -> list[LegStance]:
    """Return the stances of one leg, within its joint's limits if there are any, the asked sign first."""
    foot = -height - mount.z
    try:
        # The outer lift may have no inner one at one of the two heights.
        lifts = list(zip(leg.lifts_at(foot), leg.lifts_at(foot + posture.lift), strict=False))
    except InputError as error:
        stands, lift = (f"{1000 * length:g} mm" for length in (-foot, posture.lift))
        low, high = (f"{1000 * -height:.4g}" for height in reversed(leg.heights))
        raise InputError(
            "out-of-reach",
            f"the legs cannot stand {stands} high and lift their feet by {lift}",
            hint=f"their feet are {low} to {high} mm below the body's joints",
        ) from error
    turn, lifting = arm.joints
    allowed = [pair for pair in lifts if all(lifting.allows(angle) for angle in pair)] or lifts
    allowed = allowed if posture.beta_sign >= 0 else allowed[::-1]
    return [LegStance(mount, leg, turn, lift, raised) for lift, raised in allowed]


@dataclass(frozen=True, slots=True)
class CircleStance:
    """Legs of two joints while the robot walks: the stance of each leg.

    The second joint raises a foot while the first moves it along a circle. Such a leg can reach a foothold
    only approximately: the foot is put in the direction of the foothold, and the leg's spring, or the ground,
    takes up the difference.
    """

    stance_width: float | None
    legs: tuple[LegStance, ...]

    @property
    def free(self) -> bool:
        """Return False: a standing foot stays only roughly where the body moves along."""
        return False

    def neutral(self, leg: int, motion: BodyMotion) -> complex:
        """Return where the foot is in the middle of its stance.

        A straight stance of length c is nearest to the circle of radius ρ with its middle c² / 16ρ inside,
        one along a curve of radius R about the same side c² / 16 (1/ρ - 1/R); in a turn on the spot the foot
        stays on the circle.
        """
        stance = self.legs[leg]
        out = self._reach(stance, motion)
        if self.stance_width is not None or not motion.step:
            return stance.foothold(motion, out)
        centre = motion.centre
        if centre is None:
            inside = (abs(motion.step) * motion.duty) ** 2 / (16 * stance.radius)
            return stance.foothold(motion, out - inside)
        way = stance.foothold(motion, out) - centre
        length = abs(way) * abs(motion.turn) * motion.duty
        same_side = math.copysign(1.0, (way * stance.direction(motion).conjugate()).real)
        apart = 1 / stance.radius - same_side / max(abs(way), SAME_M)
        return stance.foothold(motion, out - length**2 * apart / 16)

    def held_back(self, leg: int, motion: BodyMotion) -> float:
        """Return the angle by which the limits of α keep the foot off the line from the centre."""
        stance = self.legs[leg]
        return abs(stance.held_back(motion, self._reach(stance, motion)))

    def _reach(self, stance: LegStance, motion: BodyMotion) -> float:
        """Return the distance of a foothold from the axis of α: ρ, or as required by the stance width."""
        if self.stance_width is None:
            return stance.radius
        sideways = math.cos(stance.mount.heading)
        if not motion.turn:
            sideways = max(sideways, abs(stance.direction(motion).imag))
        return (self.stance_width / 2 - abs(stance.mount.y)) / sideways

    def angles(self, leg: int, footholds: Complexes) -> Floats:
        """Return the angles (n, 2): α turns the foot towards its foothold, the other is the stance's."""
        stance = self.legs[leg]
        body = np.stack([footholds.real, footholds.imag, np.full(len(footholds), stance.mount.z)], axis=1)
        local = to_leg(stance.mount, body)
        alpha = np.arctan2(local[:, 1], local[:, 0]) - stance.leg.ahead(stance.lift)
        return np.stack([alpha, np.full(len(footholds), stance.lift)], axis=1)

    def lifted(self, leg: int, angles: Floats, share: Floats) -> Floats:
        """Return the angles (n, 2) with the foot raised by a share (n,) of the way to a swing's top."""
        stance = self.legs[leg]
        lift = stance.lift + (stance.raised - stance.lift) * share
        return np.stack([angles[:, 0], lift], axis=1)

    def feet(self, leg: int, angles: Floats) -> Floats:
        """Return the feet (n, 3) in the body frame."""
        stance = self.legs[leg]
        return to_body(stance.mount, stance.leg.fk(angles[:, 0], angles[:, 1]))


@dataclass(frozen=True, slots=True)
class FreeStance:
    """Legs of three joints: a foot stands exactly on its foothold, the body level or tilted above it.

    Footholds and feet are in the body's level frame. `branches`: which solution each leg uses.
    """

    leg: CoxaFemurTibia
    mounts: tuple[Mount, ...]
    posture: Posture
    height: float
    branches: tuple[int, ...]

    @property
    def free(self) -> bool:
        """Return True."""
        return True

    def neutral(self, leg: int, motion: BodyMotion) -> complex:
        """Return where the foot is in the middle of its stance: straight out, below the knee of a level
        femur, or where the stance width has it.
        """
        return free_foothold(self.leg, self.mounts[leg], self.posture)

    def held_back(self, leg: int, motion: BodyMotion) -> float:
        """Return 0: nothing holds these feet back."""
        return 0.0

    def angles(self, leg: int, footholds: Complexes) -> Floats:
        """Return the angles (n, 3) that put the foot on its footholds. Raises InputError beyond its reach."""
        ground = np.full(len(footholds), -self.height)
        return self._solve(leg, np.stack([footholds.real, footholds.imag, ground], axis=1))

    def lifted(self, leg: int, angles: Floats, share: Floats) -> Floats:
        """Return the angles (n, 3) with the foot at a share (n,) of the lift above where it is."""
        feet = self.feet(leg, angles)
        feet[:, 2] = -self.height + self.posture.lift * share
        return self._solve(leg, feet)

    def feet(self, leg: int, angles: Floats) -> Floats:
        """Return the feet (n, 3) in the body's level frame."""
        return np.asarray(to_body(self.mounts[leg], self.leg.fk(angles)) @ tilt(self.posture).T)

    def _solve(self, leg: int, feet: Floats) -> Floats:
        mount = self.mounts[leg]
        angles = self.leg.solve(to_leg(mount, feet @ tilt(self.posture)))[:, self.branches[leg], :]
        lost = np.flatnonzero(np.isnan(angles).any(axis=1))
        if len(lost):
            x, y, z = (1000 * feet[lost[0]]).tolist()
            raise InputError(
                "out-of-reach",
                f"the foot of {mount.name} cannot reach ({x:z.1f}, {y:z.1f}, {z:z.1f}) mm below the body",
                hint="shorten the stride or the turn, lower the body, or bring the feet nearer "
                "(stance_width_mm)",
            )
        return angles


def level_centre(posture: Posture, centre: tuple[float, float, float]) -> tuple[float, float]:
    """Return where a centre of mass in the body's frame is over the ground, from the body's origin."""
    x, y, _ = (tilt(posture) @ np.array(centre)).tolist()
    return x, y


def tilt(posture: Posture) -> Floats:
    """Return the rotation (3, 3) from the body's frame to its level one: Rot(y, pitch) Rot(x, roll)."""
    return np.asarray(rot("y", posture.pitch) @ rot("x", posture.roll))


def free_foothold(leg: CoxaFemurTibia, mount: Mount, posture: Posture) -> complex:
    """Return where a leg of three joints stands, under a body that is shifted and turned as asked."""
    out = cmath.exp(1j * mount.heading) * (-1j if mount.mirrored else 1j)
    reach = leg.coxa + leg.femur
    if posture.stance_width is not None and abs(out.imag) > MIN_SIDEWAYS:
        reach = (posture.stance_width / 2 - abs(mount.y)) / abs(out.imag)
    foothold = complex(mount.x, mount.y) + reach * out
    return (foothold - posture.shift) * cmath.exp(-1j * posture.yaw)


MIN_SIDEWAYS = 0.3
"""The share of a leg's direction across the body from which a stance width concerns it."""


def free_stance(leg: CoxaFemurTibia, arm: Arm, mounts: Sequence[Mount], posture: Posture) -> FreeStance:
    """Return the stance of legs of three joints, the knee up where their limits allow it.

    Raises InputError for a posture that they cannot take.
    """
    height = posture.body_height
    if height is None:
        height = min(leg.tibia - mount.z for mount in mounts)
    branches = []
    for mount in mounts:
        here = free_foothold(leg, mount, posture)
        feet = np.array([[here.real, here.imag, -height + rise] for rise in (0.0, posture.lift)])
        solved = leg.solve(to_leg(mount, feet @ tilt(posture)))
        within = np.array(
            [
                [
                    all(joint.allows(angle) for joint, angle in zip(arm.joints, each, strict=True))
                    for each in branch
                ]
                for branch in solved.swapaxes(0, 1).tolist()
            ]
        ).all(axis=1)
        if np.isnan(solved[:, 0]).any():
            far = math.hypot(*(to_leg(mount, feet @ tilt(posture))[0] - [0, leg.coxa, 0]))
            raise InputError(
                "out-of-reach",
                f"the leg {mount.name} cannot stand {1000 * height:g} mm high and lift its foot by "
                f"{1000 * posture.lift:g} mm",
                hint=f"femur and tibia reach {1000 * abs(leg.femur - leg.tibia):g} to "
                f"{1000 * (leg.femur + leg.tibia):g} mm, the foot is {1000 * far:.1f} mm from the femur's "
                "axis",
            )
        branches.append(int(np.argmax(within)))
    return FreeStance(leg, tuple(mounts), posture, height, tuple(branches))
