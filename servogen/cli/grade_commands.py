"""`servogen grade`: programs of students held against a lab's task."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.files import PROGRAM_SUFFIXES, read_program
from servogen.cli.options import Json
from servogen.cli.show import as_json, progress, table, warn
from servogen.errors import InputError, Place

if TYPE_CHECKING:
    from servogen.grade import Lab
    from servogen.pipeline.grading import Graded

PROGRAMS = tuple(suffix for suffix in PROGRAM_SUFFIXES if suffix != ".obj")
"""What counts as a program in a folder: other tools write .obj files that are none."""


def register(app: typer.Typer) -> None:
    app.command()(grade)


def grade(
    lab: Annotated[
        str,
        typer.Argument(help="lab8-exercise, lab9-exercise, or a lab's own .toml file.", show_default=False),
    ],
    files: Annotated[
        list[Path],
        typer.Argument(help="HEX, C or assembly files, or folders of them.", show_default=False),
    ],
    pages: Annotated[
        Path | None, typer.Option("--pages", help="Write a page (Markdown) for each program to this folder.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="A Dask scheduler's address; default: this machine's cores."),
    ] = None,
    timeout: Annotated[
        float,
        typer.Option("--timeout", min=0.1, help="Seconds that compiling and running one file may take."),
    ] = 120.0,
    json: Json = False,
) -> None:
    """Check programs against a lab's task and say what is wrong with each."""
    from servogen.grade import load_lab
    from servogen.pipeline.grading import grade_files

    task = load_lab(lab)
    programs = dict(_programs(files))
    with progress(task.title, len(programs)) as tell:
        graded = grade_files(list(programs.values()), lab, read_program, scheduler, tell, timeout)
    named = list(zip(programs, graded, strict=True))
    if pages:
        _write_pages(pages, task, named)
    if json:
        as_json({"lab": task.name, "title": task.title, "task": task.task, "programs": _rows(named)})
    else:
        _show(task, named)
    if any(each.defect for each in graded):
        raise typer.Exit(3)
    raise typer.Exit(0 if all(each.grade.passed for each in graded) else 1)


def _programs(files: list[Path]) -> list[tuple[str, Path]]:
    """(name on the page, file); names are the paths below a given folder, without what is the same twice."""
    found: list[tuple[str, Path]] = []
    for each in files:
        if each.is_dir():
            inside = sorted(
                path for path in each.rglob("*") if path.suffix.lower() in PROGRAMS and path.is_file()
            )
            if not inside:
                raise InputError(f"holds no program ({', '.join(PROGRAMS)})", Place(str(each)))
            found += [(path.relative_to(each).as_posix(), path) for path in _sources_first(inside)]
        else:
            found.append((each.name, each))
    names = [name for name, _ in found]
    return [(name if names.count(name) == 1 else path.as_posix(), path) for name, path in found]


def _sources_first(files: list[Path]) -> list[Path]:
    """Without a HEX file that stands beside a source of the same name: it is what the source became."""
    sources = {path.with_suffix("") for path in files if path.suffix.lower() not in (".hex", ".ihx", ".h8")}
    kept = []
    for path in files:
        if path.with_suffix("") in sources and path.suffix.lower() in (".hex", ".ihx", ".h8"):
            warn(f"{path}: not graded, as its source stands beside it")
        else:
            kept.append(path)
    return kept


def _write_pages(folder: Path, lab: Lab, graded: list[tuple[str, Graded]]) -> None:
    from servogen.grade import page
    from servogen.outputs import write_text

    folder.mkdir(parents=True, exist_ok=True)
    for name, each in graded:
        write_text(folder / f"{name.strip('/').replace('/', '-')}.md", page(lab, name, each.grade))


def _rows(graded: list[tuple[str, Graded]]) -> list[dict[str, object]]:
    return [{"program": name, "file": str(each.file), **each.grade.to_json()} for name, each in graded]


def _show(lab: Lab, graded: list[tuple[str, Graded]]) -> None:
    rows = []
    for name, each in graded:
        says = each.grade.reasons or each.grade.remarks
        text = "\n".join(" ".join(line.strip() for line in one.splitlines()[:2]) for one in says)
        rows.append((name, "passed" if each.grade.passed else "NOT PASSED", text))
    table(f"{lab.title}: {lab.task}", ("program", "verdict", "why, or what is good to know"), rows)
    passed = sum(each.grade.passed for _, each in graded)
    print(f"{passed} of {len(graded)} passed")
