"""The plan on a page: angles and widths over time, paths of feet, tool or base, every width as rounded.

In: a job, its plan, its tracks. Out: `Chart`s and rows of text.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from servogen.job import PlannedJob
from servogen.motion.trajectory import Floats
from servogen.pulse import PulsePlan, PulseSchedule
from servogen.report.drawing import Chart, path_chart, time_chart
from servogen.report.motion_table import widths_us
from servogen.report.tracks import Track


def _times(schedule: PulseSchedule) -> Floats:
    frames = schedule.lead_in_frames + schedule.loop_frames
    return float(schedule.clock.seconds(schedule.period)) * np.arange(frames + 1, dtype=np.float64)


def _mark(schedule: PulseSchedule) -> float | None:
    """When the loop begins, where something comes before it."""
    return float(schedule.clock.seconds(schedule.lead_in_frames * schedule.period)) or None


def angle_chart(job: PlannedJob, schedule: PulseSchedule) -> Chart:
    servos = job.servos
    names = [servo.name for servo in servos]
    label = "wheel speed, °/s" if all(servo.model.continuous for servo in servos) else "servo angle, °"
    columns = np.degrees(job.trajectory.angles)
    return time_chart(_times(schedule), columns, names, label, _mark(schedule))


def width_chart(schedule: PulseSchedule) -> Chart:
    names = [channel.name for channel in schedule.channels]
    return time_chart(_times(schedule), widths_us(schedule), names, "pulse width, µs", _mark(schedule))


def rounding(plan: PulsePlan) -> Iterator[tuple[str, ...]]:
    for row in plan.widths:
        yield (
            f"{row.channel}, {row.which}" if row.which else row.channel,
            f"{math.degrees(row.angle):z.2f}",
            f"{float(row.requested_us):z.3f}",
            str(row.cycles),
            f"{float(row.achieved_us):z.3f}",
            f"{float(row.error_us):+z.3f}",
            str(row.frames),
        )


def path_charts(tracks: Sequence[Track], loop_start: int) -> Iterator[tuple[str, Chart]]:
    """From above and, unless all lies in the ground plane, from the side; millimetres."""
    views = [("from above", 0, 1, "x, mm", "y, mm"), ("from the side", 0, 2, "x, mm", "z, mm")]
    flat = all(track.kind == "base" for track in tracks)
    for title, x, y, x_label, y_label in views[: 1 if flat else 2] if tracks else ():
        drawn = []
        for track in tracks:
            # The loop's end leads back to its beginning.
            around = np.vstack((track.planned, track.planned[loop_start : loop_start + 1]))
            drawn.append((track.name, 1000 * around[:, [x, y]], 1000 * track.made[:, [x, y]]))
        yield title, path_chart(drawn, x_label, y_label)
