"""The checker's chip function by function: pins, registers, timers, interrupts, and where a run stops.

Each expected value is from the data sheet, or from a model that looks at one pin or one cycle at a time.
"""

from __future__ import annotations

import random

import numpy as np
import pytest

from servogen.checker import chip, layout
from servogen.checker.layout import UNKNOWN
from servogen.pic.image import Image
from servogen.pic.isa import encode
from tests.campaigns import sampled
from tests.checker import functions, lockstep
from tests.checker.lockstep import NO_EDGES

MOVES = 1 << 16
GIE, EEIE, T0IE, INTE, RBIE, T0IF, INTF, RBIF = (0x80 >> bit for bit in range(8))
"""INTCON from bit 7 down: DS35007 register 2-3."""
NOTHING = lockstep.board(1 << 60)
AT = 100
"""The cycle of the instructions here."""


def edges(*rows: tuple[int, int]) -> tuple[chip.Ints, chip.Ints]:
    """Return the cycles of edges, and the levels of all pins after each."""
    cycles, levels = zip(*rows, strict=True) if rows else ((), ())
    return np.array(cycles, dtype=np.int64), np.array(levels, dtype=np.int64)


def resting(**slots: int) -> chip.Ints:
    """Return a chip in cycle 100 with everything known to be 0, no event due, and these slots."""
    s = np.zeros(layout.SLOTS, dtype=np.int64)
    s[layout.CHOSEN], s[layout.CYCLE] = UNKNOWN, AT
    s[layout.OPTION] = layout.PSA
    for name, value in slots.items():
        s[getattr(layout, name)] = value
    return s


# Pins -----------------------------------------------------------------------------------------------------


def read_pin(s: chip.Ints, board: layout.ChipSurroundings, pin: int) -> int | None:
    """Return the level of one pin (bit of a 13-bit word), None if it is unknown."""
    port, bit = (layout.PORTA, pin) if pin < 5 else (layout.PORTB, pin - 5)
    latch, doubt = int(s[port]) >> bit & 1, int(s[port]) >> 8 + bit & 1
    output = not int(s[port + layout.BANK_1]) >> bit & 1
    if output and pin == 4 and latch and not board.channels >> 4 & 1:
        output = False  # an open drain: DS35007 section 4.1
    if output:
        return None if doubt else latch
    return board.levels >> pin & 1 if board.held >> pin & 1 else None


def test_a_port_is_read_pin_by_pin() -> None:
    rng = random.Random(5)
    word = 0x1FFF
    for _ in range(300):
        s = resting()
        for port, mask in ((layout.PORTA, 0x1F), (layout.PORTB, 0xFF)):
            doubt = rng.getrandbits(8) & rng.getrandbits(8) & mask
            s[port] = rng.getrandbits(8) & mask & ~doubt | doubt << 8
            s[port + layout.BANK_1] = rng.getrandbits(8) & mask
        board = NOTHING._replace(
            channels=rng.getrandbits(13), held=rng.getrandbits(13) & word, levels=rng.getrandbits(13)
        )
        for port, first, count in ((layout.PORTA, 0, 5), (layout.PORTB, 5, 8)):
            cell = functions.read(s, board, port)
            assert cell >> 8 & cell & 0xFF == 0
            found = [None if cell >> 8 + bit & 1 else cell >> bit & 1 for bit in range(8)]
            pins = [read_pin(s, board, first + bit) for bit in range(count)]
            assert found == pins + [0] * (8 - count)  # RA5 to RA7 are not there


def test_registers_beside_the_ports_are_read_as_they_are() -> None:
    s = resting(PC=0x1FE, FSR=0x12, EEDATA=0x3400, PCLATH=0x15, TMR0=10, EECON1=0x0800, OPTION=0xC8)
    assert functions.read(s, NOTHING, layout.PCL) == 0xFF  # of the next instruction
    s[layout.PC] = 0x1FF
    assert functions.read(s, NOTHING, layout.PCL) == 0
    for name in ("FSR", "EEDATA", "PCLATH", "EECON1", "OPTION"):
        assert functions.read(s, NOTHING, getattr(layout, name)) == s[getattr(layout, name)]
    assert functions.read(s, NOTHING, layout.TMR0) == 10
    assert functions.read(s, NOTHING, layout.NOWHERE) == 0


@pytest.mark.parametrize(("timer", "doubt"), [(0, 0), (UNKNOWN, T0IF), (MOVES, T0IF)])
def test_a_flag_that_is_set_stays_so_and_t0if_is_unknown_where_tmr0_is(timer: int, doubt: int) -> None:
    for intcon, its_doubt in ((0xF8, 3), (0x07, 0), (0x00, 7), (0xA4, 3), (0x80, T0IF | 3)):
        s = resting(INTCON=intcon | its_doubt << 8, TMR0=timer)
        cell = functions.read(s, NOTHING, layout.INTCON)
        unknown = (doubt & ~intcon) | its_doubt
        assert cell == intcon & ~unknown | unknown << 8


