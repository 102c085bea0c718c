"""Constant propagation: the results of instructions on values of which some are known.

In: a program word, and the bytes and flags known before it. Out: those known after it. Values are kept by
place: a RAM address, `FSR`, or one of `W`, `CARRY` and `ZERO`; a missing place is not known.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cache, lru_cache

from servogen.pic.device import RAM_FIRST, RAM_LAST, addresses
from servogen.pic.isa import by_mnemonic, decode
from servogen.pic.semantics import NUMBERS, flags, result, row_of

INDF, PCL, STATUS, FSR = addresses("INDF", "PCL", "STATUS", "FSR")
W, CARRY, ZERO = -1, -2, -3
_FLAGS = {0: CARRY, 2: ZERO}
"""The bits of STATUS that are tracked."""
_BANK_BITS = (5, 6)
"""RP0 and RP1 in STATUS."""
_BANK_1 = 0x80
_POINTED = frozenset({CARRY, ZERO, *range(RAM_FIRST, RAM_LAST + 1)})
"""What a write through a pointer may change, besides FSR: a byte of RAM, or the flags in STATUS."""

NOT_FOLLOWED = ("SLEEP", "OPTION", "TRIS")
"""Instructions that stop the chip, or write a register without its address: `execute` does nothing of it."""

RETURNED = -1
"""The address after a return to which no call belongs."""

Known = dict[int, int]
"""Known values by place."""
Continuation = tuple[int, tuple[int, ...], int, Known]
"""Where execution continues: address, return addresses, the cycles of the instruction, what is known then."""


class Undefined(Exception):
    """Raised for a word that no data sheet defines."""


@dataclass(frozen=True, eq=False, slots=True)
class DecodedWord:
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
    writes_pcl: bool
    sets_carry: bool
    sets_zero: bool
    place: int | None
    """The place that f addresses, unless that is INDF."""

    @property
    def selects_bank_0(self) -> bool:
        """Whether it clears RP0 or RP1: of the two banks, bank 0 is then selected or stays so."""
        return self.name == "BCF" and self.f == STATUS and self.b in _BANK_BITS


@cache
def word_of(number: int) -> DecodedWord:
    """Return a decoded word. Raises Undefined."""
    decoded = decode(number)
    if decoded is None:
        raise Undefined
    row = decoded.instruction
    has_f = "f" in row.operands
    writes_f = row.writes_file(decoded.d)
    return DecodedWord(
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
        has_f=has_f,
        writes_f=writes_f,
        writes_w=row.writes_w(decoded.d),
        writes_pcl=writes_f and decoded.f == PCL,
        sets_carry="C" in row.flags,
        sets_zero="Z" in row.flags,
        place=place_of(decoded.f, {}) if has_f else None,
    )


@lru_cache(maxsize=1 << 16)
def known_result(
    mnemonic: str, w: int | None, f: int | None, k: int | None, b: int, carry: int | None
) -> tuple[int | None, int | None]:
    """Return the (result, carry) of an instruction from W, its byte, literal, bit and the carry; None: not
    known.
    """
    row = by_mnemonic()[mnemonic]
    operand = k if "k" in row.operands else f if "f" in row.reads else 0
    read = w if "W" in row.reads else 0
    if row_of(mnemonic) is None or operand is None or read is None:
        return None, None
    made = result(NUMBERS, mnemonic, operand, read, carry or 0, b)
    out = flags(NUMBERS, mnemonic, operand, read, made).get("C")
    return None if "C" in row.reads and carry is None else made, out


def renumbered(words: Iterable[int], places: Iterable[int]) -> tuple[list[int], tuple[int, ...]]:
    """Return words with the bytes of the RAM numbered in the order in which they name them, and `places` too.

    They do the same with these bytes, if none of them uses a pointer. Raises Undefined.
    """
    numbers: dict[int, int] = {}

    def number(place: int) -> int:
        return numbers.setdefault(place, RAM_FIRST + len(numbers))

    made = []
    for word in words:
        decoded = word_of(word)
        in_ram = decoded.has_f and RAM_FIRST <= decoded.f <= RAM_LAST
        made.append(word & ~0x7F | number(decoded.f) if in_ram else word)
    return made, tuple(number(place) for place in places)


def place_of(f: int, known: Known) -> int | None:
    """Return the place that an operand f addresses; None for places that are not tracked."""
    if f == INDF:
        if FSR not in known:
            return None
        f = known[FSR] & ~_BANK_1
    return f if f == FSR or RAM_FIRST <= f <= RAM_LAST else None


def skipped(word: DecodedWord, known: Known, changing: Collection[int] = ()) -> bool | None:
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
    counted = None if place is None else known.get(place)
    return None if counted is None else counted == 0


def execute(
    word: DecodedWord, known: Known, changing: Collection[int] = (), operand: int | None = None
) -> None:
    """Update what is known by executing an instruction; places that are `changing` are never known. `operand`
    is the byte that it reads where that is at no place that is tracked.
    """
    if word.f == STATUS and word.writes_f:
        _write_status(word, known)
        return
    place = word.place
    if place is None and word.has_f and word.f == INDF:
        place = place_of(INDF, known)
    value = known.get
    operand = operand if place is None else value(place)
    made, carry = known_result(word.name, value(W), operand, word.k, word.b, value(CARRY))
    if word.sets_carry:
        _put(known, CARRY, carry)
    if word.sets_zero:
        _put(known, ZERO, None if made is None else int(made == 0))
    if word.writes_w:
        _put(known, W, made)
    elif word.writes_f:
        if place is not None:
            _put(known, place, None if place in changing else made)
        elif word.f == INDF:
            for other in known.keys() & _POINTED:
                del known[other]  # it may be any of them


def step(address: int, stack: tuple[int, ...], word: DecodedWord, known: Known) -> list[Continuation]:
    """Execute one instruction; where it is not known whether a skip is taken, return both ways.

    Updates `known`. PCL and the cycles of a write to it are not followed.
    """
    if word.flow == "jump":
        return [(word.k, stack, 2, known)]
    if word.flow == "call":
        return [(word.k, (*stack, address + 1), 2, known)]
    if word.flow == "return":
        if word.name == "RETLW":
            known[W] = word.k
        return [(stack[-1], stack[:-1], 2, known) if stack else (RETURNED, (), 2, known)]
    if word.flow == "skip":
        taken = skipped(word, known)
        if taken is None:
            return [(address + 1, stack, 1, known), (address + 2, stack, 2, dict(known))]
        return [(address + 1 + taken, stack, 1 + taken, known)]
    execute(word, known)
    return [(address + 1, stack, 1, known)]


def _write_status(word: DecodedWord, known: Known) -> None:
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
