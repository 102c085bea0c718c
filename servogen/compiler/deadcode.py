"""Drops instructions whose results nobody needs, and forms that write both W and a byte in one.

In: a `Code` and its liveness. Out: fewer instructions with the same effect.
"""

from __future__ import annotations

from servogen.compiler.emitter import Code
from servogen.compiler.liveness import FLAG_BITS, W_BIT, Liveness, is_private
from servogen.compiler.machine import LABEL, SKIPS, STATUS, Byte, Ins

_FLAG_LETTERS = {"C": FLAG_BITS[0], "D": FLAG_BITS[1], "Z": FLAG_BITS[2]}
_PURE = frozenset(
    [
        "MOVF",
        "MOVWF",
        "MOVLW",
        "CLRF",
        "CLRW",
        "ADDWF",
        "ANDWF",
        "IORWF",
        "XORWF",
        "SUBWF",
        "INCF",
        "DECF",
        "COMF",
        "RLF",
        "RRF",
        "SWAPF",
        "ADDLW",
        "ANDLW",
        "IORLW",
        "XORLW",
        "SUBLW",
        "BCF",
        "BSF",
    ]
)


def drop_dead(code: Code) -> bool:
    """Remove what has no use. True when something changed."""
    live = Liveness(code)
    dead: set[int] = set()
    changed = False
    for at, ins in enumerate(code.ins):
        if ins.fixed or ins.op not in _PURE:
            continue
        needed = live.after[at]
        if _flags_needed(ins, needed):
            continue
        if _writes_dead(ins, live, needed):
            if _observable_read(ins):
                continue
            dead.add(at)
    for at, ins in enumerate(code.ins):
        if at in dead or ins.fixed or ins.d != 1 or not is_private(ins.f) or ins.op not in _PURE:
            continue
        needed = live.after[at]
        if ins.op != "MOVF" and not needed & live.bit(ins.f) and not needed & W_BIT:  # type: ignore[arg-type]
            ins.d = 0  # only its flags are wanted
            changed = True
    if dead:
        remove(code, dead, live)
        changed = True
    return changed


def _flags_needed(ins: Ins, needed: int) -> bool:
    if ins.f == STATUS:
        return True
    return any(needed & _FLAG_LETTERS[letter] for letter in ins.flags)


def _writes_dead(ins: Ins, live: Liveness, needed: int) -> bool:
    """Whether W or the byte that it writes is not needed."""
    if ins.writes_f:
        return is_private(ins.f) and not needed & live.bit(ins.f)  # type: ignore[arg-type]
    return ins.writes_w and not needed & W_BIT


def _observable_read(ins: Ins) -> bool:
    """Reading a register or a volatile variable is kept."""
    if not ins.reads_f or ins.f is None:
        return False
    return not isinstance(ins.f, Byte) or ins.f.symbol.volatile


def remove(code: Code, dead: set[int], live: Liveness | None = None) -> None:
    """Take instructions out; a skip whose instruction goes, goes with it, or both stay."""
    ins = code.ins
    gone = set(dead)
    for at in sorted(dead):
        before = _previous(ins, at)
        if before is None or ins[before].op not in SKIPS or before in gone:
            continue
        outer = _previous(ins, before)
        nested = outer is not None and ins[outer].op in SKIPS
        simple = ins[before].op in ("BTFSC", "BTFSS")
        if ins[before].fixed or (nested and ins[outer].op not in ("BTFSC", "BTFSS")):  # type: ignore[index]
            gone.discard(at)
        elif simple and not nested:
            gone.add(before)
        elif nested and (simple or (ins[before].d == 0 and live is not None and not live.after[at] & W_BIT)):
            gone |= {before, outer}  # type: ignore[arg-type]
        else:
            gone.discard(at)
    code.ins = [each for at, each in enumerate(ins) if at not in gone]


def _previous(ins: list[Ins], at: int) -> int | None:
    at -= 1
    while at >= 0 and ins[at].op == LABEL:
        at -= 1
    return at if at >= 0 else None
