"""A graded class as pages and rooms of the server: "open in watch" beside each program that could be run.

In: a lab, grades, the names of their pages. Out: the tables of a `WatchServer`. When a program's page is
opened, it is compiled again, within the limits of its grading and from its student's own files only, and runs
on the simulated chip. Of what students wrote, nothing but escaped text gets into a page.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from servogen.edges import PINS
from servogen.grade import page, page_names, shown_name
from servogen.programs import within_limits
from servogen.report.robot_model import servo_model
from servogen.units import Cycles
from servogen.watch.server import Page, Room
from servogen.watch.subject import Subject
from servogen.workflows.films import class_page, film_name, film_page
from servogen.workflows.grading import Graded, GradingTask
from servogen.workflows.power_ups import BOARD

HTML, TEXT = "text/html", "text/plain"
"""The types of pages; Markdown is shown as plain text."""


def class_pages(task: GradingTask, names: Sequence[str], graded: Sequence[Graded]) -> dict[str, Page]:
    """Return the page of the class and those of the programs, by their names below the token."""
    lab = task.lab
    links = [f"{_folder(number)}/" if _ran(result) else "" for number, result in enumerate(graded)]
    pages = {"": Page(HTML, lambda nonce: class_page(lab, names, graded, links, nonce))}
    for name, result, link in zip(names, graded, links, strict=True):
        film = film_name(name) if result.grade.film else ""
        pages[name] = Page(TEXT, partial(_plain, task, result, film))
        if film:
            pages[film] = Page(HTML, partial(_film, task, result, link))
    return pages


def class_rooms(task: GradingTask, graded: Sequence[Graded]) -> dict[str, Room]:
    """Return a room for each program that could be run, by its folder below the token."""
    names = page_names([result.submission.name for result in graded])
    return {
        _folder(number): Room(partial(watched_program, task, result, film_name(name)))
        for number, (result, name) in enumerate(zip(graded, names, strict=True))
        if _ran(result)
    }


def _folder(number: int) -> str:
    return f"watch/{number}"


def _ran(result: Graded) -> bool:
    return result.grade.passed or bool(result.grade.rows) or result.grade.film is not None


def _plain(task: GradingTask, result: Graded, film: str, nonce: str) -> str:
    return page(task.lab, result.submission.name, result.grade, film)


def _film(task: GradingTask, result: Graded, link: str, nonce: str) -> str:
    return film_page(task.lab, result.submission, result.grade, link, nonce)


def watched_program(
    task: GradingTask, result: Graded, film_page_name: str, progress: Callable[[str], None]
) -> Subject:
    """Return a program on the lab's board, at the moment of its film, with its grade. Raises InputError."""
    lab, submission, film = task.lab, result.submission, result.grade.film
    progress("compiling")
    submission.require_readable()
    program = within_limits(lambda: task.read(submission), submission.file, task.compiling)
    pins = dict(result.grade.pins)
    servos = [
        {**servo_model(each.servo, index), "pin": PINS.index(pins.get(each.servo.name, each.servo.pin))}
        for index, each in enumerate(lab.servos)
    ]
    begin = Cycles(0 if film is None else round(film.moment_us / float(lab.clock.cycle_us)))
    return Subject(
        submission.file,
        lab.clock,
        BOARD,
        program.image,
        program.listing,
        remarks=program.warnings,
        begin=begin,
        first_difference=None if film is None else begin,
        title=shown_name(submission.name),
        robot={"servos": servos, "ends": [], "body": [], "base": None},
        graded={
            "passed": result.grade.passed,
            "task": f"{lab.title}. {lab.task}",
            "reasons": result.grade.reasons,
            "film": film_page_name if film else None,
        },
    )
