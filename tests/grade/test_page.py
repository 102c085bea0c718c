"""The page of one program, line by line: the verdict, why, the points, what was measured."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

from servogen.errors import Diagnostic
from servogen.grade import Check, Grade, Submission, load_lab, refused
from servogen.grade.checks import Fault
from servogen.grade.formats import GradedProgram, csv_text
from servogen.grade.judge import Row
from servogen.grade.page import page
from servogen.workflows.films import class_page
from servogen.workflows.grading import Graded

LAB = load_lab("lab8-exercise")
ROWS = (
    Row(
        name="30°",
        visits=3,
        widths_us=((1166.6, 1170.2),),
        angles_deg=((29.96, 30.04),),
        periods_ms=(19.996, 20.004),
        stays_s=(2.0, 2.5),
        silent_s=(0.0, 0.0),
        pause_s=2.5,
    ),
    Row(
        name="both",
        visits=0,
        widths_us=((1500.0, 1500.0), (1200.0, 1300.0)),
        angles_deg=((90.0, 90.0), (-1.0, 1.0)),
        periods_ms=None,
        stays_s=None,
        silent_s=None,
        pause_s=None,
    ),
)


def test_the_page_of_a_right_program() -> None:
    grade = Grade(
        lab=LAB.name,
        faults=(),
        remarks=(Diagnostic("note", "other-pin", "the servo is elsewhere"),),
        pins=(("arm", "RB3"),),
        rows=ROWS,
        seen="30° → both",
        watched_s=100.0,
        repeats=True,
        chips=4,
    )
    lines = page(LAB, "ana/main.c", grade).splitlines()
    assert lines[0] == "# ana/main.c: passed"
    assert lines[2] == f"{LAB.title}. {LAB.task}"
    assert lines[4] == "Points: 10 of 10."
    assert "## What is wrong" not in lines
    assert not any("film" in line or "Step through" in line for line in lines)
    good = lines.index("## Good to know")
    assert lines[good + 2] == f"- {grade.remarks[0].sentence}"
    points = lines.index("| check | points |")
    assert lines[points + 1 : points + 4] == [
        "|---|---|",
        "| compiles and runs | 1 of 1 |",
        "| every servo gets pulses | 1 of 1 |",
    ]
    assert "| positions | 2 of 2 |" in lines and "| the same on other chips | 1 of 1 |" in lines
    measured = lines.index("## What was measured")
    assert lines[measured + 2 :] == [
        "Order: 30° → both",
        "",
        "| position | visits in order | pulses | angle | period | stays | silent | required pause |",
        "|---|---|---|---|---|---|---|---|",
        "| 30° | 3 | 1167 to 1170 µs | 30.0° | 20.00 ms | 2.00 to 2.50 s | 0.00 s | 2.5 s |",
        "| both | 0 | 1500 µs and 1200 to 1300 µs | 90.0° and -1.0 to 1.0° | – | – | – | – |",
        "",
        "Servos: arm on RB3. Watched for 100 s on 4 chips with different RAM, pins, watchdog and EEPROM at "
        "power-up; the state of each repeats, so this goes on endlessly.",
    ]


def test_how_long_a_right_program_was_watched_is_beside_its_verdict() -> None:
    """Where its chip's state did not repeat, on the page and in the table of the class."""
    note = Diagnostic("note", "not-repeated", "watched for 600 s: so nothing <later> is judged")
    grade = Grade(LAB.name, (), remarks=(note,), watched_s=600.0)
    lines = page(LAB, "a.c", grade).splitlines()
    assert lines[:3] == ["# a.c: passed", "", "Watched for 600 s: so nothing <later> is judged."]
    graded = Graded(Submission("a.c", Path("a.c"), Path()), grade)
    table = class_page(LAB, ["a.c.md"], [graded])
    assert "passed</span>; watched for 600 s: so nothing &lt;later&gt; is judged</td>" in table
    (row,) = csv.DictReader(io.StringIO(csv_text(LAB, [GradedProgram("a.c", grade)])))
    assert (row["verdict"], row["why"]) == ("passed", note.message)
    endless = replace(grade, remarks=())
    assert page(LAB, "a.c", endless).splitlines()[2].startswith("Lab 8")
    assert "passed</span></td>" in class_page(LAB, ["a.c.md"], [replace(graded, grade=endless)])


def test_the_page_of_a_wrong_program() -> None:
    faults = (
        Fault((Check.ORDER,), "the order is wrong"),
        Fault((Check.PAUSES,), "a pause is wrong:\n  1 s\n\n  2 s"),
    )
    grade = Grade(LAB.name, faults, (Check.TRAVEL,), rows=ROWS[:1], pins=(("arm", "RB0"),), watched_s=12.5)
    lines = page(LAB, "main.c", grade, "film of ana.svg", "servogen watch main.c").splitlines()
    assert lines[0] == "# main.c: not passed"
    assert lines[4] == "Points: 7 of 10."  # order 1, pauses 1 and travel 1 are missing
    wrong = lines.index("## What is wrong")
    assert lines[wrong + 1 : wrong + 11] == [
        "",
        "- the order is wrong",
        "- a pause is wrong:",
        "",
        "  ```",
        "    1 s",
        "",
        "    2 s",
        "  ```",
        "",
    ]
    assert (
        "[The film of it](film%20of%20ana.svg): the servos, the pulses and the source line at the moment."
        in lines
    )
    step = lines.index("Step through it from that moment, forwards and backwards:")
    assert lines[step - 1 : step + 5] == ["", lines[step], "", "```", "servogen watch main.c", "```"]
    for row in (
        "| order of the positions: failed | 0 of 1 |",
        "| pauses: failed | 0 of 1 |",
        "| time to get there: not checked | 0 of 1 |",
        "| period of the pulses | 1 of 1 |",
    ):
        assert row in lines
    assert "## Good to know" not in lines
    assert lines[-1] == "Servos: arm on RB0. Watched for 12.5 s."


def test_a_program_that_did_not_run_has_no_measurements() -> None:
    lines = page(LAB, "main.c", refused(LAB.name, "it does not compile")).splitlines()
    assert lines[4] == "Points: 0 of 10."
    assert "## What was measured" not in lines
    assert lines[-1] == "| the same on other chips: not checked | 0 of 1 |"
