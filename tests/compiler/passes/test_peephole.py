"""Each short sequence that the peephole pass replaces, and what keeps it from doing so."""

from __future__ import annotations

from servogen.compiler.passes.peephole import peephole
from servogen.errors import Location
from tests.compiler.cases import every
from tests.compiler.ir.assembly import check, function

LIVE_W = "MOVWF gz; RETURN"
LIVE_Z = "BTFSC Z; INCF gz,F; RETURN"
LIVE_C = "BTFSC C; INCF gz,F; RETURN"


@every(
    ("before", "after"),
    [
        ("INCF ga,W; MOVWF ga; RETURN", "INCF ga,F; RETURN"),
        ("RLF ga,W; MOVWF ga; RETURN", "RLF ga,F; RETURN"),
        ("XORWF ga,W; MOVWF ga; RETURN", "XORWF ga,F; RETURN"),
        ("INCF PORTB,W; MOVWF PORTB; RETURN", "INCF PORTB,F; RETURN"),
        ("INCF ga,W; MOVWF ga; " + LIVE_W, None),
        ("INCF ga,W; MOVWF gb; RETURN", None),
        ("INCF ga,W; MOVWF ga+1; RETURN", None),
        ("INCF ga,F; MOVWF ga; RETURN", None),
        ("*INCF ga,W; MOVWF ga; RETURN", None),
        ("INCF ga,W; *MOVWF ga; RETURN", None),
        # one after the other, and the last ones of a block
        ("INCF ga,W; MOVWF ga; DECF gb,W; MOVWF gb; RETURN", "INCF ga,F; DECF gb,F; RETURN"),
        ("CLRF gz; INCF ga,W; MOVWF ga; a: RETURN", "CLRF gz; INCF ga,F; a: RETURN"),
    ],
)
def test_an_operation_through_w_is_done_in_place(before: str, after: str | None) -> None:
    check(peephole, before, after)


@every(
    ("before", "after"),
    [
        ("MOVLW 0; MOVWF ga; RETURN", "CLRF ga; RETURN"),
        ("MOVLW 1; MOVWF ga; RETURN", None),
        ("MOVLW 0; MOVWF ga; " + LIVE_W, None),
        ("MOVLW 0; MOVWF ga; " + LIVE_Z, None),
        ("MOVF ga,W; MOVWF ga; CLRF gb; RETURN", "CLRF gb; RETURN"),
        ("a: MOVF ga,W; MOVWF ga; b: DECFSZ gb,F; GOTO a; GOTO b", "a: b: DECFSZ gb,F; GOTO a; GOTO b"),
        ("MOVF ga,W; MOVWF gb; CLRF gb; RETURN", None),
        ("MOVF ga,W; MOVWF ga; " + LIVE_Z, None),
        ("MOVF ga,W; MOVWF ga; " + LIVE_W, None),
        ("MOVF va,W; MOVWF va; RETURN", None),
        ("MOVF PORTB,W; MOVWF PORTB; RETURN", None),
        ("MOVF ga,F; MOVWF ga; RETURN", None),
    ],
)
def test_zeros_are_cleared_and_nothing_is_copied_to_itself(before: str, after: str | None) -> None:
    check(peephole, before, after)


@every(
    ("before", "after"),
    [
        ("MOVLW 1; ADDWF ga,F; RETURN", "INCF ga,F; RETURN"),
        ("MOVLW 255; ADDWF ga,F; RETURN", "DECF ga,F; RETURN"),
        ("MOVLW 1; ADDWF ga,W; " + LIVE_W, "INCF ga,W; " + LIVE_W),
        ("MOVLW 1; ADDWF ga,F; " + LIVE_W, None), ("MOVLW 2; ADDWF ga,F; RETURN", None),
        ("MOVLW 254; ADDWF ga,F; RETURN", None), ("MOVLW 1; SUBWF ga,F; RETURN", None),
        ("MOVLW 1; ADDWF ga,F; " + LIVE_C, None),
        ("MOVLW 1; ADDWF ga,F; BTFSC DC; INCF gz,F; RETURN", None),
        ("MOVLW 1; ADDWF ga,F; " + LIVE_Z, "INCF ga,F; " + LIVE_Z),
        ("MOVF ga,W; ADDLW 1; " + LIVE_W, "INCF ga,W; " + LIVE_W),
        ("MOVF ga,W; ADDLW 255; " + LIVE_W, "DECF ga,W; " + LIVE_W),
        ("MOVF ga,W; ADDLW 3; " + LIVE_W, None), ("MOVF ga,F; ADDLW 1; " + LIVE_W, None),
        ("MOVF ga,W; ADDLW 1; MOVWF gb; " + LIVE_C, None),
        ("MOVLW 9; RETURN", "RETLW 9"), ("MOVLW 0; RETURN", "RETLW 0"), ("MOVLW 9; RETFIE", None),
        ("CLRF ga; RETURN", None), ("*MOVLW 9; RETURN", None),
    ],
)  # fmt: skip
def test_counting_and_constant_results(before: str, after: str | None) -> None:
    check(peephole, before, after)


