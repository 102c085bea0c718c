"""The protocol of the kinds of robots: their file and facts (`RobotKind`), and how they walk or drive.

A kind is one module and one line in `registry`. Its robots are frozen values that satisfy `robot.model.Robot`
and, if they walk or drive, `WalkingRobot` or `DrivingRobot`; planning, reports and steering use nothing else.

    limbs ──▶ joints that servos turn, forward kinematics, stick figures, error at the foot or tool
    WalkingRobot.stance ──▶ motion.gait: joint angles of a walk        mass, torques ──▶ loads
    DrivingRobot.route, routine, wheel_speeds, body_speed ──▶ motion.drive: wheel speeds of a drive; steering
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

from numpy.typing import ArrayLike

from servogen.kinematics.mobility import Mobility
from servogen.kinematics.transforms import Complexes, Floats
from servogen.robot.arm_file import Find
from servogen.robot.model import Mount, Robot
from servogen.toml.file import Document, Table

Answer = dict[str, Any]
"""A value that JSON can hold, in metres and radians."""

Directions = Literal["any", "six"]
"""How a base may go from corner to corner: straight, or along the six directions of an omni base only."""


@dataclass(frozen=True, slots=True)
class RobotKind:
    """A kind of robot: the keys of its files, how they are read, and its facts for `servogen robots`.

    `table` has the keys of its files, with those of `RobotKeys`. `read` returns the robot of a validated
    file; its last argument finds the robots that the file refers to.
    `wheel_details` returns what wheel speeds in rad/s mean for this kind alone, such as an encoder's counts.
    """

    name: str
    table: type[Table]
    read: Callable[[Document, Any, Find], Robot]
    details: Callable[[Any], Answer]
    mobility: Callable[[Any], Mobility]
    wheel_details: Callable[[Any, Floats], Mapping[str, Floats]] = lambda robot, speeds: {}


@dataclass(frozen=True, slots=True)
class Posture:
    """How a walking robot stands and lifts its feet, in metres.

    None: the body is as high as the legs reach; the feet are as far apart as gives the smallest
    correction.
    """

    body_height: float | None = None
    """The height of the body's frame above the ground."""
    stance_width: float | None = None
    """The distance between left and right feet in the middle of their stance."""
    lift: float = 0.02
    beta_sign: int = 1
    """Which of the two β is used: with 1 a lifted foot goes towards the rear, with -1 to the front.

    In a walk that turns, a leg whose α would bend further with this one takes the other.
    """
    margin: float | None = None
    """How far inside the other feet the body leans before a foot lifts; None: 10 mm on four legs (of two
    joints: 5 mm), else it does not lean; nor with 0.
    """
    shift: complex = 0j
    """How far the body stands from the middle of its feet, x + iy in metres, body frame."""
    yaw: float = 0.0
    """The angle by which it is turned over its feet, radians, counter-clockwise."""
    roll: float = 0.0
    """The body's tilt about its x axis, radians: positive lowers its right side."""
    pitch: float = 0.0
    """Its tilt about the y axis, radians: positive lowers its front."""


@dataclass(frozen=True, slots=True)
class BodyMotion:
    """What the body does in a cycle: `step` (x + iy in metres, body frame), `turn` (radians).

    `duty` is the share of the cycle for which a foot is on the ground.
    """

    step: complex
    turn: float
    duty: float
    beyond: float = 0.0
    """The share of its way by which a swing goes farther beyond its foothold to take up lost motion."""

    @property
    def moves(self) -> bool:
        """Return whether the body goes anywhere or turns."""
        return bool(self.turn or self.step)

    @property
    def centre(self) -> complex | None:
        """Return the centre of rotation, c = i v / ω in the body frame; None: the body does not turn."""
        return 1j * self.step / self.turn if self.turn else None


