"""The windows of real programs that the passes leave: what rules have to be found for.

In: C files. Out: each window with what is not needed behind it, and how often there is one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from servogen.compiler import CompileError, Options, Source, compile_sources
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Instruction
from servogen.compiler.passes import manager
from servogen.compiler.passes.liveness import Liveness
from servogen.compiler.passes.rules import RuleInstruction
from servogen.compiler.passes.superoptimise import dead_after, windows
from servogen.errors import InputError

Key = tuple[tuple[RuleInstruction, ...], frozenset[str]]
POOL = {0, 1, 255}
"""Literals that rules name; any other is "k"."""


def collected(sources: Sequence[tuple[str, str, str]], longest: int) -> Counter[Key]:
    """Return the windows of programs, each (name, text, dialect)."""
    found: Counter[Key] = Counter()
    optimise = manager.PassManager.optimise

    def observed(self: manager.PassManager, function: Function) -> None:
        optimise(self, function)
        if not function.inline_asm and function.table is None:
            found.update(keys_of(function, longest))

    manager.PassManager.optimise = observed  # type: ignore[method-assign]
    try:
        for name, text, dialect in sources:
            try:
                compile_sources([Source(text, name)], Options(dialect=dialect, clock_hz=4_000_000))
            except (CompileError, InputError):
                continue  # not every program of a suite is for this chip
    finally:
        manager.PassManager.optimise = optimise  # type: ignore[method-assign]
    return found


def keys_of(function: Function, longest: int) -> Iterator[Key]:
    """Yield the windows of a function in both forms that a rule may have."""
    live = Liveness(function)
    lines = list(function.lines())
    for at in range(len(lines)):
        for window in windows(lines, at, longest):
            size = len(window.instructions)
            last = lines[at + size - 1]
            assert isinstance(last, Instruction)
            if size < 2:
                continue
            dead = frozenset(dead_after(last, window.bytes, live))
            literals = {each.k for each in window.instructions if each.k is not None}
            general = window.general()
            if general is not None:
                yield general.instructions, dead
            if literals <= POOL:
                yield window.instructions, dead


def files_in(folders: Sequence[Path]) -> list[tuple[str, str, str]]:
    """Return the C files of folders with their dialects, by their names or what they include."""
    found = []
    for path in sorted(file for folder in folders for file in folder.rglob("*.c")):
        text = path.read_text(errors="replace")
        named = next(
            (each for each in ("c2c", "xc8", "sdcc") if each in f"{path.parent.name}/{path.name}"), None
        )
        dialect = named or ("xc8" if "<xc.h>" in text else "c2c")
        found.append((path.name, text, dialect))
    return found
