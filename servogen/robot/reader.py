"""The tables of a robot's TOML file, with the type, unit and range of each key.

Which keys belong together is checked in `file`, after the types.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf, radians
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from servogen.errors import InputError, did_you_mean
from servogen.robot.model import Arm, DHRow, Frame, Hexapod, Joint, Length, Mount, OmniBase, Robot
from servogen.toml import file as toml_file
from servogen.toml.file import Document, Table

MAX_GRAMS = 1e7
"""Ten tonnes: a greater mass is a mistake."""

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]

MOST_MM = 100_000.0
"""Beyond it a length is a slip of the pen."""


Millimetres = Annotated[float, Field(ge=-MOST_MM, le=MOST_MM)]


def _as_text(value: Any) -> Any:
    return repr(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


LengthText = Annotated[str, BeforeValidator(_as_text)]
"""A number of millimetres, or a sum of named lengths: 40, "l2", "l2 + l3", "-l2"."""


class JointTable(Table):
    name: Name
    kind: Literal["turning", "sliding"] | None = None
    lower_deg: float | None = None
    upper_deg: float | None = None
    home_deg: float | None = None
    speed_deg_s: float | None = Field(default=None, gt=0)
    lower_mm: float | None = None
    upper_mm: float | None = None
    home_mm: float | None = None
    speed_mm_s: float | None = Field(default=None, gt=0)
    mass_g: float | None = Field(default=None, ge=0, le=MAX_GRAMS)
    centre_of_mass_mm: tuple[Millimetres, Millimetres, Millimetres] | None = None


class RowTable(Table):
    joint: Name | None = None
    ratio: float = 1.0
    theta_deg: float = 0.0
    d_mm: LengthText = "0"
    a_mm: LengthText = "0"
    alpha_deg: float = 0.0


class FrameTable(Table):
    x_mm: float = 0.0
    y_mm: float = 0.0
    z_mm: float = 0.0
    rx_deg: float = 0.0
    ry_deg: float = 0.0
    rz_deg: float = 0.0


class MountTable(Table):
    name: Name
    x_mm: float
    y_mm: float
    z_mm: float = 0.0
    heading_deg: float = 0.0
    mirrored: bool = False


class RobotTable(Table):
    """The whole file."""

    name: Name
    title: str = ""
    aliases: tuple[str, ...] = ()
    kind: Literal["arm", "hexapod", "omni"] = "arm"
    like: str | None = None
    convention: Literal["standard", "modified"] | None = None
    closed_form: str | None = None
    orientation: tuple[Literal["roll", "pitch", "rpy"], ...] = ()
    dimensions: Literal["source", "manufacturer", "example", "user"] = "user"
    source: str = ""
    lengths_mm: dict[str, Annotated[float, Field(ge=0, le=MOST_MM)]] = Field(default_factory=dict)
    """A direction is the row's: a_mm = "-l2"."""
    joint: tuple[JointTable, ...] = ()
    row: tuple[RowTable, ...] = ()
    base: FrameTable | None = None
    tool: FrameTable | None = None
    leg: str = "leg"
    mount: tuple[MountTable, ...] = ()
    centre_of_mass_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass_g: float | None = Field(default=None, gt=0, le=MAX_GRAMS)
    payload_g: float | None = Field(default=None, ge=0, le=MAX_GRAMS)
    wheel_diameter_mm: float | None = Field(default=None, gt=0)
    wheel_distance_mm: float | None = Field(default=None, gt=0)
    gear: float = Field(default=1.0, gt=0)
    counts_per_turn: int = Field(default=1, gt=0)
    sensors: int = Field(default=0, ge=0)


Find = Callable[[str], Robot]
"""Gives the catalogue's robot of a name, or raises InputError."""

# The keys of each kind of robot in addition to the common ones.
_COMMON = {"name", "title", "aliases", "kind", "dimensions", "source"}
_ARM = {
    "like",
    "convention",
    "closed_form",
    "orientation",
    "lengths_mm",
    "joint",
    "row",
    "base",
    "tool",
    "payload_g",
}
_KEYS = {
    "arm": _COMMON | _ARM,
    "hexapod": _COMMON | {"like", "leg", "lengths_mm", "mount", "centre_of_mass_mm", "mass_g"},
    "omni": _COMMON | {"wheel_diameter_mm", "wheel_distance_mm", "gear", "counts_per_turn", "sensors"},
}


