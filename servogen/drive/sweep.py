"""`Sweep`: one servo moved through its widths for calibration, and no further than it may go.

In: a channel, the widths from and to, how many. Out: the positions in order, and a robot that goes there in
small steps and waits until it stands; the readings of a calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from servogen.drive.controller import Channel, Controller
from servogen.drive.serial_link import Line, Time
from servogen.engines.stream.protocol import MOST
from servogen.errors import InputError
from servogen.robot.calibration import Reading

FEWEST = 3
STEP_S = 0.02
SECONDS_OVER = 1.5
"""For the whole range of a servo: slow enough to be switched off before it breaks anything."""

SETTLE_S = 0.5


def positions(channel: Channel, from_us: float | None, to_us: float | None, count: int) -> tuple[int, ...]:
    """`count` positions at even distances, rising; by default over all that the servo's limits allow.

    Raises InputError for widths beyond the limits and for a range too short for that many.
    """
    least, most = channel.servo.widths_us
    low, high = (least if from_us is None else from_us), (most if to_us is None else to_us)
    if low < least - channel.slack_us or high > most + channel.slack_us:
        raise InputError(
            "servo-limit",
            f"{channel.servo.name} is allowed pulses of {least:g} to {most:g} µs, not {low:g} to {high:g} µs",
            channel.servo.place,
            "its min_deg, max_deg, travel_deg and points in the job set them",
        )
    inside = [
        position
        for position, width in enumerate(channel.widths_us)
        if low - channel.slack_us <= width <= high + channel.slack_us
    ]
    if count < FEWEST or len(inside) < count:
        raise InputError(
            "too-few-points",
            f"{count} points from {low:g} to {high:g} µs: the controller makes {len(inside)} widths there",
            hint=f"{FEWEST} points or more, over a longer range",
        )
    return tuple(inside[round(index * (len(inside) - 1) / (count - 1))] for index in range(count))


@dataclass(slots=True)
class Sweep:
    """The servo at `index` of the controller; `at` is the position that it was sent last."""

    controller: Controller
    index: int
    line: Line
    time: Time
    at: int

    def go(self, position: int) -> None:
        """Goes there by steps and waits until it stands. Raises Unplugged."""
        step = max(1, round(MOST * STEP_S / SECONDS_OVER))
        for each in _way(self.at, position, step):
            self.at = each
            self.send()
            self.time.sleep(STEP_S)
        self.time.sleep(SETTLE_S)

    def send(self) -> None:
        """Sends its position, again. Raises Unplugged."""
        self.line.send(self.controller.command(self.index, self.at))

    def answered(self, answer: Callable[[], str | None]) -> str:
        """Waits for an answer; the chip hears meanwhile that its line is alive. Raises Unplugged."""
        sent = self.time.now()
        while (text := answer()) is None:
            self.time.sleep(STEP_S)
            if self.time.now() - sent >= self.controller.refresh_s:
                self.send()
                sent = self.time.now()
        return text


Ask = Callable[[Sweep, int], float]
"""Returns the angle (radians) at which the servo is seen, given the number of the point."""


def sweep_readings(
    controller: Controller, index: int, stops: Sequence[int], line: Line, time: Time, ask: Ask
) -> list[Reading]:
    """Move the servo at `index` to each position, ask where it stands, and return the readings.

    It starts at its neutral position, and goes back there whatever happens. Raises Unplugged, and what `ask`
    raises.
    """
    channel = controller.channels[index]
    rest = channel.position(channel.servo.neutral)
    sweep = Sweep(controller, index, line, time, rest)
    sweep.send()
    readings = []
    try:
        for point, position in enumerate(stops):
            sweep.go(position)
            readings.append(Reading(channel.widths_us[position], ask(sweep, point)))
    finally:
        sweep.go(rest)
    return readings


def ask_from(angles: Sequence[float], stops: Sequence[int]) -> Ask:
    """Return what answers with angles that were seen before. Raises InputError if they are not as many."""
    if len(angles) != len(stops):
        raise InputError(
            "reading-count", f"{len(angles)} angles for {len(stops)} points", hint=f"--points {len(angles)}"
        )
    return lambda sweep, point: angles[point]


def _way(start: int, end: int, step: int) -> Iterator[int]:
    """The positions from one to another, the last included."""
    sign = 1 if end > start else -1
    yield from range(start + sign * step, end, sign * step)
    yield end
