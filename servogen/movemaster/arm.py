"""A robot arm as the language sees it, and its motion: tool point, pitch and roll instead of joint
positions.

In: an `Arm`, a tool length, poses in mm and degrees. Out: `Manipulator`: joint positions near the current
ones, or `Unreachable`, and poses from joint positions; `Mover`: every frame of arm and hand since the
beginning.

Pitch p and roll r are those of the RV-M1 in the vertical plane through the first axis and the tool point:

    R = Rot(z, φ) Rot(x, 90°) Rot(z, p + 90°) Rot(x, 90°) Rot(z, r),   φ = atan2(y, x)

so that p = q2 + q3 + q4 - 90° is the approach above the horizontal and r = q5 (the language's
specification). The same commands work for any arm whose inverse kinematics accepts an orientation.

A path through joint space passes its points without stopping, and no joint is faster than its maximum
speed. One trapezoidal law applies to the whole path: it accelerates once, decelerates once, and each leg
between two points takes its share of the time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import Diagnostic, InputError
from servogen.kinematics.forward import fk, fk_position
from servogen.kinematics.inverse.solve import ik, solutions_near
from servogen.kinematics.inverse.unreachable import Unreachable, in_mm
from servogen.kinematics.orientation import short_way
from servogen.kinematics.queries import joint_text, positions_of
from servogen.kinematics.transforms import rot
from servogen.motion.follow import Branch, ChangesBranch, LeavesReach, chord_errors, trace
from servogen.motion.laws import Law, law
from servogen.motion.paths import StraightLine
from servogen.motion.trajectory import MAX_FRAMES, Floats
from servogen.movemaster.memory import CLOSED, OPEN, ToolPose
from servogen.robot.model import Arm

_ON_AXIS = 1e-9
"""Nearer than this (metres) to the first axis the tool has no azimuth: home's is taken."""


