"""The checker of contracts: bounds exact to the cycle, hints that it does not trust, the judge's opinion."""

from __future__ import annotations

import random
import re
from fractions import Fraction
from itertools import islice

import numpy as np
import pytest

from servogen.checker import Hints, NotCovered, Refused, check_contract
from servogen.checker.watches import ClauseBroken, read_watches
from servogen.contract import judge_contract, parse_contract
from servogen.edges import EdgeChunk, EdgeTrace
from servogen.pic.image import Image
from servogen.prove.contract import prove_contract
from servogen.units import Cycles
from tests.prove.contract_attack import accepted, hidden_faults, short_subjects
from tests.prove.test_contract_proofs import (
    ANSWER,
    BRIDGE,
    CLOCK,
    NEVER,
    PULSE,
    READING,
    TICK,
    UNASKED,
    UNWRITTEN,
    WAVE,
    answer,
    image,
)

TICKS = '[[pulse]]\npin = "RB0"\nhigh_us = [249, 251]\nperiod_us = [498, 502]\n'
FIRST = '[[every]]\nevent = "RB3 rises"\nfirst_us = [{}, {}]\n'
LEVELS = '[[pulse]]\npin = "RB3"\nhigh_us = [10]\nlow_us = [0, {}]\n'
WHOLE = '[[pulse]]\npin = "RB3"\nhigh_us = [{}, {}]\n'
SOON = '[[response]]\nwhen = "RB0 falls"\nthen = "RB4 rises"\nwithin_us = [{}, 2000]\n'


def hints(program: Image, contract: str) -> Hints:
    """What the prover found."""
    found = prove_contract(program, parse_contract(contract, "c.toml").clauses(CLOCK), CLOCK)
    assert found.proven, found.reason
    return Hints(found.cuts, found.inputs)


@pytest.mark.parametrize(
    ("right", "contract", "wrong", "closer"),
    [
        (ANSWER.format(delay=""), answer(2, 6), ANSWER.format(delay="nop"), [answer(2, 5), answer(3, 6)]),
        (
            BRIDGE.format(first=2, second=4, between=""),
            NEVER,
            BRIDGE.format(first=2, second=6, between=""),
            [],
        ),
        (WAVE.format(turns=10), PULSE, WAVE.format(turns=11), [PULSE.replace("32, 32", "33, 33")]),
        (
            WAVE.format(turns=10),
            FIRST.format(4, 4),
            WAVE.replace("loop ", "nop\nloop ").format(turns=10),
            [FIRST.format(5, 9), FIRST.format(0, 3)],
        ),
        (TICK.format(reload=9), TICKS, TICK.format(reload=7), [TICKS.replace("251]", "249]")]),
        (READING, LEVELS.format(310), READING.replace(".50", ".62"), [LEVELS.format(254)]),
        (UNASKED.format(read="btfss PORTB, 0"), SOON.format(0), UNASKED.format(read="nop"), [SOON.format(5)]),
    ],
    ids=[
        "an input's answer",
        "a bridge",
        "a wave",
        "the first rise",
        "TMR0's interrupt",
        "reads meanwhile",
        "an unasked answer",
    ],
)
def test_what_is_proven_is_seen_and_a_cycle_beside_it_is_not(
    right: str, contract: str, wrong: str, closer: list[str]
) -> None:
    given = hints(image(right), contract)
    assert check_contract(image(right), contract, CLOCK, given).states
    for program, clauses in [(wrong, contract), *((right, each) for each in closer)]:
        with pytest.raises(Refused) as refused:
            check_contract(image(program), clauses, CLOCK, given)
        assert not isinstance(refused.value, NotCovered) and "at address 0x" in str(refused.value)


DRIVES = ANSWER.replace("poll ", " bsf STATUS, RP0\n bcf TRISB, 0\n bsf TRISB, 0\n bcf STATUS, RP0\npoll ", 1)
AGAIN = """
        clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        bsf     TRISB, 1
        bcf     STATUS, RP0
        bsf     PORTB, 3
        bsf     STATUS, RP0
        bcf     TRISB, 1
        bcf     STATUS, RP0
        bcf     PORTB, 1
        goto    $
"""
"""RB1 becomes an output for the second time with the level that BSF has read, whatever it was."""
ASLEEP = """
        clrf    PORTA
        clrf    {port}
        bsf     STATUS, RP0
        bcf     TRISB, 1
        bcf     STATUS, RP0
        sleep
        bcf     PORTB, 1
        goto    $
"""
"""RB1 is an output for two cycles, and for any number of them in SLEEP, before its first write."""
HIGH_TOGETHER = '[[never]]\ncondition = "RB1 high and RB3 high"\n'


