"""Constant propagation: the results of instructions on values of which some are known (DS35007 section 7).

In: a program word, and the bytes and flags known before it. Out: those known after it. Values are kept by
place: a RAM address, `FSR`, or one of `W`, `CARRY` and `ZERO`; a missing place is not known.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache

from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.pic.isa import decode

INDF, PCL, STATUS, FSR = 0, 2, 3, 4
W, CARRY, ZERO = -1, -2, -3
_FLAGS = {0: CARRY, 2: ZERO}
"""The bits of STATUS that are tracked."""
_BANK_1 = 0x80

Known = dict[int, int]
"""Known values by place."""


class Undefined(Exception):
    """Raised for a word that no data sheet defines."""


@dataclass(frozen=True, slots=True)
class Word:
    """A decoded instruction with derived facts that are needed often."""

    name: str
    f: int
    d: int
    b: int
    k: int
    flow: str
    flags: str
    reads: str
    tests_bit: bool
    changes_bit: bool
    has_f: bool
    writes_f: bool
    writes_w: bool

    @property
    def writes_pcl(self) -> bool:
        return self.f == PCL and self.writes_f


@cache
def word_of(number: int) -> Word:
    """Return a decoded word. Raises Undefined."""
    decoded = decode(number)
    if decoded is None:
        raise Undefined
    row = decoded.instruction
    return Word(
        name=row.mnemonic,
        f=decoded.f,
        d=decoded.d,
        b=decoded.b,
        k=decoded.k,
        flow=row.flow,
        flags=row.flags,
        reads=row.reads,
        tests_bit=row.tests_bit,
        changes_bit=row.changes_bit,
        has_f="f" in row.operands,
        writes_f=row.writes_file(decoded.d),
        writes_w=row.writes_w(decoded.d),
    )


_OF_ONE: Mapping[str, Callable[[int, int], int]] = {
    "MOVF": lambda f, b: f,
    "INCF": lambda f, b: f + 1,
    "INCFSZ": lambda f, b: f + 1,
    "DECF": lambda f, b: f - 1,
    "DECFSZ": lambda f, b: f - 1,
    "COMF": lambda f, b: ~f,
    "SWAPF": lambda f, b: f << 4 | f >> 4,
    "BSF": lambda f, b: f | 1 << b,
    "BCF": lambda f, b: f & ~(1 << b),
}
_OF_TWO: Mapping[str, Callable[[int, int], tuple[int, int | None]]] = {
    "ADD": lambda value, w: (value + w, int(value + w > 0xFF)),
    "SUB": lambda value, w: (value - w, int(value >= w)),
    "AND": lambda value, w: (value & w, None),
    "IOR": lambda value, w: (value | w, None),
    "XOR": lambda value, w: (value ^ w, None),
}


def known_result(
    mnemonic: str, w: int | None, f: int | None, k: int | None, b: int, carry: int | None
) -> tuple[int | None, int | None]:
    """Return the (result, carry) of an instruction from W, its byte, literal, bit and the carry; None: not
    known.
    """
    if mnemonic == "MOVLW":
        return k, None
    if mnemonic == "MOVWF":
        return w, None
    if mnemonic in ("CLRF", "CLRW"):
        return 0, None
    if f is not None and mnemonic in _OF_ONE:
        return _OF_ONE[mnemonic](f, b) & 0xFF, None
    if f is not None and mnemonic == "RLF":
        return None if carry is None else (f << 1 | carry) & 0xFF, f >> 7
    if f is not None and mnemonic == "RRF":
        return None if carry is None else f >> 1 | carry << 7, f & 1
    other = k if mnemonic.endswith("LW") else f
    if w is None or other is None or mnemonic[:3] not in _OF_TWO:
        return None, None
    result, out = _OF_TWO[mnemonic[:3]](other, w)
    return result & 0xFF, out


def place_of(f: int, known: Known) -> int | None:
    """Return the place that an operand f addresses; None for places that are not tracked."""
    if f == INDF:
        if FSR not in known:
            return None
        f = known[FSR] & ~_BANK_1
    return f if f == FSR or RAM_FIRST <= f <= RAM_LAST else None


def skipped(word: Word, known: Known, changing: Collection[int] = ()) -> bool | None:
    """Return whether the next instruction is skipped; None if that is not known. Updates `known`."""
    if word.tests_bit:
        if word.f == STATUS:
            bit = known.get(_FLAGS.get(word.b, PCL))
        else:
            place = place_of(word.f, known)
            value = None if place is None else known.get(place)
            bit = None if value is None else value >> word.b & 1
        return None if bit is None else bit == (word.name == "BTFSS")
    place = W if word.writes_w else place_of(word.f, known)
    execute(word, known, changing)
    result = None if place is None else known.get(place)
    return None if result is None else result == 0


def execute(word: Word, known: Known, changing: Collection[int] = ()) -> None:
    """Update what is known by executing an instruction; places that are `changing` are never known."""
    name = word.name
    place = place_of(word.f, known) if word.has_f else None
    if word.f == STATUS and word.writes_f:
        _write_status(word, known)
        return
    operand = None if place is None else known.get(place)
    result, carry = known_result(name, known.get(W), operand, word.k, word.b, known.get(CARRY))
    if "C" in word.flags:
        _put(known, CARRY, carry)
    if "Z" in word.flags:
        _put(known, ZERO, None if result is None else int(result == 0))
    if word.writes_w:
        _put(known, W, result)
    elif word.writes_f and place is not None:
        _put(known, place, None if place in changing else result)
    elif word.writes_f and word.f == INDF:
        for other in [address for address in known if address >= RAM_FIRST]:
            del known[other]  # it may be any of them


def _write_status(word: Word, known: Known) -> None:
    if word.changes_bit:
        if word.b in _FLAGS:
            known[_FLAGS[word.b]] = int(word.name == "BSF")
        return
    known.pop(CARRY, None)
    known.pop(ZERO, None)


def _put(known: Known, place: int, value: int | None) -> None:
    if value is None:
        known.pop(place, None)
    else:
        known[place] = value
