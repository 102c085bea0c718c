"""A lab's task sheet: what a student needs, and nothing of the solution."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path

import pytest

from servogen.grade import handout_html, handout_markdown, load_lab
from tests.cli.conftest import Run, run

__all__ = ["run"]


class Text(HTMLParser):
    """The text of a page and the tags that are open at its end."""

    def __init__(self) -> None:
        super().__init__()
        self.text: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.add(tag)

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def test_the_sheet_has_wiring_facts_task_and_grading() -> None:
    sheet = handout_markdown(load_lab("lab8-exercise"))
    assert sheet.startswith("# Lab 8, exercise 8.4\n")
    for line in (
        "Turn the servo to 30°, 90° and 120° and back, endlessly, with pauses of 2 s, 5 s and 3 s.",
        "| pulse for 0° | 1000 µs |",  # lab 8: 1 ms is 0°, 2 ms is 180°
        "| pulse for 180° | 2000 µs |",
        "| greatest current | 720 mA |",
        "| mass | 45.1 g |",
        "| positions | 2 |",
        "A pause may be 5 % shorter or longer than required.",
    ):
        assert line in sheet.splitlines()
    assert "| arm | Futaba S3001 | RB0 | RB1," in sheet
    assert "4 MHz" in sheet


@pytest.mark.parametrize("lab", ["lab8-exercise", "lab9-exercise"])
def test_it_has_nothing_of_the_solution(lab: str) -> None:
    task = load_lab(lab)
    for sheet in (handout_markdown(task), handout_html(task)):
        rest = sheet.replace(task.task, "")
        names = [solution.name for solution in task.solutions if solution.name]
        names += [place.name for solution in task.solutions for place in solution.positions]
        # 0°, 90° and 180° are points of the servos.
        assert not [name for name in names if name != "90°" and name in rest]


def test_both_forms_say_the_same_and_run_nothing(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    source = Path("servogen/grade/labs/lab8-exercise.toml").read_text("utf-8")
    own.write_text(source.replace('task = "', 'task = "<script>alert(1)</script> | '), "utf-8")
    task = load_lab(str(own))
    page = Text()
    page.feed(handout_html(task))
    assert "script" not in page.tags
    assert "<script>alert(1)</script> |" in "".join(page.text)
    assert "<script>" not in handout_markdown(task)
    for fact in ("Futaba S3001", "720 mA", "17.5 to 20.5 ms"):
        assert any(fact in text for text in page.text)


def test_the_command_writes_either_form_and_says_what_is_next(run: Run, tmp_path: Path) -> None:
    assert run("handout", "lab9-exercise").out == handout_markdown(load_lab("lab9-exercise"))
    ran = run("handout", "lab9-exercise", "-o", tmp_path / "sheet.html")
    assert (ran.code, "servogen grade lab9-exercise" in ran.out) == (0, True)
    assert (tmp_path / "sheet.html").read_text("utf-8") == handout_html(load_lab("lab9-exercise"))
    ran = run("handout", "lab9-exercise", "-o", tmp_path / "sheet.pdf")
    assert ran.code == 2
    assert "neither .md nor .html" in ran.err
