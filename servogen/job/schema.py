"""The schema of a job file: one `Table` per TOML table, one field per key, its unit in the name.

Out: models against which `toml` validates a file. `reader` checks combinations of keys.
"""

# Annotations are not postponed here: pydantic would compile the text of each when a command starts.

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import ConfigDict, Field, create_model

from servogen.engines.inputs import PinName
from servogen.engines.registry import ENGINES, sections
from servogen.pulse.schedule import MAX_PPM
from servogen.robot.servo_models import FactKeys
from servogen.toml.file import Table

NAME = r"^[A-Za-z][A-Za-z0-9_-]*$"

MAX_MM, MAX_S = 100_000.0, 1_000_000.0
"""A larger number must be a typing error."""

MAX_CHOSEN = 7
"""The maximum number of segments that inputs choose among: three bits hold one, or none."""

Coordinate = Annotated[float, Field(ge=-MAX_MM, le=MAX_MM)]
Point = tuple[Coordinate, Coordinate, Coordinate]
Length = Annotated[float, Field(ge=0, le=MAX_MM)]
Tilt = Annotated[float, Field(ge=-45, le=45)]
Seconds = Annotated[float, Field(ge=0, le=MAX_S)]
LawName = Literal["linear", "cubic", "quintic", "trapezoid", "s-curve", "fastest"]
Sign = Literal["positive", "negative"]
if TYPE_CHECKING:
    EngineName = str
else:
    EngineName = Literal["auto", *ENGINES]


class ChipTable(Table):
    """[chip]"""

    device: str
    clock_hz: int = Field(gt=0)


class ChipPairTable(Table):
    """One of two [[chip]], which share a crystal: the pulses on the first chip's pin `wire` tell the second
    one, on the pin `wire` of that, when a frame begins.
    """

    device: str
    clock_hz: int = Field(gt=0)
    wire: PinName
    restart: PinName | None = None
    """The second chip's open drain, wired to the first one's MCLR: it resets that when it begins."""
    crystal_ppm: int | None = Field(default=None, gt=0, le=MAX_PPM)
    """Of the second chip, if it has a crystal of its own: how far both may be from `clock_hz`."""
    servos: tuple[str, ...] | None = None
    """Its servos; without it, the second chip's begin with the first servo whose pin is in use."""


class ServoTable(FactKeys, Table):
    """[[servo]], which can override any fact of its model."""

    name: str = Field(pattern=NAME)
    pin: PinName
    model: str
    supply_v: float | None = Field(default=None, gt=0)
    trim_us: float = 0.0
    reverse: bool = False
    min_deg: float | None = None
    max_deg: float | None = None
    open_drain: bool = False
    calibration: str | None = None
    """A file written by `servogen calibrate`, beside the job, in place of `points`."""
    joint: str | None = None
    """The joint of [robot] that the servo turns; the joint is at 0 when the servo is at `zero_deg`."""
    zero_deg: float = 90.0
    ratio: float = 1.0
    """Degrees of the servo per degree of a turning joint."""
    deg_per_mm: float | None = None
    """Degrees of the servo per millimetre of a sliding joint."""
    follows: str | None = None
    """The servo with which it turns the same joint, or the same angle: a second servo, often mirrored."""


class LegTable(Table):
    """[leg]: lengths, the servos of its joints, and the servo angle at which each joint's angle is 0."""

    ab_mm: Length
    bc_mm: float = Field(ge=0.001, le=MAX_MM)
    cd_mm: Length
    df_mm: Length
    alpha: str
    beta: str
    alpha_zero_deg: float = 90.0
    beta_zero_deg: float = 90.0
    beta_sign: Literal["nearest"] | Sign = "nearest"
    tolerance_mm: float = Field(default=0.5, ge=0, le=MAX_MM)


class RobotTable(Table):
    """[robot]: a name of the catalogue, or a file."""

    name: str


class PoseTable(Table):
    """A pose of [motion] poses; all keys that are not listed here are angles, `<servo>_deg`, or the widths of
    pulses, `<servo>_us`.
    """

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "additionalProperties": False,
            "patternProperties": {"^(?!orientation_deg$).*_(deg|us)$": {"type": "number"}},
        },
    )

    name: str | None = Field(default=None, pattern=NAME)
    """Names the pose for `servogen drive --pose`, in addition to its number."""
    foot_mm: Point | None = None
    tip_mm: Point | None = None
    orientation_deg: tuple[float, ...] | None = None
    path: Literal["joint", "line", "arc"] = "joint"
    through_mm: Point | None = None
    law: LawName | None = None
    via: bool = False
    move_s: Seconds | None = None
    hold_s: Seconds = 0.0
    pause_s: Seconds = 0.0
    release: bool = False


NOT_SEGMENTS = ("stop", "quit", "wait", "next", "stance", "lead-in")
"""Names that no segment has, because `servogen drive` takes or shows them as something else."""


class ChosenSegmentTable(Table):
    """A segment of [motion] commands: the frames of the motion between two times."""

    name: Annotated[str, Field(pattern=NAME)]
    from_s: float = Field(ge=0)
    to_s: float = Field(gt=0)
    repeat: bool = False
    """Whether it plays again and again; otherwise its last frame is held."""


