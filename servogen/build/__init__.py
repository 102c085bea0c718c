"""The rooms put together: from a job to proven HEX files."""

from servogen.build.build import Build, Program, build, report, write
from servogen.build.engines import Planned, planned
from servogen.build.fitting import DoesNotFit
from servogen.build.proof import (
    LOOPS_CHECKED,
    checked_cycles,
    motion_cycles,
    prove,
    prove_file,
    prove_image,
    running,
)

__all__ = [
    "LOOPS_CHECKED",
    "Build",
    "DoesNotFit",
    "Planned",
    "Program",
    "build",
    "checked_cycles",
    "motion_cycles",
    "planned",
    "prove",
    "prove_file",
    "prove_image",
    "report",
    "running",
    "write",
]
