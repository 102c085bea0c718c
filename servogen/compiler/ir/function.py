"""The intermediate form: a function as blocks of instructions, in their order in flash.

In: the output of the code generator. Out: the same value, rewritten by each pass, until it is laid out in
flash.

A block is entered at its first instruction and left after its last. Its successors are:

    GOTO               the block with that label; another function when no block has it
    RETURN, RETLW, …   out of the function
    BTFSC, DECFSZ, …   a conditional edge: to the next block, which holds one instruction, or over it
    a write to PCL     anywhere: out of the function, or to the next block
    anything else      the next block

`text_of` prints a function with its blocks and edges:

    main:                               ; 2 blocks, 3 instructions
      block 0 -> 1
            MOVLW 10
            MOVWF count
      block 1 main.top.1: -> 1
            GOTO main.top.1
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ir.instruction import ENDS, TARGETED, Instruction, Label
from servogen.errors import Location
from servogen.units import counted

ISR_SUFFIX = "$isr"
"""The suffix of the interrupt's copy of a function that main calls too."""

Line = Label | Instruction
"""A function as assembly writes it is a sequence of lines."""


@dataclass(slots=True, eq=False)
class Block:
    """Instructions that are executed one after the other."""

    labels: list[Label] = field(default_factory=list)
    instructions: list[Instruction] = field(default_factory=list)

    @property
    def last(self) -> Instruction | None:
        return self.instructions[-1] if self.instructions else None

    @property
    def skips(self) -> bool:
        """Return whether the block ends with a conditional edge over the next block."""
        return self.last is not None and self.last.skips

    def has_label(self, name: str) -> bool:
        return any(label.name == name for label in self.labels)


@dataclass(frozen=True, slots=True)
class LoopLines:
    """A loop of the source: "while", "for" or "do", and (line, column) of its first and last part."""

    kind: str
    first: tuple[int, int]
    last: tuple[int, int]


@dataclass(slots=True)
class Function:
    """The blocks of one function, its own variables, and the functions that it calls."""

    name: str
    blocks: list[Block] = field(default_factory=list)
    own: list[Symbol] = field(default_factory=list)
    """Parameters, results, locals and temporaries."""
    place: Location | None = None
    parameters: list[Symbol] = field(default_factory=list)
    result: Symbol | None = None
    w_parameter: Symbol | None = None
    returns_w: bool = False
    inline_asm: bool = False
    origin: int | None = None
    """The address at which it must lie."""
    table: Symbol | None = None
    """The flash object whose bytes it holds; its instructions depend on where it comes to lie."""
    also_calls: tuple[str, ...] = ()
    """Functions that it calls elsewhere than at their first instruction."""
    also_jumps_to: tuple[str, ...] = ()
    """Functions that it jumps to, there or elsewhere."""
    loops: list[LoopLines] = field(default_factory=list)
    bounds: dict[str, int] = field(default_factory=dict)
    """How often a library loop's label can be passed in one call."""
    delays: list[tuple[Instruction, Instruction]] = field(default_factory=list)
    """The first and the last instruction of each delay, once these are expanded."""
    waits_for: str = ""
    """What a library routine waits for without a known end."""
    falls_into: str = ""
    """The function that stands right behind and is entered without a jump."""

    # building

    def append(self, line: Line) -> None:
        """Append a label or an instruction, starting a new block where necessary."""
        self.extend((line,))

    def extend(self, lines: Iterable[Line]) -> None:
        """Append labels and instructions, starting new blocks where necessary."""
        blocks = self.blocks
        here = blocks[-1] if blocks else None
        # a skip leads over one instruction: the block behind a skip is complete as soon as it has one
        guarded = len(blocks) > 1 and blocks[-2].skips
        complete = here is not None and here.last is not None and (guarded or here.last.ends_block)
        for line in lines:
            is_label = isinstance(line, Label)
            if here is None or (here.instructions if is_label else complete):
                guarded = here is not None and here.skips
                here = Block()
                blocks.append(here)
                complete = False
            if isinstance(line, Label):
                here.labels.append(line)
            else:
                here.instructions.append(line)
                complete = guarded or line.ends_block

    def replace(self, lines: Iterable[Line]) -> None:
        """Replace the contents, and divide them into blocks again."""
        lines = list(lines)
        self.blocks = []
        self.extend(lines)

    def rebuild(self) -> None:
        """Divide the function into blocks again after labels or instructions were removed."""
        self.replace(self.lines())

    # looking at it

    def lines(self) -> Iterator[Line]:
        """Yield labels and instructions in order."""
        for block in self.blocks:
            yield from block.labels
            yield from block.instructions

    def instructions(self) -> Iterator[Instruction]:
        for block in self.blocks:
            yield from block.instructions

    @property
    def size(self) -> int:
        """Return the number of instructions."""
        return sum(len(block.instructions) for block in self.blocks)

    def by_label(self) -> dict[str, Block]:
        """Return the block that each label of the function leads to."""
        return {label.name: block for block in self.blocks for label in block.labels}

    def successors(self) -> list[tuple[Block | None, ...]]:
        """Return, for each block, the blocks that may be executed next; None stands for leaving the function.

        For a conditional edge, the first is the next block and the second the one after it.
        """
        labelled = self.by_label()
        following = [*self.blocks[1:], None, None]
        edges: list[tuple[Block | None, ...]] = []
        for number, block in enumerate(self.blocks):
            last = block.last
            if last is None or not last.ends_block:
                edges.append((following[number],))
            elif last.op == "GOTO":
                edges.append((labelled.get(last.target),))
            elif last.op in ENDS:
                edges.append((None,))
            elif last.skips:
                edges.append((following[number], following[number + 1]))
            else:  # a write to PCL
                edges.append((None, following[number]))
        return edges

    def skipped(self) -> set[Block]:
        """Return the blocks that a conditional edge leads over."""
        return {after for block, after in zip(self.blocks, self.blocks[1:], strict=False) if block.skips}

    def calls(self) -> list[str]:
        """Return the names of the functions that it calls or jumps to, in order, each once."""
        labels = self.by_label()
        targets = {
            ins.target: None
            for ins in self.instructions()
            if ins.op in TARGETED and ins.target and ins.target not in labels
        }
        more = [*self.also_calls, *self.also_jumps_to, *([self.falls_into] if self.falls_into else [])]
        return [*targets, *more]


def is_skipped(lines: Sequence[Line], index: int) -> bool:
    """Return whether a line directly follows a skip."""
    before = lines[index - 1] if index else None
    return isinstance(before, Instruction) and before.skips


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
