"""Composition of the packages: from a job to proven HEX files.

`servogen.build(job)` calls the package: a function of that name and the package share one attribute.
"""

import sys
from types import ModuleType

from servogen.build.build import Build, BuiltProgram, build, report, write
from servogen.build.engines import PlayedJob, nearest_pulses, planned
from servogen.build.notebook import File
from servogen.build.notebook import build as build_job
from servogen.build.proof import (
    LOOPS_CHECKED,
    checked_cycles,
    motion_cycles,
    prove,
    prove_file,
    prove_image,
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
    "motion_cycles",
    "nearest_pulses",
    "planned",
    "prove",
    "prove_file",
    "prove_image",
    "report",
    "running",
    "write",
]


class _CallablePackage(ModuleType):
    def __call__(self, job: File | Job) -> Build:
        return build_job(job)


sys.modules[__name__].__class__ = _CallablePackage
