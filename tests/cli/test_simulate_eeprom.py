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


C = """
#include <pic14/{header}.h>
void main(void)
{{
    EEADR = 9; EEDATA = 5; EECON1 = 4;
    EECON2 = 0x55; EECON2 = 0xAA; WR = 1;
    while (1);
}}
"""


@pytest.mark.parametrize(("header", "done"), [("pic16f84", False), ("pic16f84a", True)])
def test_the_header_of_a_c_file_selects_the_chip_that_runs_it(
    run: Callable[..., Ran], tmp_path: Path, header: str, done: bool
) -> None:
    """After 5 ms the write of a PIC16F84A is over (4 ms), that of a PIC16F84 is not (10 ms)."""
    program = tmp_path / "write.c"
    program.write_text(C.format(header=header))
    ran = run("simulate", program, "--cycles", 5_000, "--json")
    assert bool(json.loads(ran.out)["registers"]["EECON1"] & 0x10) is done


@pytest.mark.parametrize(
    ("names", "options", "done"),
    [
        ("", (), False),
        ("list p=16f84\n", (), False),
        ("list p=16f84a\n", (), True),
        ("processor PIC16F84A\n", (), True),
        ("include <p16f84a.inc>\n", (), True),
        ("list p=16f84a\n", ("--device", "PIC16F84"), False),
        ("list p=16f84\n", ("--device", "PIC16F84A"), True),
        ("list p=16c84\n", (), False),
    ],
)
def test_an_assembly_file_runs_on_the_chip_that_it_names_unless_another_is_asked_for(
    run: Callable[..., Ran], tmp_path: Path, names: str, options: tuple[str, ...], done: bool
) -> None:
    """A PIC16C84, which is not simulated, runs as a PIC16F84."""
    program = tmp_path / "write.asm"
    program.write_text(f"        {names}{SOURCE}")
    ran = run("simulate", program, "--cycles", 5_000, "--json", *options)
    assert bool(json.loads(ran.out)["registers"]["EECON1"] & 0x10) is done


def test_a_clock_too_fast_for_the_default_chip_selects_the_faster_one(
    run: Callable[..., Ran], tmp_path: Path
) -> None:
    """As `servogen compile` does; a PIC16F84 takes 10 MHz (DS30430)."""
    program = tmp_path / "fast.c"
    program.write_text("#pragma CLOCK_FREQ 20000000\nmain(void) { while (1); }\n")
    assert run("simulate", program, "--cycles", 100).code == 0
    assert run("simulate", program, "--cycles", 100, "--device", "PIC16F84").code == 2
