"""The arithmetic of the chip, in integers: between two poses by a weight, and the weight by a law.

In: bytes of two poses, a time in 256ths of a step, a law's table. Out: widths in cycles, bit for bit.

    value:   key · 256 ± |next - key| · weight, for a swing twice the product; 16 bits
    width:   base + value · step / 256, whole cycles, rounded down
    weight:  the law's table has 17 entries, between which the same arithmetic interpolates linearly
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Whole = npt.NDArray[np.int64]

FRACTION = 8

INTERVALS = 16
"""The number of entries of a law's table."""

ENTRIES = INTERVALS + 1


def blended(key: npt.ArrayLike, other: npt.ArrayLike, weight: npt.ArrayLike, *, twice: bool = False) -> Whole:
    """Return 256 times the value `weight`/256 of the distance from `key` to `other`, `weight`/128 if `twice`.

    The caller checks that the result fits the 16 bits that the chip can hold.
    """
    first, second = np.asarray(key, dtype=np.int64), np.asarray(other, dtype=np.int64)
    product = (second - first) * np.asarray(weight, dtype=np.int64)
    return (first << FRACTION) + (2 * product if twice else product)


def weights(table: npt.ArrayLike, time: npt.ArrayLike) -> Whole:
    """Return the weights at times, given as bytes, from a law's table."""
    entries, times = np.asarray(table, dtype=np.int64), np.asarray(time, dtype=np.int64)
    whole = times >> 4
    return blended(entries[whole], entries[whole + 1], times << 4 & 0xFF) >> FRACTION


def excursion(value: npt.ArrayLike, shifts: npt.ArrayLike) -> Whole:
    """Return the cycles relative to the channels' bases, for poses in steps of 2**shift cycles."""
    return np.asarray(value, dtype=np.int64) << np.asarray(shifts, dtype=np.int64) >> FRACTION
