"""The traps of the silicon, each with its section: what a simulator that is only nearly right gets wrong."""

from __future__ import annotations

import pytest

from servogen.edges import HIGH, LOW, UNDRIVEN
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import SimulatorOptions
from tests.simulator.helpers import edges, image, machine, ram, steps

OUTPUTS = " bsf STATUS, RP0\n clrf TRISA\n clrf TRISB\n bcf STATUS, RP0\n"


def kinds(chip: object) -> set[str]:
    return {warning.code for warning in chip.state().warnings}  # type: ignore[attr-defined]


# Ports: DS35007 section 4 --------------------------------------------------------------------------


def test_latch_and_pin_are_two_things_section_4_1() -> None:
    """A write goes to the latch also while the pin is an input, and shows when TRIS is cleared."""
    chip = machine(" movlw 0x0F\n movwf PORTB\n movf PORTB, w\n bsf STATUS, RP0\n clrf TRISB\n")
    assert edges(chip, 4) == []
    assert chip.state().w == 0
    assert [edge for edge in edges(chip, 1) if edge[2] == HIGH] == [(4, f"RB{bit}", HIGH) for bit in range(4)]


def test_read_modify_write_reads_the_pins_section_4() -> None:
    """BSF on one pin of a port copies an input pin's level into that pin's latch."""
    source = " clrf PORTB\n bsf PORTB, 0\n bsf STATUS, RP0\n clrf TRISB\n"
    chip = machine(source, changes=[(0, "RB7", HIGH)])
    edges(chip, 2)
    assert chip.state().registers["LATB"] == 0x81


def test_bit_operations_on_ra0_to_ra3_leave_ra4s_latch_as_its_pin_reads_section_4_1() -> None:
    source = OUTPUTS + " movlw 0x10\n movwf PORTA\n bsf PORTA, 0\n"
    assert steps(machine(source), 7).state().registers["LATA"] == 0x01
    pulled = steps(machine(source, SimulatorOptions(ra4_pull_up=True)), 7)
    assert pulled.state().registers["LATA"] == 0x11


def test_ra4_is_an_open_drain_section_4_1() -> None:
    """With latch 1 nothing drives it; with a pull-up fitted it is high."""
    source = OUTPUTS + " bsf PORTA, 4\n bcf PORTA, 4\n"
    assert edges(machine(source), 10, "RA4") == [(1, "RA4", LOW), (4, "RA4", UNDRIVEN), (5, "RA4", LOW)]
    set_whole = OUTPUTS + " movlw 0x10\n movwf PORTA\n clrf PORTA\n"
    assert edges(machine(set_whole), 10, "RA4") == [(1, "RA4", LOW), (5, "RA4", UNDRIVEN), (6, "RA4", LOW)]
    pulled = machine(set_whole, SimulatorOptions(ra4_pull_up=True))
    assert edges(pulled, 10, "RA4") == [(1, "RA4", LOW), (5, "RA4", HIGH), (6, "RA4", LOW)]


def test_port_b_has_weak_pull_ups_when_rbpu_is_clear_section_4_2() -> None:
    source = " movf PORTB, w\n bsf STATUS, RP0\n bcf OPTION_REG, 7\n bcf STATUS, RP0\n movf PORTB, w\n"
    chip = steps(machine(source), 1)
    assert chip.state().w == 0
    assert steps(chip, 4).state().w == 0xFF


def test_rewriting_tris_with_what_it_holds_makes_no_edge_section_4() -> None:
    chip = machine(OUTPUTS + " bsf STATUS, RP0\n clrf TRISB\n clrf TRISA\n bsf TRISB, 8-8\n bcf TRISB, 0\n")
    edges(chip, 7)
    assert edges(chip, 2) == [(7, "RB0", UNDRIVEN), (8, "RB0", LOW)]


def test_a_pin_driven_before_its_port_was_written_is_reported_section_4() -> None:
    assert "driven-before-written" in kinds(steps(machine(OUTPUTS + " nop\n" * 12), 16))
    assert kinds(steps(machine(" clrf PORTA\n clrf PORTB\n" + OUTPUTS), 6)) == set()


