"""The engines that a job can choose: from a job to its schedule and the firmware of each dialect.

In: a `PlannedJob`. Out: `PlayedJob`. "auto" is the first engine of the registry that can do the job.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from servogen.engines.firmware import Firmware, ResourceError
from servogen.engines.registry import engine_named, suitable
from servogen.errors import Diagnostic, InputError
from servogen.job import PlannedJob
from servogen.job.chips import motion_part
from servogen.motion import JointTrajectory
from servogen.plan_error import DECIMALS
from servogen.programs import PAIR_FOLDERS
from servogen.pulse import PulseSchedule
from servogen.pulse.plan import PulsePlan
from servogen.pulse.plan import plan as nearest
from servogen.report.tracks import end_errors, end_tracks, largest_error

if TYPE_CHECKING:
    from servogen.answers import CheckAnswer


@dataclass(frozen=True, slots=True, eq=False)
class PlayedJob:
    """A job as its engine plays it, with its lead-in; the schedule; the function that makes the firmware."""

    job: PlannedJob
    engine: str
    plan: PulsePlan
    make: Callable[[str], Firmware]
    data_bytes: int = 0
    tour: tuple[JointTrajectory, PulseSchedule] | None = None
    """All frames that the program can play, if the plan has only some of them."""

    def to_json(self) -> CheckAnswer:
        """Return the plan without notes and warnings."""
        job, schedule = self.job, self.plan.schedule
        return {
            "job": job.name,
            "device": job.device.name,
            "clock_hz": job.clock.hz,
            "period_cycles": schedule.period,
            "lead_in_frames": schedule.lead_in_frames,
            "loop_frames": schedule.loop_frames,
            "plan_error": schedule.plan_error.to_json() if schedule.plan_error else None,
            "widths": [row.to_json() for row in self.plan.widths],
        }


def planned(job: PlannedJob) -> PlayedJob:
    """Return the job as its engine plays it.

    Raises InputError; ResourceError if no engine can hold the motion.
    """
    if job.chips:
        raise InputError(
            "chip-pair",
            "the job is for two chips: no single program plays it",
            job.document.place("chip"),
            "`servogen build` writes both programs into one folder for verify, capture and flash; its "
            "chip1/ and chip2/ are builds for commands of one program",
        )
    played = _choose_engine(job)
    schedule = replace(played.plan.schedule, device=job.device.name)
    plan = replace(played.plan, schedule=schedule)
    if played.tour is None:
        return replace(played, plan=with_end_error(played.job, plan))
    motion, whole = played.tour
    measured = with_end_error(replace(played.job, trajectory=motion), replace(plan, schedule=whole))
    error = measured.schedule.plan_error
    return replace(played, plan=replace(plan, schedule=replace(schedule, plan_error=error)))


def chip_jobs(job: PlannedJob) -> tuple[PlannedJob, PlannedJob]:
    """Return the job of each chip: its servos' part of the motion, and its end of the wire.

    Raises InputError for a motion with pauses, which would stop the wire.
    """
    if np.isnan(job.trajectory.angles).any():
        raise InputError(
            "chip-pair",
            "the motion has frames without pulses, which would stop the wire",
            job.document.place("chip"),
            'no pauses without pulses, and no end = "release"',
        )
    jobs = []
    for folder, chip in zip(PAIR_FOLDERS, job.chips, strict=True):
        jobs.append(
            replace(
                job,
                name=f"{job.name}-{folder}",
                chips=(),
                servos=tuple(servo for servo in job.servos if servo.name in chip.servos),
                bindings=tuple(binding for binding in job.bindings if binding.servo in chip.servos),
                trajectory=motion_part(job.trajectory, chip.servos),
                inputs=(chip.wire,),
                followers=(),
                # Of the whole robot: no chip moves it alone.
                robot=None,
                tip=None,
                section=None,
                sensors=(),
                poses=(),
                parts=(),
                warnings=(),
                notes=(),
            )
        )
    first, second = jobs
    return first, second


def nearest_pulses(job: PlannedJob) -> tuple[PlannedJob, PulsePlan]:
    """Return the job and its pulses without building it, rounded to the nearest whole cycles.

    If these pulses do not fit a frame, return both as the job's engine makes them. Raises InputError
    or ResourceError.
    """
    try:
        return job, nearest(job.trajectory, job.servos, job.frame)
    except InputError:
        played = planned(job)
        return played.job, played.plan


def with_end_error(job: PlannedJob, plan: PulsePlan) -> PulsePlan:
    """Return the plan with its error also at the foot, tool or base that the job's servos move."""
    error = plan.schedule.plan_error
    ends = end_errors(end_tracks(job, plan.schedule))
    if error is None or not ends:
        return plan
    worst = largest_error(ends)
    end = worst.name if worst.name == worst.kind else f"{worst.kind} {worst.name}"
    error = replace(error, end=end, end_mm=round(1000 * worst.worst_m, DECIMALS))
    return replace(plan, schedule=replace(plan.schedule, plan_error=error))


