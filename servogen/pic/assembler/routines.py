"""The routines of an assembled program: the targets of calls and vectors, and where each ends.

In: the listing's rows and the labels. Out: `ListedFunction`s, for the listing's summary and for a profile.
Assembly has no functions: a routine is assumed to extend from its label to the next routine or to a gap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from servogen.pic.device import INTERRUPT_VECTOR, RESET_VECTOR
from servogen.pic.isa import decode
from servogen.pic.listing import ListedFunction, ListingRow

VECTORS = {RESET_VECTOR: "reset", INTERRUPT_VECTOR: "interrupt"}


def routines(rows: Sequence[ListingRow], labels: Mapping[int, str]) -> tuple[ListedFunction, ...]:
    """Return the routines. `labels` are names by address; a row without cycles is data, which belongs to no
    routine.
    """
    words = {row.address: row.word for row in rows if row.cycles}
    starts = {address: name for address, name in _starts(words, labels).items() if address in words}
    listed = []
    for start, name in sorted(starts.items()):
        end = start + 1
        while end in words and end not in starts:
            end += 1
        listed.append(ListedFunction(name, start, end))
    return tuple(listed)


def _starts(words: Mapping[int, int], labels: Mapping[int, str]) -> dict[int, str]:
    """Return each routine's first address and its name."""
    starts = {address: labels.get(address, name) for address, name in VECTORS.items() if address in words}
    if INTERRUPT_VECTOR in starts and INTERRUPT_VECTOR not in labels and INTERRUPT_VECTOR - 1 in words:
        del starts[INTERRUPT_VECTOR]  # the program runs through the vector: it has no interrupt routine
    for address, word in words.items():
        decoded = decode(word)
        if decoded is None or not decoded.instruction.has_target:
            continue
        called = decoded.instruction.flow == "call"
        if called or address in VECTORS:
            starts.setdefault(decoded.k, labels.get(decoded.k, f"at_{decoded.k:03x}"))
    return starts
