"""Poses with holds, pauses and moves between them -> `JointTrajectory`, one sample per frame.

In: `Motion`, times in seconds as exact fractions. Out: the angles of every frame and the frame at which the
loop begins, warnings about rounding, notes.

    angle                           move     hold      pause   (move of the next pose …)
      │        ╱‾‾‾‾‾‾‾‾            frames in which the servos travel, then stand,
      │  ‾‾‾‾‾╱         ┄┄┄┄        then stand with pulses or, released, without
      └──────────────────────▶ frames
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from servogen.errors import Diagnostic, InputError, Location, ServogenError
from servogen.motion import moves
from servogen.motion.follow import Followed
from servogen.motion.limits import JointLimits
from servogen.motion.torque import TorqueLimits
from servogen.motion.trajectory import MAX_FRAMES, Floats, JointTrajectory, Part
from servogen.units import Clock, Cycles

QUICKEST = "fastest"
"""The law of a move that at every place is as fast as some joint allows: it has no time of its own."""

OFF_THE_PATH_M = 1e-3
"""A warning is given if the distance from a path between two frames exceeds that at the frames by more."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Joint angles in radians; the durations, in seconds, of the move to them, the hold and the pause
    after.
    """

    angles: tuple[float, ...]
    move_s: Fraction | None = Fraction(0)
    """0: immediately. None: as fast as the limits allow."""
    hold_s: Fraction = Fraction(0)
    pause_s: Fraction = Fraction(0)
    release: bool = False
    """Whether there are no pulses in the pause; otherwise pulses hold the position."""
    law: str = "linear"
    via: bool = False
    """Whether the pose is passed without stopping or holding."""
    path: moves.FollowPath | None = None
    """The path of the move; None: straight through joint space."""
    place: Location | None = None


@dataclass(frozen=True, slots=True)
class Motion:
    """Poses in order, repeated endlessly if `repeat`; otherwise the last pose is held, or released.

    `limits` are those of the joints, for moves without a time.
    """

    joints: tuple[str, ...]
    poses: tuple[Pose, ...]
    repeat: bool = True
    release_at_end: bool = False
    limits: tuple[JointLimits, ...] = ()
    torque: TorqueLimits | None = None
    """The torque limits of the fastest moves, where the masses are known."""


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPoses:
    """A trajectory, the warnings that the user should act on or accept, and notes about it."""

    trajectory: JointTrajectory
    warnings: tuple[Diagnostic, ...] = ()
    notes: tuple[Diagnostic, ...] = ()
    parts: tuple[Part, ...] = ()
    """The parts of the motion, in the order of their frames."""


def trajectory(motion: Motion, period: Cycles, clock: Clock) -> PlannedPoses:
    """Return the motion sampled at frames of `period` cycles. Raises InputError, LeavesReach
    or ChangesBranch.

    The positions of the servos before the first pose are not known, so the first pose's move is made only
    from the last pose: with `repeat` the loop begins after that move and ends with it.
    """
    sampler = _Sampler(motion, clock.seconds(period))
    sampler.run()
    angles = np.concatenate(sampler.blocks)
    first = motion.poses[0]
    if np.isnan(angles).all():
        raise InputError(
            "no-pulses", "the motion has no pulse", first.place, "add hold_s or move_s to a pose"
        )
    before_loop = 0
    if not motion.repeat:
        before_loop = len(angles)
        end = np.array(motion.poses[-1].angles)
        angles = np.concatenate(
            (angles, _still(np.full_like(end, np.nan) if motion.release_at_end else end, 1))
        )
    joints = JointTrajectory(
        joints=motion.joints, clock=clock, period=period, angles=angles, loop_start=before_loop
    )
    return PlannedPoses(joints, tuple(sampler.warnings), tuple(sampler.notes), tuple(sampler.parts))


def _still(angles: Floats, frames: int) -> Floats:
    """Return one position for a number of frames."""
    return np.tile(angles, (frames, 1))


class _Sampler:
    """Samples the motion frame by frame."""

    def __init__(self, motion: Motion, period_s: Fraction) -> None:
        self.motion = motion
        self.period_s = period_s
        self.blocks: list[Floats] = []
        self.warnings: list[Diagnostic] = []
        self.notes: list[Diagnostic] = []
        self.parts: list[Part] = []
        self._names = {id(pose): f"pose {number}" for number, pose in enumerate(motion.poses, 1)}
        self._frames = 0

    def run(self) -> None:
        """Sample all poses."""
        poses, repeat = self.motion.poses, self.motion.repeat
        self._check_via()
        if all(pose.via for pose in poses):
            self._through([*poses, poses[0]], closed=True)
            return
        self._stand(poses[0])
        frame = 0
        # A chain leads from a pose without `via` to the next; with `repeat` the last one leads back to the
        # first pose.
        while frame + 1 < len(poses) + repeat:
            end = frame + 1
            while end < len(poses) and poses[end].via:
                end += 1
            chain = [poses[index % len(poses)] for index in range(frame, end + 1)]
            self._go(chain)
            if end < len(poses):
                self._stand(chain[-1])
            frame = end
        if not repeat and poses[0].move_s:
            self.warnings.append(
                Diagnostic(
                    "warning",
                    "move-unused",
                    "the first pose's move is not made: the motion does not repeat, and the positions of the "
                    "servos before it are not known",
                    poses[0].place,
                )
            )

    def _check_via(self) -> None:
        poses = self.motion.poses
        if all(pose.via for pose in poses) and self.motion.repeat and len(poses) > 1:
            return
        for pose in (poses[0], *(() if self.motion.repeat else poses[-1:])):
            if pose.via:
                raise InputError(
                    "pose-keys",
                    "a motion cannot begin or end with a via pose",
                    pose.place,
                    "remove via = true, or add it to all poses of a motion that repeats",
                )

    def _stand(self, pose: Pose) -> None:
        """Add the hold and the pause of a pose."""
        target = np.array(pose.angles)
        hold, pause = self._count(pose.hold_s, "hold_s", pose), self._count(pose.pause_s, "pause_s", pose)
        if hold:
            self._add(_still(target, hold), pose)
        if pause:
            self._add(_still(np.full_like(target, np.nan) if pose.release else target, pause), pose)
        if not hold and not pause and pose.move_s == 0:
            raise InputError("pose-keys", "a pose takes no time", pose.place, "add hold_s, move_s or pause_s")

    def _go(self, chain: Sequence[Pose]) -> None:
        """Add the move from the first pose of the chain to its last, through those between."""
        if len(chain) > 2:
            self._through(chain, closed=False)
            return
        before, pose = chain
        start, end = np.array(before.angles), np.array(pose.angles)
        try:
            if pose.path is not None:
                self._along(pose, pose.path)
            elif pose.move_s is None:
                self._add(self._straight(start, end, pose.law), pose)
            else:
                frames = self._count(pose.move_s, "move_s", pose)
                self._add(moves.straight(start, end, pose.law, frames), pose)
        except ServogenError as error:
            raise error if error.location else error.at(pose.place) from error

    def _straight(self, start: Floats, end: Floats, law: str) -> Floats:
        """Return the move straight through joint space, without a time."""
        limits, frame_s, torque = self.motion.limits, float(self.period_s), self.motion.torque
        if law == QUICKEST and torque is not None:
            move = moves.quickest_straight(start, end, limits, frame_s, torque)
            if move is not None:
                return move
        # Without torques a constant acceleration, speed and deceleration are the fastest.
        return moves.fastest_straight(start, end, "trapezoid" if law == QUICKEST else law, limits, frame_s)

    def _along(self, pose: Pose, path: moves.FollowPath) -> None:
        """Add the move along a path in space, with a note or warning about its chord error."""
        frame_s, limits = float(self.period_s), self.motion.limits
        number = next(number for number, other in enumerate(self.motion.poses, 1) if other is pose)
        move: Followed | None
        if pose.law == QUICKEST:
            move = moves.quickest_along(path, limits, frame_s, self.motion.torque)
        elif pose.move_s is None:
            move = moves.fastest_along(path, pose.law, limits, frame_s)
        else:
            move = moves.along(path, pose.law, self._count(pose.move_s, "move_s", pose))
        if move is None:
            raise InputError(
                "path-too-fast",
                f"the path to pose {number} cannot be followed within the joints' limits: "
                f"not even in {moves.MAX_PATH_FRAMES} frames, {moves.MAX_PATH_FRAMES * frame_s:g} s",
                pose.place,
                "state its time, move_s = …; a move that is then too fast gives a warning",
            )
        self._add(move.angles[1:], pose)
        followed = f"the path to pose {number} is followed within {1000 * move.chord_error_m:z.3f} mm"
        if move.chord_error_m <= move.missed_m + OFF_THE_PATH_M:
            self.notes.append(Diagnostic("note", "off-the-path", followed, pose.place))
        else:
            if pose.law != QUICKEST:
                followed += _slower(pose, path, len(move.angles) - 1, frame_s)
            self.warnings.append(Diagnostic("warning", "off-the-path", followed, pose.place))

    def _through(self, chain: Sequence[Pose], closed: bool) -> None:
        """Add the spline through the poses of a chain. Raises InputError if only some of them have a time."""
        points = np.array([pose.angles for pose in chain])
        timed = [pose.move_s for pose in chain[1:]]
        for pose in chain[1:]:
            if (pose.move_s is None) != (timed[0] is None) or pose.move_s == 0 or pose.path is not None:
                raise InputError(
                    "pose-keys",
                    "either all via poses have a time, or none has",
                    pose.place,
                    "add move_s, and no path, to all of them, or remove it from all",
                )
        if timed[0] is None:
            limits, frame_s = self.motion.limits, float(self.period_s)
            if chain[-1].law == QUICKEST and not closed:
                self._add(moves.quickest_through(points, limits, frame_s, self.motion.torque), chain[-1])
            else:
                self._add(moves.fastest_through(points, limits, frame_s, closed), chain[-1])
            return
        counts = [self._count(pose.move_s, "move_s", pose) for pose in chain[1:] if pose.move_s]
        self._add(moves.through(points, counts, closed), chain[-1])

    def _add(self, block: Floats, pose: Pose) -> None:
        """Add the frames of a part of a pose's way or stay; an immediate move has none."""
        if not len(block):
            return
        name = self._names[id(pose)]
        if not self.parts or self.parts[-1].name != name:
            self.parts.append(Part(name, self._frames))
        self.blocks.append(block)
        self._frames += len(block)
        if self._frames > MAX_FRAMES:
            raise self._too_long("with this pose", pose)

    def _too_long(self, cause: str, pose: Pose) -> InputError:
        longest_s = float(MAX_FRAMES * self.period_s)
        return InputError(
            "too-many-frames",
            f"{cause} the motion is more than {MAX_FRAMES} frames long, {longest_s:g} s",
            pose.place,
            "shorten move_s, hold_s and pause_s, or let the motion repeat",
        )

    def _count(self, seconds: Fraction, name: str, pose: Pose) -> int:
        """Return a time in whole frames; a warning reports the rounding."""
        asked = seconds / self.period_s
        # Rounds half up, exactly, unlike `round`, which rounds half to even.
        count = (2 * asked.numerator + asked.denominator) // (2 * asked.denominator)
        count = max(1, count) if seconds else 0
        if count > MAX_FRAMES:
            raise self._too_long(f"with {name} = {float(seconds):g}", pose)
        if count != asked:
            self.warnings.append(
                Diagnostic(
                    "warning",
                    "frames-rounded",
                    f"{name} = {float(seconds):g} is not a whole number of frames: "
                    f"{count} frame{'s' if count > 1 else ''} last {float(count * self.period_s):.6g} s",
                    pose.place,
                )
            )
        return count


def _slower(pose: Pose, path: moves.FollowPath, frames: int, frame_s: float) -> str:
    """Return a hint with a longer time for which a move stays near its path; empty if none helps."""
    for longer in (2 * frames, 4 * frames, 8 * frames, 16 * frames):
        if longer <= moves.MAX_PATH_FRAMES:
            move = moves.along(path, pose.law, longer)
            if move.chord_error_m <= move.missed_m + OFF_THE_PATH_M:
                error_mm = 1000 * move.chord_error_m
                return f"; move_s = {longer * frame_s:g} keeps it within {error_mm:z.3f} mm"
    return ""