class MotionCommandsTable(Table):
    """[motion] commands: segments of the motion, and the inputs that choose among them, as in [walk]."""

    segments: tuple[ChosenSegmentTable, ...] = Field(min_length=1, max_length=MAX_CHOSEN)
    pin: PinName | None = None
    buttons: dict[str, PinName] | None = None
    button: PinName | None = None
    button_level: Literal["low", "high"] = "low"


class MotionTable(Table):
    """[motion]"""

    repeat: bool = True
    end: Literal["hold", "release"] | None = None
    law: LawName | None = None
    poses: tuple[PoseTable, ...] = Field(min_length=1)
    commands: MotionCommandsTable | None = None


class SegmentTable(Table):
    """A segment of [walk] route: the body's motion per cycle and the number of cycles, endless if omitted."""

    forward_mm: Coordinate = 0.0
    left_mm: Coordinate = 0.0
    turn_deg: float = Field(default=0.0, ge=-360, le=360)
    cycles: float | None = Field(default=None, gt=0, le=10_000)


class DirectionPins(Table):
    """[walk] commands buttons: the pin of each direction's button; there is at least one."""

    forward: PinName | None = None
    back: PinName | None = None
    left: PinName | None = None
    right: PinName | None = None


class CommandsTable(Table):
    """[walk] commands: the body's motion per cycle, and the inputs that select the direction."""

    forward_mm: float | None = Field(default=None, gt=0, le=MAX_MM)
    turn_deg: float | None = Field(default=None, gt=0, le=360)
    pin: PinName | None = None
    """The input for the codes; None: RA4, unless there are buttons."""
    buttons: DirectionPins | None = None
    """Instead of `pin`: the robot walks in a direction while its button is held."""
    button: PinName | None = None
    """Instead of `pin`: each press of this button commands a stop, or the next direction."""
    button_level: Literal["low", "high"] = "low"
    """The level of a pressed button."""


class WalkTable(Table):
    """[walk]"""

    gait: str = "tripod"
    duty: float | None = Field(default=None, gt=0, lt=1)
    lifts: dict[str, float] | None = None
    route: tuple[SegmentTable, ...] = ()
    commands: CommandsTable | None = None
    """Instead of `route`: the robot stands, and walks as commanded."""
    law: Literal["fastest"] | None = None
    """The shortest cycle that the servos' limits allow, as without `cycle_s`."""
    cycle_s: float | None = Field(default=None, gt=0, le=MAX_S)
    lift_mm: float = Field(default=20.0, gt=0, le=MAX_MM)
    body_height_mm: float | None = Field(default=None, gt=0, le=MAX_MM)
    stance_width_mm: float | None = Field(default=None, gt=0, le=MAX_MM)
    body_shift_mm: tuple[Coordinate, Coordinate] | None = None
    """How far forward and to the left the body stands from the middle of its feet."""
    body_yaw_deg: float | None = Field(default=None, ge=-180, le=180)
    body_tilt_deg: tuple[Tilt, Tilt] | None = None
    """Roll and pitch: positive lowers the right side, and the front."""
    margin_mm: float | None = Field(default=None, ge=0, le=MAX_MM)
    """How far inside the other feet the body leans before a foot lifts."""
    beta_sign: Sign = "positive"
    spring_mm: float | None = Field(default=None, ge=0, le=MAX_MM)
    gap_mm: float = Field(default=12.0, ge=0, le=MAX_MM)
    """The least distance between the centre lines of two legs, or a leg and the body."""
    compensate: bool = True
    """Whether the swings take up the motion that the servos lose when a joint reverses."""
    allow_falling: bool = False
    leg: str | None = None
    """The only leg that walks; None: all legs walk."""
    repeat: bool = True
    end: Literal["hold", "release"] | None = None


class HandTable(Table):
    """[program] hand: the hand's servo and its two angles."""

    servo: str
    open_deg: float
    closed_deg: float


class ProgramTable(Table):
    """[program]: a file of the arm command language, beside the job."""

    file: str
    hand: HandTable | None = None
    inputs: tuple[str, ...] = ()
    """Values of the input port, as "seconds=value"."""
    max_commands: int = Field(default=100_000, ge=1)
    max_s: float = Field(default=3600.0, gt=0, le=MAX_S)
    repeat: bool = True
    end: Literal["hold", "release"] | None = None


class RoutineTable(Table):
    """One of [drive] routines: a motion by name; what else it takes depends on the robot and the name."""

    name: str
    direction_deg: float | None = Field(default=None, ge=-360, le=360)
    distance_mm: Coordinate | None = None
    turn_deg: float | None = Field(default=None, ge=-36_000, le=36_000)


