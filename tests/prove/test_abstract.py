"""The abstract chip: one run stands for the runs of all chips that its state describes.

The law: beside a plain chip, which has one of the values that the state leaves open, it makes the same
edges in the same cycles, and its states contain the plain chip's. Where an unknown bit decides, it takes that
of the plain chip for one instruction.
"""

from __future__ import annotations

import random

import numpy as np
import pytest

from servogen.edges import PINS, UNDRIVEN
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.prove.chip import (
    ALL_UNKNOWN,
    CELL_PHASED,
    FIELD,
    UNCERTAIN,
    AbstractChip,
    AssumedBits,
    ChipState,
    Reason,
    Use,
)
from servogen.simulator import Machine, SimulatorOptions
from servogen.simulator import layout as at
from tests.simulator.helpers import CLOCK, image
from tests.simulator.test_exact import rows
from tests.simulator.test_unknown import prepared_image

BASE = 1 << 40
"""The cycle that stands for now in a state."""
OUTPUTS = " clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n"


def chip_of(program: str | Image, **options: object) -> AbstractChip:
    program = program if isinstance(program, Image) else image(f"{program}\nstand goto stand\n")
    return AbstractChip(program, CLOCK, SimulatorOptions(**options))  # type: ignore[arg-type]


def changes_of_levels(edges: list[tuple[int, ...]], high: int) -> list[tuple[int, int, int]]:
    """Return the edges that change a level where an undriven pin is low; `high` were high before."""
    found = []
    for cycle, pin, level in edges:
        level = 0 if level == UNDRIVEN else level
        if high >> pin & 1 != level:
            high ^= 1 << pin
            found.append((cycle, pin, level))
    return found


# The law --------------------------------------------------------------------------------------------------


def contains(state: ChipState, machine: Machine) -> None:
    """Raise AssertionError if the machine's state is not one of the chips'."""
    s = machine.numbers
    for place, cell in enumerate(state.ram):
        assert not cell & CELL_PHASED
        assert (cell ^ int(s[0x0C + place])) & 0xFF & ~(cell >> 8) == 0, hex(0x0C + place)
    for name, row in UNCERTAIN.items():
        if name == "PRESCALER" or (name == "TMR0" and s[at.TMR0_UNKNOWN]):
            continue
        doubt = state[row.unknown_name] & row.bits
        bits = row.bits & (0xF0 << 5 if name == "RB_OLD" else row.bits)
        assert (state[name] ^ int(s[row.number])) & ~doubt & bits == 0, name
    for name in ("PC", "PCLATH", "OPTION", "SLEEPING", "TRIS", "DRIVEN", "DRIVEN_HIGH", "DEPTH", "EE_STEP"):
        assert state[name] == s[getattr(at, name)], name
    depth, top = int(s[at.DEPTH]), int(s[at.SP])
    levels = [int(s[at.STACK + (top - depth + n) % 8]) for n in range(depth)]
    assert [state[f"STACK{n}"] for n in range(8)] == levels + [0] * (8 - depth)
    now = int(s[at.CYCLE])
    done = int(s[at.EE_DONE_AT])
    assert state["EE_DONE_AT"] == (done if done == at.NEVER else BASE + done - now)


def chosen(state: ChipState, machine: Machine) -> tuple[AssumedBits, ...]:
    """Return the machine's values of everything that is unknown in the state."""
    s = machine.numbers
    choices = [AssumedBits("TMR0_PHASE", 0, 0)]
    for place, cell in enumerate(state.ram):
        if cell >> 8:
            choices.append(AssumedBits(f"0x{0x0C + place:02X}", cell >> 8, int(s[0x0C + place]) & 0xFF))
    for name, row in UNCERTAIN.items():
        doubt = state[row.unknown_name] & row.bits
        if doubt:
            choices.append(AssumedBits(name, doubt, int(s[row.number])))
    return tuple(choices)


def writes_option(word: int) -> bool:
    decoded = decode(word)
    if decoded is None:
        return False
    row = decoded.instruction
    return row.mnemonic == "OPTION" or ("f" in row.operands and decoded.f in (0, 1))


