"""Replaces jumps in small branches.

In: a `Function` and its liveness. Out: a choice between two constants, or between two instructions, by skips
alone; what both arms of a choice begin with, once in front of it; a loop that counts down with DECFSZ.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from servogen.compiler.ir.function import Block, Function
from servogen.compiler.ir.instruction import (
    BIT_WRITES,
    DELAY,
    ENDS,
    IN_PLACE,
    INDF,
    STATUS,
    TARGETED,
    Byte,
    Instruction,
    Reg,
    Z,
)
from servogen.compiler.passes.jump_threading import INVERSE
from servogen.compiler.passes.liveness import W_BIT, Z_BIT, Liveness
from servogen.compiler.passes.tail_merging import is_timed

_COUNTS = {"DECF": "DECFSZ", "INCF": "INCFSZ"}


def short_branches(function: Function) -> bool:
    """Run the pass once; return whether something changed."""
    named = Counter(ins.target for ins in function.instructions() if ins.op in TARGETED)
    skipped = function.skipped()
    for number, block in enumerate(function.blocks[:-3]):
        if block not in skipped and _choice(function.blocks[number : number + 5], named):
            function.rebuild()
            return True
    # one change at a time: it invalidates the blocks, and the liveness computed from them
    if any(block not in skipped and _same_start(arms) for block, arms in _all_arms(function, named)):
        return True
    live = Liveness(function)
    if any(block not in skipped and _two_constants(arms, live) for block, arms in _all_arms(function, named)):
        function.rebuild()
        return True
    if any(block not in skipped and _one_differs(arms, live) for block, arms in _all_arms(function, named)):
        function.rebuild()
        return True
    return _count_down(function)


@dataclass(slots=True)
class _Arms:
    """`test; GOTO other; yes; leave; other: no; end`, each arm one block and entered only here."""

    first: Block
    jump: Block
    yes: Block
    no: Block
    end: Block

    @property
    def test(self) -> Instruction:
        return self.first.instructions[-1]


def _all_arms(function: Function, named: Counter[str]) -> Iterator[tuple[Block, _Arms]]:
    """Yield the choices between two straight arms that the compiler may change, with their first blocks."""
    blocks = [*function.blocks, Block()]  # the last arm may be the function's end
    for first, jump, yes, no, end in zip(*(blocks[start:] for start in range(5)), strict=False):
        test, leave = first.last, yes.last
        if test is None or test.op not in INVERSE or leave is None or leave.op not in ENDS:
            continue
        if [ins.op for ins in jump.instructions] != ["GOTO"] or jump.labels or yes.labels:
            continue
        target = jump.instructions[0].target
        if [label.name for label in no.labels] != [target] or named[target] != 1 or no.labels[0].fixed:
            continue
        lines = (test, *jump.instructions, *yes.instructions, *no.instructions)
        if not any(ins.fixed or is_timed(ins) for ins in lines):
            yield first, _Arms(first, jump, yes, no, end)


def _same_start(arms: _Arms) -> bool:
    """Move an instruction with which both arms begin to the front of the test; return whether there is one.

    One instruction is left in either arm: what is empty is simplified elsewhere.
    """
    yes, no = arms.yes.instructions, arms.no.instructions
    if len(yes) < 3 or len(no) < 2 or not yes[0].same(no[0]) or not goes_through(arms.test, yes[0]):
        return False
    arms.first.instructions.insert(-1, yes[0])
    del yes[0], no[0]
    return True


def _one_differs(arms: _Arms, live: Liveness) -> bool:
    """Rewrite `OP f,W; other; MOVWF f` against `OP f,F`: the operation, a skip over `other`, the store.

    Return whether the arms had that form.
    """
    yes, no = arms.yes.instructions, arms.no.instructions
    if len(yes) != 4 or len(no) != 1:
        return False
    begin, other, store, leave = yes
    same = no[0]
    if leave.op != "GOTO" or not arms.end.has_label(leave.target) or same.ends_block:
        return False
    if (same.op, same.f) != (begin.op, begin.f) or begin.op not in IN_PLACE or (begin.d, same.d) != (0, 1):
        return False
    if (
        (store.op, store.f) != ("MOVWF", begin.f)
        or other.ends_block
        or other.f is not None
        or other.op == DELAY
    ):
        return False
    # the rewritten code leaves the result in W, where the second arm left W alone
    if live.after[same] & W_BIT or not goes_through(arms.test, begin):
        return False
    skip = _turned(arms.test)
    arms.first.instructions[-1:] = [begin, skip]
    arms.jump.instructions = [other]
    arms.yes.instructions = []
    arms.no.labels, arms.no.instructions = [], [store]
    return True


def _two_constants(arms: _Arms, live: Liveness) -> bool:
    """Rewrite `MOVLW k; MOVWF f` against `CLRF f` as a choice of the constant in W, and one store.

    Return whether the arms had that form.
    """
    *yes, leave = arms.yes.instructions
    no, tail = arms.no.instructions, []
    if no and no[-1].same(leave):
        no, tail = no[:-1], no[-1:]
    elif leave.op != "GOTO" or not arms.end.has_label(leave.target):
        return False
    clears, stores = (no, yes) if len(yes) == 2 else (yes, no)
    if [ins.op for ins in stores] != ["MOVLW", "MOVWF"] or [ins.op for ins in clears] != ["CLRF"]:
        return False
    clear, (load, store) = clears[0], stores
    # CLRF leaves W alone and sets Z; the new code loads W and does not
    if clear.f != store.f or isinstance(store.f, Reg) or live.after[clear] & (W_BIT | Z_BIT):
        return False
    zero = Instruction("MOVLW", k=0, place=clear.place)
    first, second = (zero, load) if stores is yes else (load, zero)
    arms.first.instructions[-1:] = [first, _turned(arms.test), second, store, *tail]
    arms.jump.instructions, arms.yes.instructions = [], []
    arms.no.labels, arms.no.instructions = [], []
    return True


def goes_through(test: Instruction, ins: Instruction) -> bool:
    """Return whether an instruction does the same before a test, and the test after it.

    A test of C, DC or Z must not see the instruction's flags, nor a test of a byte what it writes.
    """
    if ins.f is not None and not isinstance(ins.f, Byte) and ins.f != STATUS:
        return False
    if isinstance(ins.f, Byte) and ins.f.symbol.volatile:
        return False
    if ins.op in (DELAY, "CALL") or ins.leaves:
        return False
    if test.f == STATUS:
        return ins.f != STATUS and not ins.flags
    if not isinstance(test.f, Byte) or test.f.symbol.volatile:
        return not ins.writes_f or ins.f == STATUS
    return not ins.writes_f or ins.f == STATUS or _independent(ins, test)


def _choice(blocks: list[Block], named: Counter[str]) -> bool:
    """Rewrite `BTFSS b; GOTO no; yes; GOTO end; no: other; end:` with skips alone; return whether it was
    rewritten.

    `blocks` begins with the block that ends with the test.
    """
    first, jump_block, yes_block, other_block = blocks[:4]
    test = first.last
    shape = (
        test is not None
        and test.op in INVERSE
        and not jump_block.labels
        and [ins.op for ins in jump_block.instructions] == ["GOTO"]
        and not yes_block.labels
        and len(yes_block.instructions) == 2
        and yes_block.instructions[1].op in ("GOTO", "RETURN")
        and len(other_block.labels) == 1
    )
    if not shape or test is None:
        return False
    (jump,), (yes, leave) = jump_block.instructions, yes_block.instructions
    other, *rest = other_block.instructions or [leave]
    if other_block.labels[0].name != jump.target or named[jump.target] != 1:
        return False
    if any(ins.fixed for ins in (test, jump, yes, leave, other)) or other_block.labels[0].fixed:
        return False
    to_end = len(rest) == 1 and rest[0].same(leave)
    before_end = not rest and leave.op == "GOTO" and len(blocks) > 4 and blocks[4].has_label(leave.target)
    if not (to_end or before_end):
        return False
    if yes.op == other.op == "MOVLW":
        new = [other.copy(), _turned(test), yes.copy()]
    elif stays_in(test, yes) and stays_in(test, other):
        new = [test.copy(), other.copy(), _turned(test), yes.copy()]
    else:
        return False
    for ins in new:
        ins.place = ins.place or test.place
    first.instructions[-1:] = [*new, *rest]
    jump_block.instructions, yes_block.instructions = [], []
    other_block.labels, other_block.instructions = [], []
    return True


def _turned(test: Instruction) -> Instruction:
    """Return the opposite of a skip."""
    inverted = test.copy()
    inverted.op = INVERSE[test.op]
    return inverted


def stays_in(test: Instruction, ins: Instruction) -> bool:
    """Return whether a bit can be tested again after an instruction that may be skipped."""
    if ins.op in (DELAY, "CALL") or ins.ends_block:
        return False
    if test.f == STATUS:
        return test.b <= Z and not ins.flags and not (ins.writes_f and _may_be_status(ins))
    if not isinstance(test.f, Byte) or test.f.symbol.volatile:
        return False
    return not ins.writes_f or ((ins.op in BIT_WRITES or ins.op == "CLRF") and _independent(ins, test))


def _may_be_status(ins: Instruction) -> bool:
    """Return whether an instruction's byte may be STATUS: a pointer, or a variable at a fixed address."""
    return ins.f in (STATUS, INDF) or (isinstance(ins.f, Byte) and ins.f.symbol.kind == "fixed")


