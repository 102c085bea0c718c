"""Finds a program: in a file, in the folder of a build, or by building a job.

In: a path. Out: a `Program`; a job file is built in the dialect that it names.
"""

from __future__ import annotations

from pathlib import Path

from servogen import programs
from servogen.job import Job, load, plan_job
from servogen.programs import Program, is_job
from servogen.workflows.engines import PlayedJob, planned


def read_program(path: Path, device_name: str | None = None) -> Program:
    """Return the program in a file or in the folder of a build, or the one of a job. Raises InputError.

    The device of a job is the job's own.
    """
    return job_program(load(path)) if is_job(path) else programs.read_program(path, device_name)


def job_program(job: Job) -> Program:
    """Return the program of a job, in the job's dialect. Raises InputError or ResourceError."""
    return played_program(planned(plan_job(job)))


def played_program(played: PlayedJob) -> Program:
    """Return the program of a job that is planned already."""
    job = played.job
    compilation = played.make(job.firmware.dialect).compilation
    return Program(compilation.image, compilation.listing, job.clock, device=job.device.name)