def compare(seed: int, cycles: int) -> tuple[int, int]:
    """Run both side by side; return the cycles, and how often a bit was chosen."""
    program = prepared_image(seed)
    program = Image(program.program, 0x3FF1, program.eeprom)
    machine = Machine(program, CLOCK, SimulatorOptions(start_seed=seed, oscillator_start_up=False))
    chip = chip_of(program, oscillator_start_up=False)
    state = chip.power_on()
    stops = frozenset(address for address, word in program.program.items() if writes_option(word))
    dice = random.Random(seed)
    asked = 0
    while machine.cycles < cycles:
        contains(state, machine)
        began, high = int(machine.cycles), state["DRIVEN_HIGH"]
        outcome = chip.run(state, stops, dice.choice((3, 40, 300)))
        if outcome.cycles == 0 or machine.pc & 0x3FF in stops:
            asked += 1
            outcome = chip.run(state, stops, 1, chosen(state, machine))
        if outcome.reason is Reason.WARNING or outcome.rest[FIELD["SLEEPING"]] or machine.asleep:
            break
        edges = rows(machine.run(outcome.cycles))
        if machine.cycles != began + outcome.cycles:
            break  # an interrupt came at once, which the state left open
        made = [(cycle - began, pin, level) for cycle, pin, level in changes_of_levels(edges, high)]
        assert [*outcome.edges] == made, seed
        state = outcome.state(state)
    return int(machine.cycles), asked


def test_every_state_of_a_plain_chip_is_within_the_abstract_one() -> None:
    found = [compare(seed, 700) for seed in range(12)]
    assert sum(cycles for cycles, _ in found) > 2500
    assert sum(asked for _, asked in found) > 30


# Power-up and reset ---------------------------------------------------------------------------------------


def test_what_table_6_4_marks_with_x_is_unknown_at_power_up() -> None:
    """DS35007 table 6-4; and every input, so that INTF, RBIF, T0IF and TMR0 are in doubt."""
    state = chip_of(" nop\n").power_on()
    assert state.ram == (ALL_UNKNOWN,) * 68
    doubt = {"W": 0xFF, "FSR": 0xFF, "TMR0": 0xFF, "EEDATA": 0xFF, "EEADR": 0xFF, "STATUS": 0x07,
             "EECON1": 0x08, "INTCON": 0x07, "LATCH": 0x1FFF, "PINS": 0x1FFF,
             "RB_OLD": 0xF0 << 5}  # fmt: skip
    for name, bits in doubt.items():
        assert state[UNCERTAIN[name].unknown_name] & UNCERTAIN[name].bits == bits, name
        assert state[name] & bits == 0
    known = {"PC": 0, "PCLATH": 0, "OPTION": 0xFF, "TRIS": 0x1FFF, "SLEEPING": 0, "DEPTH": 0, "SP": 0,
             "DRIVEN": 0, "DRIVEN_HIGH": 0, "EE_STEP": 0, "IRQ_AT": at.NEVER,
             "EE_DONE_AT": at.NEVER}  # fmt: skip
    assert {name: state[name] for name in known} == known
    assert state["STATUS"] & ~0x07 == 0x18


def test_values_given_at_power_up_are_known_and_those_of_a_reset_are_not_once_written() -> None:
    given = (("w", 0x12), ("0x20", 0x34), ("flags", 5), ("tmr0", 0x56), ("eeadr", 7), ("wrerr", 1))
    chip = chip_of(" nop\n", start=given)
    state = chip.power_on()
    assert (state["W"], state["W_UNKNOWN"]) == (0x12, 0)
    assert (state["STATUS"], state["STATUS_UNKNOWN"]) == (0x1D, 0)
    assert (state["EEADR"], state["EEADR_UNKNOWN"]) == (7, 0)
    assert (state["EECON1"], state["EECON1_UNKNOWN"]) == (0x08, 0)
    assert state.ram[0x14] == 0x34
    assert state.ram[:0x14] + state.ram[0x15:] == (ALL_UNKNOWN,) * 67
    after = chip.after_reset(frozenset())
    assert after.ram == state.ram  # it was never written
    assert chip.after_reset(frozenset([0x14])).ram == (ALL_UNKNOWN,) * 68
    assert after["STATUS_UNKNOWN"] & 0xFF == 0x1F
    assert after["W_UNKNOWN"] & 0xFF == 0xFF
    whole = chip_of(" nop\n", start=(("ram", 0x5A),))
    assert whole.power_on().ram == (0x5A,) * 68
    assert whole.after_reset(frozenset([0, 67])).ram == (ALL_UNKNOWN, *[0x5A] * 66, ALL_UNKNOWN)


