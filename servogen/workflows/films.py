"""Pages of a graded class: the film of each program that failed, and all programs at a glance.

In: a lab, grades, the names of their pages. Out: text of HTML, each page one file without a server.
"""

from __future__ import annotations

from collections.abc import Sequence

from jinja2 import Environment, StrictUndefined

from servogen.edges import PINS
from servogen.grade import Grade, Lab, Submission, shell_word, shown_name
from servogen.grade.points import max_total, number, outcomes, total
from servogen.report.robot_model import servo_model
from servogen.report.viewer import embedded_json, viewer_colours, viewer_module
from servogen.template_files import template_folder
from servogen.workflows.grading import Graded, copies

PERIOD_US = 20_000
SHOWN_US = 100_000
"""The range of the waves that is shown at first."""


def film_name(page: str) -> str:
    """Return the name of the film beside a page."""
    return f"{page.removesuffix('.md')}.html"


def watch_command(lab: Lab, submission: Submission, grade: Grade) -> str:
    """Return the command line that opens a program at the moment of its film, on the lab's board.

    It works in the folder in which the class was graded: a page for students names no folder above that.
    """
    assert grade.film is not None
    cycle = round(grade.film.moment_us / float(lab.clock.cycle_us))
    file = shell_word(str(submission.file))
    return f"servogen watch {file} --clock-hz {lab.clock.hz} --ra4-pull-up --at-cycle {cycle}"


def film_page(lab: Lab, submission: Submission, grade: Grade, link: str = "", nonce: str = "") -> str:
    """Return the film of a program that failed. It has to have a film.

    A page of the class's server has a `link` that opens the program in `servogen watch`, and its own script
    and style carry the `nonce`; one that opens from disk has the command line.
    """
    film, name = grade.film, submission.name
    assert film is not None
    servos = [
        {**servo_model(lab_servo.servo, index), "pin": row.pin}
        for index, (lab_servo, row) in enumerate(zip(lab.servos, film.rows, strict=True))
    ]
    begin = max(film.begin_us, film.moment_us - SHOWN_US / 2)
    data = {
        "end": film.end_us,
        "period": PERIOD_US,
        "first": [begin, begin + SHOWN_US],
        "moment": film.moment_us,
        "loop": film.begin_us,
        "cycle_us": float(lab.clock.cycle_us),
        "pins": PINS,
        "robot": {"servos": servos, "ends": [], "body": [], "base": None},
        "rows": [
            {
                "channel": lab_servo.servo.name,
                "pin": row.pin,
                "kind": "simulated",
                "colour": servo["colour"],
                "rise": row.rise_us,
                "width": row.width_us,
            }
            for lab_servo, row, servo in zip(lab.servos, film.rows, servos, strict=True)
        ],
    }
    return _render(
        "film.html.j2",
        name=shown_name(name),
        command=watch_command(lab, submission, grade),
        task=f"{lab.title}. {lab.task}",
        reasons=grade.reasons,
        source=film.source,
        moment_s=f"{film.moment_us / 1e6:.3f}",
        data=embedded_json(data),
        viewer=viewer_module(),
        colours=viewer_colours(),
        link=link,
        nonce=nonce,
    )


def class_page(
    lab: Lab, names: Sequence[str], graded: Sequence[Graded], links: Sequence[str] = (), nonce: str = ""
) -> str:
    """Return the page with all programs: points, verdict or first reason, links to page and film.

    A page of the class's server also has `links` that open the programs in `servogen watch` ("": this one
    cannot be run), and its style carries the `nonce`.
    """
    rows = [
        {
            "name": shown_name(result.submission.name),
            "passed": result.grade.passed,
            "points": number(total(results := outcomes(lab, result.grade))),
            "max_points": number(max_total(results)),
            "reason": result.grade.reasons[0] if result.grade.reasons else result.grade.how_long,
            "page": page,
            "film": film_name(page) if result.grade.film else "",
            "link": link,
        }
        for page, result, link in zip(names, graded, links or [""] * len(graded), strict=True)
    ]
    return _render(
        "class.html.j2",
        title=lab.title,
        passed=sum(result.grade.passed for result in graded),
        count=len(graded),
        rows=rows,
        copies=copies(graded),
        served=bool(links),
        nonce=nonce,
    )


def _render(template: str, **values: object) -> str:
    environment = Environment(
        undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    text = (template_folder() / "grade" / template).read_text("utf-8")
    return environment.from_string(text).render(values)
