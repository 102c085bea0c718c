"""`Controller`: servo angles as Mini SSC positions, never beyond a servo's limits.

In: the servos, their numbers at the controller, and the width of each of its 255 positions. Out: which
positions changed, and the bytes that say so.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from servogen.engines.stream.protocol import MOST, Command, Kind, travel
from servogen.engines.stream.settings import Stream
from servogen.errors import InputError, Location
from servogen.job import Job
from servogen.motion.trajectory import Floats
from servogen.robot.servo import Servo

USUAL_BAUD = 9600
"""Of controllers that are no stream engine."""

REFRESH_S = 0.5
"""A robot at rest is sent one position so often: the next one in turn, so that a lost byte is mended."""

SURE = 4
"""So often a position comes in the time after which a chip believes that its line is dead."""

TINY_US = 1e-6
"""What floating point adds to a width."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A servo at `number` of the controller; `widths_us` are those of its positions 0 to 254, rising."""

    servo: Servo
    number: int
    widths_us: tuple[float, ...]
    slack_us: float = TINY_US
    """How far beyond the servo's limits a width may be by rounding."""

    @property
    def step_us(self) -> float:
        """The mean way from a position to the next."""
        return (self.widths_us[-1] - self.widths_us[0]) / MOST

    def position(self, angle: float) -> int:
        """The position nearest to a servo angle, of those that its limits allow.

        Raises InputError for an angle that the servo does not allow or the controller cannot make.
        """
        width, (least, most) = self.servo.width_us(angle), self.servo.widths_us
        after = bisect_left(self.widths_us, width)
        near = [
            position
            for position in (after - 1, after)
            if 0 <= position <= MOST
            and least - self.slack_us <= self.widths_us[position] <= most + self.slack_us
        ]
        found = min(near, key=lambda position: abs(self.widths_us[position] - width), default=None)
        if found is None or abs(self.widths_us[found] - width) > self.step_us:
            raise InputError(
                "servo-limit",
                f"{self.servo.name} would need pulses of {width:g} µs: the controller makes "
                f"{self.widths_us[0]:g} to {self.widths_us[-1]:g} µs",
                self.servo.place,
            )
        return found


@dataclass(frozen=True, slots=True)
class Controller:
    """All servos, in the order of the job; `frame_s` of a stream engine, which knows groups."""

    channels: tuple[Channel, ...]
    frame_s: float | None = None
    refresh_s: float = REFRESH_S

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
        return Command(Kind.POSITION, self.channels[index].number, position).to_bytes()


def controller_of(job: Job, baud: int | None, range_us: str | None, first: int) -> tuple[int, Controller]:
    """The baud rate and the controller of a job's servos, numbered from `first` in the order of the job.

    A job with [stream] is its own controller, unless `range_us` says another's widths of positions 0 and 254.
    Raises InputError where nothing says them.
    """
    if first + len(job.servos) > MOST + 1:
        raise InputError(
            "too-many-servos", f"{len(job.servos)} servos from number {first} on: the last number is {MOST}"
        )
    if job.stream is not None and range_us is None:
        if first:
            raise InputError(
                "bad-option", "the stream engine's servos are numbered from 0 on", job.stream.place
            )
        return baud or job.stream.baud, _stream(job, job.stream)
    if range_us is None:
        raise InputError(
            "missing-option",
            "nothing says which widths positions 0 and 254 are",
            Location(job.file),
            "the controller's manual does: --range-us 500,2500",
        )
    widths = tuple(np.linspace(*_range(range_us), MOST + 1).tolist())
    channels = tuple(Channel(servo, first + index, widths) for index, servo in enumerate(job.servos))
    return baud or USUAL_BAUD, Controller(channels)


def _stream(job: Job, stream: Stream) -> Controller:
    """The stream engine: positions are whole cycles between the ends of what each servo may be told."""
    half_us = float(job.clock.cycle_us) / 2
    channels = []
    for index, servo in enumerate(job.servos):
        made = travel(servo, job.clock)
        widths = tuple(float(job.clock.us(made.width(position))) for position in range(MOST + 1))
        channels.append(Channel(servo, index, widths, half_us + TINY_US))
    frame_s = float(job.clock.seconds(job.frame.period.cycles))
    return Controller(tuple(channels), frame_s, min(REFRESH_S, float(stream.silence_s) / SURE))


def _range(text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        low = high = math.nan
    if not 0 < low < high < math.inf:
        raise InputError("bad-option", f"'{text}' is no range of widths", hint="--range-us 500,2500")
    return low, high
