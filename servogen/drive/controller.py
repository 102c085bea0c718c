"""`Controller`: servo angles as Mini SSC positions, never beyond a servo's limits.

In: the servos, their numbers at the controller, and the widths that its positions 0 and 254 are. Out: which
positions changed, and the bytes that say so.

    width = low + p (high - low) / 254        p is the nearest whole number whose width the servo allows
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from servogen.errors import InputError, Place
from servogen.job import Job
from servogen.motion.trajectory import Floats
from servogen.robot.servo import Servo

SYNC = 0xFF
MOST_POSITION = 254
COMMAND_BYTES = 3

USUAL_BAUD = 9600
"""Of controllers that are no stream engine."""

TINY_US = 1e-6
"""What floating point adds to a width."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A servo at `number` of the controller, whose positions 0 and 254 are `low_us` and `high_us`."""

    servo: Servo
    number: int
    low_us: float
    high_us: float

    @property
    def step_us(self) -> float:
        return (self.high_us - self.low_us) / MOST_POSITION

    @property
    def positions(self) -> tuple[int, int]:
        """The least and the greatest that the servo allows. Raises InputError where there are none."""
        least, most = self.servo.widths_us
        first = max(0, math.ceil((least - TINY_US - self.low_us) / self.step_us))
        last = min(MOST_POSITION, math.floor((most + TINY_US - self.low_us) / self.step_us))
        if first > last:
            raise InputError(
                f"{self.servo.name}'s pulses are {least:g} to {most:g} µs: the controller makes "
                f"{self.low_us:g} to {self.high_us:g} µs",
                self.servo.place,
            )
        return first, last

    def position(self, angle: float) -> int:
        """The position nearest to a servo angle.

        Raises InputError for an angle that the servo does not allow or the controller cannot make.
        """
        first, last = self.positions
        width = self.servo.width_us(angle)
        position = min(max(round((width - self.low_us) / self.step_us), first), last)
        if abs(self.width_us(position) - width) > self.step_us:
            raise InputError(
                f"{self.servo.name} would need pulses of {width:g} µs: the controller makes "
                f"{self.low_us:g} to {self.high_us:g} µs",
                self.servo.place,
            )
        return position

    def width_us(self, position: int) -> float:
        return self.low_us + position * self.step_us


@dataclass(frozen=True, slots=True)
class Controller:
    """All servos, in the order of the job."""

    channels: tuple[Channel, ...]
    command_bytes: int = COMMAND_BYTES

    def changes(self, sent: Sequence[int | None], angles: Floats) -> list[tuple[int, int]]:
        """(index, position) of each servo whose position is not the one sent; NaN changes nothing."""
        found = []
        for index, (channel, before, angle) in enumerate(
            zip(self.channels, sent, angles.tolist(), strict=True)
        ):
            if not math.isnan(angle) and (position := channel.position(angle)) != before:
                found.append((index, position))
        return found

    def command(self, index: int, position: int) -> bytes:
        return bytes((SYNC, self.channels[index].number, position))


def controller_of(job: Job, baud: int | None, range_us: str | None, first: int) -> tuple[int, Controller]:
    """The baud rate and the controller of a job's servos, numbered from `first` in the order of the job.

    Raises InputError where nothing says which widths the controller makes of positions 0 and 254.
    """
    if first + len(job.servos) > MOST_POSITION + 1:
        raise InputError(f"{len(job.servos)} servos from number {first} on: the last number is 254")
    if range_us is None:
        raise InputError(
            "nothing says which widths positions 0 and 254 are",
            Place(job.file),
            "the controller's manual does: --range-us 500,2500",
        )
    low, high = _range(range_us)
    channels = tuple(Channel(servo, first + index, low, high) for index, servo in enumerate(job.servos))
    return baud or USUAL_BAUD, Controller(channels)


def _range(text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        low = high = math.nan
    if not 0 < low < high < math.inf:
        raise InputError(f"'{text}' is no range of widths", hint="--range-us 500,2500")
    return low, high
