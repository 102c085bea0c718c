"""`servogen plan`: the motion of a job before its firmware."""

from __future__ import annotations

import re
import sys
from math import degrees
from pathlib import Path
from typing import Annotated, TextIO

from servogen.cli.options import Animate, Csv, JobFile, Json, Plot
from servogen.cli.show import as_json, next_step, print_lines, status, table, warn_of_all
from servogen.errors import ServogenError
from servogen.job import Job, PlannedJob, load, plan_job
from servogen.outputs import atomic_write, write_text
from servogen.report.film import film, job_scene
from servogen.report.motion_plot import motion_plot
from servogen.report.motion_table import frame_lines
from servogen.report.plan_facts import PlanFacts, ServoFacts, plan_facts
from servogen.report.tracks import ERROR_COLUMNS, error_rows
from servogen.units import counted
from servogen.workflows.engines import nearest_pulses
from servogen.workflows.horns import Horn, centre_horns, edits, job_horns, rewritten, with_horn_advice


def plan(
    job: JobFile,
    picture: Plot = None,
    csv: Csv = None,
    animate: Animate = None,
    fit: Annotated[bool, "Write into the job where its horns centre the motion; comments stay."] = False,
    json: Json = False,
) -> None:
    """Show a job's motion without building it: frames, servos, horns, paths, pulse errors."""
    with status("planning"):
        asked = _plan_with_horns(load(job), job, fit, sys.stderr if json else sys.stdout)
        played, made = nearest_pulses(asked)
        facts = plan_facts(played, made, engine=played is not asked)
    loaded, pulses, tracks = facts.job, facts.plan, facts.tracks
    if csv:
        with atomic_write(csv) as file:
            file.writelines(f"{line}\n" for line in frame_lines(loaded, pulses.schedule, tracks))
    if picture:
        motion_plot(loaded, pulses.schedule, tracks, picture)
    if animate:
        with status(f"filming {animate}"):
            film(job_scene(loaded), animate)
    if json:
        horns = [horn.to_json() for horn in job_horns(asked)]
        as_json({**facts.to_json(), "horns": horns}, (*loaded.warnings, *pulses.warnings, *loaded.notes))
    else:
        _show_plan(facts, job_horns(asked))
        if csv or picture or animate:
            print(next_step("build", job))


def _plan_with_horns(loaded: Job, file: Path, fit: bool, out: TextIO) -> PlannedJob:
    """Return a job's plan; with `fit` that with centred horns, which is written into its file and told
    on `out`.

    Raises InputError, with the horns that would help where they are all that is in the way.
    """
    try:
        planned = plan_job(loaded)
    except ServogenError as error:
        horns, made = centre_horns(loaded)
        if not fit:
            raise with_horn_advice(error, horns) from None
    else:
        if not fit:
            return planned
        horns, made = centre_horns(loaded)
    values = edits(loaded, horns)
    if not values:
        print(f"{file}: every horn is on the tooth that centres the motion best", file=out)
        return made
    write_text(file, rewritten(file.read_text(encoding="utf-8"), values))
    worst = max(horns, key=lambda horn: abs(horn.away - horn.turn))
    print(
        f"{file}: {counted(sum(bool(horn.turn) for horn in horns), 'horn')} turned by whole teeth; "
        f"at most {abs(degrees(worst.away - worst.turn)):.1f}° from the middle, {worst.servo}",
        file=out,
    )
    return made


