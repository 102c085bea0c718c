"""What is taken in one step: the regions and waits that are found, and that are not."""

from __future__ import annotations

import numpy as np
import pytest

from servogen.simulator.regions import fast_code, is_wait, program_code
from servogen.simulator.words import LOOP, OP_MASK
from tests.simulator.helpers import image


def marks(source: str) -> tuple[list[int], list[int]]:
    """Addresses of the heads of regions, and of waits."""
    row = fast_code(program_code(image(source))).code[:1024]
    return np.flatnonzero(row & OP_MASK == LOOP).tolist(), np.flatnonzero(is_wait(row)).tolist()


@pytest.mark.parametrize(
    ("source", "heads"),
    [
        ("l decfsz 0x20, f\n goto l\n sleep\n", [0]),
        ("l nop\n incfsz 0x20, f\n goto l\n sleep\n", [0]),
        ("l decf 0x20, f\n btfss STATUS, Z\n goto l\n sleep\n", [0]),
        ("o movlw 9\n movwf 0x21\ni decfsz 0x21, f\n goto i\n decfsz 0x20, f\n goto o\n sleep\n", [0, 2]),
        ("l decfsz 0x20, f\n goto $+2\n decfsz 0x21, f\n goto l\n sleep\n", [0]),
        ("l bsf PORTB, 0\n decfsz 0x20, f\n goto l\n", []),  # writes a port
        ("l clrwdt\n decfsz 0x20, f\n goto l\n", []),  # moves the watchdog
        ("l decfsz INDF, f\n goto l\n", []),  # goes through FSR
        ("l decfsz TMR0, f\n goto l\n", []),
        ("l call f\n goto l\nf return\n", []),
        ("l btfss TMR0, 7\n goto l\n", []),
    ],
)
def test_regions_are_what_touches_only_w_flags_and_ram(source: str, heads: list[int]) -> None:
    assert marks(source)[0] == heads


@pytest.mark.parametrize(
    ("source", "waits"),
    [
        (" goto $\n", [0]), ("l nop\n nop\n goto l\n", [2]), ("l btfss INTCON, T0IF\n goto l\n", [0]),
        ("l nop\n btfsc PORTB, 3\n goto l\n", [1]), ("l btfss 0x20, 3\n goto l\n", [0]),
        ("l btfss FSR, 3\n goto l\n", []), ("l btfss TMR0, 3\n goto l\n", []),
        ("l nop\n clrwdt\n goto l\n", [2]),
        ("l clrwdt\n btfss INTCON, T0IF\n goto l\n", [1]),
        ("l movf TMR0, w\n xorwf 0x20, w\n btfss STATUS, Z\n goto l\n", [3]),
        ("l movf TMR0, w\n xorwf 0x20, f\n btfss STATUS, Z\n goto l\n", []),
        ("l movf TMR0, f\n xorwf 0x20, w\n btfss STATUS, Z\n goto l\n", []),
        ("l movf TMR0, w\n xorwf 0x20, w\n btfss STATUS, C\n goto l\n", []),
        ("l movf TMR0, w\n xorwf FSR, w\n btfss STATUS, Z\n goto l\n", []),
    ],
)  # fmt: skip
def test_waits_are_what_sees_the_same_until_something_happens(source: str, waits: list[int]) -> None:
    assert marks(source)[1] == waits


def test_a_region_of_too_many_bytes_is_left_alone() -> None:
    many = "l\n" + "".join(f" incf {0x20 + n}, f\n" for n in range(8)) + " goto l\n"
    assert marks(many)[0] == []


def test_nests_of_any_depth_are_taken_without_harm() -> None:
    heads = "".join(f"l{n} nop\n" for n in range(400))
    ends = "".join(f" decfsz {0x20 + n % 6}, f\n goto l{399 - n}\n" for n in range(300))
    found, _ = marks(f"{heads}{ends} sleep\n")
    assert 1 <= len(found) <= 8