@pytest.mark.parametrize(
    ("program", "contract", "what"),
    [
        (DRIVES, answer(2, 6), "RB0 is driven"),
        (AGAIN, HIGH_TOGETHER, "a pin whose level is unknown"),
        (WAVE, '[[count]]\nevent = "RB3 rises"\ntimes = [0, 9]\nwindow_us = 1000\n', "[[count]]"),
        (WAVE, PULSE + "duty_percent = [5, 15]\n", "duty_percent"),
        (WAVE, PULSE + "another_us = [5, 15]\n", "what it cannot read"),
        (WAVE, PULSE.replace("RB3", "RA4"), "RA4"),
        (WAVE, NEVER.replace(" and", "\tand").replace("RB2", "RB0"), "a clause about an input"),
    ],
    ids=[
        "an input is driven",
        "a latch is lost",
        "count",
        "duty",
        "unknown key",
        "open drain",
        "input",
    ],
)
def test_what_it_does_not_cover_is_said(program: str, contract: str, what: str) -> None:
    """An input that is an output for two cycles only, too."""
    with pytest.raises(NotCovered, match=re.escape(what)):
        check_contract(image(program.format(delay="", turns=10)), contract, CLOCK, Hints({}, 1 << 5))


def test_a_latch_that_is_not_written_at_first_has_either_level() -> None:
    """The pulse of one that is set begins with CLRF TRISB, a cycle nearer to XORWF than the XORWF before."""
    later = UNWRITTEN.replace("xorwf", "nop\n xorwf")
    assert check_contract(image(UNWRITTEN), WHOLE.format(154, 155), CLOCK, Hints({}, 0)).states
    for program, limits in ((UNWRITTEN, (155, 155)), (UNWRITTEN, (154, 154)), (later, (154, 155))):
        with pytest.raises(Refused, match=r"\[\[pulse\]\] high_us: at address 0x"):
            check_contract(image(program), WHOLE.format(*limits), CLOCK, Hints({}, 0))


def test_a_latch_that_is_not_written_before_sleep_has_either_level() -> None:
    low = HIGH_TOGETHER.replace(" and RB3 high", "")
    assert check_contract(image(ASLEEP.format(port="PORTB")), low, CLOCK, Hints({}, 0)).states
    with pytest.raises(Refused, match=r"RB1 high: at address 0x.*: more than 0 cycles"):
        check_contract(image(ASLEEP.format(port="0x20")), low, CLOCK, Hints({}, 0))


def test_a_number_too_small_to_count_is_read_at_once() -> None:
    """A whole number with as many digits as the exponent says would fill the memory."""
    contract = FIRST.format("1e-999999999", 4)
    assert check_contract(image(WAVE.format(turns=10)), contract, CLOCK, Hints({}, 0)).states


def test_more_cycles_than_are_allowed_end_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("servogen.checker.contract.MAX_CYCLES", 300)
    program = image(WAVE.format(turns=10))
    with pytest.raises(NotCovered, match="more states, or cycles, than are allowed"):
        check_contract(program, PULSE, CLOCK, Hints({}, 0))


def test_a_fault_that_no_plain_run_shows_is_refused_with_the_hints_of_the_right_program() -> None:
    every = short_subjects()
    right = {each.name: each.proof(each.image) for each in every}
    one_engine = [each.name for each in every if not accepted(each, each.image, right[each.name])]
    assert one_engine == ["polled"]  # its chip does not know TMR0 where no interrupt tells it
    faults = list(islice(hidden_faults(every, 3), 10))
    assert [what for _, each, what, fault in faults if accepted(each, fault, right[each.name])] == []


def test_no_hint_makes_a_wrong_program_right() -> None:
    """Too much is forgotten, or nothing; an input is called an output, or an output an input."""
    program, contract = image(ANSWER.format(delay="nop")), answer(2, 6)
    every = hints(image(ANSWER.format(delay="")), contract)
    names = frozenset().union(*every.cuts.values())
    for cuts in (
        {},
        every.cuts,
        dict.fromkeys(program.program, names),
        dict.fromkeys(every.cuts, frozenset()),
    ):
        for inputs in (every.inputs, 0, 0x1FFF):
            with pytest.raises(Refused):
                check_contract(program, contract, CLOCK, Hints(cuts, inputs))


