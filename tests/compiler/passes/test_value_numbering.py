"""What is known about W and bytes: loads, stores and tests that add nothing, and constants."""

from __future__ import annotations

from servogen.compiler.passes.value_numbering import number_values
from tests.compiler.cases import every
from tests.compiler.ir.assembly import check, function, lines, texts

USE = "MOVWF gz"
TEST_Z = "BTFSC Z; INCF gz,F; RETURN"


@every(
    ("before", "after"),
    [
        ("MOVLW 5; MOVWF ga; MOVLW 5; MOVWF gb; RETURN", "MOVLW 5; MOVWF ga; MOVWF gb; RETURN"),
        ("MOVLW 5; MOVWF ga; MOVLW 6; MOVWF gb; RETURN", None),
        ("MOVF ga,W; MOVWF gb; MOVF ga,W; MOVWF gc; RETURN", "MOVF ga,W; MOVWF gb; MOVWF gc; RETURN"),
        ("MOVF ga,W; MOVWF gb; MOVF gb,W; MOVWF gc; RETURN", "MOVF ga,W; MOVWF gb; MOVWF gc; RETURN"),
        ("MOVF ga,W; MOVWF ga; RETURN", "MOVF ga,W; RETURN"),
        ("MOVF ga,W; MOVWF gb; MOVWF gb; RETURN", "MOVF ga,W; MOVWF gb; RETURN"),
        ("MOVF ga,W; INCF ga,F; MOVF ga,W; MOVWF gc; RETURN", None),
        ("MOVF ga,W; INCF gb,F; MOVF ga,W; MOVWF gc; RETURN", "MOVF ga,W; INCF gb,F; MOVWF gc; RETURN"),
        ("MOVF va,W; MOVWF gb; MOVF va,W; MOVWF gc; RETURN", None),
        ("MOVF PORTB,W; MOVWF gb; MOVF PORTB,W; MOVWF gc; RETURN", None),
        ("MOVLW 5; MOVWF ga; MOVF va,W; MOVWF gb; MOVLW 5; MOVWF gc; RETURN", None),
        ("MOVLW 5; MOVWF ga; MOVF PORTB,W; MOVWF gb; MOVLW 5; MOVWF gc; RETURN", None),
        ("MOVWF FSR; MOVWF FSR; RETURN", "MOVWF FSR; RETURN"),
        ("MOVF FSR,W; MOVWF gb; MOVF FSR,W; MOVWF gc; RETURN", "MOVF FSR,W; MOVWF gb; MOVWF gc; RETURN"),
        # Z is as before only if a load has set it
        ("MOVF ga,W; MOVWF gb; MOVF ga,W; " + TEST_Z, "MOVF ga,W; MOVWF gb; " + TEST_Z),
        ("MOVF ga,W; CLRF gb; MOVF ga,W; " + TEST_Z, None),
        ("MOVWF ga; MOVF ga,W; " + TEST_Z, None),
        ("MOVF ga,F; MOVF ga,F; " + TEST_Z, "MOVF ga,F; " + TEST_Z),
        ("INCF ga,F; MOVF ga,F; " + TEST_Z, "INCF ga,F; " + TEST_Z),
        ("MOVF ga,W; MOVWF gb; MOVF gb,F; " + TEST_Z, "MOVF ga,W; MOVWF gb; " + TEST_Z),
        ("RLF ga,F; MOVF ga,F; " + TEST_Z, None),
        ("MOVWF ga; MOVF ga,F; MOVWF ga; " + TEST_Z, "MOVWF ga; MOVF ga,F; " + TEST_Z),
        ("INCF va,F; MOVF va,F; " + TEST_Z, None),
        ("INCF ga,F; MOVF gb,F; " + TEST_Z, None),
        ("ANDLW 3; MOVWF ga; MOVF ga,F; " + TEST_Z, "ANDLW 3; MOVWF ga; " + TEST_Z),
        ("ANDLW 3; IORLW 0; " + TEST_Z, "ANDLW 3; " + TEST_Z),
        ("ANDLW 3; IORLW 1; " + TEST_Z, None),
        ("MOVLW 3; IORLW 0; " + TEST_Z, None),
        ("ANDLW 3; CLRF STATUS; IORLW 0; " + TEST_Z, None),
        ("CLRF ga; MOVLW 0; MOVWF ga; RETURN", "CLRF ga; MOVLW 0; RETURN"),
        ("CLRF ga; CLRF ga; RETURN", "CLRF ga; RETURN"),
        ("CLRW; MOVWF ga; MOVLW 0; MOVWF gb; RETURN", "CLRW; MOVWF ga; MOVWF gb; RETURN"),
        ("CLRW; MOVWF ga; MOVLW 1; MOVWF gb; RETURN", None),
        ("CLRF ga; CLRF ga; " + TEST_Z, None),
        ("CLRF ga; INCF gb,F; CLRF ga; RETURN", "CLRF ga; INCF gb,F; RETURN"),
        ("CLRF va; CLRF va; RETURN", None),
        ("CLRF PORTB; CLRF PORTB; RETURN", None),
        # assembly stays
        ("MOVLW 5; *MOVLW 5; MOVWF ga; RETURN", None),
        ("MOVLW 5; *NOP; MOVLW 5; MOVWF ga; RETURN", "MOVLW 5; *NOP; MOVWF ga; RETURN"),
        ("MOVLW 5; *CLRF ga; MOVLW 5; MOVWF ga; RETURN", None),
    ],
)
def test_nothing_is_loaded_stored_or_tested_twice(before: str, after: str | None) -> None:
    check(number_values, before, after)


