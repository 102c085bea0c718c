"""What is compared after programming, and what each programmer is asked to do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from intelhex import IntelHex

from servogen.bench.programmers.flash import (
    Differs,
    is_protected,
    judge,
    last_lines,
    objections,
    programming_command,
    read_eeprom,
    remarks,
)
from servogen.bench.programmers.table import (
    CONFIG,
    EEPROM,
    PK2CMD,
    PROGRAM,
    PROGRAMMERS,
    InstalledProgrammer,
    Programmer,
    ProgrammingRequest,
    difference,
    picpro_config,
    picpro_eeprom,
    program_of,
    wanted,
    whole_of,
)
from servogen.errors import InputError, ToolError
from servogen.pic.device import device
from servogen.pic.image import Image, to_hex

IMAGE = Image({0: 0x2801, 1: 0x3FFF, 0x3FF: 0x0008}, 0x3FF1, eeprom={0: 0x12, 63: 0x34})


def test_a_programmed_chip_has_every_word_and_erased_ones_elsewhere() -> None:
    """An erased word is 0x3FFF, an erased byte 0xFF; the configuration word has fourteen bits."""
    contents = wanted(IMAGE)
    assert [len(contents[memory]) for memory in (PROGRAM, EEPROM, CONFIG)] == [1024, 64, 1]
    assert [contents[PROGRAM][address] for address in (0, 1, 2, 0x3FF)] == [0x2801, 0x3FFF, 0x3FFF, 0x0008]
    assert [contents[EEPROM][address] for address in (0, 1, 63)] == [0x12, 0xFF, 0x34]
    assert contents[CONFIG] == [0x3FF1]
    assert CONFIG not in wanted(replace(IMAGE, config=None))


@pytest.mark.parametrize(
    ("memory", "address", "got", "text"),
    [
        (PROGRAM, 1, 0x3FFE, "in the program memory at address 0x001: 0x3FFE where the file has 0x3FFF"),
        (PROGRAM, 0x3FF, 0, "in the program memory at address 0x3FF: 0x0000 where the file has 0x0008"),
        (EEPROM, 63, 0x3, "in the data EEPROM at address 0x03F: 0x03 where the file has 0x34"),
        (CONFIG, 0, 0x3FF5, "in the configuration word: 0x3FF5 where the file has 0x3FF1"),
    ],
)
def test_the_first_difference_is_named(memory: str, address: int, got: int, text: str) -> None:
    assert difference(wanted(IMAGE), IMAGE) is None
    read = {name: list(words) for name, words in wanted(IMAGE).items()}
    read[memory][address] = got
    assert difference(read, IMAGE) == text
    del read[memory]
    assert difference(read, IMAGE) is None, "what was not read is not compared"


def hex_file(path: Path, data: bytes) -> Path:
    made = IntelHex()
    made.frombytes(data)
    made.write_hex_file(str(path))
    return path


def test_what_was_read_is_found_in_the_files_of_each_programmer(tmp_path: Path) -> None:
    whole = tmp_path / "whole.hex"
    whole.write_text(to_hex(IMAGE), encoding="ascii")
    assert whole_of(whole, IMAGE) == wanted(IMAGE)
    assert program_of(whole, IMAGE) == {PROGRAM: wanted(IMAGE)[PROGRAM]}
    whole.write_text(to_hex(replace(IMAGE, eeprom={})), encoding="ascii")
    assert set(whole_of(whole, IMAGE)) == {PROGRAM, CONFIG}
    right = bytes(wanted(IMAGE)[EEPROM])
    swapped = bytes(byte for pair in zip(right[1::2], right[::2], strict=True) for byte in pair)
    for data in (right, swapped):
        assert picpro_eeprom(hex_file(tmp_path / "e.hex", data), IMAGE) == {EEPROM: list(right)}
    # Device ID, eight bytes of ID, the word, low byte first; the two bits above fourteen mean nothing.
    answer = bytes((0x60, 5, *range(8), 0xF1, 0xFF, 0, 0))
    assert picpro_config(hex_file(tmp_path / "c.hex", answer), IMAGE) == {CONFIG: [0x3FF1]}


@pytest.mark.parametrize(
    ("data", "text"), [(b"", "0 bytes"), (bytes(63), "63 bytes"), (bytes(65), "65 bytes")]
)
def test_an_eeprom_of_another_size_was_not_read(tmp_path: Path, data: bytes, text: str) -> None:
    with pytest.raises(ValueError, match=f"{text} of data EEPROM instead of 64"):
        picpro_eeprom(hex_file(tmp_path / "e.hex", data), IMAGE)


def test_a_configuration_that_is_cut_off_was_not_read(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="11 bytes of configuration"):
        picpro_config(hex_file(tmp_path / "c.hex", bytes(11)), IMAGE)


COMMANDS = {
    "picpro": "program -p /dev/ttyS0 -i main.hex -t 16F84A",
    "pk2cmd": "-PPIC16F84A -Fmain.hex -M -R -T",
    "ipecmd": "-TPPK4 -P16F84A -Fmain.hex -M -OL",
    "pickit3": "-TPPK3 -P16F84A -Fmain.hex -M -OL",
    "usbpicprog": "-p=16F84A -e -w -v -f=main.hex",
    "picprog": "--device=pic16f84a --pic-serial-port=/dev/ttyS0 --input-hexfile=main.hex --erase --burn",
}


@pytest.mark.parametrize("programmer", PROGRAMMERS, ids=lambda programmer: programmer.name)
def test_each_programmer_is_asked_to_program_and_to_read_back(programmer: Programmer) -> None:
    request = ProgrammingRequest(Path("main.hex"), device("PIC16F84A"), "/dev/ttyS0")
    assert " ".join(programmer.program(request)) == COMMANDS[programmer.name]
    assert programmer.needs_port == (programmer.name in ("picpro", "picprog"))
    assert programmer.verifies == (programmer.name != "usbpicprog")
    reads = [
        (" ".join(look.arguments), look.of_protected, look.of_eeprom) for look in programmer.looks(request)
    ]
    expected = {
        "picpro": [
            ("dump rom -p /dev/ttyS0 -o main.hex -t 16F84A", False, False),
            ("dump eeprom -p /dev/ttyS0 -o main.hex -t 16F84A", False, True),
            ("dump config -p /dev/ttyS0 -o main.hex -t 16F84A", True, False),
        ],
        "pk2cmd": [("-PPIC16F84A -GFmain.hex -R -T", False, True)],
    }
    assert reads == expected.get(programmer.name, [])


PK2CMD_CODES = {
    5: "voltage",
    7: "operation failed",
    10: "no PICkit 2",
    11: "too old",
    24: "PK2DeviceFile.dat",
}
PICPROG_CODES = {
    64: "arguments",
    65: "read the HEX",
    66: "open the HEX",
    69: "no JDM",
    74: "disappeared",
    77: "permission",
}
"""pk2cmd's ReadMe.txt, and sysexits.h, whose codes picprog returns."""


