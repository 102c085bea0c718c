"""The arguments and results of closed forms: components of many targets, branches of joint positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from servogen.kinematics.transforms import Floats

Branch = tuple[Floats | float, ...]
"""One candidate per joint: an array over the targets, or one number for all."""


@dataclass(frozen=True, slots=True)
class Target:
    """Components over the targets: `p` three, `n`, `o`, `a` three each, None without an orientation."""

    p: tuple[Floats, Floats, Floats]
    n: tuple[Floats, Floats, Floats] | None = None
    o: tuple[Floats, Floats, Floats] | None = None
    a: tuple[Floats, Floats, Floats] | None = None


ON_AXIS = 1e-12
"""A point nearer than this to the first joint's axis, in metres, leaves that joint free: it stays at home."""


def azimuth(y: Floats, x: Floats, home: float) -> Floats:
    """Return atan2(y, x); on the axis, where any angle is right, `home`."""
    return np.where(np.hypot(x, y) < ON_AXIS, home, np.arctan2(y, x))
