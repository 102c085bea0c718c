"""The windows of real programs that the passes leave: what rules have to be found for.

In: C files. Out: each window with what is not needed behind it, and how often there is one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from servogen.compiler import Options, Source, compile_sources
from servogen.compiler.ir.function import Function, is_skipped
from servogen.compiler.ir.instruction import Instruction
from servogen.compiler.passes import manager
from servogen.compiler.passes.liveness import Liveness
from servogen.compiler.passes.superoptimise import Names, RuleInstruction, dead_after, rule_instruction
from servogen.errors import InputError
from tools.superoptimiser.enumeration import POOL, Sequence_, Sought


def collected(sources: Sequence[tuple[str, str, str]], longest: int) -> Counter[Sought]:
    """Return the windows of programs, each (name, text, dialect), in all forms that a rule may have."""
    found: Counter[Sought] = Counter()
    optimise = manager.PassManager.optimise

    def observed(self: manager.PassManager, function: Function) -> None:
        optimise(self, function)
        if not function.inline_asm and function.table is None:
            found.update(windows(function, longest))

    manager.PassManager.optimise = observed  # type: ignore[method-assign]
    try:
        compile_all(sources)
    finally:
        manager.PassManager.optimise = optimise  # type: ignore[method-assign]
    return found


def compile_all(sources: Sequence[tuple[str, str, str]]) -> None:
    for name, text, dialect in sources:
        try:
            compile_sources([Source(text, name)], Options(dialect=dialect, clock_hz=4_000_000))
        except InputError:
            continue  # not every program of a suite is for this chip


def windows(function: Function, longest: int) -> Iterator[Sought]:
    """Yield the windows of a function: they contain no label, and no skip leads into or out of them."""
    live = Liveness(function)
    lines = list(function.lines())
    for at in range(len(lines)):
        if is_skipped(lines, at):
            continue
        names: Names = {}
        window: list[RuleInstruction] = []
        skips = False
        for line in lines[at : at + longest]:
            each = rule_instruction(line, names) if isinstance(line, Instruction) else None
            if each is None or not isinstance(line, Instruction) or (skips and line.skips):
                break
            window.append(each)
            skips = line.skips
            if len(window) > 1 and not line.skips:
                dead = frozenset(dead_after(line, names, live))
                yield from (Sought(form, dead) for form in forms(window))


def forms(window: Sequence[RuleInstruction]) -> Iterator[Sequence_]:
    """Yield a window as rules may write it: at most one of its literals is "k"."""
    literals = {each.k for each in window if each.k is not None}
    for general in (None, *literals):
        if literals <= {*POOL, general}:
            yield tuple(
                RuleInstruction(each.op, k="k") if each.k is not None and each.k == general else each
                for each in window
            )


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
