"""What a program reads and writes beside the arm: positions, counters, pallets, and the ports.

In: numbers of positions, counters and pallets; the values at the input port and their times. Out: their
values; undefined ones raise InputError without a location, which the interpreter adds. The input port has
its value at a frame and its next strobe; each write to the output port is recorded.

A pallet's grid (pallet i; the manufacturer's numbering, i tens and units):

    10i+2 ●───●───●───● 10i+3     columns run from 10i to 10i+1, rows from 10i to 10i+2
          │   │   │   │           counters 10i+1 (column) and 10i+2 (row), both from 1,
    10i   ●───●───●───● 10i+1     say which point PT makes position i
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

from servogen.errors import InputError, Location
from servogen.movemaster.language import WORD

if TYPE_CHECKING:
    from servogen.answers import ToolPoseAnswer

OPEN, CLOSED = "O", "C"


@dataclass(frozen=True, slots=True)
class ToolPose:
    """Tool point in mm; pitch above the horizontal and roll in degrees, as written in programs."""

    x: float
    y: float
    z: float
    p: float
    r: float

    @property
    def values(self) -> tuple[float, float, float, float, float]:
        """Return x, y, z in mm, and pitch and roll in degrees."""
        return self.x, self.y, self.z, self.p, self.r

    def plus(self, other: ToolPose, times: float = 1.0) -> ToolPose:
        """Return this pose plus `times` the other's values."""
        return ToolPose(*(a + times * b for a, b in zip(self.values, other.values, strict=True)))

    def times(self, factor: float) -> ToolPose:
        """Return the pose with all values multiplied by `factor`."""
        return ToolPose(*(factor * value for value in self.values))

    def to_json(self) -> ToolPoseAnswer:
        """Return the pose in metres and degrees."""
        position = [self.x / 1000, self.y / 1000, self.z / 1000]
        return {"position_m": position, "pitch_deg": self.p, "roll_deg": self.r}

    def __str__(self) -> str:
        x, y, z, p, r = (f"{value:z.1f}" for value in self.values)
        return f"({x}, {y}, {z}) mm, pitch {p}°, roll {r}°"


@dataclass(frozen=True, slots=True)
class StoredPosition:
    """A stored pose and the state of the hand there."""

    pose: ToolPose
    hand: str = OPEN


