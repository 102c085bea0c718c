"""Names of the loops that are not counted: "while at line 12".

In: a function's code and the graph of its labels and known values. Out: a name of each loop that may never
end.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from servogen.compiler.cycles import components
from servogen.compiler.emitter import Code
from servogen.compiler.machine import LABEL

Key = tuple[int, tuple[tuple[str, int], ...]]
"""An instruction, and the values that are known there."""


def uncounted(code: Code, graph: Mapping[Key, Sequence[Key]], *, returns: bool) -> list[str]:
    """Return each loop that is not counted: an outer one, then those that are left inside it.

    In a function that never `returns`, a jump to itself is where the program ends, not a loop to be named.
    """
    found: dict[str, None] = {}
    for part in components(graph):
        if not returns and len(part) == 1 and _stands_still(code, part[0][0]):
            continue
        found[name_of(code, [at for at, _ in part])] = None
        first = min(at for at, _ in part)
        inside = {key for key in part if key[0] != first}
        rest = {key: [each for each in graph[key] if each in inside] for key in inside}
        found.update(dict.fromkeys(uncounted(code, rest, returns=returns)))
    return list(found)


def _stands_still(code: Code, at: int) -> bool:
    """Return whether a label is followed by a jump to itself."""
    behind = next((each for each in code.ins[at:] if each.op != LABEL), None)
    return behind is not None and behind.op == "GOTO" and behind.target == code.ins[at].target


def name_of(code: Code, found: Iterable[int]) -> str:
    """The loop of the source that holds these instructions."""
    if code.waits_for:
        return f"waits for {code.waits_for}"
    places = [code.ins[at].place for at in found]
    inside = [(each.line, each.column or 0) for each in places if each is not None and each.line]
    if not inside:
        return "a loop"
    around = [each for each in code.loops if each.first <= min(inside) and max(inside) <= each.last]
    if not around:
        return f"loop at line {min(inside)[0]}"
    inner = max(around, key=lambda each: each.first)
    return f"{inner.kind} at line {inner.first[0]}"
