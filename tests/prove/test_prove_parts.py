"""The parts of the prover one by one, with chips whose runs are given: memory, guesses, tables, search."""

from __future__ import annotations

import itertools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.edges import PINS
from servogen.engines.stream.protocol import trim_cycles
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.prove import eeprom, explore, prover
from servogen.prove.chip import (
    ALL_UNKNOWN,
    BASE,
    CELL_PHASED,
    FIELD,
    AssumedBits,
    ChipState,
    Reason,
    RunOutcome,
    Use,
)
from servogen.prove.cuts import _as_held, _needs_w
from servogen.prove.eeprom import TrimSearch
from servogen.prove.explore import Explorer, SearchAnswer, SearchFinding, SearchResult
from servogen.prove.forks import ALONE, PreparedProgram
from servogen.prove.generalise import PHASE, Generaliser, Guess, follows_timer, live_places
from servogen.prove.nodes import Decision
from servogen.prove.quantifiers import EVERYTHING, Quantifiers
from servogen.prove.specification import IN_FRAME, Specification, SpecState
from servogen.prove.transitions import Transitions, applied
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.simulator import SimulatorOptions, layout
from servogen.units import Clock, Cycles
from tests.prove.chip_states import ram, rest

RB0, RB1, RA4 = (PINS.index(pin) for pin in ("RB0", "RB1", "RA4"))
PERIOD = 20_000


def outcome(
    cycles: int = 5, reason: Reason = Reason.STOP, after: tuple[int, ...] | None = None, **more: Any
) -> RunOutcome:
    values: dict[str, Any] = {"edges": (), "read": (), "written": ()} | more
    return RunOutcome(reason=reason, cycles=cycles, rest=rest(PC=9) if after is None else after, **values)


class Chip:
    """A chip whose runs are given by a function of its state and the choices."""

    watchdog = False

    def __init__(self, run: Any) -> None:
        self._run = run
        self.asked: list[tuple[Any, ...]] = []

    def run(self, state: ChipState, stops: Any, limit: int, choices: Any = ()) -> RunOutcome:
        self.asked.append((state, stops, limit, choices))
        result = self._run(state, choices)
        assert isinstance(result, RunOutcome)
        return result


def transitions_of(run: Any) -> tuple[Transitions, Chip]:
    chip = Chip(run)
    made: Any = chip
    return Transitions(made, 777), chip


# runs that are remembered


def test_a_run_is_repeated_only_if_it_depends_on_what_differs() -> None:
    def run(state: ChipState, choices: Any) -> RunOutcome:
        # Byte 0 decides whether byte 5 is read, too.
        read = (0, 5) if state.ram[0] else (0,)
        return outcome(10 + state.ram[5] * bool(state.ram[0]), read=read, written=((7, 1),))

    transitions, chip = transitions_of(run)
    transitions.stop_at({9})
    number = transitions.number(rest())

    def cycles(zero: int, five: int, nine: int = 0) -> int:
        return transitions.run(ram(c0=zero, c5=five, c9=nine), number, ()).cycles

    assert cycles(0, 1) == 10 and cycles(0, 2, 3) == 10 and len(chip.asked) == 1
    assert cycles(1, 1) == 11 and len(chip.asked) == 2
    assert cycles(1, 2) == 12 and cycles(1, 1, 9) == 11 and len(chip.asked) == 3
    # What was remembered before more bytes were read still serves for the bytes that it was run with.
    assert cycles(0, 1, 4) == 10 and len(chip.asked) == 3
    assert (transitions.runs, transitions.cycles, transitions.written) == (3, 10 + 11 + 12, {7})
    assert chip.asked[0][1:] == (frozenset({9}), 777, ())


