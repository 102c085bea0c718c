"""Short sequences that have a shorter form.

In: a `Code` and its liveness. Out: an operation on a byte in place instead of through W, CLRF for a stored
zero, one skip instead of a skip and two jumps.
"""

from __future__ import annotations

from servogen.compiler.emitter import Code
from servogen.compiler.liveness import C_BIT, D_BIT, W_BIT, Z_BIT, Liveness, is_private
from servogen.compiler.machine import IN_PLACE, LABEL, SKIPS, Ins, exposed

_COUNTS: dict[object, str] = {1: "INCF", 0xFF: "DECF"}
"""By the constant that is added."""
_COMMUTING = {"ADDLW": "ADDWF", "ANDLW": "ANDWF", "IORLW": "IORWF", "XORLW": "XORWF"}


def peephole(code: Code) -> bool:
    """One pass; true when something changed."""
    live = Liveness(code)
    ins = code.ins
    out: list[Ins] = []
    at = 0
    changed = False
    while at < len(ins):
        shadow = bool(out) and out[-1].op in SKIPS
        if not shadow:
            found = _match(ins, at, live)
            if found is not None:
                new, count = found
                for each in new:
                    each.place = ins[at].place
                out += new
                at += count
                changed = True
                continue
        out.append(ins[at])
        at += 1
    code.ins = out
    return changed


def _match(ins: list[Ins], at: int, live: Liveness) -> tuple[list[Ins], int] | None:
    one = ins[at]
    two = ins[at + 1] if at + 1 < len(ins) else None
    if two is None or one.fixed or two.fixed:
        return None
    after_two = live.after[at + 1]
    if two.op == "MOVWF" and not after_two & W_BIT:
        if one.op in IN_PLACE and one.d == 0 and one.f == two.f:
            return [Ins(one.op, one.f, 1)], 2
        if one.op == "MOVLW" and one.k == 0 and not after_two & Z_BIT:
            return [Ins("CLRF", two.f)], 2
        copied = one.op == "MOVF" and one.d == 0 and one.f == two.f
        if copied and not exposed(one.f) and not after_two & Z_BIT:
            return [], 2
    if not after_two & (C_BIT | D_BIT):
        if one.op == "MOVLW" and one.k in _COUNTS and two.op == "ADDWF" and not (two.d and after_two & W_BIT):
            return [Ins(_COUNTS[one.k], two.f, two.d)], 2
        if one.op == "MOVF" and one.d == 0 and two.op == "ADDLW" and two.k in _COUNTS:
            return [Ins(_COUNTS[two.k], one.f)], 2
    if one.op == "MOVLW" and two.op == "RETURN":
        return [Ins("RETLW", k=one.k)], 2
    three = ins[at + 2] if at + 2 < len(ins) else None
    if three is not None and not three.fixed and _swaps(one, two, three):
        held = live.bit(one.f)  # type: ignore[arg-type]
        if not live.after[at + 2] & held:
            return [Ins(three.op, two.f, 0)], 3
    if three is not None and not three.fixed and three.op == "MOVWF" and not live.after[at + 2] & W_BIT:
        if one.op == "MOVF" and one.d == 0 and one.f == three.f and two.op in _COMMUTING:
            return [Ins("MOVLW", k=two.k), Ins(_COMMUTING[two.op], one.f, 1)], 3
        if (
            one.op == "MOVF"
            and one.d == 0
            and two.f == three.f
            and two.op in _COMMUTING.values()
            and two.d == 0
        ):
            return [one, Ins(two.op, two.f, 1)], 3
        if (
            one.op == "MOVF"
            and one.d == 0
            and one.f == three.f
            and two.op in _COMMUTING.values()
            and two.d == 0
            and two.f != one.f
        ):
            return [Ins("MOVF", two.f, 0), Ins(two.op, one.f, 1)], 3
    return _flags(ins, at)


def _swaps(one: Ins, two: Ins, three: Ins) -> bool:
    """MOVWF t; MOVF x,W; XORWF t,W: the same as XORWF x,W where t is not needed any more."""
    return (
        one.op == "MOVWF"
        and is_private(one.f)
        and (two.op, two.d) == ("MOVF", 0)
        and two.f != one.f
        and three.op in _COMMUTING.values()
        and (three.f, three.d) == (one.f, 0)
    )


def _flags(ins: list[Ins], at: int) -> tuple[list[Ins], int] | None:
    """IORLW 0 behind what has set Z already; MOVF x,W only for Z."""
    one, two = ins[at], ins[at + 1]
    if (
        two.op == "IORLW"
        and two.k == 0
        and "Z" in one.flags
        and one.d == 0
        and one.writes_w
        and one.op != "CALL"
    ):
        return [one], 2
    return None


def invert_skips(code: Code) -> bool:
    """BTFSC x; GOTO a; GOTO b; a: becomes BTFSS x; GOTO b; a:"""
    ins = code.ins
    for at in range(len(ins) - 3):
        one, two, three, four = ins[at : at + 4]
        if (
            one.op in ("BTFSC", "BTFSS")
            and two.op == three.op == "GOTO"
            and not (one.fixed or two.fixed or three.fixed)
            and four.op == LABEL
            and not (at and ins[at - 1].op in SKIPS)
            and _label_follows(ins, at + 3, two.target)
        ):
            one.op = "BTFSS" if one.op == "BTFSC" else "BTFSC"
            del ins[at + 1]
            return True
    return False


def _label_follows(ins: list[Ins], at: int, name: str) -> bool:
    while at < len(ins) and ins[at].op == LABEL:
        if ins[at].target == name:
            return True
        at += 1
    return False
