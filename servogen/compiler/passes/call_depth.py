"""The depth of calls: the chip's stack has eight levels, and an interrupt takes one wherever main is.

In: the code of every function. Out: for each, whether one more call from it still fits; an error with the
path when the program itself does not.
"""

from __future__ import annotations

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.ir.function import Function
from servogen.errors import Place
from servogen.pic.device import STACK_LEVELS


def depths(codes: dict[str, Function]) -> dict[str, list[str]]:
    """The longest chain of calls below each function."""
    found: dict[str, list[str]] = {}

    def below(name: str) -> list[str]:
        if name not in found:
            found[name] = []
            chains = []
            calls = {ins.target: ins.op for ins in codes[name].instructions() if ins.op in ("CALL", "GOTO")}
            calls.update(dict.fromkeys(codes[name].also_calls, "CALL"))
            if codes[name].falls_into:
                calls[codes[name].falls_into] = "GOTO"
            for callee, op in calls.items():
                if callee in codes:
                    chains.append([callee, *below(callee)] if op == "CALL" else below(callee))
            found[name] = max(chains, key=len, default=[])
        return found[name]

    for name in codes:
        below(name)
    return found


def check_stack(codes: dict[str, Function], roots: list[str], reporter: Reporter) -> dict[str, bool]:
    """Report a program that calls too deep; say which functions have room for one more call."""
    room = room_for_calls(codes, roots)
    if room is None:
        chains = depths(codes)
        path = " → ".join([codes[roots[0]].falls_into, *chains[roots[0]]])
        also = (
            f", and the interrupt's {' → '.join(chains[roots[1]]) or 'own level'}" if len(roots) > 1 else ""
        )
        reporter.error(
            f"calls go {_total(chains, roots)} levels deep, "
            f"the chip's stack has {STACK_LEVELS}: {path}{also}",
            codes[codes[roots[0]].falls_into].place or Place(next(iter(reporter.texts), None)),
        )
    return room or {}


def _total(chains: dict[str, list[str]], roots: list[str]) -> int:
    """Levels that the program needs; the interrupt itself takes one."""
    return sum(len(chains[root]) for root in roots) + len(roots) - 1


def room_for_calls(codes: dict[str, Function], roots: list[str]) -> dict[str, bool] | None:
    """For each function that is reached, whether every way to it leaves a level of the stack; None when the
    program itself needs too many.
    """
    chains = depths(codes)
    spare = STACK_LEVELS - _total(chains, roots)
    if spare < 0:
        return None
    deepest: dict[str, int] = {}
    room: dict[str, bool] = {}
    for root in roots:
        limit = len(chains[root]) + spare
        waiting = [(root, 0)]
        while waiting:
            name, depth = waiting.pop()
            if depth <= deepest.get(name, -1):
                continue
            deepest[name] = depth
            room[name] = depth + 1 <= limit
            if codes[name].falls_into:
                waiting.append((codes[name].falls_into, depth))
            for ins in codes[name].instructions():
                if ins.op in ("CALL", "GOTO") and ins.target in codes and ins.target != name:
                    waiting.append((ins.target, depth + (ins.op == "CALL")))
    return room
