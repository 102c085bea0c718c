"""Composition of the packages: from a job to proven HEX files."""

from servogen.build.build import Build, Program, build, report, write
from servogen.build.engines import Planned, nearest_pulses, planned
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

__all__ = [
    "LOOPS_CHECKED",
    "Build",
    "Planned",
    "Program",
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