@pytest.mark.parametrize(
    ("name", "code", "text"),
    [
        *(("pk2cmd", code, text) for code, text in PK2CMD_CODES.items()),
        *(("picprog", code, text) for code, text in PICPROG_CODES.items()),
        ("pk2cmd", 36, "arguments"),
        ("pk2cmd", 37, "HEX file"),
        ("pk2cmd", 39, "no known chip"),
        *((name, 1, "failed with exit code 1") for name in ("pk2cmd", "picprog", "ipecmd", "picpro")),
    ],
)
def test_an_exit_code_is_explained(name: str, code: int, text: str) -> None:
    (programmer,) = (each for each in PROGRAMMERS if each.name == name)
    with pytest.raises(ToolError, match=text) as error:
        judge(programmer, code, "one\n\ntwo\nthree\nfour\n", "/dev/ttyS0")
    assert (error.value.code, str(error.value.location)) == ("tool-failed", "/dev/ttyS0")
    assert error.value.hint == "two\n  three\n  four"


def test_a_chip_that_differs_is_another_end_than_a_programmer_that_fails() -> None:
    with pytest.raises(Differs) as error:
        judge(PK2CMD, 34, "", None)
    assert (error.value.exit_code, error.value.code, error.value.location) == (1, "chip-differs", None)
    assert error.value.hint is None
    judge(PK2CMD, 0, "", None)


def test_long_lines_of_a_programmer_are_cut() -> None:
    assert last_lines("x" * 120) == "x" * 120
    assert last_lines("x" * 121) == "x" * 120 + " …"
    assert last_lines(" \n\n") is None


def codes(given: tuple[object, ...]) -> list[str]:
    return [each.code for each in given]  # type: ignore[attr-defined]


def test_an_image_that_cannot_work_is_objected_to() -> None:
    """Bit 2 of the configuration word is WDTE; CLRWDT is 0x0064 and SLEEP 0x0063 (DS35007)."""
    off, on = 0x3FF1, 0x3FF5
    assert codes(objections(Image({0: 0x2800}, off))) == []
    assert codes(objections(Image({}, None))) == ["no-program", "no-configuration"]
    assert codes(objections(Image({0: 0x2800}, on))) == ["watchdog-on"]
    for word in (0x0064, 0x0063):
        assert codes(objections(Image({0: word, 1: 0x2800}, on))) == []


def test_a_chip_without_an_identity_and_code_protection_are_remarked() -> None:
    """Code protection is on where its bits, 4 to 13, are not all one (DS35007, register 6-1)."""
    f84, f84a = device("PIC16F84"), device("PIC16F84A")
    open_, closed = Image({0: 0x2800}, 0x3FF1), Image({0: 0x2800}, 0x0001)
    assert codes(remarks(open_, f84a)) == []
    assert codes(remarks(open_, f84)) == ["no-device-id"]
    assert codes(remarks(closed, f84)) == ["no-device-id", "code-protected"]
    for bit in range(14):
        assert is_protected(replace(open_, config=0x3FF1 & ~(1 << bit)), f84a) == (bit >= 4), bit
    assert not is_protected(replace(open_, config=None), f84a)


def test_what_a_programmer_cannot_do_is_refused_before_it_is_started() -> None:
    installed = {each.name: InstalledProgrammer(each, ("true",)) for each in PROGRAMMERS}
    request = ProgrammingRequest(Path("main.hex"), device("PIC16F84A"), None)
    for name in ("picpro", "picprog"):
        with pytest.raises(InputError, match=f"{name} needs the programmer's port"):
            programming_command(installed[name], request)
    assert programming_command(installed["pk2cmd"], request)[:2] == ("true", "-PPIC16F84A")
    with pytest.raises(InputError, match="with ipecmd is not supported"):
        read_eeprom(installed["ipecmd"], request, IMAGE)
    with pytest.raises(InputError, match="the chip is code protected"):
        read_eeprom(installed["pk2cmd"], request, replace(IMAGE, config=0x0001))
