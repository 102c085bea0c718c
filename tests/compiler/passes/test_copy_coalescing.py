"""A temporary becomes the byte that it is copied to or from, unless both are needed at once."""

from __future__ import annotations

from itertools import combinations, pairwise
from random import Random

from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Byte
from servogen.compiler.passes.copy_coalescing import coalesce_copies, interference
from servogen.compiler.passes.liveness import Liveness
from tests.compiler.cases import every
from tests.compiler.ir.assembly import check, function
from tests.compiler.passes.test_meaning import Writer


@every(
    ("before", "after"),
    [
        ("CLRF t; INCF t,F; MOVF t,W; MOVWF l; MOVF l,W; MOVWF ga; RETURN",
         "CLRF l; INCF l,F; MOVF l,W; MOVWF l; MOVF l,W; MOVWF ga; RETURN"),
        ("MOVF l,W; MOVWF t; INCF t,F; MOVF t,W; MOVWF ga; RETURN",
         "MOVF l,W; MOVWF l; INCF l,F; MOVF l,W; MOVWF ga; RETURN"),
        # changed on the way
        ("CLRF t; INCF t,W; MOVWF l; MOVF l,W; MOVWF ga; RETURN",
         "CLRF l; INCF l,W; MOVWF l; MOVF l,W; MOVWF ga; RETURN"),
        # two temporaries: the first goes
        ("CLRF t; MOVF t,W; MOVWF t1; BTFSC t1,0; CLRF ga; RETURN",
         "CLRF t1; MOVF t1,W; MOVWF t1; BTFSC t1,0; CLRF ga; RETURN"),
        # both are changed while the other one is needed
        ("MOVF l,W; MOVWF t; INCF t,F; MOVF t,W; MOVWF ga; MOVF l,W; MOVWF gb; RETURN", None),
        ("MOVF l,W; MOVWF t; INCF l,F; MOVF t,W; MOVWF ga; MOVF l,W; MOVWF gb; RETURN", None),
        # two copies of the same value are no conflict
        ("MOVF l,W; MOVWF t; MOVF t,W; MOVWF ga; MOVF l,W; MOVWF gb; RETURN",
         "MOVF l,W; MOVWF l; MOVF l,W; MOVWF ga; MOVF l,W; MOVWF gb; RETURN"),
        # globals, volatile bytes and assembly stay; no temporary, nothing to merge
        ("MOVF ga,W; MOVWF t; INCF t,F; MOVF t,W; MOVWF gb; RETURN", None),
        ("MOVF l,W; MOVWF l1; INCF l1,F; MOVF l1,W; MOVWF gb; RETURN", None),
        ("*MOVF l,W; MOVWF t; BTFSC t,0; CLRF ga; RETURN", None),
        ("MOVF l,W; *MOVWF t; BTFSC t,0; CLRF ga; RETURN", None),
        ("MOVF l,F; MOVWF t; BTFSC t,0; CLRF ga; RETURN", None),
        ("MOVF l,W; ADDWF t,F; BTFSC t,0; CLRF ga; RETURN", None),
        ("ADDLW 1; MOVWF t; BTFSC t,0; CLRF ga; RETURN", None),
        # the bytes of others: only if no call and no other use comes between
        ("CLRF t; MOVF t,W; MOVWF x; CALL g; RETURN", "CLRF x; MOVF x,W; MOVWF x; CALL g; RETURN"),
        ("CLRF t; CALL h; MOVF t,W; MOVWF x; CALL g; RETURN", None),
        ("CLRF t; MOVF t,W; MOVWF x; CALL g; MOVF t,W; MOVWF ga; RETURN", None),
        ("CALL g; MOVF x,W; MOVWF t; MOVF t,W; MOVWF ga; RETURN",
         "CALL g; MOVF x,W; MOVWF x; MOVF x,W; MOVWF ga; RETURN"),
        ("MOVF x,W; MOVWF t; CALL g; MOVF t,W; MOVWF ga; RETURN", None),
        # the frames of g and h overlap: nothing is stored in one while the other is needed
        ("CALL h; MOVF y,W; MOVWF ga; CALL g; MOVF x,W; MOVWF t; MOVF t,W; MOVWF gb; RETURN",
         "CALL h; MOVF y,W; MOVWF ga; CALL g; MOVF x,W; MOVWF x; MOVF x,W; MOVWF gb; RETURN"),
        ("CALL h; CALL g; MOVF x,W; MOVWF t; MOVF y,W; MOVWF ga; MOVF t,W; MOVWF gb; RETURN", None),
        ("CALL g; MOVF x,W; MOVWF t; CLRF y; MOVF t,W; MOVWF gb; RETURN", None),
        ("CALL g; CLRF y; MOVF x,W; MOVWF t; MOVF t,W; MOVWF gb; RETURN",
         "CALL g; CLRF y; MOVF x,W; MOVWF x; MOVF x,W; MOVWF gb; RETURN"),
        ("CALL g; MOVF x,W; MOVWF t; CLRF l; CLRF x1; MOVF t,W; MOVWF gb; RETURN",
         "CALL g; MOVF x,W; MOVWF x; CLRF l; CLRF x1; MOVF x,W; MOVWF gb; RETURN"),
        # either of the two may be the temporary; a store of something else is no copy
        ("CALL g; INCF x,W; MOVWF t; MOVF t,W; MOVWF ga; RETURN",
         "CALL g; INCF x,W; MOVWF x; MOVF x,W; MOVWF ga; RETURN"),
        ("INCF l,F; MOVWF t; BTFSC t,0; CLRF ga; RETURN", None),
        ("MOVF va,W; MOVWF t; BTFSC t,0; CLRF ga; RETURN", None),
        ("MOVF t,W; MOVWF PORTB; RETURN", None),
    ],
)  # fmt: skip
def test_a_copy_and_its_source_are_merged(before: str, after: str | None) -> None:
    check(coalesce_copies, before, after)


