"""Instructions of assembly against words typed from the data sheet's encodings (DS35007, section 7)."""

from __future__ import annotations

from typing import Any

import pytest

from servogen.errors import InputError, Location
from servogen.pic.assembler.expressions import Here, Name, Number, spelling
from servogen.pic.assembler.instructions import (
    ParsedInstruction,
    encode_instruction,
    mnemonics,
    parse_line,
    takes_label,
)

PLAIN = [
    ("addwf 0x20, 0", 0x0720), ("addwf 0x20, 1", 0x07A0), ("andwf 0x20, w", 0x0520),
    ("andwf 0x20, f", 0x05A0), ("clrf 0x20", 0x01A0), ("clrw", 0x0103), ("comf 0x20, W", 0x0920),
    ("decf 0x20, F", 0x03A0), ("decfsz 0x20, f", 0x0BA0), ("incf 0x20, f", 0x0AA0),
    ("incfsz 0x20, f", 0x0FA0), ("iorwf 0x20, w", 0x0420), ("movf 0x20, w", 0x0820), ("movwf 0x20", 0x00A0),
    ("nop", 0x0000), ("rlf 0x20, f", 0x0DA0), ("rrf 0x20, f", 0x0CA0), ("subwf 0x20, w", 0x0220),
    ("swapf 0x20, w", 0x0E20), ("xorwf 0x20, f", 0x06A0), ("bcf 3, 5", 0x1283), ("bsf 3, 5", 0x1683),
    ("btfsc 6, 7", 0x1B86), ("btfss 6, 0", 0x1C06), ("addlw 0x12", 0x3E12), ("andlw 0x12", 0x3912),
    ("call 0x123", 0x2123), ("clrwdt", 0x0064), ("goto 0x123", 0x2923), ("iorlw 0x12", 0x3812),
    ("movlw 0x12", 0x3012), ("retfie", 0x0009), ("retlw 0x12", 0x3412), ("return", 0x0008), ("sleep", 0x0063),
    ("sublw 0x12", 0x3C12), ("xorlw 0x12", 0x3A12), ("option", 0x0062), ("tris 5", 0x0065),
    ("tris 6", 0x0066),
]  # fmt: skip


@pytest.mark.parametrize(("instruction", "expected"), PLAIN)
def test_each_instruction_has_the_data_sheets_word(asm: Any, instruction: str, expected: int) -> None:
    assert asm.word(instruction) == expected
    assert asm.word(instruction.upper().replace("0X", "0x")) == expected


# STATUS is register 3; C, DC and Z are its bits 0, 1 and 2; on 3,0 BCF is 0x1003, BSF 0x1403, BTFSC 0x1803,
# BTFSS 0x1C03
SPECIAL = {
    "skpc": [0x1C03], "skpnc": [0x1803], "skpdc": [0x1C83], "skpndc": [0x1883], "skpz": [0x1D03],
    "skpnz": [0x1903], "clrc": [0x1003], "setc": [0x1403], "clrdc": [0x1083], "setdc": [0x1483],
    "clrz": [0x1103], "setz": [0x1503], "movfw 0x20": [0x0820], "tstf 0x20": [0x08A0],
    "negf 0x20": [0x09A0, 0x0AA0], "negf 0x20, w": [0x09A0, 0x0A20], "addcf 0x20, f": [0x1803, 0x0AA0],
    "adddcf 0x20, w": [0x1883, 0x0A20], "subcf 0x20, f": [0x1803, 0x03A0], "subdcf 0x20, w": [0x1883, 0x0320],
    "b 0x10": [0x2810], "bc 0x10": [0x1803, 0x2810], "bnc 0x10": [0x1C03, 0x2810],
    "bdc 0x10": [0x1883, 0x2810], "bndc 0x10": [0x1C83, 0x2810], "bz 0x10": [0x1903, 0x2810],
    "bnz 0x10": [0x1D03, 0x2810], "lcall 0x10": [0x2010], "lgoto 0x10": [0x2810],
}  # fmt: skip


@pytest.mark.parametrize("instruction", SPECIAL)
def test_each_special_mnemonic_stands_for_its_instructions(asm: Any, instruction: str) -> None:
    assert asm.words(f" {instruction}") == SPECIAL[instruction]


def test_every_mnemonic_is_tested() -> None:
    tested = {instruction.split()[0].upper() for instruction in SPECIAL}
    assert tested | {text.split()[0].upper() for text, _ in PLAIN} == mnemonics()


def test_the_bank_bit_of_a_register_is_masked_with_message_302(asm: Any) -> None:
    assert asm.word("clrf 0x86") == 0x0186
    assert asm.remarks(" clrf 0x86") == ["1:2 302"]
    assert asm.remarks(" clrf 0x7F") == []


def test_a_destination_left_out_is_the_file_with_message_305(asm: Any) -> None:
    assert asm.word("incf 0x20") == 0x0AA0
    assert asm.remarks(" incf 0x20") == ["1:2 305"]


@pytest.mark.parametrize(
    ("instruction", "expected", "number"),
    [
        ("movlw 0x1FF", 0x30FF, 202), ("movlw -1", 0x30FF, None), ("movlw -0xFF", 0x3001, None),
        ("movlw -0x100", 0x3000, 202), ("bsf 3, 8", 0x1403, 202), ("movf 3, 2", 0x0803, 202),
        ("goto 0x400", 0x2C00, 220), ("call 0x801", 0x2001, 220), ("option", 0x0062, 224),
        ("tris 6", 0x0066, 224),
    ],
)  # fmt: skip
def test_a_value_that_does_not_fit_is_masked_and_remarked(
    asm: Any, instruction: str, expected: int, number: int | None
) -> None:
    assert asm.word(instruction) == expected
    assert asm.remarks(f" {instruction}") == ([] if number is None else [f"1:2 {number}"])