def _show_horns(horns: tuple[Horn, ...]) -> None:
    """Print which part of its travel each servo's motion uses, and on which tooth it is centred best."""
    rows = [
        (
            horn.servo,
            f"{degrees(horn.whole[0]):z.4g} to {degrees(horn.whole[1]):z.4g}°",
            f"{degrees(horn.used[0]):z.1f} to {degrees(horn.used[1]):z.1f}°",
            f"{degrees(horn.zero):z.4g}",
            f"{degrees(horn.zero + horn.turn):z.4g}" if horn.steps else "as it is",
            f"{horn.steps:+d} of {horn.teeth}" if horn.steps else "",
            "" if horn.fixed else f"{abs(degrees(horn.away - horn.turn)):.1f}",
        )
        for horn in horns
    ]
    if rows:
        table(
            "Horns",
            ("servo", "travel", "used", "zero_deg", "centred", "teeth", "off °"),
            rows,
            least=["travel"],
        )


def _show_plan(facts: PlanFacts, horns: tuple[Horn, ...]) -> None:
    job, schedule = facts.job, facts.plan.schedule
    _show_servos(job, facts.servos)
    _show_horns(horns)
    if facts.ends:
        _show_ends(facts)
    print_lines(note.message for note in job.notes)
    if facts.rigid_legs_end is not None:
        x, y, yaw = facts.rigid_legs_end
        moved = f"{1000 * x:z.1f} mm forward, {1000 * y:z.1f} mm to the left"
        each = " in each loop" if schedule.loop_frames > 1 else ""
        print_lines([f"rigid legs take the body {moved} and turn it by {degrees(yaw):z.1f}°{each}"])
    if facts.worst is not None:
        worst = facts.worst
        print(
            f"{_of_what(facts)}: at worst {1000 * worst.worst_m:z.3f} mm, "
            f"{worst.name} in frame {worst.frame} ({facts.seconds(worst.frame):.6g} s)"
        )
        if not facts.engine:
            print_lines(["how far the engine's schedule is from the plan, which may be more: servogen check"])
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
    joints |= {each.name: joints.get(each.leader, "") for each in job.followers}
    rows = []
    for row in facts:
        model, unit = row.servo.model, row.servo.model.unit
        rows.append(
            (
                row.servo.name,
                joints.get(row.servo.name, ""),
                f"{degrees(row.minimum):z.2f} to {degrees(row.maximum):z.2f}{unit}",
                " to ".join(f"{degrees(limit):zg}" for limit in row.servo.limits) + unit,
                _degrees(row.speed),
                _degrees(model.speed),
                "" if row.speed_frame is None else row.speed_frame,
                _degrees(row.step),
                _number(row.step_needs_s),
                _number(row.step_s),
            )
        )
    columns = (
        *("servo", "joint", "range", "limits", "peak °/s", "limit °/s", "at frame"),
        *("step °", "needs s", "has s"),
    )
    said = [index for index in range(len(columns)) if any(row[index] != "" for row in rows)]
    cells = [tuple(row[index] for index in said) for row in rows]
    least = [name for name in ("joint", "at frame") if columns.index(name) in said]
    table("Servos", tuple(columns[index] for index in said), cells, least=least)


def _show_ends(facts: PlanFacts) -> None:
    rows = []
    for end in facts.ends:
        spans = (f"{_mm(low)} to {_mm(high)}" for low, high in zip(*facts.extent(end), strict=True))
        rows.append((end.name, *spans))
    table("Paths", ("end", "x mm", "y mm", "z mm"), rows)
    columns = [re.sub(r"_(mm|s)$", r" \1", column).replace("_", " ") for column in ERROR_COLUMNS]
    title = _of_what(facts)
    least = [column for column in columns if column.startswith("jacobian")]
    rows_of_ends = list(error_rows(facts.ends, facts.seconds(1)))
    table(title[0].upper() + title[1:], columns, rows_of_ends, least=least)


def _of_what(facts: PlanFacts) -> str:
    """Return which error the facts tell: that of rounding alone, or that of what is built."""
    return "error of the engine's schedule" if facts.engine else "error of rounding to whole cycles"


def _degrees(value: float | None) -> str:
    return "" if value is None else f"{degrees(value):z.1f}"


def _mm(metres: float) -> str:
    return f"{1000 * metres:z.2f}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:z.3f}"
