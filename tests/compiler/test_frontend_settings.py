"""Pragmas, the configuration word, the clock, the names of the dialects: each rule at its limits."""

from __future__ import annotations

import re
from itertools import product

import pytest

from servogen.compiler.ast.types import BIT, BOOL, U8, FloatType, IntType
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.dialects import (
    C2C,
    SDCC,
    XC8,
    chip_bits,
    chip_registers,
    config_names,
    float_type,
    named_types,
    type_names,
)
from servogen.compiler.frontend.preprocessor import Pragma
from servogen.compiler.frontend.settings import PragmaSettings, number
from servogen.compiler.sema.names import register_layout
from servogen.errors import Location
from servogen.pic.device import device
from servogen.units import Clock
from tests.compiler.marked import found_in, line_of, stated

HERE, THERE = Location("main.c", 3, 1), Location("main.c", 5, 1)
CHIP = device("PIC16F84A")


def settings() -> PragmaSettings:
    return PragmaSettings(CHIP, Reporter())


def read(*pragmas: str) -> PragmaSettings:
    """Return what pragmas set, one in each line from the third on."""
    read_ = settings()
    for line, words in enumerate(pragmas, 3):
        read_.pragma(Pragma(words, Location("main.c", line, 1)))
    return read_


def said(read_: PragmaSettings) -> list[str]:
    places = [each.location.line for each in read_.reporter.ordered() if each.location]
    return [f"{line} {line_of(each)}" for line, each in zip(places, read_.reporter.ordered(), strict=True)]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("4000000", 4_000_000), (" 7 ", 7), ("4_000_000", 4_000_000), ("0x10", 16), ("0Xff", 255),
        ("010", 10), ("20000000UL", 20_000_000), ("((5))", 5), ("(4 * 1000000)", 4_000_000), ("(3)*(4)", 12),
        ("3 * 0x10 * 2", 96), ("20e6", 20_000_000), ("20E+6", 20_000_000), ("2.5e3", 2500), ("3.f", 3),
        ("1e2L", 100), ("2.5", None), ("1e-3", None), ("1e100", None), ("", None), ("()", None),
        ("fast", None), ("4 * fast", None), ("4 + 4", None), ("-4", None), ("0x", None),
    ],
)  # fmt: skip
def test_a_number_of_a_pragma(text: str, value: int | None) -> None:
    assert number(text) == value


def word(oscillator: int, *, watchdog: bool, timer: bool, protect: bool) -> int:
    """Return the configuration word of DS35007 register 6-1: FOSC in bits 0 and 1, WDTE in bit 2, PWRTE,
    which is on when it is 0, in bit 3, and CP in bits 4 to 13, which are 0 when it is on.
    """
    return oscillator + 4 * watchdog + 8 * (not timer) + (0 if protect else 0x3FF0)


OSCILLATORS = {"LP": 0, "XT": 1, "HS": 2, "RC": 3, "EXTRC": 3, "": 1}
SWITCH = ("", "ON", "OFF")


@pytest.mark.parametrize("oscillator", OSCILLATORS)
def test_every_configuration_word(oscillator: str) -> None:
    for wdte, pwrte, cp in product(SWITCH, SWITCH, SWITCH):
        given = {"FOSC": oscillator, "wdte": wdte.lower(), "PWRTE": pwrte, "CP": cp}
        text = ", ".join(f"{name} = {value}" for name, value in given.items() if value)
        read_ = read(*([f"config {text}"] if text else []))
        assert said(read_) == []
        expected = word(
            OSCILLATORS[oscillator], watchdog=wdte == "ON", timer=pwrte != "OFF", protect=cp == "ON"
        )
        assert read_.config_word(None) == expected, text


@pytest.mark.parametrize(
    ("hz", "oscillator"), [(200_000, 0), (200_001, 1), (4_000_000, 1), (4_000_001, 2), (20_000_000, 2)]
)
def test_the_oscillator_suits_the_clock(hz: int, oscillator: int) -> None:
    """DS35007 table 6-1: LP up to 200 kHz, XT up to 4 MHz, HS above."""
    assert settings().config_word(Clock(hz)) == word(oscillator, watchdog=False, timer=True, protect=False)
    assert read("config FOSC = RC").config_word(Clock(hz)) & 3 == 3


FIELDS = {"LP": 3, "XT": 3, "HS": 3, "RC": 3, "EXTRC": 3, "WDT": 4, "PWRT": 8, "CP": 0x3FF0}


