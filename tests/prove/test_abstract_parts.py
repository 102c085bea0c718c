"""The parts of the abstract chip, each by itself: what is assumed for one instruction and undone after it,
which interrupts are in doubt, how a state is made relative to now, and the edges of many chips at once.
"""

from __future__ import annotations

import random
from itertools import product

import numpy as np
import pytest

from servogen.edges import PINS
from servogen.pic.image import Image
from servogen.prove.chip import (
    ALL_UNKNOWN,
    CELL_PHASED,
    FIELD,
    MAX_LANE_EDGES,
    AbstractChip,
    AssumedBits,
    ChipState,
    Reason,
    Use,
)
from servogen.simulator import SimulatorOptions
from servogen.simulator import layout as at
from tests.prove.test_abstract import BASE, chip_of
from tests.simulator.helpers import CLOCK, image

GIE, EEIE, T0IE, INTE, RBIE, T0IF, INTF, RBIF = (0x80 >> bit for bit in range(8))
"""DS35007 register 2-3."""


def loaded(chip: AbstractChip) -> np.ndarray:
    """Load the state at power-up, and return its slots."""
    return chip._load(chip.power_on())


# What is assumed for one instruction ---------------------------------------------------------------------


def test_a_count_of_which_bits_were_assumed_is_unknown_again_and_has_counted_on() -> None:
    """The assumption is about one moment: before + (count after - count assumed), modulo 256."""
    chip = chip_of(" nop\n")
    for mask, bits, chosen, counted in product(
        (0xFF, 0xF0, 0x81), (0x01, 0xF0, 0xFF), (0x00, 0xB1), (0, 1, 3)
    ):
        s = loaded(chip)
        value = 0x7E & ~mask
        s[at.TMR0], s[at.TMR0_UNKNOWN], s[at.T0_HELD] = value, mask | at.SOURCE_TMR0 << 8, BASE + 2
        choice = AssumedBits("TMR0", bits, chosen)
        before = chip._hold(choice)
        assumed = value & ~bits | chosen & bits
        assert (s[at.TMR0], s[at.TMR0_UNKNOWN]) == (assumed, mask & ~bits)
        s[at.TMR0] = assumed + counted & 0xFF
        chip._release(choice, before)
        assert s[at.TMR0] == value + counted & 0xFF
        assert s[at.TMR0_UNKNOWN] == mask | at.SOURCE_TMR0 << 8


def test_a_count_that_the_instruction_wrote_stays() -> None:
    """It then stands still for the cycle of the write and the two after it (DS35007 section 5)."""
    chip = chip_of(" nop\n")
    choice = AssumedBits("TMR0", 0xFF, 0x40)
    for held, unknown, left in ((BASE + 3, 0, (0x99, 0)), (BASE + 2, 0, (0x59, 0xFF)), (BASE, 7, (0x99, 7))):
        s = loaded(chip)
        s[at.TMR0], s[at.TMR0_UNKNOWN] = 0, 0xFF
        before = chip._hold(choice)
        s[at.TMR0], s[at.TMR0_UNKNOWN], s[at.T0_HELD] = 0x99, unknown, held
        chip._release(choice, before)
        assert (s[at.TMR0], s[at.TMR0_UNKNOWN]) == left


def test_tmr0_after_an_instruction_with_an_assumed_count() -> None:
    """CLRF writes it; MOVF does not, so that after it nothing is known of the count."""
    for instruction, known in (("movf TMR0, w", False), ("clrf TMR0", True), ("movwf TMR0", True)):
        options = SimulatorOptions(start=(("w", 9),))
        chip = AbstractChip(image(f" {instruction}\n nop\n"), CLOCK, options, held={4: 0})
        first = chip.power_on()
        state = chip.run(first, frozenset([1]), 1, (AssumedBits("TMR0", 0xFF, 0x40),)).state(first)
        assert state["TMR0_UNKNOWN"] == (0 if known else 0xFF)
        assert state["W"] == (0x40 if not known else 9)
        assert state["TMR0"] == (9 if "movwf" in instruction else 0)


