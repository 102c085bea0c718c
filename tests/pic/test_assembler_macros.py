"""Macros, #define, #v, include files and the built-in headers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from servogen.errors import InputError, Location
from servogen.pic.assembler import assemble, beside
from servogen.pic.device import REGISTERS, device


def test_a_macro_puts_its_lines_with_its_arguments(asm: Any) -> None:
    macro = "load macro reg, number\n movlw number\n movwf reg\n endm\n"
    source = macro + " load 0x20, 5+1\nhere load 0x21, 'a'\n goto here"
    assert asm.words(source) == [0x3006, 0x00A0, 0x3061, 0x00A1, 0x2802]


def test_local_names_belong_to_one_call(asm: Any) -> None:
    source = (
        "wait macro count\n local again\n movlw count\nagain addlw -1\n bnz again\n endm\n wait 3\n wait 4"
    )
    assert asm.words(source) == [0x3003, 0x3EFF, 0x1D03, 0x2801, 0x3004, 0x3EFF, 0x1D03, 0x2805]


def test_a_local_label_may_be_used_before_it_stands(asm: Any) -> None:
    source = "over macro\n local done\n goto done\n nop\ndone\n endm\n over\n over"
    assert asm.words(source) == [0x2802, 0, 0x2804, 0]


def test_local_variables_may_have_a_value(asm: Any) -> None:
    source = "table macro n\n local i=0\n while i < n\n retlw i\ni++\n endw\n endm\n table 2\n table 1"
    assert asm.words(source) == [0x3400, 0x3401, 0x3400]


def test_macros_call_macros_and_exitm_leaves_one(asm: Any) -> None:
    source = (
        "inner macro n\n if n == 0\n nop\n exitm\n endif\n movlw n\n endm\n"
        "outer macro n\n inner n\n inner 0\n clrwdt\n endm\n outer 2"
    )
    assert asm.words(source) == [0x3002, 0, 0x64]


def test_the_condition_that_exitm_leaves_is_closed(asm: Any) -> None:
    assert asm.words("m macro\n if 1\n if 1\n exitm\n endif\n endif\n endm\n m\n nop") == [0]


def test_a_recursive_macro_is_fine_and_an_endless_one_an_error(asm: Any) -> None:
    source = "count macro n\n if n > 0\n retlw n\n count n-1\n endif\n endm\n count 3"
    assert asm.words(source) == [0x3403, 0x3402, 0x3401]
    assert any("without end" in each for each in asm.errors("m macro\n m\n endm\n m\n end"))


def test_arguments_may_hold_commas_in_quotes(asm: Any) -> None:
    assert asm.words("text macro s\n dt s\n endm\n text \"a,b\"\n text ','") == [
        0x3461,
        0x342C,
        0x3462,
        0x342C,
    ]


@pytest.mark.parametrize(("call", "number"), [("m 1", 128), ("m 1, 2, 3", 128), ("m", 128)])
def test_the_number_of_arguments_is_checked(asm: Any, call: str, number: int) -> None:
    (found,) = asm.errors(f"m macro a, b\n movlw a\n movlw b\n endm\n {call}\n end")
    assert found.startswith(f"5:2 {number} macro 'm' takes 2 arguments")


def test_an_error_in_a_macro_says_where_it_was_called() -> None:
    with pytest.raises(InputError) as error:
        assemble("m macro x\n movlw x\n endm\n\n m nothing\n end", "t.asm")
    assert str(error.value) == (
        "t.asm:2:8: error: symbol not previously defined: 'nothing' [asm-undefined-symbol]\n"
        "     movlw x\n           ^\n  in macro 'm', called at t.asm:5"
    )


def test_define_replaces_a_name_by_a_text(asm: Any) -> None:
    source = '#define LED 6, 0\n#define TWO ONE+1\n#define ONE 1\n bsf LED\n movlw TWO*3\n dt "LED"'
    assert asm.words(source) == [0x1406, 0x3004, 0x344C, 0x3445, 0x3444]


def test_define_takes_arguments(asm: Any) -> None:
    source = "#define AREA(a, b) ((a)*(b))\n movlw AREA(2, 1+2)\n movlw AREA(AREA(2,2),3)"
    assert asm.words(source) == [0x3006, 0x300C]
    assert asm.words("#define PUT(r) movwf r\n PUT(0x20)\n PUT 0x21") == [0x00A0, 0x00A1]


def test_a_definition_of_itself_ends(asm: Any) -> None:
    assert asm.words("x equ 3\n#define x x\n#define p q\n#define q p\np equ 5\n movlw x") == [0x3003]


def test_defining_twice_is_an_error(asm: Any) -> None:
    assert asm.errors("#define a 1\n#define a 2\n end") == ["2:9 115 'a' is defined already"]


def test_hash_v_makes_names_from_values(asm: Any) -> None:
    source = "i = 2\nlab#v(i*3) nop\n goto lab6\nnode macro n\nn#v(i) equ i\n endm\n node x\n movlw x2"
    assert asm.words(source) == [0, 0x2800, 0x3002]


def test_columns_are_those_of_the_source_after_a_substitution(asm: Any) -> None:
    assert asm.errors("#define SEVEN (3+4)\n movlw SEVEN + none\n end") == [
        "2:16 113 symbol not previously defined: 'none'"
    ]


# -- include -------------------------------------------------------------------------------------------


def test_include_files_come_through_the_callable() -> None:
    files = {"regs.inc": "led equ 3\n", "code.inc": " include regs.inc\n bsf 6, led\n"}
    assembly = assemble(' include "code.inc"\n end', "t.asm", None, files.get)
    assert dict(assembly.image.program) == {0: 0x1586}
    assert assembly.listing.rows[0].file == "code.inc"
    assert [name for name, _ in assembly.listing.sources] == ["t.asm", "code.inc", "regs.inc"]


@pytest.mark.parametrize(
    "line", ["include <P16F84.INC>", '#include "p16f84.inc"', "include p16f84.inc", "#INCLUDE <p16f84.inc>"]
)
def test_the_chips_header_is_built_in(line: str) -> None:
    assembly = assemble(f"{line}\n bsf STATUS, RP0\n clrf TRISB\n movlw W\n end")
    assert list(assembly.image.program.values()) == [0x1683, 0x0186, 0x3000]
    assert line.startswith("#") or [each.code for each in assembly.warnings] == ["asm-bank"]


def test_the_header_chooses_the_device_where_nothing_else_does() -> None:
    assert assemble(" include <p16f84a.inc>\n end").device == device("16F84A")


def test_the_header_of_the_other_chip_is_remarked() -> None:
    assembly = assemble(" list p=16f84\n include <p16f84a.inc>\n end")
    assert [each.code for each in assembly.warnings] == ["asm-user-message"]


# names and values as Microchip's p16f84.inc has them, typed from its published symbol list
FUSES = {
    "_CP_ON": 0x000F, "_CP_OFF": 0x3FFF, "_PWRTE_ON": 0x3FF7, "_PWRTE_OFF": 0x3FFF, "_WDT_ON": 0x3FFF,
    "_WDT_OFF": 0x3FFB, "_LP_OSC": 0x3FFC, "_XT_OSC": 0x3FFD, "_HS_OSC": 0x3FFE, "_RC_OSC": 0x3FFF,
}  # fmt: skip
BITS = {
    "C": 0, "DC": 1, "Z": 2, "NOT_PD": 3, "NOT_TO": 4, "RP0": 5, "RP1": 6, "IRP": 7,
    "RBIF": 0, "INTF": 1, "T0IF": 2, "RBIE": 3, "INTE": 4, "T0IE": 5, "EEIE": 6, "GIE": 7,
    "TMR0IF": 2, "TMR0IE": 5,
    "PS0": 0, "PS1": 1, "PS2": 2, "PSA": 3, "T0SE": 4, "T0CS": 5, "INTEDG": 6, "NOT_RBPU": 7,
    "RD": 0, "WR": 1, "WREN": 2, "WRERR": 3, "EEIF": 4, "RA4": 4, "RB7": 7, "TRISB0": 0, "W": 0, "F": 1,
}  # fmt: skip


def test_the_header_has_the_names_that_sources_use() -> None:
    names = {**FUSES, **BITS, **{register.name: register.address for register in REGISTERS}}
    source = " include <p16f84.inc>\n" + "\n".join(f" dw {name}" for name in names) + "\n end"
    assert list(assemble(source).image.program.values()) == list(names.values())


def test_fuses_are_joined_with_and() -> None:
    source = " include <p16f84.inc>\n __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF\n end"
    assert assemble(source).image.config == 0x3FF1


def test_a_missing_include_file_is_an_error(asm: Any) -> None:
    assert asm.errors(" include <p16f877.inc>\n end") == ["1:10 102 include file 'p16f877.inc' not found"]


def test_a_register_without_the_header_says_how_to_get_it() -> None:
    with pytest.raises(InputError) as error:
        assemble(" clrf PORTB\n end")
    assert error.value.hint is not None
    assert "include <p16f84.inc>" in error.value.hint


def test_files_beside_the_source_are_found_in_any_case(tmp_path: Path) -> None:
    (tmp_path / "Macros.INC").write_text("two equ 2\n")
    include = beside(tmp_path)
    assert include("macros.inc") == "two equ 2\n"
    assert include("other.inc") is None


def test_an_include_file_that_cannot_be_read_is_an_error_of_the_line_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "folder.inc").mkdir()
    with pytest.raises(InputError) as error:
        assemble(" nop\n include folder.inc\n end", "t.asm", None, beside(tmp_path))
    (found,) = error.value.diagnostics
    assert (found.code, found.location) == ("asm-include", Location("t.asm", 2, 10))
    assert found.message == "include file 'folder.inc' is a directory: only regular files are read"


def test_a_file_that_includes_itself_without_end_is_an_error() -> None:
    with pytest.raises(InputError, match="without end"):
        assemble(" include loop.inc\n end", "t.asm", None, {"loop.inc": " include loop.inc\n"}.get)
