"""How the prover goes on: cuts that are missing, guesses that are wrong, start values, any EEPROM."""

from __future__ import annotations

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
from servogen.prove.prover import AS_IN_THE_FILE, Proof, _Prover
from servogen.prove.quantifiers import EVERYTHING, Quantifiers
from servogen.prove.specification import Specification
from servogen.prove.tables import UndecidedTrims
from servogen.prove.trim_pulses import WrongEdge
from servogen.prove.trims import Trimmed
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
from servogen.simulator import SimulatorOptions
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


def missing(pc: int) -> SearchResult:
    return SearchResult(SearchAnswer.CUT, [], cut=pc)


class Transitions:
    """What the prover sets and reads of the transitions."""

    def __init__(self) -> None:
        self.stops: list[set[int]] = []
        self.written: set[int] = set()
        self.runs, self.cycles = 3, 700

    def stop_at(self, stops: Any) -> None:
        self.stops.append(set(stops))


class Chip:
    watchdog = False
    released: int = 0

    def power_on(self) -> Any:
        return "power-on"

    def after_reset(self, written: frozenset[int]) -> Any:
        return "reset", written


def prover_of(
    monkeypatch: pytest.MonkeyPatch, results: list[SearchResult], **changes: Any
) -> tuple[Any, list[dict[str, Any]]]:
    """A prover whose searches have these results, and what they were asked."""
    asked: list[dict[str, Any]] = []

    class Explorer:
        def __init__(self, program: Any, transitions: Any, spec: Any, generaliser: Any, *more: Any) -> None:
            phases, most, _, starts = more
            asked.append(
                {"phases": phases, "starts": list(starts), "cuts": set(generaliser.cuts), "most": most}
            )

        def search(self) -> SearchResult:
            assert len(asked) < 100, "it does not end"
            result = results[min(len(asked), len(results)) - 1]
            one._transitions.written |= written[min(len(asked), len(written)) - 1]
            return result

    written = changes.pop("written", [set()])
    monkeypatch.setattr(prover, "Explorer", Explorer)
    monkeypatch.setattr(prover, "choose_cuts", lambda *_: {9: Guess()})
    monkeypatch.setattr(_Prover, "_unfit_oscillator", lambda self: None)
    one: Any = _Prover.__new__(_Prover)
    values = {
        "_schedule": SCHEDULE, "_quantifiers": EVERYTHING, "_held": {}, "_board": SimulatorOptions(),
        "_write_us": 20_000, "_chip": Chip(), "_program": SimpleNamespace(eeprom_accesses=frozenset()),
        "_image": Image({}), "_spec": Specification(SCHEDULE, None), "_cuts": set(),
        "_transitions": Transitions(),
        "_always": frozenset({1}), "_max_states": 77, "_tell": None, "_longest": None,
    }  # fmt: skip
    for name, value in (values | changes).items():
        setattr(one, name, value)
    return one, asked


def test_inputs_are_free_only_where_the_schedule_says_what_they_do() -> None:
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
        for quantifiers in (
            EVERYTHING,
            replace(EVERYTHING, inputs=False),
            replace(EVERYTHING, any_eeprom=True),
        ):
            one = _Prover(Image({}), schedule, quantifiers, SimulatorOptions(), lambda *_: None, 7)
            free = pins is not None and quantifiers is EVERYTHING
            assert one._held == ({} if free else held)
            assert one._spec.sampled == (pins if free else frozenset())


def test_a_prover_stops_before_what_needs_a_choice_and_runs_as_long_as_pulses_may_be_apart() -> None:
    words = ("MOVF", {"f": 6, "d": 0}), ("OPTION", {}), ("SLEEP", {}), ("BSF", {"f": 8, "b": 1}), ("NOP", {})
    image = Image({n: encode(name, **operands) for n, (name, operands) in enumerate(words)})
    silent = replace(SCHEDULE, loop=(*SCHEDULE.loop, Run(2, (None,))))
    board = SimulatorOptions(eeprom_write_us=4500)
    one = _Prover(image, silent, EVERYTHING, board, lambda *_: None, 7)
    assert one._always == {0, 1, 2, 3}
    # Fifty frames to the first pulse, and twice the longest silence, of three frames.
    assert one._transitions.limit == 50 * 20_000 + 2 * 3 * 20_000
    # DS35007, parameter D122: a write takes 20 ms at most.
    assert (one._write_us, one._longest) == (20_000, 20_000)
    fixed = _Prover(image, silent, replace(EVERYTHING, eeprom_write=False), board, lambda *_: None, 7)
    assert (fixed._write_us, fixed._longest) == (4500, None)
    started = replace(EVERYTHING, start=(("w", 3),))
    assert _Prover(image, silent, started, board, lambda *_: None, 7)._board.start == (("w", 3),)


