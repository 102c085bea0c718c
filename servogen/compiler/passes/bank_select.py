"""Bank switching: RP0 is set before accesses to registers of bank 1 and cleared after them.

In: a function's instructions. Out: the same with BSF and BCF of RP0 where they are needed. A program that
switches banks itself keeps its own switches, and none is added between them; a function that returns without
having switched back leaves its bank selected in its callers. Variables need no switches: RAM is the same in
both banks (DS35007 section 2.2). The code generator never puts a skip before or on a register of bank 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from servogen.compiler.ir.function import Block, Function, Line, is_skipped
from servogen.compiler.ir.instruction import (
    BIT_WRITES,
    DELAY,
    ENDS,
    RETURNS,
    RP0,
    STATUS,
    TARGETED,
    Instruction,
    Label,
    Reg,
)
from servogen.graph import reached
from servogen.pic.device import BOTH_BANKS, RAM_FIRST, RAM_LAST, addresses

UNKNOWN = 2
"""One bank or the other, by the way that was taken."""
_COMMON = frozenset(addresses(*BOTH_BANKS))


def bank_needed(ins: Instruction) -> int | None:
    """Return the bank that an instruction's register is in; None if it is in both."""
    if not isinstance(ins.f, Reg):
        return None
    low = ins.f.address & 0x7F
    if low in _COMMON or RAM_FIRST <= low <= RAM_LAST:
        return None
    return ins.f.address >> 7


def _own_switch(ins: Instruction) -> int | None:
    """Return the bank that an instruction of the program selects."""
    if ins.f == STATUS and ins.b == RP0 and ins.op in BIT_WRITES:
        return int(ins.op == "BSF")
    return None


def _selects(ins: Instruction) -> bool:
    """Return whether an instruction replaces the whole of STATUS, whatever it held."""
    return ins.f == STATUS and ins.writes_f and not ins.reads_f


def banked(functions: Mapping[str, Function]) -> set[str]:
    """Return the functions that need a bank or switch it, themselves or through the functions that they
    call.
    """
    return _with_callers(
        functions, lambda ins: bank_needed(ins) is not None or _selects(ins) or _own_switch(ins) is not None
    )


def exit_banks(functions: Mapping[str, Function], reaching: set[str]) -> dict[str, int]:
    """Return the bank that a call leaves selected, for each function that switches banks and may return
    without having switched back. A call of any other function leaves the bank as it was.
    """
    switching = _with_callers(functions, lambda ins: _selects(ins) or _own_switch(ins) is not None)
    left: dict[str, int] = {}

    def visit(name: str) -> int:
        if name not in left:
            left[name] = 0  # recursion is reported elsewhere
            function = functions[name]
            for callee in function.calls():
                if callee in switching:
                    visit(callee)
            banks = _leaving(function, _banks(function, left), left, reaching)
            left[name] = banks.pop() if len(banks) == 1 else UNKNOWN if banks else 0
        return left[name]

    for name in switching:
        visit(name)
    return left


def _with_callers(functions: Mapping[str, Function], wanted: Callable[[Instruction], bool]) -> set[str]:
    """Return the functions that contain such an instruction, and all that call or enter one of them."""
    containing = [
        name for name, function in functions.items() if any(wanted(ins) for ins in function.instructions())
    ]
    calls = {name: function.calls() for name, function in functions.items()}
    return set(reached(containing, lambda called: [name for name in calls if called in calls[name]]))


def _leaving(
    function: Function, banks: Mapping[Instruction, int], exits: Mapping[str, int], reaching: set[str]
) -> set[int]:
    """Return the banks in which a function returns, including through a function that it ends with."""
    inside = function.by_label()
    at_returns: set[int] = set()
    for ins, bank in banks.items():
        if ins.op in RETURNS and ins.op != "RETFIE":
            at_returns.add(bank)
        elif ins.op == "GOTO" and ins.target not in inside:
            at_returns.add(exits.get(ins.target, 0 if ins.target in reaching else bank))
    return at_returns


