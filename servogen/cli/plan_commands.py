"""Commands of planned motion: plan."""

from __future__ import annotations

import re
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json
from servogen.cli.show import as_json, status, table, warn_of_all
from servogen.units import counted

if TYPE_CHECKING:
    from servogen.job import PlannedJob
    from servogen.report.plan_facts import PlanFacts
    from servogen.report.servo_facts import ServoFacts

Plot = Annotated[Path | None, typer.Option("--plot", help="Draw it: .png, .svg or .pdf.")]
Animate = Annotated[Path | None, typer.Option("--animate", help="Film the robot: .gif or .mp4 (ffmpeg).")]
Csv = Annotated[Path | None, typer.Option("--csv", help="Write one row per frame.")]


def register(app: typer.Typer) -> None:
    app.command()(plan)


def plan(
    job: Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)],
    picture: Plot = None,
    csv: Csv = None,
    animate: Animate = None,
    json: Json = False,
) -> None:
    """Show what a job will do, without building it: frames, servos, paths, pulse errors."""
    from servogen.build import nearest_pulses
    from servogen.job import load, plan_job
    from servogen.outputs import atomic_write
    from servogen.report.motion_table import frame_lines
    from servogen.report.plan_facts import plan_facts

    with status("planning"):
        facts = plan_facts(*nearest_pulses(plan_job(load(job))))
    loaded, made, tracks = facts.job, facts.plan, facts.tracks
    if csv:
        with atomic_write(csv) as file:
            file.writelines(f"{line}\n" for line in frame_lines(loaded, made.schedule, tracks))
    if picture:
        from servogen.report.motion_plot import motion_plot

        motion_plot(loaded, made.schedule, tracks, picture)
    if animate:
        from servogen.report.film import film
        from servogen.report.scenes import job_scene

        with status(f"filming {animate}"):
            film(job_scene(loaded), animate)
    if json:
        as_json(facts.to_json(), (*loaded.warnings, *made.warnings, *loaded.notes))
    else:
        _show_plan(facts)


def _show_plan(facts: PlanFacts) -> None:
    job, schedule = facts.job, facts.plan.schedule
    _show_servos(job, facts.servos)
    if facts.ends:
        _show_ends(facts)
    for note in job.notes:
        print(note.message)
    if facts.worst is not None:
        worst = facts.worst
        print(
            f"error of the pulses: at worst {1000 * worst.worst_m:z.3f} mm, "
            f"{worst.name} in frame {worst.frame} ({facts.seconds(worst.frame):.6g} s)"
        )
    parts = [("lead-in", schedule.lead_in_frames), ("loop", schedule.loop_frames)]
    text = ", ".join(
        f"{name} of {counted(frames, 'frame')}, {facts.seconds(frames):g} s"
        for name, frames in parts
        if frames
    )
    print(f"{job.file}: {counted(len(job.servos), 'servo')}, {text}")
    warn_of_all((*job.warnings, *facts.plan.warnings))


def _show_servos(job: PlannedJob, facts: tuple[ServoFacts, ...]) -> None:
    joints = {binding.servo: binding.joint for binding in job.bindings}
    rows = []
    for each in facts:
        model, unit = each.servo.model, each.servo.model.unit
        rows.append(
            (
                each.servo.name,
                joints.get(each.servo.name, ""),
                f"{degrees(each.least):z.2f} to {degrees(each.greatest):z.2f}{unit}",
                " to ".join(f"{degrees(limit):zg}" for limit in each.servo.limits) + unit,
                _degrees(each.speed),
                _degrees(model.speed),
                "" if each.speed_frame is None else each.speed_frame,
                _degrees(each.step),
                _number(each.step_needs_s),
                _number(each.step_s),
            )
        )
    table(
        "Servos",
        (
            "servo",
            "joint",
            "range",
            "limits",
            "peak °/s",
            "limit °/s",
            "at frame",
            "step °",
            "needs s",
            "has s",
        ),
        rows,
    )


def _show_ends(facts: PlanFacts) -> None:
    from servogen.report.tool_error import ERROR_COLUMNS, error_rows

    rows = []
    for each in facts.ends:
        spans = (f"{_mm(low)} to {_mm(high)}" for low, high in zip(*facts.extent(each), strict=True))
        rows.append((each.name, *spans))
    table("Paths", ("end", "x mm", "y mm", "z mm"), rows)
    columns = [re.sub(r"_(mm|s)$", r" \1", column).replace("_", " ") for column in ERROR_COLUMNS]
    table("Error of the pulses", columns, list(error_rows(facts.ends, facts.seconds(1))))


def _degrees(value: float | None) -> str:
    return "" if value is None else f"{degrees(value):z.1f}"


def _mm(metres: float) -> str:
    return f"{1000 * metres:z.2f}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:z.3f}"
