"""Prints functions in the intermediate form as text, with their blocks and edges.

In: a `Function`. Out: lines such as

    main:                               ; 2 blocks, 3 instructions
      block 0 -> 1
            MOVLW 10
            MOVWF count
      block 1 main.top.1: -> 1
            GOTO main.top.1
"""

from __future__ import annotations

from servogen.compiler.ir.function import Block, Function
from servogen.units import counted


def text_of(function: Function) -> str:
    """Return the function as text."""
    size = f"; {counted(len(function.blocks), 'block')}, {counted(function.size, 'instruction')}"
    lines = [f"{function.name}:".ljust(36) + size]
    number = {block: index for index, block in enumerate(function.blocks)}
    for block, successors in zip(function.blocks, function.successors(), strict=True):
        names = "".join(f" {label.name}:" for label in block.labels)
        lines.append(f"  block {number[block]}{names} -> {_edges(block, successors, number)}")
        lines += [f"        {ins}{'  ; fixed' if ins.fixed else ''}" for ins in block.instructions]
    return "\n".join(lines) + "\n"


def _edges(block: Block, successors: tuple[Block | None, ...], number: dict[Block, int]) -> str:
    shown = ["exit" if after is None else str(number[after]) for after in successors]
    return f"{shown[0]} or skip to {shown[1]}" if block.skips else ", ".join(dict.fromkeys(shown))
