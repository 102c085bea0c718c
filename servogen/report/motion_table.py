"""Every frame of a motion as CSV: of a planned job, of a walk, of an arm's program.

In: a `PlannedJob` with its schedule and tracks, a `Walk`, or a trajectory of joints. Out: lines of text,
one per frame; a cell without a pulse is empty.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from servogen.job import PlannedJob
from servogen.motion.gait.walk import Walk
from servogen.motion.trajectory import Floats, JointTrajectory
from servogen.pulse import PulseSchedule
from servogen.report.tracks import Track
from servogen.robot.model import Arm


def frame_lines(job: PlannedJob, schedule: PulseSchedule, tracks: Sequence[Track]) -> Iterator[str]:
    """Yield the header, then one line per frame: seconds, degrees (°/s of a wheel), µs, mm.

    Angles and points are as planned; widths are as made, whole cycles. One foot or tool has the columns
    x_mm, y_mm, z_mm; of several each is named.
    """
    angles = [f"{servo.name}_deg{'_s' if servo.model.continuous else ''}" for servo in job.servos]
    widths = [f"{servo.name}_width_us" for servo in job.servos]
    names = [f"{track.name}_" if len(tracks) > 1 else "" for track in tracks]
    points = [f"{name}{axis}_mm" for name in names for axis in "xyz"]
    yield ",".join(("time_s", *angles, *widths, *points))
    frame_s = schedule.clock.seconds(schedule.period)
    blocks = [np.degrees(job.trajectory.angles), widths_us(schedule)]
    blocks += [1000 * track.planned for track in tracks]
    decimals = [4] * len(angles) + [3] * len(widths) + [4] * len(points)
    for frame, row in enumerate(np.hstack(blocks)):
        cells = (
            "" if value != value else f"{value:z.{places}f}"
            for value, places in zip(row.tolist(), decimals, strict=True)
        )
        yield ",".join((f"{float(frame * frame_s):z.6f}", *cells))


def widths_us(schedule: PulseSchedule) -> Floats:
    """Return the widths (frames, servos) in microseconds; NaN without a pulse."""
    runs = (*schedule.lead_in, *schedule.loop)
    us = [
        [float(schedule.clock.us(pulse.width)) if pulse else np.nan for pulse in run.pulses] for run in runs
    ]
    return np.repeat(np.array(us), [run.frames for run in runs], axis=0)


def joint_lines(trajectory: JointTrajectory, arm: Arm) -> Iterator[str]:
    """Yield the header, then one line per frame: seconds, and each joint of an arm in degrees or mm."""
    units = ["deg" if joint.turning else "mm" for joint in arm.joints]
    yield ",".join(
        ("time_s", *(f"{joint.name}_{unit}" for joint, unit in zip(arm.joints, units, strict=True)))
    )
    scale = np.array([180 / math.pi if joint.turning else 1000 for joint in arm.joints])
    frame_s = trajectory.clock.seconds(trajectory.period)
    for frame, row in enumerate((trajectory.angles * scale).tolist()):
        yield ",".join((f"{float(frame * frame_s):.6g}", *(f"{value:z.6f}" for value in row)))


def walk_lines(planned: Walk) -> Iterator[str]:
    """Yield the header, then one line per frame; the margin is empty for a robot of one or two legs."""
    trajectory = planned.trajectory
    angles = [f"{joint}_deg" for joint in trajectory.joints]
    feet = [f"{leg}_{axis}_mm" for leg in planned.legs for axis in "xyz"]
    yield ",".join(("time_s", *angles, *feet, *(f"{leg}_ground" for leg in planned.legs), "margin_mm"))
    frame_s = trajectory.clock.seconds(trajectory.period)
    numbers = np.hstack((np.degrees(trajectory.angles), 1000 * planned.feet.reshape(len(planned.feet), -1)))
    rows = zip(numbers.tolist(), planned.ground.tolist(), planned.margins.tolist(), strict=True)
    for frame, (row, ground, margin) in enumerate(rows):
        cells = [f"{value:z.4f}" for value in row]
        cells += ["1" if down else "0" for down in ground]
        cells.append("" if math.isinf(margin) else f"{1000 * margin:z.4f}")
        yield ",".join((f"{float(frame * frame_s):z.6f}", *cells))
