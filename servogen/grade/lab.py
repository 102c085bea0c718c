"""A lab's task as data: `labs/*.toml` -> `Lab`.

In: a lab's name, or the path of a TOML file. Out: its positions in order with what is allowed around them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from importlib.resources import as_file, files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated

from pydantic import Field

from servogen.edges import PINS
from servogen.errors import InputError, did_you_mean
from servogen.robot.servo import Servo, servo
from servogen.robot.servo_models import servo_model
from servogen.toml import file as toml_file
from servogen.toml.file import Document, Table
from servogen.units import Clock

SLACK_DEG = 4.0
"""The angle by which a lab's range may exceed the servo's travel: a loop's cycles change a width by this."""


class Check(StrEnum):
    """What is checked; the value is its key in a lab's [points]."""

    RUNS = "runs"
    PULSES = "pulses"
    POSITIONS = "positions"
    ORDER = "order"
    PAUSES = "pauses"
    TRAVEL = "travel"
    PERIOD = "period"
    REPETITION = "repetition"
    CHIPS = "chips"


PinName = Annotated[str, Field(json_schema_extra={"enum": list(PINS)})]


class PositionTable(Table):
    """A position of a solution: the smallest and the largest correct angle of each servo."""

    name: str
    angles_deg: dict[str, tuple[float, float]] = Field(min_length=1)
    pause_s: float | None = Field(default=None, gt=0)


class SolutionTable(Table):
    """[[solution]]: one correct solution."""

    name: str = ""
    positions: tuple[PositionTable, ...] = Field(min_length=2)


class LabServoTable(Table):
    """[[servo]]: its model, the lab's pin and other pins that are accepted."""

    name: str
    model: str
    pin: PinName
    other_pins: tuple[PinName, ...] = ()


class PeriodTable(Table):
    """[period]"""

    range_ms: tuple[float, float]
    spread_us: float = Field(gt=0)


Points = Annotated[float, Field(ge=0, le=1000)]


class PointsTable(Table):
    """[points]: for a program without any fault, and for each check."""

    passed: Points = 0.0
    runs: Points = 0.0
    pulses: Points = 0.0
    positions: Points = 0.0
    order: Points = 0.0
    pauses: Points = 0.0
    travel: Points = 0.0
    period: Points = 0.0
    repetition: Points = 0.0
    chips: Points = 0.0


class LabTable(Table):
    """A whole lab file."""

    title: str
    task: str
    clock_hz: int = Field(gt=0)
    watch_s: float = Field(gt=0, le=3600)
    longest_watch_s: float | None = Field(default=None, gt=0, le=3600)
    rounds: int = Field(ge=1)
    pause_tolerance_percent: float = Field(default=5.0, gt=0)
    longest_move_s: float = Field(default=0.0, ge=0)
    servo: tuple[LabServoTable, ...] = Field(min_length=1)
    period: PeriodTable
    solution: tuple[SolutionTable, ...] = Field(min_length=1)
    points: PointsTable = PointsTable(passed=1.0)


@dataclass(frozen=True, slots=True)
class TaskPosition:
    """`ranges`: (smallest, largest) correct angle of each servo, radians, in the order of the servos."""

    name: str
    ranges: tuple[tuple[float, float], ...]
    pause_s: float | None

    def holds(self, angles: tuple[float, ...]) -> bool:
        return all(low <= angle <= high for angle, (low, high) in zip(angles, self.ranges, strict=True))


@dataclass(frozen=True, slots=True)
class Solution:
    """One correct solution: positions in order, repeatedly."""

    name: str
    positions: tuple[TaskPosition, ...]


@dataclass(frozen=True, slots=True)
class LabServo:
    """A servo of the task: on `pins[0]` in the lab, accepted on each of `pins`."""

    servo: Servo
    pins: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Lab:
    """A task. Times in the unit of their name."""

    name: str
    title: str
    task: str
    clock: Clock
    watch_s: float
    longest_watch_s: float
    """A right program is watched on until the chip's state repeats, for this time at most."""
    rounds: int
    pause_tolerance: float
    """The allowed deviation as a fraction of the pause."""
    longest_move_s: float
    period_ms: tuple[float, float]
    spread_us: float
    servos: tuple[LabServo, ...]
    solutions: tuple[Solution, ...]
    points_passed: float
    """The points for a program without any fault."""
    points: tuple[tuple[Check, float], ...]
    """The points of each check; checks without points are omitted."""

    @property
    def checks(self) -> tuple[Check, ...]:
        """Return the checks that the lab makes: without required pauses none of pauses."""
        return tuple(check for check in Check if check is not Check.PAUSES or self.has_pauses)

    @property
    def has_pauses(self) -> bool:
        return any(position.pause_s for solution in self.solutions for position in solution.positions)