def test_one_search_is_enough_if_it_closes(monkeypatch: pytest.MonkeyPatch) -> None:
    one, asked = prover_of(monkeypatch, [CLOSED])
    found = one.prove()
    assert found.proven and found.cuts == (9,) and found.quantifiers is EVERYTHING
    # After any reset nothing is known of the RAM, and TMR0 begins in four ways.
    assert asked == [{"phases": 4, "starts": [("reset", frozenset())], "cuts": {9}, "most": 77}]
    assert one._transitions.stops == [{1, 9}]


def test_a_missing_cut_is_added_up_to_twelve_times(monkeypatch: pytest.MonkeyPatch) -> None:
    one, asked = prover_of(monkeypatch, [missing(20), missing(21), CLOSED])
    found = one.prove()
    assert found.proven and found.cuts == (9, 20, 21)
    assert [each["cuts"] for each in asked] == [{9}, {9, 20}, {9, 20, 21}]
    assert one._transitions.stops[-1] == {1, 9, 20, 21}
    one, asked = prover_of(monkeypatch, [missing(20 + n) for n in range(20)])
    found = one.prove()
    assert len(asked) == 13 and not found.proven
    assert found.reason.startswith("the cut points do not suffice")


def test_a_wrong_guess_is_refined_up_to_sixty_times(monkeypatch: pytest.MonkeyPatch) -> None:
    one, asked = prover_of(monkeypatch, [REFINE] * 60 + [CLOSED])
    assert one.prove().proven and len(asked) == 61
    one, asked = prover_of(monkeypatch, [REFINE])
    assert not one.prove().proven and len(asked) == 61
    one, asked = prover_of(monkeypatch, [UNDECIDED])
    assert one.prove().reason == "too many ways (address 0x012, 0 states seen, 1 open)" and len(asked) == 1


def test_start_values_hold_only_where_the_program_never_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    known = Quantifiers(start=(("ram", 0),))
    written = [{3}, {3, 4}, {3, 4}]
    one, asked = prover_of(monkeypatch, [CLOSED], _quantifiers=known, written=written)
    assert one.prove().proven
    # What runs have written is unknown after a reset; once nothing is added, that is the proof.
    assert [each["starts"] for each in asked] == [
        ["power-on", ("reset", frozenset(places))] for places in (set(), {3}, {3, 4})
    ]
    one, asked = prover_of(monkeypatch, [CLOSED], written=written)
    assert one.prove().proven and len(asked) == 1, "without start values, all of the RAM is unknown"
    quiet = Quantifiers(start=(("ram", 0),), resets=False, tmr0_phase=False)
    one, asked = prover_of(monkeypatch, [CLOSED], _quantifiers=quiet)
    assert one.prove().proven
    assert asked[0]["starts"] == ["power-on"] and asked[0]["phases"] == 1


# any EEPROM

PLAIN = Proof(True, None, "", ("this", AS_IN_THE_FILE, "that"), EVERYTHING, 3, 10, Cycles(5))


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


