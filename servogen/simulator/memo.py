"""What regions that only count did before, by everything that they depend on. Compiled.

A row of the memory: key (PC, W, STATUS), registers before, cycles taken, PC, W and STATUS after, registers after. A
region is taken in one step only when it ends before anything else can happen, so that the step is what the single
instructions would have done.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from servogen.simulator.layout import NOT_WRITTEN

ROWS = 1 << 12
COLUMNS = 5
DEEPEST_RECORDING = 8
UNKNOWN = -1


def new_memo() -> npt.NDArray[np.int64]:
    """A memory of nothing."""
    return np.full((ROWS, COLUMNS), UNKNOWN, dtype=np.int64)


def new_recording() -> npt.NDArray[np.int64]:
    """Room for the regions being recorded, one inside the other: key, registers, cycle, region."""
    return np.zeros((DEEPEST_RECORDING, 4), dtype=np.int64)


@njit
def pack_registers(s, regions, region):  # type: ignore[no-untyped-def]
    """The region's bytes of RAM as one integer, or UNKNOWN when one was never written."""
    packed = 0
    for i in range(regions[region, 0]):
        value = s[regions[region, 1 + i]]
        if value & NOT_WRITTEN:
            return UNKNOWN
        packed = packed << 8 | value
    return packed


@njit
def row_of(key, registers):  # type: ignore[no-untyped-def]
    mixed = key * 0x1E3779B97F4A7C15 ^ registers * 0x2545F4914F6CDD1D
    return (mixed ^ mixed >> 29) & (ROWS - 1)


@njit
def lookup(memo, key, registers):  # type: ignore[no-untyped-def]
    row = row_of(key, registers)
    if memo[row, 0] == key and memo[row, 1] == registers:
        return row
    return UNKNOWN


@njit
def recall(s, memo, row, regions, region):  # type: ignore[no-untyped-def]
    """Put the registers as the region left them."""
    packed = memo[row, 4]
    for i in range(regions[region, 0] - 1, -1, -1):
        s[regions[region, 1 + i]] = packed & 0xFF
        packed >>= 8


@njit
def remember(s, memo, recording, depth, regions, cycle, pc, w, status):  # type: ignore[no-untyped-def]
    """The region recorded at `depth` is left now."""
    key, registers, region = recording[depth, 0], recording[depth, 1], recording[depth, 3]
    row = row_of(key, registers)
    memo[row, 0] = key
    memo[row, 1] = registers
    memo[row, 2] = cycle - recording[depth, 2]
    memo[row, 3] = pc << 16 | w << 8 | status
    memo[row, 4] = pack_registers(s, regions, region)
