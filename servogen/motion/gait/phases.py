"""Gaits: which legs are in the air at which share of the cycle.

In: a name, or a duty factor and a phase table. Out: `Gait`. Each leg is on the ground (stance) for the
share `duty` of the cycle and in the air (swing) for the rest; `lifts` is when each leg leaves the ground.

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

from servogen.errors import InputError, check_known, did_you_mean
from servogen.kinematics.protocol import WalkingRobot, mounts_of
from servogen.units import counted

SIXTH = Fraction(1, 6)

MIN_SHARE = Fraction(1, 24)
"""The shortest stance and swing as a share of the cycle; a shorter one must be a mistake."""

THREE_DIGITS = Fraction(1, 1000)
"""The maximum difference between a number and the simple fraction that it abbreviates."""


@dataclass(frozen=True, slots=True)
class Gait:
    """A gait; `lifts` is the share of the cycle (0 to 1) at which each leg, by name, leaves the ground."""

    name: str
    duty: Fraction
    lifts: tuple[tuple[str, Fraction], ...]

    @property
    def swing(self) -> Fraction:
        """Return the share of the cycle during which a leg is in the air."""
        return 1 - self.duty

    @property
    def grain(self) -> int:
        """Return the smallest number of frames per cycle for which every leg lifts and lands on a frame."""
        shares = (self.duty, *(lift for _, lift in self.lifts))
        return math.lcm(*(share.denominator for share in shares))

    def on_frames(self, count: int) -> Gait:
        """Return the gait whose legs all lift and land on one of the `count` frames of a cycle.

        Lifts move to the nearest frame and swings are shortened to whole frames, so that a leg that lands
        before another one lifts still does: for whole k, ⌊x + k + ½⌋ = ⌊x + ½⌋ + k, and the floor is
        monotonic.
        """
        swing = Fraction(math.floor(self.swing * count), count)
        half = Fraction(1, 2)
        lifts = tuple((leg, Fraction(math.floor(lift * count + half), count) % 1) for leg, lift in self.lifts)
        return Gait(self.name, 1 - swing, lifts)

    def changes_from(self, asked: Gait, count: int) -> tuple[PhaseChange, ...]:
        """Return the phases that differ from those of `asked` by more than half of a frame, of `count` a
        cycle.
        """
        shares = [("duty", asked.duty, self.duty)]
        pairs = zip(asked.lifts, self.lifts, strict=True)
        shares += [(leg, before, after) for (leg, before), (_, after) in pairs]
        changes = (PhaseChange(what, before, after, count) for what, before, after in shares)
        return tuple(change for change in changes if change.frames > Fraction(1, 2))


@dataclass(frozen=True, slots=True)
class PhaseChange:
    """A share of the cycle that was moved to the frames: a leg's lift, by its name, or the duty factor."""

    what: str
    asked: Fraction
    used: Fraction
    count: int

    @property
    def frames(self) -> Fraction:
        """Return the size of the change in frames, in the shorter direction round the cycle."""
        away = abs(self.used - self.asked) % 1
        return min(away, 1 - away) * self.count

    def text(self) -> str:
        """Return the change as part of a sentence."""
        name = "the duty factor" if self.what == "duty" else f"the lift of {self.what}"
        return (
            f"{name} is {float(self.used):.4g} of the cycle, not {float(self.asked):.4g}: "
            f"{float(self.frames):z.2f} frames"
        )


EIGHTH = Fraction(1, 8)

Times = tuple[int, ...]

