"""The machine's own interface at its limits: where a run ends, what is seen, what can be added."""

from __future__ import annotations

import math

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, edge_chunk
from servogen.pic.image import Image
from servogen.pic.listing import ListedFunction, Listing, ListingRow
from servogen.simulator import (
    LevelChange,
    Levels,
    Machine,
    Observation,
    Recorded,
    ServoLoad,
    SimulatorOptions,
    Stimuli,
    profile,
    simulate,
    trace,
)
from servogen.simulator.machine import unpack_edges
from servogen.units import Clock
from tests.simulator.helpers import CLOCK, edges, image, machine, ram, steps

RB0, RB1 = PINS.index("RB0"), PINS.index("RB1")
OUTPUTS = " clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n"
BLINK = OUTPUTS + "l bsf PORTB, 0\n bcf PORTB, 0\n bsf PORTB, 1\n bcf PORTB, 1\n goto l\n"
"""RB0 rises in cycle 4 + 6 n and RB1 in 6 + 6 n, each for one cycle."""


@pytest.mark.parametrize("cycles", range(3, 9))
def test_a_run_ends_with_the_instruction_in_which_its_time_is_over(cycles: int) -> None:
    """NOPs in cycles 0 to 3, and a GOTO in 4 and 5, over and over."""
    chip = machine("l nop\n nop\n nop\n nop\n nop\n goto l\n")
    chip.run(cycles)
    assert chip.cycles == (7 if cycles == 6 else cycles)


def test_no_time_is_no_instruction() -> None:
    chip = machine(BLINK)
    assert len(chip.run(0).cycle) == 0
    assert (chip.cycles, chip.pc) == (0, 0)
    assert chip.run_until(cycle=0)
    assert (chip.cycles, chip.pc) == (0, 0)
    assert not chip.run_until(predicate=lambda m: True, limit=0)
    assert chip.cycles == 0
    chip.run(7)
    assert chip.run_until(cycle=3)  # it is past already
    assert chip.cycles == 7


@pytest.mark.parametrize(("limit", "there"), [(3, False), (4, False), (5, True), (100, True)])
def test_an_address_must_be_reached_before_the_limit(limit: int, there: bool) -> None:
    chip = machine(" nop\n" * 20)
    assert chip.run_until(pc=4, limit=limit) is there
    assert chip.cycles == min(limit, 4)
    if there:
        assert chip.run_until(pc=6, limit=3)
        assert chip.cycles == 6


@pytest.mark.parametrize(
    ("cycle", "limit", "there", "at"), [(9, 9, True, 9), (9, 8, False, 8), (9, None, True, 9)]
)
def test_a_cycle_must_be_reached_within_the_limit(
    cycle: int, limit: int | None, there: bool, at: int
) -> None:
    chip = machine(" nop\n" * 20)
    assert chip.run_until(cycle=cycle, limit=limit) is there
    assert chip.cycles == at


def test_a_predicate_is_asked_after_every_instruction() -> None:
    chip = machine(" nop\n" * 20)
    asked: list[int] = []
    assert chip.run_until(predicate=lambda m: asked.append(m.pc) or m.pc == 4, limit=4)
    assert asked == [1, 2, 3, 4]
    assert not chip.run_until(predicate=lambda m: m.pc == 9, limit=4)
    assert chip.run_until(predicate=lambda m: m.pc == 9, limit=1)


@pytest.mark.parametrize(
    ("pin", "level", "limit", "found", "after"),
    [(RB0, HIGH, 5, 4, 5), (RB0, HIGH, 4, None, 4), (RB0, LOW, 100, 2, 3), (RB1, HIGH, 100, 6, 7),
     (RB1, LOW, 100, 2, 3), (RB0, UNDRIVEN, 30, None, 30), (RB1, HIGH, 0, None, 0)],
)  # fmt: skip
def test_the_next_edge_of_a_pin(pin: int, level: int, limit: int, found: int | None, after: int) -> None:
    chip = machine(BLINK)
    assert chip.run_to_edge(pin, level, limit) == found
    assert chip.cycles in (after, after + 1)
    assert sum(len(chunk.cycle) for chunk in chip.stream(600)) > 390  # the buffer is as large as before


