"""What is known of a result is what the chip makes; what is not known is never guessed."""

from __future__ import annotations

import random
from itertools import product

import pytest

from servogen.pic.known_values import known_result
from tests.campaigns import sampled
from tests.simulator.helpers import machine, ram, steps

WITH_F = [
    *("ADDWF", "ANDWF", "COMF", "DECF", "DECFSZ", "INCF", "INCFSZ", "IORWF", "MOVF"),
    *("RLF", "RRF", "SUBWF", "SWAPF", "XORWF"),
]
WITH_K = ["ADDLW", "ANDLW", "IORLW", "MOVLW", "SUBLW", "XORLW"]
CARRY = frozenset(["ADDWF", "SUBWF", "ADDLW", "SUBLW", "RLF", "RRF"])


def chip_result(mnemonic: str, w: int, f: int, k: int, b: int, carry: int) -> tuple[int, int]:
    """(result, carry) as the simulator makes them."""
    operand = {True: "0x20, W", False: f"{k}"}[mnemonic in WITH_F]
    if mnemonic in ("BSF", "BCF"):
        operand = f"0x20, {b}"
    source = f"""
        movlw {f}
        movwf 0x20
        {"bsf" if carry else "bcf"} STATUS, C
        movlw {w}
        {mnemonic} {operand}
        goto here
here    goto here
"""
    chip = steps(machine(source), 6)
    return (ram(chip, 0x20) if mnemonic in ("BSF", "BCF") else chip.state().w), chip.state().status & 1


@pytest.mark.parametrize("mnemonic", sampled([*WITH_F, *WITH_K, "BSF", "BCF"], 6))
def test_a_known_result_is_the_chips(mnemonic: str) -> None:
    chosen = random.Random(mnemonic)
    for carry, _ in product((0, 1), range(12)):
        w, f, k = (chosen.choice((0, 1, 0x7F, 0x80, 0xFF, chosen.randrange(256))) for _ in range(3))
        b = chosen.randrange(8)
        result, out = known_result(mnemonic, w, f, k, b, carry)
        expected, carry_after = chip_result(mnemonic, w, f, k, b, carry)
        assert result == expected, (mnemonic, w, f, k, b, carry)
        assert out == (carry_after if mnemonic in CARRY else None)


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