# Timer and watchdog ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("ps", sampled(range(8), 3))
def test_tmr0_counts_once_in_2_to_256_cycles_from_the_third_after_a_write(ps: int) -> None:
    """DS35007 section 5 and register 2-2; the cycle in which T0IF is seen: DS30430 figure 6-4."""
    ratio = 2 << ps
    s = resting(OPTION=ps)
    assert functions.write(s, np.zeros(66, np.int64), NOTHING, layout.TMR0, 250) == layout.GOES_ON
    for cycle in range(1, 3 + (6 + 256) * ratio + 2):
        functions.tick(s)
        assert s[layout.TMR0] == (250 + max(0, cycle - 3) // ratio) % 256
        assert bool(s[layout.INTCON] & T0IF) == (cycle >= 3 + 6 * ratio - 1)
        assert s[layout.STILL] == max(0, 3 - cycle)
    s[layout.INTCON] = 0
    functions.tick(s, 256 * ratio - 3)
    assert s[layout.INTCON] == 0
    functions.tick(s)
    assert s[layout.INTCON] == T0IF  # 256 counts later


def test_a_write_of_tmr0_whose_count_was_unknown_leaves_t0if_unknown() -> None:
    for before in (UNKNOWN, MOVES):
        s = resting(TMR0=before, INTCON=T0IE)
        functions.write(s, np.zeros(66, np.int64), NOTHING, layout.TMR0, 5)
        assert s[layout.INTCON] == T0IE | T0IF << 8
    s = resting(INTCON=T0IE | T0IF)
    functions.write(s, np.zeros(66, np.int64), NOTHING, layout.TMR0, 5)
    assert s[layout.INTCON] == T0IE | T0IF


@pytest.mark.parametrize("bit", range(8))
@pytest.mark.parametrize("before", [0x00, 0xFF])
def test_a_change_of_tmr0s_clock_makes_its_count_unknown_and_other_bits_of_option_do_not(
    bit: int, before: int
) -> None:
    """T0CS is bit 5, PSA 3, PS2 to PS0 are 2 to 0: DS35007 register 2-2."""
    s = resting(OPTION=before, STILL=1, TMR0=50, PRESCALER=1)
    option = before ^ 1 << bit
    assert functions.write(s, np.zeros(66, np.int64), NOTHING, layout.OPTION, option) == layout.GOES_ON
    after = s[[layout.OPTION, layout.TMR0, layout.STILL, layout.PRESCALER]].tolist()
    assert after == [option, *([UNKNOWN, 0, 0] if bit in (0, 1, 2, 3, 5) else [50, 1, 1])]


WATCHED = NOTHING._replace(watchdog=7000)


@pytest.mark.parametrize(
    ("option", "then", "due"),
    [
        (0x00, None, 7000),  # the prescaler is TMR0's
        (0x07, None, 7000),
        (0x08, None, 7000),
        (0x0B, None, 7000 * 8),
        (0x0F, None, 7000 * 128),
        (0x0F, 0x0B, 7000),  # its count may not be 0: PSA may have been set since CLRWDT
        (0x0F, 0x07, 7000),
        (0x07, 0x0F, 7000),
        (0x0F, 0x1F, 7000 * 128),  # another bit
    ],
)
def test_when_the_watchdog_of_some_chip_may_time_out(option: int, then: int | None, due: int) -> None:
    s = resting(OPTION=option)
    if then is not None:
        functions.write(s, np.zeros(66, np.int64), WATCHED, layout.OPTION, then)
    for age, why in ((due - 1, layout.GOES_ON), (due, layout.WATCHED), (2 * due, layout.WATCHED)):
        s[layout.AGE] = age
        assert functions.events(s, NO_EDGES, WATCHED) == why
        assert functions.events(s, NO_EDGES, NOTHING) == layout.GOES_ON  # no watchdog


# Interrupts -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "intcon",
    [
        GIE | T0IE | T0IF,
        0xFF,
        GIE | T0IE,
        GIE | T0IF,
        T0IE | T0IF,
        0x5B,
        0,
        GIE | INTE | INTF,
        GIE | RBIE | RBIF,
        GIE | INTE | RBIF,
        GIE | RBIE | INTF,
    ],
)
@pytest.mark.parametrize("before", [0, 1, 2])
def test_an_interrupt_is_sampled_by_gie_and_a_flag_with_its_enable_bit(intcon: int, before: int) -> None:
    """What was sampled in an earlier cycle stays so, whatever becomes of the flags (DS30430 figure 8-17)."""
    s = resting(INTCON=intcon, SAMPLED=before)
    functions.tick(s)
    asked = any(intcon & bits == bits for bits in (0xA4, 0x92, 0x89))
    assert s[layout.SAMPLED] == (before + 1 if before else int(asked))


