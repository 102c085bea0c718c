"""`Sweep`: moves one servo through its widths for calibration, within its limits.

In: a channel, the first and last width, the number of points. Out: the positions in order, to which the servo
goes in small steps and where it settles, and the readings of a calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from servogen.drive.controller import ControllerChannel, ServoController
from servogen.drive.serial_link import SerialLink, Time
from servogen.engines.stream.protocol import MAX_VALUE
from servogen.errors import Diagnostic, InputError, Location, ServogenError, did_you_mean
from servogen.job import Job, calibrated, plan_job
from servogen.robot.calibration import Reading
from servogen.units import counted

MIN_POINTS = 3
"""The minimum number of points: any two readings lie on a line."""

STEP_S = 0.02
"""The interval between two positions on the way to a point: a frame of the servo."""

RANGE_S = 1.5
"""The time for the whole range of a servo: slow enough to switch it off before it breaks anything."""

SETTLE_S = 0.5
"""The time that a servo needs to come to rest."""


def positions(
    channel: ControllerChannel, from_us: float | None, to_us: float | None, count: int
) -> tuple[int, ...]:
    """Return `count` evenly spaced, rising positions, by default over the whole range of the servo's limits.

    Raises InputError for widths beyond the limits and for a range too short for that many points.
    """
    minimum, maximum = channel.servo.widths_us
    low, high = (minimum if from_us is None else from_us), (maximum if to_us is None else to_us)
    if low < minimum - channel.slack_us or high > maximum + channel.slack_us:
        raise InputError(
            "servo-limit",
            f"{channel.servo.name} accepts {minimum:g} to {maximum:g} µs, not {low:g} to {high:g} µs",
            channel.servo.place,
            "its min_deg, max_deg, travel_deg and points in the job set them",
        )
    inside = [
        position
        for position, width in enumerate(channel.widths_us)
        if low - channel.slack_us <= width <= high + channel.slack_us
    ]
    if count < MIN_POINTS or len(inside) < count:
        raise InputError(
            "bad-readings",
            f"{count} points from {low:g} to {high:g} µs: the controller produces {len(inside)} widths there",
            hint=f"{MIN_POINTS} points or more, over a longer range",
        )
    return tuple(inside[round(index * (len(inside) - 1) / (count - 1))] for index in range(count))


@dataclass(slots=True)
class Sweep:
    """The servo at `index` of the controller; `at` is the position last sent to it."""

    controller: ServoController
    index: int
    line: SerialLink
    time: Time
    at: int

    def go(self, position: int) -> None:
        """Go to a position in steps and wait until the servo is at rest. Raises Unplugged."""
        # The positions that a servo passes in STEP_S at the speed that RANGE_S allows.
        step = max(1, round(MAX_VALUE * STEP_S / RANGE_S))
        for next_position in _steps(self.at, position, step):
            self.at = next_position
            self.send()
            self.time.sleep(STEP_S)
        self.time.sleep(SETTLE_S)

    def send(self) -> None:
        """Send the present position again. Raises Unplugged."""
        self.line.send(self.controller.command(self.index, self.at))

    def wait_for(self, answer: Callable[[], str | None]) -> str:
        """Return a person's answer, sending positions meanwhile to hold off the fail-safe. Raises
        Unplugged.
        """
        sent = self.time.now()
        while (text := answer()) is None:
            self.time.sleep(STEP_S)
            if self.time.now() - sent >= self.controller.refresh_s:
                self.send()
                sent = self.time.now()
        return text


Ask = Callable[[Sweep, int], float]
"""Return the angle (radians) that a person reads from the servo at the point of that index."""


def sweep_readings(
    controller: ServoController, index: int, stops: Sequence[int], line: SerialLink, time: Time, ask: Ask
) -> list[Reading]:
    """Return the readings of the servo at `index` at each position; `ask` returns the angle.

    The servo starts at its neutral position and always returns there. Raises Unplugged, and what `ask`
    raises.
    """
    channel = controller.channels[index]
    rest = channel.position(channel.servo.neutral)
    sweep = Sweep(controller=controller, index=index, line=line, time=time, at=rest)
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
    """Return an `Ask` that answers with given angles. Raises InputError unless there is one per position."""
    if len(angles) != len(stops):
        raise InputError(
            "wrong-count",
            f"{counted(len(angles), 'angle')} for {len(stops)} points",
            hint=f"--points {len(angles)}",
        )
    return lambda sweep, point: angles[point]


def _steps(start: int, end: int, step: int) -> Iterator[int]:
    """Yield the positions from one to another, the last included."""
    sign = 1 if end > start else -1
    yield from range(start + sign * step, end, sign * step)
    yield end


def servo_index(job: Job, name: str | None) -> int:
    """Return the index of a job's servo; the only servo of a job needs no name. Raises InputError."""
    names = [servo.name for servo in job.servos]
    if name is None and len(names) == 1:
        return 0
    if name not in names:
        wrong = (
            "the job has several servos, and none was named"
            if name is None
            else f"there is no servo '{name}'"
        )
        raise InputError(
            "missing-option", wrong, Location(job.file), f"--servo: {did_you_mean(name or '', names)}"
        )
    return names.index(name)


def refusals(job: Job, servo: str, file: Path) -> tuple[Diagnostic, ...]:
    """Return warnings that say why the job cannot make its motion with a servo's calibration from `file`."""
    try:
        plan_job(calibrated(job, servo, str(file.resolve())))
    except ServogenError as error:
        return tuple(replace(diagnostic, severity="warning") for diagnostic in error.diagnostics)
    return ()
