"""Figures of the data sheets, row by row: chips, memory, registers in both banks, HEX regions."""

from __future__ import annotations

import pickle

import pytest

from servogen.errors import InputError
from servogen.pic import device
from servogen.pic.device import PIC16C84, config_word, data_byte_exists, oscillator_for
from servogen.pic.image import REGIONS, Image, from_hex, image_of, read_hex, region_of, to_hex
from servogen.pic.isa import by_mnemonic, encode
from servogen.pic.spelling import assembly_text, bit_name, is_exact, other_bank, register_name
from tests.pic.test_image import END, GOOD, record

# DS30430 section 8.1 and D122, DS35007 section 6.1 and D122, DS30445 sections 4.2 and 8.1, D122: MHz, the
# code protection bits of the configuration word, typical and maximum ms of an EEPROM write, last byte of RAM.
CHIPS = {
    "PIC16F84": (10, range(4, 14), 10, 20, 0x4F, False),
    "PIC16F84A": (20, range(4, 14), 4, 8, 0x4F, False),
    "PIC16C84": (10, range(4, 5), 10, 20, 0x2F, True),
}


def test_the_chips_differ_as_their_data_sheets_say() -> None:
    assert [chip.name for chip in device.DEVICES] == ["PIC16F84", "PIC16F84A"]
    assert (*device.DEVICES, PIC16C84) == device.ASSEMBLED_DEVICES
    for chip in device.ASSEMBLED_DEVICES:
        mhz, protecting, typical_ms, most_ms, last, power_up_on_is_1 = CHIPS[chip.name]
        assert chip.max_clock_hz == mhz * 1_000_000
        assert chip.code_protect_mask == sum(1 << bit for bit in protecting)
        assert (chip.eeprom_write_us, chip.max_eeprom_write_us) == (typical_ms * 1000, most_ms * 1000)
        assert (chip.ram_last, chip.power_up_timer_on_is_1) == (last, power_up_on_is_1)
    assert device.WATCHDOG_US == (7_000, 33_000)  # DS35007 section 9, parameter 31: 7, 18, 33 ms


def test_each_oscillator_reaches_its_last_hertz() -> None:
    """DS35007 table 6-1: LP up to 200 kHz, XT up to 4 MHz."""
    pairs = ((1, "LP"), (200_000, "LP"), (200_001, "XT"), (4_000_000, "XT"), (4_000_001, "HS"))
    assert [oscillator_for(hz) for hz, _ in pairs] == [name for _, name in pairs]
    defaults = config_word("RC")
    assert defaults == 0b11_1111_1111_0011, "no protection, the power-up timer on, the watchdog off"


# DS35007 figure 2-2, the addresses without a byte: 7, the rest of each bank behind the RAM, and 87.
MISSING = {0x07, 0x87, *range(0x50, 0x80), *range(0xD0, 0x100)}


def test_the_data_memory_has_the_bytes_of_the_file_map() -> None:
    assert {address for address in range(256) if not data_byte_exists(address)} == MISSING
    assert not any(data_byte_exists(address) for address in (-1, 0x100, 0x10C, 1 << 20))


NAMES = ["INDF", "TMR0", "PCL", "STATUS", "FSR", "PORTA", "PORTB", "-", "EEDATA", "EEADR", "PCLATH", "INTCON"]
BANK_1 = {0x01: "OPTION_REG", 0x05: "TRISA", 0x06: "TRISB", 0x08: "EECON1", 0x09: "EECON2"}


def test_registers_are_spelled_by_their_name_in_bank_0_with_the_one_in_bank_1_beside_it() -> None:
    for address in range(0x80):
        known = NAMES[address] if address < len(NAMES) and address != 7 else f"0x{address:02X}"
        assert register_name(address) == known
        assert other_bank(address) == BANK_1.get(address)
    assert [bit_name(3, bit) for bit in range(8)] == ["C", "DC", "Z", "NOT_PD", "NOT_TO", "RP0", "RP1", "IRP"]
    assert [bit_name(5, bit) for bit in (0, 4, 5, 7)] == ["RA0", "RA4", "5", "7"]
    assert [bit_name(at, 6) for at in (0x20, 4, 7, 0x0B)] == ["6", "6", "6", "EEIE"]


