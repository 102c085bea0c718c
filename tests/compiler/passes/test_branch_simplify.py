"""Small branches without jumps: each form, and what keeps a branch as it is."""

from __future__ import annotations

from itertools import product

from servogen.compiler.passes.branch_simplify import goes_through, short_branches, stays_in
from servogen.errors import Location
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, check, function
from tests.compiler.passes.test_meaning import BYTES, left

END = "e: RETURN"


def choice(test: str, yes: str, other: str, end: str = END) -> str:
    return f"{test}; GOTO no; {yes}; GOTO e; no: {other}; {end}"


@every(
    ("before", "after"),
    [
        # a constant in W
        (choice("BTFSS ga,1", "MOVLW 3", "MOVLW 4", "e: MOVWF gz; RETURN"),
            "MOVLW 4; BTFSC ga,1; MOVLW 3; e: MOVWF gz; RETURN"),
        ("SWAPF gx,F; " + choice("BTFSS ga,1", "MOVLW 3", "MOVLW 4", "e: MOVWF gz; RETURN"),
            "SWAPF gx,F; MOVLW 4; BTFSC ga,1; MOVLW 3; e: MOVWF gz; RETURN"),
        (choice("BTFSS ga,1", "RETLW 3", "RETLW 4"), None),
        # two instructions that leave the bit alone, by two tests
        (choice("BTFSC ga,1", "BSF gb,3", "BCF gb,3"), "BTFSC ga,1; BCF gb,3; BTFSS ga,1; BSF gb,3; " + END),
        (choice("BTFSS C", "BSF gb,3", "BCF gb,3"), "BTFSS C; BCF gb,3; BTFSC C; BSF gb,3; " + END),
        (choice("BTFSS Z", "BSF gb,3", "BCF gb,3"), "BTFSS Z; BCF gb,3; BTFSC Z; BSF gb,3; " + END),
        (choice("BTFSS ga,1", "CLRF gb", "BSF gb,0"), "BTFSS ga,1; BSF gb,0; BTFSC ga,1; CLRF gb; " + END),
        (choice("BTFSS ga,1", "NOP", "MOVLW 1"), "BTFSS ga,1; MOVLW 1; BTFSC ga,1; NOP; " + END),
        (choice("BTFSS C", "BSF PORTB,3", "BCF PORTB,3"),
            "BTFSS C; BCF PORTB,3; BTFSC C; BSF PORTB,3; " + END),
        # registers, volatile bytes and RP0 may change between two tests
        (choice("BTFSS PORTA,1", "BSF gb,3", "BCF gb,3"), None),
        (choice("BTFSS va,1", "BSF gb,3", "BCF gb,3"), None),
        (choice("BTFSS RP0", "BSF gb,3", "BCF gb,3"), None),
        # what changes the flag, the byte, or may do so
        (choice("BTFSS Z", "CLRF gb", "BSF gb,3"), None),
        (choice("BTFSS Z", "BSF gb,3", "INCF gb,F"), None),
        (choice("BTFSS C", "BSF C", "BSF gb,3"), None),
        (choice("BTFSS C", "BSF gb,3", "BSF INDF,3"), None),
        (choice("BTFSS C", "BSF gb,3", "BCF fb,3"), None),
        (choice("BTFSS ga,1", "BSF ga,3", "BCF gb,3"), None),
        (choice("BTFSS ga,1", "BSF fa,3", "BCF gb,3"), None),
        (choice("BTFSS fa,1", "BSF gb,3", "BCF gb,3"), None),
        (choice("BTFSS ga,1", "BSF PORTB,3", "BCF PORTB,3"),
            "BTFSS ga,1; BCF PORTB,3; BTFSC ga,1; BSF PORTB,3; " + END),
        (choice("BTFSS ga,1", "BSF INDF,3", "BCF gb,3"), None),
        (choice("BTFSS ga,1", "BSF FSR,3", "BCF gb,3"), None),
        (choice("BTFSS ga,1", "BSF PORTA,3", "BCF gb,3"),
            "BTFSS ga,1; BCF gb,3; BTFSC ga,1; BSF PORTA,3; " + END),
        (choice("BTFSS ga,1", "MOVWF gc", "BCF gb,3"), None),
        (choice("BTFSS ga,1", "INCF gc,F", "BCF gb,3"), None),
        # no delay, call, skip or assembly
        (choice("BTFSS ga,1", "DELAY 5", "BCF gb,3"), None),
        (choice("BTFSS ga,1", "CALL g", "BCF gb,3"), None),
        (choice("*BTFSS ga,1", "BSF gb,3", "BCF gb,3"), None),
        (choice("BTFSS ga,1", "*BSF gb,3", "BCF gb,3"), None),
        (choice("BTFSS ga,1", "BSF gb,3", "*BCF gb,3"), None),
        ("BTFSS ga,1; *GOTO no; BSF gb,3; GOTO e; no: BCF gb,3; e: RETURN", None),
        ("BTFSS ga,1; GOTO no; BSF gb,3; *GOTO e; no: BCF gb,3; e: RETURN", None),
        ("BTFSS ga,1; GOTO no; BSF gb,3; GOTO e; *no: BCF gb,3; e: RETURN", None),
        # a skip over the test, another way to the other arm, labels, longer arms, another end
        ("BTFSC Z; " + choice("BTFSS ga,1", "BSF gb,3", "BCF gb,3"), None),
        ("BTFSC Z; GOTO no; " + choice("BTFSS ga,1", "BSF gb,3", "BCF gb,3"), None),
        ("GOTO m; NOP; BTFSS ga,1; m: GOTO no; BSF gb,3; GOTO e; no: BCF gb,3; e: RETURN", None),
        ("GOTO m; NOP; BTFSS ga,1; GOTO no; m: BSF gb,3; GOTO e; no: BCF gb,3; e: RETURN", None),
        ("BTFSS ga,1; GOTO no; BSF gb,3; GOTO e; m: no: BCF gb,3; GOTO m; e: RETURN", None),
        (choice("BTFSS ga,1", "BSF gb,3; BSF gb,4", "BCF gb,3"), None),
        (choice("BTFSS ga,1", "BSF gb,3", "BCF gb,3; BCF gb,4"), None),
        ("BTFSS ga,1; GOTO no; BSF gb,3; GOTO x; no: BCF gb,3; e: RETURN; x: NOP", None),
        ("BTFSS ga,1; GOTO yes; BSF gb,3; GOTO e; no: BCF gb,3; e: RETURN; yes: GOTO no", None),
        ("BTFSS ga,1; NOP; BSF gb,3; GOTO e; no: BCF gb,3; e: RETURN", None),
        ("DECFSZ ga,F; GOTO no; BSF gb,3; GOTO e; no: BCF gb,3; e: RETURN", None),
        # both arms return or go to the same place
        ("BTFSS ga,1; GOTO no; BSF gb,3; RETURN; no: BCF gb,3; RETURN; e: NOP",
            "BTFSS ga,1; BCF gb,3; BTFSC ga,1; BSF gb,3; RETURN; e: NOP"),
        ("BTFSS ga,1; GOTO no; BSF gb,3; GOTO x; no: BCF gb,3; GOTO x; e: NOP; x: RETURN",
            "BTFSS ga,1; BCF gb,3; BTFSC ga,1; BSF gb,3; GOTO x; e: NOP; x: RETURN"),
        ("BTFSS ga,1; GOTO no; BSF gb,3; RETURN; no: BCF gb,3; GOTO x; e: NOP; x: RETURN", None),
        ("BTFSS ga,1; GOTO no; BSF gb,3; RETURN; no: BCF gb,3; e: RETURN", None),
        # at the end of the function
        ("BTFSS ga,1; GOTO no; BSF gb,3; RETURN; no: BCF gb,3; RETURN",
            "BTFSS ga,1; BCF gb,3; BTFSC ga,1; BSF gb,3; RETURN"),
    ],
)  # fmt: skip
def test_a_choice_between_two_instructions(before: str, after: str | None) -> None:
    check(short_branches, before, after)


