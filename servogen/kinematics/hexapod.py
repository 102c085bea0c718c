"""The kind `hexapod`: a body on identical legs of two or three joints, six of them or any other number.

In: its file; angles (..., legs, k). Out: `Hexapod`; feet (..., legs, 3) in metres, body frame, in the
mounts' order; the legs' stance while it walks. `leg_kinds` has what differs between the kinds of legs.

         x forward               left legs: the leg's frame is the body's, turned by the mount's heading
    L1 ──┼── R1                  right legs: its mirror image in the plane y = 0, so that equal angles
    L2 ──┼── R2   y to the left  move both feet alike, forward and backward
    L3 ──┴── R3
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from servogen.errors import InputError, did_you_mean
from servogen.kinematics.arm import arm_details
from servogen.kinematics.forward import fk_position
from servogen.kinematics.leg_kinds import LEG_KINDS, LegKind
from servogen.kinematics.mobility import Mobility, manoeuvrability, of_arm, standing
from servogen.kinematics.protocol import Answer, BodyMotion, Posture, RobotKind, Stance
from servogen.kinematics.transforms import Floats, to_body
from servogen.robot.arm_file import (
    MAX_GRAMS,
    Find,
    JointTable,
    LengthsMm,
    Name,
    RobotKeys,
    check_unique,
    find_robot,
    kilograms,
    with_joints,
    with_lengths,
)
from servogen.robot.model import Arm, Dimensions, Limb, Mount
from servogen.toml.file import Document, Table


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
    """The stated masses of the parts of each leg, kg, by their names in `LegKind.parts`."""
    spring: float | None = None
    """The stiffness of the legs' springs E', N/m; None: not stated."""

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """Return the legs, in the order of their mounts."""
        return tuple(Limb(mount.name, "foot", self.leg, mount) for mount in self.mounts)

    @property
    def leg_kind(self) -> LegKind:
        """Return the kind of the legs."""
        return LEG_KINDS[self.leg.closed_form or ""]

    @property
    def lifting_joint(self) -> str:
        """Return the name of the joint that carries the weight: that of the vertical axis has no moment."""
        return self.leg.joints[self.leg_kind.lifting].name

    @property
    def sidesteps(self) -> bool:
        """Return whether the legs can step sideways: those of two joints swing forward and lift."""
        return self.leg_kind.sidesteps

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

    def stance(self, posture: Posture, motions: Sequence[BodyMotion]) -> Stance:
        """Return the stance of the legs in a posture, the one that suits these motions best.

        Raises InputError for a posture that they cannot take.
        """
        if posture.lift <= 0:
            raise InputError(
                "out-of-range", f"a lift of {1000 * posture.lift:g} mm does not take the foot off the ground"
            )
        return self.leg_kind.stance(self.leg, self.mounts, posture, motions)

    def torques(self, angles: Floats, forces: Floats) -> Floats:
        """Return the torque (frames, legs) at each lifting joint under vertical forces (frames, legs) at the
        feet.
        """
        return np.abs(self.leg_kind.torque(self.leg.length, angles, forces))

    def corners(self, leg: int, angles: Floats) -> Floats:
        """Return the corners (n, corners, 3) of a leg's centre line in the body frame for angles (n, k)."""
        return to_body(self.mounts[leg], self.leg_kind.corners(self.leg, angles))


def feet(robot: Hexapod, angles: ArrayLike) -> Floats:
    """Return the feet (..., legs, 3) in the body frame for angles (..., legs, k)."""
    points = fk_position(robot.leg, np.asarray(angles, float))
    placed = [to_body(mount, points[..., index, :]) for index, mount in enumerate(robot.mounts)]
    return np.stack(placed, axis=-2)


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
    leg: str | None = None
    """The kind of its legs, one of `LEG_KINDS`; needed without `like`."""
    lengths_mm: LengthsMm = Field(default_factory=dict)
    joint: tuple[JointTable, ...] = ()
    """The limits of each leg's joints, where they are not the kind's."""
    mount: tuple[MountTable, ...] = ()
    centre_of_mass_mm: tuple[float, float, float] | None = None
    """By default that of `like`, else the origin of the body's frame."""
    mass_g: float | None = Field(default=None, gt=0, le=MAX_GRAMS)
    leg_mass_g: dict[str, Annotated[float, Field(gt=0, le=MAX_GRAMS)]] = Field(default_factory=dict)
    """The masses of the parts of each leg, by their names in `LegKind.parts`."""
    spring_n_m: float | None = Field(default=None, gt=0, le=1e7)


