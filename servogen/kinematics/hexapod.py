"""The kind `hexapod`: a body on identical legs of two joints, six of them or any other number.

In: its file; angles (..., legs, 2) as (α, β). Out: `Hexapod`; feet (..., legs, 3) in metres, body frame, in
the mounts' order; the legs' angles for footholds while it walks.

         x forward               left legs: the leg's frame is the body's, turned by the mount's heading
    L1 ──┼── R1                  right legs: its mirror image in the plane y = 0, so that equal angles
    L2 ──┼── R2   y to the left  move both feet alike, forward and backward
    L3 ──┴── R3
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from servogen.errors import InputError, did_you_mean
from servogen.kinematics.arm import arm_details
from servogen.kinematics.leg import Leg
from servogen.kinematics.mobility import Mobility, manoeuvrability, of_arm, standing
from servogen.kinematics.protocol import Answer, BodyMotion, Posture, RobotKind
from servogen.kinematics.transforms import Complexes, Floats, to_body, to_leg
from servogen.robot.arm_file import (
    MAX_GRAMS,
    Find,
    LengthsMm,
    Name,
    RobotKeys,
    check_unique,
    find_robot,
    kilograms,
    with_lengths,
)
from servogen.robot.model import Arm, Dimensions, Joint, Limb, Mount
from servogen.toml.file import Document, Table

SAME_M = 1e-9
"""Points closer than this are one: floating-point noise."""


@dataclass(frozen=True, slots=True)
class Hexapod:
    """A body with identical legs; `centre_of_mass` is (x, y, z) in the body frame, in metres."""

    kind: ClassVar[str] = "hexapod"

    name: str
    title: str
    leg: Arm
    mounts: tuple[Mount, ...]
    centre_of_mass: tuple[float, float, float] = (0.0, 0.0, 0.0)
    dimensions: Dimensions = "user"
    source: str = ""
    mass: float | None = None
    """The mass of the whole robot, kg; None: not stated."""
    leg_masses: tuple[tuple[str, float], ...] = ()
    """The stated masses of the parts of each leg, kg: coxa (A to B), thigh (B to C), foot (C to F)."""
    spring: float | None = None
    """The stiffness of the legs' springs E', N/m; None: not stated."""

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """Return the legs, in the order of their mounts."""
        return tuple(Limb(mount.name, "foot", self.leg, mount) for mount in self.mounts)

    @property
    def lifting_joint(self) -> str:
        """Return the name of β; a vertical force has no moment about the vertical axis of α."""
        return self.leg.joints[1].name

    @property
    def sidesteps(self) -> bool:
        """Return False: legs of two joints swing forward and lift."""
        return False

    def mount(self, name: str) -> Mount:
        """Return the mount of the leg of that name. Raises InputError if there is none."""
        for mount in self.mounts:
            if mount.name == name:
                return mount
        raise InputError(
            "unknown-name",
            f"{self.name} has no leg '{name}'",
            hint=did_you_mean(name, [mount.name for mount in self.mounts]),
        )

    def with_leg(self, name: str) -> Hexapod:
        """Return the robot with that leg only: the same walk, on the bench."""
        return replace(self, mounts=(self.mount(name),))

    def stance(self, posture: Posture, motions: Sequence[BodyMotion]) -> HexapodStance:
        """Return the stance of the legs in a posture; β of each leg has the sign that suits these motions
        best.

        Raises InputError for a posture that they cannot take.
        """
        leg = Leg.of(self.leg.length)
        heights = {mount.z for mount in self.mounts}
        if len(heights) > 1:
            raise InputError(
                "wrong-robot-kind",
                f"{self.name}'s legs are mounted at different heights: one β cannot serve them all",
            )
        foot = -leg.bc - leg.df if posture.body_height is None else -posture.body_height - heights.pop()
        if posture.lift <= 0:
            raise InputError(
                "out-of-range", f"a lift of {1000 * posture.lift:g} mm does not take the foot off the ground"
            )
        try:
            beta, lifted = leg.beta_at(foot), leg.beta_at(foot + posture.lift)
        except InputError as error:
            stands, lifts = (f"{1000 * length:g} mm" for length in (-foot, posture.lift))
            low, high = (f"{1000 * length:g}" for length in (leg.df - leg.bc, leg.df + leg.bc))
            raise InputError(
                "out-of-reach",
                f"the legs cannot stand {stands} high and lift their feet by {lifts}",
                hint=f"their feet are {low} to {high} mm below the body's joints",
            ) from error
        sign = 1 if posture.beta_sign >= 0 else -1
        legs = tuple(
            least_bent(
                [
                    LegStance(mount, leg, self.leg.joints[0], math.copysign(beta, side))
                    for side in (sign, -sign)
                ],
                motions,
            )
            for mount in self.mounts
        )
        return HexapodStance(leg, posture.stance_width, legs, lifted)

    def torques(self, angles: Floats, forces: Floats) -> Floats:
        """Return the torque (frames, legs) at each β under vertical forces (frames, legs) at the feet."""
        return np.abs(Leg.of(self.leg.length).torque(angles[..., 1], forces))


OVERSHOOT = 0.15
"""The maximum of u - 10u³ + 15u⁴ - 6u⁵, rounded up: how far a short swing overshoots, in units of v."""

SAME_RAD = 1e-9
"""Angles nearer than this are equal: rounding does not decide which sign of β a leg uses."""


@dataclass(frozen=True, slots=True)
class LegStance:
    """How one leg stands: its mount, its lengths, its joint α, and β with its sign.

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
    leg: Leg
    joint: Joint
    beta: float

    @property
    def radius(self) -> float:
        """Return ρ, the foot's distance from the axis of α."""
        return math.hypot(self.leg.r, self.leg.bc * math.sin(self.beta))

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
        ahead = math.atan2(self.leg.r, -self.leg.bc * math.sin(self.beta))
        return math.remainder(cmath.phase(local) - ahead - self._middle, math.tau)

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
    """Return, of the stances of one leg with different signs of β, the one whose α stays nearest to its
    middle.

    If two are equal, the first is returned. One sign serves the whole walk: to change it the foot would have
    to pass the leg's full height, which is below the ground.
    """
    left = list(stances)
    # Straight ahead both signs bend α alike; then the turns decide.
    for some in ([motion for motion in motions if motion.moves], [one for one in motions if one.turn]):
        bends = [max((abs(stance.bend(motion)) for motion in some), default=0.0) for stance in left]
        left = [stance for stance, bend in zip(left, bends, strict=True) if bend <= min(bends) + SAME_RAD]
    return left[0]