STARTS = "BTFSS {test}; GOTO no; {same}; MOVLW 1; MOVWF gb; GOTO e; no: {same}; MOVLW 2; CALL g; e: RETURN"
MOVED = "{same}; BTFSS {test}; GOTO no; MOVLW 1; MOVWF gb; GOTO e; no: MOVLW 2; CALL g; e: RETURN"


@every(
    ("test", "same", "moved"),
    [
        ("ga,1", "CLRF gb", True), ("ga,1", "INCF gc,F", True), ("ga,1", "MOVLW 9", True),
        ("ga,1", "CLRF ga", False), ("ga,1", "CLRF fa", False), ("ga,1", "MOVF ga,W", True),
        ("ga,1", "MOVF PORTB,W", False), ("ga,1", "MOVWF PORTB", False), ("ga,1", "MOVF va,W", False),
        ("ga,1", "CALL h", False), ("ga,1", "DELAY 4", False), ("ga,1", "*CLRF gb", False),
        ("ga,1", "BSF C", True), ("C", "MOVWF gb", True), ("C", "MOVLW 5", True), ("C", "BSF gb,1", True),
        ("C", "CLRF gb", False), ("C", "BSF Z", False), ("C", "INCF gb,F", False),
        ("PORTA,1", "MOVF gb,W", True), ("PORTA,1", "MOVWF gb", False), ("va,1", "ADDLW 3", True),
        ("va,1", "MOVWF gb", False),
    ],
)  # fmt: skip
def test_what_both_arms_begin_with_stands_once_in_front(test: str, same: str, moved: bool) -> None:
    before = STARTS.format(test=test, same=same)
    after = MOVED.format(test=test, same=same)
    check(short_branches, before, after if moved else None)
    check(short_branches, f"SWAPF gx,F; {before}", f"SWAPF gx,F; {after}" if moved else None)


