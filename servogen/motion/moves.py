"""One move as frames: between two poses, along a path, through via points on a spline.

In: start and end, a law, a number of frames or the joints' limits. Out: the angles in each frame of the move,
excluding the start and including the end.

A spline over all joints passes its points with continuous speed and acceleration; it is at rest at both ends,
or closed, so that a loop never stops.

    joint   ●╌╌╲     ╱╌●        speeds m at the points solve, for each inner point i with h the intervals,
            rest ╲●╱   rest     m[i-1]/h[i-1] + 2 m[i] (1/h[i-1] + 1/h[i]) + m[i+1]/h[i]
                  via             = 3 (Δ[i-1]/h[i-1]² + Δ[i]/h[i]²)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.motion.follow import Followed
from servogen.motion.laws import law
from servogen.motion.limits import JointLimits, at_rest, fastest, stretch
from servogen.motion.time_optimal import time_optimal
from servogen.motion.torque import TorqueLimits
from servogen.motion.trajectory import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """A spline through `points` (n, joints) at `times` (n,) with `speeds` (n, joints)."""

    times: Floats
    points: Floats
    speeds: Floats

    @property
    def duration(self) -> float:
        """Return the duration in seconds."""
        return float(self.times[-1] - self.times[0])

    def at(self, time: ArrayLike, order: int = 0) -> Floats:
        """Return positions, or their derivatives of `order`, at times, shape (..., joints)."""
        when: Floats = np.clip(np.asarray(time, float), self.times[0], self.times[-1])
        piece = np.minimum(np.searchsorted(self.times, when, side="right") - 1, len(self.times) - 2)
        a, b, c, d = (part[piece] for part in self._coefficients())
        t = (when - self.times[piece])[..., None]
        if order == 0:
            return np.asarray(a + t * (b + t * (c + t * d)))
        if order == 1:
            return np.asarray(b + t * (2 * c + t * 3 * d))
        if order == 2:
            return np.asarray(2 * c + 6 * d * t)
        return np.asarray(6 * d + 0 * t)

    def peaks(self) -> tuple[Floats, Floats]:
        """Return the maximum speed and acceleration of each joint, at the points or extrema of the speed."""
        _, b, c, d = self._coefficients()
        h = np.diff(self.times)[:, None]
        # The speed is quadratic in each interval; its extremum, where the acceleration is 0, may lie inside.
        # With d = 0 there is none, and any place in the interval will do.
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.clip(np.nan_to_num(-c / (3 * d)), 0.0, h)
        speeds = (b, b + h * (2 * c + h * 3 * d), b + turn * (2 * c + turn * 3 * d))
        accelerations = (2 * c, 2 * c + 6 * d * h)
        return (
            np.max(np.abs(np.stack(speeds)), axis=(0, 1)),
            np.max(np.abs(np.stack(accelerations)), axis=(0, 1)),
        )

    def slower(self, factor: float) -> Spline:
        """Return the same spline in `factor` times the time."""
        return Spline(self.times * factor, self.points, self.speeds / factor)

    def _coefficients(self) -> tuple[Floats, Floats, Floats, Floats]:
        h = np.diff(self.times)[:, None]
        slope = np.diff(self.points, axis=0) / h
        m0, m1 = self.speeds[:-1], self.speeds[1:]
        return self.points[:-1], m0, (3 * slope - 2 * m0 - m1) / h, (m0 + m1 - 2 * slope) / h**2


def spline(points: ArrayLike, times: ArrayLike, closed: bool = False) -> Spline:
    """Return the spline through `points` at rising `times`; if closed, the last point repeats the first."""
    points, times = np.asarray(points, float), np.asarray(times, float)
    if len(points) < 2 or len(times) != len(points) or not (np.diff(times) > 0).all():
        raise InputError("pose-keys", "a spline needs two points or more, and a later time for each")
    h = np.diff(times)
    pull = np.diff(points, axis=0) / (h**2)[:, None]
    n = len(points)
    matrix, right = np.zeros((n, n)), np.zeros_like(points)
    for i in range(1, n - 1):
        matrix[i, i - 1 : i + 2] = 1 / h[i - 1], 2 / h[i - 1] + 2 / h[i], 1 / h[i]
        right[i] = 3 * (pull[i - 1] + pull[i])
    if closed:
        # The first point's equation includes the last interval; the last point's speed is the first's.
        matrix[0, [0, 1]] = 2 / h[-1] + 2 / h[0], 1 / h[0]
        matrix[0, n - 2] += 1 / h[-1]
        right[0] = 3 * (pull[-1] + pull[0])
        matrix[-1, [0, -1]] = 1.0, -1.0
    else:
        matrix[0, 0] = matrix[-1, -1] = 1.0
    return Spline(times, points, np.linalg.solve(matrix, right))


def fastest_spline(points: ArrayLike, limits: Sequence[JointLimits], closed: bool = False) -> Spline:
    """Return the fastest spline through `points` within the limits, with intervals proportional to their
    travel.

    Raises InputError if nothing limits a joint that moves, and for two equal points in a row.
    """
    points = np.asarray(points, float)
    maximum = np.array([limit.speed for limit in limits])
    if np.isinf(maximum[np.ptp(points, axis=0) > 0]).any():
        raise InputError("no-speed", "via points without a time need a speed limit of every joint that moves")
    h = (np.abs(np.diff(points, axis=0)) / maximum).max(axis=1)
    if not (h > 0).all():
        raise InputError("pose-keys", "two via points in a row are the same")
    first = spline(points, np.concatenate(([0.0], np.cumsum(h))), closed)
    speed, acceleration = first.peaks()
    bound = np.array([limit.acceleration for limit in limits])
    # k times the time divides speeds by k and accelerations by k².
    return first.slower(max(float((speed / maximum).max()), float(np.sqrt((acceleration / bound).max()))))


FollowPath = Callable[[Floats], Followed]
"""Shares of a path (n,) -> the angles of all joints there (n, joints), and their distance from the path."""

EXACT = 1e-9
"""A duration above whole frames by less than this is whole frames."""


def straight(start: Floats, end: Floats, name: str, frames: int) -> Floats:
    """Return a straight move through joint space in `frames` frames: all joints start and stop together."""
    share = law(name).share(_shares(frames))[:, None]
    # The last frame is the end itself, without rounding.
    return np.where(share == 1, end, start + share * (end - start))


def fastest_straight(
    start: Floats, end: Floats, name: str, limits: Sequence[JointLimits], frame_s: float
) -> Floats:
    """Return a move as `straight` does, in as few frames as the limits allow."""
    timing = fastest(name, (end - start).tolist(), limits)
    frames = timing.duration / frame_s
    if name == "linear":
        # Its speed begins at once: within a frame, which makes the acceleration finite.
        distances = zip(np.abs(end - start).tolist(), limits, strict=True)
        frames = max(frames, *(distance / (limit.acceleration * frame_s**2) for distance, limit in distances))
    frames = math.ceil(frames - EXACT)
    share = timing.law.share(_shares(frames))[:, None]
    return np.where(share >= 1, end, start + share * (end - start))


def along(follow: FollowPath, name: str, frames: int) -> Followed:
    """Return a move along a path in `frames` frames; the first sample is its start."""
    return follow(law(name).share(np.concatenate(([0.0], _shares(frames)))))


MAX_PATH_FRAMES = 1 << 15
"""The maximum number of frames of a path without a time: 11 minutes at 50 frames per second."""


def fastest_along(
    follow: FollowPath, name: str, limits: Sequence[JointLimits], frame_s: float
) -> Followed | None:
    """Return a move as `along` does, in as few frames as the limits allow; None for more than
    `MAX_PATH_FRAMES`.
    """
    frames = 1
    while frames <= MAX_PATH_FRAMES:
        move = along(follow, name, frames)
        slower = stretch(at_rest(move.angles), frame_s, limits)
        if slower <= 1 + EXACT:
            return move
        # Samples of a longer move lie at other places of the path, where the joints may be slower: the factor
        # is an estimate, so it is rounded down, at most doubled, and checked again.
        frames = max(frames + 1, math.floor(frames * min(slower, 2.0)))
    return None


def quickest_along(
    follow: FollowPath, limits: Sequence[JointLimits], frame_s: float, torque: TorqueLimits | None = None
) -> Followed | None:
    """Return a move along a path in which at every place some joint is at its limit; None for more than
    `MAX_PATH_FRAMES`.
    """
    timed = time_optimal(lambda shares: follow(shares).angles, limits, torque)
    if timed is None:
        return follow(np.array([0.0, 1.0]))
    frames = max(1, math.ceil(timed.duration / frame_s - EXACT))
    while frames <= MAX_PATH_FRAMES:
        move = follow(timed.shares_in(frames))
        slower = stretch(at_rest(move.angles), frame_s, limits)
        if torque is not None:
            slower = max(slower, torque.stretch(move.angles, frame_s))
        if slower <= 1 + EXACT:
            return move
        frames = max(frames + 1, math.floor(frames * min(slower, 2.0)))
    return None


def quickest_straight(
    start: Floats, end: Floats, limits: Sequence[JointLimits], frame_s: float, torque: TorqueLimits
) -> Floats | None:
    """Return a straight move through joint space, as `quickest_along` does."""

    def follow(shares: Floats) -> Followed:
        # The last share is 1: there the move is at the end itself, without rounding.
        part = shares[:, None]
        return Followed(shares, np.where(part == 1, end, start + part * (end - start)), 0.0)

    move = quickest_along(follow, limits, frame_s, torque)
    return None if move is None else move.angles[1:]


def quickest_through(
    points: Floats, limits: Sequence[JointLimits], frame_s: float, torque: TorqueLimits | None = None
) -> Floats:
    """Return a move through `points` on the curve of `fastest_through`, as `quickest_along` does."""
    curve = fastest_spline(points, limits)

    def follow(shares: Floats) -> Followed:
        return Followed(shares, curve.at(shares * curve.duration), 0.0)

    move = quickest_along(follow, limits, frame_s, torque)
    return fastest_through(points, limits, frame_s, closed=False) if move is None else move.angles[1:]


def through(points: Floats, frames: Sequence[int], closed: bool) -> Floats:
    """Return a move through `points` (n, joints) without stopping, with n - 1 numbers of frames between."""
    times = np.concatenate(([0], np.cumsum(frames))).astype(float)
    return spline(points, times, closed).at(np.arange(1, times[-1] + 1))


def fastest_through(points: Floats, limits: Sequence[JointLimits], frame_s: float, closed: bool) -> Floats:
    """Return a move as `through` does, in as few frames as the limits allow."""
    curve = fastest_spline(points, limits, closed)
    frames = max(1, math.ceil(curve.duration / frame_s - EXACT))
    return curve.at(np.arange(1, frames + 1) * (curve.duration / frames))


def _shares(frames: int) -> Floats:
    """Return the share of the time at each frame of a move, excluding the start and including the end."""
    return np.arange(1, frames + 1) / max(1, frames)