class Stance(Protocol):
    """The legs of a robot that walks in one posture; `leg` is the leg's index, k the joints of a leg."""

    @property
    def free(self) -> bool:
        """Return whether a standing foot follows any movement of the body; else only that along its x axis,
        roughly.
        """

    def neutral(self, leg: int, motion: BodyMotion) -> complex:
        """Return where the foot (x + iy, body frame) is in the middle of its stance."""

    def held_back(self, leg: int, motion: BodyMotion) -> float:
        """Return the angle by which joint limits keep the leg from its best foothold; 0 if they do not."""

    def angles(self, leg: int, footholds: Complexes) -> Floats:
        """Return the joint angles (n, k) that put the foot nearest to footholds (n,), x + iy, body frame."""

    def lifted(self, leg: int, angles: Floats, share: Floats) -> Floats:
        """Return `angles` (n, k) with the foot raised by a share (n,) of the posture's lift."""

    def feet(self, leg: int, angles: Floats) -> Floats:
        """Return the feet (n, 3) in the body frame for joint angles (n, k)."""


@runtime_checkable
class WalkingRobot(Robot, Protocol):
    """A body on legs with equally many joints each; a leg is a limb with a mount."""

    @property
    def mass(self) -> float | None:
        """Return the mass of the whole robot in kg; None if it is not stated."""

    @property
    def centre_of_mass(self) -> tuple[float, float, float]:
        """Return (x, y, z) of the centre of mass in the body frame, in metres."""

    @property
    def lifting_joint(self) -> str:
        """Return the name of the joint of each leg that carries the weight, the one `torques` is about."""

    @property
    def sidesteps(self) -> bool:
        """Return whether the legs can step sideways."""

    def with_leg(self, name: str) -> WalkingRobot:
        """Return the robot with that leg only. Raises InputError if it has no such leg."""

    def stance(self, posture: Posture, motions: Sequence[BodyMotion]) -> Stance:
        """Return how the legs stand in a posture, for all these motions.

        Raises InputError if they cannot take it.
        """

    def corners(self, leg: int, angles: Floats) -> Floats:
        """Return the corners (n, corners, 3) of a leg's centre line, from its mount to its foot, in the body
        frame for joint angles (n, k).
        """

    def torques(self, angles: Floats, forces: Floats) -> Floats:
        """Return the torque (frames, legs) in N·m at each lifting joint.

        `angles` (frames, legs, k) are the joints', `forces` (frames, legs) the vertical ones at the feet, N.
        """


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of a base's route during which its wheels turn at constant ratios.

    `length` (metres) is what the route's speed refers to: the path of the centre or, turning on the spot,
    of the wheels. `wheel_angles` is how far each wheel turns (radians). `text` and `remark` describe it.
    """

    length: float
    wheel_angles: tuple[float, ...]
    text: str
    remark: str = ""


@dataclass(frozen=True, slots=True)
class Routine:
    """A named motion of a base, as requested in a job; None: not given.

    Directions (radians) are in the base's frame, which turns with the base.
    """

    name: str
    direction: float | None = None
    distance: float | None = None
    """Metres."""
    turn: float | None = None
    """The angle by which the base turns, radians, counter-clockwise."""


@runtime_checkable
class DrivingRobot(Robot, Protocol):
    """A base on wheels that continuous-rotation servos turn. Body speeds are vx, vy (m/s) and Ω (rad/s)."""

    @property
    def wheel_count(self) -> int:
        """Return the number of wheels."""

    def wheel_speeds(self, body: ArrayLike) -> Floats:
        """Return the wheel speeds (..., wheels) in rad/s that give the body speeds (..., 3).

        Raises InputError for a speed that the wheels cannot give the body.
        """

    def body_speed(self, wheels: ArrayLike) -> Floats:
        """Return the body speeds (..., 3) of the wheel speeds (..., wheels)."""

    def route(
        self, corners: Sequence[Sequence[float]], directions: Directions = "any"
    ) -> tuple[Stretch, ...]:
        """Return the stretches from corner to corner (x, y in metres) and back to the first.

        The base begins at the first corner with heading 0 and ends there. Raises InputError if all corners
        are equal, and for `directions` to which the base cannot be restricted.
        """

    def routine(self, routine: Routine, directions: Directions = "any") -> tuple[Stretch, ...]:
        """Return the stretches of a named motion.

        Raises InputError for an unknown name, and for missing or superfluous values.
        """

    def outline(self) -> tuple[Complexes, ...]:
        """Return the lines (corners,) to draw it with, x + iy in metres in the body frame; wheels last."""


def mounts_of(robot: Robot) -> tuple[Mount, ...]:
    """Return the mounts of a robot's legs, in the order of its limbs; none for an arm or a base."""
    return tuple(limb.mount for limb in robot.limbs if limb.mount is not None)