@pytest.mark.parametrize(("sampled", "later"), [(0, None), (1, None), (2, 2), (3, 1)])
def test_an_interrupt_is_entered_three_cycles_after_it_was_sampled(sampled: int, later: int | None) -> None:
    s = resting(INTCON=GIE | T0IE | T0IF, SAMPLED=sampled, PC=0x123, DEPTH=2)
    why = functions.events(s, NO_EDGES, NOTHING)
    state = s[[layout.PC, layout.DEPTH, layout.STACK + 2, layout.CYCLE, layout.SAMPLED]].tolist()
    if later:
        assert (why, state) == (layout.INTERRUPTED, [4, 3, 0x123, AT + later, 0])
        assert s[layout.INTCON] == T0IE | T0IF
    else:
        assert (why, state) == (layout.GOES_ON, [0x123, 2, 0, AT, sampled])


@pytest.mark.parametrize(
    ("option", "timer"),
    [
        (layout.PSA, 2),
        (layout.PSA | 1, UNKNOWN),
        (0, UNKNOWN),
        (layout.PSA | layout.T0CS, UNKNOWN),
    ],
    ids=["the same clock", "another ratio", "the prescaler", "the pin"],
)
def test_an_interrupt_tells_tmr0_unless_its_clock_has_just_changed(option: int, timer: int) -> None:
    """The overflow may be of the clock before. Else 00h came a cycle ago, and the entry takes one."""
    s = resting(STAGE=layout.WATCHES, INTCON=GIE | T0IE, TMR0=UNKNOWN)
    functions.write(s, np.zeros(66, np.int64), NOTHING, layout.OPTION, option)
    s[layout.DOUBTED] = s[layout.WAY] = T0IF
    assert functions.events(s, NO_EDGES, NOTHING) == layout.INTERRUPTED
    assert s[layout.TMR0] == timer


@pytest.mark.parametrize(("depth", "why"), [(7, layout.INTERRUPTED), (8, layout.OVERFLOW)])
def test_an_interrupt_needs_a_free_level_of_the_stack(depth: int, why: int) -> None:
    s = resting(INTCON=GIE | T0IE | T0IF, SAMPLED=2, DEPTH=depth)
    assert functions.events(s, NO_EDGES, NOTHING) == why


@pytest.mark.parametrize(
    ("intcon", "timer", "eecon1", "doubted"),
    [
        (GIE | INTE, 0, 0, INTF),
        (GIE | RBIE, 0, 0, RBIF),
        (GIE | RBIE | INTE | T0IE, UNKNOWN, 0, RBIF | INTF | T0IF),
        (INTE | RBIE | T0IE, UNKNOWN, 0, 0),
        (GIE | T0IE, 0, 0, 0),
        (GIE | T0IE, UNKNOWN, 0, T0IF),
        (GIE | T0IE, MOVES, 0, T0IF),
        (GIE, UNKNOWN, layout.WR, 0),
        (GIE | EEIE, 0, 0, 0),
        (GIE | EEIE, 0, layout.WR, layout.WRITE_OVER),
        (EEIE, 0, layout.WR, 0),
    ],
)
def test_a_flag_that_may_be_set_in_an_instruction_may_interrupt_after_it(
    intcon: int, timer: int, eecon1: int, doubted: int
) -> None:
    """After the instruction, and once only, and also if the instruction clears GIE (DS30430 figure 8-17)."""
    cells = {"INTCON": intcon | 0x0300, "TMR0": timer, "EECON1": eecon1}
    clears_gie = encode("BCF", f=0x0B, b=7)
    _, s, _ = run([clears_gie], WRITE_LEFT=9, **cells)
    assert s[layout.DOUBTED] == doubted
    if doubted:
        assert functions.events(s, NO_EDGES, NOTHING) == layout.MAY_INTERRUPT
        ways = layout.NOTHING | doubted | doubted << layout.IS_NOP
        assert s[layout.ASKED_BITS] == ways
        for way in (1 << bit for bit in range(10) if ways >> bit & 1):
            its = s.copy()
            its[layout.WAY] = way
            why = functions.events(its, NO_EDGES, NOTHING)
            assert its[layout.DOUBTED] == its[layout.WAY] == 0
            assert why == (layout.GOES_ON if way == layout.NOTHING else layout.INTERRUPTED)
            cycles = 0 if way == layout.NOTHING else 1 if way & doubted else 2
            assert its[layout.CYCLE] == AT + 1 + cycles
            assert its[layout.PC] == (4 if cycles else 1)


