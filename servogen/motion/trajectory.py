"""`JointTrajectory`: joint angles frame by frame, what every kind of motion becomes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.units import Clock, Cycles

Floats = npt.NDArray[np.float64]

MAX_FRAMES = 500_000
"""Of a motion, nearly three hours at 50 Hz. Whatever works on a motion holds all its frames in memory."""


@dataclass(frozen=True, slots=True, eq=False)
class JointTrajectory:
    """One row of `angles` a frame of `period` cycles, one column a joint, in radians.

    NaN: no pulse in that frame. The frames before `loop_start` are run once, those from it on for ever.
    """

    joints: tuple[str, ...]
    clock: Clock
    period: Cycles
    angles: Floats
    loop_start: int
