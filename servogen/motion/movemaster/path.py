"""A path through joint space -> samples frame by frame, no joint faster than its top speed.

In: points (m + 1, joints) from where the joints are to where they go, passed without stopping. Out: their
samples, the start exclusive and the end inclusive. One trapezoidal law runs over the whole path: it speeds up
once, slows down once, and each leg between two points takes its share of the time.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache

import numpy as np

from servogen.motion.laws import Law, law
from servogen.motion.trajectory import Floats

STILL = 1e-9
"""Less than this (radians, metres) is no move: inverse kinematics gives the present joints back so well."""


@cache
def _law() -> tuple[Law, float]:
    """The law and the peak of its speed."""
    shape = law("trapezoid")
    return shape, shape.peak(1)


def sampled(points: Floats, speeds: Floats, period_s: Fraction, even: bool = False) -> Floats:
    """The samples (frames, joints) of the path; no frames when nothing moves.

    `speeds` are the joints' greatest, each leg takes as long as its slowest joint; with `even` all legs take
    as long as the longest, so that points at equal distances are passed at a constant speed of the tool.
    """
    legs = np.abs(np.diff(points, axis=0))
    times = (legs / speeds).max(axis=1, initial=0.0)
    if even:
        times = np.full_like(times, times.max(initial=0.0))
    total = float(times.sum())
    if legs.max(initial=0.0) < STILL:
        return np.empty((0, points.shape[1]))
    shape, peak = _law()
    frames = math.ceil(total * peak / float(period_s) - 1e-9)
    share = shape.share(np.arange(1, frames + 1) / frames)
    marks = np.concatenate(([0.0], np.cumsum(times))) / total
    samples = np.stack([np.interp(share, marks, column) for column in points.T], axis=1)
    samples[-1] = points[-1]
    return samples