@every(
    ("before", "after"),
    [
        ("MOVWF t; MOVF ga,W; XORWF t,W; " + LIVE_W, "XORWF ga,W; " + LIVE_W),
        ("MOVWF t; MOVF ga,W; ADDWF t,W; " + LIVE_W, "ADDWF ga,W; " + LIVE_W),
        ("MOVWF t; MOVF ga,W; SUBWF t,W; " + LIVE_W, None),
        ("MOVWF t; MOVF ga,W; XORWF t,F; MOVF t,W; " + LIVE_W, None),
        ("MOVWF t; MOVF ga,W; XORWF t,W; MOVWF gb; MOVF t,W; " + LIVE_W, None),
        ("MOVWF gt; MOVF ga,W; XORWF gt,W; " + LIVE_W, None),
        ("MOVWF t; MOVF t,W; XORWF t,W; " + LIVE_W, None),
        ("MOVWF t; COMF ga,W; XORWF t,W; " + LIVE_W, None),
        ("MOVWF t; MOVF ga,F; XORWF t,W; " + LIVE_W, None),
        ("MOVWF t; MOVF ga,W; XORWF gt,W; " + LIVE_W, None),
        ("MOVWF t; MOVF ga,W; *XORWF t,W; " + LIVE_W, None),
    ],
)
def test_a_value_is_combined_without_a_temporary(before: str, after: str | None) -> None:
    check(peephole, before, after)


@every(
    ("before", "after"),
    [
        ("MOVF ga,W; ANDLW 12; MOVWF ga; RETURN", "MOVLW 12; ANDWF ga,F; RETURN"),
        ("MOVF ga,W; XORLW 1; MOVWF ga; RETURN", "MOVLW 1; XORWF ga,F; RETURN"),
        ("MOVF ga,W; ADDLW 7; MOVWF ga; RETURN", "MOVLW 7; ADDWF ga,F; RETURN"),
        ("MOVF ga,W; SUBLW 7; MOVWF ga; RETURN", None),
        ("MOVF ga,W; ANDLW 12; MOVWF gb; RETURN", None),
        ("MOVF ga,F; ANDLW 12; MOVWF ga; RETURN", None),
        ("MOVF ga,W; ANDLW 12; MOVWF ga; " + LIVE_W, None),
        ("MOVF ga,W; ANDLW 12; *MOVWF ga; RETURN", None),
        # the result goes to the second operand, or to the first as the operation commutes
        ("MOVF ga,W; ANDWF gb,W; MOVWF gb; RETURN", "MOVF ga,W; ANDWF gb,F; RETURN"),
        ("MOVF ga,W; SUBWF gb,W; MOVWF gc; RETURN", None),
        ("MOVF ga,W; ANDWF gb,W; MOVWF ga; RETURN", "MOVF gb,W; ANDWF ga,F; RETURN"),
        ("MOVF ga,W; ADDWF gb,W; MOVWF ga; RETURN", "MOVF gb,W; ADDWF ga,F; RETURN"),
        ("MOVF ga,W; SUBWF gb,W; MOVWF ga; RETURN", None),
        ("MOVF ga,W; ANDWF gb,F; MOVWF ga; RETURN", None),
        ("MOVF ga,W; ANDWF gb,W; MOVWF ga; " + LIVE_W, None),
        ("MOVF ga,W; ANDWF gb,W; MOVWF gc; RETURN", None),
    ],
)
def test_a_store_becomes_the_operations_destination(before: str, after: str | None) -> None:
    check(peephole, before, after)


@every(
    ("before", "after"),
    [
        ("MOVF ga,W; IORLW 0; " + LIVE_Z, "MOVF ga,W; " + LIVE_Z),
        ("ANDLW 3; IORLW 0; " + LIVE_Z, "ANDLW 3; " + LIVE_Z),
        ("MOVF ga,W; IORLW 1; " + LIVE_Z, None),
        ("MOVF ga,F; IORLW 0; " + LIVE_Z, None),
        ("MOVLW 4; IORLW 0; " + LIVE_Z, None),
        ("RLF ga,W; IORLW 0; " + LIVE_Z, None),
        ("CALL g; IORLW 0; " + LIVE_Z, None),
    ],
)
def test_z_is_not_set_again(before: str, after: str | None) -> None:
    check(peephole, before, after)


def test_what_is_new_stands_where_the_first_instruction_stood() -> None:
    made = function("MOVF ga,W; ANDLW 12; MOVWF ga; RETURN")
    for line, ins in enumerate(made.instructions(), 1):
        ins.place = Location("main.c", line)
    assert peephole(made)
    assert [ins.place.line for ins in made.instructions() if ins.place] == [1, 1, 4]
