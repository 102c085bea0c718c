"""The tables of a robot's TOML file, with the type, unit and range of each key.

Which keys belong together is checked in `file`, after the types.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from servogen.tomlfile import Table

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
