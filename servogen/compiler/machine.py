"""Instructions before they have addresses: symbolic operands, labels, delays as one instruction each.

In: nothing; the code generator makes these values, the optimiser rewrites them, the layout turns them into
words.
What an instruction does to W and the flags comes from `pic.isa`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

from servogen.compiler.tree import AddressByte, Symbol
from servogen.errors import Place
from servogen.pic.device import registers
from servogen.pic.isa import by_mnemonic


@dataclass(frozen=True, slots=True)
class Imm:
    """A constant byte. No tuple, for a number must not equal the register of that address."""

    value: int | AddressByte


class Byte(NamedTuple):
    """A byte of a variable that has no address yet."""

    symbol: Symbol
    offset: int


@dataclass(frozen=True, slots=True)
class Reg:
    """A special function register, bit 7 of the address being the bank."""

    address: int


Loc = Byte | Reg
Operand = Imm | Byte | Reg


def exposed(operand: Operand | None) -> bool:
    """Return whether loads and stores of it are seen: a register, or a byte of a volatile object."""
    return isinstance(operand, Reg) or (isinstance(operand, Byte) and operand.symbol.volatile)


_SFR = registers()
INDF, PCL, STATUS, FSR, PCLATH, INTCON = (
    Reg(_SFR[name].address) for name in ("INDF", "PCL", "STATUS", "FSR", "PCLATH", "INTCON")
)
C, DC, Z, RP0 = 0, 1, 2, 5  # bits of STATUS: DS35007 register 2-1

LABEL, DELAY = "LABEL", "DELAY"
SKIPS = frozenset(("BTFSC", "BTFSS", "DECFSZ", "INCFSZ"))
ENDS = frozenset(("GOTO", "RETURN", "RETLW", "RETFIE"))
"""Instructions after which the next one is not executed."""
IN_PLACE = frozenset(
    ["ADDWF", "ANDWF", "IORWF", "XORWF", "SUBWF", "INCF", "DECF", "COMF", "RLF", "RRF", "SWAPF"]
)
"""Instructions that make a new value of a byte, in W or in its place."""


@dataclass(slots=True, eq=False)
class Ins:
    """One instruction (or label, or delay of `k` cycles)."""

    op: str
    f: Loc | None = None
    d: int = 0
    b: int = 0
    k: int | AddressByte = 0
    target: str = ""
    place: Place | None = None
    fixed: bool = False
    """Never changed, moved or dropped: the user's assembly, and what must take exact time."""
    table: Symbol | None = None
    """The flash object that a CALL reads."""

    def copy(self) -> Ins:
        return Ins(self.op, self.f, self.d, self.b, self.k, self.target, self.place, self.fixed, self.table)

    @property
    def real(self) -> bool:
        return self.op != LABEL

    @property
    def writes_w(self) -> bool:
        return self.op in _TO_W or (self.op in _BYTE_ORIENTED and self.d == 0)

    @property
    def reads_w(self) -> bool:
        return self.op in _FROM_W

    @property
    def writes_f(self) -> bool:
        return self.op in ("MOVWF", "CLRF", "BCF", "BSF") or (self.op in _BYTE_ORIENTED and self.d == 1)

    @property
    def reads_f(self) -> bool:
        return self.op in _BYTE_ORIENTED or self.op in ("BCF", "BSF", "BTFSC", "BTFSS")

    @property
    def flags(self) -> str:
        """The flags that it changes, of C, D and Z; a call changes all."""
        if self.op in ("CALL", DELAY):
            return "CDZ"
        row = _flags().get(self.op, "")
        if self.f == STATUS and self.writes_f:
            return "CDZ"
        return row

    def __str__(self) -> str:
        return assembly(self)


_BYTE_ORIENTED = frozenset(
    [
        "ADDWF",
        "ANDWF",
        "COMF",
        "DECF",
        "DECFSZ",
        "INCF",
        "INCFSZ",
        "IORWF",
        "MOVF",
        "RLF",
        "RRF",
        "SUBWF",
        "SWAPF",
        "XORWF",
    ]
)
_TO_W = frozenset(["ADDLW", "ANDLW", "IORLW", "MOVLW", "SUBLW", "XORLW", "RETLW", "CLRW", "CALL", "DELAY"])
_FROM_W = frozenset(
    [
        "ADDWF",
        "ANDWF",
        "IORWF",
        "SUBWF",
        "XORWF",
        "MOVWF",
        "ADDLW",
        "ANDLW",
        "IORLW",
        "SUBLW",
        "XORLW",
        "OPTION",
        "TRIS",
        "CALL",
        "RETURN",
        "RETFIE",
    ]
)


@cache
def _flags() -> dict[str, str]:
    return {name: "".join(flag for flag in row.flags if flag in "CDZ") for name, row in by_mnemonic().items()}


def uses_carry(ins: Ins) -> bool:
    """Whether it reads C beside naming STATUS."""
    return ins.op in ("RLF", "RRF")


def operand_text(operand: object) -> str:
    match operand:
        case Byte(symbol, offset):
            return symbol.name + (f"+{offset}" if offset else "")
        case Reg(address):
            name = next((row.name for row in _SFR.values() if row.address == address), None)
            return name or f"0x{address:02X}"
        case AddressByte(symbol, offset, part):
            return f"{('LOW', 'HIGH')[part]}({symbol.name}+{offset})"
    return str(operand)


def assembly(ins: Ins) -> str:
    """The instruction as text, for the listing of what has no address."""
    if ins.op == LABEL:
        return f"{ins.target}:"
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
