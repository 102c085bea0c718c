"""Six programs as a lab would write them, against another assembler: gpasm made the .hex files."""

from __future__ import annotations

from pathlib import Path

import pytest

from servogen.pic.assembler import Assembly, assemble
from servogen.pic.disassembler import disassemble
from servogen.pic.image import from_hex

PROGRAMS = sorted((Path(__file__).parent / "programs").glob("*.asm"))


def assembly_of(path: Path) -> Assembly:
    return assemble(path.read_text(), path.name)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_a_lab_program_has_the_words_of_the_other_assembler(path: Path) -> None:
    expected = from_hex(path.with_suffix(".hex").read_text())
    assert assembly_of(path).image == expected


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_a_lab_program_disassembles_and_assembles_to_itself(path: Path) -> None:
    assembly = assembly_of(path)
    again = assemble(disassemble(assembly.image, assembly.device))
    assert again.image == assembly.image
    assert again.device == assembly.device


def test_there_are_six() -> None:
    assert len(PROGRAMS) == 6


def test_the_blinking_light_word_by_word() -> None:
    image = assembly_of(next(path for path in PROGRAMS if path.stem == "blink")).image
    typed = {
        0x00: 0x2805,  # goto start
        0x05: 0x1683,  # bsf STATUS, RP0
        0x06: 0x1006,  # bcf TRISB, 0
        0x07: 0x1283,  # bcf STATUS, RP0
        0x08: 0x3001,  # movlw 1
        0x09: 0x0686,  # xorwf PORTB, f
        0x0A: 0x200C,  # call wait
        0x0B: 0x2808,  # goto loop
        0x0C: 0x3005,  # movlw 5
        0x0D: 0x008E,  # movwf outer
        0x0E: 0x3083,  # movlw 131
        0x0F: 0x008D,  # movwf middle
        0x10: 0x30FA,  # movlw 250
        0x11: 0x008C,  # movwf inner
        0x12: 0x0B8C,  # decfsz inner, f
        0x13: 0x2812,  # goto wait3
        0x14: 0x0B8D,  # decfsz middle, f
        0x15: 0x2810,  # goto wait2
        0x16: 0x0B8E,  # decfsz outer, f
        0x17: 0x280E,  # goto wait1
        0x18: 0x0008,  # return
    }
    assert dict(image.program) == typed
    assert image.config == 0x3FF1


def test_the_eeprom_program_fills_eeprom_and_ids() -> None:
    image = assembly_of(next(path for path in PROGRAMS if path.stem == "eeprom")).image
    assert bytes(image.eeprom[place] for place in range(7)) == b"\x00servo\xff"
    assert dict(image.ids) == {0: 2, 1: 0, 2: 2, 3: 6}
