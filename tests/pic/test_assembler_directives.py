"""Directives: names, words of data, conditions, loops, settings. Words by hand from DS35007 section 7."""

from __future__ import annotations

from typing import Any

import pytest

from servogen.pic.assembler import assemble
from servogen.pic.assembler.messages import NUMBERS
from servogen.pic.device import DEVICES, device
from tests.pic.conftest import MPASM

# -- labels and names ----------------------------------------------------------------------------------


def test_labels_stand_in_column_1_with_or_without_a_colon(asm: Any) -> None:
    assert asm.words("one nop\ntwo: nop\nthree\n goto one\n goto two\n goto three") == [
        0, 0, 0x2800, 0x2801, 0x2802,
    ]  # fmt: skip


def test_a_label_after_column_1_needs_a_colon_and_is_warned_of(asm: Any) -> None:
    assert asm.words("  here: goto here") == [0x2800]
    assert asm.remarks("  here: goto here") == ["1:3 207"]


def test_an_indented_word_alone_or_before_an_operation_is_a_label_and_is_warned_of(asm: Any) -> None:
    assert asm.words("  start\n again nop\n goto start\n goto again") == [0, 0x2800, 0x2800]
    assert asm.remarks("  start\n again nop") == ["1:3 207", "2:2 207"]


def test_an_operation_with_a_slip_of_the_pen_is_no_label(asm: Any) -> None:
    assert asm.errors(" retrun\n end") == ["1:2 122 unknown operation 'retrun'"]
    assert asm.errors(" mvlw 3\n end") == ["1:2 122 unknown operation 'mvlw'"]


def test_an_instruction_in_column_1_is_warned_of(asm: Any) -> None:
    assert asm.words("nop") == [0]
    assert asm.remarks("nop") == ["1:1 203"]


def test_names_keep_their_case_and_directives_do_not(asm: Any) -> None:
    assert asm.words("a EQU 1\nA Equ 2\n MovLW a\n movlw A") == [0x3001, 0x3002]


def test_a_name_may_be_used_before_it_is_defined(asm: Any) -> None:
    assert asm.words(" movlw later\n goto there\nlater equ 7\nthere nop") == [0x3007, 0x2802, 0]


def test_equ_set_and_assignments(asm: Any) -> None:
    source = (
        "a equ 1\nb set 2\nc = 3\n movlw a+b+c\nb set 4\n movlw b\nc += 2\nc <<= 1\n movlw c\nc++\n movlw c"
    )
    assert asm.words(source) == [0x3006, 0x3004, 0x300A, 0x300B]
    assert asm.words("c = 3\nc--\n movlw c\nc |= 8\nc *= 2\nc ^= 1\n movlw c") == [0x3002, 0x3015]


def test_an_assignment_changes_only_a_name_that_has_a_value_before_it(asm: Any) -> None:
    """The condition is false in pass 1, in which `late` is not known yet, and true in pass 2."""
    for assignment in ("none += 1", "none++", "none--"):
        for after in ("", "\nnone set 3"):
            assert asm.errors(f"{assignment}\n movlw none{after}\n end")[0] == (
                "1:1 113 symbol not previously defined: 'none'"
            )
        assert asm.errors(f" if late\n{assignment}\n endif\nlate equ 1\n end") == [
            "2:1 113 symbol not previously defined: 'none'"
        ]


def test_variable_and_constant(asm: Any) -> None:
    source = " variable i=2, j\n constant k=5, m=k+1\n movlw i\n movlw j\n movlw m\ni = 9\n movlw i"
    assert asm.words(source) == [0x3002, 0x3000, 0x3006, 0x3009]


def test_cblock_counts_on(asm: Any) -> None:
    source = " cblock 0x0C\na\nb:2, c\n  d\n endc\n cblock\n e\n endc\n" + "\n".join(
        f" movlw {name}" for name in "abcde"
    )
    assert asm.words(source) == [0x300C, 0x300D, 0x300F, 0x3010, 0x3011]


