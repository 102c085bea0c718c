"""The instruction table against a second one, typed from the data sheet: PIC16F84A DS35007, table 7-2.

OPTION and TRIS, which the table leaves out, are from PIC16F84 DS30430, section 9.
"""

from __future__ import annotations

import pytest

from servogen.pic.isa import (
    INSTRUCTIONS,
    LEGACY,
    WORD_MASK,
    by_mnemonic,
    decode,
    encode,
    literal_forms,
    mnemonics,
)

# mnemonic, fixed bits and fields from bit 13 down, cycles, status bits affected
WITNESS = """
ADDWF   000111dfffffff 1   C,DC,Z
ANDWF   000101dfffffff 1   Z
CLRF    0000011fffffff 1   Z
CLRW    0000010xxxxxxx 1   Z
COMF    001001dfffffff 1   Z
DECF    000011dfffffff 1   Z
DECFSZ  001011dfffffff 1(2) -
INCF    001010dfffffff 1   Z
INCFSZ  001111dfffffff 1(2) -
IORWF   000100dfffffff 1   Z
MOVF    001000dfffffff 1   Z
MOVWF   0000001fffffff 1   -
NOP     0000000xx00000 1   -
RLF     001101dfffffff 1   C
RRF     001100dfffffff 1   C
SUBWF   000010dfffffff 1   C,DC,Z
SWAPF   001110dfffffff 1   -
XORWF   000110dfffffff 1   Z
BCF     0100bbbfffffff 1   -
BSF     0101bbbfffffff 1   -
BTFSC   0110bbbfffffff 1(2) -
BTFSS   0111bbbfffffff 1(2) -
ADDLW   11111xkkkkkkkk 1   C,DC,Z
ANDLW   111001kkkkkkkk 1   Z
CALL    100kkkkkkkkkkk 2   -
CLRWDT  00000001100100 1   TO,PD
GOTO    101kkkkkkkkkkk 2   -
IORLW   111000kkkkkkkk 1   Z
MOVLW   1100xxkkkkkkkk 1   -
RETFIE  00000000001001 2   -
RETLW   1101xxkkkkkkkk 2   -
RETURN  00000000001000 2   -
SLEEP   00000001100011 1   TO,PD
SUBLW   11110xkkkkkkkk 1   C,DC,Z
XORLW   111010kkkkkkkk 1   Z
OPTION  00000001100010 1   -
TRIS    00000001100fff 1   -
"""
ROWS = [line.split() for line in WITNESS.split("\n") if line]
FLAG_NAMES = {"C": "C", "D": "DC", "Z": "Z", "T": "TO", "P": "PD"}


def test_there_are_35_instructions_and_two_of_the_older_family() -> None:
    assert len(INSTRUCTIONS) == 35
    assert [row.mnemonic for row in LEGACY] == ["OPTION", "TRIS"]
    assert set(by_mnemonic()) == {row[0] for row in ROWS}


@pytest.mark.parametrize(("mnemonic", "bits", "cycles", "flags"), ROWS)
def test_every_row_says_what_the_data_sheet_says(mnemonic: str, bits: str, cycles: str, flags: str) -> None:
    row = by_mnemonic()[mnemonic]
    assert row.pattern.replace(" ", "") == bits
    assert f"{row.cycles}{'(2)' if row.skips else ''}" == cycles
    assert {FLAG_NAMES[flag] for flag in row.flags} == set(flags.replace("-", "").split(",")) - {""}


def test_the_kinds_of_instructions_are_those_of_the_data_sheet() -> None:
    """DS35007 section 7.1: bit-oriented operations, and those that leave the sequence of the program."""
    assert mnemonics(lambda row: row.tests_bit) == {"BTFSC", "BTFSS"}
    assert mnemonics(lambda row: row.changes_bit) == {"BCF", "BSF"}
    assert mnemonics(lambda row: row.skips) == {"BTFSC", "BTFSS", "DECFSZ", "INCFSZ"}
    assert mnemonics(lambda row: row.has_target) == {"CALL", "GOTO"}
    assert mnemonics(lambda row: row.flow == "return") == {"RETFIE", "RETLW", "RETURN"}


def test_the_destination_bit_says_where_a_result_goes() -> None:
    rows = by_mnemonic()
    assert [rows["ADDWF"].writes_w(d) for d in (0, 1)] == [True, False]
    assert [rows["ADDWF"].writes_file(d) for d in (0, 1)] == [False, True]
    assert rows["CLRF"].writes_file(0)
    assert rows["RETLW"].writes_w(0)
    assert not rows["BTFSS"].writes_file(1)
    assert not rows["CALL"].writes_w(0)


def test_five_operations_exist_with_a_register_and_with_a_literal() -> None:
    assert literal_forms() == {f"{name}WF": f"{name}LW" for name in ("ADD", "AND", "IOR", "SUB", "XOR")}


def matching(word: int) -> list[str]:
    """The rows of the witness that a word fits."""
    digits = f"{word:014b}"
    return [
        row[0]
        for row in ROWS
        if all(fixed not in "01" or fixed == digit for fixed, digit in zip(row[1], digits, strict=True))
    ]


