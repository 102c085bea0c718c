"""TMR0, the prescaler and the watchdog: DS35007 sections 5 and 6.10, timing by DS30430 figures 6-2 to 6-4."""

from __future__ import annotations

import pytest

from servogen.edges import HIGH
from servogen.simulator import Levels, Machine, SimulatorOptions, Stimuli
from servogen.simulator.sources import pin_number
from servogen.simulator.stimulus import PIECE
from tests.simulator.helpers import CLOCK, edges, image, machine, ram, steps

WATCHDOG_ON = "        __config _XT_OSC & _WDT_ON & _PWRTE_OFF\n"


def option(value: int) -> str:
    """Five instructions, of which the fourth (cycle 3) writes OPTION_REG."""
    return f" nop\n bsf STATUS, RP0\n movlw {value}\n movwf OPTION_REG\n bcf STATUS, RP0\n"


def reads(source: str, before: int, count: int) -> list[int]:
    """What each of `count` MOVF TMR0, W reads after `before` instructions."""
    chip = steps(machine(source + " movf TMR0, w\n" * count), before)
    return [steps(chip, 1).state().w for _ in range(count)]


def test_a_written_tmr0_is_read_three_times_before_it_counts_figure_6_2() -> None:
    source = option(0x88) + " movlw 10\n movwf TMR0\n"
    assert reads(source, 7, 6) == [10, 10, 10, 11, 12, 13]


def test_with_a_prescaler_of_two_it_is_read_four_times_figure_6_3() -> None:
    source = option(0x80) + " movlw 10\n movwf TMR0\n"
    assert reads(source, 7, 9) == [10, 10, 10, 10, 11, 11, 12, 12, 13]


def test_a_read_modify_write_of_tmr0_loses_the_two_inhibited_cycles_section_5() -> None:
    """ADDWF TMR0, F: three cycles of counting are missing, its own and the two inhibited."""
    source = option(0x88) + " clrf TMR0\n movlw 0\n nop\n nop\n nop\n addwf TMR0, f\n"
    before = reads(source.removesuffix(" addwf TMR0, f\n"), 10, 1)[0]
    assert reads(source, 11, 5) == [before] * 3 + [before + 1, before + 2]


@pytest.mark.parametrize("ps", range(8))
def test_the_prescaler_divides_by_a_power_of_two_section_5_2(ps: int) -> None:
    source = option(0x80 | ps) + " clrf TMR0\nloop btfss INTCON, T0IF\n goto loop\n bsf 0x20, 0\n goto $\n"
    chip = machine(source)
    chip.run_until(pc=8)
    start = 5 + 3  # CLRF in cycle 5; counting from cycle 8 on
    due = start + (256 << (ps + 1)) - 1  # T0IF is seen one cycle before TMR0 is read as 0
    assert due <= chip.cycles - 2 < due + 3  # the loop looks every third cycle, and the skip takes two


@pytest.mark.parametrize("tracked", [False, True])
@pytest.mark.parametrize("phase", range(4))
def test_after_a_new_clock_tmr0_stands_still_for_the_cycles_of_its_phase(phase: int, tracked: bool) -> None:
    """OPTION_REG is written in cycle 4, from cycle 5 on it counts, and the reads begin in cycle 6."""
    source = " clrf TMR0\n" + option(0x88) + " movf TMR0, w\n" * 8
    chip = Machine(image(source), CLOCK, SimulatorOptions(tmr0_phase=phase), tracked=tracked)
    steps(chip, 6)
    read = [steps(chip, 1).state().w for _ in range(8)]
    assert read == [max(0, cycle - 5 - phase) for cycle in range(6, 14)]


def test_writes_of_option_reg_that_leave_tmr0s_clock_alone_do_not_stop_it() -> None:
    """RBPU, INTEDG, T0SE, and the ratio of a prescaler that is the watchdog's."""
    source = option(0x88) + " clrf TMR0\n" + option(0x58 | 3) + " movf TMR0, w\n"
    assert [steps(machine(source, SimulatorOptions(tmr0_phase=p)), 12).state().w for p in (0, 3)] == [3, 3]
    slower = option(0x88) + " clrf TMR0\n" + option(0x80) + " movf TMR0, w\n" * 4
    assert [steps(machine(slower, SimulatorOptions(tmr0_phase=p)), 15).state().w for p in (0, 3)] == [4, 2]


