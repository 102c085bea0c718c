"""A word of the program memory in the form of the instruction loop: the fields of an integer.

In: a decoded instruction. Out: an integer, numbered from the table of `pic.isa`.

    bit   0-5  6  7      8-14  15      16-23      24     25-32   33-
          op   d  flags  f     direct  mask of b  waits  period  clears

A literal k is in bits 8 to 18 instead of f and the rest. So are, from bit 8 on, a region's number, a wait's
period and clears, or the address of the byte with which TMR0 is compared, in the words that `regions.py`
substitutes for instructions.
"""

from __future__ import annotations

from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.pic.isa import INSTRUCTIONS, LEGACY, Decoded

_ON_FILES = [row.mnemonic for row in INSTRUCTIONS if "f" in row.operands]
_OTHERS = [row.mnemonic for row in (*INSTRUCTIONS, *LEGACY) if row.mnemonic not in _ON_FILES]
OPS = {mnemonic: number for number, mnemonic in enumerate((*_ON_FILES, *_OTHERS))}
"""The number of each instruction: those on file registers come first, else in the table's order."""

FILE_OPS = len(_ON_FILES)
"""The numbers below are those of instructions on file registers."""

MARKS = ("UNDEFINED", "ERASED", "EXIT", "LOOP", "SPIN", "UNTIL", "BREAK")
UNDEFINED, ERASED, EXIT, LOOP, SPIN, UNTIL, BREAK = range(len(OPS), len(OPS) + len(MARKS))
"""What else can stand in a place: a word that no data sheet defines; a word never programmed (DS35007
section 2.1); and what `regions.py` and breakpoints put in an instruction's stead."""

OP_MASK = 0x3F
D_BIT, FLAGS_BIT, F_SHIFT, DIRECT_BIT, MASK_SHIFT, WAITS_BIT, K_SHIFT = 6, 7, 8, 15, 16, 24, 8


def pack(decoded: Decoded) -> int:
    """Return the fields of one instruction as an integer. An instruction without d that writes a register has
    d = 1.
    """
    row = decoded.instruction
    word = OPS[row.mnemonic] | (row.flags != "") << FLAGS_BIT
    if "k" in row.operands:
        return word | decoded.k << K_SHIFT
    writes_back = row.writes_file(decoded.d)
    direct = "f" in row.operands and RAM_FIRST <= decoded.f <= RAM_LAST
    mask = 1 << decoded.b if "b" in row.operands else 0
    return word | writes_back << D_BIT | decoded.f << F_SHIFT | direct << DIRECT_BIT | mask << MASK_SHIFT
