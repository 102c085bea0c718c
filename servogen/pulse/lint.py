"""Warnings about planned motions and measured pulses.

In: a servo and its widths or angles, frame by frame. Out: `Diagnostic` values, whose
codes docs/diagnostics.md explains.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from servogen.errors import Diagnostic, Location
from servogen.motion.trajectory import Floats
from servogen.robot.servo import Servo
from servogen.units import Rounded

PERIOD_US = (18_000, 20_000)
"""The recommended period (specification of the labs' servos); other periods work in practice."""

CALIBRATION_SPREAD = 0.1
"""The share of a model's range of widths by which one of its servos may differ at each end."""

ANY_SERVO_US = (1000.0, 2000.0)
"""The widths that every position servo accepts, for the check of an unknown servo."""

WIDTH_TOLERANCE_US = 2.0
"""The distance by which a width may leave a servo's range without a warning: rounding, or cycles of a
statement.
"""


def check_period(period: Rounded, place: Location | None = None) -> tuple[Diagnostic, ...]:
    """Return the warnings about a stated period: not whole cycles, or outside the recommended range."""
    warnings = []
    if not period.exact:
        warnings.append(
            Diagnostic(
                "warning",
                "period-rounded",
                f"a period of {_us(period.requested_us)} is not whole cycles: "
                f"{period.cycles} cycles are {_us(period.achieved_us)}",
                place,
            )
        )
    return (*warnings, *check_periods([float(period.requested_us)], place=place))


def check_periods(
    periods_us: Sequence[float], name: str = "", place: Location | None = None
) -> tuple[Diagnostic, ...]:
    """Return the warnings about the planned or measured times from rise to rise of a channel named `name`."""
    if not len(periods_us):
        return ()
    who = f"{name}: " if name else ""
    low, high = min(periods_us), max(periods_us)
    warnings = []
    if high - low > 0:
        warnings.append(
            Diagnostic(
                "warning",
                "period-varies",
                f"{who}frames differ by {_us(high - low)}: periods of {_us(low)} to {_us(high)}",
                place,
            )
        )
    for period in dict.fromkeys((low, high)):
        if not PERIOD_US[0] <= period <= PERIOD_US[1]:
            warnings.append(
                Diagnostic(
                    "warning",
                    "period-range",
                    f"{who}a period of {_us(period)} is outside 18 to 20 ms",
                    place,
                )
            )
    return tuple(warnings)


def check_widths(
    servo: Servo, widths_us: Sequence[float], tolerance_us: float = WIDTH_TOLERANCE_US
) -> tuple[Diagnostic, ...]:
    """Return the warnings about the distinct widths of a channel that its servo does not accept."""
    low, high = servo.widths_us
    warnings = []
    for width in sorted(set(widths_us)):
        if low - tolerance_us <= width <= high + tolerance_us:
            continue
        warnings.append(
            Diagnostic(
                "warning",
                "width-range",
                f"{servo.name}: a pulse of {_us(width)} is outside the servo's {_us(low)} to {_us(high)}",
                servo.place,
            )
        )
        ends = " to ".join(servo.model.shown(limit) for limit in servo.limits)
        angle = math.degrees(servo.angle(width))
        warnings.append(
            Diagnostic(
                "warning",
                "angle-range",
                f"{servo.name}: {_us(width)} would be {angle:z.0f}{servo.model.unit}, "
                f"outside its {'speeds' if servo.model.continuous else 'travel'} of {ends}",
                servo.place,
            )
        )
    return tuple(warnings)


def check_calibration(servo: Servo) -> tuple[Diagnostic, ...]:
    """Return the warnings about a servo whose own calibration and trim exceed its model's data sheet."""
    low, high = servo.model.calibration.widths_us
    spare = CALIBRATION_SPREAD * (high - low)
    shortest, longest = servo.widths_us
    if low - spare <= shortest and longest <= high + spare:
        return ()
    return (
        Diagnostic(
            "warning",
            "width-range",
            f"{servo.name}: pulses of {_us(shortest)} to {_us(longest)} go beyond a {servo.model.title}'s "
            f"{_us(low)} to {_us(high)}",
            servo.place,
        ),
    )


def check_unknown(name: str, widths_us: Sequence[float]) -> tuple[Diagnostic, ...]:
    """Return the warnings about the distinct widths of a channel whose servo is not known."""
    low, high = ANY_SERVO_US
    return tuple(
        Diagnostic("warning", "width-range", f"{name}: a pulse of {_us(width)} is outside 1 to 2 ms")
        for width in sorted(set(widths_us))
        if not low - WIDTH_TOLERANCE_US <= width <= high + WIDTH_TOLERANCE_US
    )


def check_motion(servo: Servo, angles: Floats, loop_start: int, period_s: float) -> tuple[Diagnostic, ...]:
    """Return the warnings about angles, one per frame (NaN: no pulse), that the servo cannot follow.

    The angles from `loop_start` on repeat. Each kind of warning is given once, for its worst frame. A model
    without a stated speed is not checked.
    """
    if servo.model.speed is None:
        return ()
    reach = servo.model.speed * period_s
    # Two rounds, so that a position not reached at the end of the loop is also missed at its beginning.
    around = np.concatenate((angles, angles[loop_start:]))
    runs = list(_constant(around[~np.isnan(around)]))
    return tuple(_follow(servo, runs, reach, period_s))


def check_measured(
    servo: Servo, widths_us: npt.ArrayLike, periods_us: Sequence[float]
) -> tuple[Diagnostic, ...]:
    """Return the warnings about one measured channel: its widths, one per frame, and its times from rise to
    rise.
    """
    widths = np.asarray(widths_us, dtype=np.float64)
    distinct = np.unique(widths)
    angles = np.array([servo.angle(width) for width in distinct])[np.searchsorted(distinct, widths)]
    period_s = float(np.median(periods_us)) / 1e6 if len(periods_us) else 0.0
    return (
        *check_widths(servo, distinct.tolist()),
        *check_periods(periods_us, servo.name),
        *(check_motion(servo, angles, len(angles), period_s) if period_s else ()),
    )


def _constant(angles: Floats) -> Iterator[tuple[float, int]]:
    """Yield (angle, frames) of each run of equal angles."""
    if not len(angles):
        return
    bounds = [0, *(np.flatnonzero(np.diff(angles)) + 1).tolist(), len(angles)]
    for first, end in pairwise(bounds):
        yield float(angles[first]), end - first


def _follow(
    servo: Servo, runs: Sequence[tuple[float, int]], reach: float, period_s: float
) -> Iterator[Diagnostic]:
    """Yield the warnings about angles that a servo turning by at most `reach` per frame cannot follow.

    A position that lasts several frames is a step: the servo must reach it before leaving it. A position that
    lasts a single frame is part of a ramp, which must not be steeper than `reach`.
    """
    reached_angle = runs[0][0] if runs else 0.0
    steepest, short, needed = 0.0, 0, 0
    before = reached_angle
    for angle, frames in runs:
        away = abs(angle - reached_angle)
        take = math.ceil(away / reach - 1e-9)
        if frames == 1:
            steepest = max(steepest, abs(angle - before))
        elif take > frames and take - frames > short:
            short, needed = take - frames, take
        moved = min(away, frames * reach)
        reached_angle += math.copysign(moved, angle - reached_angle)
        before = angle
    limit = math.degrees(reach / period_s)
    if steepest > reach * (1 + 1e-9):
        asked = math.degrees(steepest / period_s)
        yield Diagnostic(
            "warning",
            "too-fast",
            f"{servo.name} would have to turn at {asked:z.0f}°/s: its maximum is {limit:z.0f}°/s",
            servo.place,
        )
    if short:
        yield Diagnostic(
            "warning",
            "frames-few",
            f"{servo.name} has to leave a position {short} frame{'s' if short > 1 else ''} before it can "
            f"reach it: the travel takes {needed} frames at {limit:z.0f}°/s",
            servo.place,
        )


def _us(value: object) -> str:
    """Return a time in µs as text, long ones in ms."""
    number = float(value)  # type: ignore[arg-type]
    return f"{number / 1000:g} ms" if number >= 10_000 else f"{number:g} µs"