def test_the_next_change_of_any_pin() -> None:
    chip = machine(BLINK)
    chip.breakpoints = {5}
    seen = []
    while chip.cycles < 12:
        chunk = chip.run_to_change(100)
        seen.append((int(chunk.cycle[0]), len(chunk.cycle), chip.cycles))
    assert seen[:4] == [(2, 8, 3), (4, 1, 5), (5, 1, 6), (6, 1, 7)]
    quiet = machine(" nop\n" * 40)
    assert len(quiet.run_to_change(10).cycle) == 0
    assert quiet.cycles == 10


def test_what_is_seen_of_the_pins() -> None:
    """RB0 is an output at 1, RB1 at 0; RB2 is held high; RA4 is an open drain with its latch at 1, then 0."""
    source = (
        " movlw 1\n movwf PORTB\n bsf PORTA, 4\n bsf STATUS, RP0\n movlw 0xFC\n movwf TRISB\n clrf TRISA\n"
    )
    chip = machine(source + " bcf STATUS, RP0\n bcf PORTA, 4\n", changes=[(0, "RB2", 1)])
    assert (chip.levels, chip.edges_made, chip.asleep) == ((UNDRIVEN,) * 13, 0, False)
    steps(chip, 7)
    assert chip.levels == (0, 0, 0, 0, UNDRIVEN, 1, 0, *[UNDRIVEN] * 6)
    assert chip.pins == 1 << 5 | 1 << 7
    assert chip.edges_made == 2 + 4
    steps(chip, 2)
    assert chip.levels[4] == 0
    assert chip.edges_made == 7
    assert chip.state().edges == 7


def test_whether_the_chip_sleeps_is_in_reset_or_has_its_pull_ups_on() -> None:
    chip = machine(
        " bsf STATUS, RP0\n bcf OPTION_REG, 7\n sleep\n", changes=[(9, "MCLR", 0), (12, "MCLR", 1)]
    )
    seen = []
    for _ in range(13):
        chip.step()
        seen.append((int(chip.cycles), chip.asleep, chip.pull_ups))
    assert [asleep for cycle, asleep, _ in seen if cycle <= 2] == [False, False]
    assert all(asleep for cycle, asleep, _ in seen if 3 <= cycle <= 12)
    assert [up for cycle, _, up in seen if cycle in (1, 2, 8)] == [False, True, True]
    assert not chip.pull_ups
    assert not steps(chip, 1).asleep


def test_the_ram_is_the_68_bytes_from_0x0c() -> None:
    chip = steps(machine(" movlw 7\n movwf 0x0C\n movlw 9\n movwf 0x4F\n"), 4)
    assert chip.ram == bytes([7, *[0] * 66, 9])
    assert chip.ram == chip.state().ram


def test_changes_may_be_added_from_now_on() -> None:
    program = image(" movf PORTB, w\n" * 40)
    stimulus = Stimuli([Levels(RB0, [(10, 1), (20, 0), (30, 1)])])
    chip = Machine(program, CLOCK, stimulus=stimulus)
    chip.run(5)
    chip.apply(
        [LevelChange(5, RB0, 1), LevelChange(7, RB0, 0), LevelChange(20, RB0, 1), LevelChange(21, RB0, 0)]
    )
    read = []
    for _ in range(30):
        chip.step()
        read.append(chip.state().w & 1)
    at_5 = {5: 1, 6: 1, 7: 0, 8: 0, 9: 0, 10: 1, 19: 1, 20: 1, 21: 0, 29: 0, 30: 1, 34: 1}
    assert {cycle: read[cycle - 5] for cycle in at_5} == at_5
    for change in ((34, 0, 1), (35, 14, 1), (35, -1, 1), (35, 0, 3), (35, 0, -1)):
        with pytest.raises(ValueError, match="cannot be applied in cycle 35"):
            chip.apply([LevelChange(*change)])
    for change in ((35, 13, 1), (35, 0, 2), (35, 0, 0)):
        chip.apply([LevelChange(*change)])
    bare = Machine(program, CLOCK)
    bare.apply([])
    bare.apply([LevelChange(2, RB0, 1)])
    assert steps(bare, 4).state().w == 1


