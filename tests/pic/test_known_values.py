"""What is not known of a result is never guessed; what is known is compared in test_semantics.py."""

from __future__ import annotations

from itertools import product

import pytest

from servogen.pic.known_values import known_result

WITH_F = [
    *("ADDWF", "ANDWF", "COMF", "DECF", "DECFSZ", "INCF", "INCFSZ", "IORWF", "MOVF"),
    *("RLF", "RRF", "SUBWF", "SWAPF", "XORWF"),
]
WITH_K = ["ADDLW", "ANDLW", "IORLW", "MOVLW", "SUBLW", "XORLW"]


@pytest.mark.parametrize("mnemonic", [*WITH_F, *WITH_K])
def test_a_result_of_something_unknown_is_unknown_or_does_not_depend_on_it(mnemonic: str) -> None:
    for w, f, k, carry in product((None, 5), (None, 0x81), (None, 3), (None, 1)):
        result, _ = known_result(mnemonic, w, f, k, 0, carry)
        if result is None:
            continue
        every = {
            known_result(mnemonic, *each, 0, c)[0]
            for each in product(
                (w,) if w is not None else (0, 9),
                (f,) if f is not None else (0, 9),
                (k,) if k is not None else (0, 9),
            )
            for c in ((carry,) if carry is not None else (0, 1))
        }
        assert every == {result}


def test_control_instructions_have_no_result() -> None:
    for mnemonic in ("GOTO", "CALL", "RETLW", "NOP", "BTFSC", "CLRWDT"):
        assert known_result(mnemonic, 1, 2, 3, 4, 0) == (None, None)