def test_driving_an_output_from_outside_is_reported_section_4() -> None:
    chip = steps(machine(" clrf PORTB\n" + OUTPUTS, changes=[(3, "RB3", HIGH)]), 5)
    assert "contention" in kinds(chip)
    assert chip.state().registers["PORTB"] == 0


def test_a_port_write_shows_on_the_pin_for_the_next_instruction_section_4() -> None:
    chip = steps(machine(OUTPUTS + " movlw 0xA5\n movwf PORTB\n movf PORTB, f\n comf PORTB, w\n"), 8)
    assert chip.state().w == 0x5A


# Memory: DS35007 section 2 -------------------------------------------------------------------------


def test_ram_is_mirrored_in_bank_1_section_2_2() -> None:
    source = " movlw 0x77\n movwf 0x4F\n bsf STATUS, RP0\n movf 0x4F, w\n incf 0x4F, f\n bcf STATUS, RP0\n"
    chip = steps(machine(source), 6)
    assert (chip.state().w, ram(chip, 0x4F)) == (0x77, 0x78)


@pytest.mark.parametrize("address", [0x07, 0x50, 0x7F, 0x87, 0x89, 0xD0, 0xFF])
def test_unimplemented_addresses_read_as_zero_section_2_2(address: int) -> None:
    source = f" movlw {address}\n movwf FSR\n movlw 0xFF\n movwf INDF\n movf INDF, w\n"
    state = steps(machine(source), 5).state()
    assert (state.w, state.status & 4, state.ram_written) == (0, 4, ())


def test_the_high_bits_of_short_registers_read_as_zero_table_2_1() -> None:
    source = " movlw 0xFF\n movwf PCLATH\n bsf STATUS, RP0\n movwf TRISA\n movf PCLATH, w\n"
    chip = steps(machine(source), 5)
    assert chip.state().w == 0x1F
    assert chip.state().registers["TRISA"] == 0x1F


def test_indf_through_fsr_bit_7_reaches_bank_1_section_2_5() -> None:
    chip = steps(machine(" movlw 0x86\n movwf FSR\n clrf INDF\n movf INDF, w\n"), 3)
    assert chip.state().registers["TRISB"] == 0


def test_indf_pointing_at_itself_reads_zero_and_writes_nothing_section_2_5() -> None:
    for fsr in (0x00, 0x80):
        chip = steps(machine(f" movlw {fsr}\n movwf FSR\n movlw 9\n movwf INDF\n movf INDF, w\n"), 5)
        assert (chip.state().w, chip.state().registers["FSR"], chip.state().ram_written) == (0, fsr, ())


def test_indf_does_not_look_at_rp0_section_2_5() -> None:
    chip = steps(machine(" movlw 6\n movwf FSR\n bsf STATUS, RP0\n clrf INDF\n movf INDF, w\n"), 4)
    assert chip.state().registers["TRISB"] == 0xFF


def test_to_and_pd_cannot_be_written_section_2_3_1() -> None:
    state = steps(machine(" clrf STATUS\n"), 1).state()
    assert state.status == 0x1C  # 000u u1uu
    state = steps(machine(" movlw 0xE7\n movwf STATUS\n"), 2).state()
    assert state.status == 0xFF


def test_an_instruction_that_sets_flags_cannot_also_write_them_section_2_3_1() -> None:
    state = steps(machine(" movlw 0x07\n movwf STATUS\n xorwf STATUS, f\n"), 3).state()
    assert (
        state.status == 0x1B
    )  # 0x1F ^ 0x07 would clear C and DC; only Z is the instruction's, and it is clear
    state = steps(machine(" movlw 0xFF\n movwf STATUS\n incf STATUS, f\n"), 3).state()
    assert state.status & 7 == 0x07  # 0xFF + 1 = 0: Z set, C and DC as they were, RP0 cleared
    assert state.status & 0xE0 == 0


def test_status_as_a_destination_of_an_instruction_without_flags_takes_all_but_to_and_pd_section_2_3_1() -> (
    None
):
    state = steps(machine(" movlw 0x03\n movwf STATUS\n swapf STATUS, f\n"), 3).state()
    assert state.status == 0xB9  # 0x1B swapped is 0xB1, with TO and PD kept