def test_text_stands_for_exactly_the_words_that_assemblers_write() -> None:
    """The ignored bits are 0, except in CLRW, where MPASM writes 0x0103."""
    ignored = {"CLRW": 0b0000011, "NOP": 0}
    for word in (0x0000, 0x0103, 0x3055, 0x3455, 0x3C55, 0x3E55, 0x0065):
        assert is_exact(word), hex(word)
    for word in (0x0020, 0x0040, 0x0100, 0x0102, 0x3155, 0x3255, 0x3555, 0x3D55, 0x3F55, 0x0001, 0x0067):
        assert not is_exact(word), hex(word)
    assert {name for name in ignored if by_mnemonic()[name].ignored} == {"CLRW"}
    assert assembly_text(0x2805) == "GOTO 0x005"
    assert assembly_text(0x2805, lambda address: f"L{address}") == "GOTO L5"
    assert assembly_text(0x3005, lambda address: f"L{address}") == "MOVLW 0x05"


# The bits of each field in a word: DS35007 figure 7-1.
WIDTHS = {"ADDWF": {"f": 7, "d": 1}, "BSF": {"f": 7, "b": 3}, "MOVLW": {"k": 8}, "GOTO": {"k": 11}}
PLACES = {"f": 0, "d": 7, "b": 7, "k": 0}


@pytest.mark.parametrize("name", WIDTHS)
def test_a_field_takes_its_largest_value_and_none_beyond(name: str) -> None:
    row = by_mnemonic()[name]
    assert "".join(row.operands) == "".join(field for field in "fdbk" if field in WIDTHS[name])
    for field, width in WIDTHS[name].items():
        assert (row.width(field), row.shift(field)) == (width, PLACES[field])
        largest = (1 << width) - 1
        assert encode(name, **{field: largest}) == encode(name) | largest << PLACES[field]
        for wrong in (largest + 1, -1):
            with pytest.raises(ValueError, match=f"^{name}: {field} = {wrong} does not fit {width} bits$"):
                encode(name, **{field: wrong})
    for field in {"f", "d", "b", "k"} - WIDTHS[name].keys():
        assert row.width(field) == 0
        with pytest.raises(ValueError, match=f"^{name} has no operand {field}$"):
            encode(name, **{field: 1})


# -- HEX files -------------------------------------------------------------------------------------------

ENDS = {
    "program": (0, 0x3FF),
    "ids": (0x2000, 0x2003),
    "config": (0x2007, 0x2007),
    "eeprom": (0x2100, 0x213F),
}


def test_the_regions_of_a_hex_file_end_where_the_programming_specification_says() -> None:
    """DS30262 section 2.1."""
    assert {region.name: (region.start, region.start + region.length - 1) for region in REGIONS} == ENDS
    for name, (first, last) in ENDS.items():
        for address in (first, last):
            region = region_of(address)
            assert region is not None and region.name == name
        for address in (first - 1, last + 1):
            region = region_of(address)
            assert region is None or region.name != name
    words = dict.fromkeys((0, 0x3FF, 0x400, 0x2003, 0x2004, 0x2007, 0x2008, 0x213F, 0x2140), 5)
    assert image_of(words) == Image({0: 5, 0x3FF: 5}, 5, {0x3F: 5}, {3: 5})


@pytest.mark.parametrize("address", range(0x2004, 0x2007))
def test_a_reserved_word_is_omitted_and_said(address: int) -> None:
    read = read_hex(GOOD + record(2 * address, 0x34, 0x12) + END, "r.hex")
    assert read.image == Image({0: 0x3001})
    assert [str(each) for each in read.remarks] == [
        f"r.hex:2: warning: word 0x{address:04X} is reserved and omitted [hex-word]"
    ]


