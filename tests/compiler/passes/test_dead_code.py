"""What is removed because nobody needs it, and what must stay."""

from __future__ import annotations

from servogen.compiler.ir.instruction import Instruction
from servogen.compiler.passes.dead_code import drop_dead, drop_unreachable, remove
from servogen.compiler.passes.liveness import Liveness
from tests.compiler.cases import every
from tests.compiler.ir.assembly import check, function, texts

KEEP_W, KEEP_Z, KEEP_C = "MOVWF gz; RETURN", "BTFSC Z; INCF gz,F; RETURN", "BTFSC C; INCF gz,F; RETURN"


@every(
    ("before", "after"),
    [
        ("GOTO a; NOP; CLRF gx; a: RETURN", "GOTO a; a: RETURN"),
        ("RETURN; NOP", "RETURN"),
        ("RETURN; a: NOP", "RETURN"),
        ("a: CLRF gx; RETURN", "CLRF gx; RETURN"),
        ("a: b: CLRF gx; GOTO b", "b: CLRF gx; GOTO b"),
        ("BTFSC Z; RETURN; CLRF gx; RETURN; NOP", "BTFSC Z; RETURN; CLRF gx; RETURN"),
        ("MOVWF PCL; CLRF gx; RETURN", None),
        ("CLRF gx; RETURN", None),
        ("GOTO a; b: CLRF gx; GOTO b; a: RETURN", "GOTO a; a: RETURN"),
        # assembly is reached, and what stands behind it in its block or after it
        ("RETURN; *NOP; CLRF gx; RETURN", None),
        ("RETURN; CLRF gx; *NOP; RETURN", "RETURN; *NOP; RETURN"),
        ("RETURN; *GOTO a; CLRF gx; a: RETURN", None),
        ("RETURN; *a: CLRF gx; RETURN", None),
        ("RETURN; CLRF gx; GOTO b; *a: CLRF gy; b: RETURN", "RETURN; *a: CLRF gy; RETURN"),
        ("RETURN; CLRF gx; GOTO b; *a: CLRF gy; GOTO b; b: RETURN", "RETURN; *a: CLRF gy; GOTO b; b: RETURN"),
        ("*BTFSC Z; RETURN; CLRF gx; RETURN", None),
        # reached from the start as well: all of the block stays
        ("GOTO a; NOP; a: CLRF gx; *NOP; RETURN", "GOTO a; a: CLRF gx; *NOP; RETURN"),
    ],
)
def test_what_is_not_reached_goes_with_the_labels_that_nobody_names(before: str, after: str | None) -> None:
    check(drop_unreachable, before, after)


@every(
    ("before", "after"),
    [
        ("MOVLW 1; MOVWF t; RETURN", "MOVLW 1; RETURN"),
        ("MOVLW 1; MOVLW 2; " + KEEP_W, "MOVLW 2; " + KEEP_W),
        ("MOVLW 1; CALL g; RETURN", None), ("MOVLW 1; MOVWF gx; RETURN", None),
        ("MOVLW 1; MOVWF n; RETURN", None), ("MOVLW 1; MOVWF v; RETURN", None),
        ("MOVLW 1; MOVWF PORTB; RETURN", None), ("CLRF t; RETURN", "RETURN"),
        ("CLRF t; MOVF t,W; " + KEEP_W, None), ("INCF t,F; RETURN", "RETURN"), ("BSF t,3; RETURN", "RETURN"),
        ("MOVF ga,W; RETURN", "RETURN"), ("MOVF v,W; RETURN", None), ("MOVF PORTB,W; RETURN", None),
        ("MOVF n,W; RETURN", "RETURN"), ("MOVF ga,F; RETURN", None), ("MOVF t,F; RETURN", "RETURN"),
        ("*MOVLW 1; RETURN", None), ("NOP; CLRWDT; SLEEP; RETURN", None), ("MOVF ga,W; " + KEEP_Z, None),
        ("ADDLW 1; " + KEEP_C, None), ("RLF ga,W; " + KEEP_C, None),
        ("RLF ga,W; " + KEEP_Z, "BTFSC Z; INCF gz,F; RETURN"),
        ("INCF ga,W; " + KEEP_C, KEEP_C),
        ("ADDLW 1; BTFSC DC; INCF gz,F; RETURN", None),
        ("BSF C; RETURN", None), ("CLRF STATUS; RETURN", None), ("DECFSZ t,F; NOP; RETURN", None),
        # only the flags of a store are needed: it goes to W
        ("INCF t,F; " + KEEP_Z, "INCF t,W; " + KEEP_Z),
        ("SUBWF t,F; " + KEEP_C, "SUBWF t,W; " + KEEP_C),
        ("INCF t,F; MOVF t,W; BTFSC Z; MOVWF gz; RETURN", None),
        ("INCF t,F; BTFSC Z; MOVWF gz; RETURN", None),
        ("MOVF t,F; " + KEEP_Z, None), ("INCF ga,F; " + KEEP_Z, None), ("*INCF t,F; " + KEEP_Z, None),
    ],
)  # fmt: skip
def test_what_nobody_reads_is_not_computed(before: str, after: str | None) -> None:
    check(drop_dead, before, after)


@every(
    ("before", "after"),
    [
        ("BTFSC ga,1; CLRF t; RETURN", "RETURN"), ("BTFSC Z; CLRF t; RETURN", "RETURN"),
        # the count of a DECFSZ is needed, and assembly stays
        ("DECFSZ ga,F; CLRF t; RETURN", None), ("*BTFSC ga,1; CLRF t; RETURN", None),
        # what a test reads of a register or a volatile byte is read even if nothing depends on it
        ("BTFSC PORTB,1; CLRF t; RETURN", None), ("BTFSS va,1; MOVLW 1; RETURN", None),
        ("BTFSS INDF,1; MOVLW 1; RETURN", None),
        ("BTFSC va,1; BTFSC ga,2; CLRF t; RETURN", None),
        ("BTFSC ga,1; BTFSC va,2; CLRF t; RETURN", None),
        # a skip over a skip goes with both, or not at all
        ("BTFSC ga,1; BTFSC ga,2; CLRF t; RETURN", "RETURN"),
        ("BTFSC ga,1; INCFSZ ga,W; CLRF t; RETURN", "RETURN"),
        ("BTFSC ga,1; INCFSZ ga,W; CLRF t; " + KEEP_W, None),
        ("BTFSC ga,1; INCFSZ ga,F; CLRF t; RETURN", None),
        ("DECFSZ ga,F; BTFSC ga,2; CLRF t; RETURN", None),
        # what stays in one place goes in others
        *((f"CLRF t; {skips}; CLRF t; CLRF t1; RETURN", f"{skips}; CLRF t; RETURN") for skips in (
            "DECFSZ ga,F", "*BTFSC ga,1", "BTFSC va,1", "BTFSC ga,1; INCFSZ ga,F", "DECFSZ ga,F; BTFSC ga,2",
            "BTFSC PORTB,1; BTFSC ga,2")),
    ],
)  # fmt: skip
def test_a_skip_goes_with_the_instruction_that_it_guards(before: str, after: str | None) -> None:
    check(drop_dead, before, after)


def test_two_dead_instructions_one_behind_the_other() -> None:
    made = function("BTFSC ga,1; CLRF t; CLRF t1; MOVLW 3; MOVWF gz; RETURN")
    dead = [each for each in made.lines() if isinstance(each, Instruction) and each.op == "CLRF"]
    assert remove(made, dead, Liveness(made))
    assert texts(made) == ["MOVLW 3", "MOVWF gz", "RETURN"]