def test_a_byte_that_decides_nothing_is_forgotten_where_the_hints_say_so() -> None:
    program = image(
        " clrf 0x20\n clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n"
        "again incf 0x20, f\n bsf PORTB, 1\n bcf PORTB, 1\n goto again\n"
    )
    contract = '[[pulse]]\npin = "RB1"\nhigh_us = [1, 1]\n'
    given = hints(program, contract)
    kept = Hints(dict.fromkeys(given.cuts, frozenset()), given.inputs)
    few, many = (check_contract(program, contract, CLOCK, each).states for each in (given, kept))
    assert few < 256 <= many


def test_a_check_may_take_what_is_allowed_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    program, contract = image(ANSWER.format(delay="")), answer(2, 6)
    given = hints(program, contract)
    took = check_contract(program, contract, CLOCK, given)
    for name, most in (("MAX_STOPS", took.states), ("MAX_CYCLES", took.cycles)):
        monkeypatch.setattr(f"servogen.checker.contract.{name}", most)
        assert check_contract(program, contract, CLOCK, given) == took
        monkeypatch.setattr(f"servogen.checker.contract.{name}", most - 1)
        with pytest.raises(NotCovered, match="more states, or cycles, than are allowed"):
            check_contract(program, contract, CLOCK, given)
        monkeypatch.undo()


CLAUSES = {
    "pulse": '[[pulse]]\npin = "RB1"\nhigh_us = [2, 9]\nlow_us = [1, 12]\nperiod_us = [4, 15]\n',
    "response": '[[response]]\nwhen = "RB1 falls"\nthen = "RB2 changes"\nwithin_us = [1, 14]\n',
    "never": '[[never]]\ncondition = "RB1 high and RB2 low"\nlonger_us = 3\n',
    "every": '[[every]]\nevent = "RB2 rises"\nfirst_us = [2, 30]\ngap_us = [3, 20]\n',
    "order": '[[order]]\nevents = ["RB1 rises", "RB2 changes", "RB1 falls", "RB2 changes"]\n',
    "serial": '[[serial]]\npin = "RB1"\nbaud = 200_000\ntolerance_percent = 5\n',
}


@pytest.mark.parametrize("kind", CLAUSES)
def test_the_watches_agree_with_the_judge_on_random_edges(kind: str) -> None:
    """Two readings of docs/contracts.md, on 300 short runs of which some keep the clause and some do not."""
    contract, rng, kept = CLAUSES[kind], random.Random(kind), 0
    for _ in range(300):
        moments, now, levels = [], 0, 0
        for _ in range(rng.randrange(7)):
            now += rng.choice((5, 5, 5, 10, 7)) if kind == "serial" else rng.randrange(1, 9)
            changed = rng.choice((1 << 6, 1 << 7, 3 << 6))
            moments.append((now, levels, levels ^ changed))
            levels ^= changed
        end = now + rng.randrange(1, 9)
        edges = [(at, pin, b >> pin & 1) for at, a, b in moments for pin in (6, 7) if (a ^ b) >> pin & 1]
        columns = np.array(edges, dtype=np.int64).reshape(-1, 3).T
        chunk = EdgeChunk(columns[0], columns[1].astype(np.uint8), columns[2].astype(np.uint8))
        clauses = parse_contract(contract, "c.toml").clauses(CLOCK)
        judged = judge_contract(clauses, EdgeTrace(CLOCK, (chunk,), Cycles(end)), from_reset=True)
        assert watched(contract, moments, end) == (not judged.violated), (moments, end)
        kept += not judged.violated
    assert 10 < kept < 290


def watched(contract: str, moments: list[tuple[int, int, int]], end: int) -> bool:
    """Whether the checker's watches find the levels right."""
    for watch in read_watches(contract, Fraction(1_000_000), 0):
        state, now = watch.start(), 0
        try:
            for at, before, after in moments:
                state = watch.change(watch.wait(state, at - now), before & watch.pins, after & watch.pins)
                now = at
            watch.wait(state, end - now)
        except ClauseBroken:
            return False
    return True


def test_an_event_out_of_its_turn_is_told_with_the_one_that_is_due() -> None:
    (watch,) = read_watches(CLAUSES["order"], Fraction(1_000_000), 0)
    for taken in (0, 2):  # RB2 changes where RB1 has to rise, or to fall
        with pytest.raises(ClauseBroken, match=f"^an event comes where number {taken + 1} is due$"):
            watch.change((taken,), 0, 1 << 7)