def test_pins_that_the_board_holds_are_known() -> None:
    program = image(" nop\n")
    state = AbstractChip(program, CLOCK, SimulatorOptions(), held={4: 1, 9: 0, 12: 1}).power_on()
    assert state["PINS_UNKNOWN"] == 0x1FFF & ~(1 << 4 | 1 << 9 | 1 << 12)
    assert state["PINS"] == 1 << 4 | 1 << 12


def test_rbif_is_set_where_a_held_pin_differs_from_a_given_reading() -> None:
    """RB4 is pin 9; a change of RB3 or RA4 sets nothing (DS35007 section 4.2)."""
    for pin, read, rbif in ((9, 0, 1), (9, 1, 0), (12, 0, 1), (12, 1, 0), (8, 0, 0), (4, 0, 0)):
        held = dict.fromkeys(range(9, 13), 1) | {pin: 1}
        readings = 0xF if read or pin < 9 else 0xF & ~(1 << pin - 9)
        options = SimulatorOptions(start=(("rb-old", readings), ("rbif", 0)))
        state = AbstractChip(image(" nop\n"), CLOCK, options, held=held).power_on()
        assert (state["INTCON"] & 1, state["INTCON_UNKNOWN"] & 1) == (rbif, 0), pin


@pytest.mark.parametrize(("config", "watched"), [(0x3FF5, True), (0x3FF1, False)])
def test_the_configuration_word_has_the_watchdog_on_or_off(config: int, watched: bool) -> None:
    program = Image(image(" nop\n").program, config)
    assert chip_of(program).watchdog is watched
    shortest = AbstractChip(program, CLOCK, SimulatorOptions(watchdog_us=18_000))
    exact = AbstractChip(program, CLOCK, SimulatorOptions(watchdog_us=18_000), any_watchdog=False)
    for chip, period in ((shortest, 7_000), (exact, 18_000)):
        due = BASE + 128 * period if watched else at.NEVER
        assert chip.power_on()["WDT_EARLIEST"] == due


# Runs -----------------------------------------------------------------------------------------------------


def test_a_run_notes_its_cycles_edges_and_what_it_read_and_wrote() -> None:
    source = (
        OUTPUTS
        + " movf 0x22, w\n movwf 0x20\n clrf 0x21\n movf 0x21, w\n bsf PORTB, 3\n nop\n bcf PORTB, 3\n"
    )
    chip = chip_of(source)
    outcome = chip.run(chip.power_on(), frozenset([11]), 1000)
    assert (outcome.reason, outcome.cycles, outcome.use, outcome.warnings) == (Reason.STOP, 11, None, ())
    rb3 = PINS.index("RB3")
    assert outcome.edges == ((8, rb3, 1), (10, rb3, 0))
    assert outcome.read == (0x22 - 0x0C,)
    assert dict(outcome.written) == {0x20 - 0x0C: ALL_UNKNOWN, 0x21 - 0x0C: 0}
    state = outcome.state(chip.power_on())
    assert (state.ram[0x20 - 0x0C], state.ram[0x21 - 0x0C]) == (ALL_UNKNOWN, 0)
    assert state["PC"] == 11
    again = chip.run(
        chip.run(chip.power_on(), frozenset([9]), 1000).state(chip.power_on()), frozenset([11]), 9
    )
    assert again.edges == ((1, rb3, 0),)
    assert (again.cycles, again.read, again.written) == (2, (), ())


@pytest.mark.parametrize(
    ("limit", "reason", "cycles"),
    [(3, Reason.LIMIT, 3), (4, Reason.LIMIT, 4), (5, Reason.STOP, 4), (100, Reason.STOP, 4)],
)
def test_a_run_ends_at_a_stop_or_at_its_limit(limit: int, reason: Reason, cycles: int) -> None:
    chip = chip_of(" nop\n" * 9)
    outcome = chip.run(chip.power_on(), frozenset([0, 4]), limit)
    assert (outcome.reason, outcome.cycles) == (reason, cycles)


def test_a_stop_at_the_first_instruction_is_passed_by() -> None:
    chip = chip_of("l nop\n goto l\n")
    assert chip.run(chip.power_on(), frozenset([0]), 100).cycles == 3


