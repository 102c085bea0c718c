"""Every message of the compiler has a test with its exact text.

The messages are read from the compiler's own source: the second argument, after the code, of each call that
reports. The texts that tests state are the `// error:` and `// warning:` comments of the C files beside this
module.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import servogen.compiler

HERE = Path(__file__).parent
PACKAGE = Path(servogen.compiler.__file__).parent
UNFORESEEN = frozenset(("this type is not supported",))
"""Stands behind all that the parser is known to give."""
REPORTS = frozenset(("error", "warn", "fatal", "fail", "SourceError"))


def pattern(node: ast.expr) -> str | None:
    """A message as a regular expression; None when it is not a literal."""
    match node:
        case ast.Constant(value=str(text)):
            return re.escape(text)
        case ast.JoinedStr(values):
            parts = [re.escape(each.value) if isinstance(each, ast.Constant) else ".*" for each in values]
            return "".join(str(part) for part in parts)
        case ast.BinOp(left, ast.Add(), right):
            one, two = pattern(left), pattern(right)
            return one + two if one is not None and two is not None else None
    return None


@cache
def messages() -> dict[str, str]:
    """Pattern of each message, and where it is reported."""
    found: dict[str, str] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call) or len(node.args) < 2:
                continue
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name not in REPORTS:
                continue
            text = pattern(node.args[1])
            if name == "SourceError" and text is not None:
                text = "assembly: " + text
            if text is not None and text.strip(".*") and text.replace("\\", "") not in UNFORESEEN:
                found[text] = f"{path.name}:{node.lineno}"
    return found


@cache
def stated() -> str:
    """The texts that the C files state, and those that a test of several sources asks for, one a line."""
    found = []
    for path in sorted(HERE.rglob("*.c")):
        found += re.findall(r"^\s*// (?:error|warning): (.*?)\s*$", path.read_text(), re.MULTILINE)
    for path in sorted(HERE.glob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return "\n".join(sorted({each.replace("\n", "\0") for each in found}))


def test_the_messages_are_found() -> None:
    assert len(messages()) > 100


def test_each_message_is_stated_by_a_test() -> None:
    texts = stated()
    unstated = [
        f"{where}: no test states {text}"
        for text, where in messages().items()
        if not re.search(f"^{text}$", texts, re.MULTILINE)
    ]
    assert unstated == []
