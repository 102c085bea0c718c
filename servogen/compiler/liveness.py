"""Which bytes, W and flags are still needed behind each instruction of a function.

In: a `Code`. Out: per instruction a bit set of what is live after it. Only private bytes are followed:
parameters, results, locals and temporaries that nothing can reach but by name; everything else is always
needed. Bytes of other functions (parameters being filled, results being fetched) are used and changed by
every CALL.
"""

from __future__ import annotations

from servogen.compiler.emitter import Code
from servogen.compiler.machine import (
    DC,
    DELAY,
    ENDS,
    LABEL,
    PCL,
    SKIPS,
    STATUS,
    Byte,
    C,
    Ins,
    Z,
    uses_carry,
)

W_BIT, C_BIT, D_BIT, Z_BIT = 1, 2, 4, 8
FLAG_BITS = {C: C_BIT, DC: D_BIT, Z: Z_BIT}
_FLAG_LETTERS = {"C": C_BIT, "D": D_BIT, "Z": Z_BIT}
ALL_FLAGS = C_BIT | D_BIT | Z_BIT
_FIRST = 4
_PRIVATE = ("local", "param", "result", "temp")


def is_private(loc: object) -> bool:
    """Whether a byte is only reached by its name."""
    return (
        isinstance(loc, Byte)
        and loc.symbol.kind in _PRIVATE
        and not loc.symbol.pinned
        and not loc.symbol.volatile
    )


class Liveness:
    """The analysis of one function; `after[i]` is what is live behind instruction i."""

    def __init__(self, code: Code) -> None:
        self.code = code
        self.ins = code.ins
        self.number: dict[Byte, int] = {}
        own = set(map(id, code.own))
        for ins in self.ins:
            if is_private(ins.f) and ins.f not in self.number:
                self.number[ins.f] = len(self.number)  # type: ignore[index]
        if code.result is not None:
            for offset in range(code.result.size):
                self.number.setdefault(Byte(code.result, offset), len(self.number))
        self.foreign = 0
        for byte in self.number:
            if id(byte.symbol) not in own:
                self.foreign |= self.bit(byte)
        self.where = {each.target: at for at, each in enumerate(self.ins) if each.op == LABEL}
        self.after = [0] * len(self.ins)
        self.before = [0] * len(self.ins)
        self._exit = self._at_exit()
        self._run()

    def bit(self, byte: Byte) -> int:
        return 1 << self.number[byte] + _FIRST

    def _at_exit(self) -> int:
        live = W_BIT if self.code.returns_w else 0
        if self.code.result is not None and is_private(Byte(self.code.result, 0)):
            for offset in range(self.code.result.size):
                live |= self.bit(Byte(self.code.result, offset))
        return live

    def successors(self, at: int) -> list[int]:
        """Indices of what may run next; len(ins) stands for leaving the function."""
        ins = self.ins[at]
        if ins.op == "GOTO":
            return [self.where.get(ins.target, len(self.ins))]
        if ins.op in ENDS or (ins.f == PCL and ins.writes_f):
            return [len(self.ins)]
        if ins.op in SKIPS:
            after = self.next_real(at + 1)
            return [at + 1, after + 1]
        return [at + 1]

    def next_real(self, at: int) -> int:
        while at < len(self.ins) and self.ins[at].op == LABEL:
            at += 1
        return at

    def uses_and_kills(self, ins: Ins) -> tuple[int, int]:
        """(what it needs, what it overwrites entirely)."""
        op = ins.op
        if op == LABEL:
            return 0, 0
        if op == DELAY:
            return 0, W_BIT | ALL_FLAGS
        if op == "CALL":
            return W_BIT | self.foreign, W_BIT | ALL_FLAGS | self.foreign
        if op in ("RETURN", "RETFIE"):
            return self._exit, 0
        if op == "RETLW":
            return self._exit & ~W_BIT, W_BIT
        uses = W_BIT if ins.reads_w else 0
        kills = W_BIT if ins.writes_w else 0
        for letter in ins.flags:
            kills |= _FLAG_LETTERS[letter]
        if uses_carry(ins):
            uses |= C_BIT
        if ins.f == STATUS:
            if op in ("BTFSC", "BTFSS"):
                return uses | FLAG_BITS.get(ins.b, 0), kills
            if op in ("BCF", "BSF"):
                return uses, FLAG_BITS.get(ins.b, 0)
            return uses | (ALL_FLAGS if ins.reads_f else 0), kills
        if isinstance(ins.f, Byte) and ins.f in self.number:
            mask = self.bit(ins.f)
            if ins.reads_f:
                uses |= mask
            elif ins.writes_f:
                kills |= mask
        return uses, kills

    def _run(self) -> None:
        ins = self.ins
        facts = [self.uses_and_kills(each) for each in ins]
        following = [self.successors(at) for at in range(len(ins))]
        changed = True
        while changed:
            changed = False
            for at in range(len(ins) - 1, -1, -1):
                live = 0
                for after in following[at]:
                    live |= self.before[after] if after < len(ins) else self._exit_of(ins[at])
                uses, kills = facts[at]
                before = uses | live & ~kills
                if live != self.after[at] or before != self.before[at]:
                    self.after[at], self.before[at] = live, before
                    changed = True

    def _exit_of(self, ins: Ins) -> int:
        """What is needed when the function is left: a jump into another one needs all that it could use."""
        if ins.op in ("RETURN", "RETFIE", "RETLW"):
            return 0
        return self._exit | W_BIT | self.foreign