@pytest.mark.parametrize(
    ("address", "value", "kept"),
    [
        (0x0000, 0x3FFF, 0x3FFF), (0x0000, 0x4000, None), (0x0000, 0xFFFE, None), (0x0000, 0xFFFF, 0x3FFF),
        (0x2000, 0x3FFF, 0x3FFF), (0x2000, 0x4000, None), (0x2003, 0xFFFF, 0x3FFF), (0x2003, 0xC001, None),
        (0x2007, 0x3FFF, 0x3FFF), (0x2007, 0x4000, None), (0x2007, 0xBFFF, None), (0x2007, 0xC000, 0x0000),
        (0x2007, 0xFFF1, 0x3FF1), (0x2100, 0xFF12, 0x12), (0x2100, 0x0100, 0x00),
    ],
)  # fmt: skip
def test_what_a_word_may_hold(address: int, value: int, kept: int | None) -> None:
    text = record(2 * address, value & 0xFF, value >> 8) + END
    if kept is None:
        region = region_of(address)
        assert region is not None
        wanted = (
            rf"^w\.hex:1: error: word 0x{address:04X} is 0x{value:04X}; the {region.name} area holds at most "
            r"0x3FFF \[hex-syntax\]"
        )
        with pytest.raises(InputError, match=wanted):
            from_hex(text, "w.hex")
        return
    read = read_hex(text)
    assert [*read.image.program.values(), *read.image.ids.values(), *read.image.eeprom.values()] == (
        [] if address == 0x2007 else [kept]
    )
    assert read.image.config == (kept if address == 0x2007 else None)
    assert bool(read.remarks) == (kept != value and address < 0x2100)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x" * 20 + "\n", f"this is not an Intel HEX file: it has '{'x' * 20}'"),
        ("x" * 21 + "\n", f"this is not an Intel HEX file: it has '{'x' * 20}…'"),
        (GOOD + "x" * 21 + "\n", f"'{'x' * 20}…' is not an Intel HEX record"),
        (END + "x\n", "'x' is not an Intel HEX record"),
        (record(0, 0, 0, kind=4) + "x\n", "'x' is not an Intel HEX record"),
        (":00000001\n", "the record is truncated: it announces 0 data bytes and has fewer"),
        (":0000FF\n", "the record is truncated: it announces 0 data bytes and has fewer"),
        (record(0, 1, kind=6) + END, "record type 06 is unknown: known are 00 to 05"),
        (":00000001FE\n", "wrong checksum 0xFE: the record's bytes give 0xFF"),
        (":0000000100FF\n", "the record is too long: it announces 0 data bytes and has 1"),
        (":0 000001FF\n", "' ' in column 3 is not a hexadecimal digit"),
        (":g0000001FF\n", "'g' in column 2 is not a hexadecimal digit"),
    ],
)
def test_a_line_that_is_not_a_record(text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        from_hex(text, "r.hex")
    assert caught.value.message == message


def test_a_record_of_each_kind_up_to_05_is_read() -> None:
    starts = record(0, 0, 0, 0, 0, kind=3) + record(0, 0, 0, 0, 0, kind=5)
    assert from_hex(record(0, 0, 0, kind=2) + record(0, 0, 0, kind=4) + starts + GOOD + END) == Image(
        {0: 0x3001}
    )


def test_an_image_says_its_size_and_goes_to_another_process() -> None:
    image = Image({0: 1, 7: 2}, 0x3FF1, {3: 4}, {0: 5})
    assert repr(image) == "<Image of 2 words, configuration 0x3FF1>"
    assert repr(Image({})) == "<Image of 0 words, configuration none>"
    assert pickle.loads(pickle.dumps(image)) == image
    assert to_hex(Image({1: 0x1234}, 0)).splitlines() == [
        ":0200020034" + "12B6",
        ":02400E000000B0",
        ":00000001FF",
    ]