def test_a_snapshot_is_of_one_image() -> None:
    kept = machine(" nop\n").snapshot()
    with pytest.raises(ValueError, match="another image"):
        machine(" nop\n nop\n").restore(kept)
    machine(" nop\n").restore(kept)


def test_packed_edges_are_cycle_pin_and_level() -> None:
    packed = np.array([7 << 8 | 12 << 2 | 2, (1 << 40) << 8 | 1], dtype=np.int64)
    rows = [column.tolist() for column in unpack_edges(packed)]
    assert rows == [[7, 1 << 40], [12, 0], [2, 1]]


def test_a_simulation_says_what_it_was() -> None:
    run = simulate(image(BLINK), CLOCK, 2_000_000)
    assert repr(run) == f"<Simulation 2 s: 0 warnings, PC 0x{run.state.pc:03X}>"
    page = run._repr_html_()
    assert "RB0" in page and "RB2" in page and "RA0" not in page
    assert "666667" in page  # RB0: once low, and 333 333 pulses that begin before cycle 2 000 000
    assert run.state.to_json()["cycles"] == run.state.cycles
    assert run.state.to_json()["ram"] == [0] * 68


def test_a_ninth_level_and_an_empty_stack_are_counted() -> None:
    nested = "".join(f" call n{i}\nn{i}\n" for i in range(10)) + " return\n"
    chip = steps(machine(nested), 10)
    state = chip.state()
    assert (state.stack_wraps, state.stack_depth, state.deepest_stack) == (2, 8, 8)
    assert state.stack == (10, 9, 8, 7, 6, 5, 4, 3)
    words = machine("".join(f" call n{i}\nn{i}\n" for i in range(3)) + " return\n return\n")
    assert (steps(words, 4).state().stack_depth, words.state().deepest_stack) == (2, 3)


# Observation ----------------------------------------------------------------------------------------------


def test_a_row_of_a_trace_in_words() -> None:
    """Flags are T, P, Z, D and C, as in STATUS from bit 4 down."""
    rows = [str(row) for row in trace(machine(" movlw 0xFF\n addlw 1\n sleep\n"), 3)]
    assert rows == [
        "           0 0000  MOVLW 0xFF           W=FF TP---",
        "           1 0001  ADDLW 0x01           W=00 TPZDC",
        "           2 0002  SLEEP                W=00 T-ZDC",
    ]
    words = Image({0: 0x0001, 2: 0x3401}, 0x3FF1)
    named = [row.assembly for row in trace(Machine(words, CLOCK), 3)]
    assert named == ["(undefined 0x0001)", "(erased)", "RETLW 0x01"]


def test_a_row_of_a_trace_with_its_line() -> None:
    text = "first\n  second line  \n"
    row = (ListingRow(0, 0, "NOP", 1, "x.asm", 2), ListingRow(1, 0, "NOP", 1, "x.asm", 3),
           ListingRow(2, 0, "NOP", 1, "y.asm", 1))  # fmt: skip
    listing = Listing(row, (), (), (("x.asm", text),))
    rows = list(trace(machine(" nop\n nop\n nop\n"), 3, listing))
    assert [(each.file, each.line, each.source) for each in rows] == [
        ("x.asm", 2, "second line"), ("x.asm", 3, ""), ("y.asm", 1, ""),
    ]  # fmt: skip
    assert str(rows[0]).endswith("  x.asm:2: second line")


