"""States as a certificate lists them: their columns, when one contains another, and what a refusal says."""

from __future__ import annotations

import hashlib
import random
from typing import Any

import numpy as np
import pytest

from servogen.checker import check, chip, layout
from servogen.checker.certificate import (
    CELLS,
    FRAME_NUMBER,
    FREE,
    MAX_TEXT,
    NUMBERS,
    PLACE,
    WIDTH,
    Certificate,
    fingerprint,
)
from servogen.checker.check import COLUMNS, DUE, ORIGIN, Checker, Refused, check_certificate
from servogen.checker.layout import UNKNOWN
from servogen.checker.plan import PINS, Place, read_plan
from servogen.errors import InputError
from servogen.pic.image import Image
from tests.checker import certify, functions, lockstep

MOVES = 1 << 16
FRAME = 6
"""The address at which the frames of the test programs begin."""
PLAIN, SCHEDULE = certify.plain_program(), certify.schedule()


@pytest.fixture(scope="module")
def claim() -> dict[str, Any]:
    """The certificate of one servo, which has one state, as data."""
    data = certify.unpack(certify.certify(PLAIN, SCHEDULE, [FRAME]))
    (place,) = data["columns"]["place"]["delta"]
    return one_state(data | {"places": [data["places"][place]]}, place=0)


def one_state(claim: dict[str, Any], **columns: int) -> dict[str, Any]:
    """Return the certificate with other values of these columns."""
    return claim | {"columns": claim["columns"] | {name: {"all": value} for name, value in columns.items()}}


# Columns --------------------------------------------------------------------------------------------------

LARGEST = {"option": 0xFF, "trisa": 0x1F, "trisb": 0xFF, "pc": 0x3FF, "depth": 8, "prescaler": 0xFF,
           "watchdog_age": 1 << 40, "write_left": 1 << 30, "tape_clock": 9 << 16,
           "time": 1 << 30, "frame": 1 << 30, "place": 0,
           **{f"stack{level}": 0x3FF for level in range(8)}}  # fmt: skip
"""Of each column of numbers: docs/proof.md. The certificate here has one place."""


@pytest.mark.parametrize("name", LARGEST)
def test_a_number_is_within_its_range(claim: dict[str, Any], name: str) -> None:
    assert LARGEST.keys() == NUMBERS.keys()
    least = {"frame": -2, "time": -(1 << 30)}.get(name, 0)
    for value in (least, LARGEST[name]):
        states = certify.reread(one_state(claim, eecon1=layout.WR, **{name: value})).states
        slot = NUMBERS[name][0]
        assert states[0, slot] == value
    for value in (least - 1, LARGEST[name] + 1):
        with pytest.raises(InputError, match=f"column {name}"):
            certify.reread(one_state(claim, **{name: value}))


MAY_BE_UNKNOWN = {"w": 0xFF, "status": 0xFF, "fsr": 0xFF, "porta": 0x1F, "portb": 0xFF, "eedata": 0xFF,
                  "eeadr": 0xFF, "pclath": 0x1F, "intcon": 0x07, "eecon1": 0x08, "tmr0": 0xFF,
                  "ram.0c": 0xFF, "ram.4f": 0xFF}  # fmt: skip
MAY_MOVE = {"w", "fsr", "eedata", "eeadr", "tmr0", "ram.0c", "ram.4f"}


@pytest.mark.parametrize("name", MAY_BE_UNKNOWN)
def test_a_cell_has_a_value_unknown_bits_or_moves(claim: dict[str, Any], name: str) -> None:
    """Value | unknown bits << 8 | 1 << 16 if it moves with TMR0's phase; an unknown bit is 0 in the value."""
    good = [0, 0xFF, *(1 << bit + 8 for bit in range(8) if MAY_BE_UNKNOWN[name] >> bit & 1)]
    good += [MOVES, MOVES | 0xFF] if name in MAY_MOVE else []
    bad = [
        -1,
        0x101,
        0x8080,
        1 << 17,
        *(1 << bit + 8 for bit in range(8) if not MAY_BE_UNKNOWN[name] >> bit & 1),
    ]
    bad += [MOVES | 0x100, MOVES | 0x8000] if name in MAY_MOVE else [MOVES, MOVES | 0xFF]
    for value in good:
        # A pin may set INTF and RBIF at any time: they are 1 or unknown.
        wider = value | (3 & ~value) << 8 if name == "intcon" else value
        assert certify.reread(one_state(claim, **{name: value})).states[0, CELLS[name][0]] == wider
    for value in bad:
        with pytest.raises(InputError, match=f"column {name} has a value that is out of range"):
            certify.reread(one_state(claim, **{name: value}))