@every(
    "before",
    [
        # one instruction is left in each arm
        "BTFSS ga,1; GOTO no; CLRF gb; CALL h; GOTO e; no: CLRF gb; e: RETURN",
        "BTFSS ga,1; GOTO no; CLRF gb; GOTO e; no: CLRF gb; CALL g; e: RETURN",
        # different, or a skip
        "BTFSS ga,1; GOTO no; CLRF gb; CALL h; GOTO e; no: CLRF gc; CALL g; e: RETURN",
        # entered from elsewhere, assembly, a delay through a routine
        "BTFSC Z; GOTO no; BTFSS ga,1; GOTO no; CLRF gb; CALL h; GOTO e; no: CLRF gb; CALL g; e: RETURN",
        "BTFSS ga,1; GOTO no; CLRF gb; CALL h; GOTO e; *no: CLRF gb; CALL g; e: RETURN",
        "BTFSS ga,1; GOTO no; CLRF gb; *CALL h; GOTO e; no: CLRF gb; CALL g; e: RETURN",
        "BTFSS ga,1; GOTO no; CLRF gb; CALL __delay_1; GOTO e; no: CLRF gb; CALL g; e: RETURN",
        "BTFSS ga,1; GOTO no; CLRF gb; CALL h; GOTO e; no: CLRF gb; DELAY 4; e: RETURN",
        "BTFSC Z; BTFSS ga,1; GOTO no; CLRF gb; CALL h; GOTO e; no: CLRF gb; CALL g; e: RETURN",
        "DECFSZ ga,F; GOTO no; CLRF gb; CALL h; GOTO e; no: CLRF gb; CALL g; e: RETURN",
    ],
)
def test_arms_that_begin_differently_or_end_at_once_stay(before: str) -> None:
    check(short_branches, before, None)


def test_one_instruction_is_left_in_either_arm() -> None:
    check(
        short_branches,
        "BTFSS ga,1; GOTO no; CLRF gb; CALL h; GOTO e; no: CLRF gb; CALL g; e: RETURN",
        "CLRF gb; BTFSS ga,1; GOTO no; CALL h; GOTO e; no: CALL g; e: RETURN",
    )


@every(
    ("before", "after"),
    [
        (choice("BTFSS ga,1", "MOVLW 5; MOVWF gb", "CLRF gb"),
            "MOVLW 0; BTFSC ga,1; MOVLW 5; MOVWF gb; " + END),
        ("SWAPF gx,F; " + choice("BTFSS ga,1", "MOVLW 5; MOVWF gb", "CLRF gb"),
            "SWAPF gx,F; MOVLW 0; BTFSC ga,1; MOVLW 5; MOVWF gb; " + END),
        (choice("BTFSC ga,1", "CLRF gb", "MOVLW 5; MOVWF gb"),
            "MOVLW 5; BTFSS ga,1; MOVLW 0; MOVWF gb; " + END),
        ("BTFSC Z; GOTO no; CLRF gb; RETURN; no: MOVLW 5; MOVWF gb; RETURN",
            "MOVLW 5; BTFSS Z; MOVLW 0; MOVWF gb; RETURN"),
        (choice("BTFSC Z", "CLRF gb", "MOVLW 5; MOVWF gc"), None),
        (choice("BTFSC Z", "CLRF PORTB", "MOVLW 5; MOVWF PORTB"), None),
        (choice("BTFSC Z", "CLRF gb", "MOVF gc,W; MOVWF gb"), None),
        (choice("BTFSC Z", "CLRF gb", "MOVLW 5; ADDWF gb,F"), None),
        (choice("BTFSC Z", "INCF gb,F", "MOVLW 5; MOVWF gb"), None),
        (choice("BTFSC Z", "CLRF gb", "MOVLW 5; MOVWF gb", "e: MOVWF gz; RETURN"), None),
        (choice("BTFSC Z", "CLRF gb", "MOVLW 5; MOVWF gb", "e: BTFSC Z; CLRF gz; RETURN"), None),
        ("BTFSC Z; GOTO no; CLRF gb; GOTO x; no: MOVLW 5; MOVWF gb; e: RETURN; x: NOP", None),
    ],
)  # fmt: skip
def test_a_choice_between_zero_and_another_constant(before: str, after: str | None) -> None:
    check(short_branches, before, after)


