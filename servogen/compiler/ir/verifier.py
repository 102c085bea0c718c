"""Checks that a function in the intermediate form is well-formed.

In: a `Function`. Out: nothing, or `MalformedIR` with the function, the pass after which it was checked, and
the fault. Only the form is checked; whether a pass preserves the meaning is tested elsewhere.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator

from servogen.compiler.ast.nodes import AddressByte
from servogen.compiler.ir.function import Block, Function
from servogen.compiler.ir.instruction import DELAY, Byte, Instruction, Reg
from servogen.pic.isa import by_mnemonic


class MalformedIR(Exception):
    """Raised when a pass has left an invalid program, which is a bug in the compiler."""


def verify(function: Function, *, after: str) -> None:
    """Check a function. Raises MalformedIR."""
    for fault in faults(function):
        raise MalformedIR(f"{function.name}, after {after}: {fault}")


def faults(function: Function) -> Iterator[str]:
    """Yield a description of each fault in a function."""
    labels = Counter(label.name for block in function.blocks for label in block.labels)
    for name, count in labels.items():
        if count > 1:
            yield f"the label {name} stands {count} times"
    seen: set[int] = set()
    for number, block in enumerate(function.blocks):
        for ins in block.instructions:
            if id(ins) in seen:
                yield f"{ins} stands twice as the same object"
            seen.add(id(ins))
            yield from _operand_faults(ins)
        yield from _flow_faults(function, number, block, labels)


def _flow_faults(function: Function, number: int, block: Block, labels: Container[str]) -> Iterator[str]:
    """Yield the faults of a block among its neighbours."""
    skipped = number > 0 and function.blocks[number - 1].skips
    last_block = number == len(function.blocks) - 1
    if not block.instructions and not last_block:
        yield f"block {number} is empty"
    if (
        not block.labels
        and number
        and not _ends(function.blocks[number - 1])
        and not _is_skipped(function, number - 1)
    ):
        yield f"block {number} continues the one before it"
    for ins in block.instructions[:-1]:
        if ins.ends_block:
            yield f"{ins} stands inside block {number}"
    if skipped and len(block.instructions) != 1:
        yield f"block {number} is skipped but holds {len(block.instructions)} instructions"
    if block.skips and last_block and not function.inline_asm:
        yield f"nothing follows the skip {block.last}"
    for ins in block.instructions:
        # only the compiler's own labels must be in the function: assembly may jump elsewhere
        own = ins.op == "GOTO" and not ins.fixed and ins.target.startswith(f"{function.name}.")
        if own and ins.target not in labels:
            yield f"{ins}: there is no such label"


def _ends(block: Block) -> bool:
    return block.last is not None and block.last.ends_block


def _is_skipped(function: Function, number: int) -> bool:
    return number > 0 and function.blocks[number - 1].skips


def _operand_faults(ins: Instruction) -> Iterator[str]:
    """Yield the operands of an instruction that its row in `pic.isa` does not have, or out of range."""
    if ins.op == DELAY:
        if not isinstance(ins.k, int) or ins.k < 0:
            yield f"a delay of {ins.k} cycles"
        return
    row = by_mnemonic().get(ins.op)
    if row is None:
        yield f"{ins.op} is not an instruction of the chip"
        return
    if ("f" in row.operands) != isinstance(ins.f, (Byte, Reg)):
        yield f"{ins.op} with the file register {ins.f}"
    if ins.d not in (0, 1) or (ins.d and "d" not in row.operands):
        yield f"{ins.op} with the destination {ins.d}"
    if not 0 <= ins.b <= 7 or (ins.b and "b" not in row.operands):
        yield f"{ins.op} with the bit {ins.b}"
    if row.flow in ("jump", "call"):
        if not ins.target:
            yield f"{ins.op} without a target"
    elif ins.target:
        yield f"{ins.op} with the target {ins.target}"
    elif "k" in row.operands and not isinstance(ins.k, AddressByte) and not 0 <= ins.k <= 0xFF:
        yield f"{ins.op} with the literal {ins.k}"