# Program counter and stack: DS35007 sections 2.4 and 2.4.1 -----------------------------------------------


def test_a_write_of_pcl_takes_pclath_and_two_cycles_section_2_4() -> None:
    state = steps(machine(" movlw 3\n movwf PCLATH\n movlw 0x45\n movwf PCL\n"), 4).state()
    assert (state.pc, state.cycles) == (0x345, 5)


def test_a_computed_goto_adds_to_the_next_address_in_eight_bits_section_2_4() -> None:
    program = {0x7FF & 0x3FE: encode("ADDWF", f=2, d=1), 0: encode("MOVLW", k=3), 1: encode("GOTO", k=0x3FE)}
    state = steps(machine(Image(program, 0x3FF1)), 3).state()
    assert (state.pc, state.cycles) == (0x02, 5)  # 0xFF + 3 = 0x102: the carry is lost, PCLATH is 0


def test_bit_operations_on_pcl_jump_too_section_2_4() -> None:
    state = steps(machine(" bsf PCL, 4\n"), 1).state()
    assert (state.pc, state.cycles) == (0x11, 2)


def test_reading_pcl_gives_the_next_address_section_2_4() -> None:
    assert steps(machine(" nop\n movf PCL, w\n"), 2).state().w == 2


def test_call_and_goto_take_pclath_bits_3_and_4_section_2_4() -> None:
    state = steps(machine(" movlw 0x1F\n movwf PCLATH\n goto 0x123\n"), 3).state()
    assert state.pc == 0x1923
    assert steps(machine(" movlw 0x07\n movwf PCLATH\n call 0x123\n"), 3).state().pc == 0x123


def test_the_program_repeats_every_1024_words_section_2_1() -> None:
    chip = steps(machine(" movlw 0x08\n movwf PCLATH\n goto 4\n nop\n movlw 0x66\n"), 4)
    assert (chip.state().pc, chip.state().w) == (0x805, 0x66)


def test_the_program_counter_runs_on_from_1023_into_the_next_image_section_2_1() -> None:
    chip = steps(machine(Image({0: encode("GOTO", k=0x3FF), 0x3FF: encode("NOP")}, 0x3FF1)), 3)
    assert (chip.state().pc, chip.state().cycles) == (0x3FF, 5)
    assert chip.state().warnings == ()


def test_an_unprogrammed_word_is_addlw_0xff_and_is_reported_section_2_1() -> None:
    chip = steps(machine(Image({0: encode("MOVLW", k=5)}, 0x3FF1)), 2)
    assert (chip.state().w, chip.state().status & 7) == (4, 3)
    assert kinds(chip) == {"erased-word"}


def test_an_undefined_word_does_nothing_and_is_reported_table_7_2() -> None:
    chip = steps(machine(Image({0: 0x0001, 1: 0x0067}, 0x3FF1)), 2)
    assert chip.state().undefined_words == (0, 1)
    assert kinds(chip) == {"undefined-word"}
    assert (chip.state().pc, chip.state().cycles) == (2, 2)


def test_the_stack_has_eight_levels_and_wraps_section_2_4_1() -> None:
    nine = "".join(f" call n{i}\nn{i}\n" for i in range(9))
    chip = steps(machine(nine), 9)
    state = chip.state()
    assert (state.stack_wraps, state.stack_depth, state.deepest_stack) == (1, 8, 8)
    assert state.stack == (9, 8, 7, 6, 5, 4, 3, 2)
    assert "stack-overflow" in kinds(chip)


def test_a_return_without_a_call_takes_what_the_ring_holds_and_is_reported_section_2_4_1() -> None:
    chip = steps(machine(" return\n"), 1)
    assert (chip.state().pc, chip.state().stack_wraps) == (0, 1)
    assert "stack-underflow" in kinds(chip)


def test_a_skip_over_a_goto_takes_two_cycles_section_7() -> None:
    chip = steps(machine(" clrf 0x20\n btfss 0x20, 0\n btfsc 0x20, 0\n goto 0x100\n nop\n"), 3)
    assert (chip.state().pc, chip.state().cycles) == (4, 4)


# Resets: DS35007 section 6 -------------------------------------------------------------------------


