"""What is general at a cut point, and what is kept once it decides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.prove.chip import (
    ALL_UNKNOWN,
    BASE,
    CELL_PHASED,
    AssumedBits,
    ChipState,
    Reason,
    RunOutcome,
    Use,
)
from servogen.prove.generalise import PHASE, Generaliser, Guess, follows_timer, live_places
from servogen.prove.nodes import Decision
from servogen.prove.transitions import Transitions
from servogen.simulator import layout
from tests.prove.chip_states import fields, ram, rest
from tests.prove.scripted_chip import Ways, outcome, transitions_of


def test_a_place_is_live_where_it_is_read_before_it_is_written() -> None:
    every = frozenset(range(4))
    reads = [frozenset({0}), frozenset({1}), frozenset(), frozenset({2})]
    writes = [frozenset({1}), frozenset({2}), frozenset({0, 3}), frozenset({0})]
    # By brute force: a value matters if a read comes before a write, or the end without a write.
    wanted = [
        frozenset(
            place
            for place in every
            for fate in [
                next(
                    (place in reads[n] for n in range(first, 4) if place in reads[n] or place in writes[n]),
                    True,
                )
            ]
            if fate
        )
        for first in range(4)
    ]
    assert live_places(reads, writes, every) == wanted
    assert wanted[0] == {0} and live_places([], [], every) == []


def test_a_byte_follows_the_timer_if_their_distance_takes_few_values() -> None:
    timers = [(7 * n) & 255 for n in range(64)]
    assert follows_timer([timer + 5 & 255 for timer in timers], timers)
    assert not follows_timer(list(range(64)), timers), "another speed"
    assert not follows_timer([9] * 64, timers), "it does not change"
    assert not follows_timer([ALL_UNKNOWN, *timers[1:]], timers), "it is not known"
    # Sixteen values are enough, of which four distances are one quarter.
    few = list(range(16))
    assert follows_timer(few, few) and not follows_timer(few[:15], few[:15])
    assert follows_timer([n + n % 4 & 255 for n in (4 * k for k in range(16))], [4 * k for k in range(16)])
    four = [(5 * n) & 255 for n in range(16)]
    assert follows_timer([value + n % 4 & 255 for n, value in enumerate(four)], four) == (
        len({value + n % 4 & 255 for n, value in enumerate(four)}) >= 16
    )
    five = [(16 * n) & 255 for n in range(16)]
    assert not follows_timer([value + n % 5 & 255 for n, value in enumerate(five)], five)
    assert follows_timer([value + n % 4 & 255 for n, value in enumerate(five)], five)


def test_what_is_to_blame_is_kept_from_then_on() -> None:
    guess = Guess({1, 0x14}, {3})
    guess.drop("0x14")
    assert guess.dead == {1}
    guess.drop("0x09")  # not among them
    guess.drop("W")
    assert "W" not in guess.registers and "FSR" in guess.registers and guess.phased == {3}
    guess.drop(PHASE)
    assert guess.phased is None
    # Everything that only the program changes, and what is general beside it.
    assert {"W", "FSR", "EEDATA", "EEADR", "FLAGS", "TIMER", "PRESCALER", "PIN_FLAGS"} == Guess().registers


def generalised(guess: Guess, cells: tuple[int, ...], beside: tuple[int, ...]) -> tuple[tuple[int, ...], Any]:
    transitions, _ = transitions_of(None)
    generaliser = Generaliser(transitions, {9: guess})
    general, number = generaliser.generalised(cells, transitions.number(beside))
    again = generaliser.generalised(cells, transitions.number(beside))
    assert again == (general, number)
    return general, transitions.rest(number)


def test_nothing_is_general_at_a_cut_without_a_guess() -> None:
    beside = rest(PC=9, W=5, STATUS=7, INTCON=7, TMR0=3, TMR0_UNKNOWN=0xFF)
    assert generalised(Guess(registers=set()), ram(c1=2), beside) == (ram(c1=2), beside)
    transitions, _ = transitions_of(None)
    generaliser = Generaliser(transitions, {})
    generaliser.add_cut(9)
    assert generaliser.cuts == {9: Guess(registers=set())}


def test_dead_bytes_registers_and_flags_become_unknown() -> None:
    beside = rest(PC=9, W=5, FSR=6, EEDATA=7, EEADR=8, STATUS=0x1F, INTCON=0x07 | 0x10)
    cells, general = generalised(Guess({2, 5}), ram(c1=1, c2=2, c5=CELL_PHASED | 3), beside)
    assert cells == ram(c1=1, c2=ALL_UNKNOWN, c5=ALL_UNKNOWN)
    assert fields(general, "W", "FSR", "EEDATA", "EEADR") == [0] * 4
    assert fields(general, "W_UNKNOWN", "FSR_UNKNOWN", "EEDATA_UNKNOWN", "EEADR_UNKNOWN") == [0xFF] * 4
    assert fields(general, "STATUS", "STATUS_UNKNOWN") == [0x18, 0x07]
    # INTE is set, so the flag of INT stays; that of port B becomes unknown.
    assert fields(general, "INTCON", "INTCON_UNKNOWN") == [0x07 & ~1 | 0x10, 0x01]
    _, general = generalised(Guess(), ram(), rest(PC=9, INTCON=0x07 | 0x08))
    assert fields(general, "INTCON", "INTCON_UNKNOWN") == [0x07 & ~2 | 0x08, 0x02]
    _, general = generalised(Guess(), ram(), rest(PC=9, INTCON=0x07))
    assert fields(general, "INTCON", "INTCON_UNKNOWN") == [0x04, 0x03]
    _, general = generalised(Guess(), ram(), rest(PC=9, INTCON=0x07 | 0x18))
    assert fields(general, "INTCON", "INTCON_UNKNOWN") == [0x07 | 0x18, 0], "both may interrupt"
    kept = Guess(registers={"W"})
    _, general = generalised(kept, ram(), beside)
    assert general == rest(PC=9, W=0, W_UNKNOWN=0xFF, FSR=6, EEDATA=7, EEADR=8, STATUS=0x1F, INTCON=0x17)


def test_an_unknown_timer_s_overflow_is_forgotten_unless_it_interrupts() -> None:
    beside = {"PC": 9, "TMR0_UNKNOWN": 0xFF, "T0_AT": BASE + 5, "T0_HELD": BASE + 6, "PRESCALER": 3}
    only = Guess(registers={"TIMER"})
    _, general = generalised(only, ram(), rest(**beside, INTCON=0x04))
    assert fields(general, "INTCON", "INTCON_UNKNOWN", "T0_AT", "T0_HELD") == [0, 4, BASE, BASE]
    assert fields(general, "PRESCALER", "PRESCALER_UNKNOWN") == [0, 0xFF]
    _, general = generalised(only, ram(), rest(**beside, OPTION=0x08))
    assert fields(general, "PRESCALER", "PRESCALER_UNKNOWN") == [3, 0], "the prescaler is the watchdog's"
    for known in ({"INTCON": 0x20}, {"TMR0_UNKNOWN": 0x7F}):
        state = rest(**(beside | known))
        assert generalised(only, ram(), state)[1] == state


@pytest.mark.parametrize("ps", range(8))
def test_bits_of_the_prescaler_that_do_not_reach_the_timer_are_idle(ps: int) -> None:
    only = Guess(registers={"PRESCALER"})
    _, general = generalised(only, ram(), rest(PC=9, OPTION=ps, PRESCALER=0xFF))
    # 1:2 counts with one bit, 1:256 with eight.
    used = (1 << ps + 1) - 1
    assert fields(general, "PRESCALER", "PRESCALER_UNKNOWN") == [0xFF & used, 0xFF & ~used]
    state = rest(PC=9, OPTION=ps | 8, PRESCALER=0xFF)
    assert generalised(only, ram(), state)[1] == state


def test_a_phase_is_what_the_timer_reads_now() -> None:
    guess = Guess(set(), {3, 4}, set())
    cells, general = generalised(guess, ram(c3=7, c4=ALL_UNKNOWN, c5=9), rest(PC=9, TMR0=10))
    assert fields(general, "TMR0", "TMR0_UNKNOWN", "T0_FLAGGED") == [0, layout.PHASED, -1]
    # 7 is 253 behind 10; what is unknown stays so, and what does not follow TMR0 stays as it is.
    assert cells == ram(c3=253 | CELL_PHASED, c4=ALL_UNKNOWN, c5=9)
    assert fields(general, "INTCON", "INTCON_UNKNOWN") == [0, 4]
    # TMR0 may read 0; 255 is the largest byte that is known, and of 256 bit 0 is not.
    cells, _ = generalised(guess, ram(c3=255, c4=256), rest(PC=9))
    assert cells == ram(c3=255 | CELL_PHASED, c4=256)
    # Phased already: everything relative to φ moves by what TMR0 differs from it.
    beside = rest(PC=9, TMR0=6, TMR0_UNKNOWN=layout.PHASED, W=1, W_UNKNOWN=layout.PHASED, FSR=1)
    cells, general = generalised(guess, ram(c3=5 | CELL_PHASED, c9=250 | CELL_PHASED), beside)
    assert cells == ram(c3=255 | CELL_PHASED, c9=244 | CELL_PHASED)
    assert fields(general, "TMR0", "W", "FSR", "W_UNKNOWN") == [0, 251, 1, layout.PHASED]
    for known in ({"INTCON": 0x20}, {"OPTION": 0x20}, {"TMR0_UNKNOWN": 1}):
        state = rest(**({"PC": 9, "TMR0": 10} | known))
        cells, general = generalised(guess, ram(c3=7), state)
        assert cells == ram(c3=7) and general == state, known
    state = rest(PC=9, TMR0=6, TMR0_UNKNOWN=layout.PHASED, INTCON=0x24)
    assert fields(generalised(guess, ram(), state)[1], "INTCON", "INTCON_UNKNOWN") == [0x24, 0]


def node_of(transitions: Transitions, cells: Any, beside: Any, raw: Any) -> Any:
    numbers = transitions.number(beside), transitions.number(raw[1])
    return SimpleNamespace(ram=cells, rest=numbers[0], raw=(raw[0], numbers[1]))


def test_only_what_decides_is_blamed() -> None:
    """The run stops at a use if W is unknown and byte 2, too: restoring either of them avoids it."""

    def run(state: ChipState, choices: Any) -> RunOutcome:
        unknown = state["W_UNKNOWN"] and state.ram[2] == ALL_UNKNOWN
        reason = Reason.USE if unknown else Reason.LIMIT
        return outcome(0 if unknown else 50, reason, after=state.rest, read=(2,))

    transitions, _ = transitions_of(run)
    guess = Guess({2, 3})
    generaliser = Generaliser(transitions, {9: guess})
    raw = ram(c2=1), rest(PC=9, W=7)
    cells, number = generaliser.generalised(raw[0], transitions.number(raw[1]))
    node = node_of(transitions, cells, transitions.rest(number), raw)
    use = Use(layout.USE_SKIP, 0, 0x30)
    assert generaliser.blamed(node, (), 0, use)
    assert guess.dead == {3} and "W" not in guess.registers and "FSR" in guess.registers


def test_what_decides_anyway_blames_nothing_and_is_looked_into_five_times() -> None:
    transitions, chip = transitions_of(lambda state, choices: outcome(0, Reason.USE, after=state.rest))
    generaliser = Generaliser(transitions, {9: Guess()})
    raw = ram(), rest(PC=9, W=7)
    _, number = generaliser.generalised(raw[0], transitions.number(raw[1]))
    node = node_of(transitions, ram(), transitions.rest(number), raw)
    for turn in range(7):
        before = transitions.runs
        # Choices that were not made before, so that nothing is remembered.
        decisions = (Decision(0, (AssumedBits("W", 1, turn),)),)
        assert not generaliser.blamed(node, decisions, 0, Use(layout.USE_SKIP, 0, 0x30))
        assert (transitions.runs > before) == (turn < 5)
    assert generaliser.guesses[9] == Guess() and chip.asked
    # At sixty addresses; from then on, nothing general is to blame.
    for address in range(61):
        generaliser.blamed(node, (), 0, Use(layout.USE_SKIP, 0, 0x100 + address))
    before = transitions.runs
    decisions = (Decision(0, (AssumedBits("W", 1, 99),)),)
    assert not generaliser.blamed(node, decisions, 0, Use(layout.USE_SKIP, 0, 0x200))
    assert transitions.runs == before


def test_what_decides_only_together_is_blamed_together() -> None:
    def run(state: ChipState, choices: Any) -> RunOutcome:
        unknown = bool(state["W_UNKNOWN"] or state["FSR_UNKNOWN"])
        return outcome(0 if unknown else 50, Reason.USE if unknown else Reason.LIMIT, after=state.rest)

    transitions, _ = transitions_of(run)
    guess = Guess(set(), None, {"W", "FSR"})
    generaliser = Generaliser(transitions, {9: guess})
    raw = ram(), rest(PC=9, W=7, FSR=8)
    cells, number = generaliser.generalised(raw[0], transitions.number(raw[1]))
    node = node_of(transitions, cells, transitions.rest(number), raw)
    assert generaliser.blamed(node, (), 0, Use(layout.USE_SKIP, 0, 0x30))
    assert guess.registers == set()


VAGUE: dict[str, Callable[[ChipState], object]] = {
    "0x14": lambda state: state.ram[20] == ALL_UNKNOWN,
    "W": lambda state: state["W_UNKNOWN"],
    "FSR": lambda state: state["FSR_UNKNOWN"],
    "EEADR": lambda state: state["EEADR_UNKNOWN"],
    "FLAGS": lambda state: state["STATUS_UNKNOWN"],
    "PIN_FLAGS": lambda state: state["INTCON_UNKNOWN"] & 3,
    PHASE: lambda state: state["TMR0_UNKNOWN"] == layout.PHASED and state.ram[3] >= CELL_PHASED,
}  # fmt: skip


@pytest.mark.parametrize("place", VAGUE)
def test_each_place_is_blamed_alone_if_it_alone_decides(place: str) -> None:
    """Byte 20, W, ... and the phase are known before they are general; only one of them stops the run."""
    asked: list[ChipState] = []

    def run(state: ChipState, choices: Any) -> RunOutcome:
        asked.append(state)
        reason = Reason.USE if VAGUE[place](state) else Reason.LIMIT
        return outcome(0 if reason is Reason.USE else 50, reason, after=state.rest, read=(3, 20))

    guess = Guess({20}, {3}, {"W", "FSR", "EEADR", "FLAGS", "PIN_FLAGS"})
    before = replace(guess, dead={*guess.dead}, registers={*guess.registers})
    transitions, _ = transitions_of(run)
    generaliser = Generaliser(transitions, {9: guess})
    raw = ram(c20=6, c3=7), rest(PC=9, W=7, FSR=8, EEADR=9, STATUS=0x1B, INTCON=0x83, TMR0=3)
    cells, number = generaliser.generalised(raw[0], transitions.number(raw[1]))
    general = ChipState(cells, transitions.rest(number))
    assert all(vague(general) for vague in VAGUE.values())
    node = node_of(transitions, cells, transitions.rest(number), raw)
    assert generaliser.blamed(node, (), 0, Use(layout.USE_SKIP, 0, 0x30))
    before.drop(place)
    assert guess == before
    # What is looked into has one place as it was before, and all others as they are now.
    for state in asked:
        restored = [name for name, vague in VAGUE.items() if not vague(state)]
        assert len(restored) == 1
        if restored == ["W"]:
            assert (state["W"], state.ram[20], state["FSR_UNKNOWN"]) == (7, ALL_UNKNOWN, 0xFF)
        if restored == ["0x14"]:
            assert (state.ram[20], state.ram[3]) == (6, cells[3])
        if restored == [PHASE]:
            assert (state["TMR0_UNKNOWN"], state.ram[3]) == (0, cells[3] & 0xFF), "some phase: φ is 0"


def test_a_use_decides_up_to_its_cycle_on_the_way_that_was_chosen() -> None:
    chosen = (AssumedBits("W", 1, 1),)

    def decides(table: dict[tuple[int, Any], RunOutcome], *decisions: Decision) -> bool:
        """Whether it decides even if W, the only thing that is general, is as it was before."""
        transitions, _ = transitions_of(Ways(table))
        generaliser = Generaliser(transitions, {9: Guess(registers={"W"})})
        node = node_of(transitions, ram(), rest(PC=9, W_UNKNOWN=0xFF), (ram(), rest(PC=9, W=7)))
        return not generaliser.blamed(node, decisions, 10, Use(layout.USE_SKIP, 0, 0x30))

    def way(cycles: int, reason: Reason, pc: int = 10) -> RunOutcome:
        return outcome(cycles, reason, after=rest(PC=pc))

    for cycles, use in ((5, True), (10, True), (11, False)):
        assert decides({(9, ()): way(cycles, Reason.USE)}) is use
    for reason in (Reason.LIMIT, Reason.STOP):
        assert not decides({(9, ()): way(0, reason)}), "it does not go on"
    assert not decides({(9, ()): way(5, Reason.LIMIT)})
    table: dict[tuple[int, Any], RunOutcome]
    # On the way it stops at other addresses.
    for cycles, use in ((5, True), (6, False)):
        table = {(9, ()): way(5, Reason.STOP), (10, ()): way(cycles, Reason.USE, 11)}
        assert decides(table) is use
    assert not decides({(9, ()): way(5, Reason.STOP), (10, ()): way(6, Reason.STOP, 11)})
    # A use at which something was chosen on the way is passed.
    for last, use in ((way(5, Reason.USE, 11), True), (way(5, Reason.LIMIT, 11), False)):
        table = {(9, ()): way(5, Reason.USE), (10, chosen): last}
        assert decides(table, Decision(5, chosen)) is use
    table = {(9, ()): way(0, Reason.STOP, 9), (9, chosen): way(10, Reason.USE)}
    assert decides(table, Decision(0, chosen)), "in the first cycle, too"
