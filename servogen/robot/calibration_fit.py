"""Readings of a servo -> its calibration: the straight line of pulse width over angle.

In: widths that were sent and the angles (or speeds) that were seen. Out: `Fit`, with the residual of every
reading, or an InputError that names the bad reading.

    width = zero + slope * angle        A width is known to the cycle, an angle is read by eye: the line is
                                        the one with the least squares of the angles' residuals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from servogen.errors import InputError

FEWEST = 3
"""Any two readings lie on a line."""

TOLERANCE_RAD = math.radians(5)
"""How far a reading may be from the line."""

OUTLIER = 4.0
"""A reading so many times farther from the line of the others than they are is a slip of the eye."""


@dataclass(frozen=True, slots=True)
class Reading:
    """`width_us` of the pulse that was sent; `angle` of the servo as it is mounted, radians (a second)."""

    width_us: float
    angle: float


@dataclass(frozen=True, slots=True)
class Fit:
    """The line, and how far each reading's angle is from it: `residuals` in radians, read less fitted."""

    readings: tuple[Reading, ...]
    zero_us: float
    us_per_rad: float
    residuals: tuple[float, ...]

    @property
    def rms(self) -> float:
        """Root of the mean square of the residuals, for the two degrees of freedom that the line takes."""
        return math.sqrt(sum(each**2 for each in self.residuals) / max(1, len(self.residuals) - 2))

    @property
    def worst(self) -> int:
        """The index of the reading that is farthest from the line."""
        return max(range(len(self.residuals)), key=lambda index: abs(self.residuals[index]))

    def width_us(self, angle: float) -> float:
        return self.zero_us + self.us_per_rad * angle

    def angle(self, width_us: float) -> float:
        return (width_us - self.zero_us) / self.us_per_rad

    def ends(
        self, limits: tuple[float, float] = (-math.inf, math.inf)
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """(angle, width) of the line's ends: the shortest and longest width read, cut at `limits` (radians).

        Raises InputError where nothing is left of it.
        """
        widths = [reading.width_us for reading in self.readings]
        first, last = sorted((self.angle(min(widths)), self.angle(max(widths))))
        low, high = max(first, limits[0]), min(last, limits[1])
        if low >= high:
            raise InputError("all that was read lies outside of the servo's travel")
        return (low, self.width_us(low)), (high, self.width_us(high))


def fit(readings: Sequence[Reading], tolerance: float = TOLERANCE_RAD, speed: bool = False) -> Fit:
    """The line of `readings`; `speed`: their angles are speeds.

    Raises InputError for too few readings and a servo that did not move; and where a reading is farther than
    `tolerance` (radians) from the line: for the one that is off the line of the others, for angles that do
    not rise or fall with the widths, for readings that are no straight line.
    """
    unit = "°/s" if speed else "°"
    _check_each(readings, unit)
    made = _line(readings)
    off = abs(made.residuals[made.worst])
    if off > tolerance:
        _check_outlier(readings, tolerance, unit)
        _check_order(readings, made.us_per_rad > 0, unit)
        raise InputError(
            f"the readings are no straight line: {_named(readings, made.worst, unit)} is "
            f"{math.degrees(off):z.1f}{unit} off it, {math.degrees(tolerance):zg}{unit} is allowed",
            hint="calibrate a shorter range, or allow more with --tolerance-deg",
        )
    return made


def _check_each(readings: Sequence[Reading], unit: str) -> None:
    for index, reading in enumerate(readings):
        if not math.isfinite(reading.angle) or not math.isfinite(reading.width_us):
            raise InputError(f"{_named(readings, index, unit)} is not a number")
    widths = {reading.width_us for reading in readings}
    if len(widths) < FEWEST:
        raise InputError(
            f"{len(widths)} widths were read: a line needs {FEWEST} or more to show its error",
            hint="take more points",
        )
    angles = [reading.angle for reading in readings]
    if max(angles) == min(angles):
        raise InputError(
            f"the servo did not move: all readings are {math.degrees(angles[0]):zg}{unit}",
            hint="is it powered, and on that pin?",
        )


def _check_order(readings: Sequence[Reading], rising: bool, unit: str) -> None:
    """All angles rise with the widths, or all fall."""
    order = sorted(range(len(readings)), key=lambda index: readings[index].width_us)
    steps = [
        (before, after, readings[after].angle - readings[before].angle)
        for before, after in pairwise(order)
        if readings[after].width_us > readings[before].width_us
    ]
    for before, after, step in steps:
        if step == 0 or (step > 0) != rising:
            raise InputError(
                f"{_named(readings, after, unit)} does not {'rise' if rising else 'fall'} from "
                f"{_named(readings, before, unit)}, as the others do",
                hint="read both again: did the servo reach its stop, or slip on its horn?",
            )


def _check_outlier(readings: Sequence[Reading], tolerance: float, unit: str) -> None:
    """One reading that is off the line of all others, which agree."""
    if len(readings) <= FEWEST:
        return
    found: list[tuple[float, float, int]] = []
    for index, reading in enumerate(readings):
        others = [*readings[:index], *readings[index + 1 :]]
        if len({each.width_us for each in others}) < FEWEST:
            continue
        line = _line(others)
        if math.isinf(line.us_per_rad) or line.us_per_rad == 0:
            continue
        off = abs(reading.angle - line.angle(reading.width_us))
        spread = abs(line.residuals[line.worst])
        if off > tolerance and spread <= tolerance and off > OUTLIER * spread:
            found.append((off / max(spread, 1e-12), off, index))
    if not found:
        return
    _, off, index = max(found)
    raise InputError(
        f"{_named(readings, index, unit)} is {math.degrees(off):z.1f}{unit} off the line of the others",
        hint="read it again",
    )


def _named(readings: Sequence[Reading], index: int, unit: str) -> str:
    reading = readings[index]
    return f"reading {index + 1} ({math.degrees(reading.angle):zg}{unit} at {reading.width_us:g} µs)"


def _line(readings: Sequence[Reading]) -> Fit:
    """Least squares of angle over width, written as width over angle."""
    widths = np.array([reading.width_us for reading in readings])
    angles = np.array([reading.angle for reading in readings])
    middle, mean = float(widths.mean()), float(angles.mean())
    away = widths - middle
    slope = float(away @ (angles - mean)) / float(away @ away)
    residuals = tuple((angles - mean - slope * away).tolist())
    if slope == 0:
        return Fit(tuple(readings), math.nan, math.inf, residuals)
    return Fit(tuple(readings), middle - mean / slope, 1 / slope, residuals)