@pytest.mark.parametrize(
    ("source", "use"),
    [
        (" btfsc 0x30, 0\n", Use(at.USE_SKIP, 0, 2)),
        (" btfsc PORTA, 3\n", Use(at.USE_SKIP, 0, 2)),
        (" clrf INDF\n", Use(at.USE_POINTER, 0, 2)),
        (" movwf STATUS\n", Use(at.USE_BANK, 0, 2)),
        (" movwf PCL\n", Use(at.USE_JUMP, 0, 2)),
        (" movwf INTCON\n", Use(at.USE_REGISTER, 0x0B, 2)),
        (" tris PORTB\n", Use(at.USE_DIRECTION, 1, 2)),
    ],
)
def test_a_run_ends_before_the_instruction_that_depends_on_an_unknown_bit(source: str, use: Use) -> None:
    chip = chip_of(" nop\n nop\n" + source)
    first = chip.power_on()
    outcome = chip.run(first, frozenset(), 100)
    assert (outcome.reason, outcome.cycles, outcome.use) == (Reason.USE, 2, use)
    state = outcome.state(first)
    assert state["PC"] == 2
    again = chip.run(state, frozenset(), 100)
    assert (again.reason, again.cycles, again.use) == (Reason.USE, 0, use)
    assert (again.edges, again.read, again.written, again.rest) == ((), (), (), state.rest)


def test_what_a_run_did_after_an_unknown_bit_decided_is_not_taken_for_every_chip() -> None:
    """W is 0x7D, 0x7F, 0xFD or 0xFF, and counts down to 0, in 500 cycles or more; a run goes on with one.

    The same loop again, from states that a run's memory does not know: what decided still does.
    """
    chip = chip_of(" iorlw 0x7d\nloop addlw 0xff\n btfss STATUS, Z\n goto loop\nhere goto here\n")
    first = chip.power_on()
    for start in (0x18, 0x1C, 0x18):
        rest = list(first.rest)
        rest[FIELD["STATUS"]], rest[FIELD["STATUS_UNKNOWN"]] = start, 0
        state = ChipState(first.ram, tuple(rest))
        outcome = chip.run(state, frozenset({4}), 3000)
        assert (outcome.reason, outcome.use) == (Reason.USE, Use(at.USE_SKIP, 0, 2))


@pytest.mark.parametrize(
    ("source", "field", "bit"),
    [("btfsc 0x30, 5", "0x30", 5), ("btfsc PORTA, 3", "PINS", 3), ("btfsc PORTB, 3", "PINS", 8),
     ("btfsc STATUS, 2", "STATUS", 2), ("btfsc EEDATA, 6", "EEDATA", 6), ("btfsc TMR0, 7", "TMR0", 7)],
)  # fmt: skip
@pytest.mark.parametrize("steer", [False, True])
def test_an_assumed_bit_decides_the_next_instruction(source: str, field: str, bit: int, steer: bool) -> None:
    chip = chip_of(f" {source}\n goto other\n movlw 1\n nop\n nop\nother movlw 2\n")
    first = chip.power_on()
    for level, pc, cycles in ((0, 2, 2), (1, 1, 1)):
        choice = AssumedBits(field, 1 << bit, level << bit, steer)
        outcome = chip.run(first, frozenset([1, 2]), 100, (choice,))
        assert (outcome.reason, outcome.cycles, outcome.rest[FIELD["PC"]]) == (Reason.STOP, cycles, pc)
        state = outcome.state(first)
        if field == "0x30":
            assert state.ram[0x30 - 0x0C] == ALL_UNKNOWN  # it was not written
        elif field in ("PINS", "TMR0"):  # any level again after the instruction
            row = UNCERTAIN[field]
            assert state[row.unknown_name] & row.bits == row.bits
        else:
            left = first[f"{field}_UNKNOWN"] & 0xFF & ~(0 if steer else 1 << bit)
            assert state[f"{field}_UNKNOWN"] & 0xFF == left
            assert state[field] & 1 << bit == (0 if steer else level << bit)


