"""What a job plans for its robot, to be compared with the physics.

In: a planned job. Out: `PlannedRoute`: where the body, base or tool should be, and where rigid legs would
take it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.job import PlannedJob
from servogen.job.schema import WalkTable
from servogen.motion.drive import positions
from servogen.motion.gait.quasistatic import rigid_body_path
from servogen.motion.gait.steps import Segment
from servogen.motion.loads import MIN_LEGS
from servogen.report.tracks import standing_feet

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class PlannedRoute:
    """`way`: x, y, yaw at the end, as the job asks; `rigid`: in each frame, with rigid legs or ideal wheels.

    `length`: how far a walk goes on its way, in metres. `rigid` has x, y, yaw.
    `tool` (frames, 3): an arm's tool. `height`: the least height of a walking body.
    None: the robot has none.
    Frames are those of the job's own motion, its loop as often as the run plays it.
    """

    frame_s: float
    way: tuple[float, float, float] | None = None
    length: float | None = None
    rigid: Floats | None = None
    tool: Floats | None = None
    height: float | None = None


def planned_of(job: PlannedJob, lead_in_frames: int, loops: int) -> PlannedRoute:
    """Return what a job asks; its trajectory begins with `lead_in_frames` of the engine."""
    trajectory = job.trajectory
    loop = trajectory.angles[trajectory.loop_start :]
    angles = np.concatenate([trajectory.angles[lead_in_frames : trajectory.loop_start], *[loop] * loops])
    frame_s = float(trajectory.clock.seconds(trajectory.period))
    if job.base is not None:
        poses = positions(job.base, np.nan_to_num(angles[:, job.wheel_columns]), frame_s)
        x, y, yaw = poses[-1].tolist()
        return PlannedRoute(frame_s, (x, y, yaw), rigid=poses)
    ends = job.ends
    if not ends or np.isnan(angles).any():
        return PlannedRoute(frame_s)
    if ends[0].kind == "tool":
        return PlannedRoute(frame_s, tool=ends[0].points(angles))
    if len(ends) < MIN_LEGS:
        return PlannedRoute(frame_s)
    feet, centre = standing_feet(job, angles)
    rigid = rigid_body_path(feet, centre).pose
    height = float((-feet[..., 2].min(axis=1)).min())
    way, length = _route_end(job, loops)
    return PlannedRoute(frame_s, way, length, rigid, height=height)


def _route_end(job: PlannedJob, loops: int) -> tuple[tuple[float, float, float] | None, float | None]:
    """Return where [walk] leads: x, y, yaw at the end of its route, and how far it goes until then; None for
    a job without a route that ends.
    """
    if not isinstance(job.section, WalkTable) or job.section.commands is not None:
        return None, None
    place, yaw, length = 0j, 0.0, 0.0
    rows = [row for row in job.section.route if row.cycles is not None]
    if len(rows) < len(job.section.route):
        return None, None
    for row in [row for _ in range(loops) for row in rows]:
        segment = Segment(row.forward_mm / 1000, row.left_mm / 1000, math.radians(row.turn_deg), row.cycles)
        position, heading = segment.travelled(np.array(float(row.cycles or 0)))
        place += complex(position) * complex(math.cos(yaw), math.sin(yaw))
        yaw += float(heading)
        length += abs(complex(segment.forward, segment.left)) * float(row.cycles or 0)
    return (place.real, place.imag, yaw), length
