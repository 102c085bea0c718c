"""The depth of calls: the chip's stack has eight levels, and an interrupt takes one wherever main is.

In: the code of every function. Out: for each, whether one more call from it still fits; an error with the
path when the program itself does not.
"""

from __future__ import annotations

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.emitter import Code
from servogen.errors import Place
from servogen.pic.device import STACK_LEVELS


def depths(codes: dict[str, Code]) -> dict[str, list[str]]:
    """The longest chain of calls below each function."""
    found: dict[str, list[str]] = {}

    def below(name: str) -> list[str]:
        if name not in found:
            found[name] = []
            chains = []
            calls = {ins.target: ins.op for ins in codes[name].ins if ins.op in ("CALL", "GOTO")}
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


def check_stack(codes: dict[str, Code], roots: list[str], reporter: Reporter) -> dict[str, bool]:
    """Report a program that calls too deep; say which functions have room for one more call."""
    chains = depths(codes)
    levels = [len(chains[root]) for root in roots]
    total = sum(levels) + (len(roots) - 1)  # the interrupt itself takes a level
    if total > STACK_LEVELS:
        path = " → ".join([codes[roots[0]].falls_into, *chains[roots[0]]])
        also = (
            f", and the interrupt's {' → '.join(chains[roots[1]]) or 'own level'}" if len(roots) > 1 else ""
        )
        reporter.error(
            f"calls go {total} levels deep, the chip's stack has {STACK_LEVELS}: {path}{also}",
            Place(next(iter(reporter.texts), None)),
        )
        return {}
    spare = STACK_LEVELS - total
    room: dict[str, bool] = {}
    for root, level in zip(roots, levels, strict=True):
        _walk(root, 0, level + spare, codes, room)
    return room


def _walk(name: str, depth: int, limit: int, codes: dict[str, Code], room: dict[str, bool]) -> None:
    """A function has room where every way to it leaves a level."""
    fits = depth + 1 <= limit
    room[name] = room.get(name, True) and fits
    if codes[name].falls_into:
        _walk(codes[name].falls_into, depth, limit, codes, room)
    for ins in codes[name].ins:
        if ins.op in ("CALL", "GOTO") and ins.target in codes and ins.target != name:
            _walk(ins.target, depth + (ins.op == "CALL"), limit, codes, room)
