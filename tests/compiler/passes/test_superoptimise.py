"""How rules are read, found in a function and applied, with their literals and bytes filled in."""

from __future__ import annotations

import pytest

from servogen.compiler.ir.instruction import Instruction
from servogen.compiler.passes.liveness import Liveness
from servogen.compiler.passes.superoptimise import (
    Names as Bytes,
)
from servogen.compiler.passes.superoptimise import (
    RuleInstruction,
    dead_after,
    rule_instruction,
    rules,
    superoptimise,
)
from servogen.errors import Location
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, check, function, line

ALL_LIVE = "MOVWF gz; BTFSC Z; INCF gz,F; BTFSC C; INCF gz,F; RETURN"


@every(
    ("text", "expected"),
    [
        ("ADDWF a,F", RuleInstruction("ADDWF", "a", 1)),
        ("ADDWF b,W", RuleInstruction("ADDWF", "b", 0)),
        ("MOVLW 3", RuleInstruction("MOVLW", k=3)),
        ("MOVLW 0", RuleInstruction("MOVLW", k=0)),
        ("MOVLW k", RuleInstruction("MOVLW", k="k")),
        ("BTFSC C", RuleInstruction("BTFSC", "C")),
        ("BSF a.7", RuleInstruction("BSF", "a", b=7)),
        ("BSF a.0", RuleInstruction("BSF", "a", b=0)),
        ("CLRF b", RuleInstruction("CLRF", "b")),
        ("CLRW", RuleInstruction("CLRW")),
    ],
)
def test_the_text_of_a_rules_instruction(text: str, expected: RuleInstruction) -> None:
    assert RuleInstruction.parse(text) == expected
    assert str(expected) == text


@every("text", ["ADDWF c,F", "BSF a.8", "addwf a,F", "MOVLW x", "ADDWF a,F ", ""])
def test_another_text_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="is not an instruction of a rule"):
        RuleInstruction.parse(text)


def test_rules_that_save_most_come_first() -> None:
    saved = [len(rule.old) - len(rule.new) for rule in rules()]
    assert saved == sorted(saved, reverse=True) and saved[-1] >= 1
    for one, two in zip(rules(), rules()[1:], strict=False):
        if len(one.old) - len(one.new) == len(two.old) - len(two.new):
            assert len(one.old) <= len(two.old)


@every(
    ("text", "expected"),
    [
        ("ADDWF ga,F", "ADDWF a,F"),
        ("ADDWF gb,W", "ADDWF b,W"),
        ("MOVLW 7", "MOVLW 7"),
        ("CLRW", "CLRW"),
        ("BSF ga,3", "BSF a.3"),
        ("BTFSC Z", "BTFSC Z"),
        ("BCF C", "BCF C"),
        # a third byte, RP0, STATUS as a whole, registers, and what others can see
        ("ADDWF gc,F", None),
        ("BSF RP0", None),
        ("MOVF STATUS,W", None),
        ("MOVF PORTB,W", None),
        ("MOVF va,W", None),
        ("MOVF fa,W", None),
        ("MOVLW ga", None),
        ("*MOVLW 3", None),
        ("GOTO x", None),
        ("CALL x", None),
        ("NOP", None),
        ("DELAY 3", None),
    ],
)
def test_an_instruction_as_rules_write_it(text: str, expected: str | None) -> None:
    names = Names()
    known: Bytes = {}
    for first in ("MOVF ga,W", "MOVF gb,W"):
        ins = line(first, names)
        assert isinstance(ins, Instruction)
        rule_instruction(ins, known)
    ins = line(text, names)
    assert isinstance(ins, Instruction)
    found = rule_instruction(ins, known)
    assert (None if found is None else str(found)) == expected
    assert list(known.values()) == ["a", "b"]


def test_what_is_not_needed_behind_an_instruction() -> None:
    names = Names()
    made = function("MOVF t,W; MOVWF t1; MOVWF ga; BTFSC Z; CLRF t1; MOVF t1,W; MOVWF gb; RETURN", names)
    code = list(made.instructions())
    live = Liveness(made)
    known: Bytes = {names.loc(name): short for name, short in (("t", "a"), ("t1", "b"))}  # type: ignore[misc]
    assert dead_after(code[1], known, live) == {"C", "D", "a"}
    assert dead_after(code[2], known, live) == {"C", "D", "W", "a"}
    assert dead_after(code[6], known, live) == {"C", "D", "Z", "W", "a", "b"}
    # a global variable is always needed
    assert dead_after(code[6], {names.loc("ga"): "a"}, live) == {"C", "D", "Z", "W"}  # type: ignore[dict-item]


@every(
    ("before", "after"),
    [
        # MOVF a,W; XORLW 255 -> COMF a,W, whatever is needed
        ("MOVF ga,W; XORLW 255; MOVWF gz; RETURN", "COMF ga,W; MOVWF gz; RETURN"),
        ("MOVF ga,W; XORLW 254; MOVWF gz; RETURN", None),
        # a literal that stands for any: the same one in both places
        ("MOVLW 9; XORLW 9; BTFSC Z; CLRF gz; RETURN", "ANDLW 0; BTFSC Z; CLRF gz; RETURN"),
        ("MOVLW 9; XORLW 8; MOVWF ga; BTFSC Z; CLRF gz; RETURN", None),
        # a byte of its own, and the flags, only where they are not needed
        ("INCF t,F; MOVF t,W; MOVWF gz; RETURN", "INCF t,W; MOVWF gz; RETURN"),
        ("INCF t,F; MOVF t,W; MOVWF gz; MOVF t,W; MOVWF ga; RETURN", None),
        (f"INCF t,F; MOVF t,W; BTFSC DC; CLRF gy; {ALL_LIVE}", f"INCF t,W; BTFSC DC; CLRF gy; {ALL_LIVE}"),
        ("INCF ga,F; MOVF ga,W; MOVWF gz; RETURN", None),
        ("MOVWF ga; CLRF ga; RETURN", "CLRF ga; RETURN"),
        ("MOVWF ga; CLRF gb; RETURN", None),
        # bits of STATUS keep their numbers
        ("BCF C; RRF ga,W; CLRW; MOVWF gz; BTFSC C; CLRF gz; RETURN",
         "RRF ga,W; CLRW; MOVWF gz; BTFSC C; CLRF gz; RETURN"),
        # behind a skip, in front of a label, and across one
        ("BTFSC gx,1; MOVWF ga; CLRF ga; RETURN", None),
        ("MOVWF ga; a: CLRF ga; GOTO a", None),
        ("a: MOVWF ga; CLRF ga; GOTO a", "a: CLRF ga; GOTO a"),
        ("MOVWF ga; CLRF ga; MOVWF gb; CLRF gb; RETURN", "CLRF ga; MOVWF gb; CLRF gb; RETURN"),
        ("*MOVWF ga; CLRF ga; RETURN", None),
    ],
)  # fmt: skip
def test_a_rule_is_applied(before: str, after: str | None) -> None:
    check(superoptimise, before, after)


def test_what_is_new_stands_where_the_first_instruction_stood() -> None:
    made = function("MOVF ga,W; XORLW 255; MOVWF gz; RETURN")
    for number, ins in enumerate(made.instructions(), 1):
        ins.place = Location("main.c", number)
    assert superoptimise(made)
    assert [ins.place.line for ins in made.instructions() if ins.place] == [1, 3, 4]


def test_a_function_may_end_within_what_a_rule_replaces() -> None:
    """As it does where its last instruction does not come back."""
    made = function("a: GOTO a; MOVWF ga", Names())
    assert superoptimise(made) is False
