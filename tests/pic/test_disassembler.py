"""Disassembly: it assembles to the same image, whatever the image; and it says what a reader needs."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.pic.assembler import assemble
from servogen.pic.device import DEVICES, device
from servogen.pic.disassembler import code_protected, disassemble
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.pic.spelling import assembly_text, cycles_text
from tests.campaigns import sampled

F84 = device("16F84")


def body(image: Image) -> list[str]:
    """The lines below the heading, without what is only for the assembler."""
    lines = disassemble(image, F84).splitlines()
    return [
        line.strip()
        for line in lines[lines.index("        radix hex") + 1 :]
        if line.strip() not in ("", "end")
    ]


@pytest.mark.parametrize("first", sampled(range(0, 0x4000, 0x400), 4))
def test_every_word_comes_back_from_its_disassembly(first: int) -> None:
    image = Image({address: first + address for address in range(0x400)})
    assert assemble(disassemble(image, F84)).image == image


@settings(max_examples=60)
@given(
    st.builds(
        Image,
        st.dictionaries(st.integers(0, 1023), st.integers(0, 0x3FFF), max_size=80),
        st.none() | st.integers(0, 0x3FFF),
        st.dictionaries(st.integers(0, 63), st.integers(0, 0xFF), max_size=20),
        st.dictionaries(st.integers(0, 3), st.integers(0, 0x3FFF) | st.integers(0, 0xF)),
    ),
    st.sampled_from(DEVICES),
)
def test_every_image_comes_back_from_its_disassembly(image: Image, chip: object) -> None:
    chosen = next(each for each in DEVICES if each == chip)
    again = assemble(disassemble(image, chosen))
    assert again.image == image
    assert again.device == chosen


def test_erased_words_in_rows_are_one_fill() -> None:
    image = Image({0: 0x2801, 1: 0x2800, **dict.fromkeys(range(2, 1024), 0x3FFF)})
    assert body(image)[-1].split(";")[0].strip() == "fill 0x3FFF, 0x3FE"
    assert assemble(disassemble(image, F84)).image == image


def test_jumps_go_to_labels() -> None:
    image = Image({0: 0x2805, 4: 0x0009, 5: 0x2007, 6: 0x2805, 7: 0x0008, 8: 0x2900})
    assert body(image) == [
        "org 0x000", "reset:", "GOTO at_005", "org 0x004", "interrupt:", "RETFIE", "at_005:", "CALL sub_007",
        "GOTO at_005", "sub_007:", "RETURN", "GOTO 0x100",
    ]  # fmt: skip


def test_registers_and_bits_have_their_names_and_the_other_bank_in_a_comment() -> None:
    image = Image({0: 0x1683, 1: 0x0186, 2: 0x1906, 3: 0x1A03, 4: 0x0081, 5: 0x0820})
    assert body(image) == [
        "org 0x000", "reset:", "BSF STATUS, RP0", "CLRF PORTB                      ; TRISB",
        "BTFSC PORTB, RB2                ; TRISB", "BTFSC STATUS, NOT_TO", "interrupt:",
        "MOVWF TMR0                      ; OPTION_REG",
        "MOVF 0x20, W",
    ]  # fmt: skip


def test_undefined_words_and_ignored_bits_are_data_with_the_reason() -> None:
    lines = body(Image({0: 0x0001, 1: 0x0100, 2: 0x33AB, 3: 0x3FFF, 4: 0x0103, 5: 0x0067}))
    assert [line.split(";")[-1].strip() for line in lines if line.startswith("dw")] == [
        "not defined by the data sheet",
        "executes as CLRW, with bits that the chip ignores",
        "executes as MOVLW 0xAB, with bits that the chip ignores",
        "erased, executes as ADDLW 0xFF",
        "not defined by the data sheet",
    ]
    assert "CLRW" in lines


def test_configuration_ids_and_eeprom_are_written() -> None:
    image = Image({}, 0x3FF1, {0: 1, 1: 0xFF, 0x20: 5}, {0: 1, 1: 2, 2: 0xA, 3: 0xF})
    assert body(image) == [
        "__config 0x3FF1                 ; XT oscillator, watchdog off, power-up timer on",
        "__idlocs 0x12AF",
        "org 0x2100                      ; data EEPROM from 0x00",
        "de 0x01, 0xFF",
        "org 0x2120                      ; data EEPROM from 0x20",
        "de 0x05",
    ]


def test_code_protection_is_stated() -> None:
    assert "CODE PROTECTED" in disassemble(Image({}, 0x0001), F84)
    assert "CODE PROTECTED" not in disassemble(Image({}, 0x3FF1), F84)
    assert "CODE PROTECTED" not in disassemble(Image({}), F84)
    assert code_protected(0x1FF1, F84)
    assert not code_protected(0x3FF0, F84)
    assert not code_protected(None, F84)


def test_the_text_names_the_device_and_is_the_same_each_time() -> None:
    image = Image({0: 0})
    assert disassemble(image, device("16F84A")).startswith("; PIC16F84A: 1 of 1024 program words\n")
    assert disassemble(image, F84) == disassemble(image, F84)


# -- the spelling of one word ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "text", "cycles"),
    [
        (0x0000, "NOP", "1"),
        (0x0782, "ADDWF PCL, F", "2"),  # a written PCL takes two cycles: DS33023 section 29
        (0x0702, "ADDWF PCL, W", "1"), (0x0082, "MOVWF PCL", "2"), (0x0182, "CLRF PCL", "2"),
        (0x0802, "MOVF PCL, W", "1"), (0x0B8C, "DECFSZ 0x0C, F", "1(2)"), (0x1D03, "BTFSS STATUS, Z", "1(2)"),
        (0x2123, "CALL 0x123", "2"), (0x34FF, "RETLW 0xFF", "2"), (0x0008, "RETURN", "2"),
        (0x0064, "CLRWDT", "1"), (0x0066, "TRIS PORTB", "1"), (0x0001, "dw 0x0001", ""),
    ],
)  # fmt: skip
def test_a_word_is_spelled_with_its_cycles(word: int, text: str, cycles: str) -> None:
    assert (assembly_text(word), cycles_text(word)) == (text, cycles)


def test_every_defined_word_has_one_or_two_cycles() -> None:
    for word in range(0x4000):
        assert (cycles_text(word) in ("1", "2", "1(2)")) == (decode(word) is not None)
