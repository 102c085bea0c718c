"""The end of a trace that was read from a file: the same rule for every format.

In: the edges, the end given in the file, the requested end. Out: an `EdgeTrace`.
"""

from __future__ import annotations

from collections.abc import Iterable

from servogen.edges import EdgeChunk, EdgeTrace
from servogen.units import Clock, Cycles


def ended(clock: Clock, chunks: Iterable[EdgeChunk], known: Cycles, end: int | None) -> EdgeTrace:
    """Return the edges up to `end`, which may cut the trace or extend it; by default up to `known`, the end
    given in the file.
    """
    if end is None:
        return EdgeTrace(clock, chunks, known)
    return EdgeTrace(clock, chunks, Cycles(max(known, end))).until(end)
