"""docs/movemaster.md has every command as the language's table has it."""

import re
from pathlib import Path

from servogen.motion.movemaster import parse
from servogen.motion.movemaster.language import COMMANDS, Where

TEXT = (Path(__file__).parents[3] / "docs" / "movemaster.md").read_text("utf-8")
WHERE = {Where.BOTH: "both", Where.PROGRAM: "program", Where.DIRECT: "direct"}


def test_the_documented_commands_are_the_language_s() -> None:
    rows = re.findall(r"^\| (\d+|–) \| `([^`]+)` \| (\w+) \| ([^|]+) \|", TEXT, re.M)
    assert rows == [
        (str(each.number or "–"), each.form, WHERE[each.where], each.meaning) for each in COMMANDS.values()
    ]


def test_the_documented_program_is_one() -> None:
    program = TEXT.split("```")[1]
    assert [each.number for each in parse(program, "doc.rvm").statements][:4] == [None, None, None, 10]