def test_other_choices_states_and_stops_are_other_runs() -> None:
    transitions, _ = transitions_of(lambda state, choices: outcome())
    transitions.stop_at({9})
    one, other = transitions.number(rest()), transitions.number(rest(W=1))
    assert (one, other) == (0, 1) and transitions.number(rest(W=1)) == 1
    assert transitions.rest(1) == rest(W=1)
    for number, choices in ((one, ()), (one, (ALONE,)), (other, ()), (one, ())):
        transitions.run(ram(), number, choices)
    assert transitions.runs == 3
    transitions.stop_at({9})
    transitions.run(ram(), one, ())
    assert transitions.runs == 3
    transitions.stop_at({9, 10})
    transitions.run(ram(), one, ())
    assert transitions.runs == 4
    assert transitions.pc(transitions.number(rest(PC=0x7FF))) == 0x3FF


def test_written_bytes_are_in_the_ram_after_a_run() -> None:
    before = ram(c3=4)
    assert applied(before, outcome()) is before
    assert applied(before, outcome(written=((3, 9), (67, 1)))) == ram(c3=9, c67=1)


# guesses


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
    assert wanted[0] == {0, 2 - 2} and live_places([], [], every) == []


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


def fields(state: tuple[int, ...], *names: str) -> list[int]:
    return [state[FIELD[name]] for name in names]


NO_REGISTERS: set[str] = set()


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
    assert len(generaliser._innocent) == 61
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


def test_only_what_is_named_is_as_it_was_before_it_was_general() -> None:
    transitions, _ = transitions_of(None)
    generaliser = Generaliser(transitions, {9: Guess()})
    known = {"PC": 9, "W": 7, "FSR": 8, "STATUS": 0x1B, "INTCON": 0x93, "TMR0": 3, "PRESCALER": 5}
    vague = {
        "PC": 9, "W": 0, "W_UNKNOWN": 0xFF, "FSR": 0, "FSR_UNKNOWN": 0xFF, "STATUS": 0x18,
        "STATUS_UNKNOWN": 7, "INTCON": 0x90, "INTCON_UNKNOWN": 3, "TMR0": 0,
        "TMR0_UNKNOWN": layout.PHASED, "PRESCALER_UNKNOWN": 7,
    }  # fmt: skip
    cells = ram(c1=ALL_UNKNOWN, c20=ALL_UNKNOWN, c3=4 | CELL_PHASED)
    node = node_of(transitions, cells, rest(**vague), (ram(c1=5, c20=6, c3=7), rest(**known)))

    def restored(*places: str) -> tuple[Any, Any]:
        return generaliser._restored(node, [*places])

    assert restored() == (cells, rest(**vague)) == restored("TIMER", "PRESCALER")
    assert restored("0x14") == (ram(c1=ALL_UNKNOWN, c20=6, c3=4 | CELL_PHASED), rest(**vague))
    assert restored("W") == (cells, rest(**vague | {"W": 7, "W_UNKNOWN": 0}))
    assert restored("FLAGS") == (cells, rest(**vague | {"STATUS": 0x1B, "STATUS_UNKNOWN": 0}))
    assert restored("PIN_FLAGS") == (cells, rest(**vague | {"INTCON": 0x93, "INTCON_UNKNOWN": 0}))
    # Some phase: φ is 0.
    assert restored(PHASE) == (
        ram(c1=ALL_UNKNOWN, c20=ALL_UNKNOWN, c3=4),
        rest(**vague | {"TMR0_UNKNOWN": 0}),
    )
    assert restored("FSR", "0x01") == (
        ram(c1=5, c20=ALL_UNKNOWN, c3=4 | CELL_PHASED), rest(**vague | {"FSR": 8, "FSR_UNKNOWN": 0})
    )  # fmt: skip


def test_a_use_decides_up_to_its_cycle_on_the_way_that_was_chosen() -> None:
    chosen = (AssumedBits("W", 1, 1),)

    def decides(table: dict[tuple[int, Any], RunOutcome], *decisions: Decision) -> bool:
        transitions, _ = transitions_of(Ways(table))
        generaliser = Generaliser(transitions, {9: Guess()})
        node = node_of(transitions, ram(), rest(PC=9), (ram(), rest(PC=9)))
        return generaliser._decides(node, [], decisions, 10)

    def way(cycles: int, reason: Reason, pc: int = 10) -> RunOutcome:
        return outcome(cycles, reason, after=rest(PC=pc))

    for cycles, use in ((5, True), (10, True), (11, False)):
        assert decides({(9, ()): way(cycles, Reason.USE)}) is use
    for reason in (Reason.LIMIT, Reason.STOP):
        assert not decides({(9, ()): way(0, reason)}), "it does not go on"
    assert not decides({(9, ()): way(5, Reason.LIMIT)})
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


