"""`servogen grade`: compares students' programs with a lab's task."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.files import check_outputs
from servogen.cli.options import Json, MemoryLimit, OpensBrowser, ServerPort
from servogen.cli.page_server import require_server, serve_until_ctrl_c
from servogen.cli.show import as_json, progress, table, warn
from servogen.errors import Diagnostic, InputError, Location, ServogenError
from servogen.grade import (
    Lab,
    find_submissions,
    handout_html,
    handout_markdown,
    load_lab,
    page,
    page_names,
    shown_name,
    visible,
)
from servogen.grade.formats import (
    GradedProgram,
    classroom_json,
    classroom_without_program,
    csv_text,
    gradescope_json,
    gradescope_without_program,
    junit_xml,
)
from servogen.grade.points import max_total, number, outcomes, total
from servogen.grade.submissions import Submissions
from servogen.isolation import COMPILING, missing_limits
from servogen.outputs import make_folder, write_text
from servogen.programs import HEX_SUFFIXES, PROGRAM_SUFFIXES, read_submission
from servogen.workflows.films import class_page, film_name, film_page, watch_command
from servogen.workflows.grading import Graded, GradingTask, copies, grade_submissions

IMAGES = tuple(suffix for suffix in HEX_SUFFIXES if suffix != ".obj")
"""The suffixes of HEX files in a folder; without .obj, which other tools use for different files."""

SOURCES = tuple(suffix for suffix in PROGRAM_SUFFIXES if suffix not in HEX_SUFFIXES)


NO_PROGRAM = "no-program"


def handout(
    lab: Annotated[
        str,
        typer.Argument(help="lab8-exercise, lab9-exercise or a lab of your own (.toml).", show_default=False),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="A .md or .html file (default: Markdown to standard output)."),
    ] = None,
) -> None:
    """Write a lab's task sheet without its solution: wiring, servos, task, grading."""
    task = load_lab(lab)
    if output is None:
        print(handout_markdown(task), end="")
        return
    forms = {".md": handout_markdown, ".html": handout_html}
    if output.suffix not in forms:
        raise InputError(
            "not-allowed", "is neither .md nor .html", Location(str(output)), "name the file handout.html"
        )
    write_text(output, forms[output.suffix](task))
    print(f"{output}: the sheet for students. Next, with their programs: servogen grade {lab} FILES")


@dataclass(frozen=True, slots=True)
class GradeFiles:
    """The files for other programs; None: not requested."""

    csv: Annotated[Path | None, "Write a table with one row per program."] = None
    junit: Annotated[Path | None, "Write JUnit XML: a suite per program, a case per check."] = None
    gradescope: Annotated[
        Path | None,
        "Write Gradescope's results.json: for a single program to this file (.json), else "
        "one file per program to this folder.",
    ] = None
    classroom: Annotated[
        Path | None,
        "Write the results that GitHub Classroom's reporter reads: for a single program to "
        "this file (.json), else one file per program to this folder.",
    ] = None

    @property
    def paths(self) -> Sequence[Path | None]:
        return (self.csv, self.junit, self.gradescope, self.classroom)

    @property
    def wants_one(self) -> bool:
        """Return whether a file is wanted that holds one program."""
        return any(path is not None and path.suffix == ".json" for path in (self.gradescope, self.classroom))

    def write(self, lab: Lab, graded: Sequence[Graded]) -> None:
        """Write the requested files."""
        entries = [GradedProgram(result.submission.name, result.grade, result.defect) for result in graded]
        if self.csv:
            write_text(self.csv, csv_text(lab, entries))
        if self.junit:
            write_text(self.junit, junit_xml(lab, entries))
        for target, text in ((self.gradescope, gradescope_json), (self.classroom, classroom_json)):
            if target is not None and target.suffix != ".json":
                _write_each(target, entries, partial(text, lab))
            elif target is not None and len(entries) == 1:
                write_text(target, text(lab, entries[0]))
        if len(entries) != 1:
            self.write_without_program(lab, _several(graded))

    def write_without_program(self, lab: Lab, why: str) -> None:
        """Write the files of one submission that does not contain one program: no points, and the reason."""
        for target, text in (
            (self.gradescope, gradescope_without_program),
            (self.classroom, classroom_without_program),
        ):
            if target is not None and target.suffix == ".json":
                write_text(target, text(lab, why))


