"""Gaits: which leg is in the air at which share of the cycle.

In: a name, or a duty factor and a phase table. Out: `Gait`. Each leg is on the ground (stance) for the
share `duty` of the cycle and in the air (swing) for the rest; `lifts` says when each leg leaves the ground.

          tripod, duty 1/2    ripple, duty 2/3    wave, duty 5/6
    L1      ▔▔▔▁▁▁              ▁▁▁▁▔▔              ▁▁▔▁▁▁
    L2      ▁▁▁▔▔▔              ▁▁▔▔▁▁              ▁▔▁▁▁▁         ▔ in the air
    L3      ▔▔▔▁▁▁              ▔▔▁▁▁▁              ▔▁▁▁▁▁         ▁ on the ground
    R1      ▁▁▁▔▔▔              ▁▔▔▁▁▁              ▁▁▁▁▁▔
    R2      ▔▔▔▁▁▁              ▔▁▁▁▁▔              ▁▁▁▁▔▁
    R3      ▁▁▁▔▔▔              ▁▁▁▔▔▁              ▁▁▁▔▁▁
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from servogen.errors import InputError, nearest
from servogen.robot.model import Hexapod

SIXTH = Fraction(1, 6)


@dataclass(frozen=True, slots=True)
class Gait:
    """`lifts`: for each leg, by name, the share of the cycle (0 to 1) at which it leaves the ground."""

    name: str
    duty: Fraction
    lifts: tuple[tuple[str, Fraction], ...]

    @property
    def swing(self) -> Fraction:
        """The share of the cycle that a leg is in the air."""
        return 1 - self.duty

    @property
    def grain(self) -> int:
        """The least number of frames a cycle for which every leg lifts and lands on a frame."""
        shares = (self.duty, *(lift for _, lift in self.lifts))
        return math.lcm(*(share.denominator for share in shares))


# Name -> duty factor, and for left and right legs from the front to the rear when they lift, in sixths.
_TABLE: Mapping[str, tuple[Fraction, tuple[int, int, int], tuple[int, int, int]]] = {
    "tripod": (3 * SIXTH, (0, 3, 0), (3, 0, 3)),
    "ripple": (4 * SIXTH, (4, 2, 0), (1, 5, 3)),
    "wave": (5 * SIXTH, (2, 1, 0), (5, 4, 3)),
}

NAMES = tuple(_TABLE)


def gait(name: str, robot: Hexapod) -> Gait:
    """The gait of that name for a robot with three legs on each side. Raises InputError."""
    if name not in _TABLE:
        raise InputError(f"unknown gait '{name}'", hint=nearest(name, NAMES))
    duty, *sixths = _TABLE[name]
    sides = [
        [mount.name for mount in sorted(robot.mounts, key=lambda mount: -mount.x) if mount.mirrored == right]
        for right in (False, True)
    ]
    if [len(side) for side in sides] != [3, 3]:
        raise InputError(
            f"the gait '{name}' is for three legs on each side: {robot.name} has "
            f"{len(sides[0])} on the left and {len(sides[1])} on the right",
            hint="give a duty factor and the phase of each leg",
        )
    lifts = {
        leg: at * SIXTH
        for side, times in zip(sides, sixths, strict=True)
        for leg, at in zip(side, times, strict=True)
    }
    return custom(name, duty, lifts, robot)


def custom(
    name: str, duty: Fraction | float, lifts: Mapping[str, Fraction | float] | Sequence[float], robot: Hexapod
) -> Gait:
    """A gait by duty factor and phase table: when each leg lifts, by name or in order. Raises InputError."""
    legs = [mount.name for mount in robot.mounts]
    if not isinstance(lifts, Mapping):
        if len(lifts) != len(legs):
            raise InputError(
                f"{len(lifts)} phases for {len(legs)} legs", hint=f"in the order {', '.join(legs)}"
            )
        lifts = dict(zip(legs, lifts, strict=True))
    for leg in lifts:
        if leg not in legs:
            raise InputError(f"{robot.name} has no leg '{leg}'", hint=nearest(leg, legs))
    for leg in legs:
        if leg not in lifts:
            raise InputError(f"the phase of the leg {leg} is missing")
        if not 0 <= lifts[leg] < 1:
            raise InputError(f"the phase of {leg} is {float(lifts[leg]):g}: it is at least 0 and below 1")
    if not 0 < duty < 1 or not 0 < _simple(duty) < 1:
        raise InputError(
            f"a duty factor of {float(duty):g}: it is between 0 and 1, 1/24 away from both or more"
        )
    return Gait(name, _simple(duty), tuple((leg, _simple(lifts[leg]) % 1) for leg in legs))


def _simple(share: Fraction | float) -> Fraction:
    """A share as people mean it: 0.667 is two thirds when it is that to three digits."""
    return Fraction(share).limit_denominator(24)
