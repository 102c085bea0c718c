"""The readings of a calibration, as a list of angles or a CSV file of widths and angles; the line fitted to
them, with one bend if they have it; the calibration file that a job reads.

In: text. Out: `Reading`s, `Fit`, the calibration file; InputError with its location.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from pydantic import Field

from servogen.errors import InputError, Location, ToolError
from servogen.inputs import number_in, read_input
from servogen.outputs import write_text
from servogen.robot.servo import Calibration, Servo, calibration
from servogen.robot.servo_models import MAX_US, MIN_US, PointTable, points_of
from servogen.toml import file as toml_file
from servogen.toml.file import Table

WIDTH, ANGLE, SPEED = "width_us", "angle_deg", "speed_deg_s"


def angle_of(text: str, what: str = "") -> float:
    """Return a number of degrees in radians; `what` names it in the error. Raises InputError."""
    degrees = number_in(text)
    if degrees is None or not math.isfinite(degrees):
        raise InputError(
            "bad-angle", f"{what}'{text.strip()}' is not a number of degrees", hint="90, or 92.5"
        )
    return math.radians(degrees)


def angles_of(text: str) -> list[float]:
    """Return the angles in a list such as `0,45,90`, in radians. Raises InputError."""
    return [angle_of(part, f"reading {index + 1}: ") for index, part in enumerate(text.split(","))]


def read_csv(path: Path, speed: bool) -> Sequence[Reading]:
    """Return the readings in a file with the columns width_us and angle_deg (or, for a speed, speed_deg_s).

    Raises InputError.
    """
    try:
        text = read_input(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("not-utf8", "is not UTF-8 text", Location(str(path))) from error
    try:
        return _readings(csv.DictReader(io.StringIO(text), skipinitialspace=True), path, speed)
    except csv.Error as error:
        raise InputError("csv-syntax", f"is not a CSV file: {error}", Location(str(path))) from error


MAX_READINGS = 1000
MAX_WIDTH_US, MAX_DEGREES = 1e6, 1e6
"""Limits of a file of readings, far beyond any servo's."""


def _readings(rows: csv.DictReader[str], path: Path, speed: bool) -> Sequence[Reading]:
    """Return the readings in the rows of a file. Raises InputError."""
    wanted = SPEED if speed else ANGLE
    for column in (WIDTH, wanted):
        if column not in (rows.fieldnames or ()):
            raise InputError(
                "csv-syntax", f"there is no column {column}", Location(str(path), 1), f"{WIDTH},{wanted}"
            )
    readings = []
    for row in rows:
        place = Location(str(path), rows.line_num)
        width_us, degrees = (number_in(row[column] or "") for column in (WIDTH, wanted))
        if width_us is None or degrees is None:
            raise InputError("csv-syntax", f"a reading is two numbers, {WIDTH} and {wanted}", place)
        if not (0 < width_us <= MAX_WIDTH_US and abs(degrees) <= MAX_DEGREES):
            raise InputError("csv-syntax", f"{width_us:g}, {degrees:g} is not a reading of a servo", place)
        readings.append(Reading(width_us, math.radians(degrees)))
        if len(readings) > MAX_READINGS:
            raise InputError("bad-readings", "has too many readings", place, f"at most {MAX_READINGS}")
    return readings


MIN_WIDTHS = 3
"""The minimum number of widths: any two readings lie on a line."""

TOLERANCE_RAD = math.radians(5)
"""The default distance allowed between a reading and the line."""

OUTLIER = 4.0
"""A reading is an outlier if it is this many times farther from the line of the others than they are."""


@dataclass(frozen=True, slots=True)
class Reading:
    """`width_us` of the pulse that was sent; `angle` of the servo as mounted, in radians (per second for a
    speed).
    """

    width_us: float
    angle: float


MIN_BENT, BENT_RAD, BENT_SHARE = 6, math.radians(0.5), 0.5
"""A third point is fitted to this many readings or more, if they scatter about the line by more than that
(rms) and about the bent line by less than this share of it.
"""


