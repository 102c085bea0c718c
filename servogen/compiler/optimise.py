"""Optimisation of one function's instructions.

In: a `Code`. Out: the same, smaller. User assembly is never touched.
"""

from __future__ import annotations

from servogen.compiler.branches import short_branches
from servogen.compiler.coalesce import coalesce
from servogen.compiler.deadcode import drop_dead
from servogen.compiler.emitter import Code
from servogen.compiler.machine import ENDS, LABEL, SKIPS, Ins
from servogen.compiler.peephole import invert_skips, peephole
from servogen.compiler.tails import merge_tails, tail_calls
from servogen.compiler.values import Tracker


def optimise(code: Code) -> None:
    """Run the passes until nothing changes. Library routines are written by hand and only lose unused
    jumps.
    """
    data = not code.name.startswith("__") and not _jumps_by_hand(code)
    for _ in range(60):
        before = [(ins.op, ins.f, ins.d, ins.b, ins.k, ins.target) for ins in code.ins]
        thread_jumps(code)
        drop_unreachable(code)
        drop_jumps_to_next(code)
        invert_skips(code)
        if data:
            Tracker(code).run()
            drop_dead(code)
            peephole(code)
            short_branches(code)
            coalesce(code)
        if before == [(ins.op, ins.f, ins.d, ins.b, ins.k, ins.target) for ins in code.ins]:
            if data and merge_tails(code):
                continue
            break
    if data and code.name != "main":
        tail_calls(code)
        drop_unreachable(code)


def _jumps_by_hand(code: Code) -> bool:
    """Whether assembly in it jumps, so that its flow is not known."""
    return code.inline_asm and any(
        ins.fixed and ins.op in ("GOTO", "CALL", "RETURN", "RETLW", "RETFIE", *SKIPS) for ins in code.ins
    )


def _after(ins: list[Ins], start: int) -> int:
    """The index of the first instruction at or after `start` that is not a label."""
    while start < len(ins) and ins[start].op == LABEL:
        start += 1
    return start


def thread_jumps(code: Code) -> None:
    """A jump to a jump goes where that goes; a jump to RETURN returns."""
    ins = code.ins
    where = {each.target: number for number, each in enumerate(ins) if each.op == LABEL}
    for each in ins:
        if each.op != "GOTO" or each.fixed:
            continue
        for _ in range(10):
            at = where.get(each.target)
            if at is None:
                break
            at = _after(ins, at)
            if at >= len(ins):
                break
            target = ins[at]
            if (
                target.op == "GOTO"
                and not target.fixed
                and target.target != each.target
                and target is not each
            ):
                each.target = target.target
            elif target.op in ("RETURN", "RETFIE") and not target.fixed:
                each.op, each.target = target.op, ""
                break
            else:
                break


def drop_unreachable(code: Code) -> None:
    """Instructions that nothing reaches, and labels that nothing names. Assembly is taken as reached."""
    ins = code.ins
    where = {each.target: number for number, each in enumerate(ins) if each.op == LABEL}
    reached = [each.fixed for each in ins]
    waiting = [0, *(number + 1 for number, each in enumerate(ins) if each.fixed)]
    while waiting:
        at = waiting.pop()
        first = True
        while at < len(ins) and (first or not reached[at]):
            first = False
            reached[at] = True
            each = ins[at]
            if each.op == "GOTO" and each.target in where and not reached[where[each.target]]:
                waiting.append(where[each.target])
            before = _before(ins, at)
            if each.op in ENDS and not (before is not None and ins[before].op in SKIPS):
                break
            at += 1
    used = {
        each.target for each, here in zip(ins, reached, strict=True) if here and each.op in ("GOTO", "CALL")
    }
    code.ins = [
        each
        for each, here in zip(ins, reached, strict=True)
        if here and (each.op != LABEL or each.target in used or each.fixed)
    ]


def _before(ins: list[Ins], at: int) -> int | None:
    at -= 1
    while at >= 0 and ins[at].op == LABEL:
        at -= 1
    return at if at >= 0 else None


def drop_jumps_to_next(code: Code) -> None:
    """GOTO to what follows anyway; and a skip over a GOTO over one instruction becomes the opposite skip."""
    ins = code.ins
    out: list[Ins] = []
    number = 0
    while number < len(ins):
        each = ins[number]
        follower = ins[number + 1] if number + 1 < len(ins) else None
        if each.op == "GOTO" and not each.fixed and _leads_to(ins, number + 1, each.target):
            if not (out and out[-1].op in SKIPS):
                number += 1
                continue
            if out[-1].op in ("BTFSS", "BTFSC") and not out[-1].fixed:
                out.pop()
                number += 1
                continue
        if (
            each.op in ("BTFSS", "BTFSC")
            and not each.fixed
            and follower is not None
            and follower.op == "GOTO"
            and not follower.fixed
            and number + 2 < len(ins)
            and ins[number + 2].real
            and ins[number + 2].op not in SKIPS
            and not ins[number + 2].fixed
            and ins[number + 2].op != "DELAY"
            and _leads_to(ins, number + 3, follower.target)
        ) and not (out and out[-1].op in SKIPS):
            each.op = "BTFSC" if each.op == "BTFSS" else "BTFSS"
            out += [each, ins[number + 2]]
            number += 3
            continue
        out.append(each)
        number += 1
    code.ins = out


def _leads_to(ins: list[Ins], at: int, label: str) -> bool:
    while at < len(ins) and ins[at].op == LABEL:
        if ins[at].target == label:
            return True
        at += 1
    return False
