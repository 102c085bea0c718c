"""The shape of a job file: one `Table` a TOML table, one field a key, its unit in the name.

In: nothing. Out: models that `tomlfile` checks a file against. What several keys mean together is `load`'s.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from servogen.robot.servo_models import FactTable
from servogen.tomlfile import Table

NAME = r"^[A-Za-z][A-Za-z0-9_-]*$"


MOST_MM, MOST_S = 100_000.0, 1_000_000.0
"""Beyond these a number is a slip of the pen."""

Coordinate = Annotated[float, Field(ge=-MOST_MM, le=MOST_MM)]


class ChipTable(Table):
    """[chip]"""

    device: str
    clock_hz: int = Field(gt=0)


class ServoTable(FactTable):
    """[[servo]]; any fact of its model can be given again here."""

    name: str = Field(pattern=NAME)
    pin: str
    model: str
    supply_v: float | None = Field(default=None, gt=0)
    trim_us: float = 0.0
    reverse: bool = False
    min_deg: float | None = None
    max_deg: float | None = None
    open_drain: bool = False


class LegTable(Table):
    """[leg]: lengths, the servos of its joints, and the servo angle at which each joint's angle is 0."""

    ab_mm: float = Field(ge=0, le=MOST_MM)
    bc_mm: float = Field(ge=0.001, le=MOST_MM)
    cd_mm: float = Field(ge=0, le=MOST_MM)
    df_mm: float = Field(ge=0, le=MOST_MM)
    alpha: str
    beta: str
    alpha_zero_deg: float = 90.0
    beta_zero_deg: float = 90.0
    beta_sign: Literal["nearest", "positive", "negative"] = "nearest"
    tolerance_mm: float = Field(default=0.5, ge=0)


class PoseTable(Table):
    """One of [motion] poses; the angles, `<servo>_deg`, are the keys that are not listed here."""

    model_config = ConfigDict(extra="allow")

    foot_mm: tuple[Coordinate, Coordinate, Coordinate] | None = None
    move_s: float = Field(default=0.0, ge=0, le=MOST_S)
    hold_s: float = Field(default=0.0, ge=0, le=MOST_S)
    pause_s: float = Field(default=0.0, ge=0, le=MOST_S)
    release: bool = False


class MotionTable(Table):
    """[motion]"""

    repeat: bool = True
    end: Literal["hold", "release"] = "hold"
    poses: tuple[PoseTable, ...] = Field(min_length=1)


class FrameTable(Table):
    """[frame]"""

    period_us: float = Field(default=20_000.0, gt=0, le=1_000_000)
    gap_us: float = Field(default=250.0, gt=0)
    slot_us: float | None = Field(default=None, gt=0)


class FirmwareTable(Table):
    """[firmware]"""

    dialect: Literal["c2c", "xc8"] = "c2c"
    engine: Literal["sequence"] = "sequence"


class JobTable(Table):
    """A whole job file."""

    chip: ChipTable
    servo: tuple[ServoTable, ...] = Field(min_length=1)
    leg: LegTable | None = None
    motion: MotionTable
    frame: FrameTable = FrameTable()
    firmware: FirmwareTable = FirmwareTable()
