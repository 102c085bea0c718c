"""The fastest way along a given course of the joints, at rest at both ends: speed, acceleration, torque.

In: angles at shares of a path, limits. Out: the share of the path at each frame, in the fewest frames.

    ṡ² │   ╱╲  limit of speed          s is the length of the course in the joints' space, each joint measured
       │  ╱  ╲___╱╲                    by its speed limit. In (ṡ², s̈) every acceleration limit is linear:
       │ ╱ forward ╲ backward             |q'(s) s̈ + q''(s) ṡ²| ≤ a, and so is every torque limit
       └───────────────▶ s            backward: the largest ṡ² from which the end can be reached; forward: the
                                      largest s̈ that stays below it

Reachability on a grid after Pham and Pham, "A new approach to time-optimal path parameterization based on
reachability analysis" (IEEE Transactions on Robotics 34, 2018). A limit counts at both ends of an interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from servogen.errors import InputError
from servogen.motion.limits import STILL, JointLimits
from servogen.motion.torque import TorqueLimits
from servogen.motion.trajectory import Floats

FIRST, GRID, ROUNDS = 129, 800, 12
"""Shares at first; the intervals into which the course is divided at least; rounds of dividing long ones."""

FREE = 1e12
"""The square of a speed that nothing limits."""

Course = Callable[[Floats], Floats]
"""Shares of a path (n,) -> the angles of all joints there (n, joints)."""


@dataclass(frozen=True, slots=True, eq=False)
class TimedCourse:
    """The `shares` (n,) of a path at `times` (n,) in seconds, and the square of the speed along the course at
    `lengths` (n,).
    """

    shares: Floats
    times: Floats
    lengths: Floats
    squares: Floats

    @property
    def duration(self) -> float:
        """Return the duration in seconds."""
        return float(self.times[-1])

    def shares_in(self, frames: int) -> Floats:
        """Return the share at the beginning and at the end of each frame of a move of that many."""
        times = np.linspace(0.0, self.duration, frames + 1)
        piece = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        along = self.lengths[piece + 1] - self.lengths[piece]
        force = (self.squares[piece + 1] - self.squares[piece]) / (2 * along)
        since = times - self.times[piece]
        gone = np.sqrt(self.squares[piece]) * since + force * since**2 / 2
        part = np.clip(gone / along, 0.0, 1.0)
        shares = self.shares[piece] + part * (self.shares[piece + 1] - self.shares[piece])
        shares[-1] = 1.0
        return np.asarray(shares)


def time_optimal(
    course: Course, limits: Sequence[JointLimits], torque: TorqueLimits | None = None
) -> TimedCourse | None:
    """Return the fastest way along a course; None if no joint moves.

    Raises InputError if a joint moves that nothing limits.
    """
    shares, angles, lengths = _grid(course, limits)
    if len(shares) < 2:
        return None
    slope, bend = _derivatives(angles, lengths)
    speed = np.array([limit.speed for limit in limits])
    with np.errstate(divide="ignore"):
        fast = np.nanmin(np.where(np.abs(slope) > STILL, (speed / np.abs(slope)) ** 2, np.inf), axis=1)
    fast = np.minimum(fast, FREE)
    maximum = np.broadcast_to([limit.acceleration for limit in limits], slope.shape)
    bounds = [_Bounds(slope, bend, -maximum, maximum)]
    if torque is not None:
        places, levers = torque.levers(angles)
        weight, most = torque.held(levers)
        force, factor = (
            np.einsum("nps,np->ns", levers, derivative) for derivative in _derivatives(places, lengths)
        )
        bounds.append(_Bounds(force, factor, -most - weight, most - weight))
    every = _Bounds(*(np.hstack(parts) for parts in zip(*bounds, strict=True)))
    limited = ~np.isinf(every.high).any(axis=0)
    squares = fast
    if limited.any():
        squares = _squares(_Bounds(*(part[:, limited] for part in every)), fast, np.diff(lengths))
    steps = 2 * np.diff(lengths) / (np.sqrt(squares[:-1]) + np.sqrt(squares[1:]))
    return TimedCourse(shares, np.concatenate(([0.0], np.cumsum(steps))), lengths, squares)


def _grid(course: Course, limits: Sequence[JointLimits]) -> tuple[Floats, Floats, Floats]:
    """Return shares so close together that no interval of the course is much longer than others."""
    measure = np.array([1.0 if math.isinf(limit.speed) else limit.speed for limit in limits])
    shares = np.linspace(0.0, 1.0, FIRST)
    angles = course(shares)
    moving = np.ptp(angles, axis=0) > STILL
    for moves, limit in zip(moving.tolist(), limits, strict=True):
        if moves and math.isinf(limit.speed) and math.isinf(limit.acceleration):
            raise InputError(
                "no-speed",
                "the speed of this move is not known",
                hint="state its time, or use a servo with a stated speed, or an acceleration limit",
            )
    if not moving.any():
        return shares[:1], angles[:1], np.zeros(1)
    for _ in range(ROUNDS):
        steps = np.linalg.norm(np.diff(angles, axis=0) / measure, axis=1)
        long = np.flatnonzero(steps > steps.sum() / GRID)
        if not len(long):
            break
        middle = (shares[long] + shares[long + 1]) / 2
        shares = np.insert(shares, long + 1, middle)
        angles = np.insert(angles, long + 1, course(middle), axis=0)
    steps = np.linalg.norm(np.diff(angles, axis=0) / measure, axis=1)
    kept = np.concatenate(([True], steps > STILL * 1e-3))
    kept[-1] = True
    return shares[kept], angles[kept], np.concatenate(([0.0], np.cumsum(steps)))[kept]


def _derivatives(angles: Floats, lengths: Floats) -> tuple[Floats, Floats]:
    """Return the first and second derivative (n, joints) of the angles by the length of the course."""
    slopes = np.diff(angles, axis=0) / np.diff(lengths)[:, None]
    first = np.gradient(angles, lengths, axis=0, edge_order=2 if len(lengths) > 2 else 1)
    second = np.zeros_like(angles)
    if len(lengths) > 2:
        second[1:-1] = 2 * np.diff(slopes, axis=0) / (lengths[2:] - lengths[:-2])[:, None]
        second[0], second[-1] = second[1], second[-2]
    return first, second


class _Bounds(NamedTuple):
    """Limits low ≤ slope · s̈ + bend · ṡ² ≤ high at every place, (n, limits) each."""

    slope: Floats
    bend: Floats
    low: Floats
    high: Floats


def _squares(bounds: _Bounds, fast: Floats, steps: Floats) -> Floats:
    """Return the largest squares of the speed (n,) that keep the bounds."""
    rows = [_rows(bounds, index, step) for index, step in enumerate(steps.tolist())]
    count = len(fast)
    reach = np.zeros(count)
    for index in range(count - 2, -1, -1):
        reach[index] = _largest(
            *rows[index], float(fast[index]), float(reach[index + 1]), float(steps[index])
        )
    squares = np.zeros(count)
    for index in range(count - 1):
        here, step = float(squares[index]), float(steps[index])
        force, factor, bound = rows[index]
        with np.errstate(divide="ignore", invalid="ignore"):
            most = np.where(force > 0, (bound - factor * here) / force, np.inf).min()
        following = min(here + 2 * step * float(most), float(reach[index + 1]))
        squares[index + 1] = max(following, 0.0)
    return squares


def _rows(bounds: _Bounds, index: int, step: float) -> tuple[Floats, Floats, Floats]:
    """Return the limits of an interval, force · s̈ + factor · ṡ² ≤ bound, at both of its ends."""
    slope, bend, low, high = bounds
    after = slope[index + 1] + 2 * step * bend[index + 1]
    force = np.concatenate((slope[index], -slope[index], after, -after))
    factor = np.concatenate((bend[index], -bend[index], bend[index + 1], -bend[index + 1]))
    return force, factor, np.concatenate((high[index], -low[index], high[index + 1], -low[index + 1]))


def _largest(
    force: Floats, factor: Floats, bound: Floats, fast: float, following: float, step: float
) -> float:
    """Return the largest ṡ² up to `fast` from which some s̈ within the limits leads to 0 … `following`."""
    force = np.concatenate((force, (2 * step, -2 * step)))
    factor = np.concatenate((factor, (1.0, -1.0)))
    bound = np.concatenate((bound, (following, 0.0)))
    flat = np.abs(force) <= STILL * 1e-3
    above, below = force > 0, force < 0
    above &= ~flat
    below &= ~flat
    # Each limit that holds s̈ from above with each from below leaves a bound on ṡ² alone (Fourier, Motzkin).
    up, down = force[above][:, None], -force[below][None, :]
    slant = factor[above][:, None] * down + factor[below][None, :] * up
    room = bound[above][:, None] * down + bound[below][None, :] * up
    with np.errstate(divide="ignore", invalid="ignore"):
        pairs = np.where(slant > 0, room / slant, np.inf).min(initial=np.inf)
        alone = np.where(factor[flat] > 0, bound[flat] / factor[flat], np.inf).min(initial=np.inf)
    return max(0.0, min(fast, float(pairs), float(alone)))