# Events in order ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("slots", "limits", "why"),
    [
        ({"AGE": 7000}, {"watchdog": 7000}, layout.WATCHED),
        ({"AGE": 6999}, {"watchdog": 7000}, layout.GOES_ON),
        ({"DARK": 12}, {}, layout.DARK_PIN),
        ({"DARK": 11}, {}, layout.GOES_ON),
        ({}, {"limit": AT}, layout.TOO_LONG),
        ({}, {"limit": AT + 1}, layout.GOES_ON),
        ({"STAGE": layout.RUNS, "TIME": 40}, {"period": 40}, layout.NEW_FRAME),
        ({"STAGE": layout.RUNS, "TIME": 40}, {"period": 41}, layout.GOES_ON),
        ({"TIME": 40}, {"period": 1}, layout.GOES_ON),
        ({"AGE": 7000, "DARK": 12}, {"watchdog": 7000}, layout.WATCHED),
        ({"SAMPLED": 2, "STAGE": layout.RUNS, "TIME": 40}, {"period": 40}, layout.NEW_FRAME),
    ],
)
def test_a_run_stops_in_the_cycle_in_which_something_is_due(
    slots: dict[str, int], limits: dict[str, int], why: int
) -> None:
    assert functions.events(resting(**slots), NO_EDGES, NOTHING._replace(**limits)) == why


@pytest.mark.parametrize(("edge", "cycle", "why"), [(0, 39, layout.MISSING), (0, 40, layout.GOES_ON),
                                                     (1, 20, layout.GOES_ON), (1, 19, layout.MISSING),
                                                     (2, 5, layout.GOES_ON)])  # fmt: skip
def test_an_edge_is_missing_one_cycle_after_it_was_due(edge: int, cycle: int, why: int) -> None:
    """In cycle 40 of the frame, or 20: an edge there is made by the next instruction."""
    at, _ = edges((cycle if edge == 0 else 0, 1), (max(cycle, 30) if edge == 0 else cycle, 0))
    s = resting(STAGE=layout.RUNS, TIME=40 if edge != 1 else 20, EDGE=edge)
    assert functions.events(s, at, NOTHING._replace(period=200)) == why


# What is driven -------------------------------------------------------------------------------------------


def drive(edge_at: chip.Ints, edge_out: chip.Ints, channels: int = 0, **slots: int) -> tuple[int, chip.Ints]:
    s = resting(**slots)
    return functions.drive(s, edge_at, edge_out, NOTHING._replace(channels=channels)), s


@pytest.mark.parametrize("pin", range(13))
def test_the_first_rise_of_any_output_begins_the_frame(pin: int) -> None:
    """Its first edge is in cycle 7 of the frame, and the second in 9."""
    level = 1 << pin
    slots = {"PORTA": level & 0x1F, "PORTB": level >> 5}
    due = edges((7, level), (9, 0))
    why, s = drive(*due, **slots)
    assert (why, s[layout.STAGE], s[layout.TIME], s[layout.EDGE]) == (layout.GOES_ON, layout.RUNS, 7, 1)
    wrong, s = drive(*edges((7, 3 << 11 if pin < 11 else 3), (9, 0)), **slots)
    assert (wrong, s[layout.EDGE]) == (layout.WRONG_EDGE, 0)
    inputs = {"TRISA": level & 0x1F, "TRISB": level >> 5}
    why, s = drive(*due, **slots, **inputs)  # nothing is driven yet
    assert (why, s[layout.STAGE]) == (layout.GOES_ON, layout.BEFORE)
    why, s = drive(*due, channels=level, STAGE=layout.RUNS, EDGE=1, **slots, **inputs)
    assert why == layout.DARK_PIN  # a servo's pin must stay an output
    assert drive(*edges(), channels=level, STAGE=layout.RUNS, **inputs)[0] == layout.DARK_PIN
    assert drive(*edges(), channels=0x1FFF & ~level, STAGE=layout.RUNS, **inputs)[0] == layout.GOES_ON


@pytest.mark.parametrize(
    ("time", "edge", "level", "why", "after"),
    [
        (10, 0, 1, layout.GOES_ON, 1),
        (11, 0, 1, layout.WRONG_EDGE, 0),  # a cycle late
        (9, 0, 1, layout.WRONG_EDGE, 0),  # a cycle early
        (10, 0, 2, layout.WRONG_EDGE, 0),
        (10, 0, 0, layout.GOES_ON, 0),  # nothing changes
        (10, 1, 1, layout.GOES_ON, 1),
        (10, 1, 0, layout.WRONG_EDGE, 1),
        (30, 1, 0, layout.GOES_ON, 2),
        (30, 2, 0, layout.GOES_ON, 2),
        (30, 2, 1, layout.WRONG_EDGE, 2),  # one more than all
    ],
)
def test_an_edge_must_be_the_next_one_and_in_its_cycle(
    time: int, edge: int, level: int, why: int, after: int
) -> None:
    found, s = drive(*edges((10, 1), (30, 0)), STAGE=layout.RUNS, TIME=time, EDGE=edge, PORTA=level)
    assert (found, s[layout.EDGE], s[layout.TIME]) == (why, after, time)


