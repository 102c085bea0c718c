"""Commands of job files: new, check."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.options import JobFile, Json
from servogen.cli.show import as_json, print_lines, status, warn_of_all
from servogen.cli.widths import width_table
from servogen.errors import InputError, Location
from servogen.job import KINDS, PlannedJob, kind_of, load, plan_job, starter, usual_servo
from servogen.outputs import write_text
from servogen.plan_error import plan_text
from servogen.units import counted
from servogen.workflows.engines import PlayedJob
from servogen.workflows.engines import planned as planned_job


def new(
    file: Annotated[Path, typer.Argument(help="The job file to write.")] = Path("job.toml"),
    robot: Annotated[
        str | None, f"The kind of robot: {', '.join(KINDS[:-1])}, {KINDS[-1]}, or a legged robot's file."
    ] = None,
    servo: Annotated[str | None, "The servo of every joint: a model, such as sg90, or a servo file."] = None,
    force: Annotated[bool, "Overwrite an existing file."] = False,
) -> None:
    """Write a commented job file to start from (without --robot: one servo; on a terminal it asks)."""
    if file.exists() and not force:
        raise InputError(
            "output-exists", "exists already", Location(str(file)), "give another name, or --force"
        )
    asks = robot is None and sys.stdin.isatty() and sys.stdout.isatty()
    if asks:
        robot = typer.prompt(f"robot ({', '.join(KINDS)})", default=KINDS[0])
    robot = robot or KINDS[0]
    if servo is None:
        servo = usual_servo(kind_of(robot))
        servo = typer.prompt("servo (a model, or a servo file)", default=servo) if asks else servo
    with status(f"{file}: planning"):
        text = starter(robot, servo, file)
    write_text(file, text)
    print(f"{file}: a job for your robot; its comments say what to change. Next:")
    print(f"  servogen check {file}\n  servogen watch {file}")


def check(job: JobFile, json: Json = False) -> None:
    """Check a job file and show its pulses, without building it."""
    loaded = plan_job(load(job))
    with status(f"{loaded.name}: planning"):
        programs = _planned_chips(loaded) if loaded.chips else (planned_job(loaded),)
    schedules = [each.plan.schedule for each in programs]
    warnings = (*loaded.warnings, *(warning for each in programs for warning in each.plan.warnings))
    notes = [note for each in programs for note in each.job.notes]
    if json:
        facts = [each.to_json() for each in programs]
        as_json(facts[0] if len(facts) == 1 else {"job": loaded.name, "chips": facts}, (*warnings, *notes))
        return
    width_table([row for each in programs for row in each.plan.widths])
    print_lines(note.message for note in notes)
    seconds = float(schedules[0].clock.seconds(schedules[0].loop_frames * schedules[0].period))
    loop = f"loop of {counted(schedules[0].loop_frames, 'frame')}, {seconds:g} s"
    errors = dict.fromkeys(plan_text(schedule.plan_error) for schedule in schedules)
    print_lines([f"{job}: {counted(len(loaded.servos), 'servo')}, {loop}; {'; '.join(errors)}"])
    warn_of_all(warnings)


def _planned_chips(job: PlannedJob) -> tuple[PlayedJob, ...]:
    from servogen.workflows.pair import planned_pair  # it runs both programs: the simulator and the compiler

    return planned_pair(job).chips
