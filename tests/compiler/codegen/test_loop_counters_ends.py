"""Counting loops at the ends of what one byte and two bytes count."""

from __future__ import annotations

from tests.compiler.codegen.forms import compiled

BODY = "PORTB = 1;"
ONE_BYTE = "MOVLW {0}; MOVWF t1; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3"
TWO_BYTES = "MOVLW {1}; MOVWF t1; {0}; MOVLW 1; MOVWF PORTB; DECFSZ t2,F; GOTO $-3; DECFSZ t1,F; GOTO $-5"
LOW_FIRST = "MOVLW {1}; MOVWF t1; {0}; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3; DECFSZ t2,F; GOTO $-5"
COUNTS_DOWN = {
    ("unsigned char", 0, 1): None,
    ("unsigned char", 0, 2): ONE_BYTE.format(2),
    ("unsigned char", 0, 255): ONE_BYTE.format(255),
    ("unsigned char", 5, 255): ONE_BYTE.format(250),
    ("signed char", -100, 100): ONE_BYTE.format(200),
    ("unsigned int", 0, 255): ONE_BYTE.format(255),
    ("unsigned int", 1000, 1255): ONE_BYTE.format(255),
    ("int", -3, 300): TWO_BYTES.format("MOVLW 47; MOVWF t2", 2),
    # --low || --high: low + 256 (high - 1) turns, the high byte rounded up
    ("unsigned int", 0, 511): TWO_BYTES.format("MOVLW 255; MOVWF t2", 2),
    ("unsigned int", 0, 257): LOW_FIRST.format("MOVLW 2; MOVWF t2", 1),
    ("unsigned int", 0, 0xFEFF): LOW_FIRST.format("MOVWF t2", 255),
}
COUNTS_UP = [("unsigned int", 0, 0xFF01), ("unsigned int", 0, 0xFFFF)]


def loop(kind: str, first: int, end: int) -> str:
    return f"{{ {kind} z; for (z = {first}; z < {end}; z++) {BODY} }}"


def test_a_counter_that_nobody_else_uses_counts_down() -> None:
    bodies = {case: loop(*case) for case in [*COUNTS_DOWN, *COUNTS_UP]}
    more = {
        case: loop(*case)
        for case in (("unsigned int", 0, 256), ("unsigned int", 0, 512), ("unsigned int", 0, 0xFF00))
    }
    found = compiled((*bodies.values(), *more.values()))
    wrong = {
        case: found[bodies[case]]
        for case, text in COUNTS_DOWN.items()
        if text and found[bodies[case]] != text
    }
    assert wrong == {}
    # 256 turns of a byte that begins with 0
    assert found[more["unsigned int", 0, 256]] == "CLRF t1; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3"
    for end, high in ((512, 2), (0xFF00, 255)):
        text = found[more["unsigned int", 0, end]]
        assert text.count("DECFSZ") == 2 and f"MOVLW {high}; " in text and "CLRF" in text
    # one more, and the high byte rounded up would be 256
    assert all("DECFSZ" not in found[bodies[case]] for case in COUNTS_UP)