def test_pins_that_were_assumed_are_unknown_again_unless_the_chip_drives_them() -> None:
    chip = chip_of(" nop\n")
    for driven in (0, 0x0F, 0x1FFF):
        s = loaded(chip)
        choice = AssumedBits("PINS", 0x333, 0x155)
        before = chip._hold(choice)
        assert (s[at.PINS], s[at.PINS_UNKNOWN]) == (0x111, 0x1FFF & ~0x333)
        s[at.DRIVEN] = driven
        chip._release(choice, before)
        assert s[at.PINS] == 0x111 & driven
        assert s[at.PINS_UNKNOWN] == 0x1FFF & ~(0x333 & driven)


def test_a_flag_of_the_second_cycle_is_clear_in_the_first_and_requests_an_interrupt_in_the_second() -> None:
    chip = chip_of(" nop\n")
    for gie, already in product((0, GIE), (BASE, BASE + 1, BASE + 5, at.NEVER)):
        s = loaded(chip)
        s[at.INTCON], s[at.INTCON_UNKNOWN] = gie | INTE | RBIF, INTF | T0IF
        choice = AssumedBits("INTCON_LATE", INTF, INTF)
        before = chip._hold(choice)
        assert (s[at.INTCON], s[at.INTCON_UNKNOWN]) == (gie | INTE | RBIF, T0IF)
        s[at.IRQ_AT] = already
        s[at.INTCON_UNKNOWN] = INTF | T0IF
        chip._release(choice, before)
        assert (s[at.INTCON], s[at.INTCON_UNKNOWN]) == (gie | INTE | RBIF | INTF, T0IF)
        assert s[at.IRQ_AT] == (min(already, BASE + 1) if gie else already)


def test_the_phase_of_tmr0_is_assumed_for_one_instruction() -> None:
    chip = chip_of(" nop\n")
    s = loaded(chip)
    choice = AssumedBits("TMR0_PHASE", 0, 3)
    before = chip._hold(choice)
    assert s[at.T0_PHASE] == 3
    chip._release(choice, before)
    assert s[at.T0_PHASE] == 0


def test_the_end_of_an_eeprom_write_is_assumed_by_its_distance() -> None:
    chip = chip_of(" nop\n")
    s = loaded(chip)
    chip._hold(AssumedBits("EE_DONE", 0, 7))
    assert s[at.EE_DONE_AT] == BASE + 7


def test_assumed_bits_of_a_byte_of_ram() -> None:
    """With `steer` they stay unknown; whether the byte was written does not change."""
    chip = chip_of(" nop\n")
    for mask, steer, written in product((0xFF, 0x3C, 0x0F), (False, True), (0, at.NOT_WRITTEN)):
        s = loaded(chip)
        value = 0xA5 & ~mask
        s[0x20] = value | mask << at.UNKNOWN_SHIFT | written
        chip._hold(AssumedBits("0x20", 0x3C, 0x14, steer))
        assert s[0x20] & 0xFF == value & ~0x3C | 0x14
        assert s[0x20] >> at.UNKNOWN_SHIFT == (mask if steer else mask & ~0x3C)
        assert s[0x20] & at.NOT_WRITTEN == written


def test_an_assumed_flag_of_an_enabled_interrupt_requests_it_now() -> None:
    """DS35007 register 2-3: each enable bit is three above its flag, and GIE enables all."""
    chip = chip_of(" nop\n")
    for gie, enables, flags in product((0, GIE), range(8), range(8)):
        s = loaded(chip)
        s[at.INTCON] = gie | enables << 3
        chip._hold(AssumedBits("INTCON", 7, flags))
        assert s[at.IRQ_AT] == (BASE if gie and enables & flags else at.NEVER)
        assert (s[at.INTCON], s[at.INTCON_UNKNOWN]) == (gie | enables << 3 | flags, 0)


