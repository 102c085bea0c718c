"""Instructions before they have addresses: symbolic operands, labels, and delays as one instruction each.

In: nothing; the code generator creates these values, the passes rewrite them, the layout turns them into
words. The registers and flags that an instruction reads and writes come from its row in `pic.isa`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.errors import Location
from servogen.pic.device import addresses, registers
from servogen.pic.isa import by_mnemonic, mnemonics


@dataclass(frozen=True, slots=True)
class Imm:
    """A constant byte. Not a tuple, because a number must not compare equal to the register at that
    address.
    """

    value: int | AddressByte


class Byte(NamedTuple):
    """A byte of a variable that has no address yet."""

    symbol: Symbol
    offset: int


@dataclass(frozen=True, slots=True)
class Reg:
    """A special function register; bit 7 of the address is the bank."""

    address: int


Loc = Byte | Reg
Operand = Imm | Byte | Reg


def exposed(operand: Operand | None) -> bool:
    """Return whether accesses to an operand are observable: a register, or a byte of a volatile object."""
    return isinstance(operand, Reg) or (isinstance(operand, Byte) and operand.symbol.volatile)


INDF, PCL, STATUS, FSR, PCLATH, INTCON = (
    Reg(address) for address in addresses("INDF", "PCL", "STATUS", "FSR", "PCLATH", "INTCON")
)
C, DC, Z, RP0 = 0, 1, 2, 5  # bits of STATUS: DS35007 register 2-1

DELAY = "DELAY"
"""The one operation that is not an instruction of the chip: exactly `k` cycles, expanded after all passes."""
SKIPS = mnemonics(lambda row: row.skips)
ENDS = mnemonics(lambda row: row.flow in ("jump", "return"))
"""Instructions after which the next one is not executed."""
JUMPING = mnemonics(lambda row: row.flow != "next")
"""Instructions after which another than the next one may be executed."""
RETURNS = mnemonics(lambda row: row.flow == "return")
TARGETED = mnemonics(lambda row: row.has_target)
"""Instructions that name a label: GOTO and CALL."""
BIT_TESTS = mnemonics(lambda row: row.tests_bit)
BIT_WRITES = mnemonics(lambda row: row.changes_bit)
IDLE = mnemonics(lambda row: row.flow == "next" and not (row.operands or row.reads or row.writes))
"""Instructions that access neither W nor a register: NOP, CLRWDT and SLEEP."""
PURE = mnemonics(lambda row: row.flow == "next" and row.writes != "")
"""Instructions that only compute a value and set flags."""
IN_PLACE = mnemonics(lambda row: row.writes == "d" and row.flow == "next") - {"MOVF"}
"""Instructions that compute a new value from a byte, in W or in place."""
SETS_Z = mnemonics(lambda row: "Z" in row.flags)
"""Instructions after which Z says whether their result is 0."""
_FACTS = {
    name: (row.reads, row.writes, "".join(flag for flag in row.flags if flag in "CDZ"))
    for name, row in by_mnemonic().items()
} | {DELAY: ("", "", "")}
"""What an operation reads, writes, and which of C, D and Z it changes."""
_CLOBBERS_W = mnemonics(lambda row: row.flow == "call") | {DELAY}
_CONVEYS_W = mnemonics(lambda row: row.flow in ("call", "return") and row.writes != "W")
"""By the calling convention W carries the last argument, or the result."""


@dataclass(slots=True, eq=False)
class Label:
    """A name for the instruction that follows it."""

    name: str
    place: Location | None = None
    fixed: bool = False
    """Kept even where no instruction of the compiler names it: written by the user."""


@dataclass(slots=True, eq=False)
class Instruction:
    """One instruction with symbolic operands, or a delay of `k` cycles."""

    op: str
    f: Loc | None = None
    d: int = 0
    b: int = 0
    k: int | AddressByte = 0
    target: str = ""
    place: Location | None = None
    fixed: bool = False
    """Never changed, moved or dropped: the user's assembly, and what must take exact time."""
    table: Symbol | None = None
    """The flash object that a CALL reads."""

    def copy(self) -> Instruction:
        return replace(self)

    def same(self, other: Instruction) -> bool:
        """Return whether it does the same, regardless of its source location."""
        return self.key == other.key

    @property
    def key(self) -> tuple[object, ...]:
        """Return what it does, without its source location."""
        return self.op, self.f, self.d, self.b, self.k, self.target

    @property
    def writes_w(self) -> bool:
        writes = _FACTS[self.op][1]
        return writes == "W" or (writes == "d" and self.d == 0) or self.op in _CLOBBERS_W

    @property
    def reads_w(self) -> bool:
        return "W" in _FACTS[self.op][0] or self.op in _CONVEYS_W

    @property
    def writes_f(self) -> bool:
        writes = _FACTS[self.op][1]
        return writes == "f" or (writes == "d" and self.d == 1)

    @property
    def reads_f(self) -> bool:
        return "f" in _FACTS[self.op][0]

    @property
    def reads_carry(self) -> bool:
        """Return whether it reads C other than by naming STATUS."""
        return "C" in _FACTS[self.op][0]

    @property
    def flags(self) -> str:
        """Return the flags among C, D and Z that it changes; a call changes all of them."""
        if self.op in ("CALL", DELAY) or (self.f == STATUS and self.writes_f):
            return "CDZ"
        return _FACTS[self.op][2]

    @property
    def skips(self) -> bool:
        return self.op in SKIPS

    @property
    def leaves(self) -> bool:
        """Return whether the following instruction is not executed next: a jump, a return, a write to PCL."""
        if self.op in ENDS:
            return True
        return self.f.__class__ is Reg and self.f == PCL and self.writes_f

    @property
    def ends_block(self) -> bool:
        return self.leaves or self.skips

    def __str__(self) -> str:
        return assembly(self)


def operand_text(operand: object) -> str:
    """Return an operand as assembly writes it, with the names of variables in place of addresses."""
    match operand:
        case Byte(symbol, offset):
            return symbol.name + (f"+{offset}" if offset else "")
        case Reg(address):
            name = next((row.name for row in registers().values() if row.address == address), None)
            return name or f"0x{address:02X}"
        case AddressByte(symbol, offset, part):
            return f"{('LOW', 'HIGH')[part]}({symbol.name}+{offset})"
    return str(operand)


def assembly(ins: Instruction) -> str:
    """Return the instruction as text, for listings of code that has no addresses yet."""
    if ins.op == DELAY:
        return f"; delay {ins.k} cycles"
    parts = []
    row = by_mnemonic()[ins.op]
    for field in row.operands:
        if field == "f":
            parts.append(operand_text(ins.f))
        elif field == "d":
            parts.append("WF"[ins.d])
        elif field == "b":
            parts.append(str(ins.b))
        else:
            parts.append(ins.target or operand_text(ins.k))
    return f"{ins.op} {', '.join(parts)}".strip()


def is_observable_read(ins: Instruction) -> bool:
    """Return whether an instruction reads a register other than the flags, or a volatile variable, so that it
    must be kept.
    """
    return ins.reads_f and ins.f != STATUS and exposed(ins.f)
