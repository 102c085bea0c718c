"""docs/movemaster.md has every command as the language's table has it."""

import re
from collections.abc import Callable
from math import degrees
from pathlib import Path

from servogen.kinematics.catalogue import arm
from servogen.movemaster import ProgramRun, parse
from servogen.movemaster.language import COMMANDS, Where

TEXT = (Path(__file__).parents[2] / "docs" / "movemaster.md").read_text("utf-8")
WHERE = {Where.BOTH: "both", Where.PROGRAM: "program", Where.DIRECT: "direct"}


def test_the_documented_commands_are_the_language_s() -> None:
    rows = re.findall(r"^\| (\d+|–) \| `([^`]+)` \| (\w+) \| ([^|]+) \|", TEXT, re.M)
    assert rows == [
        (str(each.number or "–"), each.form, WHERE[each.where], each.meaning) for each in COMMANDS.values()
    ]


def test_the_documented_program_runs(ran: Callable[..., ProgramRun]) -> None:
    program = TEXT.split("```")[1]
    assert [each.number for each in parse(program, "doc.rvm").statements][:4] == [None, None, None, 10]
    assert not ran(program.strip()).warnings


def test_the_documented_limits_of_the_rv_m1_are_those_of_its_file() -> None:
    text = (Path(__file__).parents[2] / "docs" / "robots.md").read_text("utf-8")
    rows = re.findall(r"^\| [\w ]+, q(\d) \| \S+ \| (-?\d+)° to (-?\d+)°[^|]*\| (-?\d+)° \|$", text, re.M)
    assert [tuple(map(int, row)) for row in rows] == [
        (number, *(round(degrees(value)) for value in (joint.lower, joint.upper, joint.home)))
        for number, joint in enumerate(arm("rv-m1").joints, 1)
    ]
