"""What each instruction makes of its operands, written once, for every kind of value (DS35007 section 7).

In: a mnemonic, its operands, and a `Domain`, which says what a byte and a flag are: numbers, arrays of
numbers, terms of a solver. Out: the result, and the flags C, DC and Z. Which flags an instruction changes is
its row's in `isa`. Only instructions with a result are here: the others move the program counter.

The simulator, the checker of certificates and the second chip of the tests have an arithmetic of their own,
on purpose: tests/pic/test_semantics.py compares all of them with this one, for every operand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Protocol, TypeVar

from servogen.pic.isa import by_mnemonic, literal_forms

Byte = TypeVar("Byte")
Flag = TypeVar("Flag")


class Domain(Protocol[Byte, Flag]):
    """A kind of values: the operations of a byte machine on them. None changes its operands."""

    def number(self, value: int) -> Byte:
        """Return a known byte."""

    def add(self, a: Byte, b: Byte) -> Byte:
        """Return a + b mod 256."""

    def subtract(self, a: Byte, b: Byte) -> Byte:
        """Return a - b mod 256."""

    def carry(self, a: Byte, b: Byte, bits: int) -> Flag:
        """Return whether the sum of the lowest `bits` bits exceeds as many bits."""

    def no_borrow(self, a: Byte, b: Byte, bits: int) -> Flag:
        """Return whether the lowest `bits` bits of a are at least those of b."""

    def conjunction(self, a: Byte, b: Byte) -> Byte:
        """Return a AND b."""

    def disjunction(self, a: Byte, b: Byte) -> Byte:
        """Return a OR b."""

    def difference(self, a: Byte, b: Byte) -> Byte:
        """Return a XOR b."""

    def with_bit(self, a: Byte, number: int, value: int) -> Byte:
        """Return a with one bit set to 0 or 1."""

    def bit(self, a: Byte, number: int) -> Flag:
        """Return one bit."""

    def rotate_left(self, a: Byte, carry: Flag) -> Byte:
        """Return bits 6 to 0 above the carry."""

    def rotate_right(self, a: Byte, carry: Flag) -> Byte:
        """Return the carry above bits 7 to 1."""

    def swap(self, a: Byte) -> Byte:
        """Return a with its nibbles exchanged."""

    def is_zero(self, a: Byte) -> Flag:
        """Return whether a is 0."""


Result = Callable[[Any, Any, Any, Any, int], Any]
"""What an instruction makes, in a domain, of its register or literal, of W, of C, and of the bit it names."""
Carry = Callable[[Any, Any, Any, int], Any]
"""C or DC, which is the carry out of bit `bits` - 1, from the register or literal and W."""

RESULTS: dict[str, Result] = {
    "ADDWF": lambda on, f, w, c, b: on.add(f, w),
    "ANDWF": lambda on, f, w, c, b: on.conjunction(f, w),
    "CLRF": lambda on, f, w, c, b: on.number(0),
    "CLRW": lambda on, f, w, c, b: on.number(0),
    "COMF": lambda on, f, w, c, b: on.difference(f, on.number(0xFF)),
    "DECF": lambda on, f, w, c, b: on.subtract(f, on.number(1)),
    "DECFSZ": lambda on, f, w, c, b: on.subtract(f, on.number(1)),
    "INCF": lambda on, f, w, c, b: on.add(f, on.number(1)),
    "INCFSZ": lambda on, f, w, c, b: on.add(f, on.number(1)),
    "IORWF": lambda on, f, w, c, b: on.disjunction(f, w),
    "MOVF": lambda on, f, w, c, b: f,
    "MOVLW": lambda on, f, w, c, b: f,
    "MOVWF": lambda on, f, w, c, b: w,
    "RLF": lambda on, f, w, c, b: on.rotate_left(f, c),
    "RRF": lambda on, f, w, c, b: on.rotate_right(f, c),
    "SUBWF": lambda on, f, w, c, b: on.subtract(f, w),
    "SWAPF": lambda on, f, w, c, b: on.swap(f),
    "XORWF": lambda on, f, w, c, b: on.difference(f, w),
    "BCF": lambda on, f, w, c, b: on.with_bit(f, b, 0),
    "BSF": lambda on, f, w, c, b: on.with_bit(f, b, 1),
}
"""By mnemonic; an instruction with a literal is in the row of its form with a register."""
CARRIES: dict[str, Carry] = {
    "ADDWF": lambda on, f, w, bits: on.carry(f, w, bits),
    "RLF": lambda on, f, w, bits: on.bit(f, 7),
    "RRF": lambda on, f, w, bits: on.bit(f, 0),
    "SUBWF": lambda on, f, w, bits: on.no_borrow(f, w, bits),
}


@cache
def row_of(mnemonic: str) -> str | None:
    """Return the row of an instruction in the tables above; None if it has no result."""
    register_form = {literal: register for register, literal in literal_forms().items()}
    row = register_form.get(mnemonic, mnemonic)
    return row if row in RESULTS else None


def result(domain: Domain[Byte, Flag], mnemonic: str, f: Byte, w: Byte, carry: Flag, bit: int) -> Byte:
    """Return the result of an instruction that has one; `f` is its register's byte, or its literal."""
    made: Byte = RESULTS[row_of(mnemonic) or mnemonic](domain, f, w, carry, bit)
    return made


def flags(domain: Domain[Byte, Flag], mnemonic: str, f: Byte, w: Byte, made: Byte) -> Mapping[str, Flag]:
    """Return the flags that an instruction changes, by their letters in `isa`, from operands and result."""
    changed = {}
    for letter in by_mnemonic()[mnemonic].flags:
        if letter == "Z":
            changed[letter] = domain.is_zero(made)
        else:
            changed[letter] = CARRIES[row_of(mnemonic) or mnemonic](domain, f, w, 8 if letter == "C" else 4)
    return changed


class Numbers:
    """Known bytes and flags, or NumPy arrays of them, of an integer type of more than 16 bits."""

    def number(self, value: int) -> int:
        return value

    def add(self, a: int, b: int) -> int:
        return a + b & 0xFF

    def subtract(self, a: int, b: int) -> int:
        return a - b & 0xFF

    def carry(self, a: int, b: int, bits: int) -> int:
        low = (1 << bits) - 1
        return (a & low) + (b & low) >> bits

    def no_borrow(self, a: int, b: int, bits: int) -> int:
        low = (1 << bits) - 1
        return 1 + ((a & low) - (b & low) >> bits)

    def conjunction(self, a: int, b: int) -> int:
        return a & b

    def disjunction(self, a: int, b: int) -> int:
        return a | b

    def difference(self, a: int, b: int) -> int:
        return a ^ b

    def with_bit(self, a: int, number: int, value: int) -> int:
        return a & ~(1 << number) | value << number

    def bit(self, a: int, number: int) -> int:
        return a >> number & 1

    def rotate_left(self, a: int, carry: int) -> int:
        return a << 1 & 0xFF | carry

    def rotate_right(self, a: int, carry: int) -> int:
        return a >> 1 | carry << 7

    def swap(self, a: int) -> int:
        return a << 4 & 0xFF | a >> 4

    def is_zero(self, a: int) -> int:
        return 1 - (a + 0xFF >> 8)


NUMBERS = Numbers()