def test_the_columns_are_the_registers_and_all_68_bytes_of_ram() -> None:
    ram = {f"ram.{address:02x}" for address in range(0x0C, 0x50)}
    assert len(ram) == 68
    assert CELLS.keys() == {name for name in MAY_BE_UNKNOWN if not name.startswith("ram")} | ram
    assert {name for name in MAY_MOVE if not name.startswith("ram")} | ram == FREE
    slots = [slot for slot, _ in (*CELLS.values(), *NUMBERS.values())]
    assert len(set(slots)) == len(slots)


@pytest.mark.parametrize(
    ("key", "good", "bad"),
    [
        ("cuts", [0, 1023], [-1]),
        ("cuts", [], [1024]),
        ("cuts", [5], [True]),
        ("held", {"RA0": 0, "RB7": 1}, {"RA0": 2}),
        ("held", {}, {"RA0": -1}),
        ("held", {"RA0": 1}, {"RA0": 1.0}),
        ("held", {"RA4": 1}, {"RA5": 1}),
        ("places", [[[1, 1, 0, 0], 0x1FFF, 0x1FFF]], [[[1, 1, 0, 0], 0x2000, 0]]),
        ("places", [[[1, 1, 0, 0], 0, 0]], [[[1, 1, 0, 0], 0, 0x2000]]),
        ("places", [[[1, 1, 0, 0], 0, 0]], [[[1, 1, 0, 0], -1, 0]]),
        ("places", [[[1, 1, 0, 0], 0, 0]], [[[1, 1, 0, 0], 0, -1]]),
        ("places", [[[1, 1, 0, 0], 1, 1]], [[[1, 1, 0, 0], True, 0]]),
        ("format", 2, 3),
        ("assumptions", ["any text"], {}),
        ("clock_hz", 4, "4"),
    ],
)
def test_what_else_a_certificate_says(claim: dict[str, Any], key: str, good: object, bad: object) -> None:
    certify.reread(claim | {key: good})
    with pytest.raises(InputError, match="not a certificate") as refused:
        certify.reread(claim | {key: bad})
    assert refused.value.location is not None
    assert refused.value.location.file == "certificate"


def test_a_certificate_of_no_states_is_read_and_one_of_less_than_none_is_not(claim: dict[str, Any]) -> None:
    empty = {name: {"all": 0} for name in claim["columns"]}
    read = certify.reread(claim | {"count": 0, "columns": empty})
    assert (read.count, read.states.shape) == (0, (0, WIDTH))
    with pytest.raises(InputError, match="count or cuts"):
        certify.reread(claim | {"count": -1, "columns": empty})


def test_a_column_is_one_value_or_the_differences(claim: dict[str, Any]) -> None:
    two = claim | {"count": 2, "columns": {name: {"all": 0} for name in claim["columns"]}}
    two["columns"] |= {"pc": {"delta": [5, 7]}, "w": {"delta": [9, -4]}, "option": {"all": 3}}
    states = certify.reread(two).states
    assert states[:, [layout.PC, layout.W, layout.OPTION]].tolist() == [[5, 9, 3], [12, 5, 3]]
    for column in ({"delta": [5]}, {"delta": [5, 1, 1]}, {"delta": []}):
        with pytest.raises(InputError, match=r"column pc has \d values of 2"):
            certify.reread(two | {"columns": two["columns"] | {"pc": column}})
    for column in ({"all": True}, {"all": 1, "delta": [1, 0]}, {"delta": [1, 0], "x": 1}, {}, {"each": 1}):
        with pytest.raises(InputError, match="column pc"):
            certify.reread(two | {"columns": two["columns"] | {"pc": column}})


