"""Composition of the packages: from a job to HEX files with a verdict.

`servogen.build(job)` calls the package: a function of that name and the package share one attribute.
"""

import sys
from types import ModuleType

from servogen.build.build import Build, BuiltProgram, build, report, write
from servogen.build.engines import PlayedJob, nearest_pulses, planned
from servogen.build.notebook import File
from servogen.build.notebook import build as build_job
from servogen.build.verification import (
    LOOPS_CHECKED,
    checked_cycles,
    judge_edges,
    judge_file,
    judge_image,
    motion_cycles,
    running,
)
from servogen.engines.firmware import ResourceError
from servogen.job import Job

__all__ = [
    "LOOPS_CHECKED",
    "Build",
    "BuiltProgram",
    "PlayedJob",
    "ResourceError",
    "build",
    "checked_cycles",
    "judge_edges",
    "judge_file",
    "judge_image",
    "motion_cycles",
    "nearest_pulses",
    "planned",
    "report",
    "running",
    "write",
]


class _CallablePackage(ModuleType):
    def __call__(self, job: File | Job) -> Build:
        return build_job(job)


sys.modules[__name__].__class__ = _CallablePackage
