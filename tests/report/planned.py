"""The jobs of jobs/, planned."""

from __future__ import annotations

from pathlib import Path

from servogen.job import PlannedJob, load, plan_job
from servogen.pulse import PulseSchedule
from servogen.pulse.plan import plan
from servogen.report.tracks import Track, end_tracks

JOBS = Path(__file__).parents[2] / "jobs"


def planned(name: str) -> tuple[PlannedJob, PulseSchedule, tuple[Track, ...]]:
    """Return a job of jobs/ with its schedule and the tracks of its ends."""
    job = plan_job(load(JOBS / f"{name}.toml"))
    schedule = plan(job.trajectory, job.servos, job.frame).schedule
    return job, schedule, end_tracks(job, schedule)