def test_writing_tmr0_clears_the_prescaler_when_it_has_it_section_5_2() -> None:
    source = (
        option(0x87)
        + " nop\n" * 100
        + " clrf TMR0\nloop movf TMR0, w\n btfsc STATUS, Z\n goto loop\n goto $\n"
    )
    chip = machine(source)
    chip.run_until(pc=5 + 100 + 4)
    written = 5 + 100
    assert written + 3 + 256 <= chip.cycles <= written + 3 + 256 + 6


def test_t0if_comes_at_the_overflow_and_stays_until_cleared_section_5_3() -> None:
    source = option(0x88) + " movlw 0xF0\n movwf TMR0\n nop\n"
    chip = steps(machine(source + " nop\n" * 60), 7)
    chip.run_until(predicate=lambda m: m.state().registers["INTCON"] & 4 != 0)
    assert chip.cycles == 6 + 3 + 16 - 1
    chip.run(20)
    assert chip.state().registers["INTCON"] & 4


def test_tmr0_counts_edges_of_t0cki_when_t0cs_is_set_section_5() -> None:
    """From reset T0CS and T0SE are 1: falling edges; PSA is 1: no prescaler."""
    changes = [(10 * n + 5, "RA4", n % 2) for n in range(12)]
    chip = machine(" clrf TMR0\n" + " nop\n" * 200, changes=changes)
    chip.run(200)
    assert chip.state().registers["TMR0"] == 5
    rising = machine(option(0xEF) + " clrf TMR0\n" + " nop\n" * 200, changes=changes)
    rising.run(200)
    assert rising.state().registers["TMR0"] == 6


def test_t0cki_goes_through_the_prescaler_section_5_2() -> None:
    changes = [(10 * n + 15, "RA4", (n + 1) % 2) for n in range(40)]
    chip = machine(option(0xE1) + " clrf TMR0\n" + " nop\n" * 600, changes=changes)
    chip.run(500)
    assert chip.state().registers["TMR0"] == 20 // 4


def test_tmr0_stands_still_in_sleep_section_6_11() -> None:
    chip = machine(option(0x88) + " clrf TMR0\n sleep\n")
    chip.run(1000)
    asleep = chip.state().registers["TMR0"]
    chip.run(1000)
    assert chip.state().registers["TMR0"] == asleep == 0


def test_the_prescaler_given_to_the_watchdog_leaves_tmr0_undivided_section_5_2() -> None:
    source = option(0x8F) + " clrf TMR0\n nop\n nop\n"
    assert reads(source, 8, 3) == [0, 1, 2]


def test_the_watchdogs_period_is_an_option_section_6_10() -> None:
    for period in (7_000, 18_000, 33_000):
        chip = machine(option(0x88) + " goto $\n", SimulatorOptions(watchdog_us=period), config=WATCHDOG_ON)
        chip.run(period - 1)
        assert chip.state().resets["watchdog"] == 0
        chip.run(1)
        assert chip.state().resets["watchdog"] == 1


@pytest.mark.parametrize("ps", range(8))
def test_the_postscaler_multiplies_the_watchdogs_period_section_6_10(ps: int) -> None:
    chip = machine(
        " clrwdt\n" + option(0x88 | ps) + " goto $\n", SimulatorOptions(watchdog_us=500), config=WATCHDOG_ON
    )
    chip.run((500 << ps) - 10)
    assert chip.state().resets["watchdog"] == 0
    chip.run(20)
    assert chip.state().resets["watchdog"] == 1


def test_clrwdt_starts_the_watchdog_anew_section_6_10() -> None:
    source = option(0x88) + "loop clrwdt\n" + " nop\n" * 90 + " goto loop\n"
    chip = machine(source, SimulatorOptions(watchdog_us=100), config=WATCHDOG_ON)
    chip.run(100_000)
    assert chip.state().resets["watchdog"] == 0


def test_without_its_bit_in_the_configuration_word_the_watchdog_is_off_section_6_1() -> None:
    chip = machine(option(0x88) + " goto $\n", SimulatorOptions(watchdog_us=100))
    chip.run(100_000)
    assert chip.state().resets["watchdog"] == 0


