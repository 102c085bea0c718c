"""Where a trace that was read from a file ends: the same rule for every format.

In: the edges, the end that the file itself tells, the end that is asked for. Out: an `EdgeTrace`.
"""

from __future__ import annotations

from collections.abc import Iterable

from servogen.edges import EdgeChunk, EdgeTrace
from servogen.units import Clock, Cycles


def ended(clock: Clock, chunks: Iterable[EdgeChunk], known: Cycles, end: int | None) -> EdgeTrace:
    """The edges up to `end`, cut or beyond what the file tells; by default all that it tells, to `known`."""
    if end is None:
        return EdgeTrace(clock, chunks, known)
    return EdgeTrace(clock, chunks, Cycles(max(known, end))).until(end)