# cuts


def needs_w(*words: int, pc: int = 0) -> bool:
    return _needs_w(PreparedProgram(Image(dict(enumerate(words)))), pc)


def test_w_is_needed_where_it_is_read_before_it_is_written() -> None:
    f = 0x20
    assert (
        needs_w(encode("MOVWF", f=f)) and needs_w(encode("ADDLW", k=1)) and needs_w(encode("ADDWF", f=f, d=0))
    )
    assert not needs_w(encode("MOVLW", k=1)) and not needs_w(encode("MOVF", f=f, d=0)) and not needs_w()
    assert not needs_w(encode("CLRW"))
    # MOVF to the file does not write W.
    assert needs_w(encode("MOVF", f=f, d=1), encode("MOVWF", f=f))
    assert needs_w(encode("NOP"), encode("GOTO", k=3), encode("MOVLW", k=1), encode("MOVWF", f=f))
    assert needs_w(encode("CALL", k=2), encode("MOVLW", k=1), encode("MOVWF", f=f))
    assert not needs_w(encode("GOTO", k=0)), "a loop"
    assert not needs_w(encode("BTFSS", f=f, b=1), encode("MOVWF", f=f)), "more than one way"
    assert not needs_w(encode("RETURN"), encode("MOVWF", f=f))


def test_a_way_is_as_held_if_every_pin_has_the_level_of_the_schedule() -> None:
    def pin(number: int, level: int) -> AssumedBits:
        return AssumedBits("PINS", 1 << number, level << number)

    levels = {RB0: 1, RA4: 0}
    assert _as_held((), levels) and _as_held((pin(RB0, 1), pin(RA4, 0)), levels)
    assert not _as_held((pin(RB0, 0),), levels) and not _as_held((pin(RB0, 1), pin(RA4, 1)), levels)
    assert _as_held((pin(RB1, 0), AssumedBits("W", 1, 1)), levels) and not _as_held((pin(RB1, 1),), levels)


SCHEDULE = PulseSchedule(
    Clock(4_000_000),
    Cycles(PERIOD),
    (Channel("one", "RB0", "x"), Channel("two", "RB1", "x")),
    (Run(2, (Pulse(Cycles(0), Cycles(1000)), None)),),
    (Run(1, (Pulse(Cycles(0), Cycles(1200)), Pulse(Cycles(2500), Cycles(1500)))), Run(1, (None, None))),
)


# contents of the EEPROM that are tried


def search_of(monkeypatch: pytest.MonkeyPatch, trim_byte: int = 0, wrong: Any = None) -> TrimSearch:
    """A program whose channel 0 has its trim in byte 3; `wrong`: content → cycles by which a fall is off."""

    def changes(machine: Any, begun: int, end: int) -> list[tuple[int, int, int]]:
        content = machine
        trim = trim_cycles(content[3])
        off = wrong(content) if wrong else 0
        edges = []
        frames = [(1000, None), (1000, None), (1200, 1500), (None, None)]
        for number in range(200):
            one, two = frames[number if number < 4 else 2 + number % 2]
            start = 500 + number * PERIOD
            if one:
                edges += [(start, RB0, 1), (start + one + trim + off, RB0, 0)]
            if two:
                edges += [(start + 2500, RB1, 1), (start + 2500 + two, RB1, 0)]
        return sorted(edge for edge in edges if edge[0] < end)

    monkeypatch.setattr(eeprom, "machine_of", lambda schedule, image, board: image.eeprom)
    monkeypatch.setattr(eeprom, "pin_changes", changes)
    return TrimSearch(Image({}, eeprom={0: 1, 5: 7, 9: 8}), SCHEDULE, SimulatorOptions(), {RA4: 1})


