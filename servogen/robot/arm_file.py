"""The TOML file of an arm -> `Arm`, and the keys that the files of all kinds of robots share.

In: a document and its validated table. Out: an `Arm`; InputError with the line and key for keys that do not
belong together. The files of other kinds of robots are read by their modules in `kinematics`.
"""

# Annotations are not postponed here: pydantic would compile the text of each when a command starts.

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf, radians
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field

from servogen.errors import InputError, did_you_mean
from servogen.robot.model import Arm, DHRow, FixedFrame, Joint, Length, Robot
from servogen.toml.file import Document, Table

MAX_GRAMS = 1e7
"""Ten tonnes; a larger mass must be a typing error."""

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]

MAX_MM = 100_000.0
"""A larger length must be a typing error."""


Millimetres = Annotated[float, Field(ge=-MAX_MM, le=MAX_MM)]


def _as_text(value: Any) -> Any:
    return repr(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


LengthText = Annotated[
    str, BeforeValidator(_as_text), Field(json_schema_extra={"type": ["number", "string"]})
]
"""A number of millimetres, or a sum of named lengths: 40, "l2", "l2 + l3", "-l2"."""


LengthsMm = dict[str, Annotated[float, Field(ge=0, le=MAX_MM)]]
"""Lengths by name; their sign is given in the row: a_mm = "-l2"."""


class JointTable(Table):
    """One [[joint]]: its limits, home position and speed in the unit of its kind."""

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
    """One [[row]] of the Denavit–Hartenberg table."""

    joint: Name | None = None
    ratio: float = 1.0
    theta_deg: float = 0.0
    d_mm: LengthText = "0"
    a_mm: LengthText = "0"
    alpha_deg: float = 0.0


class FrameTable(Table):
    """[base] or [tool]: a fixed frame."""

    x_mm: float = 0.0
    y_mm: float = 0.0
    z_mm: float = 0.0
    rx_deg: float = 0.0
    ry_deg: float = 0.0
    rz_deg: float = 0.0


class RobotKeys(BaseModel):
    """The keys that the files of all kinds of robots have."""

    name: Name
    title: str = ""
    aliases: tuple[str, ...] = ()
    kind: str = "arm"
    dimensions: Literal["source", "manufacturer", "example", "user"] = "user"
    source: str = ""


class ArmTable(RobotKeys, Table):
    """The file of an arm."""

    like: str | None = None
    convention: Literal["standard", "modified"] | None = None
    closed_form: str | None = None
    orientation: tuple[Literal["roll", "pitch", "rpy"], ...] = ()
    lengths_mm: LengthsMm = Field(default_factory=dict)
    joint: tuple[JointTable, ...] = ()
    row: tuple[RowTable, ...] = ()
    base: FrameTable | None = None
    tool: FrameTable | None = None
    payload_g: float | None = Field(default=None, ge=0, le=MAX_GRAMS)


Find = Callable[[str], Robot]
"""Return the catalogue's robot of a name. Raises InputError for a name that is not in the catalogue."""


def arm_of(document: Document, table: ArmTable, find: Find) -> Arm:
    """Return the arm that a file describes. Raises InputError with its location."""
    return _like(document, table, find) if table.like else _arm(document, table, find)


def _like(document: Document, table: ArmTable, find: Find) -> Arm:
    """Return an arm of the catalogue with the changes of a file. Raises InputError."""
    model = find_robot(document, "like", table.like or "", find)
    if not isinstance(model, Arm):
        raise document.error(
            "wrong-robot-kind", ("like",), f"'{model.name}' is not an arm", f'add kind = "{model.kind}"'
        )
    for key in ("row", "convention", "closed_form", "orientation"):
        if key in document.data:
            raise document.error(
                "conflicting-keys",
                (key,),
                f"'{key}' is already taken from '{model.name}' (like)",
                "remove one of the two",
            )
    # The rows stay the model's, so its closed form still holds with other lengths.
    arm = with_lengths(document, table.lengths_mm, model)
    arm = with_joints(document, table.joint, arm)
    return replace(
        arm,
        name=table.name,
        title=table.title or model.title,
        base=_frame(table.base) if table.base else arm.base,
        tool=_frame(table.tool) if table.tool else arm.tool,
        dimensions=table.dimensions if table.lengths_mm else arm.dimensions,
        source=table.source or model.source,
        payload=kilograms(table.payload_g, model.payload) or 0.0,
    )


def find_robot(document: Document, key: str, name: str, find: Find) -> Robot:
    """Return the robot that a file refers to by `key`. Raises InputError at that key."""
    try:
        return find(name)
    except InputError as error:
        raise error.at(document.place(key)) from error


def with_lengths(document: Document, lengths_mm: LengthsMm, arm: Arm) -> Arm:
    """Return `arm` with the lengths of the file in place of its own. Raises InputError for unknown ones."""
    for name in lengths_mm:
        if name not in arm.length:
            where, bare = ("lengths_mm", name), name.removesuffix("_mm")
            hint = (
                f"the unit is in lengths_mm: write {bare}"
                if bare in arm.length
                else did_you_mean(name, arm.length)
            )
            raise document.error("unknown-name", where, f"'{arm.name}' has no length '{name}'", hint)
    changed = {name: value / 1000 for name, value in lengths_mm.items()}
    return arm.with_lengths(**changed) if changed else arm


def with_joints(document: Document, joints: tuple[JointTable, ...], arm: Arm) -> Arm:
    """Return `arm` with what the file states about its joints. Raises InputError for unknown ones."""
    changed = {joint.name: joint for joint in arm.joints}
    for index, joint in enumerate(joints):
        if joint.name not in changed:
            where = ("joint", index, "name")
            raise document.error(
                "unknown-joint",
                where,
                f"'{arm.name}' has no joint '{joint.name}'",
                did_you_mean(joint.name, changed),
            )
        changed[joint.name] = _joint(document, index, joint, changed[joint.name])
    return replace(arm, joints=tuple(changed.values()))


def _arm(document: Document, table: ArmTable, find: Find) -> Arm:
    """Return an arm that a file describes completely. Raises InputError."""
    for key in ("convention", "joint", "row"):
        if key not in document.data:
            raise document.error(
                "missing-key", (), f"'{key}' is missing", "or name a catalogue robot: like = …"
            )
    joints = tuple(_joint(document, index, joint, None) for index, joint in enumerate(table.joint))
    names = [joint.name for joint in joints]
    check_unique(document, "joint", names)
    _check_orientation(document, table, find)
    lengths = {name: value / 1000 for name, value in table.lengths_mm.items()}
    rows = tuple(_row(document, index, row, names, lengths) for index, row in enumerate(table.row))
    for index, name in enumerate(names):
        if all(row.joint != index for row in rows):
            raise document.error(
                "joint-binding",
                ("joint", index),
                f"no row uses the joint '{name}'",
                "add joint = … to a [[row]]",
            )
    return Arm(
        name=table.name,
        title=table.title,
        convention=table.convention or "standard",
        joints=joints,
        rows=rows,
        lengths=tuple(lengths.items()),
        closed_form=table.closed_form,
        orientation=table.orientation,
        base=_frame(table.base),
        tool=_frame(table.tool),
        dimensions=table.dimensions,
        source=table.source,
        payload=kilograms(table.payload_g, None) or 0.0,
    )


def _check_orientation(document: Document, table: ArmTable, find: Find) -> None:
    """Raise InputError for angles that only the catalogue's arms define: which direction a roll or a pitch
    turns follows from their closed forms. Any arm may have rpy.
    """
    form = table.closed_form
    if table.orientation in ((), ("rpy",)) or (form is not None and form == table.name):
        return
    owner = find_robot(document, "closed_form", form, find) if form is not None else None
    if not isinstance(owner, Arm) or owner.orientation != table.orientation:
        raise document.error(
            "conflicting-keys",
            ("orientation",),
            f"{', '.join(table.orientation)} of {table.name} is not defined: that follows from a closed form",
            'write orientation = ["rpy"], or like = … with an arm of the catalogue that has these angles',
        )


def _frame(table: FrameTable | None) -> FixedFrame:
    if table is None:
        return FixedFrame()
    x, y, z = (value / 1000 for value in (table.x_mm, table.y_mm, table.z_mm))
    return FixedFrame(
        x=x, y=y, z=z, rx=radians(table.rx_deg), ry=radians(table.ry_deg), rz=radians(table.rz_deg)
    )


def check_unique(document: Document, array: str, names: list[str]) -> None:
    """Raise InputError at the first name of an array that is already in use."""
    for index, name in enumerate(names):
        if name in names[:index]:
            raise document.error("duplicate-name", (array, index, "name"), f"the name '{name}' is used twice")


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
            "unknown-name", ("joint", index, "kind"), f"the joint '{model.name}' is {model.kind}"
        )
    unit, factor, full = _JOINT_UNITS[kind]
    other = "mm" if unit == "deg" else "deg"
    for key in ("lower", "upper", "home", "speed"):
        wrong = f"{key}_{other}_s" if key == "speed" else f"{key}_{other}"
        if getattr(table, wrong) is not None:
            raise document.error(
                "wrong-unit",
                ("joint", index, wrong),
                f"the joint '{table.name}' is {kind}: use {unit}",
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
            "out-of-range", ("joint", index), f"the limits of '{table.name}' are not in order: lower < upper"
        )
    # A revolute joint rests at 0 if its limits allow that, a prismatic one at its minimum.
    rest = min(max(0.0, lower), upper) if kind == "turning" else lower
    home = given("home", model.home if model and lower <= model.home <= upper else rest)
    if home is None or not lower <= home <= upper:
        raise document.error("out-of-range", ("joint", index, f"home_{unit}"), "home is outside the limits")
    centre = table.centre_of_mass_mm
    mass = kilograms(table.mass_g, model.mass if model else None) or 0.0
    if centre is not None and not mass:
        raise document.error(
            "missing-key",
            ("joint", index, "centre_of_mass_mm"),
            f"the joint '{table.name}' has no mass",
            "add mass_g = …",
        )
    return Joint(
        name=table.name,
        kind=kind,
        lower=lower,
        upper=upper,
        home=home,
        speed=given("speed", model.speed if model else None),
        mass=mass,
        centre=(model.centre if model else (0.0, 0.0, 0.0)) if centre is None else _metres(centre),
    )


