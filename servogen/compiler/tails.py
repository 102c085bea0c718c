"""The ends of things: a call before a return becomes a jump, equal code before one label is kept once.

In: a `Code` after the other passes. Out: fewer words, no more cycles.
"""

from __future__ import annotations

from servogen.compiler.emitter import Code
from servogen.compiler.machine import DELAY, ENDS, LABEL, SKIPS, Ins, Reg


def tail_calls(code: Code) -> None:
    """CALL f; RETURN becomes GOTO f: a word, two cycles and a level of the stack less."""
    for one, two in zip(code.ins, code.ins[1:], strict=False):
        if one.op == "CALL" and two.op == "RETURN" and not one.fixed and not two.fixed and one.table is None:
            one.op = "GOTO"


def merge_tails(code: Code) -> bool:
    """One pass over the jumps; true when one of them now goes to the beginning of what was the same."""
    ins = code.ins
    where = {each.target: at for at, each in enumerate(ins) if each.op == LABEL}
    jumps = [
        at for at, each in enumerate(ins) if each.op == "GOTO" and not each.fixed and not _in_shadow(ins, at)
    ]
    for number, at in enumerate(jumps):
        target = where.get(ins[at].target)
        if target is None:
            continue
        rivals = [other for other in jumps[:number] if ins[other].target == ins[at].target]
        before = target
        while before and ins[before - 1].op == LABEL:
            before -= 1
        if before and ins[before - 1].op not in ENDS:
            rivals.append(before)
        for rival in rivals:
            length = _common(ins, at, rival)
            if length and not _timed_run(ins, at - length, at):
                _merge(code, at, rival, length)
                return True
            if length and rival in jumps and not _timed_run(ins, rival - length, rival):
                _merge(code, rival, at, length)
                return True
    return False


def _timed_run(ins: list[Ins], first: int, last: int) -> bool:
    """Whether a run of instructions reaches a register and a delay runs into it without a branch: its
    distance to the delay is promised.
    """
    if not any(isinstance(each.f, Reg) or each.op == "CALL" for each in ins[first:last]):
        return False
    at = first
    while at:
        at -= 1
        if is_timed(ins[at]):
            return True
        if ins[at].op in ENDS or ins[at].op in SKIPS:
            return False
    return False


def is_timed(ins: Ins) -> bool:
    """A delay, constant or by a library routine."""
    return ins.op == DELAY or (ins.op in ("CALL", "GOTO") and ins.target.startswith("__delay"))


def _in_shadow(ins: list[Ins], at: int) -> bool:
    return at > 0 and ins[at - 1].op in SKIPS


def _common(ins: list[Ins], one: int, two: int) -> int:
    """How many instructions before two places are the same, with no skip into the first of them."""
    if abs(one - two) < 2:
        return 0
    length = 0
    best = 0
    while True:
        a, b = one - length - 1, two - length - 1
        if a < 0 or b < 0 or (two < one and a <= two) or (one < two and b <= one):
            break
        if not _same(ins[a], ins[b]):
            break
        length += 1
        if not _in_shadow(ins, a) and not _in_shadow(ins, b):
            best = length
    return best


def _same(one: Ins, two: Ins) -> bool:
    if one.op in (LABEL, DELAY) or one.op in ENDS or one.fixed or two.fixed:
        return False
    return (one.op, one.f, one.d, one.b, one.k, one.target) == (
        two.op,
        two.f,
        two.d,
        two.b,
        two.k,
        two.target,
    )


def _merge(code: Code, at: int, rival: int, length: int) -> None:
    """Drop the instructions before the jump `at`; it goes to their like before `rival`."""
    ins = code.ins
    name = f"{code.name}.tail{sum(each.op == LABEL for each in ins)}.{at}"
    label = Ins(LABEL, target=name, place=ins[at].place)
    ins[at].target = name
    start = rival - length
    if start < at:
        del ins[at - length : at]
        ins.insert(start, label)
    else:
        ins.insert(start, label)
        del ins[at - length : at]