def load(path: str | Path, find: Find) -> Robot:
    """Return the robot of the file at `path`; `find` returns the catalogue's robots for `like` and `leg`."""
    return robot_of(toml_file.read(path), find)


def robot_of(document: Document, find: Find) -> Robot:
    """Return the robot that `document` describes. Raises InputError with its location."""
    table = toml_file.validate(document, RobotTable)
    for key in document.data:
        if key not in _KEYS[table.kind]:
            kinds = [f'kind = "{kind}"' for kind, keys in _KEYS.items() if key in keys]
            if kinds:
                where = f"in a file of {' or '.join(kinds)}, not of {table.kind}"
                raise document.error(
                    "unknown-key",
                    (key,),
                    f"'{key}' stands {where}",
                    "the kind is that of an arm unless given",
                )
            raise toml_file.unknown_key(document, (key,), _KEYS[table.kind])
    if table.kind == "omni":
        return _omni(document, table)
    if table.kind == "hexapod":
        return _hexapod(document, table, find)
    return _like(document, table, find) if table.like else _arm(document, table)


def _omni(document: Document, table: RobotTable) -> OmniBase:
    for key in ("wheel_diameter_mm", "wheel_distance_mm"):
        if getattr(table, key) is None:
            raise document.error("missing-key", (), f"'{key}' is missing", f"add {key} = …")
    diameter, distance = table.wheel_diameter_mm or 0.0, table.wheel_distance_mm or 0.0
    return OmniBase(
        table.name,
        table.title,
        diameter / 2000,
        distance / 1000,
        table.gear,
        table.counts_per_turn,
        table.sensors,
        table.dimensions,
        table.source,
    )


def _hexapod(document: Document, table: RobotTable, find: Find) -> Hexapod:
    key = "like" if table.like else "leg"
    found = _found(document, key, table.like or table.leg, find)
    model = found if isinstance(found, Hexapod) else None
    leg = found.leg if isinstance(found, Hexapod) else found
    if not isinstance(leg, Arm) or leg.closed_form != "leg":
        raise document.error(
            "wrong-robot-kind", (key,), f"'{found.name}' is no leg", 'a two-joint leg, such as leg = "leg"'
        )
    mounts = tuple(_mount(mount) for mount in table.mount) or (model.mounts if model else ())
    if not mounts:
        raise document.error(
            "missing-key", (), "a hexapod needs its legs", "add [[mount]] tables: name, x_mm, y_mm"
        )
    _all_different(document, "mount", [mount.name for mount in mounts])
    x, y, z = (value / 1000 for value in table.centre_of_mass_mm)
    return Hexapod(
        table.name,
        table.title,
        _leg_changed(document, table, leg),
        mounts,
        (x, y, z),
        table.dimensions,
        table.source,
        _kilograms(table.mass_g, model.mass if model else None),
    )


def _mount(table: MountTable) -> Mount:
    x, y, z = (value / 1000 for value in (table.x_mm, table.y_mm, table.z_mm))
    return Mount(table.name, x, y, z, radians(table.heading_deg), table.mirrored)


def _like(document: Document, table: RobotTable, find: Find) -> Arm:
    model = _found(document, "like", table.like or "", find)
    if not isinstance(model, Arm):
        raise document.error(
            "wrong-robot-kind", ("like",), f"'{model.name}' is no arm", f'add kind = "{_kind(model)}"'
        )
    for key in ("row", "convention", "closed_form", "orientation"):
        if key in document.data:
            raise document.error(
                "conflicting-keys", (key,), f"'{key}' is taken from '{model.name}' (like)", "leave one out"
            )
    arm = _lengths_changed(document, table, model)
    changed = {joint.name: joint for joint in arm.joints}
    for index, joint in enumerate(table.joint):
        if joint.name not in changed:
            where = ("joint", index, "name")
            raise document.error(
                "unknown-joint",
                where,
                f"'{model.name}' has no joint '{joint.name}'",
                did_you_mean(joint.name, changed),
            )
        changed[joint.name] = _joint(document, index, joint, changed[joint.name])
    return replace(
        arm,
        name=table.name,
        title=table.title or model.title,
        joints=tuple(changed.values()),
        base=_frame(table.base) if table.base else arm.base,
        tool=_frame(table.tool) if table.tool else arm.tool,
        dimensions=table.dimensions if table.lengths_mm else arm.dimensions,
        source=table.source or model.source,
        payload=_kilograms(table.payload_g, model.payload) or 0.0,
    )