def test_the_entries_of_cblock_in_ram_are_the_listings_variables(asm: Any) -> None:
    listing = asm.assembled(" cblock 0x0C\n a:2, b\n endc\n cblock 0\n state\n endc").listing
    assert listing.variables == ((0x0C, "a", 2), (0x0E, "b", 1))


def test_a_constant_keeps_its_value(asm: Any) -> None:
    assert asm.errors("a equ 1\na equ 1\n end") == []
    assert asm.errors("a equ 1\na equ 2\n end")[0].startswith("2:1 11")
    assert asm.errors("a nop\na nop\n end")[0].startswith("2:1 115")


def test_a_label_that_moves_between_the_passes_is_an_error(asm: Any) -> None:
    found = asm.errors(" if late\n nop\n endif\nhere nop\nlate equ 1\n end")
    assert found[0].startswith("4:1 116 'here' is 0x0 in pass 1, 0x1 in pass 2")


# -- where words go ------------------------------------------------------------------------------------


def test_org_moves_the_location_and_names_it(asm: Any) -> None:
    image = asm.assembled(" org 4\nisr retfie\nlater org 0x10\n goto isr\n goto later").image
    assert dict(image.program) == {4: 0x0009, 0x10: 0x2804, 0x11: 0x2810}


def test_two_words_at_one_address_are_an_error(asm: Any) -> None:
    assert asm.errors(" org 5\n nop\n org 5\n clrwdt\n end") == [
        "4:2 118 address 0x0005 holds 0x0000 already"
    ]


def test_a_word_beyond_the_chip_is_an_error(asm: Any) -> None:
    assert asm.errors(" org 0x3FF\n nop\n nop\n end") == ["3:2 220 address 0x0400 is beyond the chip"]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("dt 1, 2, 0x1FF", [0x3401, 0x3402, 0x34FF]), ('dt "AB", 0', [0x3441, 0x3442, 0x3400]),
        ("dt 'A'", [0x3441]), ("dw 0x3FFF, 1", [0x3FFF, 1]), ("data 1, 2", [1, 2]),
        ('data "AB"', [0x4142 & 0x3FFF]),
        ('data "ABC"', [0x4142 & 0x3FFF, 0x4300 & 0x3FFF]),
        ("db 1, 2, 3", [0x0102, 0x0300]), ('db "A", 2', [0x4102 & 0x3FFF]), ('da "AB"', [0x41 << 7 | 0x42]),
        ('da "ABC"', [0x41 << 7 | 0x42, 0x43 << 7]), ("fill 0x1234, 3", [0x1234] * 3),
        ("fill $, 3", [0, 1, 2]),
        ("fill (goto $), 3", [0x2800, 0x2801, 0x2802]),
        ("fill (nop), 2", [0, 0]), ("res 2", [0x3FFF, 0x3FFF]), ("banksel 0x86", [0x1683]),
        ("banksel 0x06", [0x1283]), ("bankisel 0x86", [0x1383]), ("bankisel 0x186", [0x1783]),
        ("pagesel 0", []),
    ],
)  # fmt: skip
def test_directives_that_place_words(asm: Any, line: str, expected: list[int]) -> None:
    assert asm.words(f" {line}") == expected


def test_a_word_of_more_than_14_bits_is_cut_with_message_303(asm: Any) -> None:
    assert asm.words(" dw 0x7FFF") == [0x3FFF]
    assert asm.remarks(" dw 0x7FFF") == ["1:2 303"]


def test_the_eeprom_takes_bytes(asm: Any) -> None:
    image = asm.assembled(
        ' org 0x2100\n de "AB", 1, 0x102\n db 5, 6\nplace de 7\n org 0\n movlw low place'
    ).image
    assert dict(image.eeprom) == dict(enumerate([0x41, 0x42, 1, 2, 5, 6, 7]))
    assert dict(image.program) == {0: 0x3006}