def test_an_unknown_level_may_be_driven_for_ten_cycles_before_the_first_pulse_only() -> None:
    for slots in ({"PORTA": 0x0200}, {"PORTB": 0x8000}):
        why, s = drive(*edges((0, 1)), **slots)
        assert (why, s[layout.DARK]) == (layout.GOES_ON, 1)
        functions.tick(s, 10)
        assert functions.events(s, NO_EDGES, NOTHING) == layout.GOES_ON
        functions.tick(s)
        assert functions.events(s, NO_EDGES, NOTHING) == layout.DARK_PIN
        why, s = drive(*edges((0, 1)), DARK=3, **slots)
        assert s[layout.DARK] == 3  # since it began
        assert drive(*edges((0, 1)), STAGE=layout.RUNS, **slots)[0] == layout.DARK_PIN
        why, s = drive(*edges((0, 1)), TRISA=0x02, TRISB=0x80, DARK=3, **slots)
        assert (why, s[layout.DARK]) == (layout.GOES_ON, 0)


# Writes ---------------------------------------------------------------------------------------------------


def test_eecon1_keeps_eeif_wrerr_and_wren_and_starts_no_write_without_the_keys() -> None:
    """EEIF is bit 4, WRERR 3, WREN 2, WR 1, RD 0: DS35007 section 3."""
    cells = np.arange(66) + 0x40
    for value in range(256):
        s = resting(EEADR=0x3F, EEDATA=0x11, EECON1=0x0800)
        why = functions.write(s, cells, NOTHING, layout.EECON1, value)
        assert why == (layout.SEQUENCE if value & 0x02 else layout.GOES_ON)
        if why == layout.GOES_ON:
            assert s[layout.EECON1] == value & 0x1C
            assert s[layout.EEDATA] == (0x7F if value & 1 else 0x11)


@pytest.mark.parametrize(
    ("first", "second", "between", "before", "wren", "begins"),
    [
        (0x55, 0xAA, 2, 1, True, True),
        (0x55, 0xAA, 2, 1, False, False),
        (0x55, 0xAA, 3, 1, True, False),
        (0x55, 0xAA, 1, 1, True, False),
        (0x55, 0xAA, 2, 2, True, False),
        (0x54, 0xAA, 2, 1, True, False),
        (0x55, 0xAB, 2, 1, True, False),
        (0x55, 0xAA << 8, 2, 1, True, False),
    ],
)
def test_a_write_begins_after_its_keys_in_their_cycles(
    first: int, second: int, between: int, before: int, wren: bool, begins: bool
) -> None:
    """DS35007 section 3.2: MOVLW between the keys, nothing before WR, WREN already set."""
    cells, around = np.zeros(66, np.int64), NOTHING._replace(longest_write=20_000)
    s = resting(EECON1=layout.WREN if wren else 0)
    functions.write(s, cells, around, layout.EECON2, first)
    functions.tick(s, between)
    functions.write(s, cells, around, layout.EECON2, second)
    functions.tick(s, before)
    why = functions.write(s, cells, around, layout.EECON1, layout.WREN | layout.WR)
    assert (why == layout.GOES_ON) is begins
    assert cells[layout.EEPROM_WRITTEN] == begins
    if begins:
        functions.tick(s)
        assert s[layout.WRITE_LEFT] == 20_000
        functions.write(s, cells, around, layout.EECON1, 0)
        assert s[layout.EECON1] == layout.WR, "it cannot be cleared"
        functions.tick(s, 19_999)
        assert s[layout.EECON1] == layout.WR
        functions.tick(s)
        assert (s[layout.EECON1], s[layout.WRITE_LEFT]) == (layout.EEIF, 0)


@pytest.mark.parametrize(("address", "byte"), [(0, 0x40), (63, 0x7F), (64, UNKNOWN), (0xFF, UNKNOWN),
                                               (0x0100, UNKNOWN), (3 | MOVES, UNKNOWN)])  # fmt: skip
def test_a_cell_of_the_eeprom_is_read_at_a_known_address_below_64(address: int, byte: int) -> None:
    s = resting(EEADR=address)
    assert functions.write(s, np.arange(66) + 0x40, NOTHING, layout.EECON1, 1) == layout.GOES_ON
    assert s[layout.EEDATA] == byte
    assert functions.write(s, np.arange(66) + 0x40, NOTHING, layout.EECON1, 0x0800) == layout.GOES_ON
    assert s[layout.EECON1] == 0x0800


def test_intcon_is_written_with_its_flags_and_may_request_an_interrupt_from_the_next_cycle() -> None:
    none = np.zeros(66, np.int64)
    for value in range(256):
        s = resting()
        assert functions.write(s, none, NOTHING, layout.INTCON, value) == layout.GOES_ON
        assert s[layout.INTCON] == value | (3 & ~value) << 8  # the pins may set INTF and RBIF again at once
        asked = any(value & bits == bits for bits in (0xA4, 0x92, 0x89))
        functions.tick(s)
        assert s[layout.SAMPLED] == int(asked)
    s = resting()
    assert functions.write(s, none, NOTHING, layout.INTCON, 0xA0 | 0x0700) == layout.GOES_ON
    assert s[layout.INTCON] == 0xA0 | 0x0700


