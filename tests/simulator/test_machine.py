"""Running, stopping and looking: the machine's own interface."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, join
from servogen.errors import InputError
from servogen.simulator import Machine, SimulatorOptions, simulate
from servogen.simulator.machine import EDGE_ROOM
from tests.simulator.helpers import CLOCK, edges, image, machine, ram, steps

BLINK = """
        clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
loop    bsf     PORTB, 0        ; cycle 4
        movlw   100
        movwf   0x20
wait    decfsz  0x20, f
        goto    wait
        bcf     PORTB, 0
        goto    loop
"""
HIGH_CYCLES = 3 + 100 * 3 - 1
PERIOD = HIGH_CYCLES + 3


def test_the_instruction_at_address_0_executes_in_cycle_0() -> None:
    chip = machine(" bsf STATUS, RP0\n clrf TRISB\n")
    assert edges(chip, 10, "RB0") == [(1, "RB0", LOW)]


def test_a_delay_loop_lasts_three_cycles_a_turn_less_one() -> None:
    rises = [cycle for cycle, _, level in edges(machine(BLINK), 3000, "RB0") if level == HIGH]
    falls = [cycle for cycle, _, level in edges(machine(BLINK), 3000, "RB0") if level == LOW][1:]
    assert rises[:3] == [4, 4 + PERIOD, 4 + 2 * PERIOD]
    assert falls[0] - rises[0] == HIGH_CYCLES


def test_simulate_gives_edges_state_and_warnings_at_once() -> None:
    run = simulate(image(BLINK), CLOCK, 1000)
    assert run.edges.end == 1000
    assert run.state.cycles in (1000, 1001)
    assert run.warnings == run.state.warnings
    assert run.state.edges == sum(len(chunk.cycle) for chunk in run.edges.chunks)


def test_a_stream_gives_the_same_edges_in_chunks_of_bounded_size() -> None:
    fast = " clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\nl comf PORTB, f\n goto l\n"
    chunks = list(machine(fast).stream(200_000))
    assert len(chunks) > 1
    assert max(len(chunk.cycle) for chunk in chunks) <= EDGE_ROOM + 52
    whole = join(chunks)
    assert len(whole.cycle) == 8 + 8 * ((200_000 - 4 + 2) // 3)
    assert np.all(np.diff(whole.cycle) >= 0)


def test_simultaneous_edges_are_in_order_of_pins() -> None:
    chip = machine(" bsf STATUS, RP0\n clrf TRISA\n clrf TRISB\n")
    assert [pin for _, pin, _ in edges(chip, 5)] == list(PINS)


def test_a_step_is_one_instruction() -> None:
    chip = machine(BLINK)
    addresses = [steps(chip, 1).pc for _ in range(9)]
    assert addresses == [1, 2, 3, 4, 5, 6, 7, 8, 7]


def test_a_step_in_sleep_is_one_cycle() -> None:
    chip = steps(machine(" sleep\n nop\n"), 4)
    assert (chip.cycles, chip.pc) == (4, 1)


def test_run_until_stops_before_the_instruction_at_an_address() -> None:
    chip = machine(BLINK)
    assert chip.run_until(pc=9)
    assert (chip.pc, chip.cycles) == (9, 4 + HIGH_CYCLES)
    assert chip.run_until(pc=9)
    assert chip.cycles == 4 + HIGH_CYCLES + PERIOD
    assert not chip.run_until(pc=0x200, limit=10_000)


def test_run_until_takes_a_cycle_or_a_predicate() -> None:
    chip = machine(BLINK)
    assert chip.run_until(cycle=50)
    assert chip.cycles in (50, 51)
    assert chip.run_until(predicate=lambda m: m.pc == 10)
    assert not chip.run_until(predicate=lambda m: False, limit=100)
    with pytest.raises(InputError, match="exactly one"):
        chip.run_until(pc=1, cycle=2)


def test_breakpoints_stop_a_run_also_inside_a_loop_that_is_taken_in_one_step() -> None:
    chip = machine(BLINK)
    chip.run(10_000)
    chip.breakpoints = {8}
    turns = []
    for _ in range(3):
        chip.run(10_000)
        turns.append((chip.pc, ram(chip, 0x20)))
    assert turns[0][0] == turns[1][0] == turns[2][0] == 8
    assert turns[0][1] - turns[1][1] == turns[1][1] - turns[2][1] == 1
    with pytest.raises(InputError, match="breakpoint at 0x0500"):
        chip.breakpoints = {0x500}
        chip.run(1)


def test_a_breakpoint_inside_a_wait_is_met_every_time() -> None:
    chip = machine("l nop\n nop\n goto l\n")
    chip.breakpoints = {1}
    for turn in range(3):
        chip.run(100)
        assert (chip.pc, chip.cycles) == (1, 1 + 4 * turn)


def test_run_to_edge_stops_behind_the_instruction_that_makes_it() -> None:
    chip = machine(BLINK)
    assert chip.run_to_edge(PINS.index("RB0"), HIGH, 1000) == 4
    assert chip.cycles == 5
    assert chip.run_to_edge(PINS.index("RB0"), HIGH, 1000) == 4 + PERIOD
    assert chip.run_to_edge(PINS.index("RB1"), HIGH, 1000) is None
    assert len(chip.run(PERIOD).cycle) == 2


def test_equal_fingerprints_at_equal_phases_and_different_ones_elsewhere() -> None:
    chip = machine(BLINK)
    chip.run_until(pc=4)
    chip.run_until(pc=4)
    first = chip.fingerprint()
    chip.run(50)
    assert chip.fingerprint() != first
    chip.run_until(pc=4)
    assert chip.fingerprint() == first


def test_the_timers_phase_is_in_the_fingerprint() -> None:
    counting = " bsf STATUS, RP0\n movlw 0x80\n movwf OPTION_REG\n bcf STATUS, RP0\n"
    chip = machine(counting + BLINK)
    chip.run_until(pc=8)
    first = chip.fingerprint()
    chip.run_until(pc=8)
    assert chip.fingerprint() != first


def test_options_outside_their_range_are_refused() -> None:
    with pytest.raises(InputError, match="watchdog_us"):
        SimulatorOptions(watchdog_us=0)


def test_reads_of_ram_that_was_never_written_are_noted() -> None:
    chip = steps(
        machine(
            " movf 0x30, w\n movwf 0x31\n incf 0x32, f\n clrf 0x30\n movf 0x30, w\n",
            SimulatorOptions(start=(("ram", 7),)),
        ),
        1,
    )
    assert (chip.state().w, chip.read_unwritten) == (7, (0x30,))
    steps(chip, 4)
    assert chip.read_unwritten == (0x30, 0x32)
    assert chip.state().ram_written == (0x30, 0x31, 0x32)
    assert chip.state().ram_high_water == 3


def test_importing_the_simulator_does_not_load_numpy() -> None:
    code = "import sys, servogen.simulator; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]


def test_names_are_what_they_are_after_their_modules_were_imported() -> None:
    import servogen.simulator as package

    for name in package.__all__:
        assert not hasattr(getattr(package, name), "__path__")
        assert name.isupper() or getattr(package, name).__name__ in (name, "simulate")
    assert package.Machine is Machine
    with pytest.raises(AttributeError):
        _ = package.nothing


def test_the_state_tells_when_the_watchdog_would_time_out() -> None:
    """18 ms without a postscaler; OPTION_REG is FFh after a reset, which divides by 128 (section 6.10)."""
    watched = "        __config _XT_OSC & _WDT_ON & _PWRTE_OFF\n"
    chip = machine(" bsf STATUS, RP0\n bcf OPTION_REG, PSA\nl goto l\n", config=watched)
    assert chip.state().watchdog_at == 18_000 * 128
    steps(chip, 2)
    assert chip.state().watchdog_at == 18_000
    chip.run(18_000)
    assert chip.state().resets["watchdog"] == 1
    assert machine(" nop\nl goto l\n").state().watchdog_at is None
