"""Equal ends before one label are kept once, but for instructions that must stay where they are."""

from __future__ import annotations

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import STATUS, Byte, Instruction, Label, Z
from servogen.compiler.passes.tail_merging import merge_tails, tail_calls
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, check, function

A = Byte(Symbol("a", U8, "temp"), 0)


def two_ends(first_fixed: bool, second_fixed: bool) -> Function:
    """Two ways to f.end, each with CLRF a before it: one that jumps there and one that runs into it."""
    made = Function("f")
    made.extend(
        [
            Instruction("BTFSC", STATUS, b=Z), Instruction("GOTO", target="f.else"),
            Instruction("MOVLW", k=1), Instruction("CLRF", A, fixed=first_fixed),
            Instruction("GOTO", target="f.end"), Label("f.else"), Instruction("MOVLW", k=2),
            Instruction("CLRF", A, fixed=second_fixed), Label("f.end"), Instruction("RETURN"),
        ]
    )  # fmt: skip
    return made


def clears(made: Function) -> int:
    return sum(isinstance(each, Instruction) and each.op == "CLRF" for each in made.lines())


def test_equal_ends_are_merged() -> None:
    made = two_ends(False, False)
    assert merge_tails(made)
    assert clears(made) == 1


@every("fixed", [(True, False), (False, True), (True, True)])
def test_an_end_with_a_fixed_instruction_stays(fixed: tuple[bool, bool]) -> None:
    """What an asm statement wrote is neither dropped nor reached from elsewhere."""
    made = two_ends(*fixed)
    assert not merge_tails(made)
    assert clears(made) == 2


@every("fixed", [(False, False), (True, False), (False, True)])
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


TO_END = "BTFSC ga,0; GOTO o; {one}; GOTO e; o: {two}; e: RETURN"


@every(
    ("before", "after"),
    [
        # the longest run from the end
        (
            "BTFSC ga,0; GOTO o; MOVLW 1; CALL g; CLRF gb; GOTO e; o: MOVLW 2; CALL g; CLRF gb; e: RETURN",
            "BTFSC ga,0; GOTO o; MOVLW 1; GOTO f.tail0; o: MOVLW 2; f.tail0: CALL g; CLRF gb; e: RETURN",
        ),
        # two jumps to the same place
        (
            "BTFSC ga,0; GOTO o; MOVLW 1; CLRF gb; GOTO e; o: MOVLW 2; CLRF gb; GOTO e; NOP; e: RETURN",
            "BTFSC ga,0; GOTO o; MOVLW 1; f.tail0: CLRF gb; GOTO e; o: MOVLW 2; GOTO f.tail0; NOP; e: RETURN",
        ),
        # a name that is not used yet
        (
            "f.tail0: BTFSC ga,0; GOTO o; CLRF gb; GOTO e; o: MOVLW 2; CLRF gb; e: GOTO f.tail0",
            "f.tail0: BTFSC ga,0; GOTO o; GOTO f.tail1; o: MOVLW 2; f.tail1: CLRF gb; e: GOTO f.tail0",
        ),
        # other instructions, other places, delays, returns, skips
        (TO_END.format(one="CLRF gb", two="CLRF gc"), None),
        ("BTFSC ga,0; GOTO o; CLRF gb; GOTO x; o: CLRF gb; e: RETURN; x: NOP", None),
        (TO_END.format(one="DELAY 5", two="DELAY 5"), None),
        (TO_END.format(one="BTFSC gb,1; CLRF gc", two="BTFSS gb,1; CLRF gc"), None),
        ("BTFSC ga,0; GOTO o; CLRF gb; *GOTO e; o: CLRF gb; e: RETURN", None),
        ("CLRF gb; GOTO g; NOP; CLRF gb; RETURN", None),
        (
            TO_END.format(one="MOVLW 1; BTFSC gb,1; CLRF gc", two="MOVLW 2; BTFSC gb,1; CLRF gc"),
            "BTFSC ga,0; GOTO o; MOVLW 1; GOTO f.tail0; o: MOVLW 2; f.tail0: BTFSC gb,1; CLRF gc; e: RETURN",
        ),
        # a jump that may be skipped does not end a run
        ("CLRF gb; BTFSC ga,0; GOTO e; CLRF gb; BTFSC ga,0; GOTO e; NOP; e: RETURN", None),
        # what ends with a jump elsewhere does not fall into the label
        ("BTFSC ga,0; GOTO o; CLRF gb; GOTO e; o: CLRF gb; GOTO x; e: RETURN; x: NOP", None),
        # the run that falls in through several labels
        (
            "BTFSC ga,0; GOTO o; CLRF gb; GOTO e; o: CLRF gb; d: e: RETURN",
            "BTFSC ga,0; GOTO o; GOTO f.tail0; o: f.tail0: CLRF gb; d: e: RETURN",
        ),
        # from the first instruction on
        (
            "CLRF gb; GOTO e; MOVLW 1; CLRF gb; e: RETURN",
            "GOTO f.tail0; MOVLW 1; f.tail0: CLRF gb; e: RETURN",
        ),
        # from the first instruction on, with a register: no delay leads into it
        (
            "CLRF PORTB; GOTO e; o: CLRF PORTB; e: BTFSC ga,0; GOTO o; RETURN",
            "GOTO f.tail0; o: f.tail0: CLRF PORTB; e: BTFSC ga,0; GOTO o; RETURN",
        ),
        # jumped backwards: the end stands in front
        (
            "CLRF gb; e: RETURN; MOVLW 1; CLRF gb; GOTO e",
            "f.tail0: CLRF gb; e: RETURN; MOVLW 1; GOTO f.tail0",
        ),
    ],
)  # fmt: skip
def test_runs_before_a_label(before: str, after: str | None) -> None:
    check(merge_tails, before, after)


