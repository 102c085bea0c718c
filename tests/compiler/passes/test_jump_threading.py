"""Jumps to jumps, jumps to the next instruction, and skips around them."""

from __future__ import annotations

from servogen.compiler.passes.jump_threading import drop_jumps_to_next, thread_jumps
from tests.compiler.cases import every
from tests.compiler.ir.assembly import check, function, texts


@every(
    ("before", "after"),
    [
        ("GOTO a; CLRF gx; a: GOTO b; CLRF gy; b: NOP", "GOTO b; CLRF gx; a: GOTO b; CLRF gy; b: NOP"),
        ("GOTO a; CLRF gx; a: RETURN", "RETURN; CLRF gx; a: RETURN"),
        ("GOTO a; CLRF gx; a: RETFIE", "RETFIE; CLRF gx; a: RETFIE"),
        # a constant result would have to be copied, and a label behind another one leads to the same place
        ("GOTO a; CLRF gx; a: RETLW 3", None),
        ("GOTO a; CLRF gx; a: b: RETURN", "RETURN; CLRF gx; a: b: RETURN"),
        ("GOTO a; CLRF gx; a: NOP; GOTO b; b: RETURN", "GOTO a; CLRF gx; a: NOP; RETURN; b: RETURN"),
        # assembly stays, circles end, and so do jumps out of the function
        ("*GOTO a; CLRF gx; a: RETURN", None),
        ("GOTO a; CLRF gx; a: *RETURN", None),
        ("GOTO a; CLRF gx; a: *GOTO b; b: NOP", None),
        ("a: GOTO a", None),
        ("GOTO g; CLRF gx", None),
        ("CALL a; CLRF gx; a: RETURN", None),
    ],
)
def test_a_jump_leads_where_the_next_one_leads(before: str, after: str | None) -> None:
    check(thread_jumps, before, after)


@every("length", [1, 5, 10, 11])
def test_ten_jumps_are_followed_at_once(length: int) -> None:
    chain = "; ".join(f"l{number}: GOTO l{number + 1}" for number in range(length))
    made = function(f"GOTO l0; NOP; {chain}; l{length}: NOP")
    assert thread_jumps(made)
    assert texts(made)[0] == f"GOTO l{min(length, 10)}"


def test_jumps_in_a_circle_are_not_followed_for_long() -> None:
    made = function("GOTO a; NOP; a: GOTO b; NOP; b: GOTO a")
    assert thread_jumps(made)
    assert [text for text in texts(made) if text.startswith("GOTO")] != []


@every(
    ("before", "after"),
    [
        ("GOTO a; a: NOP", "a: NOP"),
        ("CLRF gx; GOTO a; a: NOP", "CLRF gx; a: NOP"),
        ("GOTO b; a: b: NOP", "a: b: NOP"), ("GOTO a; NOP; a: NOP", None), ("*GOTO a; a: NOP", None),
        ("GOTO a", None),
        # with the test that decides about it
        ("BTFSC Z; GOTO a; a: NOP", "a: NOP"),
        ("CLRF gx; BTFSS ga,3; GOTO a; a: NOP", "CLRF gx; a: NOP"),
        ("DECFSZ ga,F; GOTO a; a: NOP", None), ("BTFSC PORTB,7; GOTO a; a: NOP", None),
        ("BTFSC va,7; GOTO a; a: NOP", None), ("*BTFSC Z; GOTO a; a: NOP", None),
        ("BTFSC C; BTFSC Z; GOTO a; a: NOP", None), ("BTFSC Z; b: GOTO a; a: NOP", None),
    ],
)  # fmt: skip
def test_a_jump_to_the_next_instruction_goes(before: str, after: str | None) -> None:
    check(drop_jumps_to_next, before, after)


@every(
    ("before", "after"),
    [
        ("BTFSC Z; GOTO a; CLRF gx; a: NOP", "BTFSS Z; CLRF gx; a: NOP"),
        ("BTFSS Z; GOTO a; CLRF gx; a: NOP", "BTFSC Z; CLRF gx; a: NOP"),
        ("BTFSC Z; GOTO a; CLRF gx; GOTO a; b: NOP; a: NOP", "BTFSS Z; CLRF gx; GOTO a; b: NOP; a: NOP"),
        ("BTFSC Z; RETURN; CLRF gx; RETURN; b: NOP", "BTFSS Z; CLRF gx; RETURN; b: NOP"),
        ("BTFSC Z; GOTO a; CALL g; a: NOP", "BTFSS Z; CALL g; a: NOP"),
        # another place, two instructions, a label, a skip, a delay or assembly in between
        ("BTFSC Z; GOTO b; CLRF gx; a: NOP; b: NOP", None),
        ("BTFSC Z; GOTO a; CLRF gx; CLRF gy; a: NOP", None),
        ("BTFSC Z; GOTO a; CLRF gx; GOTO b; b: NOP; a: NOP", "BTFSC Z; GOTO a; CLRF gx; b: NOP; a: NOP"),
        ("BTFSC Z; GOTO a; c: CLRF gx; a: NOP", None),
        ("BTFSC Z; GOTO a; BTFSC C; a: NOP", None), ("BTFSC Z; GOTO a; DELAY 9; a: NOP", None),
        ("BTFSC Z; GOTO a; *CLRF gx; a: NOP", None), ("BTFSC Z; *GOTO a; CLRF gx; a: NOP", None),
        ("*BTFSC Z; GOTO a; CLRF gx; a: NOP", None),
        ("BTFSC Z; b: GOTO a; CLRF gx; a: NOP", None),
        ("BTFSC Z; NOP; CLRF gx; a: NOP", None), ("BTFSC Z; CALL a; CLRF gx; a: NOP", None),
        ("INCFSZ ga,F; GOTO a; CLRF gx; a: NOP", None),
        ("BTFSC C; BTFSC Z; GOTO a; CLRF gx; a: NOP", None),
        ("BTFSC Z; RETURN; CLRF gx; a: NOP", None), ("BTFSC Z; GOTO a; CLRF gx", None),
    ],
)  # fmt: skip
def test_a_jump_over_one_instruction_becomes_a_skip(before: str, after: str | None) -> None:
    check(drop_jumps_to_next, before, after)