def test_other_registers_take_the_cell_and_what_does_not_exist_takes_nothing() -> None:
    none = np.zeros(66, np.int64)
    for slot in (layout.FSR, layout.EEDATA, layout.EEADR):
        for cell in (0xA5, 0x0F | 0xA000, 0x12 | MOVES):
            s = resting()
            assert functions.write(s, none, NOTHING, slot, cell) == layout.GOES_ON
            assert s[slot] == cell
    s = resting()
    assert functions.write(s, none, NOTHING, layout.NOWHERE, 0xA5) == layout.GOES_ON
    assert np.array_equal(s, resting())
    assert functions.write(s, none, NOTHING, layout.PCLATH, 0xFF) == layout.GOES_ON
    assert s[layout.PCLATH] == 0x1F
    assert functions.write(s, none, NOTHING, layout.PCLATH, 7 | MOVES) == layout.GOES_ON
    assert s[layout.PCLATH] == 0x1F00


def test_what_is_asked_is_the_lowest_unknown_bit() -> None:
    for bits in range(1, 256):
        s = resting()
        assert functions.ask(s, 0x20, bits) == layout.FORK
        lowest = next(1 << bit for bit in range(8) if bits >> bit & 1)
        assert s[[layout.ASKED, layout.ASKED_BITS]].tolist() == [0x20, lowest]
    assert functions.ask(resting(), 0x20, 0x100) == layout.PHASE  # a byte that moves has no bits to ask for


# Instructions ---------------------------------------------------------------------------------------------


def run(
    words: list[int], board: layout.ChipSurroundings | None = None, at: int = 0, **slots: int
) -> tuple[int, chip.Ints, chip.Ints]:
    """Run words from cycle 100 on, for one instruction each. Returns why it stopped, the chip, and `used`."""
    s, used = resting(PC=at, **slots), np.zeros(layout.SLOTS, dtype=np.int64)
    held = lockstep.memory(Image(dict(enumerate(words, at))))
    return chip.run(s, used, *edges(), held, board or NOTHING._replace(limit=AT + len(words))), s, used


def test_a_jump_by_an_unknown_carry_is_followed_both_ways() -> None:
    """RLF PCL,F: PCL holds the next address, 0x11, and the carry becomes its bit 0 (DS35007 section 9.1)."""
    for name, ways in (("RLF", (0x22, 0x23)), ("RRF", (0x08, 0x88))):
        word = [encode(name, f=2, d=1)]
        why, s, _ = run(word, at=0x10, STATUS=0x100)
        assert (why, s[layout.ASKED], s[layout.ASKED_BITS]) == (layout.FORK, layout.STATUS, 1)
        for carry, target in enumerate(ways):
            assert run(word, at=0x10, STATUS=carry)[1][layout.PC] == target


def test_option_and_tris_write_w() -> None:
    for word, slot, mask in (
        (encode("OPTION"), layout.OPTION, 0xFF),
        (encode("TRIS", f=5), layout.TRISA, 0x1F),
        (encode("TRIS", f=6), layout.TRISB, 0xFF),
    ):
        why, s, used = run([word], W=0xA5)
        assert (why, s[slot], s[layout.PC]) == (layout.TOO_LONG, 0xA5 & mask, 1)
        assert used[layout.W] == layout.READ
        assert run([word], W=0x0100)[0] == layout.REGISTER


@pytest.mark.parametrize(
    ("word", "slots", "slot", "bit"),
    [
        (encode("MOVF", f=0), {"FSR": 0x0600}, layout.FSR, 0x02),
        (encode("MOVF", f=1), {"STATUS": 0x2000}, layout.STATUS, 0x20),
        (encode("BTFSC", f=0x20, b=3), {"RAM": 0}, None, 0),
        (encode("BTFSC", f=0x0C, b=3), {"RAM": 0x0800}, 0x0C, 0x08),
        (encode("BTFSC", f=0x0C, b=3), {"RAM": 0xF700}, None, 0),
        (encode("DECFSZ", f=0x0C), {"RAM": 0x1801}, 0x0C, 0x08),
        (encode("DECFSZ", f=0x0C), {"RAM": 0x1800}, None, 0),  # 255, 247, 239 or 231
        (encode("ADDWF", f=2, d=1), {"W": 0x3000}, layout.W, 0x10),
        (encode("MOVWF", f=2), {"W": 5, "PCLATH": 0x0300}, layout.PCLATH, 0x01),
        (encode("MOVWF", f=2), {"W": 5, "PCLATH": 0x0200}, layout.PCLATH, 0x02),
        (encode("MOVWF", f=2), {"W": 5, "PCLATH": 0x1C00}, None, 0),  # 1024 words have ten bits of address
        (encode("BTFSS", f=5, b=2), {"TRISA": 0x04}, layout.CHOSEN, 0x04),
        (encode("BTFSS", f=6, b=7), {"TRISB": 0x80}, layout.CHOSEN, 0x80),
        (encode("BTFSS", f=11, b=1), {"INTCON": 0x0300}, layout.CHOSEN, 0x02),
        (encode("BTFSS", f=1, b=1), {"TMR0": UNKNOWN}, layout.CHOSEN, 0x02),
    ],
)
def test_a_bit_that_decides_the_way_is_asked_for(
    word: int, slots: dict[str, int], slot: int | None, bit: int
) -> None:
    why, s, _ = run([word], **slots)
    if slot is None:
        assert why == layout.TOO_LONG
    else:
        assert (why, s[layout.ASKED], s[layout.ASKED_BITS], s[layout.PC], s[layout.CYCLE]) == (
            layout.FORK, slot, bit, 0, AT)  # fmt: skip