class Memory:
    """The controller's memory. All numbers are already within the ranges of the language's table."""

    def __init__(self) -> None:
        self.positions: dict[int, StoredPosition] = {}
        self.counters: dict[int, int] = {}
        self.pallets: dict[int, tuple[int, int]] = {}
        self.comparison = 0

    def position(self, number: int) -> StoredPosition:
        """Return a stored position. Raises InputError if it is not defined."""
        if number not in self.positions:
            raise InputError(
                "undefined-position",
                f"position {number} is not defined",
                hint="PD, HE, PL or PT defines it before it is used",
            )
        return self.positions[number]

    def between(self, first: int, last: int) -> list[int]:
        """Return the defined positions from `first` to `last`, both of which are defined, in either
        direction.
        """
        for number in (first, last):
            self.position(number)
        low, high = sorted((first, last))
        numbers = sorted(number for number in self.positions if low <= number <= high)
        return numbers if first <= last else numbers[::-1]

    def shift(self, number: int, by: int) -> None:
        """Add the coordinates of position `by` to position `number`. Raises InputError for undefined ones."""
        moved = self.position(number)
        self.positions[number] = replace(moved, pose=moved.pose.plus(self.position(by).pose))

    def clear(self, first: int, last: int) -> None:
        """Delete the positions from `first` to `last`."""
        for number in [position for position in self.positions if first <= position <= last]:
            del self.positions[number]

    def neighbour(self, number: int, step: int) -> int:
        """Return the next defined position above (`step` 1) or below (-1) `number`."""
        if step > 0:
            beyond = [position for position in self.positions if position > number]
        else:
            beyond = [position for position in self.positions if position < number]
        if not beyond:
            side = "above" if step > 0 else "below"
            raise InputError(
                "undefined-position",
                f"no position {side} {number} is defined",
                hint="MO, MC and MS set the number",
            )
        return min(beyond) if step > 0 else max(beyond)

    def count(self, number: int, step: int) -> None:
        """Add `step` to a counter. Raises InputError if the result is not a signed word."""
        value = self.counters.get(number, 0) + step
        if not WORD[0] <= value <= WORD[1]:
            raise InputError(
                "program-argument", f"counter {number} would be {value}", hint=f"{WORD[0]} to {WORD[1]}"
            )
        self.counters[number] = value

    def grid_point(self, pallet: int) -> StoredPosition:
        """Return the point of the pallet's grid selected by its two counters, with the hand state of its
        first corner.
        """
        if pallet not in self.pallets:
            raise InputError(
                "undefined-position",
                f"pallet {pallet} has no grid",
                hint=f"PA {pallet}, columns, rows defines it",
            )
        shares = []
        for axis, name, size in zip((1, 2), ("column", "row"), self.pallets[pallet], strict=True):
            counter = 10 * pallet + axis
            index = self.counters.get(counter, 0)
            if not 1 <= index <= size:
                raise InputError(
                    "undefined-position",
                    f"pallet {pallet}: counter {counter} names {name} {index} of {size}",
                    hint=f"SC {counter}, 1 sets it; {name}s count from 1",
                )
            # A pallet with one row or column has no second corner to interpolate to.
            shares.append((index - 1) / (size - 1) if size > 1 else 0.0)
        along, across = shares
        corners = [self.position(10 * pallet + corner) for corner in range(4)]
        weights = ((1 - along) * (1 - across), along * (1 - across), (1 - along) * across, along * across)
        pose = corners[0].pose.times(weights[0])
        for corner, weight in zip(corners[1:], weights[1:], strict=True):
            pose = pose.plus(corner.pose, weight)
        return StoredPosition(pose, corners[0].hand)

    def kept(self) -> tuple[object, ...]:
        """Return everything that determines what a program will do, for comparison."""
        return (
            tuple((number, self.positions[number]) for number in sorted(self.positions)),
            tuple(sorted((number, value) for number, value in self.counters.items() if value)),
            tuple(sorted(self.pallets.items())),
            self.comparison,
        )


PORT_BITS = 8


@dataclass(frozen=True, slots=True)
class PortInput:
    """From `at_s` seconds on, the port reads `value`; a strobe signals it to IN."""

    at_s: Fraction
    value: int


@dataclass(frozen=True, slots=True)
class Output:
    """At the beginning of `frame` the output port becomes `value`; with `strobe`, OT signals it."""

    frame: int
    value: int
    strobe: bool


_INPUT = re.compile(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*=\s*(?:&([0-9A-Fa-f]{1,2})|(\d{1,3}))\s*", re.ASCII)


def input_of(text: str, place: Location | None = None) -> PortInput:
    """Return an input written as seconds=value, such as 1.5=3 or 0=&1F. Raises InputError."""
    match = _INPUT.fullmatch(text)
    value = -1 if match is None else int(match[2], 16) if match[2] else int(match[3])
    if match is None or not 0 <= value < 1 << PORT_BITS:
        raise InputError(
            "bad-option",
            f"'{text}' is not an input",
            place,
            "seconds=value, such as 1.5=3 or 0=&1F; value 0 to 255 or &0 to &FF",
        )
    return PortInput(Fraction(match[1]), value)


class InputPort:
    """The input port over a run: 0 until its first input."""

    def __init__(self, inputs: tuple[PortInput, ...], period_s: Fraction) -> None:
        ordered = sorted(inputs, key=lambda change: change.at_s)
        # Rounded up: an input is seen in the first frame that begins after it.
        self._rows = tuple((-((-entry.at_s) // period_s), entry.value) for entry in ordered)
        self._taken = 0

    def value(self, frame: int) -> int:
        """Return the value at the port in `frame`."""
        value = 0
        for first, given in self._rows:
            if first <= frame:
                value = given
        return value

    def strobe(self) -> tuple[int, int] | None:
        """Return the frame and value of the next input; None if none is left."""
        if self._taken == len(self._rows):
            return None
        self._taken += 1
        return self._rows[self._taken - 1]