def test_registers_at_power_up_table_6_4() -> None:
    state = machine(" nop\n").state()
    expected = {"STATUS": 0x18, "OPTION_REG": 0xFF, "TRISA": 0x1F, "TRISB": 0xFF, "INTCON": 0, "PCLATH": 0}
    assert {name: state.registers[name] for name in expected} == expected
    assert (state.pc, state.cycles) == (0, 0)


SET_ALL = """
        movlw 0x25
        movwf PCLATH
        movwf FSR
        movwf 0x20
        movwf EEADR
        movlw 0x02
        movwf INTCON
        movlw 0xE7
        movwf STATUS
        clrf  TRISB
        clrf  OPTION_REG
        goto  $
"""


def test_mclr_keeps_the_ram_and_sets_the_registers_of_table_6_4() -> None:
    chip = machine(SET_ALL, changes=[(50, "MCLR", LOW), (60, "MCLR", HIGH)])
    chip.run(61)
    state = chip.state()
    assert (state.pc, state.cycles) == (0, 61)
    assert state.status == 0x1F  # 000u uuuu
    expected = {"OPTION_REG": 0xFF, "TRISB": 0xFF, "INTCON": 0, "PCLATH": 0, "FSR": 0x25, "EEADR": 0x25}
    assert {name: state.registers[name] for name in expected} == expected
    assert ram(chip, 0x20) == 0x25
    assert state.resets["mclr"] == 1


def test_mclr_lets_the_pins_go_at_once_table_6_4() -> None:
    chip = machine(" clrf PORTB\n" + OUTPUTS + " goto $\n", changes=[(40, "MCLR", LOW), (50, "MCLR", HIGH)])
    assert (40, "RB0", UNDRIVEN) in edges(chip, 45)


def test_mclr_in_sleep_sets_to_and_clears_pd_table_6_3() -> None:
    chip = machine(" sleep\n", changes=[(50, "MCLR", LOW), (60, "MCLR", HIGH)])
    chip.run(61)
    assert chip.state().status & 0x18 == 0x10
    assert chip.state().resets["mclr_in_sleep"] == 1


def test_a_watchdog_reset_clears_to_and_keeps_flags_table_6_3() -> None:
    on = "        __config _XT_OSC & _WDT_ON & _PWRTE_OFF\n"
    source = " bsf STATUS, RP0\n movlw 0x08\n movwf OPTION_REG\n bsf STATUS, C\n goto $\n"
    chip = machine(source, config=on)
    chip.run(18_001)
    state = chip.state()
    assert (state.pc, state.cycles, state.status) == (0, 18_001, 0x09)  # 0000 1uuu
    assert state.resets["watchdog"] == 1


def test_the_stack_levels_the_ram_and_w_survive_a_watchdog_reset_table_6_4() -> None:
    on = "        __config _XT_OSC & _WDT_ON & _PWRTE_OFF\n"
    chip = machine(" btfss STATUS, 4\n goto $\n movlw 0x99\n movwf 0x33\n goto $\n", config=on)
    chip.run(18_000 * 128 + 10)
    assert (chip.state().w, ram(chip, 0x33), chip.state().pc) == (0x99, 0x99, 1)


def test_power_up_and_start_up_timers_are_counted_when_asked_sections_6_5_and_6_6() -> None:
    slow = "        __config _XT_OSC & _WDT_OFF & _PWRTE_ON\n"
    assert machine(" nop\n", config=slow).cycles == 0
    assert machine(" nop\n", SimulatorOptions(power_up=True), config=slow).cycles == 72_000 + 256
    assert machine(" nop\n", SimulatorOptions(power_up=True)).cycles == 256
    rc = "        __config _RC_OSC & _WDT_OFF & _PWRTE_OFF\n"
    assert machine(" nop\n", SimulatorOptions(power_up=True), config=rc).cycles == 0


def test_an_image_without_configuration_word_runs_as_an_erased_one_section_6_1() -> None:
    blank = Image(image(" goto $\n").program)
    chip = machine(blank)
    chip.run(18_000 * 128 + 1)
    assert "no-configuration" in kinds(chip)
    assert chip.state().resets["watchdog"] == 1
