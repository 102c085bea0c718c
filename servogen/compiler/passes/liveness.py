"""Computes which bytes, W and flags are still needed after each instruction of a function.

In: a `Function`. Out: for each instruction, a bit set of what is live after it. Only private bytes are
tracked: parameters, results, locals and temporaries that can be reached only by name; everything else is
always live. Bytes of other functions (parameters being filled, results being fetched) are used and changed by
every CALL.
"""

from __future__ import annotations

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


class Liveness:
    """The analysis of one function: `after[instruction]` is the set that is live after it."""

    def __init__(self, function: Function) -> None:
        self.function = function
        self.number: dict[Byte, int] = {}
        own = set(map(id, function.own))
        for each in function.instructions():
            if isinstance(each.f, Byte) and each.f not in self.number and is_private(each.f):
                self.number[each.f] = len(self.number)
        if function.result is not None:
            for offset in range(function.result.size):
                self.number.setdefault(Byte(function.result, offset), len(self.number))
        self.foreign = 0
        for byte in self.number:
            if id(byte.symbol) not in own:
                self.foreign |= self.bit(byte)
        self.after: dict[Instruction, int] = {}
        self._exit = self._at_exit()
        self.entry = self._solve()
        """What is live before the first instruction."""

    def bit(self, byte: Byte) -> int:
        return 1 << self.number[byte] + _FIRST

    def _at_exit(self) -> int:
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
        uses = W_BIT if ins.reads_w else 0
        kills = W_BIT if ins.writes_w else 0
        for letter in ins.flags:
            kills |= FLAG_LETTERS[letter]
        if ins.reads_carry:
            uses |= C_BIT
        if ins.f == STATUS:
            if op in BIT_TESTS:
                return uses | FLAG_BITS.get(ins.b, 0), kills
            if op in BIT_WRITES:
                return uses, FLAG_BITS.get(ins.b, 0)
            return uses | (ALL_FLAGS if ins.reads_f else 0), kills
        if isinstance(ins.f, Byte) and ins.f in self.number:
            mask = self.bit(ins.f)
            if ins.reads_f:
                uses |= mask
            elif ins.writes_f:
                kills |= mask
        return uses, kills

    def before(self, ins: Instruction) -> int:
        """Return what is live before an instruction."""
        uses, kills = self._uses_and_kills(ins)
        return uses | self.after[ins] & ~kills

    def _solve(self) -> int:
        """Iterate backwards over the blocks until nothing changes, then fill in `after`."""
        blocks = self.function.blocks
        if not blocks:
            return self._exit
        facts = [[self._uses_and_kills(each) for each in block.instructions] for block in blocks]
        # summarise each block, so that the iteration below works on blocks instead of instructions
        summary = []
        for each in facts:
            needed, overwritten = 0, 0
            for uses, kills in reversed(each):
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
            for number in range(len(blocks) - 1, -1, -1):
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
                self.after[ins] = live
                live = uses | live & ~kills
        return live_in[0]

    def _exit_of(self, last: Instruction | None) -> int:
        """Return what is needed when the function is left; a jump into another function needs everything that
        it could use.
        """
        if last is not None and last.op in RETURNS:
            return 0
        return self._exit | W_BIT | self.foreign
