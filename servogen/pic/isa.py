"""The instructions of the PIC16F84 as data, one row each; encoder, decoder and cycle counts derive from it.

In: a 14-bit word, or a mnemonic and its operands. Out: the other form. Source: DS35007B section 7
"Instruction Set Summary", table 7-2, and DS33023 section 29; OPTION and TRIS, which the chip still executes,
from DS33023 section 29 and DS30430 section 9.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property

WORD_MASK = 0x3FFF


@dataclass(frozen=True)
class Opcode:
    """One row. In `pattern`, f is a file register, d the destination, b a bit, k a literal, x is ignored."""

    mnemonic: str
    pattern: str
    cycles: int
    """Instruction cycles; one more when a skip is taken or PCL is the destination."""
    flags: str
    """The STATUS bits that it may change: of C, D (digit carry), Z, T (TO), P (PD)."""
    reads: str
    """What it reads: of W, f, and C (the carry flag)."""
    writes: str
    """Where its result goes: W, f, d (either, by the destination bit), or nothing."""
    operation: str
    flow: str = "next"
    """Where execution continues: "next", "skip" (perhaps one further), "jump", "call" or "return"."""
    ignored: int = 0
    """What assemblers put in the bits that the chip ignores."""

    @property
    def skips(self) -> bool:
        """Return whether it may skip the next instruction."""
        return self.flow == "skip"

    @property
    def tests_bit(self) -> bool:
        """Return whether it skips by one bit of a register."""
        return self.skips and "b" in self.operands

    @property
    def changes_bit(self) -> bool:
        """Return whether it changes one bit of a register."""
        return self.writes == "f" and "b" in self.operands

    @property
    def has_target(self) -> bool:
        """Return whether its literal is the address of an instruction."""
        return self.flow in ("jump", "call") and "k" in self.operands

    def writes_file(self, d: int) -> bool:
        """Return whether its result goes to the file register, given the destination bit."""
        return self.writes == "f" or (self.writes == "d" and d == 1)

    def writes_w(self, d: int) -> bool:
        """Return whether its result goes to W, given the destination bit."""
        return self.writes == "W" or (self.writes == "d" and d == 0)

    @cached_property
    def mask(self) -> int:
        """Return the bits by which its words are recognised."""
        return int("".join("1" if bit in "01" else "0" for bit in self._bits), 2)

    @cached_property
    def match(self) -> int:
        """Return the values of these bits."""
        return int("".join("1" if bit == "1" else "0" for bit in self._bits), 2)

    @cached_property
    def operands(self) -> str:
        """Return the fields in the order of assembly: "fd", "fb", "f", "k" or ""."""
        return "".join(field for field in "fdbk" if field in self._bits)

    def width(self, field: str) -> int:
        """Return the number of bits of a field; 0 if it has none of that name."""
        return self._widths.get(field, 0)

    def shift(self, field: str) -> int:
        """Return the number of the lowest bit of a field."""
        return self._shifts[field]

    @cached_property
    def _bits(self) -> str:
        return self.pattern.replace(" ", "")

    @cached_property
    def _widths(self) -> Mapping[str, int]:
        return {field: self._bits.count(field) for field in self.operands}

    @cached_property
    def _shifts(self) -> Mapping[str, int]:
        return {field: len(self._bits) - 1 - self._bits.rindex(field) for field in self.operands}


INSTRUCTIONS = (
    Opcode("ADDWF", "00 0111 dfff ffff", 1, "CDZ", "Wf", "d", "W + f -> d"),
    Opcode("ANDWF", "00 0101 dfff ffff", 1, "Z", "Wf", "d", "W & f -> d"),
    Opcode("CLRF", "00 0001 1fff ffff", 1, "Z", "", "f", "0 -> f"),
    Opcode("CLRW", "00 0001 0xxx xxxx", 1, "Z", "", "W", "0 -> W", ignored=0b0000011),  # MPASM writes 0x0103
    Opcode("COMF", "00 1001 dfff ffff", 1, "Z", "f", "d", "~f -> d"),
    Opcode("DECF", "00 0011 dfff ffff", 1, "Z", "f", "d", "f - 1 -> d"),
    Opcode("DECFSZ", "00 1011 dfff ffff", 1, "", "f", "d", "f - 1 -> d, skip if 0", flow="skip"),
    Opcode("INCF", "00 1010 dfff ffff", 1, "Z", "f", "d", "f + 1 -> d"),
    Opcode("INCFSZ", "00 1111 dfff ffff", 1, "", "f", "d", "f + 1 -> d, skip if 0", flow="skip"),
    Opcode("IORWF", "00 0100 dfff ffff", 1, "Z", "Wf", "d", "W | f -> d"),
    Opcode("MOVF", "00 1000 dfff ffff", 1, "Z", "f", "d", "f -> d"),
    Opcode("MOVWF", "00 0000 1fff ffff", 1, "", "W", "f", "W -> f"),
    Opcode("NOP", "00 0000 0xx0 0000", 1, "", "", "", "nothing"),
    Opcode("RLF", "00 1101 dfff ffff", 1, "C", "fC", "d", "f rotated left through C -> d"),
    Opcode("RRF", "00 1100 dfff ffff", 1, "C", "fC", "d", "f rotated right through C -> d"),
    Opcode("SUBWF", "00 0010 dfff ffff", 1, "CDZ", "Wf", "d", "f - W -> d"),
    Opcode("SWAPF", "00 1110 dfff ffff", 1, "", "f", "d", "f with its nibbles swapped -> d"),
    Opcode("XORWF", "00 0110 dfff ffff", 1, "Z", "Wf", "d", "W ^ f -> d"),
    Opcode("BCF", "01 00bb bfff ffff", 1, "", "f", "f", "0 -> f<b>"),
    Opcode("BSF", "01 01bb bfff ffff", 1, "", "f", "f", "1 -> f<b>"),
    Opcode("BTFSC", "01 10bb bfff ffff", 1, "", "f", "", "skip if f<b> is 0", flow="skip"),
    Opcode("BTFSS", "01 11bb bfff ffff", 1, "", "f", "", "skip if f<b> is 1", flow="skip"),
    Opcode("ADDLW", "11 111x kkkk kkkk", 1, "CDZ", "W", "W", "k + W -> W"),
    Opcode("ANDLW", "11 1001 kkkk kkkk", 1, "Z", "W", "W", "k & W -> W"),
    Opcode("CALL", "10 0kkk kkkk kkkk", 2, "", "", "", "PC + 1 -> stack, k -> PC", flow="call"),
    Opcode("CLRWDT", "00 0000 0110 0100", 1, "TP", "", "", "0 -> watchdog and its prescaler"),
    Opcode("GOTO", "10 1kkk kkkk kkkk", 2, "", "", "", "k -> PC", flow="jump"),
    Opcode("IORLW", "11 1000 kkkk kkkk", 1, "Z", "W", "W", "k | W -> W"),
    Opcode("MOVLW", "11 00xx kkkk kkkk", 1, "", "", "W", "k -> W"),
    Opcode("RETFIE", "00 0000 0000 1001", 2, "", "", "", "stack -> PC, 1 -> GIE", flow="return"),
    Opcode("RETLW", "11 01xx kkkk kkkk", 2, "", "", "W", "k -> W, stack -> PC", flow="return"),
    Opcode("RETURN", "00 0000 0000 1000", 2, "", "", "", "stack -> PC", flow="return"),
    Opcode("SLEEP", "00 0000 0110 0011", 1, "TP", "", "", "0 -> watchdog, oscillator off"),
    Opcode("SUBLW", "11 110x kkkk kkkk", 1, "CDZ", "W", "W", "k - W -> W"),
    Opcode("XORLW", "11 1010 kkkk kkkk", 1, "Z", "W", "W", "k ^ W -> W"),
)
"""The 35 instructions of the data sheet, in its order."""

LEGACY = (
    Opcode("OPTION", "00 0000 0110 0010", 1, "", "W", "", "W -> OPTION_REG"),
    Opcode("TRIS", "00 0000 0110 0fff", 1, "", "W", "", "W -> TRIS of port f"),
)
"""Two of the PIC16C5x that the chip keeps. TRIS takes f = 5 (port A) or 6 (port B) only."""

TRIS_PORTS = (5, 6)


@dataclass(frozen=True, slots=True)
class Decoded:
    """A decoded word: the row and the values of its fields (0 for fields that it does not have)."""

    instruction: Opcode
    f: int = 0
    d: int = 0
    b: int = 0
    k: int = 0


@cache
def by_mnemonic() -> Mapping[str, Opcode]:
    """Return all 37 rows by mnemonic, in upper case."""
    return {row.mnemonic: row for row in (*INSTRUCTIONS, *LEGACY)}


def mnemonics(holds: Callable[[Opcode], bool]) -> frozenset[str]:
    """Return the mnemonics of all rows for which `holds` is true."""
    return frozenset(name for name, row in by_mnemonic().items() if holds(row))


@cache
def literal_forms() -> Mapping[str, str]:
    """Return, for each operation on W and a register that also exists with a literal, both mnemonics:
    ADDWF -> ADDLW.
    """
    files = [row.mnemonic for row in INSTRUCTIONS if row.reads == "Wf"]
    pairs = ((name, name.removesuffix("WF") + "LW") for name in files)
    return {file: literal for file, literal in pairs if literal in by_mnemonic()}


@cache
def decode(word: int) -> Decoded | None:
    """Return the meaning of a 14-bit word to the chip; None if the data sheets do not define it."""
    for row in (*INSTRUCTIONS, *LEGACY):  # if two rows match, the earlier one takes precedence
        if word & row.mask == row.match:
            values = {field: word >> row.shift(field) & (1 << row.width(field)) - 1 for field in row.operands}
            if row.mnemonic != "TRIS" or values["f"] in TRIS_PORTS:
                return Decoded(row, **values)
    return None


def encode(mnemonic: str, *, f: int = 0, d: int = 0, b: int = 0, k: int = 0) -> int:
    """Return the word of an instruction, with ignored bits as assemblers write them.

    Raises KeyError for an unknown mnemonic and ValueError for a field that does not fit, so that callers
    (assembler, compiler) can say where.
    """
    row = by_mnemonic()[mnemonic]
    word = row.match | row.ignored
    for field, value in (("f", f), ("d", d), ("b", b), ("k", k)):
        if field not in row.operands:
            if value:
                raise ValueError(f"{mnemonic} has no operand {field}")
        elif not 0 <= value < 1 << row.width(field):
            raise ValueError(f"{mnemonic}: {field} = {value} does not fit {row.width(field)} bits")
        else:
            word |= value << row.shift(field)
    return word