def _choose_engine(job: PlannedJob) -> PlayedJob:
    names = _suitable(job)
    if len(names) == 1:
        return _plan_with(names[0], job)
    refused: list[InputError | ResourceError] = []
    for name in names:
        try:
            played = _plan_with(name, job)
            played.make(job.firmware.dialect)
        except (InputError, ResourceError) as error:
            refused.append(error)
            continue
        return played if not refused else _with_reason(played, refused[0])
    smallest, largest = refused[0], refused[-1]
    if not isinstance(smallest, ResourceError):
        raise smallest
    title = engine_named(names[-1]).title
    message = f"{smallest.message}; nor can {title}: {largest.message}"
    if all(error.code == "beyond-max-error" for error in refused):
        raise ResourceError("beyond-max-error", message, hint=largest.hint)
    raise ResourceError("does-not-fit", message, hint=largest.hint)


BENT_US = 2.0
"""A calibration whose points are farther than this off a straight line is named where the pulses miss."""


def _bend_text(job: PlannedJob) -> str:
    """Return the servo whose calibration is least straight, in words: an engine that stores a motion once for
    several servos follows straight ones only; empty if all are straight.
    """
    worst = max(job.servos, key=lambda servo: servo.calibration.bend_us)
    if worst.calibration.bend_us <= BENT_US:
        return ""
    bend = f"{worst.calibration.bend_us:.1f} µs off a straight line"
    return f"; the calibration of {worst.name} is bent: a point is {bend}, which costs accuracy"


def _with_reason(played: PlayedJob, refused: InputError | ResourceError) -> PlayedJob:
    """Return the job with a note why not the smallest engine plays it, whose C is the easiest to read, and at
    which price.
    """
    title = engine_named(played.engine).title
    lines = played.make(played.job.firmware.dialect).text.count("\n")
    price = f"{lines} lines of C, and pulses within {played.plan.schedule.plan_error_us:g} µs of the plan"
    why = refused.message.removeprefix(f"{played.job.name}: ")
    text = f"{title} plays this motion: {why}; its price: {price}"
    note = Diagnostic("note", "engine-chosen", text, played.job.document.place("firmware", "engine"))
    return replace(played, job=replace(played.job, notes=(*played.job.notes, note)))


def _suitable(job: PlannedJob) -> Sequence[str]:
    """Return the engine that the job names, or all engines that read its serial line and its buttons."""
    if job.firmware.engine != "auto":
        return (job.firmware.engine,)
    return suitable({each.kind for each in job.inputs})


def _plan_with(name: str, job: PlannedJob) -> PlayedJob:
    played = engine_named(name).plan(job)
    error, limit = played.plan.schedule.plan_error, job.firmware.max_error_us
    if error is not None and error.width_us > limit:
        raise ResourceError(
            "beyond-max-error",
            f"{job.name}: planned, but the pulses of {engine_named(name).title} would be up to "
            f"{error.text()} from the plan: max_error_us allows {limit:g} µs{_bend_text(job)}",
            job.document.place("firmware", "max_error_us"),
        )
    motion = replace(job, trajectory=played.trajectory, notes=(*job.notes, *played.notes))
    return PlayedJob(
        job=motion,
        engine=name,
        plan=played.plan,
        make=played.make,
        data_bytes=played.data_bytes,
        tour=played.tour,
    )
