"""Tests of public programs, in the HEX files that their authors made with XC8, with the names beside them.

    python -m tests.testing.xc8 --repositories FOLDER

reads the programs of PROGRAMS from clones, FOLDER/OWNER/NAME, and runs our tests of them as the action does.
Exit code 1 if a program has no names or a test fails.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from servogen.programs import read_program
from tests.repositories import unpack
from tests.test_ci_files import act, inputs


class XC8Program(NamedTuple):
    """A project of MPLAB X, whose HEX is below it, and tests of it, in which HEX is its name."""

    repository: str
    commit: str
    project: str
    tests: str

    @property
    def hex_file(self) -> str:
        return f"dist/default/production/{Path(self.project).name}.production.hex"


KADRTRN = ("Kadrtrn/PIC16F84A_XC8--proteus--", "9ba1c1fbb42a99ae246c887b35c8b334d93a4bd6")
SBSAMED = ("sbsamed/pic16f84aExample", "454434212f33d2e8ef93411bdf066f2415e22ee3")

PROGRAMS = (
    XC8Program(
        *KADRTRN,
        "12_TMRO_KESME_UYGULAMASI/TMR0_INTERRUPT_led_control.X",
        '''
def test_fifty_overflows_are_half_a_second(servogen_machine):
    """TMR0 goes on from 217 by 256 cycles each: 50 * 39 * 256 cycles, and the way to each writing of it."""
    chip = servogen_machine(HEX)
    chip.run_s(4)
    halves = [*chip.widths_us("RB0"), *chip.widths_us("RB0", level=0)]
    assert len(halves) >= 5 and all(499_200 < half < 503_000 for half in halves)

def test_the_counter_counts_interrupts(servogen_machine):
    chip = servogen_machine(HEX)
    for count in range(1, 4):
        chip.run_until("TMR0_KESMESI()", within_ms=11)
        chip.run_until(f"counter == {count}", within_ms=1)
    chip.run_until("counter == 49", within_ms=500)
    chip.run_until("RB0", within_ms=11)
    assert chip.variable("counter", signed=True) == 0
''',
    ),
    XC8Program(
        *KADRTRN,
        "4_PIC16F84A_BUTTON_8_LED/8_led.X",
        """
def test_each_half_second_of_the_button_lights_one_more(servogen_machine):
    chip = servogen_machine(HEX, inputs={"RA3": 1})
    for lit in range(1, 9):
        chip.run_until(f"main.count == {lit}", within_ms=510)
        chip.run_ms(1)
        assert chip.register("PORTB") == 2**lit - 1
    assert chip.line.text == "__delay_ms(500);"

def test_without_the_button_nothing_is_lit(servogen_machine):
    chip = servogen_machine(HEX, inputs={"RA3": 0})
    chip.run_s(2)
    assert (chip.variable("main.count"), chip.register("PORTB")) == (0, 0)
""",
    ),
    XC8Program(
        *SBSAMED,
        "007_SEVEN_SEGMENTS/007_SEVEN_SEGMENTS.X",
        '''
DIGITS = [0x3F, 0x06, 0x5B, 0x4F, 0x66, 0x6D, 0x7C, 0x07, 0x7F, 0x6F]

def test_ones_and_tens_are_shown_in_turn(servogen_machine):
    chip = servogen_machine(HEX)
    for number in range(1, 23):
        chip.run_until(f"main.j == {number % 10}", within_ms=210)
        chip.run_ms(50)
        assert chip.register("PORTB") == DIGITS[number % 10]
        chip.run_ms(100)
        assert chip.register("PORTB") == DIGITS[number // 10] == DIGITS[chip.variable("main.i")]
    assert chip.array("sevenSegNumbers") == DIGITS

def test_the_pins_that_choose_a_digit_are_never_outputs(servogen_machine):
    """TRISA is not written: both digits show both numbers, unless the board chooses."""
    chip = servogen_machine(HEX)
    chip.run_s(1)
    assert not chip.drives("RA0") and not chip.drives("RA1")
''',
    ),
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repositories", type=Path, required=True, help="clones, FOLDER/OWNER/NAME")
    clones = parser.parse_args().repositories.resolve()
    failed = 0
    for each in PROGRAMS:
        with TemporaryDirectory() as name:
            folder = Path(name)
            unpack(clones, each.repository, each.commit, each.project, folder)
            (folder / "test_firmware.py").write_text(f'HEX = "{each.hex_file}"\n{each.tests}')
            program = read_program(folder / each.hex_file)
            code, out, _ = act(folder, inputs(tests="test_firmware.py"))
        failed += code != 0 or not program.names
        print(f"{each.repository}: {each.project}: {program!r}\n{out}")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