def _kind(robot: Robot) -> str:
    return "hexapod" if isinstance(robot, Hexapod) else "omni" if isinstance(robot, OmniBase) else "arm"


def _found(document: Document, key: str, name: str, find: Find) -> Robot:
    try:
        return find(name)
    except InputError as error:
        raise error.at(document.place(key)) from error


def _leg_changed(document: Document, table: RobotTable, leg: Arm) -> Arm:
    """Return the leg with the lengths of the file, which must leave it a reach and a thigh."""
    changed = _lengths_changed(document, table, leg)
    if not changed.length["bc"]:
        raise document.error("bad-length", ("lengths_mm", "bc"), "bc is 0: β would lift nothing")
    if not changed.length["ab"] + changed.length["cd"]:
        raise document.error("bad-length", ("lengths_mm", "ab"), "ab and cd are both 0: a leg has a reach")
    return changed


def _lengths_changed(document: Document, table: RobotTable, arm: Arm) -> Arm:
    for name in table.lengths_mm:
        if name not in arm.length:
            where, bare = ("lengths_mm", name), name.removesuffix("_mm")
            hint = (
                f"lengths_mm says the unit: write {bare}"
                if bare in arm.length
                else did_you_mean(name, arm.length)
            )
            raise document.error("unknown-length", where, f"'{arm.name}' has no length '{name}'", hint)
    changed = {name: value / 1000 for name, value in table.lengths_mm.items()}
    return arm.with_lengths(**changed) if changed else arm


def _arm(document: Document, table: RobotTable) -> Arm:
    for key in ("convention", "joint", "row"):
        if key not in document.data:
            raise document.error(
                "missing-key", (), f"'{key}' is missing", "or name a catalogue robot: like = …"
            )
    joints = tuple(_joint(document, index, joint, None) for index, joint in enumerate(table.joint))
    names = [joint.name for joint in joints]
    _all_different(document, "joint", names)
    lengths = {name: value / 1000 for name, value in table.lengths_mm.items()}
    rows = tuple(_row(document, index, row, names, lengths) for index, row in enumerate(table.row))
    for index, name in enumerate(names):
        if all(row.joint != index for row in rows):
            raise document.error(
                "joint-unused",
                ("joint", index),
                f"no row uses the joint '{name}'",
                "add joint = … to a [[row]]",
            )
    return Arm(
        table.name,
        table.title,
        table.convention or "standard",
        joints,
        rows,
        tuple(lengths.items()),
        table.closed_form,
        table.orientation,
        _frame(table.base),
        _frame(table.tool),
        table.dimensions,
        table.source,
        _kilograms(table.payload_g, None) or 0.0,
    )


def _frame(table: FrameTable | None) -> Frame:
    if table is None:
        return Frame()
    x, y, z = (value / 1000 for value in (table.x_mm, table.y_mm, table.z_mm))
    return Frame(x, y, z, radians(table.rx_deg), radians(table.ry_deg), radians(table.rz_deg))


def _all_different(document: Document, array: str, names: list[str]) -> None:
    for index, name in enumerate(names):
        if name in names[:index]:
            raise document.error(
                "duplicate-name", (array, index, "name"), f"the name '{name}' is taken twice"
            )


# kind of joint -> unit of its keys, factor to the internal unit, default limits
_JOINT_UNITS: Mapping[str, tuple[str, float, float]] = {
    "turning": ("deg", radians(1), 180.0),
    "sliding": ("mm", 0.001, inf),
}


