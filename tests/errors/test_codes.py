"""docs/diagnostics.md lists every code, and only those that the source has: both are read here."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import servogen
from servogen.simulator.warnings import CHIP_DEPENDENT

PACKAGE = Path(servogen.__file__).parent
DOCS = PACKAGE.parent / "docs" / "diagnostics.md"
CODE = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")

ERRORS = frozenset(
    (
        *("InputError", "ToolError", "Unplugged", "Differs", "ResourceError", "RenderError"),
        *("TuningError", "SourceError", "ServogenError"),
    )
)
"""Exceptions whose first argument is a code."""
REPORTS = {
    **dict.fromkeys(("error", "_error", "warn", "fatal", "fail", "check_known"), 0),
    **dict.fromkeys(("report", "remark"), 1),
    "_say": 3,
}
"""Methods that report, and which of their arguments is the code."""
SEVERITIES = ("error", "warning", "note")


def code_argument(node: ast.Call) -> ast.expr | None:
    """Return which argument of a call that makes a diagnostic is the code."""
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    at = 0 if name in ERRORS else 1 if name == "Diagnostic" else None
    if node.args and at is None and name in REPORTS and not _takes_a_diagnostic(node, name):
        at = REPORTS[name]
    return node.args[at] if at is not None and len(node.args) > at else None


def _takes_a_diagnostic(node: ast.Call, name: str) -> bool:
    """Return whether it is another function of that name: `show.warn(diagnostic)`, the simulator's `warn`."""
    other = name == "warn" and isinstance(node.func, ast.Name)
    other |= name == "_error" and not isinstance(node.args[0], ast.Constant)
    return other or len(node.args) < 2 or (name == "report" and len(node.args) < 3)


@cache
def source() -> tuple[list[tuple[str, ast.expr]], set[str]]:
    """Return (place, code) of each call that makes a diagnostic, and every text that could be a code."""
    codes, texts = [], set()
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and (code := code_argument(node)):
                codes.append((f"{path.relative_to(PACKAGE)}:{node.lineno}", code))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.add(node.value)
    return codes, {text for text in texts if CODE.fullmatch(text)}


def documented() -> set[str]:
    return set(re.findall(r"^\| `([^`]+)` \|", DOCS.read_text("utf-8"), re.MULTILINE))


def test_every_diagnostic_has_a_literal_code_that_the_page_explains() -> None:
    """What passes a code on names it `code`, or takes it from another diagnostic."""
    known, wrong, seen = documented(), [], 0
    for place, code in source()[0]:
        if isinstance(code, ast.Constant):
            seen += 1
            if not isinstance(code.value, str) or code.value not in known:
                wrong.append(f"{place}: {code.value!r}")
        elif ast.unparse(code).rpartition(".")[2] not in ("code", "kind"):
            wrong.append(f"{place}: {ast.unparse(code)} is not a literal")
    assert not wrong
    assert seen > 500


def test_every_code_of_the_page_is_in_the_source() -> None:
    assert documented() - source()[1] == set()


def test_a_code_has_one_row_with_meaning_and_advice() -> None:
    rows = re.findall(r"^\| `[^`]+` \|.*$", DOCS.read_text("utf-8"), re.MULTILINE)
    assert len(rows) == len(documented())
    cells = [re.split(r"(?<!\\)\|", row) for row in rows]  # `\|` is a bar inside a cell
    assert all(len(row) == 5 and all(cell.strip() for cell in row[1:4]) for row in cells)


def test_codes_that_tables_hold_are_explained_too() -> None:
    from servogen.pic.assembler.messages import NUMBERS
    from servogen.simulator import layout as at
    from servogen.simulator.warnings import WORDS

    assert documented() >= CHIP_DEPENDENT
    assert sorted(WORDS) == [*at.OF_A_PIN, *at.OF_ALL, *at.OF_AN_ADDRESS]
    assert {code for code, _, _ in WORDS.values()} <= documented()
    assert set(NUMBERS) <= documented()


def test_nothing_looks_at_the_text_of_a_message() -> None:
    """No `in str(error)`, no comparison with a message, no `startswith` or regular expression on one."""
    text = re.compile(
        r"\bin str\((?:error|failure|refusal|exception)\)"
        r"|\.message\s*(?:==|!=|\.startswith|\.endswith)"
        r"|\bin (?:error|failure|diagnostic|warning|each)\.message\b"
        r"|re\.\w+\([^)]*\b(?:error|diagnostic|warning)\.message"
    )
    found = [
        f"{path.relative_to(PACKAGE)}: {match[0]}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for match in text.finditer(path.read_text("utf-8"))
    ]
    assert not found


def test_the_simulators_first_codes_are_those_that_no_proof_may_have() -> None:
    """The page says of its table that a program with one of the first so many codes is not exact."""
    section = DOCS.read_text("utf-8").partition("## Simulator")[2].partition("\n## ")[0]
    said = re.search(r"A warning with one of the first (\w+) codes means that another chip", section)
    assert said
    count = ("six", "seven", "eight", "nine", "ten", "eleven", "twelve").index(said[1]) + 6
    rows = re.findall(r"^\| `([a-z0-9-]+)` \|", section, re.MULTILINE)
    assert set(rows[:count]) == CHIP_DEPENDENT
    assert len(rows) > count == len(CHIP_DEPENDENT)
