"""A contract's file: what is wrong in it is told with its line; times become whole cycles."""

from __future__ import annotations

import pytest

from servogen.contract import load_contract, parse_contract
from servogen.contract.observers import PulseObserver
from servogen.errors import InputError
from servogen.units import Clock


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ('[[pulse]]\npin = "RC1"\nhigh_us = [1, 2]\n', 2, "there is no pin 'RC1'"),
        ('[[pulse]]\npin = "RB1"\n', 2, "the pulse says nothing"),
        ('[[pulse]]\npin = "RB1"\nhigh_us = [5, 2]\n', 3, "5 is more than 2"),
        (
            '[[pulse]]\npin = "RB1"\nhigh_us = [1.2, 1.7]\n',
            3,
            "no whole number of cycles of 1 µs lies in 1.2 to 1.7",
        ),
        ('[[pulse]]\npin = "RB1"\nhigh_us = [1, 2]\nduty_percent = [1, 2]\n', 4, "needs period_us"),
        ('[[pulse]]\npin = "RB1"\nhigh_ms = [1, 2]\n', 3, "is not given in ms: write high_us"),
        (
            '[[response]]\nwhen = "RB0 fall"\nthen = "RB1 rises"\nwithin_us = [0, 1]\n',
            2,
            "'RB0 fall' is not a pin",
        ),
        ('[[never]]\ncondition = "RB1 high or RB2 high"\n', 2, "is not levels of pins"),
        ('[[never]]\ncondition = "RB1 high and RB1 low"\n', 2, "names RB1 twice"),
        ('[[serial]]\npin = "RB5"\nbaud = 500_000\n', 3, "a bit is 2 cycles long at 4 MHz"),
        ('[[order]]\nevents = ["RB1 rises"]\n', 2, "at least 2"),
        ('[[order]]\nevents = ["RB1 rises", "RB1 rises"]\n', 2, "stands twice in turn"),
        ('[[every]]\nevent = "RB1 rises"\n', 2, "add first_us or gap_us"),
        ("clock_hz = 4_000_000\n", None, "says nothing"),
        ('[[puls]]\npin = "RB1"\n', 1, "unknown key 'puls'"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(text: str, line: int | None, message: str) -> None:
    with pytest.raises(InputError) as raised:
        parse_contract(text, "c.toml")
    assert raised.value.location is not None and raised.value.location.line == line
    assert message in str(raised.value)


def test_a_range_holds_the_whole_cycles_within_it() -> None:
    """995.5 to 1005.5 us are, at 10 MHz (a cycle is 0.4 us), 2489 to 2513 cycles: 995.6 to 1005.2 us."""
    contract = parse_contract('[[pulse]]\npin = "RB3"\nhigh_us = [995.5, 1005.5]\n', "c.toml")
    (clause,) = contract.clauses(Clock(10_000_000))
    assert isinstance(clause.observer, PulseObserver) and clause.observer.high is not None
    assert (clause.observer.high.least, clause.observer.high.most) == (2489, 2513)


def test_a_missing_file_is_an_input_error() -> None:
    with pytest.raises(InputError, match=r"none\.toml"):
        load_contract("none.toml")