def test_tris_takes_the_two_ports_only(asm: Any) -> None:
    # TRIS 3 and TRIS 4 would be the words of SLEEP and CLRWDT
    for port in (3, 4, 7):
        assert asm.errors(f" tris {port}\n end") == [
            f"1:2 126 TRIS takes port 5 (PORTA) or 6 (PORTB), not {port}"
        ]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (" movlw\n end", "1:2 128 MOVLW needs 1 operand, not 0"),
        (" nop 1\n end", "1:2 127 NOP takes at most 0 operands, not 1"),
        (" bsf 3\n end", "1:2 128 BSF needs 2 operands, not 1"),
        (" goto 1, 2\n end", "1:2 127 GOTO takes at most 1 operand, not 2"),
        (" bsf 3,\n end", "1:2 128 BSF lacks an operand"),
        (" clrc 1\n end", "1:2 127 CLRC takes at most 0 operands, not 1"),
    ],
)
def test_the_number_of_operands_is_checked(asm: Any, source: str, expected: str) -> None:
    assert asm.errors(source) == [expected]


# -- one line, for inline assembly ---------------------------------------------------------------------


class Scope:
    here = 0x10

    def value(self, name: str) -> int | None:
        return {"PORTB": 6, "x": 0x20}.get(name)

    def hint(self, name: str) -> str | None:
        return None


PLACE = Location("main.c", 12, 10)


def test_a_line_is_parsed_into_symbolic_instructions() -> None:
    line = parse_line("loop: btfss PORTB, 3 ; wait", PLACE)
    assert line.label == "loop"
    (instruction,) = line.instructions
    assert instruction.mnemonic == "BTFSS"
    assert instruction.f == Name("PORTB", 22)
    assert instruction.b == Number(3, 29)
    assert (instruction.d, instruction.k) == (None, None)
    assert instruction.place == Location("main.c", 12, 16)
    assert encode_instruction(instruction, Scope()) == (0x1D86, ())


def test_the_destination_is_a_number_whatever_its_case() -> None:
    for text, number in (("W", 0), ("w", 0), ("F", 1), ("f", 1)):
        (instruction,) = parse_line(f" movf x, {text}", PLACE).instructions
        assert isinstance(instruction.d, Number)
        assert instruction.d.value == number


def test_a_special_mnemonic_is_its_instructions() -> None:
    line = parse_line("bnz $-1", PLACE)
    assert [each.mnemonic for each in line.instructions] == ["BTFSS", "GOTO"]
    assert encode_instruction(line.instructions[1], Scope()) == (0x280F, ())


def test_a_line_may_hold_a_label_only_or_nothing() -> None:
    assert parse_line("here:", PLACE).label == "here"
    assert parse_line("here:", PLACE).instructions == ()
    assert parse_line("  ; nothing", PLACE).label is None


def test_a_label_in_the_first_column_may_do_without_a_colon() -> None:
    assert parse_line("here", PLACE).label == "here"
    line = parse_line("here nop", PLACE)
    assert (line.label, [each.mnemonic for each in line.instructions]) == ("here", ["NOP"])
    assert parse_line("nop", PLACE).label is None
    for text in (" here nop", "here there"):  # a misspelt instruction
        with pytest.raises(InputError, match="unknown instruction 'here'"):
            parse_line(text, PLACE)


@pytest.mark.parametrize("name", ["goto", "CALL", "b", "BNZ", "lcall", "LGOTO"])
def test_the_operand_of_a_jump_is_a_label(name: str) -> None:
    assert takes_label(name)


@pytest.mark.parametrize("name", ["movlw", "TSTF", "skpz", "addcf", "nothing"])
def test_no_other_operand_is_a_label(name: str) -> None:
    assert not takes_label(name)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("x+1", "x + 1"), ("(1500+14)/4", "(1500 + 14) / 4"), ("low(x+1)", "low (x + 1)"), ("-0x10", "-16"),
        ("$-2", "$ - 2"), ("300-10-1", "300 - 10 - 1"), ("300-(10-1)", "300 - (10 - 1)"),
        ("1|2&3", "1 | 2 & 3"), ("~(x|1)", "~(x | 1)"),
    ],
)  # fmt: skip
def test_an_expression_is_shown_as_text(text: str, shown: str) -> None:
    (instruction,) = parse_line(f" movlw {text}", PLACE, radix=10).instructions
    assert instruction.k is not None
    assert spelling(instruction.k) == shown


def test_the_radix_is_the_callers_choice() -> None:
    hexadecimal = parse_line("movlw 10", PLACE).instructions[0]
    decimal = parse_line("movlw 10", PLACE, radix=10).instructions[0]
    assert isinstance(hexadecimal.k, Number)
    assert isinstance(decimal.k, Number)
    assert (hexadecimal.k.value, decimal.k.value) == (16, 10)


def test_dollar_stays_symbolic() -> None:
    (instruction,) = parse_line("goto $", PLACE).instructions
    assert isinstance(instruction, ParsedInstruction)
    assert instruction.k == Here(15)


def test_an_unknown_instruction_names_the_nearest_with_its_place() -> None:
    with pytest.raises(InputError) as error:
        parse_line(" mvlw 3", PLACE)
    assert (
        str(error.value)
        == "main.c:12:11: error: unknown instruction 'mvlw' [asm-syntax]\n  did you mean 'MOVLW'?"
    )


def test_a_defect_in_an_operand_has_its_column() -> None:
    with pytest.raises(InputError) as error:
        parse_line("movlw (1", PLACE)
    assert error.value.location == Location("main.c", 12, 16)