def _joint(document: Document, index: int, table: JointTable, model: Joint | None) -> Joint:
    """Return the joint of a table; omitted keys are the model's, or a full turn and the minimum position."""
    kind = table.kind or (model.kind if model else "turning")
    if model and kind != model.kind:
        raise document.error(
            "unknown-joint-kind", ("joint", index, "kind"), f"the joint '{model.name}' is {model.kind}"
        )
    unit, factor, full = _JOINT_UNITS[kind]
    other = "mm" if unit == "deg" else "deg"
    for key in ("lower", "upper", "home", "speed"):
        wrong = f"{key}_{other}_s" if key == "speed" else f"{key}_{other}"
        if getattr(table, wrong) is not None:
            raise document.error(
                "wrong-unit",
                ("joint", index, wrong),
                f"the joint '{table.name}' is {kind}: give it in {unit}",
            )

    def given(key: str, default: float | None) -> float | None:
        value = getattr(table, f"{key}_{unit}" + ("_s" if key == "speed" else ""))
        return default if value is None else float(value) * factor

    lower = given("lower", model.lower if model else (-full * factor if kind == "turning" else None))
    upper = given("upper", model.upper if model else (full * factor if kind == "turning" else None))
    if lower is None or upper is None:
        missing = f"{'lower' if lower is None else 'upper'}_{unit}"
        raise document.error(
            "missing-key", ("joint", index), f"'{missing}' is missing", "a sliding joint needs its limits"
        )
    if lower >= upper:
        raise document.error(
            "joint-limits", ("joint", index), f"the limits of '{table.name}' leave no room: lower < upper"
        )
    rest = min(max(0.0, lower), upper) if kind == "turning" else lower
    home = given("home", model.home if model and lower <= model.home <= upper else rest)
    if home is None or not lower <= home <= upper:
        raise document.error("joint-limits", ("joint", index, f"home_{unit}"), "home is outside the limits")
    centre = table.centre_of_mass_mm
    mass = _kilograms(table.mass_g, model.mass if model else None) or 0.0
    if centre is not None and not mass:
        raise document.error(
            "missing-key",
            ("joint", index, "centre_of_mass_mm"),
            f"the joint '{table.name}' has no mass",
            "add mass_g = …",
        )
    return Joint(
        table.name,
        kind,
        lower,
        upper,
        home,
        given("speed", model.speed if model else None),
        mass,
        (model.centre if model else (0.0, 0.0, 0.0)) if centre is None else _metres(centre),
    )


def _kilograms(grams: float | None, default: float | None) -> float | None:
    return default if grams is None else grams / 1000


def _metres(millimetres: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = millimetres
    return x / 1000, y / 1000, z / 1000


def _row(
    document: Document, index: int, table: RowTable, joints: list[str], lengths: Mapping[str, float]
) -> DHRow:
    if table.joint is not None and table.joint not in joints:
        raise document.error(
            "unknown-joint",
            ("row", index, "joint"),
            f"no joint '{table.joint}'",
            did_you_mean(table.joint, joints),
        )
    return DHRow(
        radians(table.theta_deg),
        _length(document, ("row", index, "d_mm"), table.d_mm, lengths),
        _length(document, ("row", index, "a_mm"), table.a_mm, lengths),
        radians(table.alpha_deg),
        None if table.joint is None else joints.index(table.joint),
        table.ratio,
    )


_TERM = re.compile(r"\s*([+-]?)\s*(?:(\d+(?:\.\d*)?(?:e[+-]?\d+)?)|([A-Za-z]\w*))\s*")


def _length(document: Document, key: tuple[str, int, str], text: str, lengths: Mapping[str, float]) -> Length:
    terms: list[tuple[str, float]] = []
    constant, at = 0.0, 0
    while at < len(text):
        found = _TERM.match(text, at)
        if not found or (at > 0 and not found[1]):
            raise document.error(
                "bad-length", key, f'"{text}" is not a length', 'millimetres or names: 40, "l2 + l3", "-l2"'
            )
        sign = -1.0 if found[1] == "-" else 1.0
        if found[2]:
            constant += sign * float(found[2]) / 1000
        elif found[3] in lengths:
            terms.append((found[3], sign))
        else:
            raise document.error(
                "unknown-length",
                key,
                f"no length '{found[3]}' in [lengths_mm]",
                did_you_mean(found[3], lengths),
            )
        at = found.end()
    return Length(tuple(terms), constant)
