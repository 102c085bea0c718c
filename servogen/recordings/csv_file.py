"""A motion as CSV: a column of seconds, a column for each servo or joint, its unit in the name.

time_s,arm_deg,grip_us       the names of `servogen plan --csv`, whose columns of points and achieved
0,90,1500                    widths are passed over
0.02,90.4,1500
"""

from __future__ import annotations

import csv
import io
import re

from servogen.errors import InputError, Location
from servogen.inputs import number_in
from servogen.recordings.recording import MAX_SAMPLES, RecordedMotion, recording

TIMES = ("time_s", "time", "t")
UNIT = re.compile(r"(.+)_(deg|rad|us)")
NOT_ANGLES = re.compile(r".*_(mm|width_us|ground)")
"""Columns of servogen's own tables that no servo is told by."""

MAX_NUMBER = 1e9
"""The largest number in any unit; a larger one must be a mistake."""


def csv_tracks(text: str, file: str) -> RecordedMotion:
    """Return the recording in a CSV file. Raises InputError with the line."""
    rows = csv.reader(io.StringIO(text), skipinitialspace=True)
    try:
        header = [cell.strip() for cell in next(rows, [])]
        time, columns = _columns(header, file)
        samples = []
        for row in rows:
            if not any(cell.strip() for cell in row):
                continue
            place = Location(file, rows.line_num)
            if len(row) != len(header):
                raise InputError("csv-syntax", f"has {len(row)} cells, the header has {len(header)}", place)
            values = [_number(row[index], header[index], place) for index in (time, *columns)]
            samples.append((values[0], values[1:], place))
            if len(samples) > MAX_SAMPLES:
                raise InputError("file-too-large", "has too many rows", place, f"at most {MAX_SAMPLES}")
    except csv.Error as error:
        raise InputError(
            "csv-syntax", f"is not a CSV file: {error}", Location(file, rows.line_num)
        ) from error
    parts = [UNIT.fullmatch(header[index]) for index in columns]
    names = [part[1] if part else header[index] for part, index in zip(parts, columns, strict=True)]
    units = [part[2] if part else "" for part in parts]
    return recording(file, names, units, samples)


def _columns(header: list[str], file: str) -> tuple[int, list[int]]:
    """Return the column of the time and those of the tracks. Raises InputError."""
    time = next((index for index, name in enumerate(header) if name.lower() in TIMES), None)
    columns = [
        index
        for index, name in enumerate(header)
        if index != time and not NOT_ANGLES.fullmatch(name) and name
    ]
    if time is None or not columns:
        missing = "column time_s" if time is None else "column of a servo"
        raise InputError(
            "csv-syntax", f"has no {missing}", Location(file, 1), "the first line is time_s,<servo>_deg,…"
        )
    return time, columns


def _number(cell: str, column: str, place: Location) -> float:
    value = number_in(cell)
    if value is None or abs(value) > MAX_NUMBER:
        raise InputError("csv-syntax", f"{column}: '{cell[:40]}' is not a number", place)
    return value
