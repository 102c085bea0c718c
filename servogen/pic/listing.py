"""`Listing`: which source line made which word, and what it costs.

In: rows and functions, from the compiler or the assembler. Out: the text of a .lst file; the simulator's
trace and profile read the values.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ListingRow:
    """One program word: its address, the instruction as assembly text, and the source that made it."""

    address: int
    word: int
    assembly: str
    cycles: str
    """Instruction cycles as the data sheet writes them: "1", "2" or "1(2)"."""
    file: str | None = None
    line: int | None = None


@dataclass(frozen=True, slots=True)
class ListedFunction:
    """A function or routine: its words are `start` up to but not including `end`."""

    name: str
    start: int
    end: int
    ram_bytes: int = 0
    deepest_calls: int = 0
    """Stack levels that it needs below itself."""
    least_cycles: int | None = None
    most_cycles: int | None = None
    """Cycles from its first instruction to the end of its return; None where a loop has no known bound."""


@dataclass(frozen=True, slots=True)
class Listing:
    """Rows by address, functions by start, RAM variables by address, and the source texts by file name."""

    rows: tuple[ListingRow, ...]
    functions: tuple[ListedFunction, ...] = ()
    variables: tuple[tuple[int, str, int], ...] = ()
    """(address, name, bytes) of each variable, in order of address."""
    sources: tuple[tuple[str, str], ...] = ()
    """(file name, text) of each source file."""