def test_what_is_not_assumed_of_a_byte_decides_later() -> None:
    chip = chip_of(" btfsc 0x30, 5\n nop\n btfsc 0x30, 5\n nop\n btfsc 0x30, 4\n")
    for steer, address in ((False, 4), (True, 2)):
        outcome = chip.run(chip.power_on(), frozenset(), 100, (AssumedBits("0x30", 1 << 5, 0, steer),))
        assert outcome.use == Use(at.USE_SKIP, 0, address)


@pytest.mark.parametrize("flag", [0x01, 0x02, 0x04])
@pytest.mark.parametrize(("instruction", "cycles"), [("nop", 1), ("goto 0x0B", 2)])
def test_an_interrupt_that_may_come_is_a_use_and_comes_if_it_is_assumed(
    flag: int, instruction: str, cycles: int
) -> None:
    """Sampled in cycle 0 of the instruction, it is at 0004h in cycle 3; in its second cycle, in cycle 4."""
    enable = 0x80 | flag << 3
    body = f" movlw {enable}\n movwf INTCON\n nop\n {instruction}\n" + " nop\n" * 6
    chip = chip_of(f" goto main\n nop\n nop\n nop\n nop\nmain{body}")
    first = chip.power_on()
    entry = chip.run(first, frozenset([7]), 100)
    if entry.reason is Reason.USE:  # the write itself leaves it open
        entry = chip.run(entry.state(first), frozenset([7]), 100, (AssumedBits("INTCON", flag, 0),))
    state = entry.state(first)
    assert state["PC"] == 7
    outcome = chip.run(state, frozenset(), 100)
    assert (outcome.reason, outcome.cycles) == (Reason.USE, 0)
    assert outcome.use == Use(at.USE_INTERRUPT, flag, 7)
    quiet = chip.run(state, frozenset([8]), 100, (AssumedBits("INTCON", flag, 0),))
    state = quiet.state(state)
    assert (quiet.cycles, state["PC"], state["INTCON"]) == (1, 8, enable)
    if flag == 0x04:
        return  # TMR0 is unknown: the flag is in doubt again after the instruction
    comes = chip.run(state, frozenset([4]), 100, (AssumedBits("INTCON", flag, flag),))
    after = comes.state(state)
    assert (comes.reason, comes.cycles, after["PC"], after["DEPTH"]) == (Reason.STOP, 3, 4, 1)
    assert after["INTCON"] & ~0x07 == enable & 0x7F
    assert after["STACK0"] == (9 if cycles == 1 else 0x0B)
    if cycles == 2:
        late = chip.run(state, frozenset([4]), 100, (AssumedBits("INTCON_LATE", flag, flag),))
        assert (late.cycles, late.state(state)["PC"]) == (4, 4)


def test_option_may_be_written_where_the_phase_of_tmr0_is_chosen_only() -> None:
    chip = chip_of(
        " movlw 0x88\n option\n nop\n nop\n nop\n nop\n nop\n movf TMR0, w\n", start=(("tmr0", 5),)
    )
    first = chip.power_on()
    outcome = chip.run(first, frozenset([2]), 100)
    assert (outcome.reason, outcome.warnings) == (Reason.WARNING, ("OPTION_REG is written through INDF",))
    state = chip.run(first, frozenset([1]), 100).state(first)
    times = []
    for phase in range(4):
        written = chip.run(state, frozenset([2]), 100, (AssumedBits("TMR0_PHASE", 0, phase),))
        assert (written.reason, written.cycles) == (Reason.STOP, 1)
        times.append(written.state(state)["T0_AT"])
    assert [time - times[0] for time in times] == [0, 1, 2, 3]


def test_the_end_of_sleep_by_the_watchdog() -> None:
    """TO and PD are cleared, and it restarts (DS35007 tables 6-3, section 6.10); 1024 oscillator periods."""
    program = Image(image(" movlw 0x0B\n option\n sleep\n nop\n nop\n").program, 0x3FF5)
    for start_up, cycles in ((True, 256), (False, 0)):
        chip = chip_of(program, oscillator_start_up=start_up)
        first = chip.power_on()
        state = chip.run(first, frozenset([1]), 100).state(first)
        state = chip.run(state, frozenset([2]), 100, (AssumedBits("TMR0_PHASE", 0, 0),)).state(state)
        asleep = chip.run(state, frozenset(), 1).state(state)
        assert (asleep["SLEEPING"], asleep["STATUS"] & 0x18) == (1, 0x10)
        outcome = chip.run(asleep, frozenset([4]), 1000, (AssumedBits("WATCHDOG", 0, 0),))
        awake = outcome.state(asleep)
        assert (awake["SLEEPING"], awake["STATUS"] & 0x18, awake["STATUS_UNKNOWN"] & 0x18) == (0, 0, 0)
        assert (outcome.cycles, awake["PC"]) == (cycles + 1, 4)
        assert awake["WDT_EARLIEST"] - BASE == 8 * 7000 - outcome.cycles


