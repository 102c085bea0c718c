"""HEX files: what goes out comes back, and every defect of a file has its own sentence with its line."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.pic.image import Image, from_hex, read_hex, to_hex

END = ":00000001FF\n"


def record(address: int, *data: int, kind: int = 0) -> str:
    """A record with its right checksum."""
    body = [len(data), address >> 8, address & 0xFF, kind, *data]
    return ":" + bytes([*body, -sum(body) & 0xFF]).hex().upper() + "\n"


IMAGES = st.builds(
    Image,
    st.dictionaries(st.integers(0, 1023), st.integers(0, 0x3FFF), max_size=60),
    st.none() | st.integers(0, 0x3FFF),
    st.dictionaries(st.integers(0, 63), st.integers(0, 0xFF), max_size=20),
    st.dictionaries(st.integers(0, 3), st.integers(0, 0x3FFF)),
)


@given(IMAGES)
def test_an_image_written_and_read_is_the_same_image(image: Image) -> None:
    text = to_hex(image)
    assert from_hex(text) == image
    assert to_hex(from_hex(text)) == text


def test_the_whole_chip_comes_back() -> None:
    image = Image(
        {address: address * 16 & 0x3FFF for address in range(1024)},
        0x3FF1,
        {place: 255 - place for place in range(64)},
        {0: 1, 1: 2, 2: 3, 3: 4},
    )
    assert from_hex(to_hex(image)) == image


def test_words_stand_low_byte_first_at_twice_their_address() -> None:
    text = to_hex(Image({0: 0x2805, 1: 0x3FFF}, 0x3FF1, {0: 0xAB}, {0: 0x000C}))
    assert text.splitlines() == [
        ":040000000528FF3F91", ":024000000C00B2", ":02400E00F13F80", ":02420000AB0011", ":00000001FF",
    ]  # fmt: skip


def test_a_file_as_gpasm_writes_it_is_read() -> None:
    text = record(0, 0, 0, kind=4) + record(0, 0x01, 0x30, 0x86, 0x00) + record(0x400E, 0xF1, 0x3F) + END
    image = from_hex(text)
    assert dict(image.program) == {0: 0x3001, 1: 0x0086}
    assert image.config == 0x3FF1


def test_an_extended_segment_address_counts() -> None:
    config = record(0, 0x04, 0x00, kind=2) + record(0x0E, 0xF1, 0x3F) + END  # 0x4000 + 0x0E
    assert from_hex(config).config == 0x3FF1
    moved = record(0, 0x04, 0x20, kind=2) + record(0, 0xAA, 0x00) + END  # 0x4200 / 2 is EEPROM place 0
    assert dict(from_hex(moved).eeprom) == {0: 0xAA}


def test_a_start_address_record_is_passed_over() -> None:
    text = record(0, 0, 0, kind=4) + record(0, 0, 0, 0, 0, kind=5) + record(2, 0x34, 0x12) + END
    assert dict(from_hex(text).program) == {1: 0x1234}


def test_records_may_come_in_any_order_with_lower_case_and_other_line_ends() -> None:
    text = (record(0x10, 1, 0) + record(0, 2, 0)).lower().replace("\n", "\r\n") + END
    assert dict(from_hex(text).program) == {0: 2, 8: 1}


def test_comments_even_after_the_end_are_passed_over() -> None:
    assert dict(from_hex("; made by hand\n" + record(0, 1, 0) + END + ";PIC16F84\n").program) == {0: 1}


@pytest.mark.parametrize("upper", [0x00, 0x34, 0x3F, 0xFF])
def test_the_upper_byte_of_an_eeprom_word_means_nothing(upper: int) -> None:
    assert dict(from_hex(record(0x4200, 0x5A, upper) + END).eeprom) == {0: 0x5A}


def test_a_configuration_word_with_its_upper_bits_set_is_read_and_remarked() -> None:
    read = read_hex(record(0x400E, 0xF1, 0xFF) + END, "a.hex")
    assert read.image.config == 0x3FF1
    assert [str(each) for each in read.remarks] == [
        "a.hex:1: warning: word 0x2007 is 0xFFF1: its upper two bits are omitted [hex-word]"
    ]


def test_an_erased_word_as_ffff_is_read_and_remarked() -> None:
    read = read_hex(record(0, 0xFF, 0xFF) + END)
    assert dict(read.image.program) == {0: 0x3FFF}
    assert len(read.remarks) == 1


def test_the_device_id_of_a_readout_is_left_out_and_remarked() -> None:
    read = read_hex(record(0, 1, 0) + record(0x400C, 0x60, 0x05) + END)
    assert read.image == Image({0: 1})
    assert "0x2006" in read.remarks[0].message


def test_a_plain_file_has_no_remarks() -> None:
    assert read_hex(to_hex(Image({0: 0x3FFF}, 0x3FFF, {1: 255}, {2: 0x3FFF}))).remarks == ()


GOOD = record(0, 0x01, 0x30)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (GOOD + ":0200020001304F\n" + END, 2, "wrong checksum 0x4F: the record's bytes give 0xCB"),
        (GOOD + ":100004000130\n" + END, 2, "truncated: it announces 16 data bytes"),
        (GOOD + ":0200020001\n" + END, 2, "truncated: it announces 2 data bytes"),
        (GOOD + ":02\n" + END, 2, "truncated"),
        (GOOD + ":\n" + END, 2, "truncated"),
        (GOOD + ":020002000130C\n" + END, 2, "odd number of digits"),
        (GOOD + ":0200020001300000CB\n" + END, 2, "too long: it announces 2 data bytes and has 4"),
        (GOOD + ":02000200G130CB\n" + END, 2, "'G' in column 10 is not a hexadecimal digit"),
        (GOOD + record(0, 1, kind=9) + END, 2, "record type 09 is unknown"),
        # an extended linear address has two bytes, a start segment address four
        (GOOD + record(0, 0, kind=4) + END, 2, "not an Intel HEX record: Invalid Extended Linear Address"),
        (GOOD + record(0, 0, 0, kind=3) + END, 2, "not an Intel HEX record: Invalid Start Segment Address"),
        (GOOD, None, "truncated: it has no end-of-file record"),
        ("", None, "truncated: it has no end-of-file record"),
        (GOOD + END + GOOD, 3, "a record after the end-of-file record"),
        (GOOD + record(0, 0x01, 0x30) + END, 2, "word 0x0000 is given twice"),
        (record(0, 1) + END, 1, "word 0x0000 has no high byte"),
        (record(3, 1) + END, 1, "word 0x0001 has no low byte"),
        (record(0x800, 1, 0) + END, 1, "word address 0x0400 is beyond the chip"),
        (record(0x4280, 1, 0) + END, 1, "word address 0x2140 is beyond the chip"),
        (record(0, 0, 1, kind=4) + record(0, 1, 0) + END, 2, "word address 0x8000 is beyond the chip"),
        (record(0, 0x00, 0x40) + END, 1, "word 0x0000 is 0x4000; the program area holds at most 0x3FFF"),
        (record(0x4000, 0x00, 0x80) + END, 1, "the ids area holds at most 0x3FFF"),
        (record(0x400E, 0xF1, 0x7F) + END, 1, "the config area holds at most 0x3FFF"),
        ("hello\n", 1, "this is not an Intel HEX file: it has 'hello'"),
        (GOOD + "hello\n" + END, 2, "'hello' is not an Intel HEX record"),
        ("\x7fELF\x02\x01\x00\x00", 1, "binary file"),
        ("\x00" * 40, 1, "binary file"),
    ],
)
def test_each_defect_is_named_with_its_line(text: str, line: int | None, message: str) -> None:
    with pytest.raises(InputError) as defect:
        from_hex(text, "x.hex")
    assert message in defect.value.message
    assert defect.value.location is not None
    assert (defect.value.location.file, defect.value.location.line) == ("x.hex", line)
    assert defect.value.exit_code == 2


def test_what_lies_beyond_the_chip_is_told_what_is_allowed() -> None:
    with pytest.raises(InputError) as defect:
        from_hex(record(0x800, 1, 0) + END)
    assert defect.value.hint == (
        "allowed: program 0x0000-0x03FF, ids 0x2000-0x2003, config 0x2007-0x2007, eeprom 0x2100-0x213F"
    )


@settings(max_examples=300)
@given(st.text(alphabet=":0123456789ABCDEFg;\n\r \x00ÿ", max_size=200))
def test_no_text_crashes_the_reader(text: str) -> None:
    try:
        from_hex(text)
    except InputError as error:
        assert error.message


@settings(max_examples=200)
@given(IMAGES, st.data())
def test_one_changed_character_is_never_read_as_another_program(image: Image, data: st.DataObject) -> None:
    text = to_hex(image)
    index = data.draw(st.sampled_from([at for at, char in enumerate(text) if char in "0123456789ABCDEF"]))
    other = data.draw(st.sampled_from([char for char in "0123456789ABCDEF" if char != text[index]]))
    with pytest.raises(InputError):
        from_hex(text[:index] + other + text[index + 1 :])


def test_an_image_is_the_same_in_any_order_of_its_words() -> None:
    assert Image({1: 2, 0: 3}) == Image({0: 3, 1: 2})
    assert list(Image({1: 2, 0: 3}).program) == [0, 1]
    assert Image({1: 2, 0: 3}).words == 2


def test_the_flash_of_an_image_reads_erased_words_where_nothing_is() -> None:
    flash = Image({0: 0x2805}).flash()
    assert len(flash) == 1024
    assert flash[:3] == [0x2805, 0x3FFF, 0x3FFF]
