"""Simplifies jumps to jumps, jumps to the next instruction, and skips around them.

In: a `Function`. Out: fewer jumps between the same blocks.
"""

from __future__ import annotations

from servogen.compiler.ir.function import Block, Function
from servogen.compiler.ir.instruction import DELAY, RETURNS, Instruction, is_observable_read

INVERSE = {"BTFSC": "BTFSS", "BTFSS": "BTFSC"}
"""The opposite of each skip that only tests."""
_MAX_CHAIN = 10
"""Jumps that are followed one after the other: a circle of jumps has no end."""


def thread_jumps(function: Function) -> bool:
    """Redirect jumps to jumps to their final target, and replace jumps to RETURN; return whether something
    changed.
    """
    entered = _first_instructions(function)
    changed = False
    for jump in function.instructions():
        if jump.op != "GOTO" or jump.fixed:
            continue
        for _ in range(_MAX_CHAIN):
            target = entered.get(jump.target)
            if target is None or target.fixed or target is jump:
                break
            if target.op == "GOTO" and target.target != jump.target:
                jump.target = target.target
                changed = True
            # a RETLW is left where it is, since its literal would have to be copied
            elif target.op in RETURNS and not target.writes_w:
                jump.op, jump.target = target.op, ""
                changed = True
                break
            else:
                break
    if changed:
        function.rebuild()
    return changed


def _first_instructions(function: Function) -> dict[str, Instruction]:
    """Return the instruction that each label leads to."""
    first: dict[str, Instruction] = {}
    waiting: list[str] = []
    for block in function.blocks:
        waiting += [label.name for label in block.labels]
        if block.instructions:
            first.update(dict.fromkeys(waiting, block.instructions[0]))
            waiting = []
    return first


def drop_jumps_to_next(function: Function) -> bool:
    """Remove each GOTO to the next instruction, and invert a skip over a GOTO over one instruction; return
    whether something changed.
    """
    changed = False
    number = 0
    while number < len(function.blocks):
        if _drop_jump(function, number) or _skip_instead(function, number):
            changed = True
        number += 1
    if changed:
        function.rebuild()
    return changed


def _at(function: Function, number: int) -> Block | None:
    return function.blocks[number] if 0 <= number < len(function.blocks) else None


def _is_skipped(function: Function, number: int) -> bool:
    """Return whether a conditional edge leads over a block."""
    return number > 0 and function.blocks[number - 1].skips


def _drop_jump(function: Function, number: int) -> bool:
    """Remove the jump at the end of a block if it leads to the next block, together with the test
    before it.
    """
    block, after, before = function.blocks[number], _at(function, number + 1), _at(function, number - 1)
    jump = block.last
    if jump is None or jump.op != "GOTO" or jump.fixed or after is None or not after.has_label(jump.target):
        return False
    if before is not None and before.skips:
        test = before.last
        if (
            test is None
            or test.op not in INVERSE
            or test.fixed
            or is_observable_read(test)
            or block.labels
            or _is_skipped(function, number - 1)
        ):
            return False
        before.instructions.pop()
    block.instructions.pop()
    return True


def _skip_instead(function: Function, number: int) -> bool:
    """Rewrite `BTFSC x; GOTO a; one; a:` as `BTFSS x; one; a:`; `GOTO a` may stand in place of `a:`, and
    RETURN in place of `GOTO a`.
    """
    block, jump, one, after = (_at(function, number + ahead) for ahead in range(4))
    test = block.last if block is not None else None
    if test is None or test.op not in INVERSE or test.fixed or jump is None or one is None:
        return False
    if _is_skipped(function, number) or one.labels or not one.instructions or not _leaves(jump):
        return False
    single, *rest = one.instructions
    if single.skips or single.fixed or single.op == DELAY:
        return False
    leave = jump.instructions[0]
    goes_on = not rest and leave.op == "GOTO" and after is not None and after.has_label(leave.target)
    goes_there = len(rest) == 1 and rest[0].same(leave)
    if not (goes_on or goes_there):
        return False
    # the inverted test skips the one instruction, where the jump used to lead over it
    test.op = INVERSE[test.op]
    function.blocks.remove(jump)
    function.rebuild()  # the skip leads over the first instruction only
    return True


def _leaves(block: Block) -> bool:
    """Return whether a block has no labels and consists of one jump or RETURN of the compiler's."""
    if block.labels or len(block.instructions) != 1:
        return False
    return block.instructions[0].op in ("GOTO", "RETURN") and not block.instructions[0].fixed