def _read(document: Document, table: HexapodTable, find: Find) -> Hexapod:
    """Return the hexapod of a file: its own legs and mounts, or those of `like`. Raises InputError."""
    model, leg = _model(document, table, find)
    mounts = tuple(_mount(mount) for mount in table.mount) or (model.mounts if model else ())
    if not mounts:
        raise document.error(
            "missing-key", (), "a hexapod needs its legs", "add [[mount]] tables: name, x_mm, y_mm"
        )
    check_unique(document, "mount", [mount.name for mount in mounts])
    parts = LEG_KINDS[leg.closed_form or ""].parts
    for part in table.leg_mass_g:
        said = f"a leg of the kind '{leg.closed_form}' has no part '{part}'"
        document.check_known("unknown-name", ("leg_mass_g", part), part, parts, said)
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


def _model(document: Document, table: HexapodTable, find: Find) -> tuple[Hexapod | None, Arm]:
    """Return the robot of `like`, if there is one, and the legs. Raises InputError."""
    kinds = 'the lab\'s is leg = "pantograph"; others: ' + ", ".join(
        f'leg = "{name}"' for name in LEG_KINDS if name != "pantograph"
    )
    if table.like is not None:
        model = find_robot(document, "like", table.like, find)
        if not isinstance(model, Hexapod):
            raise document.error(
                "wrong-robot-kind", ("like",), f"'{model.name}' has no legs", "name a robot that walks"
            )
        if table.leg not in (None, model.leg.closed_form):
            raise document.error(
                "conflicting-keys",
                ("leg",),
                f"the legs of '{model.name}' (like) are '{model.leg.closed_form}'",
                "remove one of the two",
            )
        return model, model.leg
    if table.leg is None:
        raise document.error("missing-key", (), "'leg' is missing: which kind of legs it has", kinds)
    if table.leg not in LEG_KINDS:
        raise document.error("not-allowed", ("leg",), f"'{table.leg}' is not a kind of leg", kinds)
    leg = find_robot(document, "leg", table.leg, find)
    assert isinstance(leg, Arm)
    return None, leg


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
    """Return the leg with the lengths and joints of the file. Raises InputError for lengths without a leg."""
    changed = with_joints(document, table.joint, with_lengths(document, table.lengths_mm, leg))
    wrong = LEG_KINDS[leg.closed_form or ""].wrong(changed.length)
    if wrong is not None:
        raise document.error("bad-length", ("lengths_mm", wrong[0]), wrong[1])
    return changed


def _details(robot: Hexapod) -> Answer:
    mounts = [
        {
            "name": mount.name,
            "position_m": [mount.x, mount.y, mount.z],
            "heading_deg": math.degrees(mount.heading),
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
    mobility, driven = legs * leg.mobility, len(robot.leg.joints)
    note = f"{legs} legs of {leg.mobility}; standing on three, the body has {standing(3, driven)}"
    if robot.leg.closed_form == "pantograph":
        note += f", with the spring joints {standing(3, driven + 1)}"
    return Mobility(
        elements=1 + legs * (leg.elements - 1),
        joints=leg.joints * legs,
        passive=leg.passive * legs,
        mobility=mobility,
        manoeuvrability=manoeuvrability(mobility),
        note=note,
    )


HEXAPOD = RobotKind(
    name=Hexapod.kind,
    table=HexapodTable,
    read=_read,
    details=_details,
    mobility=_mobility,
)
