"""What the robot stands on: a plane, perhaps inclined, with a step or random roughness.

In: the options of a run. Out: `Ground`, and its height below a point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError

Floats = npt.NDArray[np.float64]

ROUGH_HALF_M = 1.2
"""Half the side length of the square of rough ground around the start."""

ROUGH_CELL_M = 0.02
"""The distance between two heights of rough ground: about the size of a footprint."""


@dataclass(frozen=True, slots=True)
class Ground:
    """`friction` is Coulomb's coefficient between feet (or wheels) and ground; lengths in metres.

    The slope rises along +x by `slope` (radians); a step of height `step` begins `step_at` before the robot;
    rough ground has independent heights from 0 to `rough`, drawn from `seed`.
    """

    friction: float = 0.8
    slope: float = 0.0
    step: float = 0.0
    step_at: float = 0.15
    rough: float = 0.0
    seed: int = 1

    def __post_init__(self) -> None:
        """Raise InputError for values that describe no ground."""
        for name, value, low, high in (
            ("friction", self.friction, 0.0, 5.0),
            ("slope", math.degrees(self.slope), -45.0, 45.0),
            ("step", 1000 * self.step, 0.0, 200.0),
            ("rough", 1000 * self.rough, 0.0, 200.0),
        ):
            if not low <= value <= high:
                raise InputError("out-of-range", f"{name} = {value:g} is not between {low:g} and {high:g}")
        if self.step and self.rough:
            raise InputError("conflicting-options", "the ground has a step or is rough, not both")

    @property
    def level(self) -> float:
        """Return the mean height where the robot starts."""
        return self.rough / 2

    def heights(self) -> Floats:
        """Return the heights (n, n) of rough ground in metres, rows along y."""
        count = 2 * round(ROUGH_HALF_M / ROUGH_CELL_M) + 1
        drawn = np.random.default_rng(self.seed).random((count, count))
        return np.asarray(self.rough * drawn)

    def text(self) -> str:
        """Return the ground in words."""
        parts = [f"friction {self.friction:g}"]
        if self.slope:
            parts.append(f"slope {math.degrees(self.slope):g}°")
        if self.step:
            parts.append(f"a step of {1000 * self.step:g} mm")
        if self.rough:
            parts.append(f"rough by {1000 * self.rough:g} mm, seed {self.seed}")
        return ", ".join(parts)