def test_the_byte_of_a_trim_is_found_and_every_value_of_it_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    assert search_of(monkeypatch)._bytes == {3: 0}
    assert search_of(monkeypatch).search({}) is None
    one = search_of(monkeypatch, wrong=lambda content: 2 * (content[3] == 0x41))
    found = one.search({})
    assert found is not None
    # 0x41 is a trim of 65 cycles: the fall of a pulse of 1000 cycles that begins in cycle 500.
    assert found.message == "the fall of RB0 is missing if byte 3 is 0x41 in the EEPROM"
    assert found.cycle == 500 + 1000 + 65 and found.eeprom == {3: 0x41}
    assert found.levels == (("RA4", ((0, 1),)),)
    early = search_of(monkeypatch, wrong=lambda content: -2 * (content[3] == 0x41 and content[60] == 9))
    assert early.search({}) is None
    found = early.search({3: 0x41, 60: 9})
    assert found is not None and found.cycle == 500 + 1000 + 65 - 2
    assert found.message == (
        "the fall of RB0 is not the schedule's if byte 3 is 0x41, byte 60 is 0x09 in the EEPROM"
    )


def test_bytes_behind_the_trims_matter_only_if_the_program_plays_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert search_of(monkeypatch).erased() is None
    wrong = search_of(monkeypatch, wrong=lambda content: 3 * (content[9] == 0xFF))
    found = wrong.erased()
    assert found is not None
    assert found.message == (
        "the EEPROM holds more than trims: with bytes 5 to 9 erased the fall of RB0 is missing"
    )
    assert (found.cycle, found.eeprom) == (1500, {})
    wrong._image = replace(wrong._image, eeprom={0: 1, 1: 5, 9: 0xFF})
    assert wrong.erased() is None, "nothing is behind the trims of two channels"
    wrong._image = replace(wrong._image, eeprom={2: 5})
    assert wrong.erased() is not None


# the search


class Ways:
    """A program's ways: from (state beside the RAM, choices) to an outcome."""

    def __init__(self, table: dict[tuple[int, Any], RunOutcome]) -> None:
        self.table = table

    def __call__(self, state: ChipState, choices: Any) -> RunOutcome:
        return self.table[state["PC"], choices]


SILENT = PulseSchedule(
    Clock(4_000_000),
    Cycles(PERIOD),
    (Channel("one", "RB0", "x"),),
    (),
    (Run(1, (Pulse(Cycles(0), Cycles(1000)),)),),
)


def explored(
    table: dict[tuple[int, Any], RunOutcome],
    cuts: set[int],
    *,
    stops: frozenset[int] = frozenset(),
    program: PreparedProgram = PreparedProgram(Image({})),  # noqa: B008 - frozen
) -> SearchResult:
    transitions, _ = transitions_of(Ways(table))
    transitions.stop_at(cuts | stops)
    generaliser = Generaliser(transitions, {pc: Guess(registers=set()) for pc in cuts})
    spec = Specification(SILENT, None)
    search = Explorer(
        program, transitions, spec, generaliser, 4, 100, lambda *_: None, [ChipState(ram(), rest(PC=0))]
    )  # fmt: skip
    return search.search()


FIRST = outcome(100, after=rest(PC=9), edges=((50, RB0, 1),))
FRAME = outcome(PERIOD, after=rest(PC=9), edges=((950, RB0, 0), (PERIOD - 50, RB0, 1)))


def test_a_search_closes_when_no_new_state_comes() -> None:
    found = explored({(0, ()): FIRST, (9, ()): FRAME}, {9})
    assert found.answer is SearchAnswer.CLOSED and found.finding is None and found.open_nodes == 0
    assert [(node.parent, node.cycles) for node in found.nodes] == [(-1, 0), (0, 100)]
    assert found.nodes[1].spec == SpecState(IN_FRAME, 50, 0)
    assert (found.waits, found.asynchronous) == ((), False)


