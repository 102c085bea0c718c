"""The robots of the tests of walks."""

from __future__ import annotations

import math
from dataclasses import replace

from servogen.kinematics.catalogue import robot
from servogen.kinematics.hexapod import Hexapod


def hexapod() -> Hexapod:
    """Return the catalogue's."""
    found = robot("hexapod")
    assert isinstance(found, Hexapod)
    return found


def hexapod_with_limits(alpha_deg: float = 90) -> Hexapod:
    """Return the catalogue's, whose joints alpha turn by `alpha_deg` to each side."""
    found = hexapod()
    alpha, beta = found.leg.joints
    limit = math.radians(alpha_deg)
    return replace(found, leg=replace(found.leg, joints=(replace(alpha, lower=-limit, upper=limit), beta)))
