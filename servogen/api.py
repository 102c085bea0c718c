"""load, build, simulate, plot: for notebooks and short scripts.

In: files, or what another of the four returned. Out: the values of the packages below, which show themselves
in a line, or in a notebook as a table or a picture.
"""

from __future__ import annotations

from dataclasses import replace
from numbers import Real
from pathlib import Path

from servogen.edges import EdgeTrace
from servogen.engines.board import board_of, inputs_of
from servogen.errors import InputError, Location
from servogen.job import Job, PlannedJob, plan_job
from servogen.job import load as load_job
from servogen.programs import PROGRAM_SUFFIXES, Program, clock_of, is_job, read_program
from servogen.pulse import PulseSchedule
from servogen.report.pictures import Picture
from servogen.report.pulse_plot import pulse_figure
from servogen.simulator import Simulation, SimulatorOptions, load_stimuli
from servogen.simulator import simulate as run
from servogen.simulator.machine import Stimulus
from servogen.units import Clock, Cycles
from servogen.workflows.job_build import Build
from servogen.workflows.job_build import build as build_planned
from servogen.workflows.job_program import job_program
from servogen.workflows.verification import motion_cycles

File = str | Path
Runnable = File | Job | Program | Build

SECONDS = 1.0
"""The time in seconds that a program without a known motion runs."""

MAX_SECONDS = 3600
"""The longest run in one call, in seconds: all its edges are kept in memory."""


def load(path: File) -> Job | Program:
    """Return the job in a .toml file, or the program in a HEX, C or assembly file or a build's folder.

    Raises InputError.
    """
    path = _path(path, "path")
    if is_job(path):
        return load_job(path)
    if path.suffix.lower() not in PROGRAM_SUFFIXES and not path.is_dir():
        raise InputError(
            "unknown-suffix",
            f"'{path.suffix}' is not the suffix of a job or a program",
            Location(str(path)),
            f"one of: .toml, {', '.join(PROGRAM_SUFFIXES)}",
        )
    return read_program(path)


def build(job: File | Job) -> Build:
    """Return a job's programs, compiled in every dialect and compared with its schedule; nothing is written.

    Raises InputError.
    """
    loaded = job if isinstance(job, Job) else load_job(_path(job, "job"))
    return build_planned(loaded if isinstance(loaded, PlannedJob) else plan_job(loaded))


def simulate(
    program: Runnable,
    seconds: float | None = None,
    *,
    clock_hz: int | None = None,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
    stimulus: File | Stimulus | None = None,
) -> Simulation:
    """Return what a program does from power-up on: its pins' edges, the chip at the end, warnings.

    A build runs for its motion once, with its inputs as its schedule holds them; any other program for a
    second. A job's program runs on the job's chip, any other on that of `options`. `stimulus` may be a TOML
    file. Raises InputError.
    """
    if isinstance(program, Build):
        schedule = program.plan.schedule
        span = motion_cycles(schedule) if seconds is None else _span(schedule.clock, seconds)
        inputs = _stimulus(stimulus, schedule.clock) or inputs_of(schedule)
        return run(program.programs[0].image, schedule.clock, span, board_of(schedule, options), inputs)
    loaded = _program(program)
    clock = clock_of(loaded, clock_hz)
    span = _span(clock, SECONDS if seconds is None else seconds)
    board = options if loaded.device is None else replace(options, device=loaded.device)
    return run(loaded.image, clock, span, board, _stimulus(stimulus, clock))


def _stimulus(given: File | Stimulus | None, clock: Clock) -> Stimulus | None:
    """Return a stimulus, read if a file is given. Raises InputError."""
    if given is None or (not isinstance(given, (str, Path)) and hasattr(given, "changes")):
        return given
    return load_stimuli(_path(given, "stimulus"), clock)


def _path(given: object, name: str) -> Path:
    """Return the path that was given. Raises InputError for anything else."""
    if isinstance(given, (str, Path)):
        return Path(given)
    raise InputError(
        "wrong-type", f"{name} = {given!r:.60} is not the path of a file", hint="give a str or a pathlib.Path"
    )


def _span(clock: Clock, seconds: float) -> Cycles:
    """Return a time in cycles. Raises InputError."""
    if not isinstance(seconds, Real) or not 0 <= seconds <= MAX_SECONDS:  # refuses NaN, too
        raise InputError("out-of-range", f"seconds = {seconds!r} is not a number from 0 to {MAX_SECONDS}")
    return Cycles(clock.round_seconds(float(seconds)))


def _program(given: File | Job | Program) -> Program:
    if isinstance(given, Program):
        return given
    loaded = given if isinstance(given, Job) else load(given)
    return job_program(loaded) if isinstance(loaded, Job) else loaded


def plot(source: Runnable | Simulation | EdgeTrace, seconds: float | None = None) -> Picture:
    """Return a picture of pulses: of a simulation, of recorded edges, or of a program that is run for it.

    Raises InputError where there are no pulses, ToolError without matplotlib.
    """
    schedule: PulseSchedule | None = None
    if isinstance(source, EdgeTrace):
        trace, title = source, "pulses"
    elif isinstance(source, Simulation):
        trace, title = source.edges, "pulses"
    else:
        schedule = source.plan.schedule if isinstance(source, Build) else None
        trace = simulate(source, seconds).edges
        title = (
            source.job.name
            if isinstance(source, Build)
            else source.name
            if isinstance(source, Job)
            else "pulses"
        )
    if seconds is not None:
        trace = trace.until(_span(trace.clock, seconds))
    return Picture(pulse_figure(trace, trace.end, f"{title}: from the first edge on", schedule))
