"""Servo models: `catalogue/servos/*.toml`, or a user's file in the same format -> `ServoModel`.

In: a model's name or the path of its file, its supply voltage, fields that replace the file's. Out: its facts
at that voltage.
"""

# Annotations are not postponed here: pydantic would compile the text of each when a command starts.

import math
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field

from servogen.errors import InputError, Location, did_you_mean
from servogen.robot.servo import Calibration, Motor, ServoModel, calibration
from servogen.toml import file as toml_file
from servogen.toml.file import Document, Table

FILE_ENDING = ".toml"
"""The suffix of a model's name that is the path of a file."""

MIN_US, MAX_US = 100.0, 10_000.0
"""Other widths must be typing errors: milliseconds, or an extra zero."""


MIN_SPELLING = 4
"""The fewest letters and digits by which a servo is recognised."""


class PointTable(Table):
    """The pulse width at an angle, or at a speed of a continuous-rotation servo."""

    angle_deg: float | None = None
    speed_deg_s: float | None = None
    width_us: float = Field(ge=MIN_US, le=MAX_US)


class FactKeys(BaseModel):
    """The facts of a servo that its model's file has, and that a job may specify in its place."""

    travel_deg: tuple[float, float] | None = None
    points: tuple[PointTable, ...] | None = Field(default=None, min_length=2)
    speed_deg_s: float | None = Field(default=None, gt=0)
    acceleration_deg_s2: float | None = Field(default=None, gt=0)
    torque_ncm: float | None = Field(default=None, gt=0)
    idle_ma: float | None = Field(default=None, ge=0)
    max_ma: float | None = Field(default=None, gt=0)
    mass_g: float | None = Field(default=None, gt=0)
    size_mm: tuple[float, float, float] | None = None
    spline_teeth: int | None = Field(default=None, ge=8, le=100)


class SupplyTable(Table):
    """Speed and torque at a supply voltage."""

    supply_v: float = Field(gt=0)
    speed_deg_s: float | None = Field(default=None, gt=0)
    speed_rad_s: float | None = Field(default=None, gt=0)
    torque_ncm: float | None = Field(default=None, gt=0)

    @property
    def speed(self) -> float | None:
        """Return the speed in radians per second; None if it is not given."""
        return self.speed_rad_s if self.speed_deg_s is None else math.radians(self.speed_deg_s)


class MotorTable(Table):
    """[motor]: facts that only the physics of `servogen twin` needs."""

    stall_ma: float | None = Field(default=None, gt=0)
    no_load_ma: float | None = Field(default=None, ge=0)
    efficiency: float | None = Field(default=None, gt=0, le=1)
    dead_band_us: float | None = Field(default=None, ge=0, le=100)
    full_drive_us: float | None = Field(default=None, gt=0, le=1000)
    lost_ms: float | None = Field(default=None, gt=0, le=100_000)
    start_ms: float | None = Field(default=None, ge=1, le=10_000)
    backlash_deg: float | None = Field(default=None, ge=0, le=30)
    assumed: tuple[str, ...] = ()


class ModelTable(FactKeys, Table):
    """A servo model's file. Without [[supply]], its speed and torque are valid at any voltage."""

    title: str
    source: str = ""
    kind: Literal["position", "continuous"] = "position"
    points: tuple[PointTable, ...] = Field(min_length=2)
    supply: tuple[SupplyTable, ...] = ()
    motor: MotorTable | None = None
    sources: dict[str, str] | None = None
    """The sources of those figures that are not from `source`, by their keys."""


def names() -> tuple[str, ...]:
    """Return the models in the catalogue."""
    return tuple(sorted(entry.name[: -len(".toml")] for entry in _folder().iterdir() if entry.is_file()))


def catalogued_as(spelling: str) -> str:
    """Return the catalogue's name for a servo in any usual spelling, such as `SG90`, `Tower Pro SG90` or
    `s3001`: the end of one name or title, without regard to case and signs. Anything else is returned as is.
    """
    wanted = _plain(spelling)
    found = [
        name
        for name in names()
        if any(_plain(known).endswith(wanted) for known in (name, _catalogue_model(name)[1].title))
    ]
    return found[0] if len(found) == 1 and len(wanted) >= MIN_SPELLING else spelling


def _plain(name: str) -> str:
    return "".join(filter(str.isalnum, name.lower()))