@pytest.mark.parametrize(("option", "periods"), [(0xFF, 128), (0xF8, 1), (0xFB, 8), (0xF7, 1), (0x00, 1)])
def test_a_time_out_restarts_the_watchdog_and_clears_its_prescaler(option: int, periods: int) -> None:
    """With PSA set the prescaler multiplies the period by 1 to 128 (DS35007 register 2-2); 7 ms at least."""
    chip = AbstractChip(Image({}, 0x3FF5), CLOCK, SimulatorOptions())
    for anchor in (BASE - 5, BASE + 1000):
        s = loaded(chip)
        s[at.OPTION], s[at.SLEEPING], s[at.T0_AT] = option, 1, anchor
        s[at.PRESCALER], s[at.PRESCALER_UNKNOWN] = 5, 0xFF
        s[at.STATUS], s[at.STATUS_UNKNOWN] = 0x1F, 0x1F
        chip._hold(AssumedBits("WATCHDOG", 0, 0))
        assert (s[at.SLEEPING], s[at.STATUS], s[at.STATUS_UNKNOWN]) == (0, 0x07, 0x07)
        assert (s[at.PRESCALER], s[at.PRESCALER_UNKNOWN]) == ((0, 0) if option & 8 else (5, 0xFF))
        assert s[at.WDT_AT] == s[at.WDT_CLEARED] == BASE
        assert s[at.WDT_EARLIEST] == BASE + periods * 7000
        # The oscillator starts up for 1024 of its periods; TMR0 does not count before.
        assert s[at.CYCLE] == s[at.AWAKE_AT] == BASE + 256
        assert s[at.T0_AT] == max(anchor, BASE + 256)


# Flags and interrupts in doubt ----------------------------------------------------------------------------


def test_pins_of_unknown_level_put_the_flags_in_doubt_that_are_not_certainly_set() -> None:
    """RB0 sets INTF, a change of an input among RB4 to RB7 RBIF, and RA4 clocks TMR0 where T0CS is set."""
    chip = chip_of(" nop\n")
    rng = random.Random(1)
    pins = (1 << 3, 1 << 4, 1 << 5, 1 << 8, 1 << 9, 1 << 12)
    for _ in range(150):
        s = loaded(chip)
        unknown = sum(pin for pin in pins if rng.random() < 0.4)
        tris = rng.choice((0x1FFF, 0, 0x1FFF & ~(1 << 9), 1 << 9))
        option, flags, doubtful = rng.choice((0xFF, 0xDF)), rng.randrange(8), rng.randrange(8)
        s[at.PINS_UNKNOWN], s[at.TRIS], s[at.OPTION] = unknown, tris, option
        s[at.INTCON], s[at.INTCON_UNKNOWN], s[at.TMR0_UNKNOWN] = flags, doubtful, 0
        chip._doubt_flags()
        clocked = bool(unknown & 1 << 4) and option == 0xFF
        may = {INTF} if unknown & 1 << 5 else set()
        may |= {RBIF} if unknown & tris & (0xF << 9) else set()
        may |= {T0IF} if clocked else set()
        certain = flags & ~doubtful
        assert s[at.INTCON_UNKNOWN] == doubtful | sum(flag for flag in may if not flag & certain)
        assert s[at.TMR0_UNKNOWN] == (0xFF if clocked else 0)


def test_an_interrupt_is_in_doubt_where_some_chips_take_it_now_and_others_do_not() -> None:
    chip = AbstractChip(image(" nop\n"), CLOCK, SimulatorOptions(), write_us=10_000)
    rng = random.Random(2)
    found = {True: 0, False: 0}
    for _ in range(600):
        s = loaded(chip)
        gie, enables = rng.random() < 0.9, rng.randrange(16)
        flags, unknown = rng.randrange(8), rng.randrange(8)
        asleep, counts, writes = rng.random() < 0.1, rng.random() < 0.3, rng.random() < 0.3
        s[at.INTCON], s[at.INTCON_UNKNOWN] = gie << 7 | enables << 3 | flags, unknown
        s[at.SLEEPING], s[at.TMR0_UNKNOWN], s[at.PC] = asleep, 0x10 if counts else 0, 0x1123
        s[at.EE_DONE_AT] = BASE + 5 if writes else at.NEVER
        doubtful, certain = 0, False
        for enable, flag in ((RBIE, RBIF), (INTE, INTF), (T0IE, T0IF)):
            if enables << 3 & enable:
                open_ = unknown & flag or (flag == T0IF and counts)
                doubtful |= flag if open_ else 0
                certain |= bool(flags & flag) and not open_
        doubtful |= 0x08 if writes and enables << 3 & EEIE else 0
        expected = None
        if gie and not asleep and not certain and doubtful:
            expected = Use(at.USE_INTERRUPT, doubtful, 0x123)
        assert chip._interrupt_in_doubt() == expected
        found[expected is None] += 1
    assert min(found.values()) > 100
    exact = chip_of(" nop\n")
    s = loaded(exact)
    s[at.INTCON], s[at.INTCON_UNKNOWN], s[at.EE_DONE_AT] = GIE | EEIE, 0, BASE + 5
    assert exact._interrupt_in_doubt() is None, "the write ends in a known cycle"