def test_the_configuration_word_and_the_id_words(asm: Any) -> None:
    image = asm.assembled(" __config 0x3FF1\n __idlocs 0x12AB").image
    assert image.config == 0x3FF1
    assert dict(image.ids) == {0: 1, 1: 2, 2: 0xA, 3: 0xB}
    assert asm.assembled(" __config 0x2007, 0x3FF2").image.config == 0x3FF2
    assert asm.assembled(" __fuses 0x3FFA").image.config == 0x3FFA
    assert asm.assembled(" org 0x2007\n dw 0x3FF1").image.config == 0x3FF1


def test_config_names_its_settings(asm: Any) -> None:
    line = " config FOSC=XT, WDTE = off, PWRTE=ON\n config CP=OFF"
    assert asm.assembled(line).image.config == 0x3FF1
    assert asm.assembled(" config fosc=hs").image.config == 0x3FFE
    assert asm.assembled(" config CP=ON, FOSC=EXTRC").image.config == 0x000F
    assert asm.errors(" config WDT=OFF\n end") == ["1:9 181 unknown setting 'WDT'"]
    assert asm.errors(" config FOSC=XTAL\n end") == ["1:9 181 unknown value 'XTAL' of FOSC"]
    assert asm.errors(" config CP=ON, CP=OFF\n end") == ["1:16 118 CP is set twice"]
    assert asm.errors(" config CP=ON\n __config 1\n end")[0].startswith("2:2 118")


def test_too_large_an_id_and_a_wrong_place_of_the_configuration(asm: Any) -> None:
    assert asm.remarks(" __idlocs 0x12345") == ["1:2 304"]
    assert asm.errors(" __config 0x2008, 1\n end")[0].startswith("1:11 126")
    assert asm.errors(" __config 1\n __config 1\n end")[0].startswith("2:2 118")


# -- conditions and loops ------------------------------------------------------------------------------


@pytest.mark.parametrize(("x", "expected"), [(0, [0x3003]), (1, [0x3001]), (2, [0x3002])])
def test_an_if_in_the_else_of_another(asm: Any, x: int, expected: list[int]) -> None:
    source = f"x equ {x}\n if x == 1\n movlw 1\n else\n if x == 2\n movlw 2\n else\n movlw 3\n endif\n endif"
    assert asm.words(source) == expected


def test_conditions_nest_and_their_hidden_lines_are_not_read(asm: Any) -> None:
    source = (
        " if 0\n if 1\n nonsense is here\n else\n here too\n endif\n #if 1\n #endif\n else\n movlw 1\n endif"
    )
    assert asm.words(source) == [0x3001]


def test_ifdef_and_ifndef_ask_for_names_and_definitions(asm: Any) -> None:
    names = "a equ 1\n#define b\n"
    assert asm.words(names + " ifdef a\n movlw 1\n endif\n ifdef b\n movlw 2\n endif") == [0x3001, 0x3002]
    assert asm.words(names + " ifndef a\n movlw 1\n endif\n ifndef c\n movlw 3\n endif") == [0x3003]
    assert asm.words("#define b\n#undefine b\n ifdef b\n movlw 1\n else\n movlw 2\n endif") == [0x3002]


def test_ifdef_of_a_later_name_is_warned_of(asm: Any) -> None:
    assert "1:8 230" in asm.remarks(" ifdef late\n endif\nlate equ 1")


def test_while_repeats(asm: Any) -> None:
    source = "i = 0\n while i < 3\n movlw i\nj = 0\n while j < 2\n retlw j\nj++\n endw\ni++\n endw"
    assert asm.words(source) == [0x3000, 0x3400, 0x3401, 0x3001, 0x3400, 0x3401, 0x3002, 0x3400, 0x3401]


def test_an_endless_while_ends_with_an_error(asm: Any) -> None:
    assert any("131" in each for each in asm.errors(" while 1\n endw\n end"))