@dataclass(frozen=True, slots=True)
class Fit:
    """The fitted line, and each reading's distance from the fit: `residuals` in radians, measured minus
    fitted.

    `bent`: the line through three points in its place, where the readings have a bend.
    """

    readings: tuple[Reading, ...]
    zero_us: float
    us_per_rad: float
    residuals: tuple[float, ...]
    bent: Calibration | None = None

    @property
    def rms(self) -> float:
        """Return the root mean square of the residuals, allowing for the fit's degrees of freedom."""
        # A line leaves n - 2 of n readings; a bend takes two more, its place and its angle.
        free = len(self.residuals) - (2 if self.bent is None else 4)
        return math.sqrt(sum(residual**2 for residual in self.residuals) / max(1, free))

    @property
    def worst(self) -> int:
        """Return the index of the reading farthest from the line."""
        return max(range(len(self.residuals)), key=lambda index: abs(self.residuals[index]))

    def width_us(self, angle: float) -> float:
        """Return the width in µs at an angle in radians."""
        if self.bent is not None:
            return self.bent.width_us(angle)
        return self.zero_us + self.us_per_rad * angle

    def angle(self, width_us: float) -> float:
        """Return the angle in radians at a width in µs."""
        if self.bent is not None:
            return self.bent.angle(width_us)
        return (width_us - self.zero_us) / self.us_per_rad

    def points(self, limits: tuple[float, float] = (-math.inf, math.inf)) -> tuple[tuple[float, float], ...]:
        """Return (angle, width) at both ends of the line: at the shortest and longest measured width, or
        where `limits` (radians) cut it; and between them where it bends.

        Raises InputError if no part of the line remains.
        """
        widths = [reading.width_us for reading in self.readings]
        first, last = sorted((self.angle(min(widths)), self.angle(max(widths))))
        low, high = max(first, limits[0]), min(last, limits[1])
        if low >= high:
            raise InputError("bad-readings", "all readings lie outside the servo's travel")
        inner = [point.angle for point in self.bent.points[1:-1]] if self.bent else []
        angles = (low, *(angle for angle in inner if low < angle < high), high)
        return tuple((angle, self.width_us(angle)) for angle in angles)


def fit(readings: Sequence[Reading], tolerance: float = TOLERANCE_RAD, speed: bool = False) -> Fit:
    """Return the line fitted to `readings`, with a bend if they have one; with `speed`, their angles are
    speeds.

    Raises InputError for too few readings, for a servo that did not move, and if a reading is farther than
    `tolerance` (radians) from the line: for a single outlier, for angles that do not rise or fall
    monotonically with the widths, and for readings that do not form a straight line.
    """
    unit = "°/s" if speed else "°"
    _check_each(readings, unit)
    line = _line(readings)
    line = _fit_two_lines(line) or line
    off = abs(line.residuals[line.worst])
    if off > tolerance:
        _check_outlier(readings, tolerance, unit)
        _check_order(readings, line.us_per_rad > 0, unit)
        raise InputError(
            "bad-readings",
            f"the readings are not on a straight line: {_reading(readings, line.worst, unit)} is "
            f"{math.degrees(off):z.1f}{unit} off it, {math.degrees(tolerance):zg}{unit} is allowed",
            hint="calibrate a shorter range, or allow more with --tolerance-deg",
        )
    widths = [reading.width_us for reading in readings]
    turned = (max(widths) - min(widths)) / abs(line.us_per_rad)
    if turned <= off:
        raise InputError(
            "bad-readings",
            f"the servo hardly moved: by {math.degrees(turned):z.1f}{unit} over all widths, and "
            f"{_reading(readings, line.worst, unit)} is {math.degrees(off):z.1f}{unit} off that line",
            hint="is it powered, and on that pin?",
        )
    return line


def _check_each(readings: Sequence[Reading], unit: str) -> None:
    """Raise InputError for invalid readings, too few widths, and a servo that did not move."""
    for index, reading in enumerate(readings):
        if not math.isfinite(reading.angle) or not math.isfinite(reading.width_us):
            raise InputError("not-a-number", f"{_reading(readings, index, unit)} is not a number")
    widths = {reading.width_us for reading in readings}
    if len(widths) < MIN_WIDTHS:
        raise InputError(
            "bad-readings",
            f"at least {MIN_WIDTHS} widths are needed to show the error of the line, not {len(widths)}",
            hint="read more points",
        )
    angles = [reading.angle for reading in readings]
    if max(angles) == min(angles):
        raise InputError(
            "bad-readings",
            f"the servo did not move: all readings are {math.degrees(angles[0]):zg}{unit}",
            hint="is it powered, and on that pin?",
        )