# States relative to now -----------------------------------------------------------------------------------


def test_cells_and_slots_of_ram_and_back() -> None:
    """Known, unknown in some bits, wholly unknown and PHASED."""
    chip = chip_of(" nop\n")
    cells = (0x5A, 0x05 | 0xF0 << 8, ALL_UNKNOWN, 0x33 | CELL_PHASED, *range(64))
    first = chip.power_on()
    s = chip._load(ChipState(cells, first.rest))
    ram = s[0x0C:0x50].tolist()
    assert [slot & 0xFF for slot in ram] == [0x5A, 0x05, 0, 0x33, *range(64)]
    assert all(slot & at.NOT_WRITTEN for slot in ram)
    assert [slot >> at.UNKNOWN_SHIFT for slot in ram] == [0, 0xF0, 0xFF, at.PHASED, *[0] * 64]
    assert chip._canonical() == ChipState(cells, first.rest)


def test_times_count_from_now_and_what_is_over_says_nothing() -> None:
    chip = AbstractChip(Image({}, 0x3FF5), CLOCK, SimulatorOptions())
    s = loaded(chip)
    now = BASE + 1000
    s[at.CYCLE] = now
    ahead = {"IRQ_AT": 4, "T0_TICK": 5, "EE_DONE_AT": 6, "WDT_EARLIEST": 7, "AWAKE_AT": 8, "T0_AT": 9,
             "T0_HELD": 1, "WDT_AT": -10, "WDT_CLEARED": -999}  # fmt: skip
    for name, distance in ahead.items():
        s[getattr(at, name)] = now + distance
    state = chip._canonical()
    assert {name: state[name] - BASE for name in ahead} == ahead
    s = loaded(chip)
    s[at.CYCLE] = now
    for name in ahead:
        s[getattr(at, name)] = now - 3
    s[at.IRQ_AT] = s[at.T0_TICK] = s[at.EE_DONE_AT] = at.NEVER
    state = chip._canonical()
    assert (state["IRQ_AT"], state["T0_TICK"], state["EE_DONE_AT"]) == (at.NEVER,) * 3
    assert {state[name] for name in ("AWAKE_AT", "T0_AT", "T0_HELD")} == {BASE}
    assert {state[name] for name in ("WDT_AT", "WDT_CLEARED", "WDT_EARLIEST")} == {BASE - 3}
    assert s[at.CYCLE] == BASE


def test_without_a_watchdog_its_age_says_nothing() -> None:
    chip = chip_of(" nop\n")
    s = loaded(chip)
    s[at.CYCLE], s[at.WDT_AT], s[at.WDT_CLEARED] = BASE + 50, BASE + 7, BASE + 8
    state = chip._canonical()
    assert (state["WDT_AT"], state["WDT_CLEARED"]) == (BASE, BASE)