@every(
    ("before", "after"),
    [
        # the distance of a write from a delay must not change: the other one jumps
        (
            "BTFSC C; GOTO o; DELAY 9; CLRF PORTB; GOTO e; o: MOVLW 1; CLRF PORTB; GOTO e; NOP; e: RETURN",
            "BTFSC C; GOTO o; DELAY 9; f.tail0: CLRF PORTB; GOTO e; o: MOVLW 1; GOTO f.tail0; NOP; e: RETURN",
        ),
        (
            "BTFSC C; GOTO o; NOP; CLRF PORTB; GOTO e; o: DELAY 9; CLRF PORTB; GOTO e; NOP; e: RETURN",
            "BTFSC C; GOTO o; NOP; GOTO f.tail0; o: DELAY 9; f.tail0: CLRF PORTB; GOTO e; NOP; e: RETURN",
        ),
        # no jump can go in front of what falls into the label, and both follow a delay
        ("BTFSC C; GOTO o; DELAY 9; CLRF PORTB; GOTO e; o: NOP; CLRF PORTB; e: RETURN", None),
        (
            "BTFSC C; GOTO o; DELAY 9; CLRF PORTB; GOTO e; o: DELAY 8; CLRF PORTB; GOTO e; NOP; e: RETURN",
            None,
        ),
        ("BTFSC C; GOTO o; DELAY 9; CALL g; GOTO e; o: NOP; CALL g; e: RETURN", None),
        (
            "BTFSC C; GOTO o; CALL __delay_4; CLRF PORTB; GOTO e; o: NOP; CLRF PORTB; e: RETURN",
            None,
        ),
        # a branch in between, or nothing but variables
        (
            "BTFSC C; GOTO o; DELAY 9; CLRF gb; GOTO e; o: NOP; CLRF gb; e: RETURN",
            "BTFSC C; GOTO o; DELAY 9; GOTO f.tail0; o: NOP; f.tail0: CLRF gb; e: RETURN",
        ),
        (
            "BTFSC C; GOTO o; DELAY 9; BTFSC gb,1; NOP; CLRF PORTB; GOTO e; o: NOP; CLRF PORTB; e: RETURN",
            "BTFSC C; GOTO o; DELAY 9; BTFSC gb,1; NOP; GOTO f.tail0; o: NOP; f.tail0: CLRF PORTB; e: RETURN",
        ),
        (
            "DELAY 9; RETURN; NOP; BTFSC C; GOTO o; x: CLRF PORTB; GOTO e; o: NOP; CLRF PORTB; e: RETURN",
            "DELAY 9; RETURN; NOP; BTFSC C; GOTO o; x: GOTO f.tail0; o: NOP; f.tail0: CLRF PORTB; e: RETURN",
        ),
        # a label between is no branch
        ("BTFSC C; GOTO o; DELAY 9; x: CLRF PORTB; GOTO e; o: NOP; CLRF PORTB; e: RETURN", None),
    ],
)  # fmt: skip
def test_a_write_keeps_its_distance_from_a_delay(before: str, after: str | None) -> None:
    check(merge_tails, before, after)


def test_a_run_that_stands_behind_a_skip_in_one_place_is_not_shared() -> None:
    check(merge_tails, TO_END.format(one="BTFSC gb,1; CLRF gc", two="NOP; CLRF gc"), None)


def test_only_neighbours_are_joined_to_a_jump() -> None:
    check(tail_calls, "CALL g; CALL h; RETURN", "CALL g; GOTO h; RETURN")
    check(tail_calls, "CALL g; RETLW 3", None)
    check(tail_calls, "CALL g; RETFIE", None)
    made = function("CALL g; RETURN")
    next(made.instructions()).table = Names()["g"]
    assert not tail_calls(made), "a table is read by a CALL"
