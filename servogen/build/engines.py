"""The engines that a job can choose: from a job to its schedule and the firmware of each dialect.

In: a planned job. Out: `Planned`. "auto" is the smallest engine that can do the job: `sequence`, else
`player`; `stream` where the job has a serial line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType

from servogen.engines.firmware import Firmware, ResourceError
from servogen.engines.player.engine import compiled, play
from servogen.engines.sequence.tuning import tune
from servogen.engines.stream.engine import compiled as compiled_stream
from servogen.engines.stream.engine import stream
from servogen.errors import InputError
from servogen.job import PlannedJob
from servogen.plan_error import DECIMALS
from servogen.pulse.plan import PulsePlan, plan
from servogen.report.tool_error import errors_of, worst_of
from servogen.report.tracks import tracks_of


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """A job as its engine plays it, with its lead-in; the schedule; what makes a dialect's firmware."""

    job: PlannedJob
    engine: str
    plan: PulsePlan
    make: Callable[[str], Firmware]


def planned(job: PlannedJob) -> Planned:
    """Return the job as its engine plays it.

    Raises InputError, ResourceError where no engine can hold the motion.
    """
    found = _planned(job)
    schedule = replace(found.plan.schedule, device=job.device.name)
    return replace(found, plan=with_end_error(found.job, replace(found.plan, schedule=schedule)))


def with_end_error(job: PlannedJob, plan: PulsePlan) -> PulsePlan:
    """Return the plan, its error also measured at the foot, tool or base that `job`'s servos move."""
    error = plan.schedule.plan_error
    ends = errors_of(tracks_of(job, plan.schedule))
    if error is None or not ends:
        return plan
    worst = worst_of(ends)
    end = worst.name if worst.name == worst.kind else f"{worst.kind} {worst.name}"
    error = replace(error, end=end, end_mm=round(1000 * worst.worst_m, DECIMALS))
    return replace(plan, schedule=replace(plan.schedule, plan_error=error))


def _planned(job: PlannedJob) -> Planned:
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
    if not isinstance(smallest, ResourceError):
        raise smallest
    raise ResourceError(f"{smallest.message}; nor can the player: {largest.message}", hint=largest.hint)


def _sequence(job: PlannedJob) -> Planned:
    made = plan(job.trajectory, job.servos, job.frame)
    return Planned(
        job, "sequence", made, cache(lambda dialect: tune(made.schedule, dialect, job.device, job.name))
    )


def _player(job: PlannedJob) -> Planned:
    motion, played = play(job)
    made = cache(lambda dialect: compiled(job, played, dialect))
    return Planned(replace(job, trajectory=motion), "player", played.plan, made)


def _stream(job: PlannedJob) -> Planned:
    idle, streamed = stream(job)
    made = cache(lambda dialect: compiled_stream(job, streamed, dialect))
    return Planned(replace(job, trajectory=idle), "stream", streamed.plan, made)


ENGINES: Mapping[str, Callable[[PlannedJob], Planned]] = MappingProxyType(
    {"sequence": _sequence, "player": _player}
)
"""Those that play a motion of their own, smallest first."""
