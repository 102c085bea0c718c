"""Interrupts, latency, SLEEP: DS35007 sections 6.8 and 6.11, timing by DS30430 figures 6-4 and 8-17."""

from __future__ import annotations

from itertools import pairwise

import pytest

from servogen.edges import HIGH, LOW
from tests.simulator.helpers import edges, machine, ram, steps

ENTRY = """
        goto    start
        org     4
        bsf     PORTB, 7        ; shows the cycle in which the instruction at 0004h executes
        bcf     INTCON, INTF
        bcf     INTCON, T0IF
        movf    PORTB, w
        bcf     INTCON, RBIF
        bcf     PORTB, 7
        incf    0x30, f
        retfie
start   clrf    PORTB
        clrf    0x30
        bsf     STATUS, RP0
        movlw   0x7F
        movwf   TRISB
        movlw   {option}
        movwf   OPTION_REG
        bcf     STATUS, RP0
        movlw   {intcon}
        movwf   INTCON
"""
RISING, FALLING = 0xC8, 0x88
INT_ON, RB_ON, T0_ON, EE_ON = 0x90, 0x88, 0xA0, 0xC0
SET_UP = 2 + 10
"""The first cycle after the set-up."""


def program(body: str, intcon: int = INT_ON, option: int = RISING) -> str:
    return ENTRY.format(intcon=intcon, option=option) + body


def entered(chip: object, cycles: int = 400) -> list[int]:
    """Cycles in which the instruction at 0004h executed."""
    return [cycle for cycle, _, level in edges(chip, cycles, "RB7") if level == HIGH]  # type: ignore[arg-type]


@pytest.mark.parametrize("at", range(SET_UP + 20, SET_UP + 26))
def test_int_is_served_three_cycles_after_its_edge_beside_one_cycle_instructions_figure_8_17(at: int) -> None:
    chip = machine(program(" nop\n" * 100), changes=[(0, "RB0", LOW), (at, "RB0", HIGH)])
    assert entered(chip, 90) == [at + 3]


@pytest.mark.parametrize("at", range(SET_UP + 20, SET_UP + 26))
def test_the_latency_is_the_same_beside_two_cycle_instructions_figure_8_17(at: int) -> None:
    chip = machine(program("loop goto loop\n"), changes=[(0, "RB0", LOW), (at, "RB0", HIGH)])
    assert entered(chip, 90) == [at + 3]


def test_intedg_chooses_the_edge_section_6_8_1() -> None:
    changes = [(0, "RB0", LOW), (50, "RB0", HIGH), (100, "RB0", LOW)]
    assert entered(machine(program("loop goto loop\n", option=RISING), changes=changes)) == [53]
    assert entered(machine(program("loop goto loop\n", option=FALLING), changes=changes)) == [103]


def test_the_return_address_is_the_instruction_that_was_not_executed_section_6_8() -> None:
    chip = machine(program(" nop\n" * 100), changes=[(0, "RB0", LOW), (40, "RB0", HIGH)])
    chip.run_until(pc=5)
    state = chip.state()
    first = 12 + 10  # the word after the set-up
    assert state.stack[0] == first + (40 - SET_UP) + 1
    assert state.registers["INTCON"] & 0x80 == 0


def test_tmr0s_interrupt_is_served_two_cycles_after_tmr0_is_first_read_as_zero_figure_6_4() -> None:
    chip = machine(program(" movlw 0xF0\n movwf TMR0\n" + " nop\n" * 100, T0_ON))
    zero = SET_UP + 1 + 3 + 16
    assert entered(chip, 60) == [zero - 1 + 3]


def test_a_change_of_rb4_to_rb7_interrupts_until_the_port_is_read_section_4_2() -> None:
    chip = machine(program("loop goto loop\n", RB_ON), changes=[(0, "RB5", LOW), (60, "RB5", HIGH)])
    assert entered(chip) == [63]


def test_rbif_comes_back_while_the_mismatch_lasts_section_4_2() -> None:
    source = " movf PORTB, w\nwait btfss INTCON, RBIF\n goto wait\n bcf INTCON, RBIF\n nop\n"
    chip = machine(source, changes=[(0, "RB4", LOW), (20, "RB4", HIGH)])
    chip.run_until(pc=5)
    assert chip.state().registers["INTCON"] & 1 == 1
    read = machine(
        source.replace(" bcf", " movf PORTB, w\n bcf"), changes=[(0, "RB4", LOW), (20, "RB4", HIGH)]
    )
    read.run_until(pc=6)
    assert read.state().registers["INTCON"] & 1 == 0


def test_outputs_are_left_out_of_the_comparison_section_4_2() -> None:
    source = " clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n movlw 0xF0\n movwf PORTB\n nop\n"
    assert steps(machine(source), 7).state().registers["INTCON"] & 1 == 0


def test_a_flag_is_set_also_when_its_interrupt_is_off_section_6_8() -> None:
    chip = machine(" nop\n" * 50, changes=[(0, "RB0", LOW), (10, "RB0", HIGH)])
    chip.run(20)
    assert chip.state().registers["INTCON"] & 2


def test_setting_gie_with_a_flag_pending_lets_one_more_instruction_execute_figure_8_17() -> None:
    body = " bsf INTCON, INTF\n bsf INTCON, GIE\n incf 0x31, f\n incf 0x31, f\n" + " nop\n" * 20
    chip = machine(program(" clrf 0x31\n" + body, 0x10))
    gie = SET_UP + 2
    assert entered(chip, 30) == [gie + 1 + 3]
    stopped = machine(program(" clrf 0x31\n" + body, 0x10))
    stopped.run_until(pc=4)
    assert ram(stopped, 0x31) == 1


