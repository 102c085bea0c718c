"""A temporary becomes the byte that it is copied to or from, unless both are needed at once."""

from __future__ import annotations

from servogen.compiler.passes.copy_coalescing import coalesce_copies, interference
from servogen.compiler.passes.liveness import Liveness
from tests.compiler.cases import every
from tests.compiler.ir.assembly import check, function


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
        ("CLRF t; CLRF t1; BTFSC t1,0; CLRF ga; RETURN", set()),
        ("CLRF t1; CLRF t; BTFSC t1,0; CLRF ga; RETURN", {"t t1"}),
    ],
)
def test_bytes_that_are_needed_at_the_same_time(text: str, expected: set[str]) -> None:
    made = function(text)
    live = Liveness(made)
    found = interference(made, live)
    pairs = {
        " ".join(sorted((one.symbol.name, two.symbol.name)))
        for one, mask in found.items()
        for two in live.number
        if mask & live.bit(two)
    }
    assert pairs == expected
    # each of the two knows the other
    for one, mask in found.items():
        for two in live.number:
            assert bool(mask & live.bit(two)) == bool(found[two] & live.bit(one))
