"""Each C file beside this module states in comments what it is to do; this harness compiles, runs and
compares.

    // dialect: c2c            when it is not the name of its directory
    // clock: 8000000          --clock-hz
    // expect: name == value   a global variable when main has ended (decimal or 0x)
    // words: 40               at most so many program words
    // ram: 5                  exactly so many bytes
    // cycles: 1002            above a statement that writes PORTB: cycles since the write of PORTB before it
    // error: text             an error in the line below, with exactly this text (several: in order)
    // warning: text           a warning in the line below
    // hint: text              the hint of the diagnostic named above it

A file must produce exactly the diagnostics that it states, no more.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.edges import PINS
from servogen.errors import Diagnostic, InputError
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from servogen.units import Clock

HERE = Path(__file__).parent
FILES = sorted(path for path in HERE.rglob("*.c") if path.parent.name in ("c2c", "xc8", "sdcc", "errors"))
CYCLES = 300_000


@dataclass
class Stated:
    """The comments of a file."""

    dialect: str
    first: int = 0
    """The first line that states nothing."""
    clock: int | None = None
    values: dict[str, int] = field(default_factory=dict)
    words: int | None = None
    ram: int | None = None
    cycles: dict[int, int] = field(default_factory=dict)
    diagnostics: list[tuple[str, int, str, str | None]] = field(default_factory=list)


def stated(path: Path, text: str) -> Stated:
    found = Stated(path.parent.name if path.parent.name != "errors" else "c2c")
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        match = re.match(r"\s*// (\w+): (.*)$", line)
        if not match:
            continue
        key, value = match[1], match[2].rstrip()
        below = next(
            (at for at in range(number + 1, len(lines) + 1) if not re.match(r"\s*// \w+: ", lines[at - 1])),
            number,
        )
        found.first = found.first or below
        if key == "dialect":
            found.dialect = value
        elif key == "clock":
            found.clock = int(value)
        elif key == "expect":
            name, number_text = value.split("==")
            found.values[name.strip()] = int(number_text.strip(), 0)
        elif key in ("words", "ram"):
            setattr(found, key, int(value))
        elif key == "cycles":
            found.cycles[below] = int(value)
        elif key in ("error", "warning"):
            found.diagnostics.append((key, below, value, None))
        elif key == "hint":
            kind, line_number, message, _ = found.diagnostics[-1]
            found.diagnostics[-1] = (kind, line_number, message, value)
    return found


def said(diagnostics: tuple[Diagnostic, ...], wanted: Stated) -> list[tuple[str, int, str, str | None]]:
    """The diagnostics in the shape of the statements; a hint counts only where one is stated."""
    with_hint = {
        (kind, line, message) for kind, line, message, hint in wanted.diagnostics if hint is not None
    }
    return [
        (
            each.severity,
            each.location.line or wanted.first,
            each.message,
            each.hint
            if (each.severity, each.location.line or wanted.first, each.message) in with_hint
            else None,
        )
        for each in diagnostics
    ]


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_program_does_what_its_comments_state(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    wanted = stated(path, text)
    options = Options(dialect=wanted.dialect, clock_hz=wanted.clock)
    try:
        found = compile_sources([Source(text, path.name)], options)
    except InputError as error:
        assert sorted(said(error.diagnostics, wanted)) == sorted(wanted.diagnostics), str(error)
        return
    assert not [each for each in wanted.diagnostics if each[0] == "error"], (
        "it compiles, but errors are stated"
    )
    assert sorted(said(found.diagnostics, wanted)) == sorted(wanted.diagnostics)
    if wanted.words is not None:
        assert found.words <= wanted.words
    if wanted.ram is not None:
        assert found.ram_bytes == wanted.ram
    run(found, wanted)


def run(found: Compilation, wanted: Stated) -> None:
    machine = Machine(found.image, found.clock or Clock(4_000_000))
    edges = machine.run(CYCLES)
    state = machine.state()
    where = {name: (address, size) for address, name, size in found.listing.variables}
    got = {}
    for name in wanted.values:
        address, size = where[name]
        start = address - RAM_FIRST
        got[name] = int.from_bytes(state.ram[start : start + size], "little")
    mask = {name: (1 << 8 * where[name][1]) - 1 for name in wanted.values}
    assert got == {name: value & mask[name] for name, value in wanted.values.items()}
    if wanted.cycles:
        check_cycles(
            found,
            wanted,
            [int(cycle) for cycle, pin in zip(edges.cycle, edges.pin, strict=True) if PINS[pin] == "RB0"],
        )


def check_cycles(found: Compilation, wanted: Stated, edges: list[int]) -> None:
    """Times between changes of RB0, which each measured statement turns over."""
    differences = [after - before for before, after in pairwise(edges[1:])]
    assert differences[: len(wanted.cycles)] == [wanted.cycles[line] for line in sorted(wanted.cycles)]
