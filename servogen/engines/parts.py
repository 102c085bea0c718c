"""What a motion does, as comments of its C: of each part the feet or the tool, and the servos that bring them
there.

In: a job. Out: lines of text: millimetres, degrees and microseconds of the same moment beside each other.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from textwrap import wrap

import numpy as np

from servogen.engines.protocol import EngineJob, MovedEnd
from servogen.motion.trajectory import Floats

MAX_PARTS = 40
"""Parts that are described: a program of a hundred lines is better read in its job file."""

LINE = 104
"""The characters of a line."""


def place_text(name: str, points: Floats) -> str:
    """Return points (n, 3), metres, as text in mm: each coordinate, or its range; empty without a point."""
    points = points[~np.isnan(points).any(axis=1)]
    if not len(points):
        return ""
    decimals = 2 if len(points) == 1 else 1
    return f"{name} {', '.join(_range(1000 * np.sort(each), decimals) for each in points.T)} mm"


def titled_ends(job: EngineJob) -> list[tuple[str, MovedEnd]]:
    """Return what the servos move, each with its name in comments: a single one is the foot or the tool."""
    ends = job.ends
    return [(end.kind if len(ends) == 1 else end.name, end) for end in ends]


def part_texts(job: EngineJob) -> Iterator[str]:
    """Yield a line or more for each part of the motion: of a walk where each foot goes, otherwise the end."""
    parts, ends = list(_parts(job)), titled_ends(job)
    walks = len(ends) > 1
    for title, angles in parts[:MAX_PARTS]:
        yield from (f"  {line}" for line in wrap(title, LINE))
        for line in _lines(job, ends, angles if walks else angles[-1:]):
            yield from (f"    {text}" for text in wrap(line, LINE))
    if len(parts) > MAX_PARTS:
        yield f"  and {len(parts) - MAX_PARTS} more parts"


def _parts(job: EngineJob) -> Iterator[tuple[str, Floats]]:
    angles, frame_s = job.trajectory.angles, float(job.clock.seconds(job.trajectory.period))
    for direction in job.directions:
        yield f"{direction.name}:", direction.angles
    if not job.directions:
        ends = [*(part.begin for part in job.parts), len(angles)]
        for part, (begin, end) in zip(job.parts, pairwise(ends), strict=True):
            if end > begin:
                seconds = " to ".join(f"{round(frame * frame_s, 3):g}" for frame in (begin, end))
                yield f"{part.name}, {seconds} s:", angles[begin:end]


def _lines(job: EngineJob, ends: list[tuple[str, MovedEnd]], angles: Floats) -> Iterator[str]:
    """Yield a line for each foot or tool and its servos, and one for the other servos."""
    texts = [_servo_text(job, index, angles[:, index]) for index in range(len(job.servos))]
    others = set(range(len(texts)))
    for title, end in ends:
        others -= set(end.columns)
        place = place_text(title, end.points(angles))
        yield "; ".join(filter(None, (place, *(texts[column] for column in end.columns))))
    if others:
        yield "; ".join(texts[column] for column in sorted(others))


def _servo_text(job: EngineJob, index: int, angles: Floats) -> str:
    """Return a servo's angles, and the widths of their pulses, each the one or its range."""
    servo, angles = job.servos[index], angles[~np.isnan(angles)]
    if not len(angles):
        return f"{servo.name} without pulses"
    ends = np.sort(angles)[[0, -1]]
    widths = np.array([servo.width_us(angle) for angle in ends])
    unit = "deg/s" if servo.model.continuous else "deg"
    return f"{servo.name} {_range(np.degrees(ends), 1)} {unit}: {_range(widths, 0)} us"


def _range(values: Floats, decimals: int) -> str:
    """Return the first and the last value; one number where they round to the same."""
    ends = (round(float(each), decimals) for each in values[[0, -1]])
    return " to ".join(dict.fromkeys(f"{each:z.8g}" for each in ends))
