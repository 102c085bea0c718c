"""How the prover goes on: cuts that are missing, guesses that are wrong, start values, any EEPROM."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.edges import PINS
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.prove import prover
from servogen.prove.explore import SearchAnswer, SearchFinding, SearchResult
from servogen.prove.generalise import Guess
from servogen.prove.prover import AS_IN_THE_FILE, Proof, prove_for_all
from servogen.prove.quantifiers import EVERYTHING, Quantifiers
from servogen.prove.tables import UndecidedTrims
from servogen.prove.trim_pulses import WrongEdge
from servogen.prove.trims import TrimResult
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import (
    ButtonRule,
    Channel,
    CodeLine,
    CommandRule,
    DirectionRuns,
    Input,
    Pulse,
    Run,
)
from servogen.units import Clock, Cycles

SCHEDULE = PulseSchedule(
    Clock(4_000_000),
    Cycles(20_000),
    (Channel("one", "RB0", "x"),),
    (),
    (Run(1, (Pulse(Cycles(0), Cycles(1000)),)),),
)
CLOSED = SearchResult(SearchAnswer.CLOSED, [])
REFINE = SearchResult(SearchAnswer.REFINE, [])
UNDECIDED = SearchResult(
    SearchAnswer.UNDECIDED, [], SearchFinding(0, (), 0, "too many ways", False, 0x12), open_nodes=1
)
WRONG = SearchFinding(0, (), 5, "wrong", True, 0x1A)


def missing(pc: int) -> SearchResult:
    return SearchResult(SearchAnswer.CUT, [], cut=pc)


def answered(
    monkeypatch: pytest.MonkeyPatch,
    results: list[SearchResult],
    over: Quantifiers = EVERYTHING,
    written: Sequence[Set[int]] = (frozenset(),),
    image: Image = Image({5: encode("SLEEP")}),  # noqa: B008 - frozen
    schedule: PulseSchedule = SCHEDULE,
) -> tuple[Proof, list[Any]]:
    """The answer if searches have these results and write these places, and the searches.

    The last of each goes on for all that follow.
    """
    asked: list[Any] = []

    def explorer(*given: Any) -> Any:
        _, transitions, spec, generaliser, phases, most, _, starts = given
        search = SimpleNamespace(
            transitions=transitions, spec=spec, phases=phases, most=most, starts=starts,
            stops=transitions.stops, cuts={*generaliser.cuts},
        )  # fmt: skip
        asked.append(search)
        assert len(asked) < 100, "it does not end"
        transitions.written |= written[min(len(asked), len(written)) - 1]
        search.search = lambda: results[min(len(asked), len(results)) - 1]
        return search

    monkeypatch.setattr(prover, "Explorer", explorer)
    monkeypatch.setattr(prover, "choose_cuts", lambda *_: {9: Guess()})
    monkeypatch.setattr(prover, "Machine", lambda *_, **keys: SimpleNamespace(chip_dependent=[]))
    return prove_for_all(image, schedule, over, max_states=77), asked


def test_inputs_are_free_only_where_the_schedule_says_what_they_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """RA2 is at 1 while nobody presses it."""
    rule = ButtonRule(Input("RA2", 0), None, True, 3)
    plain = replace(SCHEDULE, inputs=(Input("RA2", 1), Input("RB7", 0)))
    held = {PINS.index("RA2"): 1, PINS.index("RB7"): 0}
    line = CommandRule(CodeLine(Input("RA2", 1), 3, 5), (DirectionRuns("on", "01", (), (), ()),))
    for schedule, pins in (
        (plain, None),
        (replace(plain, buttons=rule), {PINS.index("RA2")}),
        (replace(plain, commands=line), {PINS.index("RA2")}),
    ):
        for over in (EVERYTHING, replace(EVERYTHING, inputs=False)):
            found, (search,) = answered(monkeypatch, [CLOSED], over, schedule=schedule)
            free = pins is not None and over is EVERYTHING
            assert found.held == ({} if free else held)
            assert search.spec.sampled == (pins if free else frozenset())


def test_a_prover_stops_before_what_needs_a_choice_and_runs_as_long_as_pulses_may_be_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    words = (
        encode("MOVF", f=6, d=0),
        encode("OPTION"),
        encode("SLEEP"),
        encode("BSF", f=8, b=1),
        encode("NOP"),
    )
    image = Image(dict(enumerate(words)))
    silent = replace(SCHEDULE, loop=(*SCHEDULE.loop, Run(2, (None,))))
    _, (search,) = answered(monkeypatch, [CLOSED], image=image, schedule=silent)
    assert search.stops == {0, 1, 2, 3, 9}
    # Fifty frames to the first pulse, and twice the longest silence, of three frames.
    assert search.transitions.limit == 50 * 20_000 + 2 * 3 * 20_000


def test_one_search_is_enough_if_it_closes(monkeypatch: pytest.MonkeyPatch) -> None:
    found, (search,) = answered(monkeypatch, [CLOSED])
    assert found.proven and list(found.cuts) == [9] and found.quantifiers is EVERYTHING
    # After any reset nothing is known of the RAM, and TMR0 begins in four ways.
    assert (search.phases, search.most, search.cuts, search.stops) == (4, 77, {9}, {5, 9})
    assert search.starts == [search.transitions.chip.after_reset(frozenset())]


def test_a_missing_cut_is_added_up_to_twelve_times(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = answered(monkeypatch, [missing(20), missing(21), CLOSED])
    assert found.proven and list(found.cuts) == [9, 20, 21]
    assert [search.cuts for search in asked] == [{9}, {9, 20}, {9, 20, 21}]
    assert asked[-1].stops == {5, 9, 20, 21}
    found, asked = answered(monkeypatch, [missing(20 + n) for n in range(20)])
    assert len(asked) == 13 and not found.proven
    assert found.reason.startswith("the cut points do not suffice")


def test_a_wrong_guess_is_refined_up_to_sixty_times(monkeypatch: pytest.MonkeyPatch) -> None:
    for results, proven, count in (([REFINE] * 60 + [CLOSED], True, 61), ([REFINE], False, 61)):
        found, asked = answered(monkeypatch, results)
        assert (found.proven, len(asked)) == (proven, count)
    found, asked = answered(monkeypatch, [UNDECIDED])
    assert found.reason == "too many ways (address 0x012, 0 states seen, 1 open)" and len(asked) == 1


def test_start_values_hold_only_where_the_program_never_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    known = Quantifiers(start=(("ram", 0),))
    written = [{3}, {3, 4}, {3, 4}]
    found, asked = answered(monkeypatch, [CLOSED], known, written)
    assert found.proven
    # What runs have written is unknown after a reset; once nothing is added, that is the proof.
    chip = asked[0].transitions.chip
    assert [search.starts for search in asked] == [
        [chip.power_on(), chip.after_reset(frozenset(places))] for places in (set(), {3}, {3, 4})
    ]
    found, asked = answered(monkeypatch, [CLOSED], written=written)
    assert found.proven and len(asked) == 1, "without start values, all of the RAM is unknown"
    quiet = Quantifiers(start=(("ram", 0),), resets=False, tmr0_phase=False)
    found, (search,) = answered(monkeypatch, [CLOSED], quiet)
    assert found.proven and (search.starts, search.phases) == ([search.transitions.chip.power_on()], 1)


@pytest.mark.parametrize(
    ("result", "message"),
    [
        (
            SearchResult(SearchAnswer.VIOLATED, [], WRONG, open_nodes=2),
            "wrong (address 0x01A, 0 states seen, 2 open)",
        ),
        (SearchResult(SearchAnswer.VIOLATED, [], replace(WRONG, certain=False)), ""),
        (SearchResult(SearchAnswer.UNDECIDED, [], WRONG), ""),
    ],
)
def test_only_a_certain_violation_is_looked_for_on_a_plain_chip(
    result: SearchResult, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[SearchFinding] = []
    shown: list[Any] = [None, object()]

    def concrete(case: Any, nodes: Any, finding: SearchFinding) -> Any:
        looked.append(finding)
        return shown[len(looked) - 1]

    monkeypatch.setattr(prover, "concrete", concrete)
    found, _ = answered(monkeypatch, [result])
    assert not found.proven and found.counterexample is None
    assert found.reason == (message or "wrong (address 0x01A, 0 states seen, 0 open)")
    assert looked == ([WRONG] if message else [])
    found, _ = answered(monkeypatch, [result])
    assert not found.proven and found.counterexample is (shown[1] if message else None)


# any EEPROM


class Trials:
    """Contents of the EEPROM: what shows a wrong edge."""

    erased_shows: Any = None
    search_shows: Any = None

    def __init__(self, *arguments: Any) -> None:
        self.asked: list[Any] = []
        Trials.last = self  # type: ignore[attr-defined]

    def erased(self) -> Any:
        return self.erased_shows

    def search(self, suspect: Any) -> Any:
        self.asked.append(suspect)
        return self.search_shows


def any_eeprom(
    monkeypatch: pytest.MonkeyPatch, outcome: TrimResult | Exception, result: SearchResult = CLOSED
) -> tuple[Proof, list[Any]]:
    """The answer for any EEPROM if the search has this result, and the proof of trims this one."""
    asked: list[Any] = []

    def trim_proof(*arguments: Any) -> Any:
        def prove(starts: Any) -> TrimResult:
            asked.append(starts)
            if isinstance(outcome, Exception):
                raise outcome
            return outcome

        return SimpleNamespace(prove=prove)

    monkeypatch.setattr(prover, "TrimSearch", Trials)
    monkeypatch.setattr(prover, "TrimProof", trim_proof)
    monkeypatch.setattr(prover, "rising_addresses", lambda *_: frozenset())
    found, searches = answered(monkeypatch, [result], Quantifiers(any_eeprom=True))
    assert all(starts == searches[0].starts for starts in asked)
    return found, asked


def test_a_proof_for_any_eeprom_names_the_trims_in_place_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    plain, _ = answered(monkeypatch, [CLOSED])
    found, _ = any_eeprom(monkeypatch, TrimResult({0: 5}, 200, 4))
    assert found.proven and found.runs == plain.runs + 200
    assert set(plain.assumptions) - set(found.assumptions) == {AS_IN_THE_FILE}
    (trims,) = set(found.assumptions) - set(plain.assumptions)
    assert trims.endswith("byte 5 of RB0")


def test_what_is_wrong_with_some_eeprom_is_shown_or_not_decided(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = WrongEdge("the fall is off", {5: 0x41}, 3)
    for outcome, reason, suspect in (
        (wrong, "any EEPROM: the fall is off (frame 3)", {5: 0x41}),
        (UndecidedTrims("the watchdog is on"), "any EEPROM: the watchdog is on", {}),
    ):
        found, _ = any_eeprom(monkeypatch, outcome)
        assert (found.proven, found.reason) == (False, reason)
        assert Trials.last.asked == [suspect]  # type: ignore[attr-defined]
    shown: Any = object()
    monkeypatch.setattr(Trials, "search_shows", shown)
    found, _ = any_eeprom(monkeypatch, wrong)
    assert (found.proven, found.reason, found.counterexample) == (False, "", shown)
    monkeypatch.setattr(Trials, "erased_shows", shown)
    found, asked = any_eeprom(monkeypatch, TrimResult({}, 1, 1))
    assert (found.proven, found.counterexample, asked) == (False, shown, [])


def test_other_interrupts_than_the_timer_s_are_not_decided_for_any_eeprom(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, asked = any_eeprom(monkeypatch, TrimResult({0: 5}, 200, 4), replace(CLOSED, asynchronous=True))
    assert (found.proven, found.reason) == (False, "any EEPROM: something other than TMR0 interrupts")
    assert not asked


def test_only_what_is_proven_is_asked_about_any_eeprom(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = any_eeprom(monkeypatch, TrimResult({}, 1, 1), UNDECIDED)
    assert found.reason.startswith("too many ways") and not asked


# the oscillator


@pytest.mark.parametrize(
    ("config", "shows"),
    [
        (None, True),
        # The two lowest bits of the configuration word are the oscillator: 11 is RC (DS35007 section 6.1).
        (0x3FF3, True),
        (0x3FF2, False),
        (0x3FF1, False),
        (0x3FF0, False),
    ],
)
def test_an_rc_oscillator_is_shown_to_be_slow_and_another_one_is_named(
    config: int | None, shows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    warnings = [SimpleNamespace(message="first"), SimpleNamespace(message="second")]
    monkeypatch.setattr(prover, "Machine", lambda *_, **keys: SimpleNamespace(chip_dependent=warnings))
    for slow in (object(), None):
        monkeypatch.setattr(prover, "slow_oscillator", lambda case, slow=slow: slow)
        found = prove_for_all(Image({}, config=config), SCHEDULE)
        assert not found.proven
        expected = (slow, "") if shows and slow else (None, "first; second")
        assert (found.counterexample, found.reason) == expected