@dataclass(frozen=True, slots=True)
class HexapodStance:
    """The legs while the robot walks: the stance of each leg, and |β| at the top of a swing.

    β raises a foot while α moves it along a circle. A leg of two joints can reach a foothold only
    approximately: the foot is put in the direction of the foothold, and the leg's spring takes up the
    difference.
    """

    leg: Leg
    stance_width: float | None
    legs: tuple[LegStance, ...]
    raised_beta: float

    def neutral(self, leg: int, motion: BodyMotion) -> complex:
        """Return where the foot is in the middle of its stance.

        A straight stance of length c is nearest to the circle of radius ρ with its middle c² / 16ρ inside.
        """
        stance = self.legs[leg]
        out = self._reach(stance, motion)
        if self.stance_width is None and not motion.turn:
            out -= (abs(motion.step) * motion.duty) ** 2 / (16 * stance.radius)
        return stance.foothold(motion, out)

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
        """Return the angles (n, 2): α turns the foot towards its foothold, β is that of the stance."""
        mount, beta = self.legs[leg].mount, self.legs[leg].beta
        body = np.stack([footholds.real, footholds.imag, np.full(len(footholds), mount.z)], axis=1)
        local = to_leg(mount, body)
        s = self.leg.bc * math.sin(beta)
        alpha = np.arctan2(local[:, 1], local[:, 0]) - math.atan2(self.leg.r, -s)
        return np.stack([alpha, np.full(len(footholds), beta)], axis=1)

    def lifted(self, leg: int, angles: Floats, share: Floats) -> Floats:
        """Return the angles (n, 2) with β moved by a share (n,) of the distance to the top of the swing."""
        stands = self.legs[leg].beta
        beta = stands + (math.copysign(self.raised_beta, stands) - stands) * share
        return np.stack([angles[:, 0], beta], axis=1)

    def feet(self, leg: int, angles: Floats) -> Floats:
        """Return the feet (n, 3) in the body frame."""
        return to_body(self.legs[leg].mount, self.leg.fk(angles[:, 0], angles[:, 1]))


def feet(robot: Hexapod, angles: ArrayLike) -> Floats:
    """Return the feet (..., legs, 3) in the body frame for angles (..., legs, 2)."""
    angles = np.asarray(angles, float)
    leg = Leg.of(robot.leg.length)
    points = leg.fk(angles[..., 0], angles[..., 1])
    placed = [to_body(mount, points[..., index, :]) for index, mount in enumerate(robot.mounts)]
    return np.stack(placed, axis=-2)


def angles_of(robot: Hexapod, points: ArrayLike) -> Floats:
    """Return all angles (..., legs, 2, 2) for feet (..., legs, 3) in the body frame. Raises `Unreachable`."""
    points = np.asarray(points, float)
    leg = Leg.of(robot.leg.length)
    angles = [leg.ik(to_leg(mount, points[..., index, :])) for index, mount in enumerate(robot.mounts)]
    return np.stack(angles, axis=-3)


