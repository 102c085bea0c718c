"""Which private bytes are alive together; copies between bytes that are not become one byte.

In: a `Code`. Out: fewer copies; and, for the RAM layout, the sets of variables that may share a place.
"""

from __future__ import annotations

from servogen.compiler.emitter import Code
from servogen.compiler.liveness import Liveness, is_private
from servogen.compiler.machine import IN_PLACE, LABEL, SKIPS, Byte, Ins
from servogen.compiler.tree import Symbol


def interference(code: Code, live: Liveness) -> dict[Byte, int]:
    """For each private byte, the bit set of the bytes that are alive where it is written."""
    found = dict.fromkeys(live.number, 0)
    for at, ins in enumerate(code.ins):
        after = live.after[at]
        if ins.op == "CALL":
            _meet(found, live, live.foreign, after)
        elif ins.writes_f and isinstance(ins.f, Byte) and ins.f in live.number:
            source = _copy_source(code.ins, at)
            others = after & ~live.bit(ins.f)
            if source is not None and source in live.number:
                others &= ~live.bit(source)
            found[ins.f] |= others
    entry = live.before[0] if live.before else 0
    for byte in live.number:
        if entry & live.bit(byte):
            found[byte] |= entry & ~live.bit(byte)
    by_bit = {live.bit(byte): byte for byte in live.number}
    for one, mask in list(found.items()):
        while mask:
            lowest = mask & -mask
            mask ^= lowest
            two = by_bit.get(lowest)  # W and the flags have bits too
            if two is not None:
                found[two] |= live.bit(one)
    return found


def _meet(found: dict[Byte, int], live: Liveness, changed: int, after: int) -> None:
    """A call may change every byte of other functions while `after` is alive."""
    for byte in live.number:
        if changed & live.bit(byte):
            found[byte] |= (after | changed) & ~live.bit(byte)


def _copy_source(ins: list[Ins], at: int) -> Byte | None:
    """The byte that a MOVWF copies, when the instruction before has just loaded it, and was not skipped."""
    if at == 0 or ins[at].op != "MOVWF" or ins[at - 1].op != "MOVF" or ins[at - 1].d:
        return None
    before = at - 2
    while before >= 0 and ins[before].op == LABEL:
        before -= 1
    loaded = ins[at - 1].f
    if before >= 0 and ins[before].op in SKIPS:
        return None
    return loaded if isinstance(loaded, Byte) else None


def _changed_source(ins: list[Ins], at: int) -> Byte | None:
    """The byte of which a MOVWF stores what the instruction before has made: it could be changed in place."""
    before = ins[at - 1]
    if ins[at].op == "MOVWF" and before.op in IN_PLACE and before.d == 0 and isinstance(before.f, Byte):
        return before.f
    return None


def coalesce(code: Code) -> bool:
    """Give a temporary and the byte that it is copied to (or from) one place, one pair a call."""
    live = Liveness(code)
    own = {id(symbol) for symbol in code.own}
    against: dict[Byte, int] | None = None
    for at in range(1, len(code.ins)):
        ins = code.ins[at]
        source = _copy_source(code.ins, at) or _changed_source(code.ins, at)
        if source is None or ins.fixed or code.ins[at - 1].fixed or source == ins.f:
            continue
        target = ins.f
        if not is_private(source) or not is_private(target) or not isinstance(target, Byte):
            continue
        if source.symbol.kind == "temp" and id(source.symbol) in own:
            gone, kept = source, target
        elif target.symbol.kind == "temp" and id(target.symbol) in own:
            gone, kept = target, source
        else:
            continue
        if against is None:
            against = interference(code, live)
        if against[gone] & live.bit(kept):
            continue
        if id(kept.symbol) not in own and not _safe_outside(code, live, gone, kept):
            continue
        for each in code.ins:
            if each.f == gone:
                each.f = kept
        return True
    return False


def _safe_outside(code: Code, live: Liveness, gone: Byte, kept: Byte) -> bool:
    """Whether a temporary may live in another function's byte.

    The frames of two functions that are called one after the other overlap: while a byte of one is wanted,
    nothing may be written into the other.
    """
    own = {id(symbol) for symbol in code.own}
    others = 0
    for byte in live.number:
        if id(byte.symbol) not in own and byte.symbol.function != kept.symbol.function:
            others |= live.bit(byte)
    mask = live.bit(gone)
    for at, ins in enumerate(code.ins):
        if ins.op == "CALL" and live.after[at] & mask:
            return False
        if not ins.writes_f or not isinstance(ins.f, Byte) or ins.f not in live.number:
            continue
        if ins.f == gone and live.after[at] & others:
            return False
        if live.bit(ins.f) & others and live.after[at] & mask:
            return False
    return True


def frame(code: Code) -> tuple[dict[Symbol, int], int]:
    """Offsets of a function's variables in its frame, and the frame's size: the first place that is free."""
    conflicts = symbol_conflicts(code)
    offsets: dict[Symbol, int] = {}
    for symbol in sorted(conflicts, key=lambda each: -each.size):
        busy = {
            offsets[other] + each
            for other in conflicts[symbol]
            if other in offsets
            for each in range(other.size)
        }
        at = 0
        while any(at + each in busy for each in range(symbol.size)):
            at += 1
        offsets[symbol] = at
    return offsets, max((at + symbol.size for symbol, at in offsets.items()), default=0)


def symbol_conflicts(code: Code) -> dict[Symbol, set[Symbol]]:
    """For each variable of a function that is used, the others that must not share its place."""
    live = Liveness(code)
    used: dict[Symbol, None] = {}
    for parameter in [*code.parameters, code.w_parameter]:
        if parameter is not None and parameter in code.own:
            used[parameter] = None
    if code.result is not None and code.result in code.own:
        used[code.result] = None
    for ins in code.ins:
        if isinstance(ins.f, Byte) and ins.f.symbol.kind in ("local", "param", "result", "temp"):
            used[ins.f.symbol] = None
        symbol = getattr(ins.k, "symbol", None)
        if isinstance(symbol, Symbol) and symbol.kind in ("local", "param", "result", "temp"):
            used[symbol] = None
    own = [symbol for symbol in used if symbol in set(code.own)]
    conflicts: dict[Symbol, set[Symbol]] = {symbol: set() for symbol in own}
    if code.inline_asm or code.name.startswith("__"):
        return {symbol: {each for each in own if each is not symbol} for symbol in own}
    for byte, mask in interference(code, live).items():
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
                everywhere or (variable in code.parameters and rival in code.parameters)
            ):
                conflicts[variable].add(rival)
                conflicts[rival].add(variable)
    return conflicts
