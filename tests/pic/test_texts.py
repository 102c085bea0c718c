"""Listings and disassemblies line by line, at the limits of what is put together and what is left out."""

from __future__ import annotations

import pytest

from servogen.pic.device import device
from servogen.pic.disassembler import disassemble
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.pic.listing import ListedFunction, Listing, ListingRow, listing_text
from tests.pic.test_disassembler import body

F84 = device("16F84")
ERASED = "dw 0x3FFF                       ; erased, executes as ADDLW 0xFF"


@pytest.mark.parametrize("count", [1, 7, 8, 9])
def test_eight_equal_words_that_are_no_instructions_become_one_fill(count: int) -> None:
    lines = body(Image({0: 0x2800, **{1 + at: 0x3FFF for at in range(count)}, 1 + count: 0}))
    filled = [f"fill 0x3FFF, 0x{count:X}                ; erased, executes as ADDLW 0xFF"]
    assert lines == [
        "org 0x000",
        "reset:",
        "GOTO reset",
        *(filled if count >= 8 else [ERASED] * count),
        "NOP",
    ]
    assert body(Image(dict.fromkeys(range(10), 0)))[2:] == [
        "NOP", "NOP", "NOP", "NOP", "interrupt:", *["NOP"] * 6
    ]  # fmt: skip


def test_a_fill_ends_where_the_words_differ_or_a_label_stands() -> None:
    words = {0: encode("GOTO", k=0x15), **dict.fromkeys(range(8, 40), 16383), 0x20: 0x0001}
    lines = body(Image(words))
    assert [line.split(";")[0].strip() for line in lines] == [
        "org 0x000", "reset:", "GOTO at_015", "org 0x008", "fill 0x3FFF, 0xD", "at_015:", "fill 0x3FFF, 0xB",
        "dw 0x0001", "dw 0x3FFF", "dw 0x3FFF", "dw 0x3FFF", "dw 0x3FFF", "dw 0x3FFF", "dw 0x3FFF",
        "dw 0x3FFF",
    ]  # fmt: skip


def test_a_target_that_is_called_and_jumped_to_is_a_subroutine() -> None:
    for first, second in (("CALL", "GOTO"), ("GOTO", "CALL")):
        lines = body(Image({0: encode(first, k=3), 1: encode(second, k=3), 2: encode("GOTO", k=2), 3: 8}))
        assert lines == [
            "org 0x000", "reset:", f"{first} sub_003", f"{second} sub_003", "at_002:",
            "GOTO at_002", "sub_003:",
            "RETURN",
        ]  # fmt: skip


def test_an_erased_vector_has_no_name() -> None:
    assert "interrupt:" not in body(Image({0: 0, 4: 0x3FFF}))
    assert "interrupt:" in body(Image({4: 0}))
    assert "reset:" not in body(Image({4: 0}))


def test_eight_bytes_of_the_eeprom_stand_in_a_row() -> None:
    lines = body(Image({}, None, {at: at for at in (*range(9), 0x30)}, {}))
    assert lines == [
        "org 0x2100                      ; data EEPROM from 0x00",
        "de 0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07", "de 0x08",
        "org 0x2130                      ; data EEPROM from 0x30", "de 0x30",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("ids", "lines"),
    [
        ({0: 0, 1: 15, 2: 10, 3: 1}, ["__idlocs 0x0FA1"]),
        ({0: 0, 1: 16, 2: 0, 3: 0}, ["org 0x2000", "dw 0x0000, 0x0010, 0x0000, 0x0000"]),
        ({1: 2, 3: 4}, ["org 0x2001", "dw 0x0002", "org 0x2003", "dw 0x0004"]),
    ],
)
def test_id_words_are_four_digits_or_single_words(ids: dict[int, int], lines: list[str]) -> None:
    assert [line.split(";")[0].strip() for line in body(Image({}, None, {}, ids))] == lines