@pytest.mark.parametrize(
    ("source", "number"),
    [
        (" if 1\n nop\n end", None), (" if 1\n nop", 129), (" else\n end", 123), (" endif\n end", 123),
        (" if 1\n else\n else\n endif\n end", 123), (" endw\n end", 123), (" endm\n end", 123),
        (" endc\n end", 123), (" while 1\n end", 129), (" cblock 1\n end", 129), ("m macro\n end", 129),
        (" macro\n endm\n end", 130),
        ("m macro\n endm\nm macro\n endm\n end", 115),
        (" exitm\n end", 123), (" local a\n end", 123), ("x if 1\n endif\n end", 121), (" equ 1\n end", 128),
        (" org\n end", 128), (" org 1, 2\n end", 127), (" udata_acs\n end", 149),
        (" frobnicate 1\n end", 122), (" clrff\n end", 122), (" 5 nop\n end", 101),
    ],
)  # fmt: skip
def test_what_does_not_fit_together_is_an_error(asm: Any, source: str, number: int | None) -> None:
    found = asm.errors(source)
    assert [int(each.split()[1]) for each in found[:1]] == ([] if number is None else [number])


def test_every_error_of_a_source_is_reported(asm: Any) -> None:
    assert [each.split()[0] for each in asm.errors(" movlw a\n nop\n goto b\n movlv 1\n end")] == [
        "1:8",
        "3:7",
        "4:2",
    ]


def test_a_source_without_end_is_warned_of() -> None:
    assembly = assemble(" nop\n", "t.asm", DEVICES[0])
    assert [each.code for each in assembly.warnings] == ["asm-no-end"]


def test_what_follows_end_is_not_read(asm: Any) -> None:
    assert asm.words(" nop\n end\n nonsense") == [0]


# -- settings ------------------------------------------------------------------------------------------


def test_errorlevel_chooses_what_is_said(asm: Any) -> None:
    loud = " incf 0x20\n movlw 0x1FF"
    assert asm.remarks(loud) == ["1:2 305", "2:2 202"]
    assert asm.remarks(f" errorlevel -305\n{loud}") == ["3:2 202"]
    assert asm.remarks(f" errorlevel -305, -202\n{loud}") == []
    assert asm.remarks(f" errorlevel 1\n{loud}") == ["3:2 202"]
    assert asm.remarks(f" errorlevel 2\n{loud}") == []
    assert asm.remarks(f" errorlevel -305\n errorlevel +305\n{loud}") == ["3:2 305", "4:2 202"]


def test_messg_says_and_error_stops(asm: Any) -> None:
    (message,) = asm.assembled(' messg "built for the lab"').warnings
    assert (message.severity, message.code, message.message) == (
        "note",
        "asm-user-message",
        "built for the lab",
    )
    assert asm.errors(' error "no clock"\n end') == ["1:2 100 no clock"]


def test_the_source_names_its_device() -> None:
    for source in (" list p=16f84a\n end", " processor 16f84a\n end", " list p = PIC16F84A, r=dec\n end"):
        assert assemble(source).device == device("16F84A")
    assert assemble(" end").device == device("16F84")


def test_the_caller_may_have_asked_for_another_device() -> None:
    assembly = assemble(" list p=16f84a\n end", "t.asm", device("16F84"))
    assert assembly.device == device("16F84")
    assert [each.code for each in assembly.warnings] == ["asm-processor"]


def test_a_device_that_is_not_known_is_an_error_with_the_known_ones(asm: Any) -> None:
    assert asm.errors(" list p=16f877\n end")[0].startswith("1:9 180 unknown device '16f877'")


def test_maxram_and_badram_say_where_there_is_no_register(asm: Any) -> None:
    source = " __maxram 0xCF\n __badram 0x07, 0x50-0x7F\n movwf 0x0C\n movwf 0x07\n movwf 0x60\n movwf 0x4F"
    assert asm.remarks(source) == ["4:2 219", "5:2 219"]


def test_directives_about_paper_do_nothing(asm: Any) -> None:
    source = ' title "x"\n subtitle "y"\n page\n space 2\n nolist\n list b=8, n=60\n expand\n noexpand\n nop'
    assert asm.words(source) == [0]


def test_a_radix_that_does_not_exist_is_an_error(asm: Any) -> None:
    assert asm.errors(" radix bin\n end") == ["1:8 124 'bin' is not a radix"]


def test_every_warning_is_muted_by_its_number_in_mpasm() -> None:
    assert {code: MPASM[code] for code in NUMBERS} == NUMBERS