def kilograms(grams: float | None, default: float | None) -> float | None:
    """Return a mass in kg; the default if the file does not state it."""
    return default if grams is None else grams / 1000


def _metres(millimetres: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = millimetres
    return x / 1000, y / 1000, z / 1000


def _row(
    document: Document, index: int, table: RowTable, joints: list[str], lengths: Mapping[str, float]
) -> DHRow:
    """Return the row of a table. Raises InputError."""
    if table.joint is not None and table.joint not in joints:
        raise document.error(
            "unknown-joint",
            ("row", index, "joint"),
            f"no joint '{table.joint}'",
            did_you_mean(table.joint, joints),
        )
    if table.ratio == 0:
        raise document.error(
            "out-of-range",
            ("row", index, "ratio"),
            "a joint does not move a row of ratio 0",
            "leave out joint",
        )
    return DHRow(
        theta=radians(table.theta_deg),
        d=_length(document, ("row", index, "d_mm"), table.d_mm, lengths),
        a=_length(document, ("row", index, "a_mm"), table.a_mm, lengths),
        alpha=radians(table.alpha_deg),
        joint=None if table.joint is None else joints.index(table.joint),
        ratio=table.ratio,
    )


_TERM = re.compile(r"\s*([+-]?)\s*(?:(\d+(?:\.\d*)?(?:e[+-]?\d+)?)|([A-Za-z]\w*))\s*", re.ASCII)


def _length(document: Document, key: tuple[str, int, str], text: str, lengths: Mapping[str, float]) -> Length:
    """Return a length written as a number of millimetres or a sum of names. Raises InputError."""
    terms: list[tuple[str, float]] = []
    constant, position = 0.0, 0
    while position < len(text):
        term = _TERM.match(text, position)
        # From the second term on a sign is needed: "l2 l3" is not a sum.
        if not term or (position > 0 and not term[1]):
            raise document.error(
                "bad-length", key, f'"{text}" is not a length', 'millimetres or names: 40, "l2 + l3", "-l2"'
            )
        sign = -1.0 if term[1] == "-" else 1.0
        if term[2]:
            constant += sign * float(term[2]) / 1000
        elif term[3] in lengths:
            terms.append((term[3], sign))
        else:
            raise document.error(
                "unknown-name",
                key,
                f"no length '{term[3]}' in [lengths_mm]",
                did_you_mean(term[3], lengths),
            )
        position = term.end()
    return Length(tuple(terms), constant)