@every(
    ("text", "expected"),
    [
        ("CLRF t; CLRF t1; MOVF t,W; ADDWF t1,W; MOVWF ga; RETURN", {"t t1"}),
        ("CLRF t; MOVF t,W; MOVWF ga; CLRF t1; MOVF t1,W; MOVWF ga; RETURN", set()),
        ("CLRF t; CALL g; MOVF t,W; MOVWF ga; MOVWF x; CALL g; RETURN", {"t x"}),
        ("MOVF p,W; ADDWF p1,W; MOVWF ga; RETURN", {"p p1"}),
        ("MOVF t,W; MOVWF t1; MOVF t1,W; MOVWF ga; MOVF t,W; MOVWF ga; RETURN", set()),
        # a call changes what it was given
        ("MOVF x,W; MOVWF t; CALL g; MOVF t,W; MOVWF ga; RETURN", {"t x"}),
        ("MOVF x,W; MOVWF y; CALL g; RETURN", {"x y"}),
        ("MOVF x,W; MOVWF t; CALL g; RETURN", set()),
        ("CLRF t; CLRF t1; BTFSC t1,0; CLRF ga; RETURN", set()),
        ("CLRF t1; CLRF t; BTFSC t1,0; CLRF ga; RETURN", {"t t1"}),
    ],
)
def test_bytes_that_are_needed_at_the_same_time(text: str, expected: set[str]) -> None:
    made = function(text)
    assert {" ".join(sorted(byte.symbol.name for byte in pair)) for pair in conflicts(made)} == expected


def conflicts(made: Function) -> set[frozenset[Byte]]:
    """The pairs that `interference` finds, each of which knows the other."""
    live = Liveness(made)
    found = interference(made, live)
    directed = {(one, two) for one, mask in found.items() for two in live.number if mask & live.bit(two)}
    assert {(two, one) for one, two in directed} == directed
    return {frozenset(pair) for pair in directed}


def test_bytes_conflict_if_one_is_written_while_the_other_is_needed() -> None:
    """Looked up pair by pair in random functions, with calls that write all bytes of other functions."""
    texts = [Writer(Random(seed)).text() for seed in range(400)]
    for text in [text for text in texts if "CALL" in text and " x" in text]:
        made = function(text)
        live = Liveness(made)
        own = {id(symbol) for symbol in made.own}
        foreign = {byte for byte in live.number if id(byte.symbol) not in own}
        expected = set()
        steps = [
            step
            for block in made.blocks
            for step in pairwise((None, *block.instructions))
            if step[1] is not None
        ]
        for before, ins in steps:
            needed = {byte for byte in live.number if live.after[ins] & live.bit(byte)}
            written: set[Byte] = {ins.f} if ins.writes_f and ins.f in live.number else set()  # type: ignore[arg-type]
            if ins.op == "CALL":
                written, needed = foreign, needed | foreign
            elif ins.op == "MOVWF" and before is not None and (before.op, before.d) == ("MOVF", 0):
                needed -= {before.f}  # type: ignore[arg-type]
            expected |= {frozenset((one, two)) for one in written for two in needed if one != two}
        entry = [byte for byte in live.number if live.entry & live.bit(byte)]
        expected |= {frozenset(pair) for pair in combinations(entry, 2)}
        assert conflicts(made) == expected