def _check_order(readings: Sequence[Reading], rising: bool, unit: str) -> None:
    """Raise InputError unless the angles rise, or fall, monotonically with the widths."""
    order = sorted(range(len(readings)), key=lambda index: readings[index].width_us)
    steps = [
        (before, after, readings[after].angle - readings[before].angle)
        for before, after in pairwise(order)
        if readings[after].width_us > readings[before].width_us
    ]
    for before, after, step in steps:
        if step == 0 or (step > 0) != rising:
            raise InputError(
                "bad-readings",
                f"{_reading(readings, after, unit)} does not {'rise' if rising else 'fall'} from "
                f"{_reading(readings, before, unit)}, as the others do",
                hint="read both again: did the servo reach its stop, or slip on its horn?",
            )


def _check_outlier(readings: Sequence[Reading], tolerance: float, unit: str) -> None:
    """Raise InputError if one reading is off the line on which all others agree."""
    if len(readings) <= MIN_WIDTHS:
        return
    outliers: list[tuple[float, float, int]] = []
    for index, reading in enumerate(readings):
        others = [*readings[:index], *readings[index + 1 :]]
        if len({other.width_us for other in others}) < MIN_WIDTHS:
            continue
        line = _line(others)
        if math.isinf(line.us_per_rad) or line.us_per_rad == 0:
            continue
        off = abs(reading.angle - line.angle(reading.width_us))
        spread = abs(line.residuals[line.worst])
        # It is off, the others agree, and its distance is far beyond theirs.
        if off > tolerance and spread <= tolerance and off > OUTLIER * spread:
            # Of several candidates, the outlier is the one without which the others fit best.
            outliers.append((off / max(spread, 1e-12), off, index))
    if not outliers:
        return
    _, off, index = max(outliers)
    raise InputError(
        "bad-readings",
        f"{_reading(readings, index, unit)} is {math.degrees(off):z.1f}{unit} off the line of the others",
        hint="read it again",
    )


def _reading(readings: Sequence[Reading], index: int, unit: str) -> str:
    reading = readings[index]
    return f"reading {index + 1} ({math.degrees(reading.angle):zg}{unit} at {reading.width_us:g} µs)"


def _line(readings: Sequence[Reading]) -> Fit:
    """Return the least-squares fit of angle over width, written as width over angle."""
    widths = np.array([reading.width_us for reading in readings])
    angles = np.array([reading.angle for reading in readings])
    middle, mean = float(widths.mean()), float(angles.mean())
    away = widths - middle
    slope = float(away @ (angles - mean)) / float(away @ away)
    residuals = tuple((angles - mean - slope * away).tolist())
    if slope == 0:
        return Fit(tuple(readings), math.nan, math.inf, residuals)
    return Fit(tuple(readings), middle - mean / slope, 1 / slope, residuals)


def _fit_two_lines(line: Fit) -> Fit | None:
    """Return the least-squares fit of two lines that meet at one of the widths, three readings or more in
    each; None unless it is far better than one line.
    """
    if len(line.readings) < MIN_BENT or line.rms <= BENT_RAD:
        return None
    widths = np.array([reading.width_us for reading in line.readings])
    angles = np.array([reading.angle for reading in line.readings])
    each = sorted(set(widths.tolist()))
    found = []
    for middle in each[2:-2]:
        knots = [each[0], middle, each[-1]]
        hats = np.stack([np.interp(widths, knots, row) for row in np.eye(3)], axis=1)
        at = np.linalg.lstsq(hats, angles, rcond=None)[0]
        if np.all(np.diff(at) > 0) or np.all(np.diff(at) < 0):
            curve = calibration(tuple(zip(at.tolist(), knots, strict=True)))
            residuals = tuple((angles - hats @ at).tolist())
            found.append(Fit(line.readings, line.zero_us, line.us_per_rad, residuals, curve))
    best = min(found, key=lambda fit: fit.rms, default=None)
    return best if best is not None and best.rms < BENT_SHARE * line.rms else None


