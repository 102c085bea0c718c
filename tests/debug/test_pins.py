"""Why a pin has its level, in sentences."""

from __future__ import annotations

import pytest

from servogen.debug.pins import explain_pin
from servogen.debug.time_machine import TimeMachine
from servogen.edges import PINS
from tests.simulator.helpers import CLOCK, image

BANK_1 = " bsf STATUS, RP0\n"
NEVER = "This program never writes TRISB: TRISB = 0 would make the whole port outputs."


@pytest.mark.parametrize(
    ("program", "writes"),
    [
        (" nop\n", False),
        (BANK_1 + " clrf TRISA\n movwf OPTION_REG\n", False),
        (BANK_1 + " movf TRISB, w\n btfsc TRISB, 0\n", False),
        (" movwf PORTB\n", False),  # in bank 0
        (" movlw 0xFF\n tris PORTB\n", True),
        (BANK_1 + " movlw 0xFF\n movwf TRISB\n", True),
        (BANK_1 + " bsf TRISB, 0\n", True),
        (" movlw 0x86\n movwf FSR\n movlw 0xFF\n movwf INDF\n", True),  # FSR selects the bank
        (" movlw 0x86\n movwf FSR\n comf INDF, w\n", False),
    ],
)
def test_an_input_that_the_program_never_makes_an_output_is_said(program: str, writes: bool) -> None:
    """The TRIS registers are in bank 1, which RP0 selects; TRISB is there where PORTB is in bank 0."""
    machine = TimeMachine(image(f"{program}end_ goto end_\n"), CLOCK)
    machine.seek(20)
    sentences = explain_pin(machine, PINS.index("RB0"))
    assert sentences[0].startswith("RB0 is an input: bit 0 of TRISB is 1")
    assert (NEVER in sentences) != writes