class DriveTable(Table):
    """[drive]: a closed contour of a base on wheels, or its routines by name: one of the two."""

    wheels: tuple[str, ...] = Field(min_length=1)
    corners_mm: tuple[tuple[Coordinate, Coordinate], ...] | None = Field(default=None, min_length=2)
    routines: tuple[RoutineTable, ...] | None = Field(default=None, min_length=1)
    speed_mm_s: float = Field(ge=0.001, le=MAX_MM)
    directions: Literal["any", "six"] = "any"
    pause_s: Seconds = 0.0
    ramp_s: Seconds = 0.0
    repeat: bool = True
    end: Literal["hold", "release"] | None = None


Section = MotionTable | WalkTable | ProgramTable | DriveTable
SECTIONS: Mapping[str, type[Section]] = MappingProxyType(
    {"motion": MotionTable, "walk": WalkTable, "program": ProgramTable, "drive": DriveTable}
)
"""The sections that move the servos."""


class FrameTable(Table):
    """[frame]"""

    period_us: float = Field(default=20_000.0, gt=0, le=1_000_000)
    gap_us: float = Field(default=250.0, gt=0)
    slot_us: float | None = Field(default=None, gt=0)
    per_slot: int = Field(default=1, ge=1, le=13)
    max_together: int | None = Field(default=None, ge=1, le=13)
    """The maximum number of pulses that start together, which limits the peak current."""


MAX_ERROR_US = 10.0
"""The maximum deviation of a pulse of a job that states none."""


class FirmwareTable(Table):
    """[firmware]"""

    dialect: Literal["c2c", "xc8", "sdcc"] = "c2c"
    engine: EngineName = "auto"
    soft_start_s: Seconds = 1.0
    """How long the player holds the neutral pose with its first pulses."""
    max_error_us: float | None = Field(default=None, gt=0, le=1000)
    """The maximum deviation of a pulse from the planned one; a job that exceeds it is not built. None: as
    small as flash allows, and at most MAX_ERROR_US.
    """
    start_pin: PinName | None = None
    """The pin of the start button; the player repeats its first frame until the button is pressed."""
    start_level: Literal["low", "high"] = "low"
    stop_pin: PinName | None = None
    """The pin of the emergency stop."""
    stop_level: Literal["low", "high"] = "low"
    stop_pulses: Literal["off", "hold"] | None = None


class SupplyTable(Table):
    """[supply]: the battery or power supply that feeds all servos, for `servogen twin`."""

    voltage_v: float = Field(gt=0, le=100)
    """Without load."""
    resistance_ohm: float = Field(default=0.0, ge=0, le=100)
    limit_a: float | None = Field(default=None, gt=0, le=1000)
    feeds_chip: bool = True


class SensorTable(Table):
    """One [[sensor]]: what drives an input pin, for `servogen twin`."""

    pin: PinName
    kind: Literal["foot", "end-stop", "stall"]
    of: str | None = None
    """The leg of a foot switch or the joint of an end stop; a stall comparator measures the whole supply."""
    force_n: float = Field(default=0.2, gt=0, le=1000)
    """The force at which a foot switch closes."""
    at_deg: float | None = Field(default=None, ge=-360, le=360)
    at_mm: float | None = Field(default=None, ge=-MAX_MM, le=MAX_MM)
    side: Literal["above", "below"] = "above"
    """The side of `at_deg` or `at_mm` on which an end stop is pressed."""
    above_a: float | None = Field(default=None, gt=0, le=1000)
    level: Literal["low", "high"] = "low"
    """The level of the pin while the sensor is active."""


class ExpectTable(Table):
    """[expect]: what `servogen twin` checks."""

    robot_within_mm: float | None = Field(default=None, gt=0, le=MAX_MM)
    """The allowed distance of the robot's final position from the planned one."""
    turn_within_deg: float | None = Field(default=None, gt=0, le=360)
    end_within_mm: float | None = Field(default=None, gt=0, le=MAX_MM)
    """The allowed distance of the tool from its planned path wherever the motion stops."""
    no_fall: bool = True
    drag_mm: float | None = Field(default=None, gt=0, le=MAX_MM)
    """The allowed distance that a foot is dragged in one stance."""
    torque_nm: float | None = Field(default=None, gt=0, le=1000)
    current_a: float | None = Field(default=None, gt=0, le=1000)
    within_s: float | None = Field(default=None, gt=0, le=MAX_S)
    """The time from power-up within which the motion must have been made once."""


class JobTable(Table):
    """A whole job file."""

    chip: ChipTable
    servo: tuple[ServoTable, ...] = Field(min_length=1)
    leg: LegTable | None = None
    robot: RobotTable | None = None
    motion: MotionTable | None = None
    walk: WalkTable | None = None
    program: ProgramTable | None = None
    drive: DriveTable | None = None
    frame: FrameTable = FrameTable()
    firmware: FirmwareTable = FirmwareTable()
    supply: SupplyTable | None = None
    sensor: tuple[SensorTable, ...] = ()
    expect: ExpectTable | None = None


if not TYPE_CHECKING:
    # an engine's own input has a table of its own, which only the engine knows
    JobTable = create_model(
        "JobTable",
        __base__=JobTable,
        __doc__=JobTable.__doc__,
        **{section.name: (section.table | None, None) for section in sections().values()},
    )
