"""Finds which private bytes are live at the same time, and merges copied bytes that are not.

In: a `Function`. Out: fewer copies.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import IN_PLACE, Byte, Instruction
from servogen.compiler.passes.liveness import Liveness, is_private


def interference(function: Function, live: Liveness) -> dict[Byte, int]:
    """Return, for each private byte, the bit set of the bytes that are live where it is written."""
    conflicts = dict.fromkeys(live.number, 0)
    for block in function.blocks:
        for before, ins in zip([None, *block.instructions], block.instructions, strict=False):
            after = live.after[ins]
            if ins.op == "CALL":
                _meet(conflicts, live, live.foreign, after)
            elif ins.writes_f and isinstance(ins.f, Byte) and ins.f in live.number:
                source = _copy_source(before, ins)
                others = after & ~live.bit(ins.f)
                # a copy and its source hold the same value: that both are live is no conflict yet
                if source is not None and source in live.number:
                    others &= ~live.bit(source)
                conflicts[ins.f] |= others
    # what is live on entry was written by the caller, all of it before the first instruction
    for byte in live.number:
        if live.entry & live.bit(byte):
            conflicts[byte] |= live.entry & ~live.bit(byte)
    by_bit = {live.bit(byte): byte for byte in live.number}
    for one, mask in list(conflicts.items()):
        while mask:
            lowest = mask & -mask
            mask ^= lowest
            two = by_bit.get(lowest)  # W and the flags have bits too
            if two is not None:
                conflicts[two] |= live.bit(one)
    return conflicts


def _meet(conflicts: dict[Byte, int], live: Liveness, changed: int, after: int) -> None:
    """Record that a call may change every byte of other functions while `after` is live."""
    for byte in live.number:
        if changed & live.bit(byte):
            conflicts[byte] |= (after | changed) & ~live.bit(byte)


def _copy_source(before: Instruction | None, ins: Instruction) -> Byte | None:
    """Return the byte that a MOVWF copies, if the preceding instruction in its block has just loaded it."""
    if before is None or ins.op != "MOVWF" or before.op != "MOVF" or before.d:
        return None
    return before.f if isinstance(before.f, Byte) else None


def _changed_source(before: Instruction, ins: Instruction) -> Byte | None:
    """Return the byte whose modified value a MOVWF stores, if it could be modified in place."""
    if ins.op == "MOVWF" and before.op in IN_PLACE and before.d == 0 and isinstance(before.f, Byte):
        return before.f
    return None


def coalesce_copies(function: Function) -> bool:
    """Merge a temporary with the byte that it is copied to or from, one pair per call; return whether one was
    merged.
    """
    live = Liveness(function)
    own = {id(symbol) for symbol in function.own}
    against: dict[Byte, int] | None = None
    for before, ins in _pairs(function):
        source = _copy_source(before, ins) or _changed_source(before, ins)
        if source is None or ins.fixed or before.fixed or source == ins.f:
            continue
        target = ins.f
        if not is_private(source) or not is_private(target) or not isinstance(target, Byte):
            continue
        if source.symbol.kind == "temp" and id(source.symbol) in own:
            merged, representative = source, target
        elif target.symbol.kind == "temp" and id(target.symbol) in own:
            merged, representative = target, source
        else:
            continue
        if against is None:
            against = interference(function, live)
        if against[merged] & live.bit(representative):
            continue
        if id(representative.symbol) not in own and not _safe_outside(function, live, merged, representative):
            continue
        for other in function.instructions():
            if other.f == merged:
                other.f = representative
        return True
    return False


def _pairs(function: Function) -> Iterator[tuple[Instruction, Instruction]]:
    """Yield adjacent instructions of a block."""
    for block in function.blocks:
        yield from pairwise(block.instructions)


def _safe_outside(function: Function, live: Liveness, merged: Byte, representative: Byte) -> bool:
    """Return whether a temporary may live in another function's byte.

    The frames of two functions that are called one after the other overlap: while a byte of one is still
    needed, nothing may be written to the other. What calls change is in `interference`.
    """
    own = {id(symbol) for symbol in function.own}
    others = 0
    for byte in live.number:
        if id(byte.symbol) not in own and byte.symbol.function != representative.symbol.function:
            others |= live.bit(byte)
    mask = live.bit(merged)
    for ins in function.instructions():
        if not ins.writes_f or not isinstance(ins.f, Byte) or ins.f not in live.number:
            continue
        if ins.f == merged and live.after[ins] & others:
            return False
        if live.bit(ins.f) & others and live.after[ins] & mask:
            return False
    return True
