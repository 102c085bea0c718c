"""`Leg`: the two-joint walking leg in closed form: foot from angles, all angles from a foot, stance, torque.

In: lengths in metres, angles in radians. Out: arrays with one row per pose.

             from above                          from the side, plane x'z, seen along y'

      y'  F' = foot for β = 0                      B ─────────▶ x'
       ▲  │                                       ╱│
       │  C────D          α turns x'y' about z   ╱ │      β turns BC about y'
    B  │ ╱ l_CD                          l_BC   ╱ β│
       │╱                                      ╱   ▼ -z
       A ───▶ x'                              C
                                              │  l_DF: the slider mechanism keeps it vertical
                                              F

    x' = -l_BC sin β        y' = l_AB + l_CD = r        z = -l_BC cos β - l_DF
    X  = -r sin α - l_BC cos α sin β
    Y  =  r cos α - l_BC sin α sin β
    Z  = -l_BC cos β - l_DF

Two joints give a surface, not a volume: with s = l_BC sin β, X² + Y² = r² + s² and cos β = -(Z + l_DF) / l_BC
must hold together. Then α = atan2(Y, X) - atan2(r, -s), and both signs of β are solutions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.transforms import Floats, wrapped

REACH_TOLERANCE_M = 1e-9
"""The distance from the surface within which a foot counts as on it."""


@dataclass(frozen=True, slots=True)
class PlannedStance:
    """A planned stance, sample by sample: joint angles, and where the foot is.

    `correction_m` (n, 3) is the vector from the foot to its requested position, taken up by the spring joint
    E'.
    """

    alpha: Floats
    beta: Floats
    foot_m: Floats
    correction_m: Floats

    @property
    def largest_correction_m(self) -> float:
        """Return the length of the largest correction, in metres."""
        return float(np.linalg.norm(self.correction_m, axis=-1).max(initial=0.0))


@dataclass(frozen=True, slots=True)
class Leg:
    """The lengths l_AB, l_BC, l_CD, l_DF in metres."""

    ab: float
    bc: float
    cd: float
    df: float

    def __post_init__(self) -> None:
        for name in ("ab", "bc", "cd", "df"):
            if not getattr(self, name) >= 0:
                raise InputError(
                    "bad-length", f"the leg's length {name} is {getattr(self, name)} m: it cannot be negative"
                )
        if not (self.bc > 0 and self.r > 0):
            raise InputError("bad-length", "a leg needs l_BC > 0 and l_AB + l_CD > 0")

    @classmethod
    def of(cls, lengths: Mapping[str, float]) -> Leg:
        """Return the leg with the lengths `ab`, `bc`, `cd`, `df` of a robot file, in metres."""
        return cls(lengths["ab"], lengths["bc"], lengths["cd"], lengths["df"])

    @property
    def r(self) -> float:
        """Return the constant distance of D from the axis of α, along y'."""
        return self.ab + self.cd

    @property
    def heights(self) -> tuple[float, float]:
        """Return the lowest and the highest Z of the foot."""
        return -self.bc - self.df, self.bc - self.df

    @property
    def rest_height(self) -> float:
        """Return the lowest Z: where the foot is unless a posture says otherwise."""
        return -self.bc - self.df

    def radius(self, beta: float) -> float:
        """Return ρ, the foot's distance from the axis of α."""
        return math.hypot(self.r, self.bc * math.sin(beta))

    def ahead(self, beta: float) -> float:
        """Return the direction of the foot from the axis of α, while α = 0, from x'."""
        return math.atan2(self.r, -self.bc * math.sin(beta))

    def lifts_at(self, height_m: float) -> tuple[float, float]:
        """Return both β, the positive one first, at which the foot is at Z = `height_m`. Raises
        InputError.
        """
        beta = self.beta_at(height_m)
        return beta, -beta

    def lever(self, beta: ArrayLike) -> Floats:
        """Return the lever arm of a vertical force at the foot about joint B, l_BC sin β, in metres."""
        return np.asarray(self.bc * np.sin(np.asarray(beta, float)))

    def fk(self, alpha: ArrayLike, beta: ArrayLike) -> Floats:
        """Return the foot, shape (..., 3), in the body joint's frame."""
        alpha, beta = np.broadcast_arrays(np.asarray(alpha, float), np.asarray(beta, float))
        s = self.bc * np.sin(beta)
        sin_a, cos_a = np.sin(alpha), np.cos(alpha)
        z = -self.bc * np.cos(beta) - self.df
        return np.stack([-self.r * sin_a - s * cos_a, self.r * cos_a - s * sin_a, z], axis=-1)

    def ik(self, foot: ArrayLike, tolerance_m: float = REACH_TOLERANCE_M) -> Floats:
        """Return all angles for `foot` (..., 3): shape (..., 2, 2), the last axis (α, β), β ≥ 0 before β ≤ 0.

        Raises `Unreachable` for the first foot farther than `tolerance_m` from the surface.
        """
        foot = np.asarray(foot, float)
        angles = self.solve(foot, tolerance_m)
        lost = np.isnan(angles).any(axis=(-2, -1))
        if lost.any():
            self._refuse(foot[lost][0] if foot.ndim > 1 else foot)
        return angles

    def solve(self, foot: ArrayLike, tolerance_m: float = REACH_TOLERANCE_M) -> Floats:
        """Return the same as `ik`, with NaN where a foot is off the surface."""
        foot = np.asarray(foot, float)
        angles = self.at_height(foot)
        error = np.linalg.norm(self.fk(angles[..., 0], angles[..., 1]) - foot[..., None, :], axis=-1)
        # `not <=` refuses NaN too.
        angles[~(error <= tolerance_m)] = np.nan
        return angles

    def at_height(self, foot: Floats) -> Floats:
        """Return the angles (..., 2, 2) for the height and azimuth of `foot`, at any distance from z."""
        beta = np.arccos(np.clip(-(foot[..., 2] + self.df) / self.bc, -1.0, 1.0))
        s = self.bc * np.sin(beta)
        azimuth = np.arctan2(foot[..., 1], foot[..., 0])
        angles = np.empty((*foot.shape[:-1], 2, 2))
        angles[..., 0, 0] = wrapped(azimuth - np.arctan2(self.r, -s))
        angles[..., 1, 0] = wrapped(azimuth - np.arctan2(self.r, s))
        angles[..., 0, 1] = beta
        angles[..., 1, 1] = -beta
        return angles

    def _refuse(self, foot: Floats) -> None:
        x, y, z = (float(value) for value in foot)
        low, high = -self.bc - self.df, self.bc - self.df
        distance, mm = float(np.hypot(x, y)), 1000.0
        if not np.isfinite(foot).all():
            raise InputError("not-a-number", f"a foot needs finite coordinates, not ({x}, {y}, {z})")
        if not low <= z <= high:
            reason = f"the height must be between {low * mm:z.3f} and {high * mm:z.3f} mm"
        else:
            needed = float(np.hypot(self.r, np.sqrt(max(self.bc**2 - (z + self.df) ** 2, 0.0))))
            reason = (
                f"two joints reach a surface only, and at this height the foot is {needed * mm:z.3f} mm"
                f" from the axis of α, not {distance * mm:z.3f} mm"
            )
        raise Unreachable((x, y, z), reason, self.nearest((x, y, z)))

    def nearest(self, foot: ArrayLike) -> tuple[float, float, float]:
        """Return the point of the leg's surface nearest to `foot`, for any α.

        By symmetry it lies at the azimuth of the foot, so only β is searched: in the half plane (ρ, z).
        """
        x, y, z = (float(value) for value in np.asarray(foot, float))
        rho = np.hypot(x, y)
        low, high = 0.0, np.pi
        best = 0.0
        # Each round narrows the interval to two steps of the previous one: π / 200⁶ is far below 1e-9.
        for _ in range(6):
            beta = np.linspace(low, high, 401)
            away = np.hypot(
                np.hypot(self.r, self.bc * np.sin(beta)) - rho, -self.bc * np.cos(beta) - self.df - z
            )
            best, step = float(beta[np.argmin(away)]), (high - low) / 400
            low, high = max(best - step, 0.0), min(best + step, np.pi)
        reach = float(np.hypot(self.r, self.bc * np.sin(best)))
        scale = (x / rho, y / rho) if rho > 0 else (0.0, 1.0)
        return (reach * scale[0], reach * scale[1], float(-self.bc * np.cos(best) - self.df))

    def beta_at(self, height_m: float) -> float:
        """Return the β ≥ 0 at which the foot is at Z = `height_m`; -β is the other one. Raises InputError.

        A height within `REACH_TOLERANCE_M` of the lowest or the highest one is that one.
        """
        low, high = -self.bc - self.df, self.bc - self.df
        for end, beta in ((low, 0.0), (high, np.pi)):
            if abs(height_m - end) <= REACH_TOLERANCE_M:
                return beta
        if not low < height_m < high:
            raise InputError(
                "out-of-reach",
                f"no β gives the height {1000 * height_m:z.3f} mm",
                hint=f"this leg's foot is between {1000 * low:z.3f} and {1000 * high:z.3f} mm",
            )
        return float(np.arccos(-(height_m + self.df) / self.bc))

    def straight(self, stride_m: float, height_m: float, samples: int, side: int = 1) -> Floats:
        """Return the straight stance path along -X (the body goes along +X), shape (samples, 3), front to
        back.

        The line has the distance from the axis that halves the maximum correction: it is as far inside the
        foot's circle of radius ρ in the middle as outside it at the ends.

            ends ρ' = √(y² + (stride/2)²) = ρ + e,  middle y = ρ - e   ⇒   e = stride² / (16 ρ)
        """
        if samples < 2 or side not in (1, -1):
            raise InputError("out-of-range", "a stance path needs two samples or more and a side of 1 or -1")
        rho = float(np.hypot(self.r, self.bc * np.sin(self.beta_at(height_m))))
        x = np.linspace(stride_m / 2, -stride_m / 2, samples)
        y = np.full(samples, side * (rho - stride_m**2 / (16 * rho)))
        return np.stack([x, y, np.full(samples, height_m)], axis=-1)

    def stance(self, path: ArrayLike, beta_sign: int = 1) -> PlannedStance:
        """Return the angles that follow a foot path (n, 3) at its heights, and what remains for the spring.

        At constant height β is constant and the foot follows a circle about the axis of α: the foot is put at
        the azimuth of the requested point, so that the correction is radial, the shortest possible at that
        height.
        """
        path = np.atleast_2d(np.asarray(path, float))
        for height in (path[:, 2].min(), path[:, 2].max()):
            self.beta_at(float(height))
        if beta_sign not in (1, -1):
            raise InputError("out-of-range", f"the sign of β is 1 or -1, not {beta_sign}")
        angles = self.at_height(path)[:, 0 if beta_sign == 1 else 1, :]
        # atan2 jumps by a turn where the path crosses its cut.
        alpha = np.unwrap(angles[:, 0])
        foot = self.fk(alpha, angles[:, 1])
        return PlannedStance(alpha, angles[:, 1], foot, path - foot)

    def torque(self, beta: ArrayLike, force_n: ArrayLike) -> Floats:
        """Return the static torque on joint B, in N·m, under a vertical force at the foot: F l_BC sin β."""
        return np.asarray(np.asarray(force_n, float) * self.bc * np.sin(np.asarray(beta, float)))
