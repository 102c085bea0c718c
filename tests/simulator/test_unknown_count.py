"""T0IF where TMR0's value is unknown: from which cycle on it may be set, and when that is a use.

A program that enables the interrupt and waits depends on the chip in the cycle in which the first chip could
take it: at the next count of TMR0, whatever its value.
"""

from __future__ import annotations

import pytest

from servogen.simulator import Machine, SimulatorOptions
from tests.simulator.helpers import CLOCK, image

PULLED_UP = SimulatorOptions(ra4_pull_up=True)


def first_use(source: str, cycles: int = 3000) -> tuple[str, int] | None:
    """Return what was used, and the cycle."""
    chip = Machine(image(f"{source}\nstand goto stand\n"), CLOCK, PULLED_UP, tracked=True)
    chip.run(cycles)
    if not chip.chip_dependent:
        return None
    (use,) = chip.chip_dependent
    assert use.location is not None
    assert use.location.cycle is not None
    return use.message, use.location.cycle


def counting(option: int) -> str:
    """TMR0 counts cycles from cycle 3 on; bank 0 again in cycle 3."""
    return f" bsf STATUS, RP0\n movlw {option}\n movwf OPTION_REG\n bcf STATUS, RP0\n"


@pytest.mark.parametrize("option", [0x88, 0x80, 0x83, 0x87])
def test_an_interrupt_by_an_unknown_count_is_a_use_at_once(option: int) -> None:
    message, cycle = first_use(counting(option) + " nop\n movlw 0xA0\n movwf INTCON\n") or ("", 0)
    assert message == "TMR0 has no value at power-up, and an interrupt depends on it"
    assert cycle == 6


@pytest.mark.parametrize("option", [0x88, 0x80, 0x83, 0x87])
def test_a_known_count_interrupts_in_its_cycle_without_a_use(option: int) -> None:
    source = counting(option) + " clrf TMR0\n movlw 0xA0\n movwf INTCON\n nop\n goto $\n"
    chip = Machine(image(source), CLOCK, PULLED_UP, tracked=True)
    ratio = 1 if option & 8 else 2 << (option & 7)
    chip.run(4 + 3 + 256 * ratio - 4)
    assert (chip.state().interrupts, chip.chip_dependent) == (0, ())
    chip.run(8)
    assert (chip.state().interrupts, chip.chip_dependent) == (1, ())


def test_a_poll_of_the_flag_is_a_use_once_tmr0_may_have_overflowed() -> None:
    """INTCON is cleared in cycle 5; with a prescaler of 256 no chip counts before cycle 258."""
    poll = " bcf INTCON, T0IF\n btfss INTCON, T0IF\n goto $-1\n"
    message, cycle = first_use(counting(0x87) + " nop\n" + poll) or ("", 0)
    assert message == "TMR0 has no value at power-up, and a skip depends on it"
    turn = 6  # BTFSS in cycles 6, 9, 12 …
    assert (cycle - turn) % 3 == 0
    assert 3 + 256 - 1 - 3 <= cycle <= 3 + 256 + 3
    early, soon = first_use(counting(0x88) + " nop\n" + poll) or ("", 0)
    assert early == message
    assert soon <= 9


def test_a_written_count_is_known_until_it_is_written_unknown() -> None:
    known = counting(0x88) + " clrf TMR0\n bcf INTCON, T0IF\n btfsc INTCON, T0IF\n nop\n movf TMR0, w\n"
    assert first_use(known + " addwf PCL, f\n" + " nop\n" * 20) is None
    unknown = counting(0x88) + " movf 0x30, w\n movwf TMR0\n movf TMR0, w\n addwf PCL, f\n"
    message, cycle = first_use(unknown) or ("", 0)
    assert message.startswith("RAM 0x30 was not written since power-up, and a jump by PCL")
    assert cycle == 7


@pytest.mark.parametrize(("nops", "masked"), [(0, 0x00), (3, 0x00)])
def test_a_noisy_clock_makes_the_count_unknown(nops: int, masked: int) -> None:
    """T0CS is 1 after a reset: TMR0 counts edges of RA4, which floats here."""
    source = " clrf TMR0\n" + " nop\n" * nops + " movf TMR0, w\n movwf 0x20\n btfsc 0x20, 0\n nop\n"
    chip = Machine(image(f"{source}stand goto stand\n"), CLOCK, tracked=True)
    chip.run(60)
    (use,) = chip.chip_dependent
    assert use.message == "RA4 is an input that nothing drives, and a skip depends on it"
    held = Machine(image(f"{source}stand goto stand\n"), CLOCK, PULLED_UP, tracked=True)
    held.run(60)
    assert held.chip_dependent == ()
    assert held.state().registers["TMR0"] == masked
