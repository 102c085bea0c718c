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
from servogen.robot.model import Hexapod, OmniBase


def steering_of(job: PlannedJob, rates: Rates) -> Steering:
    """Raises InputError where the robot cannot go any of the ways, or has nothing to be steered by."""
    if isinstance(job.robot, Hexapod) and not job.poses:
        return walker(job, rates)
    if isinstance(job.robot, OmniBase) and job.wheels:
        return roller(job, job.robot, rates)
    if job.poses or job.stream is not None:
        return Poser(job)
    raise InputError(
        "nothing-to-drive",
        "there is nothing to steer: keys walk a walking robot, roll a base, or go to the poses of [motion]",
        Location(job.file),
    )
