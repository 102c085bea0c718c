"""How long `simulate` takes for an EEPROM write: typical of the device (DS30430, DS35007: parameter D122)."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import Ran

SOURCE = """
        list r=dec
        __config 0x3FF1
        clrf    9
        clrf    8
        bsf     3, 5
        bsf     8, 2
        movlw   0x55
        movwf   9
        movlw   0xAA
        movwf   9
        bsf     8, 1
stand   goto    stand
        end
"""


@pytest.mark.parametrize(
    ("device", "options", "written_us"),
    [
        ("PIC16F84", (), 10_000),
        ("PIC16F84A", (), 4_000),
        ("PIC16F84", ("--eeprom-write-us", 20_000), 20_000),
    ],
)
def test_an_eeprom_write_takes_the_devices_time(
    run: Callable[..., Ran], tmp_path: Path, device: str, options: tuple[object, ...], written_us: int
) -> None:
    """The write begins after the ninth instruction's cycle; EEIF (bit 4 of EECON1) says that it is done."""
    program = tmp_path / "write.asm"
    program.write_text(SOURCE)

    def done(cycles: int) -> bool:
        ran = run("simulate", program, "--device", device, "--cycles", cycles, *options, "--json")
        return bool(json.loads(ran.out)["registers"]["EECON1"] & 0x10)

    assert not done(written_us)
    assert done(written_us + 20)
