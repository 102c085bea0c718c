"""`ServoController`: servo angles as Mini SSC positions within the servos' limits.

In: the servos, their numbers at the controller, and the width of each of its 255 positions. Out: the
positions that changed, and the bytes that command them.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from servogen.engines.inputs.serial import Stream
from servogen.engines.stream.protocol import MAX_VALUE, CommandKind, StreamCommand, travel
from servogen.errors import InputError, Location
from servogen.job import Job
from servogen.motion.trajectory import Floats
from servogen.robot.servo import Servo

DEFAULT_BAUD = 9600
"""The rate of controllers other than the stream engine."""

REFRESH_S = 0.5
"""The interval at which a robot at rest is sent one position, of each servo in turn, to correct lost bytes.
"""

REFRESHES_PER_SILENCE = 4
"""The number of positions sent within the time after which a chip considers its line dead."""

TINY_US = 1e-6
"""Rounding noise of a width in µs."""


@dataclass(frozen=True, slots=True)
class ControllerChannel:
    """A servo, its number at the controller, and the widths of its positions 0 to 254, rising."""

    servo: Servo
    number: int
    widths_us: tuple[float, ...]
    slack_us: float = TINY_US
    """The distance by which rounding may take a width beyond the servo's limits."""

    @property
    def step_us(self) -> float:
        """Return the mean difference, in µs, between the widths of consecutive positions."""
        return (self.widths_us[-1] - self.widths_us[0]) / MAX_VALUE

    def position(self, angle: float) -> int:
        """Return the position nearest to a servo angle within the servo's limits.

        Raises InputError for an angle outside the limits and for one that the controller cannot produce.
        """
        width, (minimum, maximum) = self.servo.width_us(angle), self.servo.widths_us
        after = bisect_left(self.widths_us, width)
        # Widths rise but are not evenly spaced in whole cycles, so both neighbours are compared.
        near = [
            position
            for position in (after - 1, after)
            if 0 <= position <= MAX_VALUE
            and minimum - self.slack_us <= self.widths_us[position] <= maximum + self.slack_us
        ]
        position = min(near, key=lambda candidate: abs(self.widths_us[candidate] - width), default=None)
        if position is None or abs(self.widths_us[position] - width) > self.step_us:
            raise InputError(
                "servo-limit",
                f"{self.servo.name} would need pulses of {width:g} µs: the controller produces "
                f"{self.widths_us[0]:g} to {self.widths_us[-1]:g} µs",
                self.servo.place,
            )
        return position


@dataclass(frozen=True, slots=True)
class ServoController:
    """All servos, in the order of the job; `frame_s` is only set for the stream engine, which has groups."""

    channels: tuple[ControllerChannel, ...]
    frame_s: float | None = None
    refresh_s: float = REFRESH_S

    def changes(self, sent: Sequence[int | None], angles: Floats) -> list[tuple[int, int]]:
        """Return (index, position) of each servo whose position differs from the one sent; NaN: no change."""
        changed = []
        for index, (channel, before, angle) in enumerate(
            zip(self.channels, sent, angles.tolist(), strict=True)
        ):
            if not math.isnan(angle) and (position := channel.position(angle)) != before:
                changed.append((index, position))
        return changed

    def command(self, index: int, position: int) -> bytes:
        """Return the bytes that command a position."""
        return StreamCommand(CommandKind.POSITION, self.channels[index].number, position).to_bytes()


def job_controller(
    job: Job, baud: int | None, range_us: str | None, first: int
) -> tuple[int, ServoController]:
    """Return the baud rate and the controller of a job's servos, numbered from `first` in the job's order.

    A job with [stream] is its own controller, unless `range_us` states the widths of positions 0 and 254 of
    another. Raises InputError if they are not known.
    """
    if first + len(job.servos) > MAX_VALUE + 1:
        raise InputError(
            "does-not-fit",
            f"{len(job.servos)} servos numbered from {first}: the highest number is {MAX_VALUE}",
        )
    if job.stream is not None and range_us is None:
        if first:
            raise InputError("bad-option", "the stream engine's servos are numbered from 0", job.stream.place)
        return baud or job.stream.baud, _stream(job, job.stream)
    if range_us is None:
        raise InputError(
            "missing-option",
            "the job has no [stream]; of another controller the widths of positions 0 and 254 must be known",
            Location(job.file),
            "see the controller's manual: --range-us 500,2500",
        )
    widths = tuple(np.linspace(*_range(range_us), MAX_VALUE + 1).tolist())
    channels = tuple(
        ControllerChannel(servo, first + index, widths) for index, servo in enumerate(job.servos)
    )
    return baud or DEFAULT_BAUD, ServoController(channels)


def _stream(job: Job, stream: Stream) -> ServoController:
    """Return the stream engine as a controller: its positions are whole cycles between a servo's limits."""
    half_us = float(job.clock.cycle_us) / 2
    channels = []
    for index, servo in enumerate(job.servos):
        limits = travel(servo, job.clock)
        widths = tuple(float(job.clock.us(limits.width(position))) for position in range(MAX_VALUE + 1))
        channels.append(ControllerChannel(servo, index, widths, half_us + TINY_US))
    frame_s = float(job.clock.seconds(job.frame.period.cycles))
    return ServoController(
        tuple(channels), frame_s, min(REFRESH_S, float(stream.silence_s) / REFRESHES_PER_SILENCE)
    )


def _range(text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        low = high = math.nan
    if not 0 < low < high < math.inf:
        raise InputError("bad-option", f"'{text}' is not a range of widths", hint="--range-us 500,2500")
    return low, high
