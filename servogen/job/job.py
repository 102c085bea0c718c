"""`Job`: what a job file says, checked and in the units of the inside."""

from __future__ import annotations

from dataclasses import dataclass

from servogen.errors import Caution
from servogen.kinematics.leg import Leg
from servogen.motion import JointTrajectory, Motion
from servogen.pic.device import Device
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock


@dataclass(frozen=True, slots=True)
class Firmware:
    """What kind of program is wanted."""

    dialect: str
    engine: str


@dataclass(frozen=True, slots=True)
class LegBinding:
    """A leg on two servos: for each joint the servo, and its angle (radians) where the joint's is 0."""

    leg: Leg
    alpha: str
    beta: str
    alpha_zero: float
    beta_zero: float
    beta_sign: int
    """1 or -1: the only sign of β that may be chosen; 0: the solution nearest to the pose before."""
    tolerance: float
    """How far, in metres, a foot position may be from the leg's surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """One job: chip, servos, motion, frame. `trajectory` has one joint a servo, in the order of `servos`."""

    name: str
    file: str
    device: Device
    clock: Clock
    servos: tuple[Servo, ...]
    leg: LegBinding | None
    motion: Motion
    frame: Frame
    firmware: Firmware
    trajectory: JointTrajectory
    warnings: tuple[Caution, ...]
