"""Edges as rows (cycle, pin, level): there and back."""

from __future__ import annotations

from collections.abc import Sequence

from servogen.edges import EdgeChunk, EdgeTrace, edge_chunk, join

Row = tuple[int, int, int]


def chunk(rows: Sequence[Row]) -> EdgeChunk:
    """Return rows as a chunk."""
    return edge_chunk(*zip(*rows, strict=True)) if rows else edge_chunk((), (), ())


def rows_of(edges: EdgeTrace | EdgeChunk) -> list[Row]:
    """Return the rows of a trace, or of a chunk."""
    whole = edges if isinstance(edges, EdgeChunk) else join(edges.chunks)
    return list(zip(*(column.tolist() for column in whole), strict=True))
