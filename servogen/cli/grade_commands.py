"""`servogen grade`: programs of students held against a lab's task."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json, MemoryLimit
from servogen.cli.show import as_json, progress, table, warn
from servogen.errors import Diagnostic, Location, ServogenError
from servogen.isolation import COMPILING, missing_limits
from servogen.programs import HEX_SUFFIXES, PROGRAM_SUFFIXES, read_submission

if TYPE_CHECKING:
    from collections.abc import Sequence

    from servogen.build.grading import Graded
    from servogen.grade import Lab

IMAGES = tuple(suffix for suffix in HEX_SUFFIXES if suffix != ".obj")
"""What counts as a HEX file in a folder: other tools write .obj files that are not."""

SOURCES = tuple(suffix for suffix in PROGRAM_SUFFIXES if suffix not in HEX_SUFFIXES)


def register(app: typer.Typer) -> None:
    app.command()(grade)


def grade(
    lab: Annotated[
        str,
        typer.Argument(help="lab8-exercise, lab9-exercise or a lab of your own (.toml).", show_default=False),
    ],
    files: Annotated[
        list[Path],
        typer.Argument(help="HEX, C or assembly files, or folders of them.", show_default=False),
    ],
    pages: Annotated[
        Path | None, typer.Option("--pages", help="Write a Markdown page for each program to this folder.")
    ] = None,
    level: Annotated[
        int,
        typer.Option(
            "--level",
            min=0,
            max=8,
            help="How many levels below a given folder the students' own folders are; a program may only "
            "include files of its own student.",
        ),
    ] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", help="The address of a Dask scheduler (default: use this machine's cores)."
        ),
    ] = None,
    timeout: Annotated[
        float,
        typer.Option(
            "--timeout",
            min=0.1,
            help="Processor seconds for running one program; compiling it is limited to "
            f"{COMPILING.seconds:g}.",
        ),
    ] = 120.0,
    memory_mb: MemoryLimit = COMPILING.memory_mb,
    json: Json = False,
) -> None:
    """Check programs against a lab's task and report what is wrong with each."""
    from servogen.build.grading import Task, grade_submissions
    from servogen.grade import find_submissions, load_lab, page_names, visible

    task = Task.of(load_lab(lab), read_submission, timeout, memory_mb)
    if sentence := missing_limits():
        warn(Diagnostic("warning", "no-limits", sentence))
    found = find_submissions(files, SOURCES, IMAGES, level)
    for warning in found.warnings:
        warn(
            replace(
                warning,
                location=Location(visible(warning.location.file))
                if warning.location and warning.location.file
                else None,
            )
        )
    with progress(task.lab.title, len(found.submissions)) as tell:
        graded = grade_submissions(found.submissions, task, scheduler, tell)
    names = page_names([each.submission.name for each in graded]) if pages else []
    failure = _write_pages(pages, names, task.lab, graded) if pages else None
    if json:
        what = {"lab": task.lab.name, "title": task.lab.title, "task": task.lab.task}
        as_json({**what, "programs": _rows(graded, names)})
    else:
        _show(task.lab, graded)
    if failure:
        raise failure
    if any(each.defect for each in graded):
        raise typer.Exit(3)
    raise typer.Exit(0 if all(each.grade.passed for each in graded) else 1)


def _write_pages(
    folder: Path, names: Sequence[str], lab: Lab, graded: Sequence[Graded]
) -> ServogenError | None:
    """Write each page that can be written; return the error of the first one that could not."""
    from servogen.build.films import class_page, film_name, film_page, watch_command
    from servogen.grade import page
    from servogen.outputs import make_folder, write_text

    make_folder(folder)
    failure = None
    texts: dict[str, Callable[[], str]] = {"index.html": lambda: class_page(lab, names, graded)}
    for name, each in zip(names, graded, strict=True):
        student, grade = each.submission.name, each.grade
        film = film_name(name) if grade.film else ""
        command = watch_command(lab, each.submission, grade) if film else ""
        texts[name] = partial(page, lab, student, grade, film, command)
        if film:
            texts[film] = partial(film_page, lab, each.submission, grade)
    for name, text in texts.items():
        target = folder / name
        if target.is_symlink():  # a link that a student has left must not lead the page elsewhere
            target.unlink()
        try:
            write_text(target, text())
        except ServogenError as error:
            failure = failure or error
    return failure


def _rows(graded: Sequence[Graded], pages: Sequence[str]) -> list[dict[str, object]]:
    from servogen.grade import shown_name

    rows: list[dict[str, object]] = [
        {
            "program": shown_name(each.submission.name),
            "file": shown_name(str(each.submission.file)),
            **each.grade.to_json(),
        }
        for each in graded
    ]
    for row, page in zip(rows, pages, strict=False):
        row["page"] = page
    return rows


def _show(lab: Lab, graded: Sequence[Graded]) -> None:
    from servogen.grade import shown_name

    rows = []
    for each in graded:
        says = each.grade.reasons or [remark.sentence for remark in each.grade.remarks]
        text = "\n".join(" ".join(line.strip() for line in one.splitlines()[:2]) for one in says)
        verdict = "passed" if each.grade.passed else "NOT PASSED"
        rows.append((shown_name(each.submission.name), verdict, text))
    table(f"{lab.title}: {lab.task}", ("program", "verdict", "why, or what is good to know"), rows)
    passed = sum(each.grade.passed for each in graded)
    print(f"{passed} of {len(graded)} passed")
