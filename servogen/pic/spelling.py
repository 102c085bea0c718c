"""The text of one word in assembly, and its cycles.

In: a 14-bit word. Out: text such as `BTFSC PORTB, RB3`, and the cycles as the data sheet writes them. An
instruction does not contain the bank: an address below 0x0C is given the name of its bank 0 register, and
`other_bank` returns its name when RP0 is 1.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from servogen.pic.device import LOW_ACTIVE_BITS, REGISTERS, Register, addresses
from servogen.pic.isa import Decoded, decode, encode

(PCL,) = addresses("PCL")


@cache
def _bank(number: int) -> dict[int, Register]:
    return {register.address & 0x7F: register for register in REGISTERS if register.address >> 7 == number}


def register_name(address: int) -> str:
    """Return the name of a bank 0 register, or the address."""
    register = _bank(0).get(address)
    return register.name if register else f"0x{address:02X}"


def other_bank(address: int) -> str | None:
    """Return the name of the register at this address in bank 1, if it differs."""
    register = _bank(1).get(address)
    return register.name if register else None


def bit_spelling(name: str) -> str:
    """Return the data sheet's name of a bit as written in assembly: a bar above it becomes NOT_."""
    return f"NOT_{name}" if name in LOW_ACTIVE_BITS else name


def bit_name(address: int, bit: int) -> str:
    """Return the name of a bit of a bank 0 register, or its number."""
    register = _bank(0).get(address)
    name = register.bit_names()[bit] if register else None
    return bit_spelling(name) if name else str(bit)


def hexadecimal(address: int) -> str:
    return f"0x{address:03X}"


def assembly_text(word: int, target: Callable[[int], str] = hexadecimal) -> str:
    """Return the instruction as text, a `dw` if the data sheet does not define it. `target` names jump
    targets.
    """
    decoded = decode(word)
    if decoded is None:
        return f"dw 0x{word:04X}"
    operands = ", ".join(_operand(decoded, field, target) for field in decoded.instruction.operands)
    return f"{decoded.instruction.mnemonic} {operands}".strip()


def _operand(decoded: Decoded, field: str, target: Callable[[int], str]) -> str:
    row = decoded.instruction
    if field == "f":
        return register_name(decoded.f)
    if field == "d":
        return "WF"[decoded.d]
    if field == "b":
        return bit_name(decoded.f, decoded.b)
    return target(decoded.k) if row.has_target else f"0x{decoded.k:02X}"


def is_exact(word: int) -> bool:
    """Return whether assembling the instruction's text gives this very word, including its ignored bits."""
    decoded = decode(word)
    if decoded is None:
        return False
    fields = {field: getattr(decoded, field) for field in decoded.instruction.operands}
    return encode(decoded.instruction.mnemonic, **fields) == word


def cycles_text(word: int) -> str:
    """Return the instruction cycles: "1", "2", or "1(2)" for a possible skip. Empty for an undefined word.

    An instruction that writes PCL takes 2 (DS33023 section 29, note of the instruction set's table).
    """
    decoded = decode(word)
    if decoded is None:
        return ""
    row = decoded.instruction
    if row.skips:
        return "1(2)"
    return "2" if row.writes_file(decoded.d) and decoded.f == PCL else str(row.cycles)