def test_the_text_of_a_certificate_has_at_most_64_mib() -> None:
    assert MAX_TEXT == 64 * 1024 * 1024  # docs/proof.md


def test_the_fingerprint_of_a_program_is_that_of_its_words_its_configuration_and_its_eeprom() -> None:
    """docs/proof.md: lines of address and word, the configuration, and the 64 cells; an erased one is FF."""
    image = Image({0x00A: 0x3FFF, 0x002: 0x0001}, 0x3FF1, {0: 0x12, 63: 0xAB})
    text = "002 0001\n00a 3fff\nconfig 3ff1\n12" + "ff" * 62 + "ab\n"
    assert fingerprint(image) == hashlib.sha256(text.encode()).hexdigest()
    erased = "config none\n" + "ff" * 64 + "\n"
    assert fingerprint(Image({})) == hashlib.sha256(erased.encode()).hexdigest()


# States on the way ----------------------------------------------------------------------------------------


def checker(schedule: bytes = SCHEDULE, image: Image = PLAIN, held: dict[str, int] | None = None) -> Checker:
    """Return a checker of a certificate that lists nothing."""
    none = np.zeros((0, WIDTH), dtype=np.int64)
    nothing = Certificate("", "", 0, held or {}, frozenset([FRAME]), [], none)
    return Checker(image, read_plan(schedule, "schedule.json"), nothing)


def started(of: Checker, listed: chip.Ints) -> chip.Ints:
    """Return the chip that runs on from a listed state, in frame 0, in which nothing was read yet."""
    listed[[FRAME_NUMBER, PLACE]] = 0, of.number(Place((1, 1, 0, 0)))
    listed[layout.STAGE] = layout.RUNS
    return of.started(listed[None])[0]


def row(**slots: int) -> chip.Ints:
    """Return a state in cycle 1000, with everything known to be 0."""
    s = np.zeros(COLUMNS, dtype=np.int64)
    s[layout.CYCLE], s[layout.OPTION] = 1000, layout.PSA
    for name, value in slots.items():
        s[getattr(layout, name)] = value
    return s


def test_power_up_is_that_of_the_lockstep() -> None:
    """Both are written from DS35007 table 6-4."""
    of = checker()
    found = of.power_up()[0]
    expected = lockstep.power_up()
    assert np.array_equal(found[: layout.SLOTS], expected)
    assert found[[FRAME_NUMBER, ORIGIN, DUE]].tolist() == [0, -1, 0]
    assert of.places[found[PLACE]] == Place((1, 1, 0, 0))


@pytest.mark.parametrize(("config", "due"), [(0x3FF5, 7000), (0x3FF1, None), (None, 7000)])
def test_the_watchdog_is_on_by_its_bit_and_on_an_erased_chip(config: int | None, due: int | None) -> None:
    """7 ms at 4 MHz: DS35007 section 6.1, parameter 31."""
    assert checker(image=Image(PLAIN.program, config)).board.watchdog == (due or 0)


@pytest.mark.parametrize("clock_hz", [3_999_999, 4_000_000, 20_000_000])
def test_the_watchdogs_period_is_a_whole_number_of_cycles_rounded_down(clock_hz: int) -> None:
    schedule = SCHEDULE.replace(b"4000000", str(clock_hz).encode())
    assert checker(schedule, certify.plain_program("0x3ff5")).board.watchdog == 7 * clock_hz // 4000


