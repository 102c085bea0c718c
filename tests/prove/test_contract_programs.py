"""The programs with contracts: what the runner says of them, and that a fault in one is shown again."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.prove.contract_programs import Case, answer, ours

QUICK = ("dim_four", "heartbeat", "remote_control", "supervisor", "two_servos")


@pytest.fixture(scope="module")
def cases() -> dict[str, Case]:
    return {case.name: case for case in ours(QUICK)}


@pytest.mark.parametrize("name", QUICK)
def test_a_program_of_each_kind_is_proven(cases: dict[str, Case], name: str) -> None:
    case = cases[name]
    assert answer(case, case.run(), 20_000)[0].startswith("proven")


def test_a_contract_that_a_power_up_breaks_is_shown_on_the_simulator(cases: dict[str, Case]) -> None:
    """The first overflow of a TMR0 that was never written may come 256 ticks later than any other."""
    case = cases["two_servos"]
    late = '[[every]]\nevent = "RB1 rises"\nfirst_us = [0, 1900]\n'
    strict = replace(case, text=late)
    word, why, consistent = answer(strict, case.run(), 20_000)
    assert word == "counterexample" and consistent, why


def test_a_proof_that_a_plain_run_contradicts_is_told(cases: dict[str, Case]) -> None:
    case = cases["heartbeat"]
    never = '[[never]]\ncondition = "RB0 high"\n'
    wrong = replace(case, text=never)
    assert answer(case, wrong.run(), 20_000)[0::2] == ("proven, checked", False)