@dataclass(frozen=True, slots=True)
class GradeLimits:
    """How the programs are run."""

    level: Annotated[
        int,
        typer.Option(
            min=0,
            max=8,
            help="How many levels below a given folder the students' folders are; a program can "
            "include only its own student's files.",
        ),
    ] = 1
    scheduler: Annotated[
        str | None, "The address of a Dask scheduler (default: use this machine's cores)."
    ] = None
    timeout: Annotated[
        float,
        typer.Option(
            min=0.1,
            help="Processor seconds for running one program; compiling it is limited to "
            f"{COMPILING.seconds:g}.",
        ),
    ] = 120.0
    memory_mb: MemoryLimit = COMPILING.memory_mb


@dataclass(frozen=True, slots=True)
class Browsing:
    """The pages in the browser."""

    watch: Annotated[
        bool,
        "Afterwards serve the pages on this machine until Ctrl-C: a click opens a program "
        "in the browser at the moment that is wrong.",
    ] = False
    port: ServerPort = 0
    browser: OpensBrowser = True

    def check(self, json: bool) -> None:
        """Raise an error where the pages cannot be served as asked."""
        if self.watch:
            if json:
                raise InputError("conflicting-options", "--watch prints an address: without --json")
            require_server()
        elif self.port:
            raise InputError("conflicting-options", "--port is for --watch")


def grade(
    lab: Annotated[
        str,
        typer.Argument(help="lab8-exercise, lab9-exercise or a lab of your own (.toml).", show_default=False),
    ],
    files: Annotated[
        list[Path], typer.Argument(help="HEX, C or assembly files, or folders of them.", show_default=False)
    ],
    outputs: GradeFiles,
    work: GradeLimits,
    browsing: Browsing,
    pages: Annotated[Path | None, "Write a Markdown page for each program to this folder."] = None,
    json: Json = False,
) -> None:
    """Check programs against a lab's task and report what is wrong with each."""
    browsing.check(json)
    check_outputs([path for path in files if not path.is_dir()], *outputs.paths)
    task = GradingTask.of(load_lab(lab), read_submission, work.timeout, work.memory_mb)
    if sentence := missing_limits():
        warn(Diagnostic("warning", "no-limits", sentence))
    search = _search(files, work.level, task.lab, outputs)
    with progress(task.lab.title, len(search.submissions)) as tell:
        graded = grade_submissions(search.submissions, task, work.scheduler, tell)
    names = page_names([result.submission.name for result in graded]) if pages or browsing.watch else []
    failure = _write_pages(pages, names, task.lab, graded) if pages else None
    outputs.write(task.lab, graded)
    if json:
        task_of_lab = {"lab": task.lab.name, "title": task.lab.title, "task": task.lab.task}
        same = [list(group) for group in copies(graded)]
        as_json({**task_of_lab, "programs": _rows(task.lab, graded, names), "same_code": same})
    else:
        _show(task.lab, graded)
        for group in copies(graded):
            print(f"the same machine code: {', '.join(group)}")
        if pages and not browsing.watch:
            print(f"next: open {pages / 'index.html'}, or grade again with --watch")
        elif any(outputs.paths) and not browsing.watch:
            print("next: grade again with --pages FOLDER, a page for each student, or with --watch")
    if browsing.watch:
        _serve(task, names, graded, browsing)
    if failure:
        raise failure
    if outputs.wants_one and len(graded) > 1:
        raise InputError("several-programs", _several(graded), hint="hand in one program, or name a folder")
    if any(result.defect for result in graded):
        raise typer.Exit(3)
    if search.errors:
        raise typer.Exit(2)
    raise typer.Exit(0 if all(result.grade.passed for result in graded) else 1)


def _search(files: Sequence[Path], level: int, lab: Lab, outputs: GradeFiles) -> Submissions:
    """Return the students' programs, and warn of what is none. Raises InputError if there are none."""
    try:
        search = find_submissions(files, SOURCES, IMAGES, level)
    except InputError as error:
        if error.code == NO_PROGRAM:
            outputs.write_without_program(lab, "no program was handed in")
        raise
    for diagnostic in (*search.warnings, *search.errors):
        file = diagnostic.location and diagnostic.location.file
        warn(replace(diagnostic, location=Location(visible(file)) if file else None))
    return search


