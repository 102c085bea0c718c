"""A path in space as joint angles, on one branch of the inverse kinematics from start to end.

In: a path, the inverse kinematics along it, the joint angles at its start. Out: a `Branch`, the course of the
joints along the path, or `LeavesReach` and `ChangesBranch` if there is none; and `Followed`: joint angles at
chosen shares of the path with a stated chord error.

    joints │  ╲___            the branch is traced in steps that are small beside the distance to the
           │      ╲___○       next solution; where even the smallest step is not (○), the joints would
           │  ┄┄┄┄┄┄┄┄╲___    have to jump to another branch, and the path is refused
           └───────────────▶ share of the path

         path  ___________    the chord: the forward kinematics of the joints half-way between two
              ╱   chord   ╲   samples
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError, Location, ServogenError
from servogen.kinematics.inverse.unreachable import in_mm
from servogen.motion.paths import SpatialPath
from servogen.motion.trajectory import Floats

Inverse = Callable[[Floats, Floats], Floats]
"""Shares (n,) of the path and the joint angles expected there (n, joints) -> the solutions (n, solutions,
joints), NaN for none. The expected angles decide between whole turns; a numerical method starts there."""

Forward = Callable[[Floats], Floats]
"""Joint angles (n, joints) -> points (n, 3)."""

Shown = Callable[[Floats], str]
"""Joint angles (joints,) -> text for a message."""

INSIDE = np.array([0.25, 0.5, 0.75])
"""The shares between two samples at which the chord error is computed."""

STEP = 0.1
"""The maximum step of a joint (radians, metres) between two samples of a traced branch."""

SMALL = 0.005
"""A step smaller than this (radians, metres) is not a jump."""

FASTER = 3.0
"""The ratio to the previous slope above which a step that is not small is divided."""

APART = 4.0
"""A step is surely on the same branch if the next solution is at least this many steps away."""

SAME = 1e-6
"""Solutions closer together than this (radians, metres) are equal."""

MIN_SHARE = 1e-10
"""The smallest step, as a share of the path."""

BESIDE = 1e-7
"""The distance from a singular point, as a share of the path, at which the branch continues."""

# Shares at the beginning, shares that are solved together, and parts into which a step is divided.
FIRST_SAMPLES, BLOCK, SPLIT = 64, 64, 8
MAX_SAMPLES = 1 << 14
"""The maximum number of solutions of the inverse kinematics for one path."""


class LeavesReach(ServogenError):
    """The path has no solution at `share`, at `point` (metres)."""

    def __init__(
        self, share: float, point: tuple[float, float, float], place: Location | None, hint: str | None = None
    ) -> None:
        super().__init__(
            "leaves-reach", f"the path leaves the reachable space at {in_mm(point)}", place, hint
        )
        self.share = share
        self.point = point


class ChangesBranch(ServogenError):
    """The joints would have to jump between two solutions at `share` of the path, at `point` (metres)."""

    def __init__(
        self,
        share: float,
        point: tuple[float, float, float],
        branches: tuple[str, str],
        place: Location | None,
        hint: str | None = None,
    ) -> None:
        ends = "at its start, " if share < SAME else "at its end, " if share > 1 - SAME else "at "
        super().__init__(
            "leaves-reach",
            f"the path would change the branch of the inverse kinematics {ends}{in_mm(point)}: "
            f"from {branches[0]} to {branches[1]}",
            place,
            hint,
        )
        self.share = share
        self.point = point
        self.branches = branches


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Joint angles (n, joints) at the `shares` (n,) of the path.

    `chord_error_m` is the maximum distance from the path between the samples, `missed_m` that at the samples,
    which exceeds rounding only where a tolerance allows it.
    """

    shares: Floats
    angles: Floats
    chord_error_m: float
    missed_m: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """One branch along a path: joint angles (m, joints) at rising `shares` (m,) from 0 to 1."""

    path: SpatialPath
    inverse: Inverse
    shares: Floats
    angles: Floats
    place: Location | None = None

    @property
    def end(self) -> Floats:
        """Return the joint angles at the end of the path."""
        return np.asarray(self.angles[-1])

    def at(self, shares: Floats) -> Floats:
        """Return the joint angles (n, joints) at shares of the path. Raises LeavesReach."""
        expected = self._extrapolated(shares)
        chosen, away = _nearest(self.inverse(shares, expected), expected)
        # Where the inverse has no solution `away` is inf.
        for index in np.nonzero(~(away <= STEP))[0]:
            chosen[index] = self._beside(float(shares[index]))
        return chosen

    def followed(self, shares: ArrayLike, forward: Forward) -> Followed:
        """Return the joint angles at shares of the path with their chord error. Raises LeavesReach."""
        shares = np.asarray(shares, float)
        angles = self.at(shares)
        chord_error = float(chord_errors(self.path, angles, forward).max(initial=0.0))
        missed = float(self.path.distance(forward(angles)).max(initial=0.0))
        return Followed(shares, angles, chord_error, missed)

    def _extrapolated(self, shares: Floats) -> Floats:
        return np.stack([np.interp(shares, self.shares, column) for column in self.angles.T], axis=-1)

    def _beside(self, share: float) -> Floats:
        """Return the joint angles next to a singular point, where the inverse does not give them."""
        for near in (share - BESIDE, share + BESIDE):
            if 0 <= near <= 1:
                there = np.array([near])
                expected = self._extrapolated(there)
                chosen, away = _nearest(self.inverse(there, expected), expected)
                if away[0] <= STEP:
                    return np.asarray(chosen[0])
        if share == 0 or share == 1:
            return np.asarray(self.angles[0 if share == 0 else -1])
        raise LeavesReach(share, _point(self.path, share), self.place)