@pytest.mark.parametrize(
    ("config", "meaning"),
    [
        (0x3FF0, "LP oscillator, watchdog off, power-up timer on"),
        (0x3FFD, "XT oscillator, watchdog on, power-up timer off"),
        (0x3FF2, "HS oscillator, watchdog off, power-up timer on"),
        (0x3FFB, "RC oscillator, watchdog off, power-up timer off"),
        (0x3FF7, "RC oscillator, watchdog on, power-up timer on"),
    ],
)
def test_the_configuration_is_explained(config: int, meaning: str) -> None:
    assert body(Image({}, config)) == [f"__config 0x{config:04X}                 ; {meaning}"]


def test_the_heading_counts_words_and_warns_of_protection() -> None:
    lines = disassemble(Image({0: 0, 5: 0}, 0x000F), device("16F84A")).splitlines()
    assert lines[:8] == [
        "; PIC16F84A: 2 of 1024 program words",
        "; registers have their bank 0 names; the comment says what they are when RP0 is 1",
        "; CODE PROTECTED: once programmed, the chip does not let this program be read back",
        "", "        list p=16f84a", "        include <p16f84a.inc>", "        radix hex", "",
    ]  # fmt: skip
    assert lines[-1] == "        end"


# -- listings ------------------------------------------------------------------------------------------------


def test_a_listing_shows_each_file_once_in_order_and_lines_that_do_not_exist_as_empty() -> None:
    rows = (
        ListingRow(0, 0x3001, "MOVLW 0x01", "1", "a.c", 2),
        ListingRow(1, 0x3002, "MOVLW 0x02", "1", "b.c", 1),
        ListingRow(0x3FF, 0x1D03, "BTFSS STATUS, Z", "1(2)", "a.c", 4),
        ListingRow(0x400, 0, "NOP", "1", "other.c", 9),
    )
    text = listing_text(Listing(rows, sources=(("a.c", "one\n\ttwo\nthree\n"), ("b.c", "x"))))
    assert text.splitlines() == [
        "4 of 1024 program words", "", "addr  word  cycles  instruction",
        "a.c:", f"{1:>28}: one", f"{2:>28}:         two", "0000  3001  1       MOVLW 0x01",
        "b.c:", f"{1:>28}: x", "0001  3002  1       MOVLW 0x02",
        "a.c:", f"{3:>28}: three", f"{4:>28}:", "03FF  1D03  1(2)    BTFSS STATUS, Z",
        "0400  0000  1       NOP", "",
    ]  # fmt: skip
    assert text.endswith("\n")


def test_functions_stand_in_columns_as_wide_as_the_longest_name() -> None:
    functions = (
        ListedFunction("a_long_name", 0, 1024, 68, 7, 1, None, ("while at line 3", "call at line 5")),
        ListedFunction("b", 0x3FF, 0x400, 0, 0, None, None, ("sleep",)),
    )
    assert listing_text(Listing((), functions)).splitlines()[4:] == [
        "function     start  words  bytes of RAM  deepest calls  cycles",
        "a_long_name  0000    1024            68              7  1 to unbounded",
        "b            03FF       1             0              0  never returns",
        "a_long_name  unbounded: while at line 3, call at line 5",
        "b            unbounded: sleep",
        "",
    ]
    assert repr(Listing((), functions)) == "<Listing of 0 words, 2 functions>"


def test_the_map_of_ram_marks_each_of_the_68_bytes() -> None:
    listing = Listing(
        (), variables=((0x0C, "first", 1), (0x1F, "two", 2), (0x4F, "last", 1), (0x4F, "same", 1))
    )
    assert listing_text(listing).splitlines()[4:] == [
        "addr  bytes  variable", "000C      1  first", "001F      2  two", "004F      1  last",
        "004F      1  same", "4 of 68 bytes of RAM", "", "0000              X---", "0010  ---------------X",
        "0020  X---------------", "0030  ----------------", "0040  ---------------X", "X used, - free",
    ]  # fmt: skip
