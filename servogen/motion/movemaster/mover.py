"""The arm and its hand in time: each move, grip and wait becomes frames of joint positions.

In: poses to go to and states of the hand. Out: `Mover.samples`, one row a frame, one column a joint, then the
hand's. Errors have no place: the interpreter adds that of the command.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from servogen.errors import Caution, InputError
from servogen.kinematics.chain import fk_position
from servogen.kinematics.unreachable import Unreachable, in_mm
from servogen.motion.movemaster.arm import Manipulator
from servogen.motion.movemaster.memory import CLOSED, OPEN, Pose
from servogen.motion.movemaster.path import sampled
from servogen.motion.paths import Line
from servogen.motion.trajectory import Floats

SPEEDS = 10
"""SP 0 to SP 9: tenths of the top speed."""

FIRST_SPEED = 4
FIRST_GRIP_TENTHS = 3
"""Before the first SP and GP (the manufacturer's)."""

OFF_THE_LINE_MM = 1.0
"""A tool further than this from the line of an MS is worth a word."""


@dataclass(frozen=True, slots=True)
class Hand:
    """The hand's servo: its angles open and closed, and its top speed, in radians; None: not limited."""

    name: str
    open: float
    closed: float
    speed: float | None = None

    def angle(self, state: str) -> float:
        return self.closed if state == CLOSED else self.open


class Mover:
    """Where arm and hand are, and every frame since the beginning, when they stood at home, open."""

    def __init__(
        self, manipulator: Manipulator, hand: Hand | None, period_s: Fraction, most_s: Fraction
    ) -> None:
        self.manipulator = manipulator
        self.hand = hand
        self.period_s = period_s
        self.most_s = most_s
        self.uncounted = 1
        """Frames that are not the program's: the first, and those of its first pass."""
        self.q: Floats = np.array(manipulator.arm.home)
        self.hand_state = OPEN
        self.speed = FIRST_SPEED
        self.grip_tenths = FIRST_GRIP_TENTHS
        self.cautions: list[Caution] = []
        self.frame = 0
        self._blocks: list[Floats] = []
        self.stand(1)

    @property
    def pose(self) -> Pose:
        return self.manipulator.pose(self.q)

    @property
    def samples(self) -> Floats:
        return np.concatenate(self._blocks)

    def go(self, pose: Pose, what: str) -> None:
        """To `pose`, all joints together."""
        self.go_joints(self._solved(pose, self.q, what))

    def go_joints(self, q: Floats) -> None:
        self._path(np.stack([self.q, q]), even=False)

    def turn_joints(self, by: Floats) -> None:
        """Each joint by radians (metres), within its limits."""
        target = self.q + by
        for joint, value in zip(self.manipulator.arm.joints, target.tolist(), strict=True):
            if not joint.lower - 1e-9 <= value <= joint.upper + 1e-9:
                factor, unit = (180 / math.pi, "°") if joint.turning else (1000.0, " mm")
                raise InputError(
                    f"joint {joint.name} would turn to {value * factor:g}{unit}",
                    hint=f"its limits are {joint.lower * factor:g}{unit} to {joint.upper * factor:g}{unit}",
                )
        self.go_joints(target)

    def through(self, poses: list[tuple[Pose, str]]) -> None:
        """Through all poses without stopping."""
        points = [self.q]
        for pose, what in poses:
            points.append(self._solved(pose, points[-1], what))
        self._path(np.stack(points), even=False)

    def line(self, pose: Pose, intermediate: int, what: str) -> None:
        """To `pose` through `intermediate` points at equal distances on the straight line."""
        start = self.pose
        way = pose.plus(start, -1.0)
        points = [self.q]
        for index in range(1, intermediate + 2):
            point = pose if index > intermediate else start.plus(way, index / (intermediate + 1))
            name = what if index > intermediate else f"point {index} of {intermediate} on the line to {what}"
            points.append(self._solved(point, points[-1], name))
        samples = self._path(np.stack(points), even=True)
        self._check_line(samples, start, pose, what, intermediate)

    def grip(self, state: str) -> None:
        """Opens or closes the hand; it takes GP's time, and longer if its servo needs that."""
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
        """At least one frame, else the nearest whole number of them."""
        if seconds:
            self.stand(max(1, math.floor(seconds / self.period_s + Fraction(1, 2))))

    def stand(self, frames: int) -> None:
        row = list(self.q) + ([self.hand.angle(self.hand_state)] if self.hand else [])
        self._add(np.tile(np.array(row), (self._allowed(frames), 1)))

    def set_tool_mm(self, length: float) -> None:
        self.manipulator = self.manipulator.with_tool_mm(length)

    def kept(self) -> tuple[object, ...]:
        """Everything that decides how it will move, to be compared."""
        joints = tuple(float(value) for value in np.round(self.q, 9) + 0.0)
        return joints, self.hand_state, self.speed, self.grip_tenths, self.manipulator.tool_mm

    def _solved(self, pose: Pose, near: Floats, what: str) -> Floats:
        try:
            return self.manipulator.solve(pose, near)
        except Unreachable as error:
            raise InputError(
                f"{what} {pose} cannot be reached: {error.reason}",
                hint=f"the nearest reachable point is {in_mm(error.nearest)}",
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

    def _check_line(self, samples: Floats, start: Pose, end: Pose, what: str, intermediate: int) -> None:
        """How far the tool leaves the line between its points, where only the joints are straight."""
        line = Line(*((each.x / 1000, each.y / 1000, each.z / 1000) for each in (start, end)))
        tools = fk_position(self.manipulator.arm, samples)
        worst = 1000 * float(line.distance(tools).max(initial=0.0))
        if worst > OFF_THE_LINE_MM:
            self.cautions.append(
                Caution(
                    "off-the-line",
                    f"on its way to {what} the tool is up to {worst:.1f} mm off the straight line: "
                    f"more than {intermediate} intermediate points would keep it nearer",
                )
            )

    def _allowed(self, frames: int) -> int:
        if (self.frame + frames - self.uncounted) * self.period_s > self.most_s:
            raise InputError(
                f"the program would take longer than {float(self.most_s):g} s",
                hint="end it with ED; what should go on for ever is repeated by its job; or allow more time",
            )
        return frames

    def _add(self, rows: Floats) -> None:
        self._allowed(len(rows))
        self.frame += len(rows)
        self._blocks.append(rows)
