"""The kind `dog`: a body on four legs of three joints each, which put a foot anywhere in reach.

In: its file; joint angles (..., 3): hip about z, thigh and knee about the leg's own axis. Out: `Dog`.

    foot = Rot(z, hip) (u + t cos(thigh) + s cos(thigh + knee), 0, t sin(thigh) + s sin(thigh + knee))
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from servogen.errors import InputError
from servogen.kinematics.arm import arm_details
from servogen.kinematics.mobility import Mobility, manoeuvrability, of_arm
from servogen.kinematics.protocol import Answer, BodyMotion, Posture, RobotKind
from servogen.kinematics.transforms import Complexes, Floats, to_body, to_leg
from servogen.robot.arm_file import Find, RobotKeys, find_robot
from servogen.robot.model import Arm, Dimensions, Limb, Mount
from servogen.toml.file import Document, Table


@dataclass(frozen=True, slots=True)
class Dog:
    kind: ClassVar[str] = "dog"

    name: str
    title: str
    leg: Arm
    mounts: tuple[Mount, ...]
    mass: float | None = None
    dimensions: Dimensions = "user"
    source: str = ""

    @property
    def limbs(self) -> tuple[Limb, ...]:
        return tuple(Limb(mount.name, "foot", self.leg, mount) for mount in self.mounts)

    @property
    def centre_of_mass(self) -> tuple[float, float, float]:
        return 0.0, 0.0, 0.0

    @property
    def lifting_joint(self) -> str:
        return "thigh"

    @property
    def sidesteps(self) -> bool:
        return True

    def with_leg(self, name: str) -> Dog:
        return replace(self, mounts=tuple(mount for mount in self.mounts if mount.name == name))

    def stance(self, posture: Posture, motions: Sequence[BodyMotion]) -> DogStance:
        if posture.body_height is None:
            raise InputError("posture-out-of-reach", f"{self.name} needs a height", hint="body_height_mm = …")
        return DogStance(self, posture.body_height, posture.lift)

    def corners(self, leg: int, angles: Floats) -> Floats:
        u, t = (self.leg.length[name] for name in "ut")
        hip, thigh = angles[:, 0], angles[:, 1]
        out = np.stack([np.cos(hip), np.sin(hip), np.zeros_like(hip)], axis=1)
        knee = out * (u + t * np.cos(thigh))[:, None] + np.outer(t * np.sin(thigh), [0.0, 0.0, 1.0])
        foot = to_leg(self.mounts[leg], DogStance(self, 0.0, 0.0).feet(leg, angles))
        return to_body(self.mounts[leg], np.stack([0 * out, u * out, knee, foot], axis=1))

    def torques(self, angles: Floats, forces: Floats) -> Floats:
        return np.abs(forces * (_reach(self.leg, angles) - self.leg.length["u"]))


def _reach(leg: Arm, angles: Floats) -> Floats:
    """Return how far (...,) the foot is from the hip's axis."""
    u, t, s = (leg.length[name] for name in "uts")
    thigh, knee = angles[..., 1], angles[..., 2]
    return np.asarray(u + t * np.cos(thigh) + s * np.cos(thigh + knee))


@dataclass(frozen=True, slots=True)
class DogStance:
    dog: Dog
    height: float
    lift: float

    @property
    def free(self) -> bool:
        return True

    def neutral(self, leg: int, motion: BodyMotion) -> complex:
        point = to_body(self.dog.mounts[leg], np.array([0.0, 0.12, 0.0]))
        return complex(point[0], point[1])

    def held_back(self, leg: int, motion: BodyMotion) -> float:
        return 0.0

    def angles(self, leg: int, footholds: Complexes) -> Floats:
        ground = np.full(len(footholds), -self.height)
        return self._solve(leg, np.stack([footholds.real, footholds.imag, ground], axis=1))

    def lifted(self, leg: int, angles: Floats, share: Floats) -> Floats:
        feet = self.feet(leg, angles)
        feet[:, 2] += self.lift * share
        return self._solve(leg, feet)

    def feet(self, leg: int, angles: Floats) -> Floats:
        length = self.dog.leg.length
        out, thigh, knee = _reach(self.dog.leg, angles), angles[:, 1], angles[:, 2]
        down = length["t"] * np.sin(thigh) + length["s"] * np.sin(thigh + knee)
        points = np.stack([out * np.cos(angles[:, 0]), out * np.sin(angles[:, 0]), down], axis=1)
        return to_body(self.dog.mounts[leg], points)

    def _solve(self, leg: int, feet: Floats) -> Floats:
        """Return the angles (n, 3) of feet in the body frame, by the law of cosines."""
        u, t, s = (self.dog.leg.length[name] for name in "uts")
        x, y, z = to_leg(self.dog.mounts[leg], feet).T
        out = np.hypot(x, y) - u
        cosine = (out**2 + z**2 - t**2 - s**2) / (2 * t * s)
        if (np.abs(cosine) > 1).any():
            raise InputError("posture-out-of-reach", f"a foot of {self.dog.name} is out of reach")
        knee = -np.arccos(cosine)
        thigh = np.arctan2(z, out) - np.arctan2(s * np.sin(knee), t + s * np.cos(knee))
        return np.stack([np.arctan2(y, x), thigh, knee], axis=1)


class DogTable(RobotKeys, Table):
    leg: str
    length_mm: float = Field(gt=0)
    width_mm: float = Field(gt=0)


def _read(document: Document, table: DogTable, find: Find) -> Dog:
    leg = find_robot(document, "leg", table.leg, find)
    if not isinstance(leg, Arm):
        raise document.error("wrong-robot-kind", ("leg",), f"'{leg.name}' is not a leg")
    x, y = table.length_mm / 2000, table.width_mm / 2000
    corners = (("FL", x, y), ("FR", x, -y), ("HL", -x, y), ("HR", -x, -y))
    mounts = tuple(Mount(name, at_x, at_y, mirrored=at_y < 0) for name, at_x, at_y in corners)
    return Dog(table.name, table.title, leg, mounts)


def _details(dog: Dog) -> Answer:
    return {"leg": arm_details(dog.leg)}


def _mobility(dog: Dog) -> Mobility:
    leg = of_arm(dog.leg)
    return Mobility(13, leg.joints * 4, 0, 4 * leg.mobility, manoeuvrability(4 * leg.mobility), "four legs")


DOG = RobotKind("dog", DogTable, _read, _details, _mobility)
