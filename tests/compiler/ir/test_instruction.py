"""What each instruction reads and writes, worked out from DS35007B table 7-2."""

from __future__ import annotations

from servogen.compiler.ast.nodes import AddressByte
from servogen.compiler.ir.instruction import (
    BIT_TESTS,
    BIT_WRITES,
    DELAY,
    ENDS,
    IDLE,
    IN_PLACE,
    JUMPING,
    PURE,
    RETURNS,
    SETS_Z,
    SKIPS,
    TARGETED,
    Byte,
    Imm,
    Instruction,
    Reg,
    assembly,
    exposed,
    operand_text,
)
from servogen.errors import Location
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, line

NAMES = Names()


def ins(text: str) -> Instruction:
    made = line(text, NAMES)
    assert isinstance(made, Instruction)
    return made


EVERY = "ADDWF ANDWF CLRF CLRW COMF DECF DECFSZ INCF INCFSZ IORWF MOVF MOVWF NOP RLF RRF SUBWF SWAPF XORWF "
EVERY += "BCF BSF BTFSC BTFSS ADDLW ANDLW CALL CLRWDT GOTO IORLW MOVLW RETFIE RETLW RETURN SLEEP SUBLW XORLW"


COMPUTING = "ADDWF ANDWF COMF DECF INCF IORWF RLF RRF SUBWF SWAPF XORWF"
WITH_Z = "ADDWF ANDWF CLRF CLRW COMF DECF INCF IORWF MOVF SUBWF XORWF ADDLW ANDLW IORLW SUBLW XORLW"


def test_the_kinds_of_instructions() -> None:
    known = set(EVERY.split())
    assert known >= {"NOP"} and len(known) == 35  # the chip has 35 instructions
    assert SKIPS & known == {"BTFSC", "BTFSS", "DECFSZ", "INCFSZ"}
    assert ENDS & known == {"GOTO", "RETURN", "RETLW", "RETFIE"}
    assert JUMPING & known == SKIPS | {"GOTO", "CALL", "RETURN", "RETLW", "RETFIE"}
    assert RETURNS & known == {"RETURN", "RETLW", "RETFIE"}
    assert TARGETED & known == {"GOTO", "CALL"}
    assert BIT_TESTS & known == {"BTFSC", "BTFSS"}
    assert BIT_WRITES & known == {"BCF", "BSF"}
    assert IDLE & known == {"NOP", "CLRWDT", "SLEEP"}
    assert PURE & known == known - SKIPS - ENDS - IDLE - {"CALL"}
    assert IN_PLACE & known == set(COMPUTING.split())
    assert SETS_Z & known == set(WITH_Z.split())


@every(
    ("text", "reads", "writes", "flags"),
    [
        ("ADDWF g,W", "W f", "W", "CDZ"), ("ADDWF g,F", "W f", "f", "CDZ"), ("SUBWF g,F", "W f", "f", "CDZ"),
        ("ANDWF g,W", "W f", "W", "Z"), ("MOVF g,W", "f", "W", "Z"), ("MOVF g,F", "f", "f", "Z"),
        ("MOVWF g", "W", "f", ""), ("CLRF g", "", "f", "Z"), ("CLRW", "", "W", "Z"),
        ("INCF g,F", "f", "f", "Z"), ("DECFSZ g,F", "f", "f", ""), ("INCFSZ g,W", "f", "W", ""),
        ("RLF g,F", "f C", "f", "C"), ("RRF g,W", "f C", "W", "C"), ("SWAPF g,W", "f", "W", ""),
        ("BSF g,3", "f", "f", ""), ("BTFSC g,3", "f", "", ""), ("MOVLW 3", "", "W", ""),
        ("ADDLW 3", "W", "W", "CDZ"), ("XORLW 3", "W", "W", "Z"), ("RETLW 3", "", "W", ""),
        ("RETURN", "W", "", ""), ("RETFIE", "W", "", ""), ("GOTO x", "", "", ""), ("CALL x", "W", "W", "CDZ"),
        ("NOP", "", "", ""), ("DELAY 9", "", "W", "CDZ"),
        # STATUS holds the flags
        ("MOVWF STATUS", "W", "f", "CDZ"), ("CLRF STATUS", "", "f", "CDZ"), ("BSF C", "f", "f", "CDZ"),
        ("BTFSC C", "f", "", ""), ("SWAPF STATUS,W", "f", "W", ""),
    ],
)  # fmt: skip
def test_what_an_instruction_reads_and_writes(text: str, reads: str, writes: str, flags: str) -> None:
    made = ins(text)
    found = [
        name for name, wanted in (("W", made.reads_w), ("f", made.reads_f), ("C", made.reads_carry)) if wanted
    ]
    assert " ".join(found) == reads
    assert " ".join(name for name, wanted in (("W", made.writes_w), ("f", made.writes_f)) if wanted) == writes
    assert made.flags == flags


@every(
    ("text", "leaves", "ends"),
    [
        ("GOTO x", True, True), ("RETURN", True, True), ("RETLW 1", True, True), ("BTFSC g,1", False, True),
        ("DECFSZ g,F", False, True), ("CALL x", False, False), ("MOVWF PCL", True, True),
        ("ADDWF PCL,F", True, True), ("ADDWF PCL,W", False, False), ("MOVF PCL,W", False, False),
        ("MOVWF PCLATH", False, False), ("MOVWF g", False, False), ("DELAY 3", False, False),
    ],
)  # fmt: skip
def test_where_a_block_ends(text: str, leaves: bool, ends: bool) -> None:
    assert (ins(text).leaves, ins(text).ends_block) == (leaves, ends)


def test_two_instructions_are_the_same_if_they_do_the_same() -> None:
    one = ins("ADDWF g,F")
    two = one.copy()
    two.place, two.fixed = Location("main.c", 1), True
    assert one.same(two) and one is not two
    for other in ("ADDWF g,W", "ADDWF gb,F", "SUBWF g,F"):
        assert not one.same(ins(other))
    assert not ins("BSF g,1").same(ins("BSF g,2"))
    assert not ins("MOVLW 1").same(ins("MOVLW 2"))
    assert not ins("GOTO a").same(ins("GOTO b"))


def test_what_is_observable() -> None:
    assert exposed(Reg(6)) and exposed(NAMES.loc("v"))
    assert not exposed(NAMES.loc("g")) and not exposed(Imm(6)) and not exposed(None)
    assert Imm(6) != 6 and Imm(6) != Reg(6) and Imm(6) == Imm(6)


def test_the_text_of_operands_and_instructions() -> None:
    g = NAMES["g"]
    assert operand_text(Byte(g, 0)) == "g" and operand_text(Byte(g, 2)) == "g+2"
    assert operand_text(Reg(0x86)) == "TRISB" and operand_text(Reg(0x87)) == "0x87"
    assert operand_text(AddressByte(g, 3, 0)) == "LOW(g+3)"
    assert operand_text(AddressByte(g, 3, 1)) == "HIGH(g+3)"
    assert operand_text(17) == "17"
    expected = {
        "ADDWF g,F": "ADDWF g, F", "MOVF g+1,W": "MOVF g+1, W", "BSF PORTB,3": "BSF PORTB, 3",
        "MOVLW 200": "MOVLW 200", "GOTO f.x": "GOTO f.x", "RETURN": "RETURN", "DELAY 12": "; delay 12 cycles",
    }  # fmt: skip
    assert {text: assembly(ins(text)) for text in expected} == expected
    assert {text: str(ins(text)) for text in expected} == expected
    assert ins("DELAY 12").op == DELAY
