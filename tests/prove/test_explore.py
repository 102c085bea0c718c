"""The search from cut to cut, with chips whose runs are given."""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import replace
from typing import Any

import pytest

from servogen.edges import PINS
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.prove import explore
from servogen.prove.chip import AssumedBits, ChipState, Reason, RunOutcome, Use
from servogen.prove.explore import Explorer, SearchAnswer, SearchFinding, SearchResult
from servogen.prove.forks import PreparedProgram
from servogen.prove.generalise import Generaliser, Guess
from servogen.prove.nodes import Decision
from servogen.prove.specification import IN_FRAME, Specification, SpecState
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.simulator import layout
from servogen.units import Clock, Cycles
from tests.prove.chip_states import ram, rest
from tests.prove.scripted_chip import Ways, outcome, transitions_of

RB0 = PINS.index("RB0")
PERIOD = 20_000

SILENT = PulseSchedule(
    Clock(4_000_000),
    Cycles(PERIOD),
    (Channel("one", "RB0", "x"),),
    (),
    (Run(1, (Pulse(Cycles(0), Cycles(1000)),)),),
)


def explored(
    run: Callable[[ChipState, Any], RunOutcome],
    *,
    stops: Set[int] = frozenset(),
    program: PreparedProgram = PreparedProgram(Image({})),  # noqa: B008 - frozen
    schedule: PulseSchedule = SILENT,
    start: tuple[int, ...] = rest(PC=0),
    most: int = 100,
    tell: Callable[[int, int], None] = lambda *_: None,
    watchdog: bool = False,
) -> SearchResult:
    """Search through the runs of a chip; the only cut is at address 9, where nothing is general."""
    transitions, chip = transitions_of(run)
    chip.watchdog = watchdog
    transitions.stop_at({9} | stops)
    generaliser = Generaliser(transitions, {9: Guess(registers=set())})
    spec, starts = Specification(schedule, None), [ChipState(ram(), start)]
    return Explorer(program, transitions, spec, generaliser, 1, most, tell, starts).search()


FIRST = outcome(100, after=rest(PC=9), edges=((50, RB0, 1),))
FRAME = outcome(PERIOD, after=rest(PC=9), edges=((950, RB0, 0), (PERIOD - 50, RB0, 1)))


def test_a_search_closes_when_no_new_state_comes() -> None:
    found = explored(Ways({(0, ()): FIRST, (9, ()): FRAME}))
    assert found.answer is SearchAnswer.CLOSED and found.finding is None and found.open_nodes == 0
    assert [(node.parent, node.cycles) for node in found.nodes] == [(-1, 0), (0, 100)]
    assert found.nodes[1].spec == SpecState(IN_FRAME, 50, 0)
    assert (found.waits, found.asynchronous) == ((), False)


def test_a_wrong_edge_is_found_with_its_cycle_since_the_cut() -> None:
    late = replace(FRAME, edges=((950, RB0, 0), (PERIOD - 49, RB0, 1)))
    found = explored(Ways({(0, ()): FIRST, (9, ()): late}))
    assert found.answer is SearchAnswer.VIOLATED and found.finding is not None
    assert found.finding == SearchFinding(1, (), PERIOD - 50, "the rise of RB0 comes 1 cycle late", True, 9)


def test_chips_that_differ_by_themselves_are_found() -> None:
    warned = replace(FRAME, reason=Reason.WARNING, warnings=("one", "two"), rest=rest(PC=0x2A))
    found = explored(Ways({(0, ()): FIRST, (9, ()): warned}))
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
    found = explored(Ways(table), program=program, start=rest(PC=0, W_UNKNOWN=1))
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
    found = explored(Ways({(0, ()): use}))
    assert found.answer is SearchAnswer.UNDECIDED
    assert found.finding == SearchFinding(0, (), 7, "what decides is not known", False, 5, use.use)


def test_a_first_pulse_has_fifty_frames() -> None:
    for cycles, answer in ((50 * PERIOD - 1, SearchAnswer.CLOSED), (50 * PERIOD, SearchAnswer.VIOLATED)):
        wait = outcome(cycles, after=rest(PC=9))
        found = explored(Ways({(0, ()): wait, (9, ()): replace(wait, cycles=5)}))
        assert found.answer is answer, cycles
        if answer is SearchAnswer.VIOLATED:
            assert found.finding == SearchFinding(0, (), cycles, "no pulse comes", True, 9)
        else:
            # It waits from cut to cut: a cycle of states without a pulse.
            assert [wait[:2] for wait in found.waits] == [(0, 1), (1, 1)]


def test_a_loop_without_a_cut_asks_for_one() -> None:
    found = explored(Ways({(0, ()): outcome(777, Reason.LIMIT, after=rest(PC=0x42))}))
    assert (found.answer, found.cut) == (SearchAnswer.CUT, 0x42)


def test_more_states_than_allowed_are_not_decided() -> None:
    def run(state: ChipState, choices: Any) -> RunOutcome:
        if state["PC"] == 0:
            return FIRST
        return replace(FRAME, read=(1,), written=((1, state.ram[1] + 1),))

    for most in (3, 1200):
        told: list[tuple[int, int]] = []
        found = explored(run, most=most, tell=lambda *numbers: told.append(numbers))  # noqa: B023 - now only
        assert found.answer is SearchAnswer.UNDECIDED and found.finding is not None
        assert found.finding.message == f"more than {most} states" and len(found.nodes) == most + 1
        assert told == [(n, n + 1) for n in range(500, most, 500)]


def test_a_chip_that_sleeps_while_pulses_are_due_is_wrong() -> None:
    asleep = replace(FRAME, rest=rest(PC=9, SLEEPING=1))
    found = explored(Ways({(0, ()): FIRST, (9, ()): asleep}))
    assert found.answer is SearchAnswer.VIOLATED and found.asynchronous
    assert found.finding == SearchFinding(1, (), PERIOD, "SLEEP while pulses are due", True, 9, silent=True)
    before = outcome(5, after=rest(PC=9, SLEEPING=1))
    found = explored(Ways({(0, ()): before}))
    assert found.finding is not None
    assert found.finding.message == "no pulse comes: SLEEP, and nothing has to end it"


def test_what_is_written_to_the_eeprom_and_read_is_not_decided() -> None:
    program = PreparedProgram(Image({0: encode("BSF", f=8, b=1), 1: encode("BSF", f=8, b=0)}))
    written = replace(FIRST, rest=rest(PC=9, EE_DONE_AT=5))
    found = explored(Ways({(0, ()): written, (9, ()): FRAME}), program=program)
    assert found.answer is SearchAnswer.CLOSED and found.asynchronous
    found = explored(Ways({(0, ()): written}))
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
    for points, answer in ((4, SearchAnswer.CLOSED), (3, SearchAnswer.CUT)):
        monkeypatch.setattr(explore, "MAX_POINTS", points)
        found = explored(Ways(table), stops={1, 2, 3})
        assert found.answer is answer
    assert found.finding is not None and found.finding.message == "too many ways between two frames"
    assert found.cut == 0, "of the most points, the first"
    monkeypatch.setattr(explore, "MAX_POINTS", 4)
    # Of a hundred states five points are a twentieth each.
    for work, answer in ((0.05, SearchAnswer.CLOSED), (0.04, SearchAnswer.UNDECIDED)):
        monkeypatch.setattr(explore, "WORK_PER_STATE", work)
        assert explored(Ways(table), stops={1, 2, 3}).answer is answer


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
    program = PreparedProgram(Image({0: encode("BSF", f=8, b=1)}))
    found = explored(run, program=program, schedule=once, watchdog=watchdog)
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