def test_a_wrong_edge_is_found_with_its_cycle_since_the_cut() -> None:
    late = replace(FRAME, edges=((950, RB0, 0), (PERIOD - 49, RB0, 1)))
    found = explored({(0, ()): FIRST, (9, ()): late}, {9})
    assert found.answer is SearchAnswer.VIOLATED and found.finding is not None
    assert found.finding == SearchFinding(1, (), PERIOD - 50, "the rise of RB0 comes 1 cycle late", True, 9)


def test_chips_that_differ_by_themselves_are_found() -> None:
    warned = replace(FRAME, reason=Reason.WARNING, warnings=("one", "two"), rest=rest(PC=0x2A))
    found = explored({(0, ()): FIRST, (9, ()): warned}, {9})
    assert found.answer is SearchAnswer.VIOLATED
    assert found.finding == SearchFinding(1, (), PERIOD, "one; two", True, 0x2A)


def test_an_unknown_bit_is_followed_both_ways() -> None:
    """At the start W decides: both values lead to the same cut, one a cycle later."""
    use = outcome(0, Reason.USE, after=rest(PC=0), use=Use(layout.USE_JUMP, 0, 0))
    program = PreparedProgram(Image({0: encode("ADDLW", k=1)}))
    table: dict[tuple[int, Any], RunOutcome] = {(0, ()): replace(use, rest=rest(PC=0))}
    for value in (0, 1):
        choice = (AssumedBits("W", 1, value),)
        table[0, choice] = replace(FIRST, cycles=100 + value)
    table[9, ()] = FRAME
    transitions, _ = transitions_of(Ways(table))
    transitions.stop_at({9})
    start = ChipState(ram(), rest(PC=0, W_UNKNOWN=1))
    search = Explorer(
        program, transitions, Specification(SILENT, None),
        Generaliser(transitions, {9: Guess(registers=set())}), 1, 100, lambda *_: None, [start],
    )  # fmt: skip
    table[9, ()] = replace(FRAME, edges=((950, RB0, 0), (PERIOD - 50, RB0, 1)))
    found = search.search()
    # The chip that comes a cycle later has its fall in another cycle since the cut.
    assert found.answer is SearchAnswer.VIOLATED and found.finding is not None
    assert found.finding.message == "the fall of RB0 comes 1 cycle late" or (
        found.finding.message == "the fall of RB0 comes 1 cycle early"
    )
    decided = found.nodes[found.finding.node].decisions
    assert decided in [(Decision(0, (AssumedBits("W", 1, value),)),) for value in (0, 1)]
    assert len(found.nodes) == 3


def test_what_decides_and_is_not_known_is_not_decided() -> None:
    use = outcome(7, Reason.USE, after=rest(PC=5), use=Use(layout.USE_JUMP, 0, 5))
    found = explored({(0, ()): use}, {9})
    assert found.answer is SearchAnswer.UNDECIDED
    assert found.finding == SearchFinding(0, (), 7, "what decides is not known", False, 5, use.use)


def test_a_first_pulse_has_fifty_frames() -> None:
    for cycles, answer in ((50 * PERIOD - 1, SearchAnswer.CLOSED), (50 * PERIOD, SearchAnswer.VIOLATED)):
        wait = outcome(cycles, after=rest(PC=9))
        found = explored({(0, ()): wait, (9, ()): replace(wait, cycles=5)}, {9})
        assert found.answer is answer, cycles
        if answer is SearchAnswer.VIOLATED:
            assert found.finding == SearchFinding(0, (), cycles, "no pulse comes", True, 9)
        else:
            # It waits from cut to cut: a cycle of states without a pulse.
            assert found.waits == ((0, 1), (1, 1))


def test_a_loop_without_a_cut_asks_for_one() -> None:
    found = explored({(0, ()): outcome(777, Reason.LIMIT, after=rest(PC=0x42))}, {9})
    assert (found.answer, found.cut) == (SearchAnswer.CUT, 0x42)


