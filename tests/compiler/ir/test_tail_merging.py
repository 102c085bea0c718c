"""Equal ends before one label are kept once, but for instructions that must stay where they are."""

from __future__ import annotations

import pytest

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import STATUS, Byte, Instruction, Label, Z
from servogen.compiler.passes.tail_merging import merge_tails, tail_calls

A = Byte(Symbol("a", U8, "temp"), 0)


def two_ends(first_fixed: bool, second_fixed: bool) -> Function:
    """Two ways to f.end, each with CLRF a before it: one that jumps there and one that runs into it."""
    made = Function("f")
    made.extend(
        [
            Instruction("BTFSC", STATUS, b=Z),
            Instruction("GOTO", target="f.else"),
            Instruction("MOVLW", k=1),
            Instruction("CLRF", A, fixed=first_fixed),
            Instruction("GOTO", target="f.end"),
            Label("f.else"),
            Instruction("MOVLW", k=2),
            Instruction("CLRF", A, fixed=second_fixed),
            Label("f.end"),
            Instruction("RETURN"),
        ]
    )
    return made


def clears(made: Function) -> int:
    return sum(isinstance(each, Instruction) and each.op == "CLRF" for each in made.lines())


def test_equal_ends_are_merged() -> None:
    made = two_ends(False, False)
    assert merge_tails(made)
    assert clears(made) == 1


@pytest.mark.parametrize("fixed", [(True, False), (False, True), (True, True)])
def test_an_end_with_a_fixed_instruction_stays(fixed: tuple[bool, bool]) -> None:
    """What an asm statement wrote is neither dropped nor reached from elsewhere."""
    made = two_ends(*fixed)
    assert not merge_tails(made)
    assert clears(made) == 2


@pytest.mark.parametrize("fixed", [(False, False), (True, False), (False, True)])
def test_a_call_before_a_return_is_a_jump_unless_one_of_them_is_fixed(fixed: tuple[bool, bool]) -> None:
    made = Function("f")
    made.extend([Instruction("CALL", target="g", fixed=fixed[0]), Instruction("RETURN", fixed=fixed[1])])
    assert tail_calls(made) == (not any(fixed))
    found = [each.op for each in made.lines() if isinstance(each, Instruction)]
    assert found[0] == ("CALL" if any(fixed) else "GOTO")


def test_a_label_between_call_and_return_keeps_the_call() -> None:
    made = Function("f")
    made.extend([Instruction("CALL", target="g"), Label("f.end"), Instruction("RETURN")])
    assert not tail_calls(made)