DIFFERS = "BTFSS ga,1; GOTO no; {begin}; {other}; {store}; GOTO e; no: {same}; e: {end}"


@every(
    ("begin", "other", "store", "same", "end", "rewritten"),
    [
        ("INCF gb,W", "ANDLW 3", "MOVWF gb", "INCF gb,F", "RETURN", True),
        ("DECF gb,W", "MOVLW 7", "MOVWF gb", "DECF gb,F", "RETURN", True),
        ("INCF gb,W", "ANDLW 3", "MOVWF gb", "DECF gb,F", "RETURN", False),
        ("INCF gb,W", "ANDLW 3", "MOVWF gb", "INCF gc,F", "RETURN", False),
        ("INCF gb,W", "ANDLW 3", "MOVWF gc", "INCF gb,F", "RETURN", False),
        ("INCF gb,W", "ANDLW 3", "ADDWF gb,F", "INCF gb,F", "RETURN", False),
        ("INCF gb,W", "MOVF gc,W", "MOVWF gb", "INCF gb,F", "RETURN", False),
        ("INCF gb,F", "ANDLW 3", "MOVWF gb", "INCF gb,F", "RETURN", False),
        ("MOVF gb,W", "ANDLW 3", "MOVWF gb", "MOVF gb,F", "RETURN", False),
        ("INCF gb,W", "ANDLW 3", "MOVWF gb", "INCF gb,F", "MOVWF gz; RETURN", False),
        ("INCF gb,W", "DELAY 3", "MOVWF gb", "INCF gb,F", "RETURN", False),
        ("INCF vb,W", "ANDLW 3", "MOVWF vb", "INCF vb,F", "RETURN", False),
    ],
)
def test_arms_that_differ_in_one_instruction(
    begin: str, other: str, store: str, same: str, end: str, rewritten: bool
) -> None:
    before = DIFFERS.format(begin=begin, other=other, store=store, same=same, end=end)
    after = f"{begin}; BTFSC ga,1; {other}; {store}; e: {end}"
    check(short_branches, before, after if rewritten else None)
    check(short_branches, f"SWAPF gx,F; {before}", f"SWAPF gx,F; {after}" if rewritten else None)


def test_the_flag_that_is_tested_is_not_changed_before_the_test() -> None:
    text = DIFFERS.format(
        begin="INCF gb,W", other="ANDLW 3", store="MOVWF gb", same="INCF gb,F", end="RETURN"
    )
    check(short_branches, text.replace("BTFSS ga,1", "BTFSS Z"), None)


