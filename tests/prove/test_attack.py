"""The runner of the attack: a counterexample counts only if `servogen simulate` repeats it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from servogen.pic.isa import decode
from servogen.prove import prove_for_all
from servogen.simulator import Machine
from tests.prove import attack
from tests.prove.attack_programs import programs


def test_a_counterexample_is_repeated_and_what_is_right_is_not_taken_for_one(tmp_path: Path) -> None:
    case = attack.target("TMR0 absolutely")
    address = next(a for a, word in case.image.program.items() if "INCF" in str(decode(word)))
    mutant = replace(case.image, program={**case.image.program, address: 0x2800 | address + 1})
    assert attack.answered(case, mutant, tmp_path, 2000) == attack.REPLAYED
    assert attack.answered(case, case.image, tmp_path, 2000) == "proven"
    end = 40 * case.plan.period
    machine = Machine(case.image, case.schedule.clock)
    assert not attack.judged(case, case.image, machine.run(end), machine, end - 2 * case.plan.period)


@pytest.mark.campaign
def test_a_start_that_comes_later_on_some_chips_is_not_a_fault() -> None:
    """TRISB gets W: if RB1 stays an input by chance, the pulses begin when the program starts again."""
    case = attack.target("resets itself")
    load = next(a for a, word in case.image.program.items() if word == 0x30FD)
    late = replace(case.image, program={**case.image.program, load: 0})
    seeds = [replace(attack.as_verified(case), start_seed=seed) for seed in range(8)]
    assert all(attack.is_right(case, late, around) for around in seeds)
    assert prove_for_all(late, case.schedule).proven


@pytest.mark.parametrize("name", [*programs(), "start and stop"])
def test_the_programs_are_right_whatever_comes_in(name: str) -> None:
    case = attack.target(name)
    assert attack.is_right(case, case.image, attack.as_verified(case))