@every(
    ("before", "after"),
    [
        ("MOVLW 5; MOVWF ga; COMF gb,W; MOVF ga,W; MOVWF gz; RETURN",
         "MOVLW 5; MOVWF ga; COMF gb,W; MOVLW 5; MOVWF gz; RETURN"),
        ("CLRF ga; COMF gb,W; MOVF ga,W; MOVWF gz; RETURN", "CLRF ga; COMF gb,W; MOVLW 0; MOVWF gz; RETURN"),
        ("MOVLW 5; MOVWF ga; COMF gb,W; MOVF ga,W; " + TEST_Z, None),
        ("MOVLW 5; MOVWF ga; COMF gb,W; ADDWF ga,W; MOVWF gz; RETURN",
         "MOVLW 5; MOVWF ga; COMF gb,W; ADDLW 5; MOVWF gz; RETURN"),
        ("MOVLW 5; MOVWF ga; COMF gb,W; SUBWF ga,W; MOVWF gz; RETURN",
         "MOVLW 5; MOVWF ga; COMF gb,W; SUBLW 5; MOVWF gz; RETURN"),
        ("MOVLW 5; MOVWF ga; COMF gb,W; ADDWF ga,F; RETURN", None),
        ("MOVLW 5; MOVWF va; COMF gb,W; ADDWF va,W; MOVWF gz; RETURN", None),
        ("MOVLW 5; MOVWF ga; COMF gb,W; COMF ga,W; MOVWF gz; RETURN", None),
        ("CLRF ga; COMF gb,W; XORWF ga,W; " + TEST_Z, "CLRF ga; COMF gb,W; XORLW 0; " + TEST_Z),
    ],
)  # fmt: skip
def test_a_byte_with_a_known_value_is_a_literal(before: str, after: str | None) -> None:
    check(number_values, before, after)