def witness(word: int) -> tuple[str, dict[str, int]] | None:
    """A word taken apart by the witness alone."""
    names = matching(word)
    # TRIS would take seven words: 0x63 and 0x64 are SLEEP and CLRWDT, 0x62 OPTION, and there are two ports
    if "TRIS" in names and word not in (0x65, 0x66):
        names.remove("TRIS")
    if not names:
        return None
    (name,) = names
    bits = next(row[1] for row in ROWS if row[0] == name)
    digits = f"{word:014b}"
    fields = {
        field: int("".join(digit for place, digit in zip(bits, digits, strict=True) if place == field), 2)
        for field in "fdbk"
        if field in bits
    }
    return name, fields


def test_all_16384_words_decode_as_the_witness_says() -> None:
    for word in range(WORD_MASK + 1):
        expected = witness(word)
        found = decode(word)
        if expected is None:
            assert found is None, f"0x{word:04X}"
            continue
        assert found is not None, f"0x{word:04X}"
        name, fields = expected
        assert found.instruction.mnemonic == name, f"0x{word:04X}"
        assert {field: getattr(found, field) for field in "fdbk"} == {
            field: fields.get(field, 0) for field in "fdbk"
        }, f"0x{word:04X}"


def test_no_word_fits_two_rows() -> None:
    for word in range(WORD_MASK + 1):
        names = [name for name in matching(word) if name != "TRIS"]
        assert len(names) <= 1, f"0x{word:04X}"


@pytest.mark.parametrize(
    ("mnemonic", "first", "last", "step"),
    [
        ("CLRW", 0x0100, 0x017F, 1), ("NOP", 0x0000, 0x0060, 0x20), ("MOVLW", 0x3000, 0x33FF, 1),
        ("RETLW", 0x3400, 0x37FF, 1), ("SUBLW", 0x3C00, 0x3DFF, 1), ("ADDLW", 0x3E00, 0x3FFF, 1),
    ],
)  # fmt: skip
def test_ignored_bits_do_not_change_the_instruction(mnemonic: str, first: int, last: int, step: int) -> None:
    for word in range(first, last + 1, step):
        found = decode(word)
        assert found is not None
        assert found.instruction.mnemonic == mnemonic
        assert found.k == (word & 0xFF if mnemonic not in ("CLRW", "NOP") else 0)


def test_an_erased_word_is_addlw_255() -> None:
    found = decode(0x3FFF)
    assert found is not None
    assert (found.instruction.mnemonic, found.k) == ("ADDLW", 0xFF)


def test_undefined_words_are_named_as_such() -> None:
    undefined = [word for word in range(WORD_MASK + 1) if decode(word) is None]
    low = [
        word for word in range(0x80) if word not in (0, 0x20, 0x40, 0x60, 8, 9, 0x62, 0x63, 0x64, 0x65, 0x66)
    ]
    assert undefined == [*low, *range(0x3B00, 0x3C00)]


def test_encoding_what_was_decoded_decodes_to_the_same() -> None:
    for word in range(WORD_MASK + 1):
        found = decode(word)
        if found is None:
            continue
        row = found.instruction
        again = encode(row.mnemonic, **{field: getattr(found, field) for field in row.operands})
        assert decode(again) == found
        assert again == word or "x" in row.pattern.replace(" ", "")


def test_assemblers_write_clrw_as_0103() -> None:
    assert encode("CLRW") == 0x0103  # MPASM and gpasm; the chip ignores the lowest seven bits


@pytest.mark.parametrize(
    ("mnemonic", "operands", "word"),
    [
        ("ADDWF", {"f": 0x20, "d": 0}, 0x0720), ("ADDWF", {"f": 0x7F, "d": 1}, 0x07FF),
        ("BSF", {"f": 0x03, "b": 5}, 0x1683), ("BTFSS", {"f": 0x06, "b": 7}, 0x1F86),
        ("CALL", {"k": 0x123}, 0x2123), ("GOTO", {"k": 0x7FF}, 0x2FFF), ("MOVLW", {"k": 0x55}, 0x3055),
        ("RETLW", {"k": 0xAA}, 0x34AA), ("TRIS", {"f": 6}, 0x0066), ("RETFIE", {}, 0x0009),
    ],
)  # fmt: skip
def test_words_are_encoded_as_the_data_sheet_draws_them(
    mnemonic: str, operands: dict[str, int], word: int
) -> None:
    assert encode(mnemonic, **operands) == word


@pytest.mark.parametrize(
    ("mnemonic", "operands"),
    [
        ("MOVLW", {"k": 256}),
        ("MOVLW", {"k": -1}),
        ("BSF", {"f": 3, "b": 8}),
        ("GOTO", {"k": 2048}),
        ("NOP", {"f": 1}),
    ],
)
def test_a_field_that_does_not_fit_is_refused(mnemonic: str, operands: dict[str, int]) -> None:
    with pytest.raises(ValueError, match=mnemonic):
        encode(mnemonic, **operands)


def test_an_unknown_mnemonic_is_refused() -> None:
    with pytest.raises(KeyError):
        encode("MUL")