# Many chips at once ---------------------------------------------------------------------------------------


def test_chips_that_differ_in_some_bytes_run_as_each_alone() -> None:
    source = (
        OUTPUTS
        + """
loop    decfsz  0x20, f
        goto    loop
        movf    0x21, w
        movwf   0x22
        btfsc   0x21, 0
        bsf     PORTB, 1
        nop
        bcf     PORTB, 1
        nop
"""
    )
    chip = chip_of(source)
    first = chip.power_on()
    state = chip.run(first, frozenset([4]), 100).state(first)
    values = np.array([[turns, byte] for turns in (1, 2, 9) for byte in (0x10, 0x11, 0xFF)], dtype=np.int64)
    places = (0x20 - 0x0C, 0x21 - 0x0C)
    lanes = chip.run_lanes(state, places, values, frozenset([12]), 1000)
    assert lanes.fit.all()
    for number, row in enumerate(values.tolist()):
        ram = list(state.ram)
        for place, value in zip(places, row, strict=True):
            ram[place] = value
        alone = chip.run(ChipState(tuple(ram), state.rest), frozenset([12]), 1000)
        assert lanes.cycles[number] == alone.cycles == 3 * row[0] + 5
        made = sorted(
            (int(cycles[number]), *edge) for edge, cycles in lanes.edges.items() if cycles[number] >= 0
        )
        assert made == sorted(alone.edges)
        assert len(made) == 2 * (row[1] & 1)
        written = {place: int(cell) for place, cell in enumerate(lanes.ram[number]) if cell >= 0}
        assert written == dict(alone.written)
    assert lanes.read == places
    assert sorted(number for rows_ in lanes.rests.values() for number in rows_.tolist()) == [*range(9)]
    short = chip.run_lanes(state, places, values, frozenset([12]), 20)
    assert short.fit.tolist() == [3 * turns + 5 < 20 for turns, _ in values.tolist()]


def test_chips_of_which_an_unknown_bit_decides_do_not_fit() -> None:
    chip = chip_of(" btfsc 0x20, 0\n btfsc 0x30, 0\n nop\n nop\n nop\n")
    values = np.array([[0], [1]], dtype=np.int64)
    lanes = chip.run_lanes(chip.power_on(), (0x20 - 0x0C,), values, frozenset([4]), 100)
    assert lanes.fit.tolist() == [True, False]


def test_chips_that_go_different_ways_end_in_different_states() -> None:
    """Alike in everything beside the RAM are those that took the same way; W and the flags may differ."""
    chip = chip_of(" btfsc 0x20, 0\n goto odd\n movf 0x20, w\n nop\nodd movf 0x20, w\n nop\n")
    values = np.array([[4], [5], [6], [7], [0]], dtype=np.int64)
    lanes = chip.run_lanes(chip.power_on(), (0x20 - 0x0C,), values, frozenset([3, 5]), 100)
    assert lanes.fit.tolist() == [True] * 5
    assert lanes.cycles.tolist() == [3, 4, 3, 4, 3]
    ends = {rest[FIELD["PC"]]: numbers.tolist() for rest, numbers in lanes.rests.items()}
    assert ends == {3: [0, 2, 4], 5: [1, 3]}
    for rest, numbers in lanes.rests.items():
        differs = 0
        for value in values[numbers, 0].tolist():
            differs |= value ^ int(values[numbers[0], 0])
        assert rest[FIELD["W_UNKNOWN"]] & 0xFF == differs
        assert rest[FIELD["W"]] == int(values[numbers[0], 0]) & ~differs
        assert rest[FIELD["STATUS_UNKNOWN"]] & 4 == (4 if 4 in numbers else 0)  # Z: one of them is 0