@every(
    ("before", "after"),
    [
        # the same operation on the same values gives the same result
        ("MOVF ga,W; ANDLW 3; MOVWF gb; MOVF ga,W; ANDLW 3; MOVWF gb; RETURN",
         "MOVF ga,W; ANDLW 3; MOVWF gb; MOVF ga,W; ANDLW 3; RETURN"),
        ("MOVF ga,W; ANDLW 3; MOVWF gb; MOVF ga,W; ANDLW 7; MOVWF gb; RETURN", None),
        ("MOVF ga,W; ANDWF gc,W; MOVWF gb; MOVF ga,W; ANDWF gc,W; MOVWF gb; RETURN",
         "MOVF ga,W; ANDWF gc,W; MOVWF gb; MOVF ga,W; ANDWF gc,W; RETURN"),
        ("MOVF ga,W; ANDWF vc,W; MOVWF gb; MOVF ga,W; ANDWF vc,W; MOVWF gb; RETURN", None),
        ("MOVF ga,W; ANDLW 3; MOVWF gb; MOVF ga,W; IORLW 3; MOVWF gb; RETURN", None),
        ("COMF ga,W; MOVWF gb; COMF ga,W; MOVWF gb; RETURN", None),
        # what a call, a pointer, a delay or an overlapping variable may have changed
        ("MOVF ga,W; MOVWF gb; CALL g; MOVF ga,W; MOVWF gc; RETURN", None),
        ("MOVLW 4; MOVWF l; CALL g; MOVF l,W; MOVWF gc; RETURN",
         "MOVLW 4; MOVWF l; CALL g; MOVLW 4; MOVWF gc; RETURN"),
        ("MOVLW 4; MOVWF x; CALL g; MOVF x,W; MOVWF gc; RETURN", None),
        ("MOVLW 4; MOVWF n; CALL g; MOVF n,W; MOVWF gc; RETURN", None),
        ("CLRF ga; CLRF INDF; COMF gb,W; MOVF ga,W; MOVWF gc; RETURN", None),
        ("CLRF l; CLRF INDF; COMF gb,W; MOVF l,W; MOVWF gc; RETURN",
         "CLRF l; CLRF INDF; COMF gb,W; MOVLW 0; MOVWF gc; RETURN"),
        ("CLRF FSR; CLRF INDF; CLRF FSR; RETURN", "CLRF FSR; CLRF INDF; RETURN"),
        ("MOVLW 4; MOVWF INDF; MOVLW 4; MOVWF ga; RETURN", "MOVLW 4; MOVWF INDF; MOVWF ga; RETURN"),
        ("MOVLW 4; DELAY 20; MOVLW 4; MOVWF ga; RETURN", None),
        ("CLRF ga; DELAY 20; CLRF ga; RETURN", "CLRF ga; DELAY 20; RETURN"),
        ("ANDLW 1; MOVWF ga; DELAY 20; MOVF ga,F; " + TEST_Z, None),
        ("CLRF fa; CLRF fb; CLRF fa; RETURN", None),
        ("CLRF fa; CLRF gb; CLRF fa; RETURN", "CLRF fa; CLRF gb; RETURN"),
        ("CLRF fa; CLRF fa; RETURN", "CLRF fa; RETURN"),
        ("CLRF ga; CLRF fb; CLRF ga; RETURN", "CLRF ga; CLRF fb; RETURN"),
    ],
)  # fmt: skip
def test_what_is_forgotten(before: str, after: str | None) -> None:
    check(number_values, before, after)


