"""The watchdog of the chip with the shortest period, 7 ms (DS35007 parameter 31): in which cycle it is due.

At 4 MHz a cycle takes 1 µs. After a reset OPTION_REG is FFh: the postscaler divides by 128.
"""

from __future__ import annotations

import pytest

from servogen.simulator import Machine, SimulatorOptions
from tests.checker.certify import delay
from tests.simulator.helpers import CLOCK, image

ON = " __config _XT_OSC & _WDT_ON & _PWRTE_OFF\n"


def due(source: str, cycles: int = 1_000_000, **options: int) -> tuple[int, int] | None:
    """Return the cycle and the address of the warning, None if there is none."""
    program = image(f"{source}\nstand goto stand\n", ON)
    chip = Machine(program, CLOCK, SimulatorOptions(**options), tracked=True)  # type: ignore[arg-type]
    chip.run(cycles)
    found = [each for each in chip.chip_dependent if each.code == "watchdog-margin"]
    if not found:
        return None
    (warning,) = found
    assert warning.location is not None
    assert warning.location.cycle is not None and warning.location.address is not None
    return warning.location.cycle, warning.location.address


def option(value: int) -> str:
    """Three instructions, of which the third writes OPTION_REG; bank 1 stays."""
    return f" bsf STATUS, RP0\n movlw {value}\n movwf OPTION_REG\n"


def test_it_is_due_from_the_beginning() -> None:
    assert due("") == (7000 * 128, 0)
    assert due("", cycles=7000 * 128 - 2) is None
    assert due("", watchdog_us=33_000) == (7000 * 128, 0)  # whatever period this chip has
    assert due("", watchdog_us=5000, cycles=5000 * 128 + 1) == (5000 * 128, 0)  # unless it has a shorter one


@pytest.mark.parametrize("ps", range(8))
@pytest.mark.parametrize("psa", [0, 8])
def test_the_postscaler_multiplies_it_where_it_is_the_watchdogs(ps: int, psa: int) -> None:
    cycle, address = due(option(0x80 | psa | ps)) or (0, 0)
    expected = 7000 << ps if psa else 7000
    assert address == 3
    assert expected <= cycle <= expected + 1  # the instruction that begins then or next


@pytest.mark.parametrize("wait", [0, 1, 2, 500])
def test_clrwdt_and_sleep_begin_it_anew(wait: int) -> None:
    """Each takes effect at its end."""
    cycle, _ = due(option(0x88) + delay(wait) + " clrwdt\n") or (0, 0)
    assert 0 <= cycle - (3 + wait + 1 + 7000) <= 1
    cycle, _ = due(option(0x88) + delay(wait) + " sleep\n nop\n") or (0, 0)
    assert cycle == 3 + wait + 1 + 7000


@pytest.mark.parametrize(("clears", "certain"), [(6999, True), (7000, True), (7001, False), (7002, False)])
def test_it_must_be_cleared_before_it_is_due(clears: int, certain: bool) -> None:
    """CLRWDT in cycle 3 counts from cycle 4 on; the next one, so many cycles later, from its own end on."""
    source = option(0x88) + " clrwdt\n" + delay(clears - 1) + " clrwdt\n"
    first = due(source, 3 + clears + 2)
    assert (first is None) is certain
    if not certain:
        assert first is not None
        assert first[0] == 4 + 7000


@pytest.mark.parametrize(
    ("later", "to", "expected"),
    [
        (6990, 0x8A, 4 + (7000 << 2)),  # no chip's postscaler has counted yet
        (6999, 0x8A, 4 + (7000 << 2)),
        (7000, 0x8A, 4 + 7000),  # now it is unknown what it has counted
        (7500, 0x8A, 4 + 7500),
        (20_000, 0x8E, 4 + 20_000),
    ],
)
def test_another_ratio_counts_from_the_beginning_or_is_in_doubt(later: int, to: int, expected: int) -> None:
    """CLRWDT in cycle 3 counts from 4 on; OPTION_REG has 1:16 first, and is changed so many cycles later."""
    source = option(0x8C) + " clrwdt\n" + delay(later - 2) + f" movlw {to}\n movwf OPTION_REG\n"
    cycle, _ = due(source) or (0, 0)
    assert 0 <= cycle - expected <= 1


def test_bits_of_option_reg_that_are_not_the_watchdogs_leave_it_alone() -> None:
    """RBPU, INTEDG, T0CS and T0SE; and the ratio of a prescaler that is TMR0's."""
    source = option(0x8C) + " clrwdt\n" + delay(10_000) + " movlw 0x7C\n movwf OPTION_REG\n"
    cycle, _ = due(source) or (0, 0)
    assert 0 <= cycle - (4 + 7000 * 16) <= 1
    source = option(0x81) + " clrwdt\n" + delay(100) + " movlw 0x86\n movwf OPTION_REG\n"
    cycle, _ = due(source) or (0, 0)
    assert 0 <= cycle - (4 + 7000) <= 1


def test_a_prescaler_that_is_handed_over_after_the_shortest_period_is_in_doubt() -> None:
    for first, then in ((0x8C, 0x80), (0x8C, 0x84)):
        source = option(first) + " clrwdt\n" + delay(7500 - 2) + f" movlw {then}\n movwf OPTION_REG\n"
        cycle, _ = due(source) or (0, 0)
        assert 0 <= cycle - (4 + 7500) <= 1


def test_it_is_noted_once() -> None:
    chip = Machine(image("stand goto stand\n", ON), CLOCK, tracked=True)
    chip.run(3 * 7000 * 128)
    assert [each.code for each in chip.state().warnings].count("watchdog-margin") == 1
    assert chip.state().resets["watchdog"] == 1  # this chip's period is 18 ms, times 128


def test_without_its_bit_in_the_configuration_word_it_is_never_due() -> None:
    off = image("stand goto stand\n", " __config _XT_OSC & _WDT_OFF & _PWRTE_OFF\n")
    chip = Machine(off, CLOCK, tracked=True)
    chip.run(1_000_000)
    assert chip.chip_dependent == ()