def test_what_counts_in_its_own_cycle_or_step_only() -> None:
    """An overflow seen ahead of it; the key of the EEPROM, for three cycles; a pin driven unwritten."""
    chip = chip_of(" nop\n", start=(("tmr0", 1),))

    def after(cycle: int, held: int = 0x1FFF, **slots: int) -> ChipState:
        s = loaded(chip)
        s[at.PINS_UNKNOWN] = 0x1FFF & ~held
        s[at.CYCLE] = BASE + cycle
        for name, value in slots.items():
            s[getattr(at, name)] = value
        return chip._canonical()

    assert after(5, T0_FLAGGED=BASE + 5, TMR0_UNKNOWN=0)["T0_FLAGGED"] == BASE
    assert after(5, T0_FLAGGED=BASE + 4, TMR0_UNKNOWN=0)["T0_FLAGGED"] == -1
    assert after(5, T0_FLAGGED=BASE + 5, TMR0_UNKNOWN=1)["T0_FLAGGED"] == -1
    for ago, left in ((0, 0), (1, 1), (2, 2), (3, 3), (4, 3), (400, 3)):
        assert after(500, EE_STEP=2, EE_STEP_AT=BASE + 500 - ago)["EE_STEP_AT"] == BASE - left
    assert after(500, EE_STEP=0, EE_STEP_AT=BASE + 499)["EE_STEP_AT"] == 0
    s = loaded(chip)
    s[at.CYCLE], s[at.DRIVEN_UNKNOWN] = BASE + 20, 1 << 6
    for pin in range(len(PINS)):
        s[at.DRIVEN_FROM + 2 * pin] = BASE + pin
    state = chip._canonical()
    assert {pin: state[f"DRIVEN_FROM_{pin}"] for pin in PINS} == dict.fromkeys(PINS, 0) | {
        PINS[6]: BASE + 6 - 20
    }
    cleared = after(1, EE_CELL=5, EE_BYTE=6)
    assert (cleared["EE_CELL"], cleared["EE_BYTE"]) == (0, 0), "nobody reads what the program has written"


def test_the_levels_of_the_stack_in_use_come_first_and_the_others_are_forgotten() -> None:
    """By the definition of a ring of eight (DS35007 section 2.4.1)."""
    chip = chip_of(" nop\n")
    for depth, top in product(range(9), range(8)):
        s = loaded(chip)
        s[at.STACK : at.STACK + 8] = range(100, 108)
        s[at.DEPTH], s[at.SP] = depth, top
        state = chip._canonical()
        pushed = [100 + (top - back) % 8 for back in range(depth, 0, -1)]
        assert [state[f"STACK{level}"] for level in range(8)] == pushed + [0] * (8 - depth)
        assert (state["SP"], state["DEPTH"]) == (depth % 8, depth)


# Runs -----------------------------------------------------------------------------------------------------


def test_a_sleeping_chip_is_run_for_the_assumed_instruction_only() -> None:
    chip = chip_of(" sleep\n nop\n")
    first = chip.power_on()
    outcome = chip.run(first, frozenset(), 50, (AssumedBits("TMR0_PHASE", 0, 0),))
    assert (outcome.cycles, outcome.rest[FIELD["SLEEPING"]], outcome.reason) == (1, 1, Reason.STOP)


# Many chips at once ---------------------------------------------------------------------------------------


def test_the_edges_of_many_chips_are_those_of_each_alone() -> None:
    """Levels are low, high and undriven, which counts as low; an edge that changes nothing is none."""
    chip = chip_of(" nop\n")
    rng = random.Random(3)
    rows, twice_found = 60, 0
    for _ in range(12):
        s = loaded(chip)
        chip._high = rng.randrange(1 << 13) & 0x60
        count = np.array([rng.randrange(MAX_LANE_EDGES + 1) for _ in range(rows)])
        changes = np.zeros((rows, MAX_LANE_EDGES), dtype=np.int64)
        for row, number in product(range(rows), range(MAX_LANE_EDGES)):
            pin, level = rng.choice((5, 6, 12)), rng.randrange(3)
            cycle = BASE + 1 + number * 3
            changes[row, number] = cycle << at.PACK_CYCLE | pin << at.PACK_PIN | level
        fit = np.array([rng.random() < 0.9 for _ in range(rows)])
        before = fit.copy()
        columns = chip._lane_edges(count, changes, fit)
        for row in range(rows):
            s[at.EDGE_COUNT] = count[row]
            chip._edges[:MAX_LANE_EDGES] = changes[row]
            alone = chip._changes()
            twice = len({edge[1:] for edge in alone}) < len(alone)
            twice_found += twice
            assert fit[row] == (before[row] and not twice)
            if not twice:
                made = [(int(at_[row]), *edge) for edge, at_ in columns.items() if at_[row] >= 0]
                assert sorted(made) == list(alone)
    assert twice_found > 20
    nothing = np.zeros(rows, dtype=bool)
    assert chip._lane_edges(count, changes, nothing) == {}, "none of them is compared"


