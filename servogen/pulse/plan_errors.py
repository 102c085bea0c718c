"""The distance between the widths that a chip makes and those of the motion: the largest of each kind.

In: a servo, its planned angles and both widths. Out: a `PlanError`. Only `pulse` knows both sides: what
follows it sees whole cycles. The distance at a foot or tool needs a robot and is added by `build`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from servogen.motion.trajectory import Floats
from servogen.plan_error import DECIMALS, PlanError
from servogen.pulse.quantise import Quantised
from servogen.robot.servo import Servo


def channel_error(servo: Servo, angles: Floats, planned_us: Floats, achieved_us: Floats) -> PlanError:
    """Return the error of one servo; the arrays have one entry for each frame, or for each distinct width."""
    if not len(angles):
        return PlanError(0.0)
    distinct, back = np.unique(achieved_us, return_inverse=True)
    achieved = np.array([servo.angle(width) for width in distinct.tolist()])[back]
    width = float(np.abs(achieved_us - planned_us).max())
    away = math.degrees(float(np.abs(achieved - angles).max()))
    if servo.model.continuous:
        return PlanError(width, speed_deg_s=away)
    return PlanError(width, angle_deg=away)


def error_of_rows(servo: Servo, rows: Sequence[Quantised]) -> PlanError:
    """Return the error of one servo, of which `rows` has every distinct width."""
    return channel_error(
        servo,
        np.array([row.angle for row in rows]),
        np.array([float(row.requested_us) for row in rows]),
        np.array([float(row.achieved_us) for row in rows]),
    )


def largest(errors: Iterable[PlanError]) -> PlanError:
    """Return the largest of each kind, rounded for files."""
    all_errors = list(errors)
    return PlanError(
        round(max((each.width_us for each in all_errors), default=0.0), DECIMALS),
        _largest(each.angle_deg for each in all_errors),
        _largest(each.speed_deg_s for each in all_errors),
    )


def _largest(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(max(known), DECIMALS) if known else None
