"""Removes unreachable blocks, instructions whose results are not needed, and needless destinations.

In: a `Function`. Out: fewer instructions with the same effect.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import pairwise

from servogen.compiler.ir.function import Block, Function, Line
from servogen.compiler.ir.instruction import (
    BIT_TESTS,
    PURE,
    STATUS,
    TARGETED,
    Byte,
    Instruction,
    Label,
    is_observable_read,
)
from servogen.compiler.passes.liveness import FLAG_LETTERS, W_BIT, Liveness, is_private


def drop_unreachable(function: Function) -> bool:
    """Remove unreachable blocks and unused labels; return whether there were any. Assembly counts as
    reached.
    """
    blocks = function.blocks
    successors = dict(zip(blocks, function.successors(), strict=True))
    followers = dict(pairwise(blocks))
    start: dict[Block, int] = {}
    """Where each block that stays begins: the compiler's code before assembly may be unreachable."""
    waiting = [(block, index) for block in blocks if (index := _first_fixed(block)) is not None] + [
        (block, 0) for block in blocks[:1]
    ]
    while waiting:
        block, index = waiting.pop()
        if start.get(block, index + 1) <= index:
            continue
        start[block] = index
        waiting += [(successor, 0) for successor in successors[block] if successor is not None]
        if block.last is not None and block.last.fixed and block in followers:
            waiting.append((followers[block], 0))
    lines: list[Line] = []
    for block in blocks:
        if block in start:
            lines += [*block.labels, *block.instructions[start[block] :]]
    used = {line.target for line in lines if isinstance(line, Instruction) and line.op in TARGETED}
    remaining = [line for line in lines if not isinstance(line, Label) or line.fixed or line.name in used]
    changed = len(remaining) != sum(1 for _ in function.lines())
    if changed:
        function.replace(remaining)
    return changed


def _first_fixed(block: Block) -> int | None:
    """Return the index of the first instruction that the user wrote; 0 for a block with one of the user's
    labels.
    """
    if any(label.fixed for label in block.labels):
        return 0
    return next((index for index, ins in enumerate(block.instructions) if ins.fixed), None)


def drop_dead(function: Function) -> bool:
    """Remove instructions whose results are not used; return whether something changed."""
    live = Liveness(function)
    dead: set[Instruction] = set()
    changed = False
    for ins in function.instructions():
        if ins.fixed or ins.op not in PURE or _flags_needed(ins, live.after[ins]):
            continue
        if _writes_dead(ins, live) and not is_observable_read(ins):
            dead.add(ins)
    # a store that nobody reads but whose flags are needed goes to W instead
    for ins in function.instructions():
        if ins in dead or ins.fixed or ins.d != 1 or ins.op not in PURE or not isinstance(ins.f, Byte):
            continue
        needed = live.after[ins]
        if ins.op != "MOVF" and is_private(ins.f) and not needed & (live.bit(ins.f) | W_BIT):
            ins.d = 0  # only its flags are wanted
            changed = True
    return remove(function, dead, live) or changed


def _flags_needed(ins: Instruction, needed: int) -> bool:
    """Return whether a flag that an instruction changes is read later; a write to STATUS always counts."""
    if ins.f == STATUS:
        return True
    return any(needed & FLAG_LETTERS[letter] for letter in ins.flags)


def _writes_dead(ins: Instruction, live: Liveness) -> bool:
    """Return whether W, or the byte that an instruction writes, is not needed."""
    needed = live.after[ins]
    if ins.writes_f:
        return isinstance(ins.f, Byte) and is_private(ins.f) and not needed & live.bit(ins.f)
    return ins.writes_w and not needed & W_BIT


def remove(function: Function, dead: Collection[Instruction], live: Liveness) -> bool:
    """Remove instructions; return whether there were any. A skip and the instruction it guards are removed
    together or not at all.
    """
    gone = set(dead)
    outer: Instruction | None = None
    before: Instruction | None = None
    for ins in function.instructions():
        if ins in dead and before is not None and before.skips and before not in gone:
            gone = _with_skip(ins, before, outer if outer is not None and outer.skips else None, gone, live)
        outer, before = before, ins
    if gone:
        function.replace([line for line in function.lines() if isinstance(line, Label) or line not in gone])
    return bool(gone)


def _with_skip(
    ins: Instruction,
    skip: Instruction,
    outer: Instruction | None,
    gone: set[Instruction],
    live: Liveness,
) -> set[Instruction]:
    """Return what is removed when the instruction after `skip` is dead; `outer` is a skip over that skip."""
    simple = skip.op in BIT_TESTS
    if skip.fixed or is_observable_read(skip):
        return gone - {ins}
    if outer is not None and (outer.op not in BIT_TESTS or is_observable_read(outer)):
        return gone - {ins}
    if outer is None:
        return gone | {skip} if simple else gone - {ins}
    if simple or (skip.d == 0 and not live.after[ins] & W_BIT):
        return gone | {skip, outer}
    return gone - {ins}
