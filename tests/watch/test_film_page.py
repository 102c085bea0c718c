"""The film of a failed student's program, in a real browser."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from servogen.grade import Lab, Submission, load_lab, page, refused
from servogen.programs import read_submission
from servogen.simulator import SimulatorOptions
from servogen.watch.session import WatchSession
from servogen.watch.subject import Setting, load_subject
from servogen.workflows.films import class_page, film_name, film_page, watch_command
from servogen.workflows.grading import Graded, GradingTask, grade_submissions
from tests.watch.browser import Browser, wait

WRONG = Path(__file__).parent.parent / "grade" / "programs" / "lab8-wrong" / "order.c"
MAX_BYTES = 300_000


@pytest.fixture(scope="module")
def lab() -> Lab:
    return load_lab("lab8-exercise")


@pytest.fixture(scope="module")
def graded(lab: Lab) -> Iterator[Graded]:
    """A program that goes to its positions in a wrong order."""
    submission = Submission("ana/<b>order.c", WRONG, WRONG.parent)
    yield grade_submissions([submission], GradingTask.of(lab, read_submission, 60.0, 300))[0]


def test_the_film_begins_at_what_is_wrong(lab: Lab, graded: Graded) -> None:
    film = graded.grade.film
    assert film is not None and not graded.grade.passed
    assert film.begin_us < film.moment_us < film.end_us
    (row,) = film.rows
    at = row.rise_us.index(film.moment_us)
    assert abs(row.width_us[at] - row.width_us[at - 1]) > 100  # the visit that is wrong begins
    assert film.source is not None
    text = WRONG.read_text().splitlines()
    assert film.source.lines == tuple(text[film.source.first - 1 :][: len(film.source.lines)])
    shown = text[film.source.line - 1]
    assert shown.strip() == "PULSES(100, 1660) __delay_ms(5000);"  # 120° before 90°


def test_the_command_on_the_page_opens_the_program_at_the_same_moment(lab: Lab, graded: Graded) -> None:
    command = watch_command(lab, graded.submission, graded.grade)
    assert command in page(lab, graded.submission.name, graded.grade, "x.html", command)
    words = shlex.split(command)
    assert words[:6] == ["servogen", "watch", str(WRONG), "--clock-hz", "4000000", "--ra4-pull-up"]
    assert words[6] == "--at-cycle" and len(words) == 8
    setting = Setting(SimulatorOptions(ra4_pull_up=True), 4_000_000, at_cycle=int(words[7]))
    session = WatchSession(load_subject(WRONG, setting))
    while session.now < setting.at_cycle:  # a slow machine goes the rest of the way in ticks
        assert next(iter(session.tick(0)))["is"] in ("going", "now")
    film = graded.grade.film
    assert film is not None and film.source is not None
    assert session.now - film.moment_us in (0, 1)  # 1 µs per cycle
    here = session.shown()["chip"]["here"]
    assert here == (str(WRONG), film.source.line)
    (after,) = session.handle({"do": "step", "what": "edge", "count": 1})
    assert after["cycle"] - film.moment_us in (1, 2) and after["levels"][film.rows[0].pin] == "1"


def test_a_right_program_has_no_film(lab: Lab) -> None:
    right = WRONG.parent.parent / "lab8-right" / "delays.c"
    task = GradingTask.of(lab, read_submission, 60.0, 300)
    (found,) = grade_submissions([Submission("eva.c", right, right.parent)], task)
    assert found.grade.passed and found.grade.film is None
    html = class_page(lab, ["eva.c.md"], [found])
    assert "1 of 1 programs passed" in html and "film</a>" not in html


def test_the_film_is_small_plays_and_asks_for_nothing(
    lab: Lab, graded: Graded, browser: Browser, tmp_path: Path
) -> None:
    html = film_page(lab, graded.submission, graded.grade)
    assert len(html.encode()) < MAX_BYTES
    assert "<b>order" not in html
    file = tmp_path / film_name("ana.md")
    file.write_text(html)
    tab = browser.page(width=390, height=844)
    tab.call("Page.navigate", url=file.as_uri())
    tab.arrives(file.as_uri(), "typeof film !== 'undefined'")
    assert graded.grade.film is not None
    begin = tab.run("film.time")
    assert begin == pytest.approx(graded.grade.film.moment_us)
    assert tab.run("document.querySelector('.here').textContent.includes('PULSES(100, 1660)')")
    assert tab.run("film.servos.angles[0] * 180 / Math.PI") == pytest.approx(28.8, abs=0.2)  # 1160 µs before
    tab.plays(begin + 3e5)
    assert tab.run("film.servos.angles[0] * 180 / Math.PI") > 40  # it turns to 119°, 60° in 0.19 s or slower
    tab.click("#copy")
    wait(lambda: bool(tab.run("document.getElementById('copy').textContent === 'copied'")))
    assert tab.run("getSelection().toString()") == watch_command(lab, graded.submission, graded.grade)
    assert tab.run("document.documentElement.scrollWidth") <= 390
    assert tab.problems == [] and tab.requests == [file.as_uri()]
    tab.close()


def test_names_and_reasons_of_strangers_stay_text(lab: Lab) -> None:
    evil = refused(lab.name, "</script><script>alert(1)</script>")
    submission = Submission("<img src=x onerror=alert(1)>.c", WRONG, WRONG.parent)
    html = class_page(lab, ["x.md"], [Graded(submission, evil)])
    assert "<img" not in html and "<script>alert" not in html