@pytest.mark.parametrize(
    ("body", "fit"),
    [
        (" movf EEDATA, w\n movwf 0x21\n", True),
        (" movf EEDATA, w\n movwf EEDATA\n incf EEDATA, f\n", False),
        (" clrf TMR0\n nop\n", False),
        (" bsf INTCON, T0IE\n nop\n", False),
        (" movlw 0x80\n option\n", False),
        (" sleep\n nop\n", False),
        (" return\n", False),
        (" bsf STATUS, RP0\n bcf TRISB, 0\n", False),  # driven with an unknown latch
    ],
)
def test_chips_that_change_what_is_not_compared_do_not_fit(body: str, fit: bool) -> None:
    chip = chip_of(body + " nop\n")
    count = len(body.strip().splitlines())
    values = np.array([[0x12], [0x34]], dtype=np.int64)
    lanes = chip.run_lanes(chip.power_on(), ("EEDATA",), values, frozenset([count]), 50)
    assert lanes.fit.tolist() == [fit, fit]
    if fit:
        assert lanes.ram[:, 0x21 - 0x0C].tolist() == [0x12, 0x34]


def test_tmr0_after_an_instruction_with_an_assumed_count() -> None:
    """CLRF writes it; MOVF does not, so that after it nothing is known of the count but its distance from
    another PHASED byte, 7 here.
    """
    for instruction, known in (("movf TMR0, w", False), ("clrf TMR0", True), ("movwf TMR0", True)):
        options = SimulatorOptions(start=(("w", 9),))
        chip = AbstractChip(image(f" {instruction}\n nop\n"), CLOCK, options, held={4: 0})
        first = chip.power_on()
        assumed = AssumedBits("TMR0", 0xFF, 0x40)
        state = chip.run(first, frozenset([1]), 1, (assumed,)).state(first)
        assert state["TMR0_UNKNOWN"] == (0 if known else 0xFF)
        assert state["W"] == (0x40 if not known else 9)
        assert state["TMR0"] == (9 if "movwf" in instruction else 0)
        moving = [{"TMR0": 7, "TMR0_UNKNOWN": at.PHASED}.get(name, first[name]) for name in FIELD]
        state = chip.run(ChipState(first.ram, tuple(moving)), frozenset([1]), 1, (assumed,)).state(first)
        assert (state["TMR0_UNKNOWN"], state["TMR0"]) == (
            (0, 9 if "movwf" in instruction else 0) if known else (at.PHASED, 7)
        )


def test_a_sleeping_chip_is_run_for_the_assumed_instruction_only() -> None:
    chip = chip_of(" sleep\n nop\n")
    first = chip.power_on()
    outcome = chip.run(first, frozenset(), 50, (AssumedBits("TMR0_PHASE", 0, 0),))
    assert (outcome.cycles, outcome.rest[FIELD["SLEEPING"]], outcome.reason) == (1, 1, Reason.STOP)


@pytest.mark.parametrize(
    ("body", "fit"), [("movf 0x30, w\n movwf EEDATA", False), ("movf EEDATA, w\n movwf 0x21", True)]
)
def test_a_chip_that_writes_an_unknown_byte_to_an_unknown_eedata_does_not_fit(body: str, fit: bool) -> None:
    chip = chip_of(f" {body}\n nop\n")
    values = np.array([[1], [2]], dtype=np.int64)
    lanes = chip.run_lanes(chip.power_on(), (0x20 - 0x0C,), values, frozenset([2]), 50)
    assert lanes.fit.tolist() == [fit, fit]


def test_chips_that_end_alike_have_the_state_of_the_first() -> None:
    """They differ in time only, by the turns of the loop; one chip has its own state."""
    chip = chip_of("loop decfsz 0x20, f\n goto loop\n nop\n", start=(("w", 1), ("flags", 0)))
    first = chip.power_on()
    place, stops = 0x20 - 0x0C, frozenset([2])
    for turns in ((5,), (9,), (9, 5), (5, 9, 2)):
        values = np.array([[count] for count in turns], dtype=np.int64)
        ram = (*first.ram[:place], turns[0], *first.ram[place + 1 :])
        alone = chip.run(ChipState(ram, first.rest), stops, 100)
        lanes = chip.run_lanes(first, (place,), values, stops, 100)
        assert {rest: rows.tolist() for rest, rows in lanes.rests.items()} == {
            alone.rest: [*range(len(turns))]
        }
