"""Bank switching: RP0 is set for the registers of bank 1 and cleared again behind them.

In: a function's instructions. Out: the same with BSF and BCF of RP0 where they are needed. A program that
switches by itself keeps its own switches, and none is added inside its bracket. Variables need none: RAM
is the same in both banks (DS35007 section 2.2). The code generator never puts a skip before or on a
register of bank 1.
"""

from __future__ import annotations

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


def switch_banks(code: Code) -> None:
    """Insert the switches."""
    ins = code.ins
    if not any(bank_needed(each) is not None and not each.fixed for each in ins):
        return
    state = _states(ins)
    out: list[Ins] = []
    number = 0
    while number < len(ins):
        each = ins[number]
        need = bank_needed(each)
        base = state[number] or 0
        if each.fixed or need is None or need == base:
            out.append(each)
            number += 1
            continue
        run = [each]
        number += 1
        while number < len(ins) and _joins(ins[number], need):
            run.append(ins[number])
            number += 1
        while bank_needed(run[-1]) is None:
            number -= 1
            run.pop()
        out += [_switch(need, each), *run, _switch(base, run[-1])]
    code.ins = out


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
            elif each.f == STATUS and each.writes_f and each.op in ("MOVWF", "CLRF"):
                bank = 0
            if each.op == "GOTO" and each.target in where:
                waiting.append((where[each.target], bank))
            if each.op in ENDS and not skipped:
                break
            number += 1
    return state