def names() -> tuple[str, ...]:
    """Return the names of the labs that come with servogen."""
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in _folder().iterdir()))


def load_lab(name: str) -> Lab:
    """Return the lab of that name, or in that .toml file. Raises InputError."""
    if name.endswith(".toml"):
        return _lab(Path(name).stem, *toml_file.load(name, LabTable))
    if name not in names():
        near = did_you_mean(name, names())
        stop = "" if near.endswith("?") else "."
        hint = f"{near}{stop} A lab of your own is a file that ends in .toml"
        raise InputError("unknown-name", f"unknown lab '{name}'", hint=hint)
    with as_file(_folder() / f"{name}.toml") as path:
        return _lab(name, *toml_file.load(path, LabTable))


def _folder() -> Traversable:
    return files("servogen.grade") / "labs"


def _lab(name: str, document: Document, table: LabTable) -> Lab:
    low, high = table.period.range_ms
    if not 0 < low < high:
        raise document.error(
            "out-of-range", ("period", "range_ms"), "the first time must be above 0 and below the second"
        )
    servos = tuple(_servo(document, index, row) for index, row in enumerate(table.servo))
    known = [lab_servo.servo.name for lab_servo in servos]
    for index, one in enumerate(known):
        if one in known[:index]:
            raise document.error(
                "duplicate-name", ("servo", index, "name"), f"two servos have the name {one}"
            )
    solutions = tuple(
        Solution(
            solution.name,
            tuple(
                _position(document, ("solution", at, "positions", number), position, servos)
                for number, position in enumerate(solution.positions)
            ),
        )
        for at, solution in enumerate(table.solution)
    )
    points = tuple((check, worth) for check in Check if (worth := getattr(table.points, check)))
    if not points and not table.points.passed:
        raise document.error("not-allowed", ("points",), "no points are given", "for example: passed = 1")
    longest = table.watch_s if table.longest_watch_s is None else table.longest_watch_s
    if longest < table.watch_s:
        raise document.error("out-of-range", ("longest_watch_s",), f"{longest:g} is below watch_s")
    lab = Lab(
        name=name,
        title=table.title,
        task=table.task,
        clock=Clock(table.clock_hz),
        watch_s=table.watch_s,
        longest_watch_s=longest,
        rounds=table.rounds,
        pause_tolerance=table.pause_tolerance_percent / 100,
        longest_move_s=table.longest_move_s,
        period_ms=(low, high),
        spread_us=table.period.spread_us,
        servos=servos,
        solutions=solutions,
        points_passed=table.points.passed,
        points=points,
    )
    if Check.PAUSES in dict(points) and not lab.has_pauses:
        raise document.error(
            "not-allowed", ("points", "pauses"), "points for pauses, but no position has a pause_s"
        )
    return lab


def _servo(document: Document, index: int, table: LabServoTable) -> LabServo:
    pins = (table.pin, *table.other_pins)
    for pin in pins:
        if pin not in PINS:
            key = "pin" if pin == table.pin else "other_pins"
            raise document.error(
                "unknown-pin", ("servo", index, key), f"unknown pin '{pin}'", did_you_mean(pin, PINS)
            )
    model = servo_model(table.model, place=document.place("servo", index, "model"))
    return LabServo(servo(table.name, table.pin, model), pins)


def _position(
    document: Document, key: tuple[str | int, ...], table: PositionTable, servos: tuple[LabServo, ...]
) -> TaskPosition:
    known = [lab_servo.servo.name for lab_servo in servos]
    for name in table.angles_deg:
        document.check_known(
            "unknown-servo", (*key, "angles_deg", name), name, known, f"unknown servo '{name}'"
        )
    ranges = []
    for lab_servo in servos:
        name = lab_servo.servo.name
        if name not in table.angles_deg:
            raise document.error("missing-key", (*key, "angles_deg"), f"'{name}' is missing")
        low, high = table.angles_deg[name]
        least, greatest = (math.degrees(limit) for limit in lab_servo.servo.limits)
        if not least - SLACK_DEG <= low < high <= greatest + SLACK_DEG:
            raise document.error(
                "servo-limit",
                (*key, "angles_deg", name),
                f"{low:g}° to {high:g}° is not a range within the servo's {least:g}° to {greatest:g}°",
            )
        ranges.append((math.radians(low), math.radians(high)))
    return TaskPosition(table.name, tuple(ranges), table.pause_s)
