"""The engines that a job can choose: from a job to its schedule and the firmware of each dialect.

In: a `Job`. Out: `Planned`. "auto" is the smallest engine that can do the job: `sequence`, else `player`;
`stream` where the job has a serial line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType

from servogen.errors import InputError
from servogen.job import Job
from servogen.pipeline.fitting import DoesNotFit
from servogen.pipeline.player import compiled, play
from servogen.pipeline.stream import compiled as compiled_stream
from servogen.pipeline.stream import stream
from servogen.pipeline.tuning import Firmware, tune
from servogen.pulse.plan import PulsePlan, plan


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """A job as its engine plays it, with its lead-in; the schedule; what makes a dialect's firmware."""

    job: Job
    engine: str
    plan: PulsePlan
    make: Callable[[str], Firmware]


def planned(job: Job) -> Planned:
    """The job as its engine plays it. Raises InputError, DoesNotFit where no engine can hold the motion."""
    if job.stream is not None:
        return _stream(job)
    if job.firmware.engine != "auto":
        return ENGINES[job.firmware.engine](job)
    if job.firmware.buttons.any:
        return _player(job)
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
    motion, played = play(job)
    made = cache(lambda dialect: compiled(job, played, dialect))
    return Planned(replace(job, trajectory=motion), "player", played.plan, made)


def _stream(job: Job) -> Planned:
    idle, streamed = stream(job)
    made = cache(lambda dialect: compiled_stream(job, streamed, dialect))
    return Planned(replace(job, trajectory=idle), "stream", streamed.plan, made)


ENGINES: Mapping[str, Callable[[Job], Planned]] = MappingProxyType({"sequence": _sequence, "player": _player})
"""Those that play a motion of their own, smallest first."""
