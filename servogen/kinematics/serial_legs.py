"""The legs of the field: `HipLift` of two joints and `CoxaFemurTibia` of three, in closed form.

In: lengths in metres, angles in radians. Out: arrays with one row per pose, in the hip's frame: x' forward,
y' outward, z up. At zero the femur is level and the tibia points straight down.

    from above                     from the side, along x'

       y' ▲ ● foot                    hip ○────○──────○     coxa, femur
          │╱  hip turns about z           coxa  femur │     both other axes point along x' and lift the foot
          ○───▶ x'                                    │     outwards: positive is up
                                                      ● foot, tibia below the knee

    hip-lift            ρ = coxa + femur cos λ + tibia sin λ      z = femur sin λ - tibia cos λ
    coxa-femur-tibia    ρ = coxa + femur cos φ + tibia sin(φ+τ)   z = femur sin φ - tibia cos(φ+τ)
    both                X = -ρ sin h        Y = ρ cos h           Z = z

The rigid leg of hip-lift is that of coxa-femur-tibia with its knee held at τ = 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.kinematics.leg import REACH_TOLERANCE_M
from servogen.kinematics.transforms import Floats, wrapped


def _placed(hip: Floats, out: Floats, height: Floats) -> Floats:
    """Return the points (..., 3) at the distance `out` from the hip's axis."""
    hip, out, height = np.broadcast_arrays(hip, out, height)
    return np.stack([-out * np.sin(hip), out * np.cos(hip), height], axis=-1)


@dataclass(frozen=True, slots=True)
class HipLift:
    """The lengths of a leg whose hip turns it and whose lift turns all the rest of it, in metres."""

    coxa: float
    femur: float
    tibia: float

    @classmethod
    def of(cls, lengths: Mapping[str, float]) -> HipLift:
        """Return the leg with the lengths of a robot file, in metres."""
        return cls(lengths["coxa"], lengths["femur"], lengths["tibia"])

    @property
    def heights(self) -> tuple[float, float]:
        """Return the lowest and the highest Z of the foot."""
        return -self._length, self._length

    @property
    def rest_height(self) -> float:
        """Return Z of the foot at zero: where it is unless a posture says otherwise."""
        return -self.tibia

    def radius(self, lift: float) -> float:
        """Return ρ, the foot's distance from the hip's axis; negative behind the axis."""
        return self.coxa + self.femur * math.cos(lift) + self.tibia * math.sin(lift)

    def ahead(self, lift: float) -> float:
        """Return the direction of the foot from the hip's axis, while the hip is at 0, from x': outwards."""
        return math.pi / 2

    def fk(self, hip: ArrayLike, lift: ArrayLike) -> Floats:
        """Return the foot, shape (..., 3), in the hip's frame."""
        hip, lift = np.asarray(hip, float), np.asarray(lift, float)
        cosine, sine = np.cos(lift), np.sin(lift)
        out = self.coxa + self.femur * cosine + self.tibia * sine
        return _placed(hip, out, self.femur * sine - self.tibia * cosine)

    def at_height(self, height: Floats) -> Floats:
        """Return both lifts (..., 2) at which the foot is at a height, the outer one first; heights beyond
        reach are clipped.
        """
        rise = np.arcsin(np.clip(height / self._length, -1.0, 1.0))
        return np.asarray(
            wrapped(np.stack([rise, np.pi - rise], axis=-1) + math.atan2(self.tibia, self.femur))
        )

    def lifts_at(self, height_m: float) -> tuple[float, ...]:
        """Return the lifts at which the foot is at Z = `height_m` and before the hip, the outer one first.

        Raises InputError if there are none.
        """
        if abs(height_m) > self._length + REACH_TOLERANCE_M:
            raise InputError("out-of-reach", f"no lift gives the height {1000 * height_m:z.3f} mm")
        found = tuple(lift for lift in self.at_height(np.array(height_m)).tolist() if self.radius(lift) > 0)
        if not found:
            raise InputError("out-of-reach", "the foot would be behind the hip's axis")
        return found

    def torque(self, lift: ArrayLike, force_n: ArrayLike) -> Floats:
        """Return the static torque on the lift, in N·m, under a vertical force at the foot."""
        lift = np.asarray(lift, float)
        return np.asarray(
            np.asarray(force_n, float) * (self.femur * np.cos(lift) + self.tibia * np.sin(lift))
        )

    @property
    def _length(self) -> float:
        return math.hypot(self.femur, self.tibia)


@dataclass(frozen=True, slots=True)
class CoxaFemurTibia:
    """The lengths of a leg of three joints, in metres."""

    coxa: float
    femur: float
    tibia: float

    @classmethod
    def of(cls, lengths: Mapping[str, float]) -> CoxaFemurTibia:
        """Return the leg with the lengths of a robot file, in metres."""
        return cls(lengths["coxa"], lengths["femur"], lengths["tibia"])

    def fk(self, angles: Floats) -> Floats:
        """Return the foot, shape (..., 3), in the hip's frame, for angles (..., 3)."""
        femur, both = angles[..., 1], angles[..., 1] + angles[..., 2]
        out = self.coxa + self.femur * np.cos(femur) + self.tibia * np.sin(both)
        return _placed(angles[..., 0], out, self.femur * np.sin(femur) - self.tibia * np.cos(both))

    def solve(self, foot: Floats) -> Floats:
        """Return all angles (..., 4, 3) for feet (..., 3), NaN where a foot is out of reach.

        First with the hip towards the foot, the knee above and below the line to it, then with the hip
        turned away. On the hip's axis, where any hip is right, it is 0.

            cos τ' = (r² + z² - femur² - tibia²) / (2 femur tibia)    τ' = τ - 90°, the angle of the knee
        """
        x, y, z = foot[..., 0], foot[..., 1], foot[..., 2]
        across = np.hypot(x, y)
        towards = np.where(across < 1e-12, 0.0, np.arctan2(-x, y))
        angles = np.empty((*foot.shape[:-1], 4, 3))
        for index, (turned, side) in enumerate(((0.0, 1.0), (0.0, -1.0), (np.pi, 1.0), (np.pi, -1.0))):
            out = (-across if turned else across) - self.coxa
            cosine = (out**2 + z**2 - self.femur**2 - self.tibia**2) / (2 * self.femur * self.tibia)
            cosine = np.where(np.abs(cosine) > 1 + REACH_TOLERANCE_M, np.nan, np.clip(cosine, -1.0, 1.0))
            # The knee above the line to the foot bends the tibia down: τ' < 0.
            bend = -side * np.arccos(cosine)
            femur = np.arctan2(z, out) - np.arctan2(
                self.tibia * np.sin(bend), self.femur + self.tibia * np.cos(bend)
            )
            angles[..., index, 0] = wrapped(towards + turned)
            angles[..., index, 1] = wrapped(femur)
            angles[..., index, 2] = wrapped(bend + np.pi / 2)
        return angles

    def torque(self, angles: Floats, force_n: Floats) -> Floats:
        """Return the static torque (...,) on the femur, N·m, under a vertical force at the foot."""
        femur, both = angles[..., 1], angles[..., 1] + angles[..., 2]
        return np.asarray(force_n * (self.femur * np.cos(femur) + self.tibia * np.sin(both)))
