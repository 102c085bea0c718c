"""Edges by time window, so that two streams with any chunk sizes can be compared as arrays.

In: chunks in order, of any size. Out: all edges before a cycle, those of one cycle in the order of their pins
(changes of a port in one cycle have no order of their own).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.edges import EdgeChunk, ExpectedChunk

Ints = npt.NDArray[np.int64]


class Edges(NamedTuple):
    """Consecutive edges; `frame` is -1 for an edge without one. All are int64, except `pin` and `level`,
    which are uint8.
    """

    cycle: Ints
    pin: npt.NDArray[np.uint8]
    level: npt.NDArray[np.uint8]
    frame: Ints

    def take(self, rows: slice | npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> Edges:
        return Edges(self.cycle[rows], self.pin[rows], self.level[rows], self.frame[rows])

    def same_as(self, other: Edges) -> bool:
        """Return whether these are the same changes at the same cycles, regardless of frames."""
        return (
            np.array_equal(self.cycle, other.cycle)
            and np.array_equal(self.pin, other.pin)
            and np.array_equal(self.level, other.level)
        )


NO_EDGES = Edges(
    np.zeros(0, dtype=np.int64),
    np.zeros(0, dtype=np.uint8),
    np.zeros(0, dtype=np.uint8),
    np.zeros(0, dtype=np.int64),
)


def observed_edges(chunk: EdgeChunk, start: int) -> Edges:
    """Return a chunk with its cycles counted from `start`."""
    return Edges(chunk.cycle - start, chunk.pin, chunk.level, np.full(len(chunk.cycle), -1, dtype=np.int64))


def expected_edges(chunk: ExpectedChunk) -> Edges:
    """Return a chunk of expected edges in the common form."""
    return Edges(*chunk)


def concatenate(parts: list[Edges]) -> Edges:
    """Return consecutive edges as one."""
    if len(parts) == 1:
        return parts[0]
    if not parts:
        return NO_EDGES
    cycle, pin, level, frame = zip(*parts, strict=True)
    return Edges(np.concatenate(cycle), np.concatenate(pin), np.concatenate(level), np.concatenate(frame))


class Windows:
    """Takes edges off a stream, window by window."""

    def __init__(self, chunks: Iterable[Edges]) -> None:
        self._chunks: Iterator[Edges] = iter(chunks)
        self._pending: list[Edges] = []
        self._ended = False

    def until(self, limit: int) -> Edges:
        """Return all edges before cycle `limit` that have not been taken yet."""
        while not self._ended and not (self._pending and self._pending[-1].cycle[-1] >= limit):
            self._read()
        edges = concatenate(self._pending)
        size = int(np.searchsorted(edges.cycle, limit))
        self._pending = [edges.take(slice(size, None))] if size < len(edges.cycle) else []
        return _in_order(edges.take(slice(size)))

    def ahead(self, limit: int) -> Edges:
        """Return all edges before cycle `limit` that have not been taken yet, without taking them."""
        edges = self.until(limit)
        if len(edges.cycle):
            self._pending.insert(0, edges)
        return edges

    def first(self) -> int | None:
        """Return the cycle of the next edge that has not been taken yet; None if there is none."""
        while not self._ended and not self._pending:
            self._read()
        return int(self._pending[0].cycle[0]) if self._pending else None

    def _read(self) -> None:
        chunk = next(self._chunks, None)
        if chunk is None:
            self._ended = True
        elif len(chunk.cycle):
            self._pending.append(chunk)


def _in_order(edges: Edges) -> Edges:
    key = edges.cycle * 16 + edges.pin
    if np.all(key[1:] >= key[:-1]):
        return edges
    return edges.take(np.argsort(key, kind="stable"))