def _independent(first: Instruction, second: Instruction) -> bool:
    """Return whether two instructions certainly refer to different bytes; a pointer may lead anywhere."""
    if isinstance(first.f, Byte):
        return first.f != second.f and "fixed" not in (first.f.symbol.kind, second.f.symbol.kind)  # type: ignore[union-attr]
    return first.f is not None and first.f.address & 0x7F > 4


def _count_down(function: Function) -> bool:
    """Rewrite `DECF n,F; BTFSS STATUS,Z; GOTO again` as `DECFSZ n,F; GOTO again`; a MOVF n in between is
    dropped. Return whether something changed.
    """
    live = Liveness(function)
    for block, after in zip(function.blocks, function.blocks[1:], strict=False):
        test, jump = block.last, after.last
        if test is None or jump is None or test.fixed or jump.fixed or after.labels or jump.op != "GOTO":
            continue
        # DECFSZ does not set Z
        if (test.op, test.f, test.b) != ("BTFSS", STATUS, Z) or live.after[test] & Z_BIT:
            continue
        behind = 1
        again = block.instructions[-2] if len(block.instructions) > 1 else None
        if again is not None and again.op == "MOVF" and not again.fixed and isinstance(again.f, Byte):
            if again.f.symbol.volatile or live.after[again] & W_BIT:
                continue
            behind = 2
        count = block.instructions[-behind - 1] if len(block.instructions) > behind else None
        if count is None or count.op not in _COUNTS or count.d != 1 or count.fixed:
            continue
        if behind == 2 and again is not None and again.f != count.f:
            continue
        block.instructions[-behind - 1 :] = [Instruction(_COUNTS[count.op], count.f, 1, place=count.place)]
        function.rebuild()
        return True
    return False
