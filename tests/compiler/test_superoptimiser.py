"""The superoptimiser's search: what it lists is all there is, and what it finds is shorter and proven."""

from __future__ import annotations

from collections import Counter
from itertools import product

import pytest

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Byte, Instruction
from servogen.compiler.passes.superoptimise import RuleInstruction
from tools.superoptimiser.__main__ import proven
from tools.superoptimiser.corpus import windows
from tools.superoptimiser.enumeration import (
    SIMPLE,
    SKIPS,
    Behaviours,
    Coverage,
    Enumeration,
    Sequence_,
    Sought,
    hashed,
    parse,
    samples,
)
from tools.superoptimiser.machine import run
from tools.superoptimiser.proof import can_be_proven, differing, holds


def sought(old: str, dead: str = "") -> Sought:
    return Sought(parse(*old.split("; ")), frozenset(dead))


SHORTER = {
    sought("MOVF a,W; XORLW 255", "CD"): "COMF a,W",
    sought("MOVF b,W; ADDWF a,F; INCF a,W", "CDa"): "INCF b,W; ADDWF a,W",
    sought("MOVLW 0; BTFSC a.0; MOVLW 1", "Z"): "MOVLW 1; ANDWF a,W",
    sought("SWAPF a,W; ANDLW 15; ADDWF b,F"): "",  # there is nothing shorter
}


@pytest.fixture(scope="module")
def searched() -> tuple[list[Coverage], Behaviours]:
    behaviours = Behaviours(list(SHORTER))
    said: list[str] = []
    covered = Enumeration(3, behaviours, 1000.0, {}, said.append).run()
    assert "3 instructions: 100.0 % of" in said[2]
    return covered, behaviours


def canonical() -> dict[int, list[Sequence_]]:
    """All sequences of one and two instructions that name `a` before `b`."""
    pairs = [*product(SIMPLE, SIMPLE), *product(SKIPS, SIMPLE)]
    return {
        length: [each for each in some if next((ins.f for ins in each if ins.f in ("a", "b")), "a") == "a"]
        for length, some in ((1, [(each,) for each in SIMPLE]), (2, pairs))
    }


def test_every_short_sequence_is_listed_or_has_a_part_that_is_not_needed(
    searched: tuple[list[Coverage], Behaviours],
) -> None:
    """The counts agree with running each sequence on its own."""
    start = {name: value[None] for name, value in samples().items()}
    known = {hashed(start).tobytes()}
    for coverage, (length, sequences) in zip(searched[0], canonical().items(), strict=False):
        found = {hashed(run(each, start)).tobytes() for each in sequences}
        assert (coverage.length, coverage.all) == (length, len(sequences))
        assert coverage.complete
        assert coverage.new == len(found - known)
        known |= found


@pytest.mark.parametrize("each", SHORTER, ids=lambda each: "; ".join(map(str, each.old)))
def test_the_shortest_sequence_is_found(each: Sought, searched: tuple[list[Coverage], Behaviours]) -> None:
    new = proven(each, searched[1].candidates[each])
    assert ("" if new is None else "; ".join(map(str, new))) == SHORTER[each]


def test_without_time_nothing_is_covered_and_that_is_said() -> None:
    covered = Enumeration(3, Behaviours(list(SHORTER)), 0.0, {}, lambda _: None).run()
    assert [each.length for each in covered] == [1, 2]
    assert covered[0].complete and not covered[1].complete


def test_what_occurs_often_comes_first() -> None:
    often = parse("SWAPF a,W", "ANDLW 15")
    search = Enumeration(4, Behaviours([]), 0.0, {often: 3}, lambda _: None)
    tails = [tuple([*SIMPLE, *SKIPS][number] for number in tail) for *_, tail in search._shapes(4)[:2]]
    assert tails == [often, parse("SWAPF b,W", "ANDLW 15")]


def test_a_proof_tries_all_values_of_three_bytes() -> None:
    old = parse("ADDWF a,W", "ADDWF b,W")
    assert differing(old, parse("ADDWF b,W", "ADDWF a,W")) == {"C", "D"}
    assert holds(old, parse("ADDWF b,W", "ADDWF a,W"), {"C", "D"})
    assert not holds(old, parse("ADDWF b,W", "IORWF a,W"), {"C", "D", "Z"})
    # these differ only where W, a and b are all 255
    ones = "ANDWF a,W", "ANDWF b,W", "ADDLW 1"
    assert differing(parse(*ones, "MOVLW 0", "BTFSC C", "MOVLW 1"), parse("MOVLW 0")) == {"W", "C", "D", "Z"}
    assert can_be_proven(old, old)
    assert not can_be_proven(parse("ADDLW k", "ADDWF a,W", "ADDWF b,W"), ())  # W, a, b and k


def test_a_name_that_is_not_read_must_pass_through() -> None:
    assert differing(parse("MOVF a,W"), parse("MOVF a,W", "MOVWF b")) == {"b"}
    assert differing(parse("BTFSC C", "MOVLW 37"), parse("BTFSC C", "MOVLW 38")) == {"W"}
    assert differing(parse("BTFSC C", "MOVLW 37"), ()) == {"W"}


def test_windows_have_one_literal_for_all_at_most() -> None:
    a = Byte(Symbol("a", U8, "local", function="f"), 0)
    function = Function("f", result=a.symbol)
    function.extend(
        [
            Instruction("MOVLW", k=7),
            Instruction("XORLW", k=1),
            Instruction("MOVWF", a),
            Instruction("MOVLW", k=9),
            Instruction("RETURN"),
        ]
    )
    found = Counter("; ".join(map(str, each.old)) for each in windows(function, 4))
    assert found == Counter(
        [
            "MOVLW k; XORLW 1",
            "MOVLW k; XORLW 1; MOVWF a",
            "XORLW 1; MOVWF a",
            "XORLW k; MOVWF a",
            "XORLW 1; MOVWF a; MOVLW k",
            "MOVWF a; MOVLW k",
        ]
    )
    assert all(isinstance(ins, RuleInstruction) for each in windows(function, 4) for ins in each.old)
