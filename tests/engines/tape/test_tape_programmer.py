"""The chip that writes a tape: docs/examples/tape, its program and its script on the computer."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from servogen.pic.assembler import assemble
from servogen.simulator import EEPROM24
from servogen.simulator.eeprom24 import RunningEEPROM
from servogen.testing.chip import Board, Chip
from tests.engines.tape.tape_jobs import tape_of
from tests.simulator.helpers import CLOCK

FOLDER = Path(__file__).parents[3] / "docs/examples/tape"


@pytest.fixture(scope="module")
def blocks() -> list[bytes]:
    script = runpy.run_path(str(FOLDER / "program.py"))
    return list(script["blocks"](tape_of().content.data))


def powered(device: EEPROM24) -> Chip:
    made = assemble((FOLDER / "programmer.asm").read_text(), "programmer.asm")
    chip = Chip(Board("programmer.asm", made.image, CLOCK, made.listing, inputs={"RB0": 1}))
    chip.attach(device, scl="RA3", sda="RA4")
    chip.run_ms(1)
    return chip


def answer(chip: Chip, block: bytes, **line: float) -> bytes:
    begin = chip.us
    chip.send("RB0", block, 9600, **line)  # type: ignore[arg-type]
    chip.run_ms(60)
    return chip.uart("RB1", 9600, since_us=begin)


@pytest.mark.parametrize("off", [-2, 2])
def test_what_it_is_sent_is_in_the_eeprom(blocks: list[bytes], off: float) -> None:
    chip = powered(EEPROM24())
    for block in blocks[:4]:
        assert answer(chip, block, baud_error_percent=off) == b"K"
    device = chip.devices[0]
    assert isinstance(device, RunningEEPROM)
    assert device.memory[:128] == tape_of().content.data[:128] and not device.remarks


def test_a_wrong_sum_and_an_eeprom_that_is_not_there_are_told(blocks: list[bytes]) -> None:
    chip = powered(EEPROM24())
    assert answer(chip, blocks[0][:-1] + bytes([blocks[0][-1] ^ 1])) == b"E"
    assert chip.devices[0].memory == b"\xff" * 32768  # type: ignore[attr-defined]
    assert answer(powered(EEPROM24(address=1)), blocks[0]) == b"E"