class LineTable(Table):
    """[fit]: what the points were computed from, for human readers."""

    readings: int
    us_per_deg: float
    zero_us: float
    rms_deg: float
    worst_deg: float


class ReadingTable(Table):
    """[[reading]]: the width sent and the angle measured, for the servo as mounted, and its distance from the
    line.
    """

    angle_deg: float | None = None
    speed_deg_s: float | None = None
    width_us: float = Field(ge=MIN_US, le=MAX_US)
    residual_deg: float


class CalibrationTable(Table):
    """A calibration file. The points are the shaft's, as a model's are: without reverse and trim_us."""

    servo: str
    model: str
    points: tuple[PointTable, ...] = Field(min_length=2)
    fit: LineTable | None = None
    reading: tuple[ReadingTable, ...] = ()


def read_calibration(path: Path, servo: str, model: str, continuous: bool, place: Location) -> Calibration:
    """Return the calibration of that servo; `place` is where the job names the file.

    Raises InputError for a file that is missing or invalid, and for one of another servo or model.
    """
    if not path.is_file():
        raise InputError(
            "unreadable-file",
            f"there is no calibration file '{path}'",
            place,
            f"servogen calibrate … --servo {servo}",
        )
    document, table = toml_file.load(path, CalibrationTable)
    for key, mine in (("servo", servo), ("model", model)):
        given = getattr(table, key)
        if given != mine:
            raise document.error(
                "bad-calibration",
                (key,),
                f"this calibrates the {key} '{given}', but the job has '{mine}'",
                "calibrate it again",
            )
    return points_of(table.points, document.place("points"), continuous)


def calibration_text(fit: Fit, servo: Servo) -> str:
    """Return the file's text; the line is cut at the servo's mechanical stops."""
    key = "speed_deg_s" if servo.model.continuous else "angle_deg"
    points = [
        f"    {{ {key} = {math.degrees(servo.mounted(angle)):z.6f}, "
        f"width_us = {width - servo.trim_us:.4f} }},"
        for angle, width in fit.points(servo.model.travel)
    ]
    lines = [
        "# The calibration of one servo, written by `servogen calibrate`.",
        f'servo = "{servo.name}"',
        f'model = "{servo.model.name}"',
        "points = [ # of the shaft, without the job's reverse and trim_us",
        *points,
        "]",
        "",
        "[fit] # of the servo as mounted and trimmed; from here on for information only",
        f"readings = {len(fit.readings)}",
        f"us_per_deg = {fit.us_per_rad * math.radians(1):z.6f}",
        f"zero_us = {fit.zero_us:z.3f}",
        f"rms_deg = {math.degrees(fit.rms):z.3f}",
        f"worst_deg = {math.degrees(fit.residuals[fit.worst]):z.3f}",
    ]
    for reading, residual in zip(fit.readings, fit.residuals, strict=True):
        lines += [
            "",
            "[[reading]]",
            f"{key} = {math.degrees(reading.angle):z.3f}",
            f"width_us = {reading.width_us:z.3f}",
            f"residual_deg = {math.degrees(residual):z.3f}",
        ]
    return "\n".join(lines) + "\n"


def write_calibration(path: Path, text: str) -> Path | None:
    """Write the file atomically; an existing file is kept under the name that is returned.

    Raises InputError if the path cannot be written.
    """
    previous = _back_up(path) if path.is_file() else None
    try:
        write_text(path, text)
    except BaseException:
        if previous is not None:  # the old file still has its name
            previous.unlink(missing_ok=True)
        raise
    return previous


def _back_up(path: Path) -> Path:
    """Return a copy of the file under the first free name among NAME.1.bak, NAME.2.bak, …."""
    old = path.read_bytes()
    number = 0
    while True:
        number += 1
        copy = path.with_name(f"{path.name}.{number}.bak")
        try:
            with copy.open("xb") as file:
                file.write(old)
        except FileExistsError:
            continue
        except OSError as error:
            raise ToolError(
                "write-failed", f"the old file cannot be kept: {error.strerror}", Location(str(copy))
            ) from error
        return copy
