"""Composition of the packages: from a job to HEX files with a verdict."""

from servogen.engines.firmware import ResourceError
from servogen.workflows.engines import PlayedJob, nearest_pulses, planned
from servogen.workflows.job_build import Build, BuiltProgram, build, report, write
from servogen.workflows.verification import (
    LOOPS_CHECKED,
    checked_cycles,
    judge_edges,
    judge_file,
    judge_image,
    motion_cycles,
    running,
)

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
