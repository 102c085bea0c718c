"""Bank switching: RP0 is set for the registers of bank 1 and cleared again behind them.

In: a function's instructions. Out: the same with BSF and BCF of RP0 where they are needed. A program that
switches by itself keeps its own switches, and none is added inside its bracket. Variables need none: RAM
is the same in both banks (DS35007 section 2.2). The code generator never puts a skip before or on a
register of bank 1.
"""

from __future__ import annotations

from collections.abc import Mapping

from servogen.compiler.emitter import Code
from servogen.compiler.machine import ENDS, LABEL, RP0, SKIPS, STATUS, Ins, Reg
from servogen.pic.device import BOTH_BANKS, RAM_FIRST, RAM_LAST, registers

_COMMON = frozenset(registers()[name].address & 0x7F for name in BOTH_BANKS)


def bank_needed(ins: Ins) -> int | None:
    """The bank that an instruction's register lies in; None when it is in both."""
    if not isinstance(ins.f, Reg):
        return None
    low = ins.f.address & 0x7F
    if low in _COMMON or RAM_FIRST <= low <= RAM_LAST:
        return None
    return ins.f.address >> 7


def _own_switch(ins: Ins) -> int | None:
    """The bank that an instruction selects."""
    if ins.f == STATUS and ins.b == RP0 and ins.op in ("BSF", "BCF"):
        return int(ins.op == "BSF")
    return None


def banked(codes: Mapping[str, Code]) -> set[str]:
    """The functions that reach a register of one bank only, themselves or through what they call."""
    found = {name for name, code in codes.items() if any(bank_needed(ins) is not None for ins in code.ins)}
    grown = True
    while grown:
        more = {name for name, code in codes.items() if found & set(code.calls())} - found
        grown = bool(more)
        found |= more
    return found


def switch_banks(code: Code, reaching: set[str]) -> None:
    """Insert the switches; `reaching` names the functions before whose call bank 0 must be selected."""
    ins = code.ins
    state = _states(ins)
    out: list[Ins] = []
    behind: list[Ins] = []
    number = 0
    while number < len(ins):
        each = ins[number]
        need = 0 if each.op == "CALL" and each.target in reaching else bank_needed(each)
        base = state[number] or 0
        if each.fixed or need is None or need == base:
            out.append(each)
            number += 1
            continue
        if out and out[-1].op in SKIPS:
            skip = out.pop()
            out += [_switch(need, each), skip, each, _switch(base, each)]
            number += 1
            continue
        if each.op in SKIPS and number + 1 < len(ins):
            out += [
                _switch(need, each),
                each,
                _shadow(code, ins[number + 1], base, behind),
                _switch(base, each),
            ]
            number += 2
            continue
        run = [each]
        number += 1
        while each.op != "CALL" and number < len(ins) and _joins(ins[number], need):
            run.append(ins[number])
            number += 1
        while bank_needed(run[-1]) is None and run[-1].op != "CALL":
            number -= 1
            run.pop()
        out += [_switch(need, each), *run, _switch(base, run[-1])]
    code.ins = out + behind


def _shadow(code: Code, follower: Ins, base: int, behind: list[Ins]) -> Ins:
    """What follows a skip between two switches; a jump goes over a place that switches back first."""
    if follower.op != "GOTO":
        return follower
    label = f"{code.name}.bank{len(behind)}"
    behind += [Ins(LABEL, target=label), _switch(base, follower), follower]
    return Ins("GOTO", target=label, place=follower.place)


def _joins(ins: Ins, need: int) -> bool:
    """Whether an instruction may stand between the switches."""
    if not ins.real or ins.fixed or ins.op in SKIPS or ins.op in ENDS or ins.op in ("CALL", "DELAY"):
        return False
    return bank_needed(ins) in (None, need) and _own_switch(ins) is None


def _switch(bank: int, like: Ins) -> Ins:
    return Ins("BSF" if bank else "BCF", STATUS, b=RP0, place=like.place)


def _states(ins: list[Ins]) -> list[int | None]:
    """The bank that the program itself has selected before each instruction; None: not reached."""
    where = {each.target: number for number, each in enumerate(ins) if each.op == LABEL}
    state: list[int | None] = [None] * len(ins)
    waiting = [(0, 0)]
    while waiting:
        number, bank = waiting.pop()
        while number < len(ins) and state[number] is None:
            state[number] = bank
            each = ins[number]
            switched = _own_switch(each)
            skipped = number > 0 and ins[number - 1].op in SKIPS
            if switched is not None:
                bank = switched
            elif each.f == STATUS and each.op in ("MOVWF", "CLRF"):
                before = ins[number - 1]
                known = before.op == "MOVLW" and isinstance(before.k, int) and each.op == "MOVWF"
                bank = before.k >> RP0 & 1 if known and isinstance(before.k, int) else 0
            if each.op == "GOTO" and each.target in where:
                waiting.append((where[each.target], bank))
            if each.op in ENDS and not skipped:
                break
            number += 1
    return state
