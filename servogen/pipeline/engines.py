"""The engines that a job can choose: from a job to its schedule and the firmware of each dialect.

In: a `Job`. Out: `Planned`. "auto" is the smallest engine that can do the job: `sequence`, else `player`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType

from servogen.compiler import CompileError, Options, Source, compile_sources
from servogen.csource import Overheads, render_player
from servogen.errors import InputError
from servogen.job import Job
from servogen.pipeline.tuning import DoesNotFit, Firmware, tune
from servogen.pulse.plan import PulsePlan, plan
from servogen.pulse.player import playing, soft_start


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """A job as its engine plays it, with its lead-in; the schedule; what makes a dialect's firmware."""

    job: Job
    engine: str
    plan: PulsePlan
    make: Callable[[str], Firmware]


def planned(job: Job) -> Planned:
    """The job as its engine plays it. Raises InputError, DoesNotFit where no engine can hold the motion."""
    if job.firmware.engine != "auto":
        return ENGINES[job.firmware.engine](job)
    refused: list[InputError] = []
    for engine in ENGINES.values():
        try:
            found = engine(job)
            found.make(job.firmware.dialect)
        except InputError as error:
            refused.append(error)
            continue
        return found
    smallest, largest = refused[0], refused[-1]
    if not isinstance(smallest, DoesNotFit):
        raise smallest
    raise DoesNotFit(f"{smallest.message}; nor can the player: {largest.message}", hint=largest.hint)


def _sequence(job: Job) -> Planned:
    made = plan(job.trajectory, job.servos, job.frame)
    return Planned(
        job, "sequence", made, cache(lambda dialect: tune(made.schedule, dialect, job.device, job.name))
    )


def _player(job: Job) -> Planned:
    frames = round(job.firmware.soft_start_s / job.clock.seconds(job.trajectory.period))
    begun = soft_start(job.trajectory, job.servos, frames)
    soft = len(begun.angles) - len(job.trajectory.angles)
    played = playing(begun, job.servos, job.frame, soft)

    @cache
    def make(dialect: str) -> Firmware:
        file = f"main.{dialect}.c"
        text = render_player(played, dialect, job.device, job.name)
        try:
            made = compile_sources([Source(text, file)], Options(dialect=dialect, device=job.device))
        except CompileError as error:
            raise DoesNotFit(
                f"{job.name}: planned, but more than the player can hold: {error.message}",
                hint="fewer parts: let more of the motion repeat",
            ) from error
        return Firmware(dialect, file, text, made, Overheads())

    return Planned(replace(job, trajectory=begun), "player", played.plan, make)


ENGINES: Mapping[str, Callable[[Job], Planned]] = MappingProxyType({"sequence": _sequence, "player": _player})
"""Smallest first."""