def any_eeprom(monkeypatch: pytest.MonkeyPatch, outcome: Any, plain: Proof = PLAIN) -> Proof:
    class Search:
        def __init__(self, *arguments: Any) -> None:
            pass

        def prove(self, starts: Any) -> Trimmed:
            assert starts == ["start", frozenset({7})]
            if isinstance(outcome, Exception):
                raise outcome
            assert isinstance(outcome, Trimmed)
            return outcome

    one, _ = prover_of(monkeypatch, [CLOSED])
    monkeypatch.setattr(prover, "TrimSearch", Trials)
    monkeypatch.setattr(prover, "TrimProof", Search)
    monkeypatch.setattr(prover, "AbstractChip", lambda *_: SimpleNamespace(released=0))
    monkeypatch.setattr(prover, "rising_addresses", lambda *_: frozenset())
    monkeypatch.setattr(_Prover, "_assumptions", lambda self: PLAIN.assumptions)
    monkeypatch.setattr(prover, "starts_of", lambda chip, over, written: ["start", written])
    found = one._any_eeprom(plain, SimpleNamespace(), frozenset({7}))
    assert isinstance(found, Proof)
    return found


def test_a_proof_for_any_eeprom_names_the_trims_in_place_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    found = any_eeprom(monkeypatch, Trimmed({0: 5}, 200, 4))
    assert found.proven and found.runs == 210
    assert found.assumptions[:2] == ("this", "that") and len(found.assumptions) == 3
    assert found.assumptions[2].endswith("byte 5 of RB0")


def test_what_is_wrong_with_some_eeprom_is_shown_or_not_decided(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = WrongEdge("the fall is off", {5: 0x41}, 3)
    found = any_eeprom(monkeypatch, wrong)
    assert (found.proven, found.reason) == (False, "any EEPROM: the fall is off (frame 3)")
    assert Trials.last.asked == [{5: 0x41}]  # type: ignore[attr-defined]
    found = any_eeprom(monkeypatch, UndecidedTrims("the watchdog is on"))
    assert (found.proven, found.reason) == (False, "any EEPROM: the watchdog is on")
    assert Trials.last.asked == [{}]  # type: ignore[attr-defined]
    shown: Any = object()
    monkeypatch.setattr(Trials, "search_shows", shown)
    found = any_eeprom(monkeypatch, wrong)
    assert (found.proven, found.reason, found.counterexample) == (False, "", shown)
    monkeypatch.setattr(Trials, "erased_shows", "erased")
    found = any_eeprom(monkeypatch, Trimmed({}, 1, 1))
    assert (found.proven, found.counterexample) == (False, "erased")


def test_other_interrupts_than_the_timer_s_are_not_decided_for_any_eeprom(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = any_eeprom(monkeypatch, Trimmed({0: 5}, 200, 4), replace(PLAIN, asynchronous=True))
    assert (found.proven, found.reason) == (False, "any EEPROM: something other than TMR0 interrupts")


def test_only_what_is_proven_is_asked_about_any_eeprom(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def more(self: Any, plain: Proof, generaliser: Any, written: frozenset[int]) -> str:
        asked.append((plain.proven, written))
        return "the answer"

    monkeypatch.setattr(_Prover, "_any_eeprom", more)
    every = Quantifiers(any_eeprom=True)
    one, _ = prover_of(monkeypatch, [CLOSED], _quantifiers=every)
    assert one.prove() == "the answer" and asked == [(True, frozenset())]
    one, _ = prover_of(monkeypatch, [UNDECIDED], _quantifiers=every)
    assert one.prove().reason.startswith("too many ways") and len(asked) == 1
    one, _ = prover_of(monkeypatch, [CLOSED])
    assert one.prove().proven and len(asked) == 1


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
    unfit = _Prover._unfit_oscillator
    one, _ = prover_of(monkeypatch, [CLOSED], _image=Image({}, config=config))
    slow: Any = object()
    warnings: list[Any] = []
    monkeypatch.setattr(prover, "Machine", lambda *_, **keys: SimpleNamespace(chip_dependent=warnings))
    monkeypatch.setattr(prover, "slow_oscillator", lambda case: slow)
    assert unfit(one) is None
    warnings += [SimpleNamespace(message="first"), SimpleNamespace(message="second")]
    found = unfit(one)
    assert found is not None and not found.proven
    assert (found.counterexample, found.reason) == ((slow, "") if shows else (None, "first; second"))
    slow = None
    found = unfit(one)
    assert found is not None and (found.counterexample, found.reason) == (None, "first; second")