def trace(
    path: SpatialPath,
    inverse: Inverse,
    start: ArrayLike,
    shown: Shown,
    place: Location | None = None,
    hint: str | None = None,
) -> Branch:
    """Return the branch on which the joints follow `path` from the joint angles `start`.

    Raises LeavesReach or ChangesBranch (`hint` suggests an alternative), or InputError if more than 16384
    samples are needed.
    """
    return _Tracer(path, inverse, shown, place, hint).run(np.asarray(start, float))


class _Tracer:
    """The branch so far, and the remaining shares, the next one last."""

    def __init__(
        self, path: SpatialPath, inverse: Inverse, shown: Shown, place: Location | None, hint: str | None
    ) -> None:
        self.path, self.inverse, self.shown, self.place, self.hint = path, inverse, shown, place, hint
        self.shares = [0.0]
        self.angles: list[Floats] = []
        self.ahead = np.linspace(1.0, 0.0, FIRST_SAMPLES + 1)[:-1].tolist()
        self.samples = 0

    def run(self, start: Floats) -> Branch:
        """Return the branch from the joint angles `start`. Raises LeavesReach, ChangesBranch, InputError."""
        self.angles.append(start)
        while self.ahead:
            # The inverse is vectorised, so a whole block is solved although `_go` may use only a part of it.
            block = np.array(self.ahead[: -BLOCK - 1 : -1])
            if not self._go(block):
                self._divide()
        return Branch(
            path=self.path,
            inverse=self.inverse,
            shares=np.array(self.shares),
            angles=np.array(self.angles),
            place=self.place,
        )

    def _go(self, block: Floats) -> bool:
        """Add the shares of a block that are surely on the branch; return whether there was at least one."""
        count = len(self.shares)
        for candidates in self._solve(block, self.angles[-1]):
            chosen, away = _nearest(candidates[None], self.angles[-1][None])
            step = float(away[0])
            if step > self._largest_step() or not _sure(candidates, chosen[0], step):
                break
            self._take(chosen[0])
        return len(self.shares) > count

    def _largest_step(self) -> float:
        """Return how far the joints may move up to the next share: a multiple of the previous slope."""
        if len(self.shares) == 1:
            return SMALL
        longer = (self.ahead[-1] - self.shares[-1]) / (self.shares[-1] - self.shares[-2])
        # The previous step was so short, beside a singular point, that its slope says nothing about this one.
        if longer > 2 * SPLIT:
            return SMALL
        before = float(np.abs(self.angles[-1] - self.angles[-2]).max())
        return float(min(STEP, max(SMALL, FASTER * before * longer)))

    def _take(self, angles: Floats) -> None:
        self.shares.append(self.ahead.pop())
        self.angles.append(angles)

    def _divide(self) -> None:
        """Insert shares before the next one, or pass a singular point if there is no room for another
        share.
        """
        here, there = self.shares[-1], self.ahead[-1]
        if there - here > MIN_SHARE:
            self.ahead += np.linspace(there, here, SPLIT + 1)[1:-1].tolist()
        else:
            self._pass(there)

    def _pass(self, there: float) -> None:
        """Continue past a point where the inverse leaves a joint undetermined. Raises ChangesBranch at a
        jump.
        """
        here = self.angles[-1]
        # The end itself is singular: a joint that it does not determine stays where it is.
        if there == 1.0:
            self._take(here)
            return
        beside = min(there + BESIDE, 1.0)
        candidates = self._solve(np.array([beside]), here)[0]
        chosen, away = _nearest(candidates[None], here[None])
        if away[0] <= SMALL:
            # The shares within the neighbourhood of the singular point have no reliable solution.
            while self.ahead and self.ahead[-1] <= beside:
                self.ahead.pop()
            self.ahead.append(beside)
            self._take(chosen[0])
            return
        share = self.shares[-1]
        if np.isinf(away[0]):
            raise LeavesReach(beside, _point(self.path, beside), self.place, self.hint)
        both = self.shown(here), self.shown(chosen[0])
        raise ChangesBranch(share, _point(self.path, share), both, self.place, self.hint)

    def _solve(self, shares: Floats, here: Floats) -> Floats:
        self.samples += len(shares)
        if self.samples > MAX_SAMPLES:
            share = self.shares[-1]
            raise InputError(
                "path-too-fast",
                f"the path cannot be followed beyond {in_mm(_point(self.path, share))}, {100 * share:.3g} % "
                f"of it: the joints move too steeply there for {MAX_SAMPLES} samples",
                self.place,
            )
        return self.inverse(shares, np.tile(here, (len(shares), 1)))


