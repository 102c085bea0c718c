"""Case splits over the contents of the EEPROM: what chips do for each, and one state for them all."""

from __future__ import annotations

import numpy as np
import pytest

from servogen.edges import PINS
from servogen.pic.device import RAM_FIRST
from servogen.prove import table_runs
from servogen.prove.chip import ALL_UNKNOWN, FIELDS, AbstractChip, ChipState
from servogen.prove.table_runs import TableRunner, join_rests
from servogen.prove.tables import VALUES, ByteTable, Ints, Place, UndecidedTrims, addresses_of, along, spread
from servogen.prove.trim_states import TrimState
from servogen.prove.trim_time import PassingTime, at_any_time
from servogen.simulator import SimulatorOptions, layout
from tests.prove.chip_states import fields, rest
from tests.prove.test_abstract import OUTPUTS
from tests.simulator.helpers import CLOCK, image

BYTE = np.arange(VALUES)
FIRST, SECOND, SUM, COPY, COUNT, HIGH = (address - RAM_FIRST for address in range(0x20, 0x26))
RB1 = PINS.index("RB1")
"""Places of the program's bytes."""
PROGRAM = f"""{OUTPUTS}
 movf 0x20, w
 movwf 0x23
 addwf 0x21, w
 movwf 0x22
 btfsc 0x20, 7
 movwf 0x25
 movlw 7
 andwf 0x20, w
 addlw 1
 movwf 0x24
loop decfsz 0x24, f
 goto loop
 bsf PORTB, 1
stop nop
"""
STOP = 17
LOW = BYTE & 7


def runner_of(program: str = PROGRAM) -> tuple[TableRunner, ChipState]:
    """A program up to `STOP`, and the state after power-on: nothing in the RAM is known."""
    chip = AbstractChip(image(program), CLOCK, SimulatorOptions(), any_eeprom=True)
    return TableRunner(chip, frozenset({STOP}), 10_000), chip.power_on()


def split(place: int, values: Ints, address: int = 3) -> dict[Place, ByteTable]:
    """A place with a table of one byte of the EEPROM."""
    return {place: ByteTable((address,), values)}


def known(start: ChipState, cells: dict[int, int]) -> ChipState:
    """A start with some known bytes in the RAM."""
    return ChipState(tuple(cells.get(place, cell) for place, cell in enumerate(start.ram)), start.rest)


def test_each_content_of_a_byte_has_its_run() -> None:
    """4 and 10 cycles, 3 for each turn of the loop, 2 for its end, 1 for the rise: DS35007 table 7-2."""
    runner, start = runner_of()
    runs = runner.run(known(start, {SECOND: 5, HIGH: 9}), split(FIRST, BYTE))
    assert runs.joinable and runs.is_exact and runs.addresses == (3,)
    assert runs.cycles.tolist() == (17 + 3 * LOW).tolist()
    assert runs.written[SUM].tolist() == [(value + 5) % 256 for value in BYTE]
    assert runs.written[HIGH].tolist() == [9] * 128 + [(value + 5) % 256 for value in range(128, 256)]
    assert FIRST not in runs.written
    assert [*runs.edges] == [RB1] and runs.edges[RB1].fall is None
    rise = runs.edges[RB1].rise
    assert rise is not None and (rise - rise[0]).tolist() == (3 * LOW).tolist()


def test_contents_for_which_the_tables_say_the_same_are_run_once_and_starts_share_runs() -> None:
    runner, start = runner_of()
    table = split(FIRST, LOW)
    plain = known(start, {SECOND: 5})
    first = runner.run(plain, table)
    assert runner.count == 8
    # Nothing reads 0x30, and another byte of the EEPROM would say the same values: neither is run again.
    again = runner.run(known(plain, {0x30 - RAM_FIRST: 1}), table)
    assert runner.count == 8 and again.cycles.tolist() == first.cycles.tolist()
    assert runner.run(plain, split(FIRST, 7 - LOW)).written[SUM].tolist() == (12 - LOW).tolist()
    assert runner.count == 8
    # 0x21 is read: with another value each is run.
    other = runner.run(known(start, {SECOND: 6}), table)
    assert runner.count == 16 and other.written[SUM].tolist() == (6 + LOW).tolist()
    assert runner.written == {SUM, COPY, COUNT}
    # What is split in one frame is so in others, where it is constant: they share runs.
    runner.run(start, split(FIRST, LOW) | split(SECOND, 5 + LOW))
    before = runner.count
    runner.run(plain, split(FIRST, 0 * BYTE))
    assert runner.count == before, "0 and 5 have been run"