def _serve(task: GradingTask, names: Sequence[str], graded: Sequence[Graded], browsing: Browsing) -> None:
    """Serve the class's pages until Ctrl-C."""
    from servogen.watch.graded import class_pages, class_rooms  # with the server, twins and provers
    from servogen.watch.server import WatchServer

    server = WatchServer(class_rooms(task, graded), class_pages(task, names, graded))
    serve_until_ctrl_c(server, task.lab.name, browsing.port, browsing.browser)


def _several(graded: Sequence[Graded]) -> str:
    names = ", ".join(shown_name(result.submission.name) for result in graded)
    return f"{len(graded)} programs were handed in, where one is graded: {names}"


def _write_each(folder: Path, entries: Sequence[GradedProgram], text: Callable[[GradedProgram], str]) -> None:
    """Write a file for each program to a folder, named like its page."""
    make_folder(folder)
    pages = page_names([entry.name for entry in entries])
    texts = {f"{page.removesuffix('.md')}.json": entry for page, entry in zip(pages, entries, strict=True)}
    for name, entry in texts.items():
        write_text(_own(folder / name), text(entry))
    _remove_others(folder, "results", texts)


def _own(target: Path) -> Path:
    """Return a file of a folder; a link that a student has left there must not lead it elsewhere."""
    if target.is_symlink():
        target.unlink()
    return target


def _write_pages(
    folder: Path, names: Sequence[str], lab: Lab, graded: Sequence[Graded]
) -> ServogenError | None:
    """Write each page that can be written; return the error of the first one that could not."""
    make_folder(folder)
    failure = None
    texts: dict[str, Callable[[], str]] = {"index.html": lambda: class_page(lab, names, graded)}
    for name, result in zip(names, graded, strict=True):
        student, grade = result.submission.name, result.grade
        film = film_name(name) if grade.film else ""
        command = watch_command(lab, result.submission, grade) if film else ""
        texts[name] = partial(page, lab, student, grade, film, command)
        if film:
            texts[film] = partial(film_page, lab, result.submission, grade)
    for name, text in texts.items():
        try:
            write_text(_own(folder / name), text())
        except ServogenError as error:
            failure = failure or error
    _remove_others(folder, "pages", texts)
    return failure


def _remove_others(folder: Path, kind: str, written: Collection[str]) -> None:
    """Remove the files of this kind that an earlier grading wrote to a folder, and list those of this one."""
    listed = folder / f".graded-{kind}"
    before = listed.read_text("utf-8").splitlines() if listed.is_file() and not listed.is_symlink() else []
    for name in set(before) - set(written):
        file = folder / name
        if Path(name).name == name and (file.is_symlink() or file.is_file()):
            file.unlink()
    write_text(_own(listed), "".join(f"{name}\n" for name in sorted(written)))


def _rows(lab: Lab, graded: Sequence[Graded], pages: Sequence[str]) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = [
        {
            "program": shown_name(result.submission.name),
            "file": shown_name(str(result.submission.file)),
            **result.grade.to_json(),
            **_points(lab, result),
        }
        for result in graded
    ]
    for row, file in zip(rows, pages, strict=False):
        row["page"] = file
    return rows


def _points(lab: Lab, result: Graded) -> dict[str, object]:
    results = outcomes(lab, result.grade)
    checks = {
        one.key: {"state": one.state, "points": one.points, "max_points": one.max_points} for one in results
    }
    return {"points": total(results), "max_points": max_total(results), "checks": checks}


def _show(lab: Lab, graded: Sequence[Graded]) -> None:
    rows = []
    for result in graded:
        says = result.grade.reasons or [remark.sentence for remark in result.grade.remarks]
        text = "\n".join(" ".join(line.strip() for line in message.splitlines()[:2]) for message in says)
        verdict = "passed" if result.grade.passed else "NOT PASSED"
        results = outcomes(lab, result.grade)
        points = f"{number(total(results))} of {number(max_total(results))}"
        rows.append((shown_name(result.submission.name), verdict, points, text))
    columns = ("program", "verdict", "points", "why, or what is good to know")
    table(f"{lab.title}: {lab.task}", columns, rows)
    passed = sum(result.grade.passed for result in graded)
    print(f"{passed} of {len(graded)} passed")
