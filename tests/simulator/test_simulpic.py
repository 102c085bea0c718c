"""A third simulator, where it is installed, does the same instruction by instruction."""

from __future__ import annotations

import pytest

from servogen.pic.image import Image
from servogen.pic.isa import encode
from tests.simulator import simulpic

pytestmark = pytest.mark.skipif(simulpic.PROGRAM is None, reason="simulpic is not installed")


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_random_program_runs_the_same_on_simulpic(seed: int) -> None:
    assert simulpic.difference(simulpic.image(seed)) == ""


def test_a_difference_is_noticed_as_after_decfsz_whose_zero_flag_simulpic_changes() -> None:
    """DS35007 table 7-2: it affects no flag."""
    words = [
        encode("MOVLW", k=3),
        encode("MOVWF", f=0x20),
        encode("ADDLW", k=253),
        encode("DECFSZ", f=0x20, d=1),
    ]
    words += [encode("NOP"), encode("GOTO", k=0)]
    assert "after DECFSZ" in simulpic.difference(Image(dict(enumerate(words)), 0x3FF1))