@pytest.mark.parametrize("slot", ["USE_KIND", "WARN_COUNT", "SLEEPING", "OPTION_WRITES", "DRIVEN_UNKNOWN"])
def test_a_chip_that_ends_with_this_set_does_not_fit(slot: str) -> None:
    assert fits({getattr(at, slot): 1}) == [True, False]


@pytest.mark.parametrize(
    ("slot", "value", "fit"),
    [
        (at.INTCON, T0IF | INTF | RBIF, True), (at.INTCON, T0IE, False), (at.INTCON, EEIE, False),
        (at.INTCON, GIE, False), (at.T0_HELD, BASE + 9, False), (at.EE_DONE_AT, BASE + 9, False),
        (at.IRQ_AT, BASE + 1, False), (at.INTERRUPTS, 1, False), (at.PC, 5, False), (at.PC, 0x404, True),
        (at.EDGE_COUNT, MAX_LANE_EDGES, True), (at.EDGE_COUNT, MAX_LANE_EDGES + 1, False),
    ],
)  # fmt: skip
def test_chips_fit_that_differ_in_what_is_compared_only(slot: int, value: int, fit: bool) -> None:
    assert fits({slot: value}) == [True, fit]


def fits(changed: dict[int, int]) -> list[bool]:
    """Return which of two chips that stop at 4 fit: the second ends with these slots changed."""
    chip = chip_of(" nop\n" * 4)
    start = loaded(chip).copy()
    start[at.INTCON_UNKNOWN] = 0
    ends = np.array([start, start])
    ends[:, at.PC], ends[:, at.CYCLE] = 4, BASE + 4
    for slot, value in changed.items():
        ends[1, slot] = value
    changes = np.zeros((2, MAX_LANE_EDGES), dtype=np.int64)
    fit = np.ones(2, dtype=bool)
    return [bool(each) for each in chip._lanes(start, ends, changes, fit, frozenset([4, 9])).fit]


@pytest.mark.parametrize(
    ("body", "fit"), [("movf 0x30, w\n movwf EEDATA", False), ("movf EEDATA, w\n movwf 0x21", True)]
)
def test_a_chip_that_writes_an_unknown_byte_to_an_unknown_eedata_does_not_fit(body: str, fit: bool) -> None:
    chip = chip_of(f" {body}\n nop\n")
    values = np.array([[1], [2]], dtype=np.int64)
    lanes = chip.run_lanes(chip.power_on(), (0x20 - 0x0C,), values, frozenset([2]), 50)
    assert lanes.fit.tolist() == [fit, fit]


def test_the_bytes_that_many_chips_wrote_are_those_of_each_alone() -> None:
    """Known, unknown in some or all bits, PHASED, or not written: -1."""
    chip = chip_of(" nop\n" * 4)
    start = loaded(chip).copy()
    rng = random.Random(4)
    ends = np.array([start] * 8)
    ends[:, at.PC], ends[:, at.CYCLE] = 4, BASE + 4
    for row in ends:
        for slot in range(0x0C, 0x50):
            mask = rng.choice((0, 0xFF, rng.randrange(256), 0x0F | at.SOURCE_TMR0 << 8, at.PHASED))
            row[slot] = rng.randrange(256) | mask << at.UNKNOWN_SHIFT | rng.choice((0, at.NOT_WRITTEN))
    changes = np.zeros((8, MAX_LANE_EDGES), dtype=np.int64)
    lanes = chip._lanes(start, ends, changes, np.ones(8, dtype=bool), frozenset([4]))
    for row, cells in zip(ends, lanes.ram.tolist(), strict=True):
        chip._s[:] = row
        expected = [
            -1 if slot & at.NOT_WRITTEN else cell
            for slot, cell in zip(row[0x0C:0x50].tolist(), chip._cells(), strict=True)
        ]
        assert cells == expected
        phased = [cell for cell in cells if cell >= CELL_PHASED]
        assert len(phased) == sum(
            slot >> at.UNKNOWN_SHIFT == at.PHASED and not slot & at.NOT_WRITTEN
            for slot in row[0x0C:0x50].tolist()
        )


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