def test_more_states_than_allowed_are_not_decided() -> None:
    def run(state: ChipState, choices: Any) -> RunOutcome:
        if state["PC"] == 0:
            return FIRST
        return replace(FRAME, read=(1,), written=((1, state.ram[1] + 1),))

    for most in (3, 1200):
        transitions, _ = transitions_of(run)
        transitions.stop_at({9})
        told: list[tuple[int, int]] = []
        search = Explorer(
            PreparedProgram(Image({})), transitions, Specification(SILENT, None),
            Generaliser(transitions, {9: Guess(registers=set())}), 1, most,
            lambda *numbers: told.append(numbers),  # noqa: B023 - called in this turn only
            [ChipState(ram(), rest(PC=0))],
        )  # fmt: skip
        found = search.search()
        assert found.answer is SearchAnswer.UNDECIDED and found.finding is not None
        assert found.finding.message == f"more than {most} states" and len(found.nodes) == most + 1
        assert told == [(n, n + 1) for n in range(500, most, 500)]


def test_a_chip_that_sleeps_while_pulses_are_due_is_wrong() -> None:
    asleep = replace(FRAME, rest=rest(PC=9, SLEEPING=1))
    found = explored({(0, ()): FIRST, (9, ()): asleep}, {9})
    assert found.answer is SearchAnswer.VIOLATED and found.asynchronous
    assert found.finding == SearchFinding(1, (), PERIOD, "SLEEP while pulses are due", True, 9, silent=True)
    before = outcome(5, after=rest(PC=9, SLEEPING=1))
    found = explored({(0, ()): before}, {9})
    assert found.finding is not None
    assert found.finding.message == "no pulse comes: SLEEP, and nothing has to end it"


def test_what_is_written_to_the_eeprom_and_read_is_not_decided() -> None:
    program = PreparedProgram(Image({0: encode("BSF", f=8, b=1), 1: encode("BSF", f=8, b=0)}))
    written = replace(FIRST, rest=rest(PC=9, EE_DONE_AT=5))
    found = explored({(0, ()): written, (9, ()): FRAME}, {9}, program=program)
    assert found.answer is SearchAnswer.CLOSED and found.asynchronous
    found = explored({(0, ()): written}, {9})
    assert found.answer is SearchAnswer.UNDECIDED and found.finding is not None
    assert found.finding.message == (
        "what the program writes to the EEPROM, it reads, or it writes through INDF"
    )