class MountTable(Table):
    """One [[mount]]: where a leg is on the body, and its direction."""

    name: Name
    x_mm: float
    y_mm: float
    z_mm: float = 0.0
    heading_deg: float = 0.0
    mirrored: bool = False


class HexapodTable(RobotKeys, Table):
    """The file of a hexapod."""

    like: str | None = None
    leg: str = "leg"
    lengths_mm: LengthsMm = Field(default_factory=dict)
    mount: tuple[MountTable, ...] = ()
    centre_of_mass_mm: tuple[float, float, float] | None = None
    """By default that of `like`, else the origin of the body's frame."""
    mass_g: float | None = Field(default=None, gt=0, le=MAX_GRAMS)
    leg_mass_g: dict[Literal["coxa", "thigh", "foot"], Annotated[float, Field(gt=0, le=MAX_GRAMS)]] = Field(
        default_factory=dict
    )
    spring_n_m: float | None = Field(default=None, gt=0, le=1e7)


def _read(document: Document, table: HexapodTable, find: Find) -> Hexapod:
    """Return the hexapod of a file: its own leg and mounts, or those of `like`. Raises InputError."""
    key = "like" if table.like else "leg"
    template = find_robot(document, key, table.like or table.leg, find)
    model = template if isinstance(template, Hexapod) else None
    leg = template.leg if isinstance(template, Hexapod) else template
    if not isinstance(leg, Arm) or leg.closed_form != "leg":
        raise document.error(
            "wrong-robot-kind",
            (key,),
            f"'{template.name}' is not a leg",
            'a two-joint leg, such as leg = "leg"',
        )
    mounts = tuple(_mount(mount) for mount in table.mount) or (model.mounts if model else ())
    if not mounts:
        raise document.error(
            "missing-key", (), "a hexapod needs its legs", "add [[mount]] tables: name, x_mm, y_mm"
        )
    check_unique(document, "mount", [mount.name for mount in mounts])
    return Hexapod(
        name=table.name,
        title=table.title or (model.title if model else ""),
        leg=_leg(document, table, leg),
        mounts=mounts,
        centre_of_mass=_centre_of_mass(table, model),
        dimensions=model.dimensions if model and not (table.lengths_mm or table.mount) else table.dimensions,
        source=table.source or (model.source if model else ""),
        mass=kilograms(table.mass_g, model.mass if model else None),
        leg_masses=tuple((part, grams / 1000) for part, grams in table.leg_mass_g.items())
        or (model.leg_masses if model else ()),
        spring=table.spring_n_m if table.spring_n_m is not None else model.spring if model else None,
    )


def _centre_of_mass(table: HexapodTable, model: Hexapod | None) -> tuple[float, float, float]:
    if table.centre_of_mass_mm is not None:
        x, y, z = (value / 1000 for value in table.centre_of_mass_mm)
        return x, y, z
    return model.centre_of_mass if model else (0.0, 0.0, 0.0)


def _mount(table: MountTable) -> Mount:
    x, y, z = (value / 1000 for value in (table.x_mm, table.y_mm, table.z_mm))
    return Mount(
        name=table.name, x=x, y=y, z=z, heading=math.radians(table.heading_deg), mirrored=table.mirrored
    )


def _leg(document: Document, table: HexapodTable, leg: Arm) -> Arm:
    """Return the leg with the lengths of the file. Raises InputError if its thigh or its reach is 0."""
    changed = with_lengths(document, table.lengths_mm, leg)
    if not changed.length["bc"]:
        raise document.error("bad-length", ("lengths_mm", "bc"), "bc is 0: β would lift nothing")
    if not changed.length["ab"] + changed.length["cd"]:
        raise document.error(
            "bad-length", ("lengths_mm", "ab"), "ab and cd are both 0: the leg would have no length"
        )
    return changed


def _details(robot: Hexapod) -> Answer:
    mounts = [
        {
            "name": mount.name,
            "position_m": [mount.x, mount.y, mount.z],
            "heading_rad": mount.heading,
            "mirrored": mount.mirrored,
        }
        for mount in robot.mounts
    ]
    return {
        "mounts": mounts,
        "centre_of_mass_m": list(robot.centre_of_mass),
        "leg": arm_details(robot.leg),
    }


def _mobility(robot: Hexapod) -> Mobility:
    legs, leg = len(robot.mounts), of_arm(robot.leg)
    mobility = legs * leg.mobility
    return Mobility(
        elements=1 + legs * (leg.elements - 1),
        joints=leg.joints * legs,
        passive=leg.passive * legs,
        mobility=mobility,
        manoeuvrability=manoeuvrability(mobility),
        note=f"{legs} legs of {leg.mobility}; standing on three, the body has {standing(3, springs=False)},"
        f" with the spring joints {standing(3, springs=True)}",
    )


HEXAPOD = RobotKind(
    name=Hexapod.kind,
    table=HexapodTable,
    read=_read,
    details=_details,
    mobility=_mobility,
)
