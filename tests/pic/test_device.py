"""The chip's facts against a second list, typed from PIC16F84A DS35007 (tables 1-1 and 2-1, section 6.1)."""

from __future__ import annotations

import pytest

from servogen.errors import InputError
from servogen.pic import device
from servogen.pic.device import config_word, oscillator_for, register_bits, registers

ADDRESSES = """
00 INDF   01 TMR0  02 PCL    03 STATUS 04 FSR 05 PORTA 06 PORTB 08 EEDATA 09 EEADR 0A PCLATH 0B INTCON
81 OPTION_REG 85 TRISA 86 TRISB 88 EECON1 89 EECON2
"""

# bits 7 to 0
BITS = {
    "STATUS": "IRP RP1 RP0 TO PD Z DC C",
    "INTCON": "GIE EEIE T0IE INTE RBIE T0IF INTF RBIF",
    "OPTION_REG": "RBPU INTEDG T0CS T0SE PSA PS2 PS1 PS0",
    "EECON1": "- - - EEIF WRERR WREN WR RD",
    "PORTA": "- - - RA4 RA3 RA2 RA1 RA0",
    "PORTB": "RB7 RB6 RB5 RB4 RB3 RB2 RB1 RB0",
    "TRISA": "- - - TRISA4 TRISA3 TRISA2 TRISA1 TRISA0",
    "TRISB": "TRISB7 TRISB6 TRISB5 TRISB4 TRISB3 TRISB2 TRISB1 TRISB0",
}


def test_registers_are_where_the_register_file_map_has_them() -> None:
    cells = ADDRESSES.split()
    expected = {name: int(address, 16) for address, name in zip(cells[::2], cells[1::2], strict=True)}
    assert {name: register.address for name, register in registers().items()} == expected


def test_bits_are_where_the_register_drawings_have_them() -> None:
    expected = {
        bit: (register, 7 - place)
        for register, names in BITS.items()
        for place, bit in enumerate(names.split())
        if bit != "-"
    }
    assert {name: (register.name, bit) for name, (register, bit) in register_bits().items()} == expected


def test_registers_without_named_bits_have_none() -> None:
    assert registers()["TMR0"].bit_names() == (None,) * 8


def test_six_registers_are_in_both_banks() -> None:
    assert set(device.BOTH_BANKS) == {"INDF", "PCL", "STATUS", "FSR", "PCLATH", "INTCON"}


def test_memory_is_as_large_as_the_data_sheet_says() -> None:
    assert device.PROGRAM_WORDS == 1024
    assert device.RAM_BYTES == 68
    assert (device.RAM_FIRST, device.RAM_LAST) == (0x0C, 0x4F)
    assert device.EEPROM_BYTES == 64
    assert device.STACK_LEVELS == 8
    assert (device.RESET_VECTOR, device.INTERRUPT_VECTOR) == (0, 4)
    assert device.ERASED_WORD == 0x3FFF
    assert (device.ID_ADDRESS, device.ID_WORDS) == (0x2000, 4)
    assert device.CONFIG_ADDRESS == 0x2007
    assert device.EEPROM_ADDRESS == 0x2100


DRAWN = "RA2 RA3 RA4 MCLR VSS RB0 RB1 RB2 RB3 RB4 RB5 RB6 RB7 VDD OSC2 OSC1 RA0 RA1"


def test_the_package_has_18_pins_as_drawn() -> None:
    assert [(pin.number, pin.name) for pin in device.PACKAGE] == list(enumerate(DRAWN.split(), 1))
    assert device.OPEN_DRAIN_PIN == "RA4"


@pytest.mark.parametrize(
    ("oscillator", "watchdog", "power_up_timer", "code_protect", "word"),
    [
        ("XT", False, True, False, 0x3FF1), ("HS", False, True, False, 0x3FF2),
        ("LP", False, True, False, 0x3FF0), ("RC", False, True, False, 0x3FF3),
        ("XT", True, True, False, 0x3FF5), ("XT", False, False, False, 0x3FF9),
        ("RC", True, False, False, 0x3FFF), ("XT", False, True, True, 0x0001),
    ],
)  # fmt: skip
def test_configuration_words(
    oscillator: str, watchdog: bool, power_up_timer: bool, code_protect: bool, word: int
) -> None:
    made = config_word(
        oscillator, watchdog=watchdog, power_up_timer=power_up_timer, code_protect=code_protect
    )
    assert made == word


@pytest.mark.parametrize(
    ("hz", "oscillator"),
    [
        (32_768, "LP"), (200_000, "LP"), (1_000_000, "XT"), (4_000_000, "XT"), (4_000_001, "HS"),
        (20_000_000, "HS"),
    ],
)  # fmt: skip
def test_the_oscillator_setting_follows_the_clock(hz: int, oscillator: str) -> None:
    assert oscillator_for(hz) == oscillator


@pytest.mark.parametrize("name", ["PIC16F84", "pic16f84", "16F84", "16f84", "P16F84"])
def test_a_device_is_found_with_or_without_pic(name: str) -> None:
    found = device.device(name)
    assert found.name == "PIC16F84"
    assert found.short_name == "16F84"


def test_the_two_devices_differ_in_their_fastest_clock() -> None:
    assert device.device("16F84").max_clock_hz == 10_000_000
    assert device.device("16F84A").max_clock_hz == 20_000_000


def test_an_unknown_device_is_refused_with_the_nearest_known() -> None:
    with pytest.raises(InputError, match="16F48") as refusal:
        device.device("PIC16F48")
    assert refusal.value.hint is not None
    assert "PIC16F84" in refusal.value.hint