def servo_model(
    name: str,
    supply_v: float | None = None,
    overrides: FactKeys | None = None,
    place: Location | None = None,
) -> ServoModel:
    """Return the model at `supply_v` (its lowest if None), with `overrides` facts taking precedence; `name`
    may be the path of a file.

    Raises InputError located at `place` for the request, and in the file for errors in a user's file.
    """
    document, table = _model(name, place)
    overrides = overrides or FactKeys()
    # Points are not facts of the model: they belong to one servo.
    facts = table.model_copy(update=overrides.model_dump(exclude_none=True, exclude={"points"}))
    speed, torque_ncm = _at(table, supply_v, place)
    continuous = table.kind == "continuous"
    curve = points_of(table.points, document.place("points"), continuous)
    return ServoModel(
        name=Path(name).stem if name.endswith(FILE_ENDING) else name,
        title=table.title,
        travel=_travel(
            facts.travel_deg, table, curve, place if overrides.travel_deg else document.place("travel_deg")
        ),
        calibration=curve,
        speed=speed if facts.speed_deg_s is None else math.radians(facts.speed_deg_s),
        acceleration=_scale(facts.acceleration_deg_s2, math.degrees(1)),
        torque_nm=_scale(torque_ncm if facts.torque_ncm is None else facts.torque_ncm, 100),
        idle_a=_scale(facts.idle_ma, 1000),
        max_a=_scale(facts.max_ma, 1000),
        mass_kg=_scale(facts.mass_g, 1000),
        size_m=None if facts.size_mm is None else _metres(facts.size_mm),
        spline_teeth=facts.spline_teeth,
        source=table.source,
        continuous=continuous,
        supply_v=_voltage(table, supply_v),
        motor=_motor(document, table),
    )


@dataclass(frozen=True, slots=True)
class ServoFigure:
    """A figure of a model's file as its keys and units say it, and where it comes from.

    `origin` is one of `ORIGINS` or "file", the words of a file that names none of them.
    """

    key: str
    value: str
    origin: str
    source: str


ORIGINS = ("maker", "seller", "lab", "assumed")
"""Whose figures they are: a `source` begins with one of the first three and a colon."""


def figures(name: str, place: Location | None = None) -> tuple[ServoFigure, ...]:
    """Return the figures of a model in the order of its file's keys; `name` as for `servo_model`.

    Raises InputError.
    """
    document, table = _model(name, place)
    motor = _motor(document, table)
    data = table.model_dump(exclude_none=True, exclude={"title", "source", "sources", "kind"})
    unit = "°/s" if table.kind == "continuous" else "°"
    values = {
        key: _literal(value)
        for key, value in data.items()
        if key in FactKeys.model_fields and key != "points"
    }
    values["points"] = ", ".join(
        f"{point.angle_deg if point.speed_deg_s is None else point.speed_deg_s:g}{unit} {point.width_us:g} µs"
        for point in table.points
    )
    for key in ("speed_deg_s", "speed_rad_s", "torque_ncm"):
        at = [(row.supply_v, getattr(row, key)) for row in table.supply if getattr(row, key) is not None]
        if at:
            values[key] = ", ".join(f"{value:g} at {volts:g} V" for volts, value in at)
    values |= {key: _literal(value) for key, value in data.get("motor", {}).items() if key != "assumed"}
    return tuple(ServoFigure(key, value, *_origin(key, table, motor)) for key, value in values.items())


def _origin(key: str, table: ModelTable, motor: Motor) -> tuple[str, str]:
    """Return whose figure a key's is, and its source."""
    source = (table.sources or {}).get(key, table.source)
    if key in motor.assumed:
        return "assumed", ""
    origin, colon, text = source.partition(": ")
    return (origin, text) if colon and origin in ORIGINS else ("file", source)


def _literal(value: object) -> str:
    return ", ".join(f"{each:g}" for each in (value if isinstance(value, tuple) else (value,)))


def _voltage(table: ModelTable, supply_v: float | None) -> float | None:
    return min((row.supply_v for row in table.supply), default=None) if supply_v is None else supply_v