def test_starts_that_shared_runs_no_longer_do_once_a_run_reads_where_they_differ() -> None:
    """0x26 is read with bit 7 of 0x20 only; the contents of the first split have it clear."""
    runner, start = runner_of(PROGRAM.replace("movwf 0x25", "addwf 0x26, f"))
    one, two = (known(start, {SECOND: 0, HIGH + 1: value}) for value in (1, 2))
    runner.run(one, split(FIRST, LOW))
    for start, value in ((two, 2), (one, 1)):
        runs = runner.run(start, split(FIRST, BYTE))
        assert runs.written[HIGH + 1].tolist() == [value] * 128 + [(value + b) % 256 for b in BYTE[128:]]


def test_every_pair_of_two_bytes_is_run() -> None:
    runner, start = runner_of()
    pairs = split(SECOND, BYTE, 2) | split(FIRST, LOW, 5)
    runs = runner.run(start, pairs)
    assert runs.addresses == (2, 5) and runner.count == 256 * 8
    assert runs.cycles[77, 12] == 17 + 3 * 4 and runs.written[SUM][200, 63] == (200 + 7) % 256
    after = TrimState(start.ram, start.rest, tables=pairs).joined(runs)
    assert after.tables.keys() == {FIRST, SECOND, SUM, COPY}
    # The sum is of both bytes, and with it the copy: they have one pairing.
    pairings = {after.tables[place].pairing for place in (SUM, COPY)}
    assert len(pairings) == 1 and None not in pairings
    assert (after.tables[COPY].values == spread(pairs[FIRST], (2, 5))).all()
    assert after.ram[SUM] == ALL_UNKNOWN
    # Their next runs are one for each row, and no pair is told apart that was one row.
    both: dict[Place, ByteTable] = {FIRST: after.tables[COPY], SECOND: after.tables[SUM]}
    further = runner.run(start, both)
    assert runner.count == 2 * 256 * 8
    assert further.written[SUM][200, 63] == (7 + 207) % 256
    # Another visit of the same runs: places of both are no case split, for the rows are of different pairs.
    once_more = TrimState(start.ram, start.rest).joined(runner.run(start, pairs))
    assert once_more.tables[SUM].pairing is not after.tables[SUM].pairing


def test_places_that_depend_on_each_others_bytes_share_no_runs() -> None:
    runner, start = runner_of()
    high = BYTE // 128
    for first, second in ((2, 5), (5, 2)):
        runs = runner.run(start, split(FIRST, high, first) | split(SECOND, high, second))
        of_first = runs.addresses.index(first)
        assert runs.written[COPY][200, 0] == (of_first == 0)
        assert runs.written[COPY][0, 200] == (of_first == 1)
    assert runner.count == 2 * 4


def test_a_constant_that_is_of_one_byte_shares_no_runs_with_a_table_of_the_other() -> None:
    """HIGH is added too; what is split only there is constant, as of the first byte, in the other runs."""
    runner, start = runner_of(PROGRAM.replace("movwf 0x25", "addwf 0x25, w"))
    high = BYTE // 128
    for _ in range(2):
        runs = runner.run(known(start, {HIGH: 0}), split(FIRST, high, 2) | split(SECOND, 3 * high, 5))
        assert runs.written[SUM][200, 200] == 1 + 3
        runner.run(known(start, {SECOND: 0}), split(FIRST, high, 2) | split(HIGH, 3 * high, 5))


def test_where_something_unknown_decides_there_is_nothing_to_join() -> None:
    """0x20 does in the BTFSC; its place is among those that were read."""
    runner, start = runner_of()
    runs = runner.run(start, split(SECOND, BYTE))
    assert not runs.joinable and FIRST in runs.table.read
    away = PROGRAM.replace("btfsc 0x20, 7\n movwf 0x25", "btfsc 0x20, 7\n goto stop")
    chip = AbstractChip(image(away + " nop\n"), CLOCK, SimulatorOptions(), any_eeprom=True)
    ends = TableRunner(chip, frozenset({STOP - 3, STOP}), 10_000)
    assert not ends.run(chip.power_on(), split(FIRST, BYTE)).joinable, "at two addresses"


def test_what_is_copied_without_being_split_is_known_once_it_is() -> None:
    text = PROGRAM.replace("andwf 0x20, w", "andlw 0").replace("btfsc 0x20, 7\n movwf 0x25", "nop\n nop")
    runner, start = runner_of(text)
    state = TrimState(start.ram, start.rest, split(FIRST, LOW))
    vague = state.joined(runner.run(known(start, {SECOND: 5}), {}))
    assert vague.is_vague(COPY) and vague.is_vague(SUM) and not vague.is_vague(FIRST)
    told = vague.completed(runner.run(known(start, {SECOND: 5}), split(FIRST, LOW)))
    assert told.tables[COPY].values.tolist() == LOW.tolist()
    assert told.tables[SUM].values.tolist() == (LOW + 5).tolist()
    one = vague.completed(runner.run(start, split(FIRST, 3 + 0 * BYTE)))
    assert one.ram[COPY] == 3 and one.is_vague(SUM)


