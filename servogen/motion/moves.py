"""One move as frames: between two poses, along a path, through via points.

In: start and end, a law, a number of frames or the joints' limits. Out: the angles of each frame of
the move, the start exclusive and the end inclusive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from servogen.motion.follow import Followed
from servogen.motion.laws import law
from servogen.motion.limits import Limits, fastest, stretch
from servogen.motion.splines import fastest_spline, spline
from servogen.motion.trajectory import Floats

Way = Callable[[Floats], Followed]
"""Shares of a path (n,) -> the angles of all joints there (n, joints), and their distance from the path."""

EXACT = 1e-9
"""A duration above whole frames by less than this is whole frames."""


def straight(start: Floats, end: Floats, name: str, frames: int) -> Floats:
    """Return a straight move through joint space in so many frames: all joints begin and end together."""
    share = law(name).share(_shares(frames))[:, None]
    return np.where(share == 1, end, start + share * (end - start))


def fastest_straight(
    start: Floats, end: Floats, name: str, limits: Sequence[Limits], frame_s: float
) -> Floats:
    """Return the same as `straight` in as few frames as the limits allow."""
    timing = fastest(name, (end - start).tolist(), limits)
    frames = math.ceil(timing.duration / frame_s - EXACT)
    share = timing.law.share(_shares(frames))[:, None]
    return np.where(share >= 1, end, start + share * (end - start))


def along(follow: Way, name: str, frames: int) -> Followed:
    """Return a move along a path in so many frames; the first sample is its start."""
    return follow(law(name).share(np.concatenate(([0.0], _shares(frames)))))


MAX_PATH_FRAMES = 1 << 15
"""The most frames of a path without a time: 11 minutes at 50 frames per second."""


def fastest_along(follow: Way, name: str, limits: Sequence[Limits], frame_s: float) -> Followed | None:
    """Return the same as `along` in as few frames as the limits allow, None for more than
    `MAX_PATH_FRAMES`.
    """
    frames = 1
    while frames <= MAX_PATH_FRAMES:
        move = along(follow, name, frames)
        slower = stretch(move.angles, frame_s, limits)
        if slower <= 1 + EXACT:
            return move
        frames = max(frames + 1, math.floor(frames * min(slower, 2.0)))
    return None


def through(points: Floats, frames: Sequence[int], closed: bool) -> Floats:
    """Return a move through `points` (n, joints) without stopping, with n - 1 counts of frames
    between them.
    """
    times = np.concatenate(([0], np.cumsum(frames))).astype(float)
    return spline(points, times, closed).at(np.arange(1, times[-1] + 1))


def fastest_through(points: Floats, limits: Sequence[Limits], frame_s: float, closed: bool) -> Floats:
    """Return the same as `through` in as few frames as the limits allow."""
    curve = fastest_spline(points, limits, closed)
    frames = max(1, math.ceil(curve.duration / frame_s - EXACT))
    return curve.at(np.arange(1, frames + 1) * (curve.duration / frames))


def _shares(frames: int) -> Floats:
    """Return the shares of the time at the frames of a move, from after its start to its end."""
    return np.arange(1, frames + 1) / max(1, frames)
