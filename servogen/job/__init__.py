"""Job file -> `Job`: chip, servos, motion and frame, checked; `Job` -> `PlannedJob`: its trajectory."""

from servogen.job.job import Job, PlannedJob
from servogen.job.plan import plan_job
from servogen.job.reader import calibrated, load, loads
from servogen.job.starter import KINDS, kind_of, starter, template, usual_servo

__all__ = [
    "KINDS",
    "Job",
    "PlannedJob",
    "calibrated",
    "kind_of",
    "load",
    "loads",
    "plan_job",
    "starter",
    "template",
    "usual_servo",
]
