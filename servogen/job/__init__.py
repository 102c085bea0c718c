"""Job file -> `Job`: chip, servos, motion and frame, checked; `Job` -> `PlannedJob`: its trajectory."""

from servogen.job.job import FirmwareSettings, Job, PlannedJob
from servogen.job.plan import plan_job
from servogen.job.reader import calibrated, load, loads, template

__all__ = ["FirmwareSettings", "Job", "PlannedJob", "calibrated", "load", "loads", "plan_job", "template"]