@every(
    ("before", "after"),
    [
        # a temporary that is a copy of a variable
        ("MOVF ga,W; MOVWF t; COMF gb,W; ADDWF t,W; MOVWF gz; RETURN",
         "MOVF ga,W; MOVWF t; COMF gb,W; ADDWF ga,W; MOVWF gz; RETURN"),
        ("MOVF ga,W; MOVWF t; BTFSC t,3; CLRF gz; RETURN", "MOVF ga,W; MOVWF t; BTFSC ga,3; CLRF gz; RETURN"),
        ("MOVF ga,W; MOVWF t; INCF ga,F; ADDWF t,W; MOVWF gz; RETURN", None),
        ("MOVF ga,W; MOVWF t; COMF gb,W; ADDWF t,F; MOVF t,W; MOVWF gz; RETURN", None),
        ("MOVF ga,W; MOVWF t; DECFSZ t,F; CLRF gz; RETURN", None),
        ("MOVF ga,W; MOVWF t; DECFSZ t,W; CLRF gz; RETURN", None),
        ("MOVF ga,W; MOVWF l; BTFSC l,3; CLRF gz; RETURN", None),
        ("MOVF x,W; MOVWF t; BTFSC t,3; CLRF gz; RETURN", None),
        ("MOVWF t; MOVWF ga; BTFSC t,3; CLRF gz; RETURN", None),
        ("MOVF va,W; MOVWF t; BTFSC t,3; CLRF gz; RETURN", None),
        ("MOVF l,W; MOVWF t; BTFSC t,3; CLRF gz; RETURN", "MOVF l,W; MOVWF t; BTFSC l,3; CLRF gz; RETURN"),
    ],
)  # fmt: skip
def test_a_copy_is_read_where_it_came_from(before: str, after: str | None) -> None:
    check(number_values, before, after)


@every(
    ("before", "after"),
    [
        # known on both ways
        ("BTFSC gc,0; GOTO a; MOVLW 1; GOTO b; a: MOVLW 1; b: MOVLW 1; MOVWF gz; RETURN",
         "BTFSC gc,0; GOTO a; MOVLW 1; GOTO b; a: MOVLW 1; b: MOVWF gz; RETURN"),
        ("BTFSC gc,0; GOTO a; MOVLW 1; GOTO b; a: MOVLW 2; b: MOVLW 1; MOVWF gz; RETURN", None),
        # on one of three
        ("BTFSC gc,0; GOTO b; BTFSC gc,1; GOTO b; MOVLW 1; b: MOVLW 1; MOVWF gz; RETURN", None),
        ("MOVLW 1; BTFSC gc,0; GOTO b; BTFSC gc,1; GOTO b; NOP; b: MOVLW 1; MOVWF gz; RETURN",
         "MOVLW 1; BTFSC gc,0; GOTO b; BTFSC gc,1; GOTO b; NOP; b: MOVWF gz; RETURN"),
        # over a skipped instruction
        ("MOVLW 1; BTFSC gc,0; MOVLW 2; MOVLW 1; MOVWF gz; RETURN", None),
        ("MOVLW 1; BTFSC gc,0; MOVWF ga; MOVLW 1; MOVWF gz; RETURN",
         "MOVLW 1; BTFSC gc,0; MOVWF ga; MOVWF gz; RETURN"),
        ("CLRF ga; BTFSC gc,0; INCF ga,F; MOVF ga,W; MOVWF gz; RETURN", None),
        ("CLRF gx; BTFSC gc,0; RETURN; CLRF gx; MOVWF gz; RETURN",
         "CLRF gx; BTFSC gc,0; RETURN; MOVWF gz; RETURN"),
        # nothing is known where a loop comes back
        ("MOVLW 1; b: MOVLW 1; MOVWF gz; GOTO b", None),
        ("MOVLW 1; MOVWF ga; b: MOVLW 2; MOVLW 2; MOVWF gz; GOTO b",
         "MOVLW 1; MOVWF ga; b: MOVLW 2; MOVWF gz; GOTO b"),
        # unreachable
        ("GOTO a; MOVLW 1; a: MOVLW 1; MOVWF gz; RETURN", None),
    ],
)  # fmt: skip
def test_where_ways_meet_only_what_holds_on_all_of_them_is_known(before: str, after: str | None) -> None:
    check(number_values, before, after)


def test_a_skip_that_is_skipped_keeps_its_byte() -> None:
    """In front of it stands another test of the same copy, which may read the original."""
    made = function("MOVF ga,W; MOVWF t; BTFSC t,3; BTFSC t,4; CLRF gz; RETURN")
    number_values(made)
    assert texts(made) == lines("MOVF ga,W; MOVWF t; BTFSC ga,3; BTFSC t,4; CLRF gz; RETURN")