def test_a_profile_of_a_loop() -> None:
    """Three turns of NOP and GOTO, three cycles each; two words are never executed."""
    chip = machine("l nop\n goto l\n nop\n return\n")
    listing = Listing(
        tuple(ListingRow(a, 0, "", 1, "x.asm", 1 + a // 2) for a in range(4)),
        (ListedFunction("f", 0, 1), ListedFunction("g", 1, 4)),
        (),
        (("x.asm", ""),),
    )
    found = profile(chip, 9, listing)
    assert (found.cycles, found.idle, found.coverage, found.unexecuted) == (9, 0, 0.5, (2, 3))
    assert {a: (spent.executions, spent.cycles) for a, spent in found.words.items()} == {0: (3, 3), 1: (3, 6)}
    assert {n: (spent.executions, spent.cycles) for n, spent in found.functions.items()} == {
        "f": (3, 3), "g": (3, 6),
    }  # fmt: skip
    assert found.lines["x.asm", 1].cycles == 9
    assert found.to_json()["function_cycles"] == {"f": 3, "g": 6}
    assert found.to_json()["lines"] == [{"file": "x.asm", "line": 1, "cycles": 9, "executions": 6}]
    again = profile(chip, 3, listing)
    assert (again.cycles, again.words[1].executions) == (3, 1)
    alone = profile(machine("l nop\n goto l\n"), 9)
    assert alone.functions[""].cycles == 9
    assert (alone.lines, alone.coverage) == ({}, 1.0)


def test_counts_are_of_addresses_and_stop_at_a_breakpoint() -> None:
    chip = machine(" nop\n nop\n goto 0\n")
    watched = Observation()
    for _ in chip.observe(12, watched):
        pass
    assert watched.counts[:4].tolist() == [[3, 3], [3, 3], [3, 6], [0, 0]]
    assert not watched.counts[4:].any()


# Servos ---------------------------------------------------------------------------------------------------


def test_a_servo_moves_at_its_speed_towards_what_the_last_pulse_commanded() -> None:
    """At 8 MHz a cycle is half a microsecond; 1000 µs is 0 rad, 2000 µs is 2 rad; 10 rad/s."""
    load = ServoLoad((1000.0, 2000.0), (0.0, 2.0), speed=10.0, start=1.0)
    rows = [(10, RB0, HIGH), (3010, RB0, LOW), (40_000, RB0, HIGH), (41_000, RB1, HIGH), (44_000, RB0, LOW),
            (80_000, RB0, HIGH), (81_000, RB0, HIGH), (82_000, RB0, LOW), (83_000, RB0, LOW),
            (900_000, RB0, HIGH), (902_000, RB0, LOW)]  # fmt: skip
    chunk = edge_chunk(*zip(*rows, strict=True))
    found = list(load.positions([chunk], Clock(8_000_000), RB0))
    assert [(each.cycle, each.width) for each in found] == [
        (3010, 3000), (44_000, 4000), (82_000, 2000), (902_000, 2000),
    ]  # fmt: skip
    assert [each.commanded for each in found] == pytest.approx([1.0, 2.0, 0.0, 0.0])
    # 38 000 cycles are 19 ms: 0.19 rad from 1 towards 2; then there is time enough.
    assert [each.angle for each in found] == pytest.approx([1.0, 1.0, 1.19, 0.0])


@pytest.mark.parametrize(
    ("widths", "angles", "speed", "good"),
    [
        ((1.0, 2.0), (0.0, 1.0), 1e-9, True),
        ((1.0, 2.0), (0.0, 1.0), 0.0, False),
        ((1.0, 2.0), (0.0, 1.0), -1.0, False),
        ((1.0, 1.0), (0.0, 1.0), 1.0, False),
        ((1.0, 3.0, 2.0), (0.0, 1.0, 2.0), 1.0, False),
        ((1.0, 2.0, 3.0), (0.0, math.pi, 1.0), 1.0, True),
        ((1.0, 2.0), (0.0,), 1.0, False),
        ((1.0,), (0.0,), 1.0, False),
    ],
)
def test_a_calibration_has_two_or_more_rising_widths_and_a_speed(
    widths: tuple[float, ...], angles: tuple[float, ...], speed: float, good: bool
) -> None:
    if good:
        assert ServoLoad(widths, angles, speed).start == 0.0
    else:
        with pytest.raises(Exception, match=r"servo load needs|servo's speed is"):
            ServoLoad(widths, angles, speed)


# Warnings of the configuration ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("config", "hz", "said"),
    [
        (0x3FF0, 200_000, None),
        (0x3FF0, 200_004, "LP oscillator, which is for at most 200000 Hz, not for 200004 Hz"),
        (0x3FF1, 4_000_000, None),
        (0x3FF1, 4_000_004, "XT oscillator, which is for at most 4000000 Hz, not for 4000004 Hz"),
        (0x3FF2, 20_000_000, None),
        (0x3FF2, 4, None),
        (0x3FF3, 4_000_000, "RC oscillator, whose frequency is not exactly 4000000 Hz"),
        (None, 4_000_000, "the oscillator is RC and the watchdog is on"),
    ],
)
def test_the_oscillator_suits_the_clock(config: int | None, hz: int, said: str | None) -> None:
    """LP up to 200 kHz, XT up to 4 MHz, HS any: DS35007 section 6.2."""
    chip = Machine(Image({0: 0}, config), Clock(hz), SimulatorOptions(watchdog_us=1_000_000))
    warnings = chip.state().warnings
    if said is None:
        assert warnings == ()
    else:
        (warning,) = warnings
        assert said in warning.message
        assert warning.location is not None
        assert (warning.location.cycle, warning.location.address) == (0, 0x2007)


def test_a_recording_applied_in_the_cycle_of_a_reset() -> None:
    """MCLR low from cycle 3 to 5: the first instruction is in cycle 6, one after the release (its fetch)."""
    changes = Recorded(
        [LevelChange(3, 13, 0), LevelChange(3, 13, 0), LevelChange(5, 13, 1), LevelChange(5, 13, 1)]
    )
    chip = Machine(image(OUTPUTS + " goto $\n"), CLOCK, stimulus=Stimuli([changes]))
    made = edges(chip, 9, "RB3")
    assert made == [(2, "RB3", LOW), (3, "RB3", UNDRIVEN), (8, "RB3", LOW)]
    assert chip.state().resets["mclr"] == 1
    assert ram(chip, 0x0C) == 0


def test_a_state_as_json_has_what_it_says_without_the_warnings() -> None:
    program = image(" org 0x2100\n de 9\n org 0\n movlw 7\n movwf 0x20\n call s\n nop\ns sleep\n")
    state = steps(Machine(program, CLOCK), 4).state()
    found = state.to_json()
    assert found["cycles"] == 5
    assert (found["pc"], found["w"], found["status"], found["sleeping"]) == (5, 7, 0x10, True)
    assert found["ram"] == [7 if address == 0x20 else 0 for address in range(0x0C, 0x50)]
    assert found["eeprom"] == [9] + [0xFF] * 63
    assert found["resets"] == {"power_on": 1, "mclr": 0, "mclr_in_sleep": 0, "watchdog": 0}
    assert (found["stack_wraps"], found["deepest_stack"], found["edges"]) == (0, 1, 0)
    registers = found["registers"]
    assert isinstance(registers, dict)
    assert (registers["PCL"], registers["OPTION_REG"], registers["TRISB"], registers["EECON2"]) == (
        5,
        255,
        255,
        0,
    )
    assert state.stack == (3, 0, 0, 0, 0, 0, 0, 0)
    assert (state.ram_written, state.ram_high_water, state.prescaler) == ((0x20,), 1, 0)