def test_too_many_equivalence_classes_are_not_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    alone, pair = split(FIRST, LOW), split(FIRST, LOW) | split(SECOND, LOW // 4, 9)
    for most, tables in (((1, 7, 8), alone), ((1, 8, 7), pair)):
        monkeypatch.setattr(table_runs, "MAX_CLASSES", most)
        runner, start = runner_of()
        with pytest.raises(UndecidedTrims) as undecided:
            runner.run(start, tables)
        assert str(undecided.value) == "byte 3 of the EEPROM makes too many different values"


def test_two_states_beside_the_ram_become_one_that_contains_both() -> None:
    one = rest(W=0b1100, STATUS=0b101, TMR0=4, INTCON=4)
    assert join_rests(one, one) == one
    other = rest(W=0b1010, STATUS=0b100, TMR0=9, INTCON=0)
    both = join_rests(one, other)
    assert fields(both, "W", "W_UNKNOWN", "STATUS", "STATUS_UNKNOWN") == [0b1000, 0b0110, 0b100, 0b001]
    assert fields(both, "TMR0", "INTCON") == [4, 4], "the time is that of one of them"
    assert join_rests(one, rest(W=0b1100, PC=1, STATUS=0b101)) == (), "at another address"
    some = rest(W=0b1100, W_UNKNOWN=0b0011)
    # What is unknown in one of them is unknown, and W's lower bits with it.
    both = join_rests(some, rest(W=0b1111))
    assert fields(both, "W", "W_UNKNOWN") == [0b1100, 0b0011]
    for name in ("EEADR", "LATCH", "TRIS"):
        assert join_rests(rest(), rest(**{name: 1})) == (), name


def test_values_of_one_byte_are_spread_over_pairs() -> None:
    first, second = along(BYTE, 0, 2), along(BYTE, 1, 2)
    assert first.shape == (256, 256) and first[3, 7] == 3 and second[3, 7] == 7
    assert along(BYTE, 0, 1).tolist() == BYTE.tolist()
    table = ByteTable((5,), BYTE)
    assert spread(table, (5,)) is BYTE
    assert spread(table, (2, 5))[3, 7] == 7 and spread(table, (5, 9))[3, 7] == 3
    assert addresses_of([table, ByteTable((2,), BYTE), table]) == (2, 5)


TIMER = {
    "T0_AT": 5,
    "TMR0": 7,
    "TMR0_UNKNOWN": 1,
    "T0_TICK": 9,
    "T0_FLAGGED": 3,
    "T0_HELD": 4,
    "PRESCALER": 2,
}
TIMER |= {"PRESCALER_UNKNOWN": 4}
"""All that `core/timer.h` counts TMR0 with."""


def test_nothing_is_known_of_the_timer_at_any_time() -> None:
    assert {name for name in FIELDS if name.startswith(("T0", "TMR0", "PRESCALER"))} == TIMER.keys()
    plain = at_any_time(rest(W=5))
    for name, value in TIMER.items():
        assert at_any_time(rest(W=5, **{name: value})) == plain, name
    for flag in (layout.T0IF, layout.INTF, layout.RBIF):
        assert at_any_time(rest(W=5, INTCON=flag)) == plain, flag
    assert at_any_time(rest(W=6)) != plain and at_any_time(rest(W=5, INTCON=layout.GIE)) != plain
    assert fields(plain, "TMR0_UNKNOWN", "PRESCALER_UNKNOWN", "T0_TICK") == [0xFF, 0xFF, layout.NEVER]


def test_the_time_is_that_of_a_chip_that_waits_unless_pins_are_counted() -> None:
    """With T0CS TMR0 counts edges of RA4 (DS35007 section 5.1), which a program may make."""
    idle = AbstractChip(image(" nop\n" * 20), CLOCK, SimulatorOptions(start=(("tmr0", 5),)), held={4: 0})
    names = "TMR0", "TMR0_UNKNOWN", "INTCON_UNKNOWN", "RB_OLD_UNKNOWN"
    for option, told in ((layout.PSA, [15, 0]), (layout.PSA | layout.T0CS, [0, 0xFF])):
        start = idle.power_on()
        start = ChipState(start.ram, changed(start.rest, OPTION=option))
        later = PassingTime(idle).with_time_after(TrimState(start.ram, start.rest), 10, start.rest)
        assert fields(later, *names) == [*told, 7, layout.RB4_TO_7], option
        assert fields(later, "PC", "W_UNKNOWN") == fields(start.rest, "PC", "W_UNKNOWN")


def changed(state: tuple[int, ...], **values: int) -> tuple[int, ...]:
    """A state beside the RAM with other values in some fields."""
    return tuple(values.get(name, value) for name, value in zip(FIELDS, state, strict=True))
