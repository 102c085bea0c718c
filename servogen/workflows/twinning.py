"""From a job to its twin: the program, compiled or from a file, in a simulated robot.

In: a planned job, settings. Out: `TwinVerdict`.
"""

from __future__ import annotations

from pathlib import Path

from servogen.errors import InputError
from servogen.job import PlannedJob
from servogen.pic.image import Image
from servogen.programs import read_program
from servogen.pulse import PulseSchedule
from servogen.simulator import Stimuli
from servogen.twin import TwinSettings, TwinVerdict, planned_of, simulate, verdict_of
from servogen.workflows.engines import PlayedJob, planned
from servogen.workflows.job_build import Build, Progress
from servogen.workflows.pair import planned_pair, read_job_pair


def twin_of(
    job: PlannedJob,
    settings: TwinSettings = TwinSettings(),  # noqa: B008 - frozen
    program: Path | None = None,
    stimuli: Stimuli | None = None,
    progress: Progress = lambda step: None,
) -> TwinVerdict:
    """Return what the robot does with the job's own program, or with the one in a file. Raises InputError."""
    if job.chips:
        return _twin_of_pair(job, settings, program, stimuli, progress)
    played = planned(job)
    progress("compiling")
    image = _image(played, program)
    progress("moving")
    return twin_of_image(job, played.job, played.plan.schedule, image, settings, stimuli)


def _twin_of_pair(
    job: PlannedJob,
    settings: TwinSettings,
    folder: Path | None,
    stimuli: Stimuli | None,
    progress: Progress,
) -> TwinVerdict:
    """Return what the robot does with the programs of both chips, or with those in the folder of a build."""
    if stimuli is not None:
        message = "two chips read nothing that --stimulus could change"
        raise InputError("chip-pair", message, job.document.place("chip"))
    given = None if folder is None else read_job_pair(job, folder)[1]
    pair = planned_pair(job)
    progress("compiling")
    images = given or pair.images()
    progress("moving")
    schedules, played = pair.schedules, pair.job
    lead_in = played.trajectory.loop_start - job.trajectory.loop_start
    record = simulate(played, schedules[0], images[0], lead_in, settings, second=(schedules[1], images[1]))
    return verdict_of(record, job, planned_of(played, lead_in, settings.loops))


def twin_of_build(job: PlannedJob, result: Build) -> TwinVerdict:
    """Return what the robot does with the job's own program of a build."""
    return twin_of_image(job, result.job, result.plan.schedule, result.programs[0].image)


def twin_of_image(
    job: PlannedJob,
    played: PlannedJob,
    schedule: PulseSchedule,
    image: Image,
    settings: TwinSettings = TwinSettings(),  # noqa: B008 - frozen
    stimuli: Stimuli | None = None,
) -> TwinVerdict:
    """Return what the robot does with an image; `played` is the job as its engine plays it."""
    lead_in = played.trajectory.loop_start - job.trajectory.loop_start
    record = simulate(played, schedule, image, lead_in, settings, stimuli)
    return verdict_of(record, job, planned_of(played, lead_in, settings.loops))


def _image(played: PlayedJob, program: Path | None) -> Image:
    if program is not None:
        return read_program(program, played.job.device.name).image
    return played.make(played.job.firmware.dialect).compilation.image
