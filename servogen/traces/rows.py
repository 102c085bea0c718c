"""Formats many rows at once: a matrix of bytes, one row per line, padded with NUL.

In: arrays of integers and tables of byte strings. Out: bytes, in one pass of NumPy, without a loop over rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from servogen.edges import EdgeChunk, part

Bytes = npt.NDArray[np.uint8]
Integers = npt.NDArray[np.int64]

BLOCK = 1 << 17
"""The number of rows that are formatted at a time: some megabytes of text."""


def blocks(chunk: EdgeChunk) -> Iterator[EdgeChunk]:
    """Yield `chunk` in pieces of at most `BLOCK` edges."""
    for start in range(0, len(chunk.cycle), BLOCK):
        yield part(chunk, slice(start, start + BLOCK))


def decimals(values: Integers) -> Bytes:
    """Return the decimal digits of non-negative `values`, right-aligned: shape (rows, digits of the
    largest).
    """
    width = len(str(int(values.max(initial=0))))
    digits = np.empty((width, len(values)), dtype=np.uint8)
    rest = values
    for column in range(width - 1, -1, -1):
        higher = rest // 10
        digits[column] = rest - higher * 10 + ord("0")
        if column < width - 1:
            digits[column][rest == 0] = 0
        rest = higher
    return digits.T


def table(texts: Sequence[str]) -> Bytes:
    """Return `texts` (ASCII) as rows of equal length, padded with NUL: shape (texts, longest)."""
    encoded = [text.encode("ascii") for text in texts]
    width = max(map(len, encoded))
    return np.frombuffer(b"".join(text.ljust(width, b"\0") for text in encoded), dtype=np.uint8).reshape(
        -1, width
    )


def joined(*tables: Bytes) -> Bytes:
    """Return the rows of all `tables` as one table."""
    width = max(table.shape[1] for table in tables)
    return np.concatenate([np.pad(table, ((0, 0), (0, width - table.shape[1]))) for table in tables])


def text(*columns: Bytes) -> bytes:
    """Return the bytes of the rows formed by `columns` side by side, without NULs."""
    flat = np.concatenate(columns, axis=1).ravel()
    return bytes(flat[flat != 0].tobytes())


def rescale(values: Integers, ratio: Fraction) -> Integers:
    """Return non-decreasing `values` × `ratio`, rounded exactly to the nearest integer, halves up."""
    if not len(values):
        return values
    base = int(values[0])
    up, down = 2 * ratio.numerator, 2 * ratio.denominator
    base_whole, base_part = divmod(base * up + ratio.denominator, down)
    if (int(values[-1]) - base) * up + down > np.iinfo(np.int64).max:
        # Rare (picoseconds): Python's integers have no limit.
        return np.array(
            [(value * up + ratio.denominator) // down for value in values.tolist()], dtype=np.int64
        )
    return base_whole + (base_part + (values - base) * up) // down
