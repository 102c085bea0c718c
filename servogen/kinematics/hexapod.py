"""The kind `hexapod`: a body on identical legs of two joints, six of them or any other number.

In: its file; angles (..., legs, 2) as (α, β). Out: `Hexapod`; feet (..., legs, 3) in metres, body frame, in
the mounts' order; the legs' angles for footholds while it walks.

         x forward               left legs: the leg's frame is the body's, turned by the mount's heading
    L1 ──┼── R1                  right legs: its mirror image in the plane y = 0, so that equal angles
    L2 ──┼── R2   y to the left  move both feet alike, forward and backward
    L3 ──┴── R3
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from servogen.errors import InputError, did_you_mean
from servogen.kinematics.arm import arm_details
from servogen.kinematics.leg import Leg
from servogen.kinematics.mobility import Mobility, manoeuvrability, of_arm, standing
from servogen.kinematics.protocol import Answer, Kind, Posture
from servogen.kinematics.transforms import Complexes, Floats, to_body, to_leg
from servogen.robot.arm_file import (
    MAX_GRAMS,
    Find,
    LengthsMm,
    Name,
    RobotTable,
    check_unique,
    find_robot,
    kilograms,
    with_lengths,
)
from servogen.robot.model import Arm, Dimensions, Limb, Mount
from servogen.toml.file import Document, Table

SAME_M = 1e-9
"""A height nearer than this to the lowest is the lowest: what floating point adds."""


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
    """Of the whole robot, kg; None: not stated."""

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
            "unknown-leg",
            f"{self.name} has no leg '{name}'",
            hint=did_you_mean(name, [mount.name for mount in self.mounts]),
        )

    def with_leg(self, name: str) -> Hexapod:
        """Return the robot with that leg only: the same walk, on the bench."""
        return replace(self, mounts=(self.mount(name),))

    def stance(self, posture: Posture) -> HexapodStance:
        """Return how the legs stand in a posture. Raises InputError for one that they cannot take."""
        leg = Leg.of(self.leg.length)
        heights = {mount.z for mount in self.mounts}
        if len(heights) > 1:
            raise InputError(
                "mounting-heights",
                f"{self.name}'s legs are mounted at different heights: one β cannot serve them all",
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
            low, high = (f"{1000 * length:g}" for length in (leg.df - leg.bc, leg.df + leg.bc))
            raise InputError(
                "out-of-reach",
                f"the legs cannot stand {stands} high and lift their feet by {lifts}",
                hint=f"their feet are {low} to {high} mm below the body's joints",
            ) from error
        sign = 1 if posture.beta_sign >= 0 else -1
        return HexapodStance(self, leg, posture.stance_width, sign * beta, sign * lifted)

    def torques(self, angles: Floats, forces: Floats) -> Floats:
        """Return the torque (frames, legs) at each β under vertical forces (frames, legs) at the feet."""
        return np.abs(Leg.of(self.leg.length).torque(angles[..., 1], forces))


@dataclass(frozen=True, slots=True)
class HexapodStance:
    """The legs while the robot walks: `beta` of the stance, and `lifted`, that at the top of a swing.

    β raises a foot while α moves it along a circle. A leg of two joints reaches a foothold only roughly: the
    foot is put in its direction, and the leg's spring gives the rest.
    """

    robot: Hexapod
    leg: Leg
    stance_width: float | None
    beta: float
    raised_beta: float

    def neutral(self, leg: int, stroke: float) -> complex:
        """Return where the foot is in the middle of its stance.

        A straight stance of length c is nearest to the circle of radius ρ with its middle c² / 16ρ inside.
        """
        mount = self.robot.mounts[leg]
        rho = math.hypot(self.leg.r, self.leg.bc * math.sin(self.beta))
        out = rho - stroke**2 / (16 * rho)
        if self.stance_width is not None:
            out = (self.stance_width / 2 - abs(mount.y)) / math.cos(mount.heading)
        point = to_body(mount, np.array([0.0, out, 0.0]))
        return complex(point[0], point[1])

    def angles(self, leg: int, footholds: Complexes) -> Floats:
        """Return the angles (n, 2): α turns the foot towards its foothold, β is that of the stance."""
        mount = self.robot.mounts[leg]
        body = np.stack([footholds.real, footholds.imag, np.full(len(footholds), mount.z)], axis=1)
        local = to_leg(mount, body)
        s = self.leg.bc * math.sin(self.beta)
        alpha = np.arctan2(local[:, 1], local[:, 0]) - math.atan2(self.leg.r, -s)
        return np.stack([alpha, np.full(len(footholds), self.beta)], axis=1)

    def lifted(self, leg: int, angles: Floats, share: Floats) -> Floats:
        """Return the angles (n, 2) with β moved by a share (n,) of its way to the top of the swing."""
        beta = self.beta + (self.raised_beta - self.beta) * share
        return np.stack([angles[:, 0], beta], axis=1)

    def feet(self, leg: int, angles: Floats) -> Floats:
        """Return the feet (n, 3) in the body frame."""
        return to_body(self.robot.mounts[leg], self.leg.fk(angles[:, 0], angles[:, 1]))


def _beta_at(leg: Leg, height: float) -> float:
    """Return `leg.beta_at(height)`; a height that is the lowest but for floating point is the lowest."""
    return 0.0 if abs(height + leg.bc + leg.df) < SAME_M else leg.beta_at(height)


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
    found = [leg.ik(to_leg(mount, points[..., index, :])) for index, mount in enumerate(robot.mounts)]
    return np.stack(found, axis=-3)


class MountTable(Table):
    """One [[mount]]: where a leg is on the body, and its direction."""

    name: Name
    x_mm: float
    y_mm: float
    z_mm: float = 0.0
    heading_deg: float = 0.0
    mirrored: bool = False


class HexapodTable(RobotTable):
    """The file of a hexapod."""

    like: str | None = None
    leg: str = "leg"
    lengths_mm: LengthsMm = Field(default_factory=dict)
    mount: tuple[MountTable, ...] = ()
    centre_of_mass_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass_g: float | None = Field(default=None, gt=0, le=MAX_GRAMS)


def _read(document: Document, table: HexapodTable, find: Find) -> Hexapod:
    key = "like" if table.like else "leg"
    found = find_robot(document, key, table.like or table.leg, find)
    model = found if isinstance(found, Hexapod) else None
    leg = found.leg if isinstance(found, Hexapod) else found
    if not isinstance(leg, Arm) or leg.closed_form != "leg":
        raise document.error(
            "wrong-robot-kind", (key,), f"'{found.name}' is not a leg", 'a two-joint leg, such as leg = "leg"'
        )
    mounts = tuple(_mount(mount) for mount in table.mount) or (model.mounts if model else ())
    if not mounts:
        raise document.error(
            "missing-key", (), "a hexapod needs its legs", "add [[mount]] tables: name, x_mm, y_mm"
        )
    check_unique(document, "mount", [mount.name for mount in mounts])
    x, y, z = (value / 1000 for value in table.centre_of_mass_mm)
    return Hexapod(
        name=table.name,
        title=table.title,
        leg=_leg(document, table, leg),
        mounts=mounts,
        centre_of_mass=(x, y, z),
        dimensions=table.dimensions,
        source=table.source,
        mass=kilograms(table.mass_g, model.mass if model else None),
    )


def _mount(table: MountTable) -> Mount:
    x, y, z = (value / 1000 for value in (table.x_mm, table.y_mm, table.z_mm))
    return Mount(table.name, x, y, z, math.radians(table.heading_deg), table.mirrored)


def _leg(document: Document, table: HexapodTable, leg: Arm) -> Arm:
    """Return the leg with the lengths of the file, of which its thigh and its reach must not be 0."""
    changed = with_lengths(document, table.lengths_mm, leg)
    if not changed.length["bc"]:
        raise document.error("bad-length", ("lengths_mm", "bc"), "bc is 0: β would lift nothing")
    if not changed.length["ab"] + changed.length["cd"]:
        raise document.error("bad-length", ("lengths_mm", "ab"), "ab and cd are both 0: a leg has a reach")
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


HEXAPOD = Kind(
    name=Hexapod.kind,
    table=HexapodTable,
    read=_read,
    details=_details,
    mobility=_mobility,
)
