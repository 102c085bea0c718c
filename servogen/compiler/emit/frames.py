"""The frame of a function: the offsets of its variables.

In: a `Function`. Out: offsets; variables that are never live at the same time share a place.
"""

from __future__ import annotations

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Byte
from servogen.compiler.passes.copy_coalescing import interference
from servogen.compiler.passes.liveness import Liveness


def frame(function: Function) -> tuple[dict[Symbol, int], int]:
    """Return the offsets of a function's variables in its frame, and the frame's size, which is the first
    free offset.
    """
    conflicts = symbol_conflicts(function)
    offsets: dict[Symbol, int] = {}
    # the largest first: small ones fit into the gaps that large ones leave
    for symbol in sorted(conflicts, key=lambda symbol: -symbol.size):
        busy = {
            offsets[other] + index
            for other in conflicts[symbol]
            if other in offsets
            for index in range(other.size)
        }
        offset = 0
        while any(offset + index in busy for index in range(symbol.size)):
            offset += 1
        offsets[symbol] = offset
    return offsets, max((offset + symbol.size for symbol, offset in offsets.items()), default=0)


def symbol_conflicts(function: Function) -> dict[Symbol, set[Symbol]]:
    """Return, for each used variable of a function, the others that must not share its place."""
    live = Liveness(function)
    used: dict[Symbol, None] = {}
    for parameter in [*function.parameters, function.w_parameter]:
        if parameter is not None and parameter in function.own:
            used[parameter] = None
    if function.result is not None and function.result in function.own:
        used[function.result] = None
    for ins in function.instructions():
        if isinstance(ins.f, Byte) and ins.f.symbol.kind in ("local", "param", "result", "temp"):
            used[ins.f.symbol] = None
        if isinstance(ins.k, AddressByte) and ins.k.symbol.kind in ("local", "param", "result", "temp"):
            used[ins.k.symbol] = None
    own = [symbol for symbol in used if symbol in set(function.own)]
    conflicts: dict[Symbol, set[Symbol]] = {symbol: set() for symbol in own}
    # assembly may use its variables in an order that liveness does not see, and routines are written by hand
    if function.inline_asm or function.name.startswith("__"):
        return {symbol: {other for other in own if other is not symbol} for symbol in own}
    for byte, mask in interference(function, live).items():
        if byte.symbol not in conflicts:
            continue
        for other in live.number:
            if other.symbol is not byte.symbol and other.symbol in conflicts and mask & live.bit(other):
                conflicts[byte.symbol].add(other.symbol)
                conflicts[other.symbol].add(byte.symbol)
    for variable in own:
        everywhere = variable.pinned or variable.volatile
        for rival in own:
            if rival is not variable and (
                everywhere or (variable in function.parameters and rival in function.parameters)
            ):
                conflicts[variable].add(rival)
                conflicts[rival].add(variable)
    return conflicts
