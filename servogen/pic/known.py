"""What an instruction does to values that are known, and to those that are not.

In: a program word and what is known before it. Out: what is known after it, by place: RAM addresses in
hexadecimal, "FSR", "W", and the flags "C" and "Z".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.pic.isa import decode
from servogen.pic.known_result import known_result

INDF, PCL, STATUS, FSR = 0, 2, 3, 4
C, Z = 0, 2
_BANK_1 = 0x80

Known = dict[str, int]
"""The bytes and bits that are known, by place."""


class Undefined(Exception):
    """A word that no data sheet defines."""


@dataclass(frozen=True, slots=True)
class Word:
    """An instruction and what of it is asked again and again: what it reads and where its result goes."""

    name: str
    f: int
    b: int
    k: int
    skips: bool
    flags: str
    has_f: bool
    writes_f: bool
    writes_w: bool


@cache
def word_of(number: int) -> Word:
    """Raises Undefined."""
    found = decode(number)
    if found is None:
        raise Undefined
    row, operands = found.instruction, found.instruction.operands
    name = row.mnemonic
    to_f = "f" in operands and (bool(found.d) if "d" in operands else name in ("MOVWF", "CLRF", "BCF", "BSF"))
    to_w = not to_f and operands in ("fd", "k", "") and name not in ("NOP", "CLRWDT", "TRIS", "OPTION")
    return Word(name, found.f, found.b, found.k, row.skips, row.flags, "f" in operands, to_f, to_w)


def _place(f: int, known: Known) -> str | None:
    """The name of what an operand f addresses; None for what is not followed."""
    if f == INDF:
        if "FSR" not in known:
            return None
        f = known["FSR"] & ~_BANK_1
    if f == FSR:
        return "FSR"
    return f"{f:02X}" if RAM_FIRST <= f <= RAM_LAST else None


def skipped(word: Word, known: Known) -> bool | None:
    """Whether the next instruction is skipped; None where that is not known."""
    name = word.name
    if name in ("BTFSC", "BTFSS"):
        if word.f == STATUS:
            bit = known.get({C: "C", Z: "Z"}.get(word.b, ""))
        else:
            value = known.get(_place(word.f, known) or "")
            bit = None if value is None else value >> word.b & 1
        return None if bit is None else bit == (name == "BTFSS")
    execute(word, known)
    result = known.get("W" if word.writes_w else _place(word.f, known) or "")
    return None if result is None else result == 0


def execute(word: Word, known: Known) -> None:
    """Changes what is known as the instruction does."""
    name = word.name
    place = _place(word.f, known) if word.has_f else None
    if word.f == STATUS and word.writes_f:
        flag = {C: "C", Z: "Z"}.get(word.b) if name in ("BCF", "BSF") else None
        if name not in ("BCF", "BSF"):
            known.pop("C", None)
            known.pop("Z", None)
        elif flag:
            known[flag] = int(name == "BSF")
        return
    result, carry = known_result(name, known.get("W"), known.get(place or ""), word.k, word.b, known.get("C"))
    for flag, letter in (("C", "C"), ("Z", "Z")):
        if letter in word.flags:
            known.pop(flag, None)
    if "Z" in word.flags and result is not None:
        known["Z"] = int(result == 0)
    if "C" in word.flags and carry is not None:
        known["C"] = carry
    if word.writes_f:
        if word.f == INDF and place is None and "FSR" not in known:
            for other in [key for key in known if key not in ("W", "C", "Z")]:
                del known[other]  # it may be any of them
        target = place
    else:
        target = "W" if word.writes_w else None
    if target is not None:
        known.pop(target, None)
        if result is not None:
            known[target] = result