def test_clearing_gie_as_the_interrupt_is_sampled_does_not_prevent_it_section_6_8() -> None:
    """The old trap: RETFIE then sets GIE again, behind the back of the program that cleared it."""
    at = SET_UP + 10
    body = " nop\n" * 10 + " bcf INTCON, GIE\n" + " nop\n" * 30
    chip = machine(program(body), changes=[(0, "RB0", LOW), (at, "RB0", HIGH)])
    assert entered(chip, 60) == [at + 3]
    assert chip.state().registers["INTCON"] & 0x80
    later = machine(program(body), changes=[(0, "RB0", LOW), (at + 1, "RB0", HIGH)])
    assert entered(later, 60) == []


def test_a_pending_flag_is_served_again_right_after_retfie() -> None:
    """GIE is set in RETFIE's first cycle, so its second is sampled: DS33023 section 29, RETFIE."""
    source = " goto start\n org 4\n bsf PORTB, 7\n bcf PORTB, 7\n retfie\n"
    source += (
        "start bsf STATUS, RP0\n bcf TRISB, 7\n bcf STATUS, RP0\n movlw 0x92\n movwf INTCON\n" + " nop\n" * 30
    )
    times = entered(machine(source), 40)
    assert {later - earlier for earlier, later in pairwise(times)} == {6}


def test_a_wake_up_with_gie_executes_one_instruction_and_then_the_routine_section_6_11_2() -> None:
    source = program(" clrf 0x31\n sleep\n incf 0x31, f\n incf 0x31, f\n nop\n")
    chip = machine(source, changes=[(0, "RB0", LOW), (100, "RB0", HIGH)])
    assert entered(chip) == [100 + 256 + 3]
    stopped = machine(source, changes=[(0, "RB0", LOW), (100, "RB0", HIGH)])
    stopped.run_until(pc=4)
    assert ram(stopped, 0x31) == 1
    assert stopped.state().status & 0x18 == 0x10


def test_a_wake_up_without_gie_goes_on_in_line_section_6_11_2() -> None:
    source = program(" clrf 0x31\n sleep\n incf 0x31, f\n goto $\n", INT_ON & 0x7F)
    chip = machine(source, changes=[(0, "RB0", LOW), (100, "RB0", HIGH)])
    assert entered(chip, 600) == []
    assert ram(chip, 0x31) == 1
    assert chip.state().wakes["interrupt"] == 1


def test_sleep_is_a_nop_when_an_enabled_flag_is_set_section_6_11_3() -> None:
    chip = steps(machine(" bsf INTCON, INTE\n bsf INTCON, INTF\n sleep\n nop\n"), 4)
    assert not chip.state().sleeping
    assert chip.state().status & 0x18 == 0x18


def test_port_changes_wake_the_chip_section_6_11_2() -> None:
    source = " movf PORTB, w\n movlw 0x08\n movwf INTCON\n sleep\n incf 0x20, f\n goto $\n"
    chip = machine(source, changes=[(0, "RB6", LOW), (500, "RB6", HIGH)])
    chip.run(1000)
    assert chip.state().wakes["interrupt"] == 1


def test_a_long_delay_is_interrupted_in_the_right_cycle() -> None:
    """The delay loop is taken in one step, but not past the interrupt."""
    body = (
        " movlw 200\n movwf 0x20\n movwf 0x21\nl decfsz 0x20, f\n goto l\n decfsz 0x21, f\n goto l\n goto $\n"
    )
    changes = [(0, "RB0", LOW), *((1000 + 777 * n, "RB0", 1 - n % 2) for n in range(40))]
    served = entered(machine(program(body), changes=changes), 40_000)
    assert served == [1000 + 777 * n + 3 for n in range(0, 40, 2)]


EEPROM_WRITE = """
        bsf     STATUS, RP0
        bsf     EECON1, WREN
        movlw   0x55
        movwf   EECON2
        movlw   0xAA
        movwf   EECON2
        bsf     EECON1, WR
        bcf     STATUS, RP0
loop    goto    loop
"""


@pytest.mark.parametrize(("intcon", "served"), [(EE_ON, True), (0x80, False), (0x40, False)])
def test_the_end_of_an_eeprom_write_interrupts_with_eeie_and_gie_section_6_8(
    intcon: int, served: bool
) -> None:
    """EEIF is set either way: it is the enables that decide."""
    chip = machine(program(EEPROM_WRITE, intcon))
    assert bool(entered(chip, 15_000)) == served
    assert chip.state().registers["EECON1"] & 0x10


def test_eeie_without_a_finished_write_interrupts_nothing_section_6_8() -> None:
    assert entered(machine(program("loop goto loop\n", EE_ON)), 15_000) == []


@pytest.mark.parametrize("enable", [0x08, 0x10, 0x20])
def test_a_flag_is_served_by_its_own_enable_only_register_2_3(enable: int) -> None:
    """T0IF is bit 2, INTF 1, RBIF 0; T0IE is bit 5, INTE 4, RBIE 3."""
    for flag in (0x01, 0x02, 0x04):
        set_flag = f" movlw {0x80 | enable | flag}\n movwf INTCON\nloop goto loop\n"
        assert bool(entered(machine(program(set_flag, 0)), 30)) == (enable >> 3 == flag)
