"""Small branches without their jumps.

In: a `Code` and its liveness. Out: a choice of two constants, or of two instructions, by skips alone; a loop
that counts down by DECFSZ.
"""

from __future__ import annotations

from collections import Counter

from servogen.compiler.emitter import Code
from servogen.compiler.liveness import W_BIT, Z_BIT, Liveness
from servogen.compiler.machine import DELAY, ENDS, LABEL, SKIPS, STATUS, Byte, Ins, Z

_TESTS = {"BTFSC": "BTFSS", "BTFSS": "BTFSC"}
_COUNTS = {"DECF": "DECFSZ", "INCF": "INCFSZ"}


def short_branches(code: Code) -> bool:
    """One pass; true when something changed."""
    ins = code.ins
    named = Counter(each.target for each in ins if each.op in ("GOTO", "CALL"))
    for at in range(len(ins) - 2):
        if at and ins[at - 1].op in SKIPS:
            continue
        found = _choice(ins, at, named)
        if found is not None:
            new, behind = found
            for each in new:
                each.place = each.place or ins[at].place
            code.ins = [*ins[:at], *new, *ins[behind:]]
            return True
    return _count_down(code)


def _choice(ins: list[Ins], at: int, named: Counter[str]) -> tuple[list[Ins], int] | None:
    """BTFSS b; GOTO no; yes; GOTO end; no: other; end: as skips alone, and the index behind it."""
    if at + 5 >= len(ins):
        return None
    test, jump, yes, leave, label, other = ins[at : at + 6]
    shape = test.op in _TESTS and jump.op == leave.op == "GOTO" and label.op == LABEL
    if not shape or label.target != jump.target or named[label.target] != 1:
        return None
    if any(each.fixed for each in (test, jump, yes, leave, label, other)):
        return None
    behind = at + 6
    if behind < len(ins) and ins[behind].op == "GOTO" and ins[behind].target == leave.target:
        pass
    elif not _leads_to(ins, behind, leave.target):
        return None
    if yes.op == other.op == "MOVLW":
        return [other.copy(), _turned(test), yes.copy()], behind
    if _stays(test, yes) and _stays(test, other):
        return [test.copy(), other.copy(), _turned(test), yes.copy()], behind
    return None


def _turned(test: Ins) -> Ins:
    found = test.copy()
    found.op = _TESTS[test.op]
    return found


def _stays(test: Ins, ins: Ins) -> bool:
    """Whether a bit can be tested again behind an instruction that may be skipped."""
    if not isinstance(test.f, Byte) or test.f.symbol.volatile:
        return False
    if ins.op in (LABEL, DELAY, "CALL", "ORG") or ins.op in ENDS or ins.op in SKIPS:
        return False
    return not ins.writes_f or (ins.op in ("BCF", "BSF", "CLRF") and _apart(ins, test))


def _apart(one: Ins, two: Ins) -> bool:
    """Whether two instructions surely name different bytes: a pointer may lead anywhere."""
    if isinstance(one.f, Byte):
        return one.f != two.f and "fixed" not in (one.f.symbol.kind, two.f.symbol.kind)  # type: ignore[union-attr]
    return one.f is not None and one.f.address & 0x7F > 4


def _leads_to(ins: list[Ins], at: int, label: str) -> bool:
    while at < len(ins) and ins[at].op == LABEL:
        if ins[at].target == label:
            return True
        at += 1
    return False


def _count_down(code: Code) -> bool:
    """DECF n,F; BTFSS STATUS,Z; GOTO again: DECFSZ n,F; GOTO again; a MOVF n between is not needed."""
    ins = code.ins
    live = Liveness(code)
    for at, count in enumerate(ins[:-2]):
        if count.op not in _COUNTS or count.d != 1 or count.fixed or (at and ins[at - 1].op in SKIPS):
            continue
        test = at + 1
        again = ins[test]
        if again.op == "MOVF" and again.f == count.f and not again.fixed and isinstance(again.f, Byte):
            if again.f.symbol.volatile or live.after[test] & W_BIT:
                continue
            test += 1
        if test + 1 >= len(ins) or ins[test].fixed or ins[test + 1].fixed or ins[test + 1].op != "GOTO":
            continue
        if (ins[test].op, ins[test].f, ins[test].b) != ("BTFSS", STATUS, Z) or live.after[test] & Z_BIT:
            continue
        made = Ins(_COUNTS[count.op], count.f, 1, place=count.place)
        code.ins = [*ins[:at], made, *ins[test + 1 :]]
        return True
    return False
