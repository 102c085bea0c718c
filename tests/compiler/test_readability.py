"""Others can read the compiler: its longer functions say what they do, and names say what they hold."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import servogen.compiler

PACKAGE = Path(servogen.compiler.__file__).parent
UNEXPLAINED_LINES = 7
"""A function without a docstring has at most so many lines below its first."""
VAGUE = frozenset(("at", "done", "each", "found", "held", "kept", "made", "told", "way", "what"))
"""Names that do not tell what a variable or parameter holds."""


def test_longer_functions_say_what_they_do() -> None:
    assert [name for tree, path in sources() for name in unexplained(tree, path)] == []


def test_variables_are_named_by_what_they_hold() -> None:
    assert [name for tree, path in sources() for name in vague(tree, path)] == []


def test_a_function_without_a_docstring_is_seen() -> None:
    long = "def f(x):\n" + "    x += 1\n" * (UNEXPLAINED_LINES + 1)
    assert unexplained(ast.parse(long), "a.py") == ["a.py: f"]
    assert (
        unexplained(ast.parse(long.replace("def f(x):\n", 'def f(x):\n    """Return nothing."""\n')), "")
        == []
    )
    assert unexplained(ast.parse("def f(x):\n    return x"), "a.py") == []
    assert unexplained(ast.parse(f"class A:\n    {long.replace(chr(10), chr(10) + '    ')}"), "") == [": f"]
    assert unexplained(ast.parse(long.replace("f(", "__init__(")), "") == []


def test_a_vague_name_is_seen() -> None:
    for text in ("found = 1", "for each in x: pass", "def f(what): pass", "(kept := 2)", "[at for at in x]"):
        assert len(list(vague(ast.parse(text), "a.py"))) == 1, text
    assert list(vague(ast.parse("match x:\n    case held: pass"), "a.py")) == ["a.py:2: held"]
    assert list(vague(ast.parse("index = lines.at(3)"), "a.py")) == []


def sources() -> Iterator[tuple[ast.Module, str]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        yield ast.parse(path.read_text()), str(path.relative_to(PACKAGE))


def unexplained(tree: ast.AST, path: str) -> list[str]:
    """Return the longer functions without a docstring, but for special methods and functions in functions."""
    names = []
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef):
            lines = (node.end_lineno or 0) - node.body[0].lineno
            if lines >= UNEXPLAINED_LINES and not ast.get_docstring(node) and not node.name.startswith("__"):
                names.append(f"{path}: {node.name}")
        elif isinstance(node, ast.ClassDef):
            names += unexplained(node, path)
    return names


def vague(tree: ast.AST, path: str) -> Iterator[str]:
    """Yield where a vague name is bound."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(name, ast.Store()) | ast.arg(name) | ast.MatchAs(name=str(name)) if name in VAGUE:
                yield f"{path}:{node.lineno}: {name}"
