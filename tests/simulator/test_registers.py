"""The table of registers (`layout.ROWS`) is complete, and the instruction loop agrees with it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from servogen.pic.device import RAM_FIRST, REGISTERS, Register, registers
from servogen.simulator import LevelChange, Machine, Recorded, SimulatorOptions, Stimuli, layout
from servogen.simulator.layout import MCLR_PIN, NOT_STORED, ROWS, UNCERTAIN
from servogen.simulator.slots import SlotFacts
from tests.simulator.helpers import CLOCK, image

BANK_1, RP0 = 0x80, 0x20


def without_row(chip: Iterable[Register]) -> list[str]:
    """Return the names of a chip's registers for which the simulator has no row."""
    known = {register.name for row in ROWS for register in row.registers} | set(NOT_STORED)
    return [register.name for register in chip if register.name not in known]


def test_every_register_of_the_chip_has_its_row() -> None:
    assert without_row(REGISTERS) == []


def test_a_register_without_a_row_is_named() -> None:
    assert without_row([*REGISTERS, Register("TMR1", 0x07)]) == ["TMR1"]


def test_a_row_holds_a_register_of_the_chip() -> None:
    assert [row.name for row in ROWS if row.register and row.register not in registers()] == []


def test_each_slot_has_the_name_of_its_row_and_is_used_once() -> None:
    named = {row.name: row.number for row in ROWS} | {row.unknown_name: mask for row, mask in UNCERTAIN}
    assert {name: getattr(layout, name) for name in named} == named
    assert sorted(named.values()) == list(range(layout.RAM_SLOTS, layout.STACK))


def test_what_is_undefined_at_power_up_can_be_given_and_named() -> None:
    """A start value for the bits that table 6-4 marks "x", which docs/proof.md names, and a source that is
    not that of a byte of RAM.
    """
    rows = [row for row, _ in UNCERTAIN if row.undefined]
    assert len({row.start for row in rows} - {""}) == len(rows)
    page = (Path(__file__).parents[2] / "docs" / "proof.md").read_text("utf-8")
    assert [row.start for row in rows if f"`{row.start}`" not in page] == []
    sources = [row.source for row in rows if row.source]
    assert len(set(sources)) == len(sources)
    assert max(sources) < RAM_FIRST


READ = [row for row in ROWS if row.register and row.register != "PCL"]


@pytest.mark.parametrize("row", READ, ids=lambda row: row.name)
def test_an_instruction_reads_the_slot_of_the_row_with_its_unknown_bits(row: SlotFacts) -> None:
    address = registers()[row.register].address
    program = image(f" movf 0x{address & 0x7F:02X}, w\nstand goto stand\n")
    chip = Machine(program, CLOCK, SimulatorOptions(ra4_pull_up=True), tracked=True)  # TMR0 is not in doubt
    state, doubtful = chip.numbers, row.undefined & -row.undefined
    state[row.number] = row.bits & 0x45  # INTCON: GIE is clear; STATUS: bank 0
    if address & BANK_1:
        state[layout.STATUS] |= RP0
    if row.unknown is not None:
        state[row.unknown] = doubtful
    expected = int(state[row.number])
    chip.run(1)
    assert int(state[layout.W]) == expected
    assert int(state[layout.W_UNKNOWN]) & row.undefined == doubtful


KEPT = {"STATUS": 0x1F, "PCLATH": 0, "INTCON": 0x01, "EECON1": 0x08, "OPTION_REG": 0}
"""The bits that a reset by MCLR keeps: DS35007 table 6-4, "u"; those of the other registers are all kept."""


@pytest.mark.parametrize("row", READ, ids=lambda row: row.name)
def test_a_reset_by_mclr_keeps_the_bits_that_table_6_4_says(row: SlotFacts) -> None:
    reset = Stimuli([Recorded([LevelChange(3, MCLR_PIN, 0)])])
    kept = KEPT.get(row.register, 0xFF)
    for value in (row.bits & 0x55, row.bits & 0x2A):
        chip = Machine(image(" nop\n" * 9), CLOCK, stimulus=reset)
        chip.run(2)
        chip.numbers[row.number] = value
        chip.run(6)
        assert chip.state().registers["PCL"] == 0
        assert int(chip.numbers[row.number]) == value & kept | (0xFF if row.register == "OPTION_REG" else 0)