@every(
    ("before", "after"),
    [
        ("a: CLRF gx; DECF gb,F; BTFSS Z; GOTO a; RETURN", "a: CLRF gx; DECFSZ gb,F; GOTO a; RETURN"),
        ("a: CLRF gx; INCF gb,F; BTFSS Z; GOTO a; RETURN", "a: CLRF gx; INCFSZ gb,F; GOTO a; RETURN"),
        ("a: DECF gb,F; BTFSS Z; GOTO a; RETURN", "a: DECFSZ gb,F; GOTO a; RETURN"),
        ("a: DECF gb,F; MOVF gb,F; BTFSS Z; GOTO a; RETURN", "a: DECFSZ gb,F; GOTO a; RETURN"),
        ("a: NOP; DECF gb,F; MOVF gb,W; BTFSS Z; GOTO a; RETURN", "a: NOP; DECFSZ gb,F; GOTO a; RETURN"),
        ("a: DECF gb,F; MOVF gb,W; BTFSS Z; GOTO a; MOVWF gz; RETURN", None),
        ("a: DECF gb,F; MOVF gc,F; BTFSS Z; GOTO a; RETURN", None),
        ("a: DECF vb,F; MOVF vb,F; BTFSS Z; GOTO a; RETURN", None),
        ("a: DECF gb,F; *MOVF gb,F; BTFSS Z; GOTO a; RETURN", None),
        ("a: DECF PORTB,F; MOVF PORTB,F; BTFSS Z; GOTO a; RETURN", None),
        ("a: DECF vb,F; BTFSS Z; GOTO a; RETURN", "a: DECFSZ vb,F; GOTO a; RETURN"),
        ("a: DECF gb,W; BTFSS Z; GOTO a; RETURN", None),
        ("a: COMF gb,F; BTFSS Z; GOTO a; RETURN", None),
        ("a: DECF gb,F; BTFSC Z; GOTO a; RETURN", None),
        ("a: DECF gb,F; BTFSS C; GOTO a; RETURN", None),
        ("a: DECF gb,F; BTFSS gc,2; GOTO a; RETURN", None),
        ("a: *DECF gb,F; BTFSS Z; GOTO a; RETURN", None),
        ("a: DECF gb,F; *BTFSS Z; GOTO a; RETURN", None),
        ("a: DECF gb,F; BTFSS Z; *GOTO a; RETURN", None),
        ("a: DECF gb,F; BTFSS Z; b: GOTO a; GOTO b", None),
        ("a: DECF gb,F; BTFSS Z; CALL a; RETURN", None),
        ("a: DECF gb,F; BTFSS Z; GOTO a; BTFSC Z; CLRF gz; RETURN", None),
        ("GOTO b; a: DECF gb,F; b: BTFSS Z; GOTO a; RETURN", None),
    ],
)
def test_a_loop_counts_down_with_a_skip(before: str, after: str | None) -> None:
    check(short_branches, before, after)


def test_new_instructions_stand_where_the_test_stood() -> None:
    made = function(choice("BTFSS ga,1", "MOVLW 3", "MOVLW 4", "e: MOVWF gz; RETURN"))
    for line, ins in enumerate(made.instructions(), 1):
        ins.place = Location("main.c", line) if line != 3 else None
    assert short_branches(made)
    assert [ins.place.line for ins in made.instructions() if ins.place] == [5, 1, 1, 6, 7]


TESTS = ("C", "Z", "DC", "RP0", "ga,1", "fa,1", "va,1", "l,7", "PORTB,0", "FSR,0", "INDF,0")
PLACES = ("ga", "fb", "va", "l", "PORTB", "FSR", "INDF", "STATUS")
OTHERS = ("MOVLW 3", "ADDLW 1", "ANDLW 1", "IORLW 0", "CLRW", "NOP", "DELAY 3", "CALL g", "GOTO b", "RETURN")
FORMS = (
    "MOVWF {}", "MOVF {},W", "MOVF {},F", "CLRF {}", "INCF {},W", "INCF {},F", "RLF {},F", "BSF {},0",
    "BCF {},1",
)  # fmt: skip


def test_what_may_pass_a_test_and_after_what_it_may_be_repeated() -> None:
    """Every test with every instruction: where it is allowed, the chip does the same in every state tried."""
    allowed = [0, 0]
    for flag, other in product(TESTS, [*OTHERS, *(form.format(place) for form in FORMS for place in PLACES)]):
        names = Names()
        for name in BYTES:
            names[name]
        test, ins = function(f"BTFSC {flag}; {other}", names).instructions()
        passes, stays = goes_through(test, ins), stays_in(test, ins)
        assert isinstance(passes, bool) and isinstance(stays, bool)
        allowed[0] += passes
        allowed[1] += stays
        same = []
        if passes:
            same.append(
                (
                    f"BTFSC {flag}; GOTO a; {other}; CALL g; RETURN; a: {other}; RETURN",
                    f"{other}; BTFSC {flag}; GOTO a; CALL g; a: RETURN",
                )
            )
        if stays:
            same.append(
                (
                    f"BTFSC {flag}; GOTO a; {other}; CALL g; a: RETURN",
                    f"BTFSC {flag}; GOTO a; {other}; BTFSC {flag}; GOTO a; CALL g; a: RETURN",
                )
            )
        for texts in same:
            for seed in range(3):
                one, two = (left(text, function(text, names), names, seed, "W") for text in texts)
                assert one == two, texts
    assert min(allowed) > 100