def mask(name: str) -> int:
    """Return the mask that a name of the headers stands for: its own field as set, all other bits 1."""
    bare = name.removeprefix("_").removeprefix("FOSC_").removesuffix("_OSC")
    if bare in OSCILLATORS:
        return 0x3FFC | OSCILLATORS[bare]
    on = bare.endswith(("_ON", "EN")) or bare == "PROTECT"
    if bare.startswith("WDT"):
        return 0x3FFF if on else 0x3FFB
    if bare.startswith("PWRT"):
        return 0x3FF7 if on else 0x3FFF
    assert bare.startswith("CP") or bare.endswith("PROTECT")
    return 0x000F if on else 0x3FFF


def test_the_masks_of_the_configuration_word() -> None:
    assert {name: f"{value:04X}" for name, value in config_names().items()} == {
        name: f"{mask(name):04X}" for name in config_names()
    }
    assert len(config_names()) == 30


CONFIGURATION = "error c-configuration: "


@pytest.mark.parametrize(
    ("pragmas", "texts"),
    [
        (["config FOSC"], ["3 " + CONFIGURATION + "'FOSC' is not a setting, which is written NAME = VALUE"]),
        (["config FOSK = XT"], [
            "3 " + CONFIGURATION + "unknown configuration setting 'FOSK' // did you mean 'FOSC'?"]),
        (["config fosc = XY"], ["3 " + CONFIGURATION + "'XY' is not a value of FOSC // known: EXTRC, "
            "HS, LP, RC, XT"]),
        (["config CP = ON", "config CP = OFF"], ["4 " + CONFIGURATION + "CP is set twice: ON and OFF"]),
        (["config CP = ON", "config cp = on"], []),
        (["config A, WDTE = ON, B"], [
            f"3 {CONFIGURATION}'{name}' is not a setting, which is written NAME = VALUE" for name in "AB"]),
        (["CLOCK_FREQ 0"], ["3 error c-clock: #pragma CLOCK_FREQ needs a frequency in hertz, not '0'"]),
        (["CLOCK_FREQ"], ["3 error c-clock: #pragma CLOCK_FREQ needs a frequency in hertz, not ''"]),
        (["CLOCK_FREQ 1"], []),
        (["DATA 0x2100, 256"], ["3 error c-pragma: #pragma DATA: '256' is not a number from 0 to 255"]),
        (["DATA 0x2100, -1"], ["3 error c-pragma: #pragma DATA: '-1' is not a number from 0 to 255"]),
        (["DATA 0x2100, x, 1"], ["3 error c-pragma: #pragma DATA: 'x' is not a number from 0 to 255"]),
        (["push_macro(A)"], ["3 error c-pragma: #pragma push_macro is not supported"]),
        (["pop_macro(A)"], ["3 error c-pragma: #pragma pop_macro is not supported"]),
        (["hurry now"], ["3 c-pragma: unknown #pragma hurry"]),
        (["pack(1)"], ["3 c-pragma: unknown #pragma pack(1)"]),
        (["pack 1", "ONCE", "warning disable 520", "interrupt_level 1", "printf_check(x) const"], [
            "7 c-pragma: unknown #pragma printf_check(x)"]),
        ([""], ["3 c-pragma: unknown #pragma "]),
    ],
)  # fmt: skip
def test_what_a_pragma_does_not_accept(pragmas: list[str], texts: list[str]) -> None:
    assert said(read(*pragmas)) == texts


NOWHERE = (
    "error c-pragma: #pragma DATA: no data can be placed at '{}' // 0x2007 is the configuration word, "
    "the EEPROM begins at 0x2100, the ID words at 0x2000"
)


def test_data_go_to_the_eeprom_and_to_the_id_words() -> None:
    """The EEPROM has 64 bytes, and there are four ID words (DS35007 sections 3 and 6.13)."""
    read_ = read(
        "DATA 0x2100, 1, 0xFF, 0", "data _EEPROM, 9", "DATA 0x213F, 7", "DATA _IDLOC0, 1, 2", "DATA 0x2003, 5"
    )
    assert (read_.eeprom, read_.ids) == ({0: 9, 1: 255, 2: 0, 63: 7}, {0: 1, 1: 2, 3: 5})
    assert said(read_) == []
    for where in ("0x2140", "0x20FF", "0x2004", "0x1FFF", "here"):
        read_ = read(f"DATA {where}, 5, 6")
        assert said(read_) == ["3 " + NOWHERE.format(where)]
        assert (read_.eeprom, read_.ids) == ({}, {})
    read_ = read("DATA 0x213F, 5, 6")
    assert (said(read_), read_.eeprom) == (["3 " + NOWHERE.format("0x213F")], {63: 5})
    read_ = read("DATA 0x2100, 1, 999, 3")
    assert (len(said(read_)), read_.eeprom) == (1, {0: 1, 2: 3})


