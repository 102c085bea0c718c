"""Computes which bytes, W and flags are still needed after each instruction of a function.

In: a `Function`. Out: for each instruction, a bit set of what is live after it. Only private bytes are
tracked: parameters, results, locals and temporaries that can be reached only by name; everything else is
always live. Bytes of other functions (parameters being filled, results being fetched) are used and changed by
every CALL.
"""

from __future__ import annotations

from functools import cache, cached_property

from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import (
    BIT_TESTS,
    BIT_WRITES,
    DC,
    DELAY,
    RETURNS,
    STATUS,
    Byte,
    C,
    Instruction,
    Z,
)

W_BIT, C_BIT, D_BIT, Z_BIT = 1, 2, 4, 8
FLAG_BITS = {C: C_BIT, DC: D_BIT, Z: Z_BIT}
FLAG_LETTERS = {"C": C_BIT, "D": D_BIT, "Z": Z_BIT}
ALL_FLAGS = C_BIT | D_BIT | Z_BIT
_FIRST = 4
_PRIVATE = ("local", "param", "result", "temp")


def is_private(loc: object) -> bool:
    """Return whether a byte can be reached only by its name."""
    return (
        isinstance(loc, Byte)
        and loc.symbol.kind in _PRIVATE
        and not loc.symbol.pinned
        and not loc.symbol.volatile
    )


@cache
def _without_byte(op: str, d: int) -> tuple[int, int]:
    """Return what an instruction needs, and what it overwrites, of W and the flags, whatever its byte is."""
    ins = Instruction(op, d=d)
    uses = (W_BIT if ins.reads_w else 0) | (C_BIT if ins.reads_carry else 0)
    kills = W_BIT if ins.writes_w else 0
    for letter in ins.flags:
        kills |= FLAG_LETTERS[letter]
    return uses, kills


class Liveness:
    """The analysis of one function, which is done when an answer is first needed: most passes find nothing
    that they could change, and do without.
    """

    def __init__(self, function: Function) -> None:
        self.function = function

    @cached_property
    def number(self) -> dict[Byte, int]:
        """Return the private bytes of the function with their numbers."""
        number: dict[Byte, int] = {}
        for ins in self.function.instructions():
            if isinstance(ins.f, Byte) and ins.f not in number and is_private(ins.f):
                number[ins.f] = len(number)
        result = self.function.result
        if result is not None:
            for offset in range(result.size):
                number.setdefault(Byte(result, offset), len(number))
        return number

    @cached_property
    def foreign(self) -> int:
        """Return the bytes that belong to other functions."""
        own = set(map(id, self.function.own))
        return sum(self.bit(byte) for byte in self.number if id(byte.symbol) not in own)

    @property
    def after(self) -> dict[Instruction, int]:
        """Return what is live after each instruction."""
        return self._solution[0]

    @property
    def entry(self) -> int:
        """Return what is live before the first instruction."""
        return self._solution[1]

    def bit(self, byte: Byte) -> int:
        return 1 << self.number[byte] + _FIRST

    @cached_property
    def _exit(self) -> int:
        """Return what a return needs: the result."""
        function = self.function
        live = W_BIT if function.returns_w else 0
        if function.result is not None and is_private(Byte(function.result, 0)):
            for offset in range(function.result.size):
                live |= self.bit(Byte(function.result, offset))
        return live

    def _uses_and_kills(self, ins: Instruction) -> tuple[int, int]:
        """Return (what an instruction needs, what it overwrites entirely)."""
        op = ins.op
        # the loop that a delay is expanded to may count in W, and changes the flags
        if op == DELAY:
            return 0, W_BIT | ALL_FLAGS
        # W may hold an argument; the bytes of other functions are parameters and results
        if op == "CALL":
            return W_BIT | self.foreign, W_BIT | ALL_FLAGS | self.foreign
        if op in RETURNS:
            return (self._exit & ~W_BIT, W_BIT) if ins.writes_w else (self._exit, 0)
        uses, kills = _without_byte(op, ins.d)
        if isinstance(ins.f, Byte):
            if ins.f in self.number:
                mask = self.bit(ins.f)
                if ins.reads_f:
                    uses |= mask
                elif ins.writes_f:
                    kills |= mask
        elif ins.f == STATUS:
            if op in BIT_TESTS:
                return uses | FLAG_BITS.get(ins.b, 0), kills
            if op in BIT_WRITES:
                return uses, FLAG_BITS.get(ins.b, 0)
            return uses | (ALL_FLAGS if ins.reads_f else 0), kills | (ALL_FLAGS if ins.writes_f else 0)
        return uses, kills

    def before(self, ins: Instruction) -> int:
        """Return what is live before an instruction."""
        uses, kills = self._uses_and_kills(ins)
        return uses | self.after[ins] & ~kills

    @cached_property
    def _solution(self) -> tuple[dict[Instruction, int], int]:
        """Iterate backwards over the blocks until nothing changes; return `after` and `entry`."""
        blocks = self.function.blocks
        after_each: dict[Instruction, int] = {}
        if not blocks:
            return after_each, self._exit
        facts = [[self._uses_and_kills(ins) for ins in block.instructions] for block in blocks]
        # summarise each block, so that the iteration below works on blocks instead of instructions
        summary = []
        for block_facts in facts:
            needed, overwritten = 0, 0
            for uses, kills in reversed(block_facts):
                needed = uses | needed & ~kills
                overwritten |= kills
            summary.append((needed, overwritten))
        index = {block: number for number, block in enumerate(blocks)}
        following = [
            [None if block is None else index[block] for block in after]
            for after in self.function.successors()
        ]
        live_in = [0] * len(blocks)
        live_out = [0] * len(blocks)
        changed = True
        while changed:
            changed = False
            for number in reversed(range(len(blocks))):
                live = 0
                for after in following[number]:
                    live |= self._exit_of(blocks[number].last) if after is None else live_in[after]
                needed, overwritten = summary[number]
                before = needed | live & ~overwritten
                if live != live_out[number] or before != live_in[number]:
                    live_out[number], live_in[number] = live, before
                    changed = True
        for number, block in enumerate(blocks):
            live = live_out[number]
            for ins, (uses, kills) in zip(reversed(block.instructions), reversed(facts[number]), strict=True):
                after_each[ins] = live
                live = uses | live & ~kills
        return after_each, live_in[0]

    def _exit_of(self, last: Instruction | None) -> int:
        """Return what is needed when the function is left; a jump into another function needs everything that
        it could use.
        """
        if last is not None and last.op in RETURNS:
            return 0
        return self._exit | W_BIT | self.foreign
