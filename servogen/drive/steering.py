"""What a job's robot is steered by: a walking robot walks and turns, a base rolls, any other goes to poses.

In: a job. Out: its `Steering`.
"""

from __future__ import annotations

from servogen.drive.commands import Rates, Steering
from servogen.drive.poser import Poser
from servogen.drive.roller import roller
from servogen.drive.walker import walker
from servogen.errors import InputError, Location
from servogen.job import PlannedJob
from servogen.kinematics.protocol import WalkingRobot


def steering_of(job: PlannedJob, rates: Rates) -> Steering:
    """Raises InputError where the robot cannot go any of the ways, or has nothing to be steered by."""
    if isinstance(job.robot, WalkingRobot) and not job.poses:
        return walker(job, job.robot, rates)
    if job.base is not None:
        return roller(job, job.base, rates)
    if job.poses or job.stream is not None:
        return Poser(job)
    raise InputError(
        "nothing-to-drive",
        "there is nothing to steer: keys walk a walking robot, roll a base, or go to the poses of [motion]",
        Location(job.file),
    )
