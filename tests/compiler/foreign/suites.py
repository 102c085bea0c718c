"""The programs in a folder of a suite.

In: a folder. Out: `Program`s. A file that includes <testfwk.h> is a test of SDCC's regression suite: the
head of a template (`*.c.in`) names values, and each combination of them is a program, which calls all of its
`void test...(void)`. Any other file with a `main` is run as it is: its exit status must be 0, and it must
write the text of `NAME.c.expected`, where that file exists.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tests.compiler.foreign.headers import harness, prelude

MAX_CHARACTERS = 1_000_000
_TEST = re.compile(r"^(?:\W*void\W+)?\W*(test\w*)\W*\(\W*void\W*\)")
_MAIN = re.compile(r"\b(?:(?P<result>int|void)\s+)?main\s*\(\s*(?P<parameters>[^)]*)\)")
_HEAD = re.compile(r"^\s*(\w+)\s*:\s*(.*?)\s*$")


@dataclass(frozen=True, slots=True)
class Program:
    """One program: a text to compile under `file`'s name."""

    name: str
    file: Path
    text: str
    defines: Mapping[str, str] = field(default_factory=dict)
    output: str | None = None
    """What it must write, or None where that is open."""
    alone: tuple[Program, ...] = ()
    """The same tests one by one, for a chip that has too little memory for all."""
    dialect: str = "sdcc"


def programs(folder: Path, instances: int) -> Iterator[Program]:
    """Return the programs of all C files below `folder`, in the order of their names.

    Of the combinations of a template's values there are at most `instances`, at even distances.
    """
    for path in sorted([*folder.rglob("*.c"), *folder.rglob("*.c.in")]):
        if path.is_file():
            yield from programs_of(path, str(path.relative_to(folder)), instances)


def programs_of(path: Path, name: str, instances: int) -> Iterator[Program]:
    """Return the programs that a file holds; none where it has neither tests nor a main."""
    text = path.read_text(encoding="latin-1")
    if len(text) > MAX_CHARACTERS:
        return
    if "testfwk.h" in text:
        yield from _regression(path, name, text, instances)
        return
    main = _MAIN.search(text)
    if main is None:
        return
    expected = path.with_name(path.name + ".expected")
    arguments = ", ".join("0" for each in main["parameters"].split(",") if each.strip() not in ("", "void"))
    call = f"suite_main({arguments});"
    yield Program(
        name,
        path,
        f"{prelude(text)}{text}\n{harness(call if main['result'] == 'void' else 'suite_failed = ' + call)}",
        {"main": "suite_main"},
        expected.read_text(encoding="latin-1") if expected.is_file() else None,
    )


def _regression(path: Path, name: str, text: str, instances: int) -> Iterator[Program]:
    """Return the programs of one test of SDCC's suite."""
    head, tests = _parts(text)
    if not tests:
        return
    for values in _combinations(head, instances):
        body, label = text, name
        for key, value in values:
            body = body.replace(f"{{{key}}}", value)
            label += f" {key}={value or 'none'}"
        body = f"{prelude(text)}{body}\n"

        def made(what: str, calls: list[str], body: str = body) -> Program:
            return Program(what, path, body + harness(" ".join(f"{each}();" for each in calls)))

        alone = tuple(made(f"{label} {each}", [each]) for each in tests) if len(tests) > 1 else ()
        whole = made(label, tests)
        yield Program(whole.name, path, whole.text, alone=alone)


def _parts(text: str) -> tuple[list[tuple[str, list[str]]], list[str]]:
    """Return the named values of the first comment, and the test functions behind it."""
    head: list[tuple[str, list[str]]] = []
    tests: list[str] = []
    inside = True
    for line in text.splitlines():
        found = _HEAD.match(line)
        if inside and found:
            head.append((found[1], [each.strip() for each in found[2].split(",")]))
        elif inside and "*/" in line:
            inside = False
        elif not inside and (test := _TEST.match(line.strip())):
            tests.append(test[1])
    return [(key, values) for key, values in head if f"{{{key}}}" in text], list(dict.fromkeys(tests))


def _combinations(head: list[tuple[str, list[str]]], instances: int) -> list[list[tuple[str, str]]]:
    """Return the combinations of values that are run."""
    found = [
        list(zip([key for key, _ in head], each, strict=True))
        for each in itertools.product(*(values for _, values in head))
    ]
    step = -(-len(found) // instances)
    return found[::step]