def test_a_mask_of_the_assembler() -> None:
    for text, value in (
        ("0x3FF9", 0x3FF9),
        ("(_HS_OSC & _wdt_off)", 0x3FFA),
        ("0x7FFF", 0x3FFF),
        ("_CP_ON", 0xF),
    ):
        read_ = settings()
        read_.asm_config(text, HERE)
        assert read_.config_mask == (value, HERE)
        assert read_.config_word(Clock(20_000_000)) == value
    read_ = settings()
    read_.asm_config("_HS_OSC & _WDT_OF", HERE)
    hint = "did you mean '_WDT_OFF'?"
    assert said(read_) == [f"3 {CONFIGURATION}'_WDT_OF' is not a configuration mask // {hint}"]
    assert read_.config_mask is None
    assert read("DATA 0x2007, 0x3FF2").config_mask == (0x3FF2, HERE)


def test_the_serial_settings() -> None:
    read_ = read(
        "RS232_TXPORT PORTB",
        "rs232_txpin 1",
        "RS232_RXPORT 5",
        "RS232_RXPIN 0",
        "RS232_BAUD 9600",
        "TRUE_RS232 0",
    )
    assert read_.serial == {
        "TXPORT": "PORTB", "TXPIN": "1", "RXPORT": "5", "RXPIN": "0", "BAUD": "9600", "TRUE": "0",
    }  # fmt: skip


def test_the_clock_by_precedence() -> None:
    macros = {"_XTAL_FREQ": ("4000000", THERE), "_CLOCK_FREQ": ("4e6", THERE), "OTHER": ("x", THERE)}
    assert settings().clock({}, None) is None
    assert settings().clock(macros, None) == Clock(4_000_000)
    assert settings().clock({}, 8_000_000) == Clock(8_000_000)
    assert read("CLOCK_FREQ 20000000").clock({}, None) == Clock(20_000_000)
    assert read("CLOCK_FREQ 4000000").clock(macros, 4_000_000) == Clock(4_000_000)


AGREE = "one program has one clock: make them agree"


@pytest.mark.parametrize(
    ("pragmas", "macros", "option", "texts"),
    [
        ([], {"_XTAL_FREQ": "0"}, None, ["5 error c-clock: _XTAL_FREQ must be a frequency in hertz, not "
            "'0'"]),
        ([], {"_CLOCK_FREQ": "x"}, None, ["5 error c-clock: _CLOCK_FREQ must be a frequency in hertz, "
            "not 'x'"]),
        (["CLOCK_FREQ 5"], {"_XTAL_FREQ": "6"}, None, [
            f"5 error c-clock: _XTAL_FREQ says 6 Hz, #pragma CLOCK_FREQ says 5 Hz // {AGREE}"]),
        (["CLOCK_FREQ 5"], {}, 6, [
            f"3 error c-clock: --clock-hz says 6 Hz, #pragma CLOCK_FREQ says 5 Hz // {AGREE}"]),
        ([], {"_XTAL_FREQ": "6", "_CLOCK_FREQ": "7"}, 8, [
            f"5 error c-clock: _CLOCK_FREQ says 7 Hz, _XTAL_FREQ says 6 Hz // {AGREE}",
            f"5 error c-clock: --clock-hz says 8 Hz, _XTAL_FREQ says 6 Hz // {AGREE}"]),
        ([], {"_XTAL_FREQ": "20000000"}, None, []),
        (["CLOCK_FREQ 20000001"], {}, None, [
            "3 error c-clock: 20000001 Hz is too fast: PIC16F84A runs at up to 20000000 Hz"]),
    ],
)  # fmt: skip
def test_clocks_that_cannot_be(
    pragmas: list[str], macros: dict[str, str], option: int | None, texts: list[str]
) -> None:
    read_ = read(*pragmas)
    read_.clock({name: (text, THERE) for name, text in macros.items()}, option)
    assert said(read_) == texts


# the names of the dialects


