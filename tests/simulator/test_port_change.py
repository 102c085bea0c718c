"""RBIF: DS35007 section 4.2. Pins are compared with what the last read or write of PORTB latched."""

from servogen.simulator import Machine
from tests.simulator.helpers import machine, steps


def rbif(chip: Machine) -> int:
    return chip.state().registers["INTCON"] & 1


def test_a_write_of_port_b_latches_the_pins_as_a_read_does() -> None:
    """RB4 rises, the program writes PORTB and clears RBIF, RB4 falls: it differs from the write's level."""
    source = " movf PORTB, w\n nop\n nop\n movwf PORTB\n bcf INTCON, RBIF\n" + " nop\n" * 6
    chip = machine(source, changes=[(0, "RB4", 0), (2, "RB4", 1), (8, "RB4", 0)])
    assert rbif(steps(chip, 3)) == 1  # high since the read
    assert rbif(steps(chip, 3)) == 0  # cleared, and as it was at the write
    assert rbif(steps(chip, 4)) == 1


def test_without_a_write_a_pin_that_is_again_as_it_was_read_sets_nothing() -> None:
    source = " movf PORTB, w\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n bcf INTCON, RBIF\n" + " nop\n" * 3
    chip = machine(source, changes=[(0, "RB4", 0), (2, "RB4", 1), (5, "RB4", 0)])
    assert rbif(steps(chip, 8)) == 1
    assert rbif(steps(chip, 3)) == 0


def test_a_write_of_port_a_latches_nothing_of_port_b() -> None:
    source = " movf PORTB, w\n nop\n nop\n movwf PORTA\n bcf INTCON, RBIF\n" + " nop\n" * 6
    chip = machine(source, changes=[(0, "RB4", 0), (2, "RB4", 1)])
    assert rbif(steps(chip, 7)) == 1  # the mismatch with the read lasts, and sets it again
