"""Poses with holds, pauses and linear moves -> `JointTrajectory`, one sample a frame.

In: `Motion`, times in seconds as exact fractions. Out: the angles of every frame and the frame at which the
repeat begins.

    angle                           move     hold      pause   (move of the next pose …)
      │        ╱‾‾‾‾‾‾‾‾            frames in which the servos travel, then stand,
      │  ‾‾‾‾‾╱         ┄┄┄┄        then stand with pulses or, released, without
      └──────────────────────▶ frames
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from servogen.errors import Caution, InputError, Place
from servogen.motion.trajectory import Floats, JointTrajectory
from servogen.units import Clock, Cycles

MOST_FRAMES = 1 << 23
"""Longer motions are refused: more than a day at 50 frames a second."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Joint angles (radians); the seconds of the move to them, of the hold there, of the pause then."""

    angles: tuple[float, ...]
    move_s: Fraction = Fraction(0)
    hold_s: Fraction = Fraction(0)
    pause_s: Fraction = Fraction(0)
    release: bool = False
    """No pulses in the pause; otherwise they hold the position."""
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class Motion:
    """Poses in order, for ever when `repeat`; otherwise the end holds the last pose, or releases it."""

    joints: tuple[str, ...]
    poses: tuple[Pose, ...]
    repeat: bool = True
    release_at_end: bool = False


def trajectory(motion: Motion, period: Cycles, clock: Clock) -> tuple[JointTrajectory, tuple[Caution, ...]]:
    """The motion sampled at frames of `period` cycles, and what had to be rounded. Raises InputError.

    Nothing is known of where the servos are before the first pose, so its move is made only when it comes
    from the last pose: with `repeat` the loop begins after that move and ends with it.
    """
    frames = _Frames(clock.seconds(period))
    counts = [frames.of_pose(pose) for pose in motion.poses]
    total = sum(sum(count) for count in counts)
    if total > MOST_FRAMES:
        raise InputError(
            f"the motion is {total} frames long: {MOST_FRAMES} is the most",
            motion.poses[0].place,
            "shorten the holds, or let the motion repeat",
        )
    blocks = []
    for index, (pose, (move, hold, pause)) in enumerate(zip(motion.poses, counts, strict=True)):
        target = np.array(pose.angles)
        if index:
            blocks.append(_line(np.array(motion.poses[index - 1].angles), target, move))
        blocks.append(_still(target, hold))
        blocks.append(_still(target * np.nan if pose.release else target, pause))
    last, first = np.array(motion.poses[-1].angles), np.array(motion.poses[0].angles)
    if motion.repeat:
        blocks.append(_line(last, first, counts[0][0]))
    before_loop = 0 if motion.repeat else sum(len(block) for block in blocks)
    if not motion.repeat:
        blocks.append(_still(last * np.nan if motion.release_at_end else last, 1))
        if counts[0][0]:
            frames.cautions.append(
                Caution(
                    "move-unused",
                    "the first pose's move is not made: the motion does not repeat, and where the servos are "
                    "before it is not known",
                    motion.poses[0].place,
                )
            )
    angles = np.concatenate(blocks)
    if np.isnan(angles).all():
        raise InputError("the motion has no pulse", motion.poses[0].place, "give a pose hold_s or move_s")
    return JointTrajectory(motion.joints, clock, period, angles, before_loop), tuple(frames.cautions)


def _line(start: Floats, end: Floats, frames: int) -> Floats:
    """`frames` equal steps from `start`, exclusive, to `end`, inclusive (the specification's linear law)."""
    share = np.arange(1, frames + 1)[:, None] / max(1, frames)
    return np.where(share == 1, end, start + share * (end - start))


def _still(angles: Floats, frames: int) -> Floats:
    return np.tile(angles, (frames, 1))


class _Frames:
    """Seconds as whole frames; what does not divide is rounded to the nearest, and said."""

    def __init__(self, period_s: Fraction) -> None:
        self.period_s = period_s
        self.cautions: list[Caution] = []

    def of_pose(self, pose: Pose) -> tuple[int, int, int]:
        counts = (
            self._count(pose.move_s, "move_s", pose.place),
            self._count(pose.hold_s, "hold_s", pose.place),
            self._count(pose.pause_s, "pause_s", pose.place),
        )
        if not any(counts):
            raise InputError("a pose takes no time", pose.place, "give it hold_s, move_s or pause_s")
        return counts

    def _count(self, seconds: Fraction, name: str, place: Place | None) -> int:
        asked = seconds / self.period_s
        count = (2 * asked.numerator + asked.denominator) // (2 * asked.denominator)
        count = max(1, count) if seconds else 0
        if count != asked:
            achieved = float(count * self.period_s)
            self.cautions.append(
                Caution(
                    "frames-rounded",
                    f"{name} = {float(seconds):g} is not a whole number of frames: "
                    f"{count} frame{'s' if count > 1 else ''} last {achieved:.6g} s",
                    place,
                )
            )
        return count