def switch_banks(function: Function, reaching: set[str], exits: Mapping[str, int]) -> bool:
    """Insert the switches; return whether there are any.

    `reaching` names the functions that must be called with bank 0 selected, `exits` gives the bank left
    selected by functions that switch it themselves.
    """
    banks = _banks(function, exits)
    lines = list(function.lines())
    out: list[Line] = []
    behind: list[Line] = []
    number = 0
    while number < len(lines):
        line = lines[number]
        number += 1
        if isinstance(line, Label):
            out.append(line)
            continue
        enters = line.op in TARGETED and line.target in reaching
        need = 0 if enters else bank_needed(line)
        base = banks.get(line, 0)
        if line.fixed or need is None or need == base:
            out.append(line)
            continue
        before = out[-1] if out else None
        skip = before if isinstance(before, Instruction) and before.skips else None
        # no switch back: control does not return here, or the callee chooses the bank; behind a skip, the
        # path that skips still needs it
        if enters and (line.op == "GOTO" or line.target in exits):
            if skip is None:
                out += [_switch(need, line), line]
            else:
                out[-1:] = [_switch(need, line), skip, line, _switch(base, line)]
        # the guarded instruction must directly follow its skip, so both go between the switches
        elif skip is not None:
            out[-1:] = [_switch(need, line), skip, line, _switch(base, line)]
        # only after the guarded instruction is there room for the switch back
        elif line.skips and number < len(lines):
            shadow = _shadow(function, lines[number], base, behind)
            out += [_switch(need, line), line, shadow, _switch(base, line)]
            number += 1
        else:
            out += [_switch(need, line), line, _switch(base, line)]
    needed = _without_needless(out + behind)
    changed = len(needed) != len(lines)
    function.replace(needed)
    return changed


def _without_needless(lines: list[Line]) -> list[Line]:
    """Return the lines without the compiler's switches that another one follows before anything needs the
    bank.
    """
    out: list[Line] = []
    bank: int | None = None
    for number, line in enumerate(lines):
        if isinstance(line, Label):
            bank = None
            out.append(line)
            continue
        selected = _own_switch(line)
        skipped = is_skipped(out, len(out))
        if selected is None or line.fixed or skipped:
            if not _passes(line):
                bank = selected if line.fixed and not skipped else None
        elif selected == bank or _is_overruled(lines, number):
            continue
        else:
            bank = selected
        out.append(line)
    return out


def _is_overruled(lines: list[Line], number: int) -> bool:
    """Return whether another switch follows before anything depends on the one at `number`."""
    for line in lines[number + 1 :]:
        if isinstance(line, Label):
            return False
        if not _passes(line) or bank_needed(line) is not None:
            return _own_switch(line) is not None
    return False


def _passes(ins: Instruction) -> bool:
    """Return whether an instruction neither changes the bank nor transfers control."""
    leads = ins.skips or ins.op in ENDS or ins.op in ("CALL", DELAY)
    writes_bank = ins.f == STATUS and ins.writes_f and (ins.op not in BIT_WRITES or ins.b == RP0)
    return not leads and not writes_bank


def _shadow(function: Function, follower: Line, base: int, behind: list[Line]) -> Line:
    """Return what follows a skip between two switches; a jump is redirected through a place that switches
    back first.
    """
    if isinstance(follower, Label) or follower.op != "GOTO":
        return follower
    label = f"{function.name}.bank{len(behind)}"
    behind += [Label(label), _switch(base, follower), follower]
    return Instruction("GOTO", target=label, place=follower.place)


def _switch(bank: int, like: Instruction) -> Instruction:
    return Instruction("BSF" if bank == 1 else "BCF", STATUS, b=RP0, place=like.place)


def _banks(function: Function, exits: Mapping[str, int]) -> dict[Instruction, int]:
    """Return the bank that the program itself has selected before each reachable instruction."""
    successors = dict(zip(function.blocks, function.successors(), strict=True))
    entry: dict[Block, int] = {}
    selected: dict[Instruction, int] = {}
    waiting = [(block, 0) for block in function.blocks[:1]]
    while waiting:
        block, bank = waiting.pop()
        # a block that is reached with different banks becomes UNKNOWN, so each is visited at most twice
        known = entry.get(block)
        if known in (bank, UNKNOWN):
            continue
        entry[block] = bank = bank if known is None else UNKNOWN
        before: Instruction | None = None
        for ins in block.instructions:
            selected[ins] = bank
            bank = _bank_after(before, ins, bank, exits)
            before = ins
        waiting += [(after, bank) for after in successors[block] if after is not None]
    return selected


def _bank_after(before: Instruction | None, ins: Instruction, bank: int, exits: Mapping[str, int]) -> int:
    """Return the bank after an instruction that was reached in `bank`."""
    switched = _own_switch(ins)
    if switched is not None:
        return switched
    if ins.op == "CALL":
        return exits.get(ins.target, bank)
    if _selects(ins):
        loaded = before.k if before is not None and before.op == "MOVLW" and ins.op == "MOVWF" else None
        return loaded >> RP0 & 1 if isinstance(loaded, int) else 0
    return bank
