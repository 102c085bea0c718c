"""`EngineJob`: what an engine reads of a job.

A job imports the settings of the engines (a player's buttons, a stream's serial line), so an engine cannot
import `PlannedJob`, which has the attributes listed here.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Protocol

from servogen.engines.player.buttons import Buttons
from servogen.engines.stream.settings import Stream
from servogen.motion import JointTrajectory
from servogen.pic.device import Device
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock


class FirmwareChoice(Protocol):
    """What the job says of its program."""

    @property
    def soft_start_s(self) -> Fraction: ...

    @property
    def buttons(self) -> Buttons: ...


class EngineJob(Protocol):
    """A job, as far as an engine reads it."""

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
    def stream(self) -> Stream | None: ...

    @property
    def trajectory(self) -> JointTrajectory: ...