@pytest.mark.parametrize("f", [*range(1, 0x10), 0x4F, 0x50, 0x7F])
def test_the_bank_must_be_known_where_the_two_have_different_registers(f: int) -> None:
    """Alike in both: PCL, STATUS, FSR, PCLATH, INTCON and the RAM; not there in either: 07h, from 50h on."""
    alike = f in (2, 3, 4, 10, 11) or 0x0C <= f <= 0x4F or f in (7, 0x50, 0x7F)
    assert (run([encode("MOVF", f=f, d=0)], STATUS=0x2000)[0] == layout.FORK) is not alike


@pytest.mark.parametrize("pin", range(13))
def test_an_input_of_the_schedule_is_asked_for_as_a_button(pin: int) -> None:
    f, bit = (5, pin) if pin < 5 else (6, pin - 5)
    inputs = {"TRISA": 0x1F, "TRISB": 0xFF}
    board = NOTHING._replace(limit=AT + 1, buttons=1 << pin)
    for word in (encode("BTFSC", f=f, b=bit), encode("MOVF", f=f, d=0)):
        why, s, _ = run([word], board, **inputs)
        slot = layout.PORTA if f == 5 else layout.PORTB
        assert (why, s[layout.ASKED], s[layout.ASKED_BITS]) == (layout.BUTTON, slot, 1 << bit)
        answered = {"CHOSEN": UNKNOWN & ~(1 << bit << 8) | 1 << bit}
        why, s, _ = run([word], board, **inputs, **answered)
        assert why == layout.TOO_LONG
        if word == encode("MOVF", f=f, d=0):
            mask = 0x1F if f == 5 else 0xFF
            assert s[layout.W] == 1 << bit | (mask & ~(1 << bit)) << 8
        else:
            assert s[layout.CYCLE] == AT + 1
        assert s[layout.CHOSEN] == UNKNOWN  # for this instruction only
    # A test of another bit, and a read that writes the port back, ask for nothing.
    other = encode("BTFSC", f=f, b=bit ^ 1)
    assert run([other], board, **inputs)[1][layout.ASKED_BITS] == (
        1 << (bit ^ 1) if bit ^ 1 < 5 or f == 6 else 0
    )
    assert run([other], board, **inputs)[0] != layout.BUTTON
    assert run([encode("MOVF", f=f, d=1)], board, **inputs)[0] != layout.BUTTON


def test_calls_and_returns_use_eight_levels() -> None:
    call = encode("CALL", k=0x155)
    for depth, why in ((0, layout.TOO_LONG), (7, layout.TOO_LONG), (8, layout.OVERFLOW)):
        found, s, _ = run([call], at=0x3FF, DEPTH=depth)
        assert found == why
        if why == layout.TOO_LONG:
            assert s[[layout.PC, layout.DEPTH, layout.STACK + depth, layout.CYCLE]].tolist() == [
                0x155,
                depth + 1,
                0,
                AT + 2,
            ]
    for depth, why in ((0, layout.EMPTY), (1, layout.TOO_LONG), (8, layout.TOO_LONG)):
        levels = {"STACK": 0x111} if depth == 1 else {}
        found, s, _ = run([encode("RETLW", k=0x77)], DEPTH=depth, **levels)
        assert found == why
        if depth == 1:
            assert s[[layout.PC, layout.DEPTH, layout.STACK, layout.CYCLE, layout.W]].tolist() == [
                0x111,
                0,
                0,
                AT + 2,
                0x77,
            ]


def test_clrwdt_restarts_the_watchdog_and_makes_to_and_pd_known() -> None:
    why, s, _ = run([encode("CLRWDT")], WATCHED._replace(limit=AT + 1), STATUS=0x1F00, OPTION=0x0A, AGE=50)
    assert (why, s[layout.STATUS], s[layout.AGE]) == (layout.TOO_LONG, 0x18 | 0x0700, 0)