# Name -> for each number of legs on a side: duty factor, unit of time, and for left and right legs from the
# front to the rear when they lift, in that unit.
_TABLE: Mapping[str, Mapping[int, tuple[Fraction, Fraction, Times, Times]]] = {
    "tripod": {3: (3 * SIXTH, SIXTH, (0, 3, 0), (3, 0, 3))},
    "ripple": {3: (4 * SIXTH, SIXTH, (4, 2, 0), (1, 5, 3))},
    "wave": {
        3: (5 * SIXTH, SIXTH, (2, 1, 0), (5, 4, 3)),
        4: (7 * EIGHTH, EIGHTH, (3, 2, 1, 0), (7, 6, 5, 4)),
    },
    "crawl": {2: (7 * EIGHTH, EIGHTH, (2, 0), (6, 4))},
    "trot": {2: (4 * EIGHTH, EIGHTH, (0, 4), (4, 0))},
    "tetrapod": {4: (4 * EIGHTH, EIGHTH, (0, 4, 0, 4), (4, 0, 4, 0))},
}

NAMES = tuple(_TABLE)


def gait(name: str, robot: WalkingRobot) -> Gait:
    """Return the named gait for a robot with as many legs on each side as it is for. Raises InputError."""
    if name not in _TABLE:
        raise InputError("unknown-name", f"unknown gait '{name}'", hint=did_you_mean(name, NAMES))
    mounts = sorted(mounts_of(robot), key=lambda mount: -mount.x)
    sides = [[mount.name for mount in mounts if mount.mirrored == right] for right in (False, True)]
    counts = [len(side) for side in sides]
    if counts[0] != counts[1] or counts[0] not in _TABLE[name]:
        wanted = " or ".join(NUMBERS[count] for count in _TABLE[name])
        fitting = [other for other, table in _TABLE.items() if counts[0] == counts[1] and counts[0] in table]
        raise InputError(
            "unknown-name",
            f"the gait '{name}' is for {wanted} legs on each side: {robot.name} has "
            f"{counts[0]} on the left and {counts[1]} on the right",
            hint=(f"its gaits: {', '.join(fitting)}; or " if fitting else "")
            + "give a duty factor and the phase of each leg",
        )
    duty, unit, *sideways = _TABLE[name][counts[0]]
    lifts = {
        leg: time * unit
        for side, times in zip(sides, sideways, strict=True)
        for leg, time in zip(side, times, strict=True)
    }
    return custom(name, duty, lifts, robot)


NUMBERS = {2: "two", 3: "three", 4: "four"}


def custom(
    name: str,
    duty: Fraction | float,
    lifts: Mapping[str, Fraction | float] | Sequence[float],
    robot: WalkingRobot,
) -> Gait:
    """Return the gait with a duty factor and the lift of each leg, by name or in order. Raises InputError."""
    legs = [mount.name for mount in mounts_of(robot)]
    if not isinstance(lifts, Mapping):
        if len(lifts) != len(legs):
            raise InputError(
                "missing-key",
                f"{counted(len(lifts), 'phase')} for {counted(len(legs), 'leg')}",
                hint=f"in the order {', '.join(legs)}",
            )
        lifts = dict(zip(legs, lifts, strict=True))
    for leg in lifts:
        check_known("unknown-name", leg, legs, f"{robot.name} has no leg '{leg}'")
    for leg in legs:
        if leg not in lifts:
            raise InputError("missing-key", f"the phase of the leg {leg} is missing")
        if not 0 <= lifts[leg] < 1:
            raise InputError(
                "out-of-range", f"the phase of {leg} is {float(lifts[leg]):g}: it is at least 0 and below 1"
            )
    if not MIN_SHARE <= _simple(duty) <= 1 - MIN_SHARE:
        raise InputError(
            "out-of-range",
            f"the duty factor is between 0 and 1, at least 1/24 away from both, not {float(duty):g}",
        )
    return Gait(name, _simple(duty), tuple((leg, _simple(lifts[leg]) % 1) for leg in legs))


def _simple(share: Fraction | float) -> Fraction:
    """Return the fraction that a share abbreviates: 0.667 is two thirds, to three digits."""
    exact = Fraction(share).limit_denominator(10**6)
    simple = exact.limit_denominator(24)
    return simple if abs(simple - exact) < THREE_DIGITS else exact