@dataclass(frozen=True, slots=True)
class Manipulator:
    """An arm whose tool length is set by TL; `speeds` are its joints' maximum speeds, in radians (metres) per
    second.
    """

    arm: Arm
    speeds: tuple[float, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        """Return the names of the joints."""
        return tuple(joint.name for joint in self.arm.joints)

    @property
    def tool_mm(self) -> float:
        """Return the distance from the last link to the tool's point, in mm."""
        return 1000 * self.arm.tool.z

    def with_tool_mm(self, length: float) -> Manipulator:
        """Return the same arm with a tool of that length in mm."""
        return replace(self, arm=self.arm.with_tool(replace(self.arm.tool, z=length / 1000)))

    def pose(self, q: Floats) -> ToolPose:
        """Return the tool's pose at the joint positions `q`."""
        matrix = fk(self.arm, q)
        x, y, z = (float(value) for value in matrix[:3, 3])
        n, o, a = matrix[:3, 0], matrix[:3, 1], matrix[:3, 2]
        azimuth = float(self._azimuth(x, y))
        cosine, sine = math.cos(azimuth), math.sin(azimuth)
        lean, side_n, side_o = (
            cosine * a[0] + sine * a[1],
            sine * n[0] - cosine * n[1],
            sine * o[0] - cosine * o[1],
        )
        if not self.arm.orientation:
            return ToolPose(x=1000 * x, y=1000 * y, z=1000 * z, p=0.0, r=0.0)
        pitch = _degrees(math.atan2(lean, -a[2]) - math.pi / 2)
        return ToolPose(x=1000 * x, y=1000 * y, z=1000 * z, p=pitch, r=_degrees(math.atan2(side_n, side_o)))

    def solve(self, pose: ToolPose, near: Floats) -> Floats:
        """Return the joint positions for `pose` that are nearest to `near`. Raises `Unreachable` or
        InputError.
        """
        point = np.array([pose.x, pose.y, pose.z]) / 1000
        if not self.arm.orientation:
            if pose.p or pose.r:
                raise InputError(
                    "wrong-count",
                    f"{self.arm.name} takes no pitch and roll: they must be 0, not {pose.p:g} and {pose.r:g}",
                )
            return ik(self.arm, point, None, near)
        return ik(self.arm, point, self._rotation(pose), near)

    def solutions(self, poses: Floats, near: Floats) -> Floats:
        """Return the joint positions (n, solutions, joints) for poses (n, 5), NaN where there is no solution.

        Each is in the turn nearest to `near` (n, joints).
        """
        turns = self._rotations(poses) if self.arm.orientation else None
        return solutions_near(self.arm, poses[:, :3] / 1000, turns, near)

    def approach(self, pose: ToolPose) -> Floats:
        """Return the unit vector along the tool."""
        if not self.arm.orientation:
            raise InputError("wrong-robot-kind", f"{self.arm.name} cannot orient its tool independently")
        return np.asarray(self._rotation(pose)[:, 2])

    def _rotation(self, pose: ToolPose) -> Floats:
        return np.asarray(self._rotations(np.array([pose.values]))[0])

    def _rotations(self, poses: Floats) -> Floats:
        """Return the rotations (n, 3, 3) of poses (n, 5)."""
        x, y, _, pitch, roll = poses.T
        turns = (
            rot("z", self._azimuth(x / 1000, y / 1000)),
            rot("x", np.pi / 2),
            rot("z", np.radians(pitch) + np.pi / 2),
            rot("x", np.pi / 2),
            rot("z", np.radians(roll)),
        )
        return np.asarray(turns[0] @ turns[1] @ turns[2] @ turns[3] @ turns[4])

    def _azimuth(self, x: ArrayLike, y: ArrayLike) -> Floats:
        return np.where(np.hypot(x, y) > _ON_AXIS, np.arctan2(y, x), self.arm.home[0])


def _degrees(angle: float) -> float:
    """Return an angle in degrees, in (-180°, 180°]."""
    # -180° becomes 180°.
    return 180 - (180 - math.degrees(angle)) % 360


def manipulator(arm: Arm, speeds: tuple[float | None, ...] | None = None) -> Manipulator:
    """Return `arm` with its joints' maximum speeds, or the given `speeds`. Raises InputError if there are
    none.
    """
    chosen = speeds or tuple(joint.speed for joint in arm.joints)
    known = []
    for joint, speed in zip(arm.joints, chosen, strict=True):
        if speed is None:
            raise InputError(
                "no-speed",
                f"the maximum speed of {arm.name}'s joint {joint.name} is not known",
                hint="state its speed_deg_s in the robot's file, or bind it to a servo with a known speed",
            )
        known.append(speed)
    if (arm.tool.x, arm.tool.y, arm.tool.rx, arm.tool.ry) != (0.0, 0.0, 0.0, 0.0):
        raise InputError(
            "wrong-robot-kind", f"{arm.name}'s tool is not on its approach axis: TL sets a length along it"
        )
    return Manipulator(arm, tuple(known))


STILL = 1e-9
"""A shorter distance (radians, metres) is not a move: inverse kinematics is no more accurate than this."""


@cache
def _law() -> tuple[Law, float]:
    """Return the law and its maximum speed."""
    shape = law("trapezoid")
    return shape, shape.peak(1)


def sampled(points: Floats, speeds: Floats, period_s: Fraction, even: bool = False) -> Floats:
    """Return the samples (frames, joints) of the path; no frames if nothing moves.

    `speeds` are the joints' maximum speeds; each leg takes as long as its slowest joint. With `even`, all
    legs take as long as the longest, so that equidistant points are passed at a constant tool speed.
    """
    legs = np.abs(np.diff(points, axis=0))
    times = (legs / speeds).max(axis=1, initial=0.0)
    if even:
        times = np.full_like(times, times.max(initial=0.0))
    total = float(times.sum())
    if legs.max(initial=0.0) < STILL:
        return np.empty((0, points.shape[1]))
    shape, peak = _law()
    # The law's peak speed is `peak` times its mean, so the path takes `peak` times as long as at top speed.
    frames = math.ceil(total * peak / float(period_s) - 1e-9)
    share = shape.share(np.arange(1, frames + 1) / frames)
    # The share of the law at which each point is passed.
    marks = np.concatenate(([0.0], np.cumsum(times))) / total
    samples = np.stack([np.interp(share, marks, column) for column in points.T], axis=1)
    samples[-1] = points[-1]
    return samples


SPEEDS = 10
"""SP 0 to SP 9: tenths of the top speed."""

FIRST_SPEED = 4
FIRST_GRIP_TENTHS = 3
"""The values before the first SP and GP (the manufacturer's)."""

OFF_THE_LINE_MM = 1.0
"""A tool farther than this from the line of an MS causes a warning."""

MAX_POINTS = 99
"""The maximum number of intermediate points of MS."""


@dataclass(frozen=True, slots=True)
class Hand:
    """The hand's servo: its angles open and closed, and its maximum speed, in radians; None: not limited."""

    name: str
    open: float
    closed: float
    speed: float | None = None

    def angle(self, state: str) -> float:
        """Return the servo's angle, in radians, for the hand state `state`."""
        return self.closed if state == CLOSED else self.open


class Mover:
    """The positions of arm and hand, and every frame since the beginning, at the home position with the hand
    open.
    """

    def __init__(
        self, manipulator: Manipulator, hand: Hand | None, period_s: Fraction, max_s: Fraction
    ) -> None:
        self.manipulator = manipulator
        self.hand = hand
        self.period_s = period_s
        self.max_s = max_s
        self.uncounted = 1
        """Frames that are not the program's: the first, and those of its first pass."""
        self.q: Floats = np.array(manipulator.arm.home)
        self.hand_state = OPEN
        self.speed = FIRST_SPEED
        self.grip_tenths = FIRST_GRIP_TENTHS
        self.warnings: list[Diagnostic] = []
        self.frame = 0
        self._blocks: list[Floats] = []
        self.stand(1)

    @property
    def pose(self) -> ToolPose:
        """Return the tool's present pose."""
        return self.manipulator.pose(self.q)

    @property
    def samples(self) -> Floats:
        """Return all frames so far (frames, joints), with the hand's angle in the last column if it has a
        servo.
        """
        return np.concatenate(self._blocks)

    def go(self, pose: ToolPose, target: str) -> None:
        """Move to `pose`, all joints together."""
        self.go_joints(self._solve(pose, self.q, target))

    def go_joints(self, q: Floats) -> None:
        """Move to the joint positions `q` through joint space."""
        self._path(np.stack([self.q, q]), even=False)

    def turn_joints(self, by: Floats) -> None:
        """Move each joint by radians (metres), within its limits."""
        target = self.q + by
        for joint, value in zip(self.manipulator.arm.joints, target.tolist(), strict=True):
            if not joint.allows(value):
                raise InputError(
                    "servo-limit",
                    f"joint {joint.name} would turn to {joint.shown(value)}",
                    hint=f"its limits are {joint.shown(joint.lower)} to {joint.shown(joint.upper)}",
                )
        self.go_joints(target)

    def through(self, poses: list[tuple[ToolPose, str]]) -> None:
        """Move through all poses without stopping."""
        points = [self.q]
        for pose, target in poses:
            points.append(self._solve(pose, points[-1], target))
        self._path(np.stack(points), even=False)

    def line(self, pose: ToolPose, intermediate: int, target: str) -> None:
        """Move to `pose` through `intermediate` equidistant points on the straight line."""
        self._solve(pose, self.q, target)
        branch = self._branch(pose, target)
        points = _points_on(branch, self.q, intermediate)
        samples = self._path(points, even=True)
        self._check_line(samples, branch, target, intermediate)

    def grip(self, state: str) -> None:
        """Open or close the hand, in GP's time, or longer if its servo is slower."""
        if state == self.hand_state:
            return
        frames = math.ceil(Fraction(self.grip_tenths, 10) / self.period_s)
        before, self.hand_state = self.hand_state, state
        if self.hand is None:
            self.stand(frames)
            return
        start, end = self.hand.angle(before), self.hand.angle(state)
        if self.hand.speed:
            frames = max(
                frames, math.ceil(abs(end - start) / (self.hand.speed * float(self.period_s)) - 1e-9)
            )
        share = np.arange(1, max(1, frames) + 1) / max(1, frames)
        angles = start + share * (end - start)
        angles[-1] = end
        self._add(np.column_stack([np.tile(self.q, (len(angles), 1)), angles]))

    def wait_s(self, seconds: Fraction) -> None:
        """Wait for the nearest whole number of frames, at least one."""
        if seconds:
            self.stand(max(1, math.floor(seconds / self.period_s + Fraction(1, 2))))

    def stand(self, frames: int) -> None:
        """Add frames in which nothing moves. Raises InputError beyond the limit of the run."""
        row = list(self.q) + ([self.hand.angle(self.hand_state)] if self.hand else [])
        self._add(np.tile(np.array(row), (self._check_length(frames), 1)))

    def set_tool_mm(self, length: float) -> None:
        """Change the tool's length; nothing moves."""
        self.manipulator = self.manipulator.with_tool_mm(length)

    def kept(self) -> tuple[object, ...]:
        """Return everything that determines how the arm will move, for comparison."""
        # Rounded, because a position that is reached again differs in the last digits; + 0.0 makes -0.0 equal
        # to 0.0.
        joints = tuple(float(value) for value in np.round(self.q, 9) + 0.0)
        return joints, self.hand_state, self.speed, self.grip_tenths, self.manipulator.tool_mm

    def _solve(self, pose: ToolPose, near: Floats, target: str) -> Floats:
        try:
            return self.manipulator.solve(pose, near)
        except Unreachable as error:
            raise InputError(
                "out-of-reach",
                f"{target} {pose} cannot be reached: {error.reason}",
                hint=error.hint,
            ) from error

    def _path(self, points: Floats, even: bool) -> Floats:
        speeds = np.array(self.manipulator.speeds) * (self.speed + 1) / SPEEDS
        samples = sampled(points, speeds, self.period_s, even)
        self.q = points[-1].copy()
        columns = [samples]
        if self.hand:
            columns.append(np.full((len(samples), 1), self.hand.angle(self.hand_state)))
        self._add(np.concatenate(columns, axis=1))
        return samples

    def _branch(self, pose: ToolPose, target: str) -> Branch:
        """Return the branch on which the arm moves straight to `pose`; pitch and roll take the shorter
        turn.
        """
        start = np.array(self.pose.values)
        path = np.array(pose.values) - start
        # Pitch and roll, after x, y, z.
        path[3:] = np.degrees(short_way(np.radians(path[3:])))
        manipulator = self.manipulator

        def inverse(shares: Floats, near: Floats) -> Floats:
            poses = start + shares[:, None] * path
            # The end exactly, not by addition.
            poses[shares == 1.0] = pose.values
            return manipulator.solutions(poses, near)

        def shown(q: Floats) -> str:
            return ", ".join(joint_text(positions_of(manipulator.arm, q)).split("  "))

        line = StraightLine(_metres(start), _metres(start + path))
        try:
            return trace(line, inverse, self.q, shown)
        except ChangesBranch as error:
            raise InputError(
                "leaves-reach",
                f"the straight line to {target} would change the branch of the inverse kinematics at "
                f"{in_mm(error.point)}: from {error.branches[0]} to {error.branches[1]}",
                hint=f"MO goes to {target} through joint space",
            ) from error
        except LeavesReach as error:
            raise InputError(
                "leaves-reach",
                f"the straight line to {target} leaves what the arm reaches at {in_mm(error.point)}: "
                f"{self._reason(ToolPose(*(start + error.share * path).tolist()))}",
                hint=f"MO goes to {target} through joint space",
            ) from error

    def _reason(self, pose: ToolPose) -> str:
        """Return why a pose has no solution."""
        try:
            self.manipulator.solve(pose, self.q)
        except Unreachable as error:
            return error.reason
        return "the arm is at the limit of its reach"

    def _check_line(self, samples: Floats, branch: Branch, target: str, intermediate: int) -> None:
        """Warn where the tool leaves the line between its points, because only the joints move linearly
        there.
        """
        tools = fk_position(self.manipulator.arm, samples)
        worst = 1000 * float(branch.path.distance(tools).max(initial=0.0))
        if worst <= OFF_THE_LINE_MM:
            return
        text = f"on the move to {target} the tool is up to {worst:z.1f} mm off the straight line"
        enough = self._enough(branch, intermediate)
        self.warnings.append(
            Diagnostic(
                "warning",
                "off-the-line",
                f"{text}: {enough} intermediate points keep it within {OFF_THE_LINE_MM:g} mm"
                if enough
                else f"{text}: {MAX_POINTS} intermediate points, the maximum, do not keep it within "
                f"{OFF_THE_LINE_MM:g} mm",
            )
        )

    def _enough(self, branch: Branch, intermediate: int) -> int | None:
        """Return the larger number of intermediate points that keeps the tool near the line; None if there is
        none.
        """

        def keeps(count: int) -> bool:
            points = _points_on(branch, branch.angles[0], count)
            errors = chord_errors(branch.path, points, lambda q: fk_position(self.manipulator.arm, q))
            return 1000 * float(errors.max(initial=0.0)) <= OFF_THE_LINE_MM

        few, enough = intermediate, MAX_POINTS
        if not keeps(enough):
            return None
        # Bisection between a number that is not enough and one that is.
        while enough - few > 1:
            middle = (few + enough) // 2
            few, enough = (few, middle) if keeps(middle) else (middle, enough)
        return enough

    def _check_length(self, frames: int) -> int:
        if (self.frame + frames - self.uncounted) * self.period_s > self.max_s:
            raise InputError(
                "program-too-long",
                f"the program would take longer than {float(self.max_s):g} s",
                hint="end it with ED and let its job repeat it, or allow more time",
            )
        if self.frame + frames > MAX_FRAMES:
            raise InputError(
                "too-many-frames",
                f"the program is more than {MAX_FRAMES} frames long, {float(MAX_FRAMES * self.period_s):g} s",
                hint="shorten its waits, or make the frames longer",
            )
        return frames

    def _add(self, rows: Floats) -> None:
        self._check_length(len(rows))
        self.frame += len(rows)
        self._blocks.append(rows)


def _points_on(branch: Branch, start: Floats, intermediate: int) -> Floats:
    """Return the joint positions at the start of a branch, at equidistant points on it, and at its end."""
    shares = np.arange(1, intermediate + 2) / (intermediate + 1)
    return np.vstack([start, branch.at(shares)])


def _metres(pose: Floats) -> tuple[float, float, float]:
    x, y, z = (pose[:3] / 1000).tolist()
    return x, y, z