def test_status_as_a_destination_keeps_to_and_pd_and_flags_of_the_instruction() -> None:
    """DS35007 section 2.3.1."""
    _, s, _ = run([encode("MOVWF", f=3)], W=0xE7, STATUS=0x08)
    assert s[layout.STATUS] == 0xEF
    _, s, _ = run([encode("CLRF", f=3)], STATUS=0xFB)
    assert s[layout.STATUS] == 0x1F
    _, s, _ = run([encode("MOVWF", f=3)], W=0xFF00, STATUS=0x08)
    assert s[layout.STATUS] == 0x08 | 0xE700
    _, s, _ = run([encode("MOVWF", f=3)], W=5 | MOVES, STATUS=0x10)
    assert s[layout.STATUS] == 0x10 | 0xE700
    _, s, _ = run([encode("IORWF", f=3, d=1)], W=0x47, STATUS=0x08)
    assert s[layout.STATUS] == 0x48


@pytest.mark.parametrize("f", [5, 6])
def test_a_port_takes_unknown_bits_and_a_direction_none(f: int) -> None:
    inputs = {"TRISA": 0x1F, "TRISB": 0xFF}
    why, s, _ = run([encode("MOVWF", f=f)], W=0x0A | 0xF500, **inputs)
    assert (why, s[f]) == (layout.TOO_LONG, 0x0A | (0x1500 if f == 5 else 0xF500))
    assert run([encode("MOVWF", f=f)], W=5 | MOVES, **inputs)[0] == layout.REGISTER
    bank_1 = {"STATUS": 0x20}
    assert run([encode("MOVWF", f=f)], W=0x0100, **bank_1)[0] == layout.REGISTER
    why, s, _ = run([encode("MOVWF", f=f)], W=0xFF, **bank_1)
    assert (why, s[f + layout.BANK_1]) == (layout.TOO_LONG, 0x1F if f == 5 else 0xFF)


def test_a_cut_is_passed_by_where_a_certificate_could_not_describe_the_state() -> None:
    """In cycle 0, before the first pulse, while TMR0 stands still, and with an interrupt on its way."""
    words = {0: encode("NOP"), 1: encode("NOP")}
    code = chip.program_code(Image(words), frozenset({0}))
    held = lockstep.memory(Image(words))._replace(code=code)

    def why(**slots: int) -> int:
        s = resting(**({"STAGE": layout.RUNS} | slots))
        board = NOTHING._replace(limit=int(s[layout.CYCLE]) + 1)
        return int(chip.run(s, np.zeros(layout.SLOTS, dtype=np.int64), *edges(), held, board))

    assert why() == why(CYCLE=1) == why(STAGE=layout.OVER) == why(INTCON=GIE | T0IE) == layout.CUT
    states = ({"CYCLE": 0}, {"STAGE": layout.BEFORE}, {"STILL": 1}, {"SAMPLED": 1}, {"KEY_1": 2},
              {"KEY_2": 1}, {"RESCALED": 1})  # fmt: skip
    assert {why(**state) for state in states} == {layout.TOO_LONG}
    assert why(INTCON=GIE | INTE | 0x0200) == layout.MAY_INTERRUPT  # after the instruction at the cut
    # Of a tape it can describe an EEPROM that gives a byte, once both lines are settled.
    giving = {"TAKES": layout.GIVING, "SEEN": layout.UNSURE}
    giving |= dict.fromkeys(("SCL_AGE", "SDA_AGE"), layout.SETTLED)
    for changed in ({}, {"SCL_AGE": 3}, {"SDA_AGE": 3}, {"SEEN": layout.UNREAD}):
        assert bool(chip.at_rest(resting(**(giving | changed)))) == (not changed)


def test_a_vector_that_c_would_read_wrongly_is_refused() -> None:
    s = resting()
    for wrong in (s.astype(np.int32), np.repeat(s, 2)[::2]):
        with pytest.raises(TypeError, match="a vector of the chip is of 64-bit integers"):
            chip.at_rest(wrong)


def test_the_last_edge_of_a_frame_stops_a_run_that_has_made_it() -> None:
    words = [encode("BSF", f=6, b=0), encode("NOP")]
    held = lockstep.memory(Image(dict(enumerate(words))))
    due = edges((10, 1 << 5))
    for edge, port, expected in ((0, 0, layout.LAST_EDGE), (1, 1, layout.TOO_LONG)):
        s = resting(STAGE=layout.RUNS, TIME=10, EDGE=edge, PORTB=port)
        found = chip.run(
            s, np.zeros(layout.SLOTS, dtype=np.int64), *due, held, NOTHING._replace(limit=AT + 2)
        )
        assert found == expected
        assert s[layout.CYCLE] == (AT + 1 if edge == 0 else AT + 2)