@pytest.mark.parametrize("option", [*range(8), layout.PSA, layout.PSA | 7])
def test_tmr0_goes_on_from_its_listed_count_and_the_cycles_since_it_counted(option: int) -> None:
    """It is read as so many counts more, and T0IF is set one cycle before it is read as 0."""
    ratio = 1 if option & 8 else 2 << option
    for count, prescaler in ((0, 0), (0, ratio - 1), (255, 0), (254, ratio // 2)):
        again = started(checker(), row(OPTION=option, TMR0=count, PRESCALER=prescaler))
        for later in range(1, 3 * ratio):
            functions.tick(again)
            assert again[layout.TMR0] == (count + (prescaler + later) // ratio) % 256
            overflows = (256 - count) * ratio - prescaler - 1
            assert bool(again[layout.INTCON] & layout.T0IF) == (1 <= overflows <= later)


def test_an_unknown_count_stays_so_and_one_that_moves_counts() -> None:
    for cell, later in ((UNKNOWN, UNKNOWN), (255 | MOVES, 9 | MOVES)):
        again = started(checker(), row(TMR0=cell))
        functions.tick(again, 10)
        assert again[layout.TMR0] == later
        assert again[layout.INTCON] == 0
    again = started(checker(), row(OPTION=layout.T0CS | layout.PSA))
    assert again[layout.TMR0] == UNKNOWN  # edges of RA4, at any time


def test_a_started_state_has_the_next_edge_of_its_frame() -> None:
    """The pulse of the schedule is from cycle 0 to 300."""
    for time, edge in ((0, 0), (1, 1), (299, 1), (300, 1), (301, 2), (1999, 2)):
        again = started(checker(), row(TIME=time))
        assert (again[layout.EDGE], again[DUE]) == (edge, 0)


def contains(listed: chip.Ints, state: chip.Ints) -> bool:
    """Return whether the first state contains the second, by the keys of the checker."""
    cells = listed[check.BYTES].astype(np.int32)
    shape = np.where(cells >> 16, 1 << 16, cells & UNKNOWN)
    (key,) = check.listed_keys(listed[None], shape)
    return key is not None and check.listed_keys(state[None], shape)[0] == key


def bytes_of(cell: int, phase: int) -> set[int]:
    """Return all bytes that a cell may be."""
    if cell >> 16:
        return {cell + phase & 0xFF}
    return {cell & 0xFF | choice & cell >> 8 for choice in range(256)}


SLOTS = (0x0C, layout.W, layout.TMR0)


def within(state: chip.Ints, listed: chip.Ints, phase: int) -> bool:
    """Return whether with one phase of `listed` all bytes of `state`, with this phase, are among its own."""
    moving = next((slot for slot in SLOTS if listed[slot] >> 16), None)
    other = 0
    if moving is not None:
        other = min(bytes_of(int(state[moving]), phase)) - int(listed[moving])
    return all(
        bytes_of(int(state[slot]), phase) <= bytes_of(int(listed[slot]), other & 0xFF) for slot in SLOTS
    )


def test_a_listed_state_contains_a_state_whose_bytes_are_all_among_its_own() -> None:
    """For each phase of the state there is one of the listed state, of all bytes together."""
    dice = random.Random(8)
    outcomes = {True: 0, False: 0}
    for _ in range(300):
        first, second, timer = SLOTS
        listed, state = row(), row()
        for slot in (first, second, timer):
            kind = dice.randrange(3)
            value, mask = dice.choice((0x10, 0x11, 0x90)), dice.choice((0x01, 0x80, 0xFF))
            listed[slot] = (value, value & ~mask | mask << 8, value | MOVES)[kind]
            change = dice.choice((0, 0, 0, 0x01, 0x80, MOVES, 0x100))
            state[slot] = int(listed[slot]) ^ (change if listed[slot] >> 8 == 0 or change == 0 else 0)
            if listed[slot] >> 8 and dice.random() < 0.6:
                state[slot] = value if dice.random() < 0.5 else dice.choice((0x10, 0x11, 0x90))
        if state[timer] >> 8 and not state[timer] >> 16:
            state[timer] = UNKNOWN  # TMR0 is known, unknown, or moves
        if listed[timer] >> 8 and not listed[timer] >> 16:
            listed[timer] = UNKNOWN
        state[[first, second]] &= ~((state[[first, second]] >> 8) & 0xFF)
        expected = all(within(state, listed, phase) for phase in (0, 1, 77))
        found = contains(listed, state)
        assert found <= expected, (listed[[first, second, timer]], state[[first, second, timer]])
        outcomes[found] += 1
    assert min(outcomes.values()) > 50


@pytest.mark.parametrize(
    ("listed", "state", "within"),
    [
        (0x10, 0x10, True),
        (0x10, 0x11, False),
        (0x0100, 0x01, True),
        (0x0100, 0x02, False),
        (0x0100, 0x0300, False),
        (UNKNOWN, 0x5A, True),
        (UNKNOWN, 0x0F00, True),
        (0x7F00, 0x80, False),
        (UNKNOWN, 5 | MOVES, True),
        (0xFE00, 5 | MOVES, False),
        (0x10, 5 | MOVES, False),
    ],
)
def test_a_cell_contains_a_cell_with_fewer_choices(listed: int, state: int, within: bool) -> None:
    for slot in (0x0C, 0x4F, layout.W, layout.FSR):
        one, other = row(), row()
        one[slot], other[slot] = listed, state
        assert contains(one, other) is within, hex(slot)


@pytest.mark.parametrize(
    ("byte", "timer", "within"),
    [
        (5 | MOVES, 7 | MOVES, True),
        (250 | MOVES, 252 | MOVES, True),  # another φ
        (250, 252, True),  # φ is known
        (254, 0, True),
        (5, 8, False),
        (5 | MOVES, 8 | MOVES, False),
        (5 | MOVES, 7, False),
        (5, 7 | MOVES, False),
        (0x0100, 7, False),
        (5, UNKNOWN, False),
    ],
)
def test_bytes_that_move_together_keep_their_difference_from_tmr0(
    byte: int, timer: int, within: bool
) -> None:
    listed = row(TMR0=7 | MOVES, PRESCALER=3)
    listed[0x20] = 5 | MOVES
    state = row(TMR0=timer, PRESCALER=3)
    state[0x20] = byte
    assert contains(listed, state) is within
    state[layout.PRESCALER] = 2  # the prescaler's count
    assert not contains(listed, state)


@pytest.mark.parametrize("name", ["PC", "DEPTH", "OPTION", "TRISA", "TRISB", "STAGE", "TIME", "STACK"])
def test_everything_beside_bytes_must_be_equal(name: str) -> None:
    assert contains(row(), row())
    other = row()
    other[getattr(layout, name)] += 1
    assert not contains(row(), other)
    for column in (FRAME_NUMBER, PLACE, layout.STACK + 7):
        other = row()
        other[column] = 1
        assert not contains(row(), other)
    for slot in (layout.AGE, layout.WRITE_LEFT, layout.EDGE, layout.CHOSEN):  # otherwise, or not at all
        other = row()
        other[slot] = 1
        assert contains(row(), other)


def test_the_prescalers_count_says_nothing_where_tmr0_is_unknown() -> None:
    assert contains(row(TMR0=UNKNOWN, PRESCALER=1), row(TMR0=UNKNOWN, PRESCALER=2))
    assert not contains(row(PRESCALER=1), row(PRESCALER=2))


@pytest.mark.parametrize(("slot", "on"), [("AGE", True), ("AGE", False), ("WRITE_LEFT", True)])
def test_a_watchdog_that_was_cleared_later_or_a_write_that_ends_earlier_is_contained(
    slot: str, on: bool
) -> None:
    of = checker(image=certify.plain_program("0x3ff5" if on else "0x3ff1"))
    listed = Certificate("", "", 0, {}, frozenset(), [Place((1, 1, 0, 0))], row(**{slot: 50})[None, :WIDTH])
    of.states = of.started(of.known(listed))
    for value in (50, 49, 0, 51, 5000):
        state = row(**{slot: value}, STAGE=layout.RUNS)
        state[PLACE] = of.number(Place((1, 1, 0, 0)))
        if value <= 50 or not on:
            of.compare(state[None])
        else:
            with pytest.raises(Refused, match="the state is within no listed one"):
                of.compare(state[None])


# What is said ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({}, "1000 cycles after state 0, at address 0x000, frame 0, cycle 1000, high pins: none: why"),
        ({"PC": 0x2AB, "TIME": 600},
         "1000 cycles after state 0, at address 0x2AB, frame 0, cycle 600, high pins: none: why"),
        ({"STAGE": layout.BEFORE},
         "1000 cycles after state 0, at address 0x000, before the first pulse, high pins: none: why"),
        ({"STAGE": layout.OVER},
         "1000 cycles after state 0, at address 0x000, after the last pulse, high pins: none: why"),
        ({"PORTA": 0x11, "PORTB": 0x82},
         "1000 cycles after state 0, at address 0x000, frame 0, cycle 1000, high pins: RA0 RA4 RB1 RB7: why"),
        ({"PORTA": 0x1100, "PORTB": 0x8200},  # unknown: it may be high
         "1000 cycles after state 0, at address 0x000, frame 0, cycle 1000, high pins: RA0 RA4 RB1 RB7: why"),
        ({"PORTA": 0x1F, "PORTB": 0xFF, "TRISA": 0x1B, "TRISB": 0x7F},
         "1000 cycles after state 0, at address 0x000, frame 0, cycle 1000, high pins: RA2 RB7: why"),
    ],
)  # fmt: skip
def test_a_refusal_says_where_it_was_and_which_pins_were_high(changes: dict[str, int], text: str) -> None:
    state = row(**({"STAGE": layout.RUNS, "TIME": 1000} | changes))
    assert check.place_of(state) + ": why" == text


def test_a_refusal_names_the_listed_state_and_the_frame() -> None:
    state = row(STAGE=layout.RUNS, TIME=1000)
    state[[ORIGIN, FRAME_NUMBER]] = 17, 23
    assert "cycles after state 17, at address 0x000, frame 23, cycle 1000" in check.place_of(state)
    state[ORIGIN] = -1
    assert check.place_of(state).startswith("1000 cycles after power-up, ")


@pytest.mark.parametrize(
    ("config", "fastest"),
    [(0x3FF0, 200_000), (0x3FF1, 4_000_000), (0x3FF2, 20_000_000), (0x3FF3, 0), (None, 0)],
)
def test_the_clock_is_one_that_the_oscillator_allows(config: int | None, fastest: int) -> None:
    """LP 200 kHz, XT 4 MHz, HS 20 MHz: DS35007 section 6.2; RC, also of an erased chip, has no exact one."""
    image = Image(PLAIN.program, config)
    for clock_hz in {max(4, fastest), fastest + 4}:
        schedule = SCHEDULE.replace(b"4000000", str(clock_hz).encode()).replace(b"16F84", b"16F84A")
        nothing = Certificate(fingerprint(image), "", 0, {}, frozenset(), [], np.zeros((0, WIDTH), np.int64))
        allowed = clock_hz <= fastest
        with pytest.raises(Refused, match="another schedule" if allowed else "no exact frequency"):
            check_certificate(nothing, image, schedule, "schedule.json")


def test_the_claim_is_of_this_program_clock_and_schedule(claim: dict[str, Any]) -> None:
    def verdict(**changes: object) -> None:
        check_certificate(certify.reread(claim | changes), PLAIN, SCHEDULE, "schedule.json")

    verdict()
    for changes, why in (
        ({"image": "0" * 64}, "the certificate is of another program"),
        ({"schedule": "0" * 64}, "the certificate is of another schedule"),
        ({"clock_hz": 4_000_001}, "the certificate is of another schedule"),
        ({"count": 0, "columns": {name: {"all": 0} for name in claim["columns"]}}, "within no listed one"),
    ):
        with pytest.raises(Refused, match=why):
            verdict(**changes)


@pytest.mark.parametrize(
    ("places", "good"),
    [([[1, 1, 0, 0]], True), ([[1, 1, 0]], False), ([[1, 1, 0, "0"]], False), ([[]], False)],
)
def test_a_place_has_the_memory_of_the_inputs(places: list[list[object]], good: bool) -> None:
    of = checker()
    listed = Certificate("", "", 0, {}, frozenset(), [Place(tuple(each)) for each in places],
                         np.zeros((1, WIDTH), dtype=np.int64))  # fmt: skip
    if good:
        assert of.known(listed)[0, ORIGIN] == 0
    else:
        with pytest.raises(Refused, match="the schedule has none such"):
            of.known(listed)


def test_a_held_pin_that_is_an_input_of_the_schedule_is_read_no_more() -> None:
    schedule = certify.schedule(certify.STOP)
    assert checker(schedule).board.buttons == 1 << PINS.index("RA4")
    held = checker(schedule, held={"RA4": 1, "RB7": 0})
    assert (held.board.buttons, held.board.held, held.board.levels) == (0, 0x1010, 0x10)
    other = checker(schedule, held={"RB7": 1})
    assert (other.board.buttons, other.board.held, other.board.levels) == (0x10, 0x1000, 0x1000)
