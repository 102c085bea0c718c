"""Readings of a calibration as text: angles in a row, or a CSV file of widths and angles.

In: text. Out: `Reading`s; InputError with the place of what is no number.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

from servogen.errors import InputError, Place
from servogen.inputs import read_input
from servogen.robot.calibration_fit import Reading

WIDTH, ANGLE, SPEED = "width_us", "angle_deg", "speed_deg_s"


def angle_of(text: str, what: str = "") -> float:
    """Radians of a number of degrees; `what` is named in the error. Raises InputError."""
    try:
        degrees = float(text)
    except ValueError:
        degrees = math.nan
    if not math.isfinite(degrees):
        raise InputError(f"{what}'{text.strip()}' is no number of degrees", hint="90, or 92.5")
    return math.radians(degrees)


def angles_of(text: str) -> list[float]:
    """Radians of `0,45,90`. Raises InputError."""
    return [angle_of(part, f"reading {index + 1}: ") for index, part in enumerate(text.split(","))]


def read_csv(path: Path, speed: bool) -> Sequence[Reading]:
    """The readings in a file with the columns width_us and angle_deg (or, of a speed, speed_deg_s).

    Raises InputError.
    """
    try:
        text = read_input(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8 text", Place(str(path))) from error
    try:
        return _readings(csv.DictReader(io.StringIO(text), skipinitialspace=True), path, speed)
    except csv.Error as error:
        raise InputError(f"is not a CSV file: {error}", Place(str(path))) from error


MAX_READINGS = 1000
MAX_WIDTH_US, MAX_DEGREES = 1e6, 1e6


def _readings(rows: csv.DictReader[str], path: Path, speed: bool) -> Sequence[Reading]:
    wanted = SPEED if speed else ANGLE
    for column in (WIDTH, wanted):
        if column not in (rows.fieldnames or ()):
            raise InputError(f"there is no column {column}", Place(str(path), 1), f"{WIDTH},{wanted}")
    found = []
    for row in rows:
        place = Place(str(path), rows.line_num)
        try:
            width_us, degrees = float(row[WIDTH]), float(row[wanted])
        except (TypeError, ValueError) as error:
            raise InputError(f"a reading is two numbers, {WIDTH} and {wanted}", place) from error
        if not (0 < width_us <= MAX_WIDTH_US and abs(degrees) <= MAX_DEGREES):
            raise InputError(f"{width_us:g}, {degrees:g} is not a reading of a servo", place)
        found.append(Reading(width_us, math.radians(degrees)))
        if len(found) > MAX_READINGS:
            raise InputError("has too many readings", place, f"at most {MAX_READINGS}")
    return found
