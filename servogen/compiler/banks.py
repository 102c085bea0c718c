"""Bank switching: RP0 is set for the registers of bank 1 and cleared again behind them.

In: a function's instructions. Out: the same with BSF and BCF of RP0 where they are needed. A program that
switches by itself keeps its own switches, and none is added inside its bracket; a function that returns
without having switched back leaves its bank to its callers. Variables need none: RAM is the same in both
banks (DS35007 section 2.2). The code generator never puts a skip before or on a register of bank 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from servogen.compiler.emitter import Code
from servogen.compiler.machine import DELAY, ENDS, LABEL, RP0, SKIPS, STATUS, Ins, Reg
from servogen.pic.device import BOTH_BANKS, RAM_FIRST, RAM_LAST, registers

UNKNOWN = 2
"""One bank or the other, by the way that was taken."""
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


def _selects(ins: Ins) -> bool:
    """Whether it writes the whole of STATUS."""
    return ins.f == STATUS and ins.op in ("MOVWF", "CLRF")


def banked(codes: Mapping[str, Code]) -> set[str]:
    """The functions that need a bank or switch it, themselves or through what they call."""
    return _with_callers(
        codes, lambda ins: bank_needed(ins) is not None or _selects(ins) or _own_switch(ins) is not None
    )


def exit_banks(codes: Mapping[str, Code], reaching: set[str]) -> dict[str, int]:
    """The bank that a call leaves selected, for each function that switches and may return without having
    switched back. A call of any other function leaves the bank as it was.
    """
    switching = _with_callers(codes, lambda ins: _selects(ins) or _own_switch(ins) is not None)
    found: dict[str, int] = {}

    def visit(name: str) -> int:
        if name not in found:
            found[name] = 0  # what calls itself is refused elsewhere
            code = codes[name]
            for callee in code.calls():
                if callee in switching:
                    visit(callee)
            banks = _leaving(code, _states(code.ins, found), found, reaching)
            found[name] = banks.pop() if len(banks) == 1 else UNKNOWN if banks else 0
        return found[name]

    for name in switching:
        visit(name)
    return found


def _with_callers(codes: Mapping[str, Code], wanted: Callable[[Ins], bool]) -> set[str]:
    """The functions with such an instruction, and all that call or enter one of them."""
    found = {name for name, code in codes.items() if any(wanted(ins) for ins in code.ins)}
    grown = True
    while grown:
        more = {name for name, code in codes.items() if found & set(code.calls())} - found
        grown = bool(more)
        found |= more
    return found


def _leaving(code: Code, state: list[int | None], exits: Mapping[str, int], reaching: set[str]) -> set[int]:
    """The banks in which a function returns, or in which the function that it ends with does."""
    inside = {ins.target for ins in code.ins if ins.op == LABEL}
    found: set[int] = set()
    for ins, bank in zip(code.ins, state, strict=True):
        if bank is None:
            continue
        if ins.op in ("RETURN", "RETLW"):
            found.add(bank)
        elif ins.op == "GOTO" and ins.target not in inside:
            found.add(exits.get(ins.target, 0 if ins.target in reaching else bank))
    return found


def switch_banks(code: Code, reaching: set[str], exits: Mapping[str, int]) -> None:
    """Insert the switches.

    `reaching` names the functions before whose call bank 0 must be selected, `exits` the bank that those
    leave which switch by themselves.
    """
    ins = code.ins
    state = _states(ins, exits)
    out: list[Ins] = []
    behind: list[Ins] = []
    number = 0
    while number < len(ins):
        each = ins[number]
        enters = each.op in ("CALL", "GOTO") and each.target in reaching
        need = 0 if enters else bank_needed(each)
        base = state[number] or 0
        if each.fixed or need is None or need == base:
            out.append(each)
            number += 1
            continue
        if enters and (each.op == "GOTO" or each.target in exits):
            shadow = [out.pop()] if out and out[-1].op in SKIPS else []
            out += [_switch(need, each), *shadow, each]
            if shadow:
                out.append(_switch(base, each))
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
    code.ins = _without_needless(out + behind)


def _without_needless(ins: list[Ins]) -> list[Ins]:
    """Drop a switch of the compiler's behind which another comes before anything needs the bank."""
    out: list[Ins] = []
    bank: int | None = None
    for number, each in enumerate(ins):
        selected = _own_switch(each)
        if selected is None or each.fixed or (out and out[-1].op in SKIPS):
            if not _passes(each):
                bank = selected if each.fixed and not (out and out[-1].op in SKIPS) else None
        elif selected == bank or _is_overruled(ins, number):
            continue
        else:
            bank = selected
        out.append(each)
    return out


def _is_overruled(ins: list[Ins], number: int) -> bool:
    after = number + 1
    while after < len(ins) and _passes(ins[after]) and bank_needed(ins[after]) is None:
        after += 1
    return after < len(ins) and _own_switch(ins[after]) is not None


def _passes(ins: Ins) -> bool:
    """Whether an instruction neither changes the bank nor leads anywhere else."""
    leads = not ins.real or ins.op in SKIPS or ins.op in ENDS or ins.op in ("CALL", DELAY)
    return not leads and not _selects(ins) and _own_switch(ins) is None


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
    return Ins("BSF" if bank == 1 else "BCF", STATUS, b=RP0, place=like.place)


def _states(ins: list[Ins], exits: Mapping[str, int]) -> list[int | None]:
    """The bank that the program itself has selected before each instruction; None: not reached."""
    where = {each.target: number for number, each in enumerate(ins) if each.op == LABEL}
    state: list[int | None] = [None] * len(ins)
    waiting = [(0, 0)]
    while waiting:
        number, bank = waiting.pop()
        while number < len(ins):
            known = state[number]
            if known in (bank, UNKNOWN):
                break
            state[number] = bank = bank if known is None else UNKNOWN
            each = ins[number]
            skipped = number > 0 and ins[number - 1].op in SKIPS
            after = _bank_after(ins, number, bank, exits)
            if each.op == "GOTO" and each.target in where:
                waiting.append((where[each.target], bank))
            if each.op in ENDS and not skipped:
                break
            bank = UNKNOWN if skipped and after != bank else after
            number += 1
    return state


def _bank_after(ins: list[Ins], number: int, bank: int, exits: Mapping[str, int]) -> int:
    """The bank behind one instruction that was reached in `bank`."""
    each = ins[number]
    switched = _own_switch(each)
    if switched is not None:
        return switched
    if each.op == "CALL":
        return exits.get(each.target, bank)
    if _selects(each):
        before = ins[number - 1]
        known = before.op == "MOVLW" and isinstance(before.k, int) and each.op == "MOVWF"
        return before.k >> RP0 & 1 if known and isinstance(before.k, int) else 0
    return bank