def _motor(document: Document, table: ModelTable) -> Motor:
    """Return the motor's facts. Raises InputError for an assumption about a missing key."""
    motor = table.motor or MotorTable()
    keys = [*MotorTable.model_fields, *FactKeys.model_fields]
    for index, key in enumerate(motor.assumed):
        where, said = ("motor", "assumed", index), f"there is no key '{key}' whose value could be assumed"
        document.check_known("unknown-name", where, key, keys, said)
    for key in table.sources or ():
        said = f"there is no figure '{key}' that could have a source"
        document.check_known("unknown-name", ("sources", key), key, keys, said)
    return Motor(
        stall_a=_scale(motor.stall_ma, 1000),
        no_load_a=_scale(motor.no_load_ma, 1000),
        efficiency=motor.efficiency,
        dead_band_us=motor.dead_band_us,
        full_drive_us=motor.full_drive_us,
        lost_s=_scale(motor.lost_ms, 1000),
        start_s=_scale(motor.start_ms, 1000),
        backlash=_scale(motor.backlash_deg, math.degrees(1)),
        assumed=motor.assumed,
    )


def points_of(
    points: tuple[PointTable, ...], place: Location | None, continuous: bool = False
) -> Calibration:
    """Return the calibration given by a file's points: angles, or speeds. Raises InputError."""
    wanted, other = ("speed_deg_s", "angle_deg") if continuous else ("angle_deg", "speed_deg_s")
    pairs = []
    for point in points:
        value: float | None = getattr(point, wanted)
        if value is None or getattr(point, other) is not None:
            raise InputError(
                "bad-calibration",
                f"a calibration point of this servo is {{ {wanted} = …, width_us = … }}",
                place,
                "a continuous-rotation servo's width is a speed, any other's an angle",
            )
        pairs.append((math.radians(value), point.width_us))
    return calibration(tuple(pairs), place)


def _travel(
    travel_deg: tuple[float, float] | None, table: ModelTable, curve: Calibration, place: Location | None
) -> tuple[float, float]:
    """Return the stops' angles in radians, by default those of the end points; infinite for a continuous
    servo.
    """
    if table.kind == "continuous":
        if travel_deg is not None:
            raise InputError(
                "wrong-servo-kind", f"{table.title}: it turns continuously and has no travel", place
            )
        return -math.inf, math.inf
    if travel_deg is None:
        return curve.angles
    low, high = (math.radians(angle) for angle in travel_deg)
    if low >= high:
        raise InputError("servo-range", "travel_deg does not rise from its first to its second angle", place)
    return low, high


def _at(
    table: ModelTable, supply_v: float | None, place: Location | None
) -> tuple[float | None, float | None]:
    """Return speed and torque, linearly interpolated between two specified voltages."""
    rows = sorted(table.supply, key=lambda row: row.supply_v)
    if not rows:
        return None, None
    volts = rows[0].supply_v if supply_v is None else supply_v
    if not rows[0].supply_v <= volts <= rows[-1].supply_v:
        raise InputError(
            "out-of-range",
            f"{volts:g} V is outside the servo's supply",
            place,
            f"{table.title}: {rows[0].supply_v:g} to {rows[-1].supply_v:g} V",
        )
    below = max((row for row in rows if row.supply_v <= volts), key=lambda row: row.supply_v)
    above = min((row for row in rows if row.supply_v >= volts), key=lambda row: row.supply_v)
    width = above.supply_v - below.supply_v
    # `below` and `above` are the same row at a specified voltage.
    share = (volts - below.supply_v) / width if width else 0.0
    return _between(below.speed, above.speed, share), _between(below.torque_ncm, above.torque_ncm, share)


def _between(below: float | None, above: float | None, share: float) -> float | None:
    return None if below is None or above is None else below + share * (above - below)


def _scale(value: float | None, parts: float) -> float | None:
    return None if value is None else value / parts


def _metres(size_mm: tuple[float, float, float]) -> tuple[float, float, float]:
    length, height, width = (side / 1000 for side in size_mm)
    return length, height, width


def _model(name: str, place: Location | None) -> tuple[Document, ModelTable]:
    """Return the model's validated file."""
    if name.endswith(FILE_ENDING):
        if not Path(name).is_file():
            raise InputError("unknown-servo-model", f"there is no servo file '{name}'", place)
        return toml_file.load(name, ModelTable)
    if name not in names():
        own = '; or describe the servo in a file: model = "my-servo.toml"'
        raise InputError(
            "unknown-servo-model", f"unknown servo model '{name}'", place, did_you_mean(name, names()) + own
        )
    return _catalogue_model(name)


@cache
def _catalogue_model(name: str) -> tuple[Document, ModelTable]:
    entry = _folder() / f"{name}.toml"
    document = toml_file.parse(entry.read_text(encoding="utf-8"), entry.name)
    return document, toml_file.validate(document, ModelTable)


def _folder() -> Traversable:
    return files("servogen.robot") / "catalogue" / "servos"