def test_handing_the_prescaler_over_without_clrwdt_keeps_its_count_section_5_2_1() -> None:
    """The watchdog inherits the count, so its first period is a part of what it should be."""
    source = option(0x87) + " clrf TMR0\n" + " nop\n" * 125 + option(0x8F) + " goto $\n"
    chip = machine(source, SimulatorOptions(watchdog_us=1000), config=WATCHDOG_ON)
    chip.run(128_000)
    assert chip.state().resets["watchdog"] >= 1
    cleared = source.replace(" goto $", " clrwdt\n goto $")
    chip = machine(cleared, SimulatorOptions(watchdog_us=1000), config=WATCHDOG_ON)
    chip.run(128_000)
    assert chip.state().resets["watchdog"] == 0


def test_a_watchdog_time_out_in_sleep_wakes_and_clears_to_and_pd_table_6_3() -> None:
    source = " clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n movlw 0x08\n movwf OPTION_REG\n bcf STATUS, RP0\n"
    source += " sleep\n bsf PORTB, 0\n goto $\n"
    chip = machine(source, config=WATCHDOG_ON)
    slept_from = 6 + 1
    woken = slept_from + 18_000 + 256  # the oscillator's start-up, 1024 periods: section 6.11
    assert [edge for edge in edges(chip, 20_000, "RB0") if edge[2] == HIGH] == [(woken, "RB0", HIGH)]
    assert chip.state().status & 0x18 == 0
    assert chip.state().wakes["watchdog"] == 1
    quick = machine(source, SimulatorOptions(oscillator_start_up=False), config=WATCHDOG_ON)
    assert (slept_from + 18_000, "RB0", HIGH) in edges(quick, 20_000, "RB0")


def test_long_waits_on_t0if_are_exact() -> None:
    """The wait is taken in one step; T0IF must still be seen in the cycle in which it comes."""
    source = (
        option(0x85)
        + " clrf TMR0\nloop btfss INTCON, T0IF\n goto loop\n incf 0x20, f\n bcf INTCON, T0IF\n goto loop\n"
    )
    fast, slow = machine(source), machine(source)
    fast.run(75_000)
    while slow.cycles < 75_000:
        slow.step()
    assert ram(fast, 0x20) == ram(slow, 0x20) == 4
    assert fast.fingerprint() == slow.fingerprint()


def test_many_overflows_at_once_leave_what_each_by_itself_does() -> None:
    """T0IF is due the second time in cycle 519: TMR0 counts from cycle 8 on."""
    source = option(0x88) + " clrf TMR0\n" + " nop\n" * 520
    for cycle in range(515, 523):
        fast, slow = machine(source), steps(machine(source), cycle)
        fast.run(cycle)
        assert fast.fingerprint() == slow.fingerprint()


def test_a_time_out_in_the_cycle_in_which_more_changes_are_asked_for_comes() -> None:
    period = PIECE + 100
    changes = Levels(pin_number("RB0"), [*((n, n % 2) for n in range(PIECE)), (period, 1)])
    options = SimulatorOptions(watchdog_us=period)
    chip = Machine(image(option(0x88) + " goto $\n", WATCHDOG_ON), CLOCK, options, Stimuli([changes]))
    chip.run(period)
    assert chip.state().resets["watchdog"] == 1


def test_the_watchdog_counts_nothing_while_mclr_is_low_though_one_looks() -> None:
    """From the release on it has the prescaler of a reset, 1:128 (DS35007 register 2-2)."""
    changes = [(50, "MCLR", 0), (1000, "MCLR", 1)]
    chip = machine(" goto $\n", SimulatorOptions(watchdog_us=100), changes, WATCHDOG_ON)
    chip.run(300)
    chip.run(1000 + 128 * 100 - 1 - 300)
    assert chip.state().resets["watchdog"] == 0
    chip.run(1)
    assert chip.state().resets["watchdog"] == 1


def test_any_wake_up_starts_the_watchdog_anew_section_6_11_2() -> None:
    source = " bsf INTCON, INTE\n sleep\n bcf INTCON, INTF\n goto $\n"
    changes = [(0, "RB0", 0), (17_000, "RB0", 1)]
    chip = machine(" clrwdt\n" + option(0xC8) + source, changes=changes, config=WATCHDOG_ON)
    chip.run(17_000 + 18_000 - 1)
    assert (chip.state().wakes["interrupt"], chip.state().resets["watchdog"]) == (1, 0)
    chip.run(1)
    assert chip.state().resets["watchdog"] == 1
