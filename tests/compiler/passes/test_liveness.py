"""What is needed after each instruction, worked out by hand."""

from __future__ import annotations

from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Byte
from servogen.compiler.passes.liveness import C_BIT, D_BIT, W_BIT, Z_BIT, Liveness, is_private
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, function

FLAGS = {"W": W_BIT, "C": C_BIT, "D": D_BIT, "Z": Z_BIT}


def named(live: Liveness, bits: int) -> str:
    """The names of a bit set: W and the flags, then bytes."""
    flags = [name for name, bit in FLAGS.items() if bits & bit]
    bytes_ = sorted(
        byte.symbol.name + (f"+{byte.offset}" if byte.offset else "")
        for byte in live.number
        if bits & live.bit(byte)
    )
    known = sum(FLAGS.values()) + sum(live.bit(byte) for byte in live.number)
    assert bits & ~known == 0
    return " ".join([*flags, *bytes_])


def after(made: Function) -> list[str]:
    live = Liveness(made)
    return [named(live, live.after[ins]) for ins in made.instructions()]


@every(
    ("text", "needed"),
    [
        ("MOVLW 1; MOVWF t; MOVF t,W; MOVWF ga; RETURN", ["W", "t", "W", "", ""]),
        ("MOVF ga,W; ADDWF t,F; MOVF t,W; MOVWF ga; RETURN", ["W t", "t", "W", "", ""]),
        ("CLRF t; INCF t,F; BTFSC t,1; CLRF ga; RETURN", ["t", "t", "", "", ""]),
        ("ADDLW 1; BTFSC C; CLRF ga; RETURN", ["C", "", "", ""]),
        ("ADDLW 1; BTFSC Z; CLRF ga; RETURN", ["Z", "", "", ""]),
        ("ADDLW 1; BTFSC DC; CLRF ga; RETURN", ["D", "", "", ""]),
        ("ADDLW 1; BTFSC RP0; CLRF ga; RETURN", ["", "", "", ""]),
        ("BCF C; RLF ga,F; RETURN", ["C", "", ""]),
        ("BCF C; RLF t,F; RETURN", ["C t", "", ""]),
        ("ADDLW 1; BSF C; BTFSC C; CLRF ga; RETURN", ["", "C", "", "", ""]),
        ("ADDLW 1; BSF Z; BTFSC C; CLRF ga; RETURN", ["C", "C", "", "", ""]),
        ("ADDLW 1; MOVF STATUS,W; MOVWF ga; RETURN", ["C D Z", "W", "", ""]),
        ("ADDLW 1; SWAPF STATUS,W; MOVWF ga; RETURN", ["C D Z", "W", "", ""]),
        ("ADDLW 1; MOVWF STATUS; BTFSC C; CLRF ga; RETURN", ["W", "C", "", "", ""]),
        ("ADDLW 1; CLRF STATUS; BTFSC C; CLRF ga; RETURN", ["", "C", "", "", ""]),
        ("ADDLW 1; COMF STATUS,F; RETURN", ["C D Z", "", ""]),
        # a delay and a call change W and the flags; a call reads W and the bytes of other functions
        ("MOVLW 1; DELAY 9; MOVWF ga; RETURN", ["", "W", "", ""]),
        ("MOVWF t; DELAY 9; MOVF t,W; MOVWF ga; RETURN", ["t", "t", "W", "", ""]),
        ("ADDLW 1; DELAY 9; BTFSC Z; CLRF ga; RETURN", ["", "Z", "", "", ""]),
        ("MOVLW 1; CALL g; MOVWF ga; RETURN", ["W", "W", "", ""]),
        ("ADDLW 1; CALL g; BTFSC Z; CLRF ga; RETURN", ["W", "Z", "", "", ""]),
        ("MOVWF x; CALL g; MOVF x,W; MOVWF ga; RETURN", ["W x", "x", "W", "", ""]),
        ("MOVWF x; CALL g; RETURN", ["W x", "", ""]),
        ("MOVWF t; MOVWF x; CALL g; RETURN", ["W", "W x", "", ""]),
        # RETLW gives its own W; a jump to another function needs what a call does
        ("MOVWF x; RETLW 3", ["", ""]),
        ("MOVWF x; GOTO g", ["W x", "W x"]),
        ("MOVWF t; MOVWF x; GOTO g", ["W", "W x", "W x"]),
        # both ways of a skip, and around a loop
        ("MOVWF t; MOVWF t1; BTFSC ga,1; MOVF t,W; MOVWF gb; RETURN", ["W t", "W t", "W t", "W", "", ""]),
        ("MOVWF t; a: DECFSZ t,F; GOTO a; RETURN", ["t", "t", "t", ""]),
        ("MOVWF t; MOVLW 2; a: MOVWF t1; MOVF t,W; MOVWF ga; MOVF t1,W; GOTO a",
         ["t", "W t", "t t1", "W t t1", "t t1", "W t", "W t"]),
    ],
)  # fmt: skip
def test_what_is_live_after_each_instruction(text: str, needed: list[str]) -> None:
    assert after(function(text)) == needed


def test_w_and_the_result_are_needed_where_a_function_returns_them() -> None:
    names = Names()
    made = function("MOVLW 1; MOVWF t; MOVWF t+1; CLRF t1; RETURN", names)
    made.returns_w = True
    assert after(made) == ["W", "W", "W", "W", ""]
    made.result = names["t"]
    made.returns_w = False
    assert after(made)[:4] == ["W t+2 t+3", "W t t+2 t+3", "t t+1 t+2 t+3", "t t+1 t+2 t+3"]
    constant = function("MOVLW 1; RETLW 5")
    constant.returns_w = True
    assert after(constant) == ["", ""]
    other = function("MOVLW 1; GOTO g", names)
    assert after(other)[0] == "W"


def test_what_is_live_on_entry() -> None:
    for text, needed in (
        ("MOVWF p1; MOVF p,W; ADDWF p1,F; MOVF p1,W; MOVWF ga; RETURN", "W p"),
        ("CLRF t; BTFSC ga,0; MOVF l,W; MOVWF gb; RETURN", "W l"),
        ("RLF ga,F; RETURN", "C"),
    ):
        live = Liveness(function(text))
        assert named(live, live.entry) == needed
    assert Liveness(Function("f")).entry == 0


def test_before_an_instruction_is_what_it_needs_and_what_it_does_not_overwrite() -> None:
    made = function("MOVWF t; ADDWF t,F; MOVF t,W; MOVWF ga; RETURN")
    live = Liveness(made)
    assert [named(live, live.before(ins)) for ins in made.instructions()] == ["W", "W t", "t", "W", ""]


def test_only_what_no_pointer_reaches_is_private() -> None:
    names = Names()
    found = [name for name in ("t", "l", "p", "x", "n", "g", "v", "f") if is_private(Byte(names[name], 0))]
    assert found == ["t", "l", "p", "x"]
    names["l"].volatile = True
    assert not is_private(Byte(names["l"], 0))
    assert not is_private("t") and not is_private(None)


def test_bytes_of_other_functions_are_known() -> None:
    live = Liveness(function("MOVWF x; MOVWF t; MOVF x+1,W; MOVWF ga; RETURN"))
    assert named(live, live.foreign) == "x x+1"
