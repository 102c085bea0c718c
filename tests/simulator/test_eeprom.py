"""The data EEPROM: DS35007 section 3."""

from __future__ import annotations

import pytest

from servogen.edges import HIGH, LOW
from servogen.pic.image import from_hex, to_hex
from servogen.simulator import Machine, SimulatorOptions
from tests.simulator.helpers import machine, steps

WRITE = """
        movlw   {address}
        movwf   EEADR
        movlw   {byte}
        movwf   EEDATA
        bsf     STATUS, RP0
        bsf     EECON1, WREN
        movlw   0x55
        movwf   EECON2
        movlw   0xAA
        movwf   EECON2
        bsf     EECON1, WR
        bcf     EECON1, WREN
        goto    $
"""
WR_AT = 10
"""The cycle in which WR is set."""


def write(address: int = 5, byte: int = 0x3C) -> str:
    return WRITE.format(address=address, byte=byte)


def eecon1(chip: Machine) -> int:
    return chip.state().registers["EECON1"]


def test_a_write_takes_its_time_and_then_sets_eeif_section_3_2() -> None:
    for time in (4_000, 8_000):
        chip = machine(write(), SimulatorOptions(eeprom_write_us=time))
        chip.run(WR_AT + time)
        assert (chip.state().eeprom[5], eecon1(chip) & 0x12) == (0xFF, 0x02)
        chip.run(3)
        assert (chip.state().eeprom[5], eecon1(chip)) == (0x3C, 0x10)


def test_address_and_data_are_kept_as_they_were_when_the_write_began() -> None:
    source = write().replace(" goto    $", " bcf STATUS, RP0\n clrf EEADR\n clrf EEDATA\n goto $")
    chip = machine(source)
    chip.run(10_000)
    assert chip.state().eeprom[:6] == bytes([0xFF] * 5 + [0x3C])


@pytest.mark.parametrize("line", [6, 7, 8, 9, 10])
def test_an_instruction_more_in_the_sequence_prevents_the_write_section_3_2(line: int) -> None:
    lines = write().strip("\n").split("\n")
    lines.insert(line, " nop")
    chip = machine("\n".join(lines))
    chip.run(10_000)
    written = line in (6, 7)  # before the first key nothing is wrong yet
    assert (chip.state().eeprom[5] == 0x3C) == written
    assert ("eeprom-sequence" in {w.code for w in chip.state().warnings}) == (not written)


def test_without_wren_wr_cannot_be_set_section_3() -> None:
    chip = machine(write().replace("bsf     EECON1, WREN", "nop"))
    chip.run(10_000)
    assert (chip.state().eeprom[5], eecon1(chip)) == (0xFF, 0)


def test_wr_and_rd_cannot_be_cleared_by_software_section_3() -> None:
    chip = machine(write().replace("goto    $", "clrf EECON1\n goto $"))
    chip.run(20)
    assert eecon1(chip) & 2


def test_a_read_is_there_in_the_next_cycle_and_rd_reads_as_zero_section_3_1() -> None:
    source = (
        " org 0x2100\n de 1, 2, 0x77\n org 0\n movlw 2\n movwf EEADR\n bsf STATUS, RP0\n bsf EECON1, RD\n"
    )
    chip = steps(machine(source + " movf EECON1, w\n bcf STATUS, RP0\n movf EEDATA, w\n"), 5)
    assert chip.state().w == 0
    assert steps(chip, 2).state().w == 0x77


def test_a_reset_during_a_write_sets_wrerr_section_3() -> None:
    chip = machine(write(), changes=[(1000, "MCLR", LOW), (1010, "MCLR", HIGH)])
    chip.run(1011)
    assert (eecon1(chip), chip.state().eeprom[5]) == (0x08, 0xFF)


def test_eeif_interrupts_and_wakes_section_6_8() -> None:
    source = write().replace(
        "goto    $", "bcf STATUS, RP0\n bsf INTCON, EEIE\n sleep\n incf 0x20, f\n goto $"
    )
    chip = machine(source)
    chip.run(WR_AT + 4_000)
    assert chip.state().sleeping
    chip.run(400)
    assert chip.state().wakes["interrupt"] == 1


def test_addresses_beyond_63_reach_nothing_section_3() -> None:
    chip = machine(write(address=0x45))
    chip.run(10_000)
    assert chip.state().eeprom == bytes([0xFF] * 64)
    assert "eeprom-address" in {w.code for w in chip.state().warnings}


def test_what_the_program_wrote_is_in_the_chips_contents_and_goes_into_a_file() -> None:
    chip = machine(write())
    chip.run(10_000)
    again = from_hex(to_hex(chip.contents()))
    assert (again.eeprom[5], again.eeprom[6]) == (0x3C, 0xFF)
    assert (again.program, again.config) == (chip.image.program, chip.image.config)


def test_the_image_fills_the_eeprom() -> None:
    chip = machine(" org 0x2100\n de 9, 8, 7\n org 0\n nop\n")
    assert chip.state().eeprom[:4] == bytes([9, 8, 7, 0xFF])
