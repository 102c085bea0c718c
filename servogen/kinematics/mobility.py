"""Mobility: the degrees of freedom of a mechanism, by Kutzbach and Grübler.

In: the number of elements and the kinds of the joints between them, or an arm. Out: M, and M - 6.
Both formulas count every constraint as independent of the others.

    in space M = 6 (n - 1 - k) + Σ m_i      in the plane M = 3 (n - 1 - k) + Σ m_i

n elements, the base among them; k joints; m_i the mobility of joint i.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from servogen.errors import InputError, check_known
from servogen.robot.model import Arm
from servogen.units import counted

JOINT_MOBILITY: Mapping[str, int] = MappingProxyType(
    {"turning": 1, "sliding": 1, "screw": 1, "cylindrical": 2, "universal": 2, "spherical": 3}
)
"""The mobility of each kind of joint. A spherical joint is passive only: no motor drives it."""

PLANE_JOINTS = ("turning", "sliding")
"""The kinds of joints whose elements stay in one plane."""

IN_SPACE = 6
IN_PLANE = 3
"""The degrees of freedom of a free body."""


@dataclass(frozen=True, slots=True)
class Mobility:
    """The degrees of freedom of a robot; `passive` joints follow others (the leg's slider)."""

    elements: int
    joints: tuple[str, ...]
    passive: int
    mobility: int
    manoeuvrability: int
    note: str

    @property
    def verdict(self) -> str:
        """Return the manoeuvrability in one word."""
        return verdict(self.manoeuvrability)

    @property
    def closed_loops(self) -> int:
        """Return how many joints there are beyond those that an open chain needs."""
        return len(self.joints) - (self.elements - 1)


def kutzbach(elements: int, joints: Sequence[str]) -> int:
    """Return the mobility of a mechanism in space; `elements` counts the base too."""
    return _mobility(IN_SPACE, elements, joints)


def gruebler(elements: int, joints: Sequence[str]) -> int:
    """Return the mobility of a plane mechanism, with 3 in place of 6.

    Raises InputError for a joint that leaves the plane.
    """
    for kind in joints:
        if kind in JOINT_MOBILITY and kind not in PLANE_JOINTS:
            raise InputError(
                "bad-option",
                f"a {kind} joint cannot be part of a plane mechanism",
                hint=" or ".join(PLANE_JOINTS),
            )
    return _mobility(IN_PLANE, elements, joints)


def _mobility(freedom: int, elements: int, joints: Sequence[str]) -> int:
    if elements < 1:
        raise InputError("out-of-range", f"a mechanism has at least one element, not {elements}")
    for kind in joints:
        check_known("unknown-name", kind, JOINT_MOBILITY, f"unknown kind of joint '{kind}'")
    return freedom * (elements - 1 - len(joints)) + sum(JOINT_MOBILITY[kind] for kind in joints)


def of_mechanism(elements: int, joints: Sequence[str], *, plane: bool = False) -> Mobility:
    """Return the mobility of a mechanism, open or with closed loops; `elements` counts the base too.

    Raises InputError if the joints are too few to connect the elements.
    """
    freedoms = (gruebler if plane else kutzbach)(elements, joints)
    if len(joints) < elements - 1:
        raise InputError(
            "wrong-count",
            f"{len(joints)} joints do not connect {elements} elements",
            hint=f"at least {elements - 1} joints; the base is one of the elements",
        )
    loops = len(joints) - (elements - 1)
    note = "open chain: the sum of the joints' mobilities"
    if loops:
        constraints = IN_PLANE if plane else IN_SPACE
        note = f"{counted(loops, 'closed loop')}, {constraints} constraints each"
    if freedoms < 1:
        note += "; rigid, unless some constraints repeat others"
        note += "" if plane else ", as those of parallel axes do: count such a mechanism in the plane"
    return Mobility(
        elements=elements,
        joints=tuple(joints),
        passive=0,
        mobility=freedoms,
        manoeuvrability=manoeuvrability(freedoms),
        note=note,
    )


def manoeuvrability(mobility: int) -> int:
    """Return M - 6: negative if the mechanism is deficient, positive if it is redundant."""
    return mobility - IN_SPACE


def verdict(value: int) -> str:
    """Return a manoeuvrability in one word."""
    return "deficient" if value < 0 else "redundant" if value > 0 else "exact"


def standing(legs: int, joints: int) -> int:
    """Return the mobility of a body on `legs` legs of `joints` turning joints, whose feet are spherical
    joints on the floor.

    Each foot has three degrees of freedom: 6 (2 + k m - 1 - (k + 1) m) + (k + 3) m = 6 + (k - 3) m for m
    legs of k joints. On three legs of two joints the body keeps 3; on legs of three, or of two and a
    spring, all 6.
    """
    return kutzbach(2 + joints * legs, (["turning"] * joints + ["spherical"]) * legs)


def of_arm(arm: Arm) -> Mobility:
    """Return the mobility of a serial arm or leg."""
    kinds = tuple(arm.joints[row.joint].kind for row in arm.rows if row.joint is not None)
    passive = len(kinds) - len(arm.joints)
    # A joint that another one drives adds a joint to the formula but no freedom.
    mobility = kutzbach(len(kinds) + 1, kinds) - passive
    note = "serial: the sum of the joints' mobilities"
    if passive:
        note = f"the mobility of {counted(passive, 'joint')} that another one drives is subtracted"
    return Mobility(
        elements=len(kinds) + 1,
        joints=kinds,
        passive=passive,
        mobility=mobility,
        manoeuvrability=manoeuvrability(mobility),
        note=note,
    )
