"""`measure --contract`: what a run keeps is proposed with margins; one edge outside them breaks it."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import pytest

from servogen.contract import ContractVerdict, judge_contract, parse_contract, proposed_contract
from servogen.edges import PINS, EdgeTrace, edge_chunk
from servogen.errors import InputError
from servogen.units import Clock, Cycles

CLOCK = Clock(8_000_000)
"""Two cycles are a microsecond."""
END_US = 120_000

Change = tuple[int, str, int]
"""At which µs a pin gets a level."""


def servos() -> list[Change]:
    """RB0: 1000 or 1200 µs every 20 ms from 5 ms on; RB1 3 ms later, always 1500 µs; RB2 stays low."""
    changes = [(100, "RB2", 0)]
    for frame in range(6):
        rise = 5000 + 20_000 * frame
        changes += [(rise, "RB0", 1), (rise + (1200 if frame == 3 else 1000), "RB0", 0)]
        changes += [(rise + 3000, "RB1", 1), (rise + 4500, "RB1", 0)]
    return changes


def trace(changes: Sequence[Change]) -> EdgeTrace:
    rows = sorted((2 * us, PINS.index(pin), level) for us, pin, level in changes)
    return EdgeTrace(CLOCK, (edge_chunk(*zip(*rows, strict=True)),), Cycles(2 * END_US))


def proposed(changes: Sequence[Change], percent: str = "1", from_reset: bool = True) -> str:
    return proposed_contract(trace(changes), "a.hex", Fraction(percent) / 100, from_reset=from_reset)


def judged(text: str, changes: Sequence[Change], from_reset: bool = True) -> ContractVerdict:
    clauses = parse_contract(text, "c.toml").clauses(CLOCK)
    return judge_contract(clauses, trace(changes), from_reset=from_reset, capture=not from_reset)


def test_each_bound_is_what_was_seen_and_the_margin() -> None:
    """One percent of each end, and 2 µs where that is more: 1000 - 10, 1200 + 12; 5000 ± 50."""
    assert proposed(servos()).splitlines()[3:] == [
        *("", "[[pulse]]", 'pin = "RB0"', "high_us = [990, 1212]", "period_us = [19800, 20200]"),
        *("", "[[pulse]]", 'pin = "RB1"', "high_us = [1485, 1515]", "period_us = [19800, 20200]"),
        *("", "[[every]]", 'event = "RB0 rises"', "first_us = [4950, 5050]"),
        *("", "[[every]]", 'event = "RB1 rises"', "first_us = [7920, 8080]"),
        *("", "[[order]]", 'events = ["RB0 rises", "RB1 rises"]'),
        *("", "[[never]]", 'condition = "RB2 high"'),
    ]
    head = proposed(servos(), "0").splitlines()
    assert head[0].endswith("bounds are 0 % wider, and at least by 2 µs.")
    assert (head[2], head[6]) == ("clock_hz = 8000000", "high_us = [998, 1202]")


@pytest.mark.parametrize("from_reset", [True, False])
def test_the_run_that_it_was_made_from_keeps_every_clause(from_reset: bool) -> None:
    verdict = judged(proposed(servos(), from_reset=from_reset), servos(), from_reset)
    assert verdict.word == ("exact" if from_reset else "agrees")


@pytest.mark.parametrize(
    ("change", "clause"),
    [
        ({(6000, "RB0", 0): 6213}, "pulse of RB0"),
        ({(6000, "RB0", 0): 5989}, "pulse of RB0"),
        ({(48_000, "RB1", 1): 48_201, (49_500, "RB1", 0): 49_701}, "pulse of RB1"),
        ({(48_000, "RB1", 1): None, (49_500, "RB1", 0): None}, "pulse of RB1"),
        ({(5000, "RB0", 1): 4949}, "every: RB0"),
        ({(100, "RB2", 0): None, (0, "RB2", 1): 9000}, "never: RB2"),
    ],
    ids=["wide", "narrow", "late", "missing", "early", "output"],
)
def test_one_edge_outside_breaks_the_clause_that_is_about_it(
    change: dict[Change, int | None], clause: str
) -> None:
    moved = [(change.get(each, each[0]), *each[1:]) for each in servos()]
    moved += [(at, *each[1:]) for each, at in change.items() if each not in servos()]
    verdict = judged(proposed(servos()), [(at, pin, level) for at, pin, level in moved if at is not None])
    assert verdict.word == "violated"
    broken = [each.clause.text for each in verdict.clauses if each.breaches]
    assert any(text.startswith(clause) for text in broken), broken


def test_an_edge_within_the_margin_breaks_nothing() -> None:
    moved = [(us + 7 if (us, level) == (6000, 0) else us, pin, level) for us, pin, level in servos()]
    assert judged(proposed(servos()), moved).word == "exact"


def test_the_order_breaks_when_two_pins_change_places() -> None:
    swapped = [
        (us, {"RB0": "RB1", "RB1": "RB0"}.get(pin, pin) if us > 100_000 else pin, level)
        for us, pin, level in servos()
    ]
    broken = [each.clause.text for each in judged(proposed(servos()), swapped).clauses if each.breaches]
    assert "order: RB0 rises, RB1 rises" in broken


def test_a_motion_that_ends_keeps_its_own_contract() -> None:
    """The silence at the end is longer than any period, and a pulse that the end cuts than any width."""
    ending = [each for each in servos() if each[0] < 60_000]
    text = proposed(ending)
    assert "period_us = [19800, 75750]" in text  # from the last rise at 45 ms to the end at 120 ms
    assert judged(text, ending).word == "exact"
    cut = [*ending, (100_000, "RB0", 1)]
    assert "high_us = [990, 20200]" in proposed(cut)
    assert judged(proposed(cut), cut).word == "exact"


def test_without_a_pulse_there_is_nothing_to_propose() -> None:
    with pytest.raises(InputError, match="no pin has a whole pulse"):
        proposed([(100, "RB0", 0), (500, "RB0", 1)])
