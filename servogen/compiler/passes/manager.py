"""Runs the passes over each function, and records what each of them saved.

In: the functions of a program. Out: the same functions, smaller. The user's assembly is never changed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import JUMPING
from servogen.compiler.ir.verifier import verify
from servogen.compiler.passes.branch_simplify import short_branches
from servogen.compiler.passes.copy_coalescing import coalesce_copies
from servogen.compiler.passes.dead_code import drop_dead, drop_unreachable
from servogen.compiler.passes.idioms import shorten_idioms
from servogen.compiler.passes.jump_threading import drop_jumps_to_next, thread_jumps
from servogen.compiler.passes.peephole import peephole
from servogen.compiler.passes.tail_merging import merge_tails, tail_calls
from servogen.compiler.passes.value_numbering import number_values

Pass = Callable[[Function], bool]
"""Rewrites a function; true when something changed."""

JUMPS: Mapping[str, Pass] = {
    "thread-jumps": thread_jumps,
    "drop-unreachable": drop_unreachable,
    "drop-jumps-to-next": drop_jumps_to_next,
}
"""Passes that only look at where control goes: they apply to library routines too."""
VALUES: Mapping[str, Pass] = {
    "value-numbering": number_values,
    "dead-code": drop_dead,
    "peephole": peephole,
    "idioms": shorten_idioms,
    "branch-simplify": short_branches,
    "copy-coalescing": coalesce_copies,
}
"""Passes that follow values. They are not applied to library routines, which are written by hand."""
TAILS: Mapping[str, Pass] = {"tail-merging": merge_tails}
RETURNS: Mapping[str, Pass] = {"tail-calls": tail_calls, "drop-unreachable": drop_unreachable}
PROGRAM_PASSES = ("bank-select", "outlining", "delays")
"""What rewrites the whole program, in order, after the passes above."""
PASSES = tuple(dict.fromkeys(("codegen", "startup", *JUMPS, *VALUES, *TAILS, *RETURNS, *PROGRAM_PASSES)))
"""Names for `--dump ir:pass`, in order."""
_MAX_ROUNDS = 60


@dataclass(slots=True)
class PassManager:
    """Runs the passes, optionally verifies the form after each, and keeps statistics."""

    verify_ir: bool = False
    after_pass: Callable[[str, Function], None] | None = None
    """Called after each pass with its name and the function."""
    saved: Counter[str] = field(default_factory=Counter)
    """Instructions that each pass has removed, in total."""
    runs: Counter[str] = field(default_factory=Counter)

    def finished(self, name: str, function: Function, *, changed: bool = True) -> None:
        """Verify a function that a pass has changed, and pass it to the observer."""
        if self.verify_ir and changed:
            verify(function, after=name)
        if self.after_pass is not None:
            self.after_pass(name, function)

    def finished_all(self, name: str, functions: Mapping[str, Function]) -> None:
        """Call `finished` for every function except tables, whose instructions depend on their addresses."""
        for function in functions.values():
            if function.table is None:
                self.finished(name, function)

    def run(self, passes: Mapping[str, Pass], function: Function, settled: set[str]) -> bool:
        """Run each pass once; return whether one of them changed something.

        `settled` holds the passes that would change nothing, because nothing has changed since they ran.
        """
        changed = False
        for name, transform in passes.items():
            if name in settled:
                continue
            before = function.size
            rewritten = transform(function)
            if rewritten:
                changed = True
                settled.clear()
            else:
                settled.add(name)
            self.saved[name] += before - function.size
            self.runs[name] += 1
            self.finished(name, function, changed=rewritten)
        return changed

    def optimise(self, function: Function) -> None:
        """Run the passes until nothing changes."""
        follows_values = not function.name.startswith("__") and not _jumps_by_hand(function)
        settled: set[str] = set()
        for _ in range(_MAX_ROUNDS):
            changed = self.run(JUMPS, function, settled)
            if follows_values:
                changed |= self.run(VALUES, function, settled)
            # tails are merged once nothing else changes: more is known where a path has its end to itself
            if not changed and not (follows_values and self.run(TAILS, function, settled)):
                break
        # last, because a GOTO out of the function hides from liveness what the callee needs; main never
        # returns
        if follows_values and function.name != "main":
            self.run(RETURNS, function, settled)


def _jumps_by_hand(function: Function) -> bool:
    """Return whether a function contains assembly that jumps, so that its control flow is unknown."""
    return function.inline_asm and any(ins.fixed and ins.op in JUMPING for ins in function.instructions())
