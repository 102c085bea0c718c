"""`Job`: the content of a job file, validated and in internal units; `PlannedJob`: a job and its motion."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from servogen.edges import OTHER_PINS, PINS
from servogen.engines.inputs import EngineInput, given
from servogen.engines.inputs.buttons import ControlButtons
from servogen.engines.inputs.commands import Commander, commander
from servogen.engines.inputs.serial import Stream
from servogen.errors import Diagnostic, Location
from servogen.job.chips import PairedChip
from servogen.job.ends import End, moved_ends
from servogen.job.followers import Follower
from servogen.job.schema import ExpectTable, Section, SensorTable, SupplyTable
from servogen.job.tip import Tip
from servogen.kinematics.protocol import DrivingRobot
from servogen.motion import JointTrajectory, Part
from servogen.motion.gait.commands import CommandedDirection
from servogen.notebooks import table_html
from servogen.pic.device import Device
from servogen.pulse.slots import Frame
from servogen.robot.binding import Binding
from servogen.robot.model import Limb, Robot
from servogen.robot.servo import Servo
from servogen.toml.file import Document
from servogen.units import Clock


@dataclass(frozen=True, slots=True)
class FirmwareSettings:
    """The program that a job requests."""

    dialect: str
    engine: str
    """"auto": the engine with the smallest program that can do the job."""
    soft_start_s: Fraction
    max_error_us: float
    """The maximum deviation of a pulse from the planned one."""
    precise: bool
    """Whether the job does not state it: then the pulses are as close as flash allows."""
    soft_start_place: Location | None = None


@dataclass(frozen=True, slots=True)
class NamedPose:
    """A pose of [motion] poses: the angle of every servo in the job's order, in radians."""

    name: str | None
    angles: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """A job before planning.

    `bindings` are the joints that the servos turn, but for `followers`, which turn them with another servo;
    `tip` is the end of the leg or arm that they move, `robot` that of [robot], `wheels` are the servos of
    the wheels 1, 2, … of a drive.
    """

    name: str
    document: Document
    """The file, with the location of each key."""
    chips: tuple[PairedChip, ...]
    """The two chips of [[chip]]; empty for one chip."""
    device: Device
    clock: Clock
    servos: tuple[Servo, ...]
    bindings: tuple[Binding, ...]
    followers: tuple[Follower, ...]
    robot: Robot | None
    tip: Tip | None
    wheels: tuple[str, ...]
    frame: Frame
    firmware: FirmwareSettings
    inputs: tuple[EngineInput, ...]
    """What steers the program from outside; an engine accepts or refuses each."""
    section: Section | None
    """The section that moves the servos; None for a stream job without a motion."""
    supply: SupplyTable | None
    sensors: tuple[SensorTable, ...]
    expect: ExpectTable | None
    """What `servogen twin` checks; None if the job does not say."""

    def __repr__(self) -> str:
        servos = ", ".join(f"{servo.name} on {servo.pin}" for servo in self.servos)
        chip = f"{self.device.name} at {self.clock.hz / 1e6:g} MHz"
        return f"<{type(self).__name__} {self.name}: {servos}; {chip}>"

    def _repr_html_(self) -> str:
        rows = [(servo.name, servo.pin, servo.model.title) for servo in self.servos]
        title = f"{self.name}: {self.device.name} at {self.clock.hz / 1e6:g} MHz"
        return table_html(title, ("servo", "pin", "model"), rows)

    def pin_numbers(self, shown: int = 0) -> tuple[int, ...]:
        """Return the number of each servo's pin in a trace; of two chips the one that is not `shown` (0 or 1)
        has those from `OTHER_PINS` on.
        """
        others = self.chips[1 - shown].servos if self.chips else ()
        return tuple(PINS.index(servo.pin) + OTHER_PINS * (servo.name in others) for servo in self.servos)

    @property
    def leading(self) -> tuple[Servo, ...]:
        """Return the servos that follow none."""
        following = {follower.name for follower in self.followers}
        return tuple(servo for servo in self.servos if servo.name not in following)

    def together(self, servo: str) -> tuple[Servo, ...]:
        """Return a servo and those that follow it."""
        names = {servo, *(each.name for each in self.followers if each.leader == servo)}
        return tuple(each for each in self.servos if each.name in names)

    @property
    def buttons(self) -> ControlButtons:
        """Return the start button and the emergency stop, or neither."""
        return given(self.inputs, ControlButtons) or ControlButtons()

    @property
    def commands(self) -> Commander | None:
        """Return the input that selects the direction of a walk on command; None without one."""
        return commander(self.inputs)

    @property
    def stream(self) -> Stream | None:
        """Return the serial line; None without one."""
        return given(self.inputs, Stream)

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """Return the legs or the arm of the job's robot; empty without a robot and for one on wheels."""
        if self.robot is not None:
            return self.robot.limbs
        return (self.tip.limb,) if self.tip is not None else ()

    @property
    def ends(self) -> tuple[End, ...]:
        """Return the feet or the tool that the servos move; empty for servos that move no robot."""
        return moved_ends(self.limbs, self.servos, self.bindings)

    @property
    def base(self) -> DrivingRobot | None:
        """Return the robot whose wheels the servos turn; None if the servos move something else."""
        return self.robot if self.wheels and isinstance(self.robot, DrivingRobot) else None

    @property
    def wheel_columns(self) -> list[int]:
        """Return the indices of the servos of the wheels 1, 2, …."""
        names = [servo.name for servo in self.servos]
        return [names.index(wheel) for wheel in self.wheels]

    @property
    def file(self) -> str:
        """Return the job file's name."""
        return self.document.file


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PlannedJob(Job):
    """A job and the motion of its servos.

    `trajectory` has one joint for each servo, in the order of `servos`: the angles of the servos themselves.
    `poses` are those of [motion], and empty if another section moves the servos. The user should act on the
    `warnings` or accept them; `notes` describe the motion.
    """

    trajectory: JointTrajectory
    poses: tuple[NamedPose, ...]
    warnings: tuple[Diagnostic, ...]
    notes: tuple[Diagnostic, ...]
    directions: tuple[CommandedDirection, ...] = ()
    """The directions of a walk on command, whose `trajectory` is its stance."""
    parts: tuple[Part, ...] = ()
    """The segments, poses or program lines of the motion, by the frames of `trajectory`."""
