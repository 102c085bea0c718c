"""The calibration file of one servo: what `servogen calibrate` writes and `calibration = …` of a job reads.

In: a `Fit`. Out: TOML text; a file that was there is kept beside the new one. And back: the `Calibration`.
"""

from __future__ import annotations

import math
from pathlib import Path

from pydantic import Field

from servogen import tomlfile
from servogen.errors import InputError, Place, ToolError
from servogen.outputs import write_text
from servogen.robot.calibration_fit import Fit
from servogen.robot.servo import Calibration, Servo
from servogen.robot.servo_models import PointTable, points_of
from servogen.tomlfile import Table


class LineTable(Table):
    """[fit]: what the points were made from, for people."""

    readings: int
    us_per_deg: float
    zero_us: float
    rms_deg: float
    worst_deg: float


class ReadingTable(PointTable):
    """[[reading]]: what was sent and read, of the servo as it sits, and how far it is from the line."""

    residual_deg: float


class CalibrationTable(Table):
    """A calibration file. The points are the shaft's, as a model's are: without reverse and trim_us."""

    servo: str
    model: str
    points: tuple[PointTable, ...] = Field(min_length=2)
    fit: LineTable | None = None
    reading: tuple[ReadingTable, ...] = ()


def read_calibration(path: Path, servo: str, model: str, continuous: bool, place: Place) -> Calibration:
    """The calibration of that servo; `place` is where the job names the file.

    Raises InputError for a file that is not there or wrong, and for one of another servo or model.
    """
    if not path.is_file():
        raise InputError(
            f"there is no calibration file '{path}'", place, f"servogen calibrate … --servo {servo}"
        )
    document, table = tomlfile.load(path, CalibrationTable)
    for key, mine in (("servo", servo), ("model", model)):
        given = getattr(table, key)
        if given != mine:
            raise document.error(
                (key,), f"this calibrates the {key} '{given}', the job's is '{mine}'", "calibrate it anew"
            )
    return points_of(table.points, document.place("points"), continuous)


def calibration_text(fit: Fit, servo: Servo) -> str:
    """The file's text; the line is cut at the servo's mechanical stops."""
    key = "speed_deg_s" if servo.model.continuous else "angle_deg"
    points = [
        f"    {{ {key} = {math.degrees(servo.mounted(angle)):z.6f}, "
        f"width_us = {width - servo.trim_us:.4f} }},"
        for angle, width in fit.ends(servo.model.travel)
    ]
    lines = [
        "# The calibration of one servo, as `servogen calibrate` found it.",
        f'servo = "{servo.name}"',
        f'model = "{servo.model.name}"',
        "points = [ # of the shaft: reverse and trim_us of the job are not in them",
        *points,
        "]",
        "",
        "[fit] # of the servo as it sits, trimmed; from here on for people",
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
    """Writes the file, whole or not at all; a file that was there is kept, under the name that is returned.

    Raises InputError where the path cannot be written.
    """
    kept = _kept(path) if path.is_file() else None
    try:
        write_text(path, text)
    except BaseException:
        if kept is not None:  # the old file still has its own name
            kept.unlink(missing_ok=True)
        raise
    return kept


def _kept(path: Path) -> Path:
    """A copy of the file under the first of NAME.1.bak, NAME.2.bak, … that is free."""
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
            raise ToolError(f"the old file cannot be kept: {error.strerror}", Place(str(copy))) from error
        return copy
