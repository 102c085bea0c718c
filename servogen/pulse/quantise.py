"""Angles -> whole cycles, the nearest ones, and how far they are from the plan.

In: a servo and its angles. Out: the cycles in each frame; for every distinct width a row with the requested
and the achieved width; the largest differences as a `PlanError`, to which `build` adds the distance at a foot
or tool.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError
from servogen.motion.trajectory import Floats
from servogen.plan_error import DECIMALS, PlanError
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

if TYPE_CHECKING:
    from servogen.answers import WidthAnswer

NO_PULSE = 0
"""The width, in the arrays of this package, of a frame without a pulse."""

PARTS = 10**4
"""Requested widths are rounded to this part of a µs: smaller differences are floating-point noise."""


@dataclass(frozen=True, slots=True)
class Quantised:
    """A requested and achieved width of a channel; `frames` counts the frames with it."""

    channel: str
    angle: float
    requested_us: Fraction
    cycles: Cycles
    achieved_us: Fraction
    frames: int
    which: str = ""
    """The label of a row that is only an example of the widths, such as "longest"; else empty."""
    held: bool = True
    """Whether two successive frames have this width; otherwise it is only passed on a ramp."""

    @property
    def error_us(self) -> Fraction:
        """Return the achieved width minus the requested one, in µs."""
        return self.achieved_us - self.requested_us

    def to_json(self) -> WidthAnswer:
        row: WidthAnswer = {
            "servo": self.channel,
            "requested_us": float(self.requested_us),
            "cycles": self.cycles,
            "achieved_us": float(self.achieved_us),
            "error_us": float(self.error_us),
            "frames": self.frames,
        }
        return {**row, "pulse": self.which} if self.which else row


def quantise(
    servo: Servo, angles: Floats, clock: Clock
) -> tuple[npt.NDArray[np.int64], tuple[Quantised, ...]]:
    """Return the cycles of `angles` (NaN gives NO_PULSE), and one row for each distinct width, the shortest
    first.

    Raises InputError for an angle outside the servo's limits and for a width below one cycle.
    """
    pulsed = ~np.isnan(angles)
    distinct, back, counts = np.unique(angles[pulsed], return_inverse=True, return_counts=True)
    # Two equal frames in a row are a position that is held; a ramp passes each of its angles only once.
    repeated = frozenset(angles[:-1][angles[:-1] == angles[1:]].tolist())
    cycles_of: list[int] = []
    rows: dict[Fraction, Quantised] = {}
    for angle, count in zip(distinct.tolist(), counts.tolist(), strict=True):
        width = Fraction(round(servo.width_us(angle) * PARTS), PARTS)
        rounded = clock.round_us(width)
        if rounded.cycles < 1:
            raise InputError(
                "pulse-too-short",
                f"{servo.name}: a pulse of {float(width):g} µs is shorter than half an instruction cycle",
                servo.place,
                f"a cycle is {float(clock.cycle_us):g} µs at {clock.hz} Hz",
            )
        # Angles that differ by floating-point noise have the same width: they share a row.
        before = rows.get(width)
        rows[width] = Quantised(
            channel=servo.name,
            angle=angle,
            requested_us=width,
            cycles=rounded.cycles,
            achieved_us=rounded.achieved_us,
            frames=count + (before.frames if before else 0),
            held=angle in repeated or (before is not None and before.held),
        )
        cycles_of.append(rounded.cycles)
    cycles = np.full(len(angles), NO_PULSE, dtype=np.int64)
    cycles[pulsed] = np.array(cycles_of, dtype=np.int64)[back]
    return cycles, tuple(rows[width] for width in sorted(rows))


def channel_error(servo: Servo, angles: Floats, planned_us: Floats, achieved_us: Floats) -> PlanError:
    """Return the error of one servo from arrays with one entry per frame, or per distinct width."""
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
    """Return the error of one servo from `rows` with all its distinct widths."""
    return channel_error(
        servo,
        np.array([row.angle for row in rows]),
        np.array([float(row.requested_us) for row in rows]),
        np.array([float(row.achieved_us) for row in rows]),
    )


def largest(errors: Iterable[PlanError]) -> PlanError:
    """Return the largest error of each kind, rounded for files."""
    all_errors = list(errors)
    return PlanError(
        round(max((error.width_us for error in all_errors), default=0.0), DECIMALS),
        _largest(error.angle_deg for error in all_errors),
        _largest(error.speed_deg_s for error in all_errors),
    )


def _largest(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(max(known), DECIMALS) if known else None
