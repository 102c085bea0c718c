"""`Engine`: the protocol of engines; `EngineJob`: the part of a job that they read; `EnginePlan`: their
result.

A job imports the inputs of the engines, so an engine cannot import `PlannedJob`, which has the attributes
listed here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

from servogen.engines.firmware import Firmware
from servogen.engines.inputs import EngineInput
from servogen.errors import Diagnostic, Location
from servogen.motion import JointTrajectory, Part
from servogen.motion.gait.commands import CommandedDirection
from servogen.motion.trajectory import Floats
from servogen.pic.device import Device
from servogen.pulse import PulseSchedule
from servogen.pulse.plan import PulsePlan
from servogen.pulse.slots import Frame
from servogen.robot.binding import Binding
from servogen.robot.servo import Servo
from servogen.units import Clock


class FirmwareChoice(Protocol):
    """The job's choice of its program."""

    @property
    def dialect(self) -> str: ...

    @property
    def soft_start_s(self) -> Fraction: ...

    @property
    def soft_start_place(self) -> Location | None:
        """Return where the job states `soft_start_s`."""

    @property
    def max_error_us(self) -> float: ...

    @property
    def precise(self) -> bool:
        """Return whether the pulses should be as close as flash allows, below `max_error_us`."""


class MovedEnd(Protocol):
    """A foot or the tool that servos move."""

    @property
    def name(self) -> str: ...

    @property
    def kind(self) -> str:
        """Return "foot" or "tool"."""

    @property
    def columns(self) -> tuple[int, ...]:
        """Return the servos of its joints."""

    def points(self, angles: Floats) -> Floats:
        """Return where it is (n, 3), in metres, at the angles (n, servos) of all servos."""


class EngineJob(Protocol):
    """The part of a job that an engine reads."""

    @property
    def name(self) -> str: ...

    @property
    def device(self) -> Device: ...

    @property
    def clock(self) -> Clock: ...

    @property
    def servos(self) -> tuple[Servo, ...]: ...

    @property
    def frame(self) -> Frame: ...

    @property
    def firmware(self) -> FirmwareChoice: ...

    @property
    def inputs(self) -> tuple[EngineInput, ...]: ...

    @property
    def bindings(self) -> tuple[Binding, ...]: ...

    @property
    def ends(self) -> Sequence[MovedEnd]: ...

    @property
    def trajectory(self) -> JointTrajectory: ...

    @property
    def parts(self) -> tuple[Part, ...]: ...

    @property
    def directions(self) -> tuple[CommandedDirection, ...]: ...


@dataclass(frozen=True, slots=True, eq=False)
class EnginePlan:
    """A job as an engine plays it.

    `trajectory` has the engine's lead-in. `make` compiles the firmware of a dialect; it raises ResourceError
    where the chip is too small.
    """

    trajectory: JointTrajectory
    plan: PulsePlan
    make: Callable[[str], Firmware]
    data_bytes: int = 0
    """Bytes of tables that hold the motion; 0 if it is in the program itself."""
    tour: tuple[JointTrajectory, PulseSchedule] | None = None
    """All frames that the program can play, as planned and as made, where `plan` has only some of them."""
    notes: tuple[Diagnostic, ...] = ()


class Engine(Protocol):
    """A kind of program that plays a motion: a package, a folder of `templates/` and a line in `registry`."""

    @property
    def title(self) -> str:
        """Return its name in a sentence: "the player"."""

    def plan(self, job: EngineJob) -> EnginePlan:
        """Return the job's pulses. Raises InputError or ResourceError if this engine cannot play it."""