def chord_errors(path: SpatialPath, angles: Floats, forward: Forward) -> Floats:
    """Return the maximum distance (n - 1,) from the path within each interval of samples (n, joints)."""
    if len(angles) < 2:
        return np.zeros(0)
    between = angles[:-1, None, :] + INSIDE[:, None] * (angles[1:, None, :] - angles[:-1, None, :])
    points = forward(between.reshape(-1, angles.shape[1]))
    return np.asarray(path.distance(points).reshape(-1, len(INSIDE)).max(axis=1))


def _nearest(solutions: Floats, expected: Floats) -> tuple[Floats, Floats]:
    """Return the solutions (n, joints) nearest to `expected`, and their distances (n,), inf without any."""
    away = np.abs(solutions - expected[:, None, :]).max(axis=2)
    away = np.where(np.isnan(away), np.inf, away)
    best = np.argmin(away, axis=1)[:, None]
    chosen = np.take_along_axis(solutions, best[..., None], axis=1)[:, 0]
    return chosen, np.take_along_axis(away, best, axis=1)[:, 0]


def _sure(candidates: Floats, chosen: Floats, step: float) -> bool:
    """Return whether every other solution is so far away that a step cannot have gone to it instead."""
    apart = np.abs(candidates - chosen).max(axis=1)
    others = apart[apart > SAME]
    # At a singular point branches meet: equal solutions are not others.
    return step <= SAME or not others.size or APART * step <= float(others.min())


def _point(path: SpatialPath, share: float) -> tuple[float, float, float]:
    x, y, z = path.point(np.array([share]))[0].tolist()
    return x, y, z