def test_too_many_ways_are_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five steps from cut to cut: the start's and its three, and then the first frame's."""
    table = {
        (0, ()): outcome(1, after=rest(PC=1)),
        (1, ()): outcome(1, after=rest(PC=2)),
        (2, ()): outcome(1, after=rest(PC=3)),
        (3, ()): FIRST,
        (9, ()): FRAME,
    }
    for points, answer in ((4, SearchAnswer.CLOSED), (3, SearchAnswer.UNDECIDED)):
        monkeypatch.setattr(explore, "MAX_POINTS", points)
        found = explored(table, {9}, stops=frozenset({1, 2, 3}))
        assert found.answer is answer
    assert found.finding is not None and found.finding.message == "too many ways between two frames"
    monkeypatch.setattr(explore, "MAX_POINTS", 4)
    # Of a hundred states five points are a twentieth each.
    for work, answer in ((0.05, SearchAnswer.CLOSED), (0.04, SearchAnswer.UNDECIDED)):
        monkeypatch.setattr(explore, "WORK_PER_STATE", work)
        assert explored(table, {9}, stops=frozenset({1, 2, 3})).answer is answer


# the answer


def prover_of(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> Any:
    """A prover without its search."""
    one: Any = prover._Prover.__new__(prover._Prover)
    values = {
        "_schedule": SCHEDULE,
        "_quantifiers": EVERYTHING,
        "_held": {},
        "_board": SimulatorOptions(),
        "_write_us": 20_000,
        "_chip": SimpleNamespace(watchdog=False, released=0),
        "_program": SimpleNamespace(eeprom_accesses=frozenset()),
        "_image": Image({}),
        "_spec": None,
        "_cuts": {9, 5},
        "_transitions": SimpleNamespace(runs=3, cycles=700, pc=lambda number: 0x123),
    }
    for name, value in (values | changes).items():
        setattr(one, name, value)
    return one


PLAIN = (
    "the instruction set's table, servogen/pic/isa.py",
    "timers, ports and resets as docs/simulator.md lists them, with the data sheet's sections",
    "no servo responds to a pulse of at most 10 cycles before the first frame",
    "a reset cuts the current pulse short; after it the same holds from the first pulse on",
    "levels of inputs change between instruction cycles; the crystal is exact",
    "the EEPROM holds what the file says",
)


@pytest.mark.parametrize(
    ("changes", "more"),
    [
        ({}, ()),
        (
            {"_chip": SimpleNamespace(watchdog=True, released=0)},
            ("no chip's watchdog is faster than 7 ms (DS35007, parameter 31)",),
        ),
        (
            {
                "_chip": SimpleNamespace(watchdog=True, released=0),
                "_quantifiers": Quantifiers(watchdog=False),
                "_board": SimulatorOptions(watchdog_us=18_500),
            },
            ("the watchdog's period is 18.5 ms",),
        ),
        ({"_quantifiers": Quantifiers(watchdog=False)}, ()),
        (
            {"_program": SimpleNamespace(eeprom_accesses=frozenset({1}))},
            ("an EEPROM write takes at most 20 ms",),
        ),
        (
            {
                "_program": SimpleNamespace(eeprom_accesses=frozenset({1})),
                "_quantifiers": Quantifiers(eeprom_write=False),
                "_write_us": 4500,
            },
            ("an EEPROM write takes 4.5 ms",),
        ),
        (
            {"_quantifiers": Quantifiers(start=(("w", 10), ("0x0C", 255)))},
            ("at power-up w is 0x0A", "at power-up 0x0C is 0xFF"),
        ),
        (
            {"_held": {RA4: 1}},
            ("RA4 is held at 1, as the schedule says: it does not say what another level does",),
        ),
        (
            {"_quantifiers": Quantifiers(tmr0_phase=False)},
            ("TMR0 counts from the cycle after OPTION_REG is written",),
        ),
    ],
)
def test_a_proof_says_what_it_rests_on(
    changes: dict[str, Any], more: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert prover_of(monkeypatch, **changes)._assumptions() == (*PLAIN, *more)


def test_without_resets_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    texts = prover_of(monkeypatch, _quantifiers=Quantifiers(resets=False))._assumptions()
    assert texts[3] == "there is no reset after power-on" and len(texts) == 6


def test_a_result_counts_its_states_and_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    one = prover_of(monkeypatch)
    nodes = [SimpleNamespace(parent=parent) for parent in (-1, 0, 0, 2)]
    search: Any = SimpleNamespace(nodes=nodes, asynchronous=True)
    found = one._result(search, None, "")
    assert (found.proven, found.states, found.runs, found.cycles) == (True, 3, 3, 700)
    assert found.cuts == (5, 9) and found.asynchronous and found.nodes == tuple(nodes)
    undecided = one._result(None, None, "why")
    assert (undecided.proven, undecided.reason, undecided.states) == (False, "why", 0)
    assert not undecided.asynchronous
    shown: Any = object()
    assert one._result(search, shown, "").proven is False


def test_only_a_certain_violation_is_looked_for_on_a_plain_chip(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    shown: Any = object()
    answers = itertools.chain([shown, None])

    def concrete(case: Any, nodes: Any, finding: SearchFinding) -> Any:
        asked.append(finding)
        return next(answers)

    monkeypatch.setattr(prover, "concrete", concrete)
    one = prover_of(monkeypatch)
    wrong = SearchFinding(0, (), 5, "wrong", True, 0x1A)
    found = one._answer(SearchResult(SearchAnswer.VIOLATED, [], wrong))
    assert found.counterexample is shown and not found.proven and found.reason == ""
    found = one._answer(SearchResult(SearchAnswer.VIOLATED, [], wrong, open_nodes=2))
    assert found.counterexample is None and found.reason == "wrong (address 0x01A, 0 states seen, 2 open)"
    assert asked == [wrong, wrong]
    open_ = replace(wrong, certain=False)
    for answer, finding in ((SearchAnswer.VIOLATED, open_), (SearchAnswer.UNDECIDED, wrong)):
        assert one._answer(SearchResult(answer, [], finding)).reason.startswith("wrong (address")
    assert one._answer(SearchResult(SearchAnswer.CUT, [])).reason == (
        "the cut points do not suffice (address 0x000, 0 states seen, 0 open)"
    )
    assert len(asked) == 2
    assert one._answer(SearchResult(SearchAnswer.CLOSED, [])).proven


def test_a_program_that_waits_endlessly_makes_no_pulse(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(prover, "concrete", lambda case, nodes, finding: asked.append(finding))
    nodes: Any = [SimpleNamespace(parent=-1, rest=0), SimpleNamespace(parent=0, rest=1)]
    found = prover_of(monkeypatch)._answer(SearchResult(SearchAnswer.CLOSED, nodes, waits=((0, 1), (1, 1))))
    assert not found.proven
    assert found.reason == "no pulse comes (address 0x123, 2 states seen, 0 open)"
    assert asked == [SearchFinding(1, (), 0, "no pulse comes", True, 0x123, silent=True)]


# sleep


def woken(intcon: int, unknown: int = 0, *, watchdog: bool = False, **more: int) -> list[Any]:
    """The choices with which a chip that sleeps after the last pulse is woken."""
    asked: list[Any] = []

    def run(state: ChipState, choices: Any) -> RunOutcome:
        if state["PC"] == 0 and not choices:
            beside = rest(PC=5, SLEEPING=1, INTCON=intcon, INTCON_UNKNOWN=unknown, **more)
            return outcome(2000, after=beside, edges=((1, RB0, 1), (1000, RB0, 0)))
        asked.append(choices)
        return outcome(3, after=rest(PC=9))

    once = replace(SILENT, lead_in=(Run(1, (Pulse(Cycles(0), Cycles(999)),)),), loop=(Run(1, (None,)),))
    transitions, chip = transitions_of(run)
    chip.watchdog = watchdog
    transitions.stop_at({9})
    search = Explorer(
        PreparedProgram(Image({0: encode("BSF", f=8, b=1)})), transitions, Specification(once, None),
        Generaliser(transitions, {9: Guess(registers=set())}), 1, 100, lambda *_: None,
        [ChipState(ram(), rest(PC=0))],
    )  # fmt: skip
    found = search.search()
    assert found.asynchronous and found.answer is SearchAnswer.CLOSED, found.finding
    return [choices for choices in asked if choices]


def test_a_chip_that_sleeps_after_the_last_pulse_is_woken_in_every_way() -> None:
    """By each flag that may be set and is enabled, three places above it; by the watchdog, if it is on."""
    assert woken(0) == []
    flags = {1: 0x08, 2: 0x10, 4: 0x20}
    for flag, enable in flags.items():
        assert woken(enable, flag) == [(AssumedBits("INTCON", flag, flag),)]
        assert woken(enable) == [] == woken(0, flag), "neither a flag that is known nor one that is off"
    every = [(AssumedBits("INTCON", flag, flag),) for flag in (1, 2, 4)]
    assert woken(0x38, 7) == every
    assert woken(0x38, 7, watchdog=True) == [*every, (AssumedBits("WATCHDOG", 0, 0),)]
    # EEIE is bit 6; a write has to be in progress.
    assert woken(0x40) == [] and woken(0, EE_DONE_AT=9) == []
    assert woken(0x40, EE_DONE_AT=9) == [(AssumedBits("EE_DONE", 0, 0),)]
