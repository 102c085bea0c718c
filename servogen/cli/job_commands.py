"""Commands of job files: new, check, build, demo."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json
from servogen.cli.show import as_json, status, table, warn_of_all
from servogen.errors import Diagnostic
from servogen.units import counted

if TYPE_CHECKING:
    from servogen.build.build import Build
    from servogen.pulse import Quantised

LEAST_FOLDED = 3
"""Rows of a table that are worth a row of their own."""

JobFile = Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)]


def register(app: typer.Typer) -> None:
    app.command()(new)
    app.command()(check)
    app.command()(build)
    app.command()(demo)


def new(
    file: Annotated[Path, typer.Argument(help="The job file to write.")] = Path("job.toml"),
    force: Annotated[bool, typer.Option("--force", help="Write over a file that exists.")] = False,
) -> None:
    """Write a commented job file to start from."""
    from servogen.errors import InputError, Location
    from servogen.job import template
    from servogen.outputs import write_text

    if file.exists() and not force:
        raise InputError(
            "output-exists", "exists already", Location(str(file)), "give another name, or --force"
        )
    write_text(file, template())
    print(f"{file}: change it to your robot, then: servogen build {file}")


def check(job: JobFile, json: Json = False) -> None:
    """Read a job file and say what its pulses will be, without building it."""
    from servogen.build import planned as planned_job
    from servogen.job import load, plan_job
    from servogen.plan_error import plan_words

    loaded = plan_job(load(job))
    with status(f"{loaded.name}: planning"):
        found = planned_job(loaded)
    planned = found.plan
    schedule = planned.schedule
    warnings = (*loaded.warnings, *planned.warnings)
    if json:
        as_json(found.to_json(), (*warnings, *loaded.notes))
        return
    _width_table(planned.widths)
    for note in loaded.notes:
        print(note.message)
    seconds = float(schedule.clock.seconds(schedule.loop_frames * schedule.period))
    loop = f"loop of {counted(schedule.loop_frames, 'frame')}, {seconds:g} s"
    print(f"{job}: {counted(len(loaded.servos), 'servo')}, {loop}; {plan_words(schedule.plan_error)}")
    warn_of_all(warnings)


def build(
    job: JobFile,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The folder (default: the job's name, in build/)."),
    ] = None,
    json: Json = False,
) -> None:
    """Make a job's firmware in every dialect and prove every pulse edge of it."""
    from servogen.build import build as built
    from servogen.build import write
    from servogen.build.build import program_facts
    from servogen.job import load, plan_job
    from servogen.plan_error import plan_words
    from servogen.report import timing_budgets_text

    loaded = plan_job(load(job))
    folder = output or Path("build") / loaded.name
    with status(f"{loaded.name}: planning") as tell:
        done = built(loaded, lambda step: tell(f"{loaded.name}: {step}"))
        write(done, folder)
    if json:
        as_json(_json(done, folder), done.warnings)
    else:
        _width_table(done.plan.widths)
        _program_table([done])
        print("\n".join(timing_budgets_text(program_facts(done), done.job.clock)))
        plan = plan_words(done.plan.schedule.plan_error)
        print(f"{folder}: {'proven' if done.proven else 'NOT PROVEN'}; {plan}; all of it in report.txt")
    warn_of_all(done.warnings)
    raise typer.Exit(0 if done.proven else 1)


def demo(
    jobs: Annotated[list[Path], typer.Argument(help="Job files.", show_default=False)],
    output: Annotated[Path, typer.Option("--output", "-o", help="The folder of the jobs' folders.")] = Path(
        "build"
    ),
    json: Json = False,
) -> None:
    """Build and prove several jobs, each into its own folder, and print one table."""
    from servogen.build import ResourceError, write
    from servogen.build import build as built
    from servogen.job import load, plan_job

    done: list[Build] = []
    refused: list[Diagnostic] = []
    with status("reading") as tell:
        for loaded in [plan_job(load(job)) for job in jobs]:

            def progress(step: str, name: str = loaded.name) -> None:
                tell(f"{name}: {step}")

            try:
                done.append(built(loaded, progress))
            except ResourceError as error:
                refused.append(error.first)
                continue
            write(done[-1], output / loaded.name)
    if json:
        found = [warning for each in done for warning in each.warnings]
        as_json({"jobs": [_json(each, output / each.job.name) for each in done]}, (*found, *refused))
    else:
        _program_table(done)
        for refusal in refused:
            print(refusal.message)
        for each in done:
            if each.warnings:
                print(f"{each.job.name}: {counted(len(each.warnings), 'warning')} in its report.txt")
    raise typer.Exit(0 if all(each.proven for each in done) else 1)


def _width_table(widths: Sequence[Quantised]) -> None:
    """Print one row for each width, and one for each ramp."""
    examples = any(row.which for row in widths)
    table(
        "Pulse widths",
        ("servo", *(["pulse"] if examples else []), "requested µs", "cycles", "error µs", "frames"),
        [_width_cells(rows, examples) for rows in _folded(widths)],
    )


def _folded(widths: Sequence[Quantised]) -> Iterator[list[Quantised]]:
    """Yield the rows, those of neighbouring widths that no pose holds together: they are a ramp's."""
    for (_, held), group in groupby(widths, key=lambda row: (row.channel, row.held)):
        rows = list(group)
        if held or len(rows) < LEAST_FOLDED:
            yield from ([row] for row in rows)
        else:
            yield rows


def _width_cells(rows: list[Quantised], examples: bool) -> tuple[object, ...]:
    first, last = rows[0], rows[-1]
    if len(rows) == 1:
        which = [first.which] if examples else []
        error = f"{float(first.error_us):+z.3f}"
        return (first.channel, *which, f"{float(first.requested_us):z.3f}", first.cycles, error, first.frames)
    errors = [float(row.error_us) for row in rows]
    return (
        f"{first.channel}, {len(rows)} widths of ramps",
        *([""] if examples else []),
        f"{float(first.requested_us):z.3f} to {float(last.requested_us):z.3f}",
        f"{first.cycles} to {last.cycles}",
        f"{min(errors):+z.3f} to {max(errors):+z.3f}",
        sum(row.frames for row in rows),
    )


def _program_table(builds: list[Build]) -> None:
    from servogen.pic.device import PROGRAM_WORDS, RAM_BYTES

    table(
        "Programs",
        (
            *("job", "engine", "dialect", "words", "left", "RAM", "left", "frames"),
            *("worst edge error", "from the plan", "verdict"),
        ),
        [
            (
                done.job.name,
                done.engine,
                program.firmware.dialect,
                program.firmware.compilation.words,
                PROGRAM_WORDS - program.firmware.compilation.words,
                program.firmware.compilation.ram_bytes,
                RAM_BYTES - program.firmware.compilation.ram_bytes,
                done.frames,
                f"{program.verdict.worst_edge_error} cycles",
                "?" if program.verdict.plan_error is None else program.verdict.plan_error.text(),
                "proven" if program.proven else "NOT PROVEN",
            )
            for done in builds
            for program in done.programs
        ],
    )


def _json(done: Build, folder: Path) -> dict[str, object]:
    return {"folder": str(folder), **done.to_json()}
