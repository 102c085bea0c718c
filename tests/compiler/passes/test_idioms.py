"""The rows of the table of idioms: each leaves the same, is shorter, and applies only where it holds."""

from __future__ import annotations

import random
import re
from itertools import pairwise

import pytest

from servogen.compiler.passes.idioms import IDIOMS, shorten_idioms
from servogen.errors import Location
from servogen.pic.isa import by_mnemonic
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Chip, Names, check, function

ROWS = IDIOMS.strip().splitlines()
CORNERS = (0, 1, 2, 15, 16, 127, 128, 129, 254, 255)
STATES = 300
ALL_LIVE = "MOVWF gz; BTFSC Z; INCF gz,F; BTFSC C; INCF gz,F; RETURN"


def sides(row: str) -> tuple[str, str, set[str]]:
    old, _, rest = row.partition(" -> ")
    new, _, dead = rest.rstrip("]").partition(" [")
    return old, new, set(dead.split())


def left_different(old: str, new: str) -> set[str]:
    """What two sequences leave different for some of many states: `a`, `b`, W and the flags."""
    dice = random.Random(old)
    names = Names()
    a, b = names.loc("ga"), names.loc("gb")
    made = [function(re.sub(r"\b([ab])\b", r"g\1", side).replace(" k", " 77"), names) for side in (old, new)]
    literals = [ins for side in made for ins in side.instructions() if ins.k == 77]
    found: set[str] = set()
    for _ in range(STATES):
        literal, w, *held = (dice.choice([*CORNERS, dice.randrange(256)]) for _ in range(4))
        flags = [dice.random() < 0.5 for _ in range(3)]
        for ins in literals:
            ins.k = literal
        ends = []
        for side in made:
            chip = Chip({"f": side}, {a: held[0], b: held[1]})
            chip.w, (chip.c, chip.dc, chip.z) = w, flags
            chip.call("f")
            ends.append((chip.w, chip.memory[a], chip.memory[b], chip.c, chip.dc, chip.z))
        found |= {name for name, one, two in zip("WabCDZ", *ends, strict=True) if one != two}
    return found


@pytest.mark.parametrize("row", ROWS)
def test_both_sides_of_a_row_leave_the_same_but_for_what_is_dead(row: str) -> None:
    old, new, dead = sides(row)
    assert left_different(old, new) <= dead


def test_a_wrong_row_is_found() -> None:
    assert left_different("MOVF a,W; MOVWF b", "MOVF b,W") == {"W", "b", "Z"}
    assert left_different("INCF a,F", "DECF a,F") == {"a", "Z"}
    assert left_different("MOVF a,W; SUBWF b,W", "COMF a,W; ADDWF b,W; ADDLW 1") == {"C", "D"}
    assert left_different("MOVF a,W; XORLW 1", "DECF a,W") == {"W"}
    assert left_different("RLF a,W", "MOVF a,W; ADDWF a,W") == {"W", "D", "Z"}  # C is bit 7 of a, both times


@pytest.mark.parametrize("row", ROWS)
def test_a_row_saves_words_and_never_costs_a_cycle(row: str) -> None:
    """A skip takes two cycles instead of its own and the skipped one's: every instruction is one cycle."""
    old, new = (side.split("; ") for side in sides(row)[:2])
    assert len(new) < len(old)
    for side in (old, new):
        rows = [by_mnemonic()[text.split()[0]] for text in side]
        assert not any(each.has_target or each.flow == "return" for each in rows)
        assert not any(one.skips and two.skips for one, two in pairwise(rows)) and not rows[-1].skips


@every(
    ("before", "after"),
    [
        ("MOVF ga,W; XORLW 255; MOVWF gz; RETURN", "COMF ga,W; MOVWF gz; RETURN"),
        ("MOVF ga,W; XORLW 254; MOVWF gz; RETURN", None),
        # a literal that stands for any, the same one in both places
        ("MOVWF ga; MOVLW 9; ANDWF ga,W; MOVWF gz; RETURN", "MOVWF ga; ANDLW 9; MOVWF gz; RETURN"),
        ("MOVWF ga; MOVLW 9; ANDWF gb,W; MOVWF gz; RETURN", None),
        ("MOVWF ga; MOVLW gx; ANDWF ga,W; MOVWF gz; RETURN", None),
        # two bytes are two
        ("RRF gb,W; RRF ga,W; ANDLW 15; MOVWF gz; RETURN", "RRF ga,W; ANDLW 15; MOVWF gz; RETURN"),
        ("RRF ga,W; RRF ga,W; ANDLW 15; MOVWF gz; RETURN", None),
        # a byte of its own, W and the flags, only where they are not needed
        ("ADDWF t,F; MOVF t,W; MOVWF gz; RETURN", "ADDWF t,W; MOVWF gz; RETURN"),
        ("ADDWF t,F; MOVF t,W; MOVWF gz; MOVF t,W; MOVWF ga; RETURN", None),
        ("ADDWF ga,F; MOVF ga,W; MOVWF gz; RETURN", None),
        ("DECF ga,F; MOVF ga,W; BTFSC Z; INCF gz,F; RETURN", "DECF ga,F; BTFSC Z; INCF gz,F; RETURN"),
        (f"DECF ga,F; MOVF ga,W; {ALL_LIVE}", None),
        ("RLF t,F; MOVF t,W; MOVWF gz; RETURN", "RLF t,W; MOVWF gz; RETURN"),
        (f"RLF t,F; MOVF t,W; {ALL_LIVE}", None),
        # bits of STATUS keep their numbers
        ("BCF C; RRF ga,W; CLRW; MOVWF gz; BTFSC C; CLRF gz; RETURN",
         "RRF ga,W; CLRW; MOVWF gz; BTFSC C; CLRF gz; RETURN"),
        ("BCF DC; RRF ga,W; CLRW; MOVWF gz; BTFSC C; CLRF gz; RETURN", None),
        # registers, volatile bytes and bytes at fixed addresses, which others can see
        ("MOVF PORTB,W; XORLW 255; MOVWF gz; RETURN", None),
        ("MOVF va,W; XORLW 255; MOVWF gz; RETURN", None),
        ("MOVF fa,W; XORLW 255; MOVWF gz; RETURN", None),
        # behind a skip, in front of a label, and across one
        ("BTFSC gx,1; MOVF ga,W; XORLW 255; MOVWF gz; RETURN", None),
        ("MOVF ga,W; a: XORLW 255; MOVWF gz; GOTO a", None),
        ("a: MOVF ga,W; XORLW 255; MOVWF gz; GOTO a", "a: COMF ga,W; MOVWF gz; GOTO a"),
        ("MOVF ga,W; XORLW 255; MOVF gb,W; XORLW 255; RETURN", "COMF ga,W; MOVF gb,W; XORLW 255; RETURN"),
        ("*MOVF ga,W; XORLW 255; MOVWF gz; RETURN", None),
        ("MOVF ga,W; *XORLW 255; MOVWF gz; RETURN", None),
        ("a: GOTO a; MOVF ga,W", None),
    ],
)  # fmt: skip
def test_a_row_is_applied(before: str, after: str | None) -> None:
    check(shorten_idioms, before, after)


def test_what_is_new_stands_where_the_first_instruction_stood() -> None:
    made = function("MOVF ga,W; XORLW 255; MOVWF gz; RETURN")
    for number, ins in enumerate(made.instructions(), 1):
        ins.place = Location("main.c", number)
    assert shorten_idioms(made)
    assert [ins.place.line for ins in made.instructions() if ins.place] == [1, 3, 4]
