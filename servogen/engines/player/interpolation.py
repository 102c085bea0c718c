"""The arithmetic of the chip, in whole numbers: what lies between two keyframes, bit for bit.

In: keyframes, one byte a channel, and a time between them in 256ths. Out: widths in cycles.

    between:  eight times: (value + the keyframe that the next bit of the time chooses) / 2
              = (p (256 - t) + q t) / 256, with eight bits of fraction, as long as t has no more bits than n
    width:    base ± (between · step), whole cycles, rounded down
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Whole = npt.NDArray[np.int64]

FRACTION = 8


def between(one: npt.ArrayLike, other: npt.ArrayLike, time: int) -> Whole:
    """256 times the value at `time`/256 of the way from `one` to `other` (bytes)."""
    first, second = np.asarray(one, dtype=np.int64), np.asarray(other, dtype=np.int64)
    value = first << FRACTION
    for bit in range(FRACTION):
        chosen = second if time >> bit & 1 else first
        value = value + (chosen << FRACTION) >> 1
    return value


def excursion(value: npt.ArrayLike, shift: int) -> Whole:
    """Cycles from the channel's base, for keyframes in steps of 2**shift cycles."""
    return np.asarray(value, dtype=np.int64) << shift >> FRACTION
