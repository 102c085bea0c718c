"""The depth of calls: the chip's stack has eight levels, and an interrupt takes one wherever main is.

In: the code of every function. Out: for each function, whether one more call from it still fits; an error
with the call path if the program itself does not fit.
"""

from __future__ import annotations

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import TARGETED
from servogen.errors import Location
from servogen.pic.device import STACK_LEVELS


def depths(functions: dict[str, Function]) -> dict[str, list[str]]:
    """Return the longest chain of calls below each function."""
    deepest: dict[str, list[str]] = {}

    def below(name: str) -> list[str]:
        if name not in deepest:
            deepest[name] = []
            chains = []
            calls = {ins.target: ins.op for ins in functions[name].instructions() if ins.op in TARGETED}
            calls.update(dict.fromkeys(functions[name].also_calls, "CALL"))
            calls.update(dict.fromkeys(functions[name].also_jumps_to, "GOTO"))
            if functions[name].falls_into:
                calls[functions[name].falls_into] = "GOTO"
            for callee, op in calls.items():
                if callee in functions:
                    # a GOTO into a function pushes nothing: the callee returns in its place
                    chains.append([callee, *below(callee)] if op == "CALL" else below(callee))
            deepest[name] = max(chains, key=len, default=[])
        return deepest[name]

    for name in functions:
        below(name)
    return deepest


def check_stack(functions: dict[str, Function], roots: list[str], reporter: Reporter) -> dict[str, bool]:
    """Report a program whose calls are nested too deep, and return which functions have room for one more
    call.
    """
    room = room_for_calls(functions, roots)
    if room is None:
        chains = depths(functions)
        path = " → ".join([functions[roots[0]].falls_into, *chains[roots[0]]])
        also = (
            f", and the interrupt's {' → '.join(chains[roots[1]]) or 'own level'}" if len(roots) > 1 else ""
        )
        reporter.error(
            "c-call-depth",
            f"calls are nested {_total(chains, roots)} levels deep, "
            f"the chip's stack has {STACK_LEVELS}: {path}{also}",
            functions[functions[roots[0]].falls_into].place or Location(next(iter(reporter.texts), None)),
        )
    return room or {}


def _total(chains: dict[str, list[str]], roots: list[str]) -> int:
    """Return the number of levels that the program needs; the interrupt itself takes one."""
    return sum(len(chains[root]) for root in roots) + len(roots) - 1


def room_for_calls(functions: dict[str, Function], roots: list[str]) -> dict[str, bool] | None:
    """Return, for each function that is reached, whether every call path to it leaves a level of the stack
    free; None if the program itself needs too many.
    """
    chains = depths(functions)
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
            if functions[name].falls_into:
                waiting.append((functions[name].falls_into, depth))
            for ins in functions[name].instructions():
                if ins.op in TARGETED and ins.target in functions and ins.target != name:
                    waiting.append((ins.target, depth + (ins.op == "CALL")))
    return room
