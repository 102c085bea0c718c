"""Advice for a job whose motion does not fit: changes that have been tried and make it fit.

In: a planned job and the error that refused it. Out: the same error; its hint lists the changes with which
the job can be built (planned, and compiled for its dialect), and the size of each segment of a walk by
itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace

from servogen.build.engines import Planned, planned
from servogen.errors import InputError, ServogenError
from servogen.job import PlannedJob, plan_job
from servogen.job.reader import changed
from servogen.job.schema import MotionTable, WalkTable
from servogen.units import counted

CODES = ("frame-too-short", "does-not-fit", "beyond-max-error", "widths-too-far-apart")
"""The codes of errors for which changes are tried."""

PERIODS_US = (20_480, 21_000, 22_000, 23_000, 25_000, 30_000)
"""Longer periods that most servos accept, the shortest first."""

MAX_POSES = 500
"""The maximum number of poses for which changes are tried: half as many still take four of 1024 words
each.
"""

SLOWER = (1.25, 1.5, 2.0)
LOWER = (0.75, 0.5)


@dataclass(frozen=True, slots=True)
class Change:
    """A key of the job with another value, and the notation of the change."""

    table: str
    key: str
    value: object
    text: str


@dataclass(frozen=True, slots=True)
class Fit:
    """The resources of a job that can be built."""

    words: int
    data: int
    error_us: float

    def text(self) -> str:
        return f"{self.data} bytes of motion, {self.words} words, {self.error_us:g} µs"


def advised(job: PlannedJob, error: InputError) -> InputError:
    """Return the error with a hint that lists what would fit, if anything that was tried does."""
    if error.code not in CODES:
        return error
    tried = [_first_fit(job, group) for group in _groups(job, error)]
    proposals = [f"{change.text} ({fit.text()})" for change, fit in filter(None, tried)]
    sentences = [f"what fits: {'; or '.join(proposals)}"] if proposals else []
    parts = list(_parts(job))
    if parts:
        sentences.append(f"by segment: {'; '.join(parts)}")
    if not sentences:
        return error
    advised_error = copy(error)
    advised_error.diagnostics = (replace(error.first, hint="\n  ".join(sentences)),)
    return advised_error


def _groups(job: PlannedJob, error: InputError) -> Iterator[list[Change]]:
    """Yield groups of changes of the same kind, the smallest change first."""
    section = job.section
    if isinstance(section, MotionTable) and len(section.poses) > MAX_POSES:
        return
    period_us = float(job.frame.period.requested_us)
    longer = [value for value in PERIODS_US if value > period_us]
    yield [Change("frame", "period_us", value, f"period_us = {value}") for value in longer]
    if isinstance(section, WalkTable):
        yield from _walk_changes(job, section)
    if isinstance(section, MotionTable) and len(section.poses) > 1:
        poses = job.document.data["motion"]["poses"]
        counts = sorted({len(poses) * 3 // 4, len(poses) // 2} - {0}, reverse=True)
        yield [Change("motion", "poses", poses[:count], f"only the first {count} poses") for count in counts]
    limit = job.firmware.max_error_us
    if error.code == "beyond-max-error":
        larger = sorted({math.ceil(limit * factor) for factor in (1.25, 1.5, 2, 3, 4)})
        yield [Change("firmware", "max_error_us", value, f"max_error_us = {value}") for value in larger]


def _walk_changes(job: PlannedJob, walk: WalkTable) -> Iterator[list[Change]]:
    period_s = float(job.clock.seconds(job.trajectory.period))
    if walk.cycle_s is not None:
        slower = [round(math.ceil(walk.cycle_s * factor / period_s) * period_s, 4) for factor in SLOWER]
        yield [Change("walk", "cycle_s", value, f"cycle_s = {value:g}") for value in slower]
    lower = [round(walk.lift_mm * share, 1) for share in LOWER]
    yield [Change("walk", "lift_mm", value, f"lift_mm = {value:g}") for value in lower]
    if walk.gait != "tripod" and walk.duty is None:
        yield [Change("walk", "gait", "tripod", 'gait = "tripod"')]
    if len(walk.route) > 1:
        route = tuple(job.document.data["walk"]["route"])
        yield [
            Change("walk", "route", route[:count], f"only the first {counted(count, 'segment')} of the route")
            for count in range(len(route) - 1, 0, -1)
        ]
    if walk.commands is not None and walk.commands.forward_mm and walk.commands.turn_deg:
        asked = job.document.data["walk"]["commands"]
        yield [
            Change(
                "walk",
                "commands",
                {key: value for key, value in asked.items() if key != without},
                f"commands without {without}",
            )
            for without in ("turn_deg", "forward_mm")
        ]


def _first_fit(job: PlannedJob, group: list[Change]) -> tuple[Change, Fit] | None:
    for change in group:
        fit = _fit(job, change)
        if fit is not None:
            return change, fit
    return None


def _fit(job: PlannedJob, change: Change) -> Fit | None:
    """Return the resources of the changed job; None if it cannot be built."""
    try:
        played = planned(plan_job(changed(job, change.table, change.key, change.value)))
        return _taken(played)
    except ServogenError:
        return None


def _taken(played: Planned) -> Fit | None:
    firmware = played.make(played.job.firmware.dialect)
    if any(room.left is None or room.left < 0 for room in firmware.timing_budgets):
        return None
    error = played.plan.schedule.plan_error
    return Fit(firmware.compilation.words, played.data_bytes, 0.0 if error is None else error.width_us)


def _parts(job: PlannedJob) -> Iterator[str]:
    """Yield what each segment of a walk's route takes by itself."""
    if not isinstance(job.section, WalkTable) or len(job.section.route) < 2:
        return
    for number, segment in enumerate(job.document.data["walk"]["route"], 1):
        fit = _fit(job, Change("walk", "route", (segment,), ""))
        yield f"segment {number} alone {'does not fit' if fit is None else f'takes {fit.text()}'}"
