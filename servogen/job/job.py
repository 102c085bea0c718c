"""`Job`: what a job file says, checked and in the units of the inside; `PlannedJob`: what its servos do."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from servogen.engines.player.buttons import Buttons
from servogen.engines.stream.settings import Stream
from servogen.errors import Caution, Location
from servogen.job.schema import Section
from servogen.job.tip import Tip
from servogen.kinematics.protocol import DrivingRobot
from servogen.motion import JointTrajectory
from servogen.pic.device import Device
from servogen.pulse.slots import Frame
from servogen.robot.binding import Binding
from servogen.robot.model import Limb, Robot
from servogen.robot.servo import Servo
from servogen.toml.file import Document
from servogen.units import Clock


@dataclass(frozen=True, slots=True)
class Firmware:
    """What kind of program is wanted."""

    dialect: str
    engine: str
    """"auto": the smallest that can do the job."""
    soft_start_s: Fraction
    buttons: Buttons
    soft_start_place: Location | None = None


@dataclass(frozen=True, slots=True)
class NamedPose:
    """One of [motion] poses: every servo's angle, in the order of the servos, radians."""

    name: str | None
    angles: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """One job, not planned yet.

    `bindings` are the joints that servos turn, `tip` the end of the leg or arm that they move, `robot` what
    was named, `wheels` the servos of a drive's wheels 1, 2, ….
    """

    name: str
    document: Document
    """The file, with the place of each key."""
    device: Device
    clock: Clock
    servos: tuple[Servo, ...]
    bindings: tuple[Binding, ...]
    robot: Robot | None
    tip: Tip | None
    wheels: tuple[str, ...]
    frame: Frame
    firmware: Firmware
    stream: Stream | None
    """The serial line of the stream engine, which then is the job's."""
    section: Section | None
    """The one that says what the servos do; None: a stream job without a motion of its own."""

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """Return the legs or the arm of the job's robot; none without a robot and for one on wheels."""
        if self.robot is not None:
            return self.robot.limbs
        return (self.tip.limb,) if self.tip is not None else ()

    @property
    def base(self) -> DrivingRobot | None:
        """Return the robot whose wheels the servos turn; None if they move something else."""
        return self.robot if self.wheels and isinstance(self.robot, DrivingRobot) else None

    @property
    def wheel_columns(self) -> list[int]:
        """Return the indices of the servos of the wheels 1, 2, …."""
        names = [servo.name for servo in self.servos]
        return [names.index(wheel) for wheel in self.wheels]

    @property
    def file(self) -> str:
        """The job file's name."""
        return self.document.file


@dataclass(frozen=True, slots=True, eq=False)
class PlannedJob(Job):
    """A job and what its servos do.

    `trajectory` has one joint for each servo, in the order of `servos`: the servos' own angles. `poses` are
    those of [motion], none where something else moves the servos. `warnings`: what the user should change or
    accept; `notes`: what is good to know of the motion.
    """

    trajectory: JointTrajectory
    poses: tuple[NamedPose, ...]
    warnings: tuple[Caution, ...]
    notes: tuple[Caution, ...]
