"""The files that commands read, within limits and with warnings, and those that they must not overwrite."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from servogen import programs
from servogen.cli.show import warn
from servogen.errors import Diagnostic, InputError, Location
from servogen.isolation import COMPILING, WorkLimits, missing_limits
from servogen.outputs import write_text
from servogen.pic.image import Image, read_hex, to_hex
from servogen.pic.listing import Listing, listing_text
from servogen.programs import Program, read_schedule

if TYPE_CHECKING:
    from servogen.pulse import PulseSchedule  # which loads the planner: a HEX file does not need it

T = TypeVar("T")


def check_outputs(inputs: Sequence[Path], *outputs: Path | None) -> None:
    """Raise InputError if an output is also an input, or the same file as another output."""
    used = {path.resolve(): "is what is read" for path in inputs}
    for output in outputs:
        if output is None:
            continue
        if output.resolve() in used:
            raise InputError(
                "output-exists",
                f"{used[output.resolve()]}: give the output another name",
                Location(str(output)),
            )
        if output.exists() and not (output.is_file() or output.is_dir()):
            continue  # a device, such as /dev/null, takes any number of outputs
        used[output.resolve()] = "is written already"


def read_image(path: Path) -> Image:
    """Return the image in a HEX file, in the folder of a build, or of a job; warn of what is unusual.

    Raises InputError.
    """
    if programs.is_job(path):
        return read_program(path).image
    path = programs.program_file(path)
    file = read_hex(programs.read_source(path), str(path))
    for remark in file.remarks:
        warn(remark)
    return file.image


def read_program(path: Path, device_name: str | None = None) -> Program:
    """Return the program in a HEX, C or assembly file, of a job or of its build; warn of what is unusual.

    Raises InputError.
    """
    if path.suffix.lower() in (programs.C_SUFFIX, *programs.ASSEMBLY_SUFFIXES):
        warn_of_missing_limits()
    if programs.is_job(path):
        from servogen.workflows.job_program import read_program as built  # compiler, engines: only for a job

        program = built(path)
    else:
        program = programs.read_program(path, device_name)
    for remark in program.remarks:
        warn(remark)
    return program


def read_any_schedule(path: Path) -> PulseSchedule:
    """Return the schedule in a schedule.json, of the folder of a build, or of a job. Raises InputError."""
    if programs.is_job(path):
        from servogen.job import load, plan_job  # loads the engines: only for a job
        from servogen.workflows.engines import planned

        return planned(plan_job(load(path))).plan.schedule
    return read_schedule(programs.one_build(path) / programs.BUILT_SCHEDULE if path.is_dir() else path)


def within_limits(
    work: Callable[[], T],
    file: Path,
    limits: WorkLimits = COMPILING,
    hint: str = programs.LIMITS_HINT,
) -> T:
    """Return what `work`, which compiles `file`, returns. Raises InputError if it exceeds the limits."""
    warn_of_missing_limits()
    return programs.within_limits(work, file, limits, hint)


@cache
def warn_of_missing_limits() -> None:
    """Warn, once, if this system cannot limit a process."""
    if sentence := missing_limits():
        warn(Diagnostic("warning", "no-limits", sentence))


def write_program(target: Path, image: Image, listing: Path | None, rows: Listing) -> None:
    """Write a HEX file and, if asked for, its listing."""
    write_text(target, to_hex(image))
    if listing:
        write_text(listing, listing_text(rows))