def test_the_types_of_stdint_have_the_size_in_their_name() -> None:
    numbered = {}
    for name, kind in named_types().items():
        digits = re.search(r"int(?:_least|_fast)?(\d+)", name)
        if digits:
            assert isinstance(kind, IntType)
            numbered[name] = (8 * kind.size, kind.signed)
            assert numbered[name] == (int(digits[1]), not name.strip("_").startswith("u")), name
    assert len(numbered) == 22
    for name, size, signed in (("size_t", 2, False), ("intptr_t", 2, True), ("uintmax_t", 4, False)):
        found = named_types()[name]
        assert isinstance(found, IntType)
        assert (found.size, found.signed) == (size, signed)
    assert [named_types()[name] for name in ("bit", "__bit", "bool", "_Bool")] == [BIT, BIT, BOOL, BOOL]
    assert {"int64_t", "uint_least64_t", "PORTBbits_t", "uint8_t", "bit"} <= type_names()


def test_the_floating_point_type_of_each_dialect() -> None:
    """XC8 User's Guide DS52053B, section 5.4.3: 24 bits unless 32 are asked for."""
    assert [float_type(name) for name in (XC8, C2C, SDCC)] == [FloatType(3), FloatType(4), FloatType(4)]
    assert [float_type(name, 32) for name in (XC8, C2C)] == [FloatType(4)] * 2
    assert [float_type(name, 24) for name in (XC8, SDCC)] == [FloatType(3)] * 2


def test_registers_and_bits_by_all_their_names() -> None:
    """DS35007 table 2-1 and registers 2-1 to 2-3."""
    where = {name: (bit.register.name, bit.bit) for name, bit in chip_bits().items()}
    for bit in range(8):
        assert where[f"RB{bit}"] == where[f"PORTB{bit}"] == ("PORTB", bit)
    for bit in range(5):
        assert where[f"PORTA{bit}"] == ("PORTA", bit)
    names = ("C", "CARRY", "ZERO", "nPD", "NOT_TO", "GIE", "TMR0IF", "T0IE", "nRBPU")
    assert [where[name] for name in names] == [
        ("STATUS", 0), ("STATUS", 0), ("STATUS", 2), ("STATUS", 3), ("STATUS", 4),
        ("INTCON", 7), ("INTCON", 2), ("INTCON", 5), ("OPTION_REG", 7),
    ]  # fmt: skip
    assert {name: chip_registers()[name].address for name in ("PORTA", "portb", "OPTION", "option_reg")} == {
        "PORTA": 5, "portb": 6, "OPTION": 0x81, "option_reg": 0x81,
    }  # fmt: skip


def test_the_layout_of_a_register() -> None:
    """RP is bits 5 and 6 of STATUS, PS bits 0 to 2 of OPTION_REG (DS35007 registers 2-1 and 2-2)."""
    status, option = register_layout("STATUS"), register_layout("OPTION")
    assert (status.tag, status.union, status.size, option.tag) == ("STATUSbits", False, 1, "OPTION_REGbits")
    for layout, name, kind, bit, width in (
        (status, "RP", U8, 5, 2), (status, "RP0", BIT, 5, 1), (status, "C", BIT, 0, 1),
        (option, "PS", U8, 0, 3), (option, "PS1", BIT, 1, 1), (option, "INTEDG", BIT, 6, 1),
    ):  # fmt: skip
        member = layout.members[name]
        assert (member.name, member.type, member.offset, member.bit, member.width) == (
            name, kind, 0, bit, width,
        )  # fmt: skip
    assert "RB0" not in status.members


def test_a_declaration_may_set_the_configuration() -> None:
    for marked, texts in (
        ("__CONFIG(FOSC_HS & ‸WDTE_OF);", ["error c-undeclared: 'WDTE_OF' is not declared"]),
        ("__IDLOC(FFFF);", []),
        ("‸__IDLOC(G);", ["error c-configuration: __IDLOC takes up to four hexadecimal digits, not 'G'"]),
        ("‸__IDLOC();", ["error c-configuration: __IDLOC takes up to four hexadecimal digits, not ''"]),
        (
            "‸__EEPROM_DATA(1, 2);",
            ["error c-initialiser: __EEPROM_DATA takes 8 values, not 2 // fill the rest with 0"],
        ),
        ("__EEPROM_DATA(1, 2, 3, 4, 5, 6, 7, 8);", []),
    ):
        program = f"{marked}\nvoid main(void) {{ }}"
        assert found_in(program) == stated(program, texts)
