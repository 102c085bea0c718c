"""Robots as frozen data: what all kinds of robots share (`Robot`), and `Arm` with its Denavit–Hartenberg
rows.

Lengths are in metres and angles in radians. Nothing is calculated here: that is the task of
`servogen.kinematics`, which also contains the other kinds of robots, one module each.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Protocol

from servogen.errors import Diagnostic, check_known

JointKind = Literal["turning", "sliding"]
Convention = Literal["standard", "modified"]
Dimensions = Literal["source", "manufacturer", "example", "user"]
EndKind = Literal["foot", "tool"]


@dataclass(frozen=True, slots=True)
class Length:
    """A length of a DH row: a sum of signed named lengths and a constant in metres, such as l2 + l3."""

    terms: tuple[tuple[str, float], ...] = ()
    constant: float = 0.0

    def value(self, lengths: Mapping[str, float]) -> float:
        """Return the length in metres, given the named lengths."""
        return self.constant + sum(factor * lengths[name] for name, factor in self.terms)

    @property
    def zero(self) -> bool:
        """Return whether the length is 0 for any values of the named lengths."""
        return not self.terms and self.constant == 0.0


@dataclass(frozen=True, slots=True)
class Joint:
    """A driven joint: revolute (radians) or prismatic (metres), with its hard limits, home position and
    maximum speed.
    """

    name: str
    kind: JointKind
    lower: float
    upper: float
    home: float
    speed: float | None = None
    mass: float = 0.0
    """The mass of the link that the joint moves, in kg; 0 if not stated."""
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The centre of that mass, in metres, in the frame after the joint's DH row."""
    continuous: bool = False
    """Whether it turns without limits: `lower` to `upper` is then the turn in which its positions are given.
    """

    @property
    def turning(self) -> bool:
        """Return whether the joint is revolute."""
        return self.kind == "turning"

    def shown(self, position: float) -> str:
        """Return a position as text, in degrees or millimetres."""
        return f"{math.degrees(position):zg}°" if self.turning else f"{1000 * position:zg} mm"

    def allows(self, position: float) -> bool:
        """Return whether a position (radians, metres) is within the limits, to rounding."""
        return self.continuous or self.lower - 1e-9 <= position <= self.upper + 1e-9


@dataclass(frozen=True, slots=True)
class DHRow:
    """One Denavit–Hartenberg row; θ varies with a revolute joint, d with a prismatic one.

    The variable part is `ratio` times the position of joint number `joint`, so a row may also follow a
    joint that it does not own (the leg's slider mechanism turns back what β turns). `joint` None: fixed.
    In the modified convention, `a` and `alpha` are those of the previous link, a_{i-1} and α_{i-1}.
    """

    theta: float
    d: Length
    a: Length
    alpha: float
    joint: int | None
    ratio: float = 1.0


@dataclass(frozen=True, slots=True)
class FixedFrame:
    """A fixed frame: Trans(x, y, z) Rot(z, rz) Rot(y, ry) Rot(x, rx), metres and radians."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    rx: float = 0.0
    ry: float = 0.0
    rz: float = 0.0

    @property
    def identity(self) -> bool:
        """Return whether the frame is that of its parent."""
        return self == FixedFrame()


@dataclass(frozen=True, slots=True)
class Mount:
    """The position of a leg's body joint in the body frame (x forward, y left, z up), and its direction.

    A left leg's frame is the body's, turned by `heading` about z. A mirrored (right) leg's is the mirror
    image of a left one's in the plane y = 0: equal angles move both feet alike, forward and backward.

        body point = Trans(x, y, z) Rot(z, heading) diag(1, -1 if mirrored else 1, 1) leg point
    """

    name: str
    x: float
    y: float
    z: float = 0.0
    heading: float = 0.0
    mirrored: bool = False


@dataclass(frozen=True, slots=True)
class Arm:
    """A serial arm, or the leg: base, rows, tool.

    `closed_form` names the closed-form inverse kinematics; None if there is none. `orientation` names what a
    target may specify in addition to x, y, z: `rpy` (φ, θ, η about z, y, x), `roll`, or `pitch` and `roll`.
    """

    kind: ClassVar[str] = "arm"

    name: str
    title: str
    convention: Convention
    joints: tuple[Joint, ...]
    rows: tuple[DHRow, ...]
    lengths: tuple[tuple[str, float], ...] = ()
    closed_form: str | None = None
    orientation: tuple[str, ...] = ()
    base: FixedFrame = FixedFrame()
    tool: FixedFrame = FixedFrame()
    dimensions: Dimensions = "user"
    source: str = ""
    payload: float = 0.0
    """The mass that the tool carries, in kg; 0 if not stated."""
    notes: tuple[Diagnostic, ...] = ()
    """What was not read of its file."""

    @property
    def length(self) -> dict[str, float]:
        """Return the named lengths in metres."""
        return dict(self.lengths)

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """Return the arm itself: its end is the tool, or the foot if it is a leg."""
        return (Limb("tool", "tool", self),)

    @property
    def home(self) -> tuple[float, ...]:
        """Return the home positions of the joints."""
        return tuple(joint.home for joint in self.joints)

    @property
    def reference(self) -> tuple[float, ...]:
        """Return the reference configuration: revolute joints at 0, prismatic joints at their minimum."""
        return tuple(0.0 if joint.turning else joint.lower for joint in self.joints)

    def with_lengths(self, **lengths: float) -> Arm:
        """Return the same arm with other lengths, in metres."""
        for name in lengths:
            check_known("unknown-name", name, self.length, f"{self.name} has no length '{name}'")
        return replace(self, lengths=tuple((self.length | lengths).items()), dimensions="user")

    def with_tool(self, tool: FixedFrame) -> Arm:
        """Return the same arm with another tool."""
        return replace(self, tool=tool)


@dataclass(frozen=True, slots=True)
class Limb:
    """A serial chain of a robot: an arm on its own base, or a leg at its mount on a body."""

    name: str
    end: EndKind
    arm: Arm
    mount: Mount | None = None

    @property
    def joints(self) -> dict[str, Joint]:
        """Return the joints by the names that servos are bound to; a leg's have the leg's name in front."""
        prefix = f"{self.mount.name}_" if self.mount else ""
        return {prefix + joint.name: joint for joint in self.arm.joints}


class Robot(Protocol):
    """The attributes of robots of all kinds.

    `kind` names the kind in a robot file and in `kinematics.registry`. What robots of some kinds can do in
    addition, walking or driving, is in `kinematics.protocol`.
    """

    kind: ClassVar[str]

    @property
    def name(self) -> str:
        """Return the short name."""

    @property
    def title(self) -> str:
        """Return the name used in reports."""

    @property
    def dimensions(self) -> Dimensions:
        """Return where the lengths and limits come from."""

    @property
    def source(self) -> str:
        """Return the source of these dimensions."""

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """Return the chains of joints that servos turn; none for a robot that only has wheels."""
