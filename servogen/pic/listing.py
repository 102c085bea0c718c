"""`Listing`: maps each word to its source line and its cost.

In: rows and functions, from the compiler, the assembler or the files beside a HEX. Out: the text of a .lst
file, always the same for the same values; the simulator's trace and profile read the values themselves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from servogen.pic.device import INTERRUPT_VECTOR, PROGRAM_WORDS, RAM_BYTES, RAM_FIRST, RAM_LAST, RESET_VECTOR
from servogen.pic.isa import decode

VECTORS = {RESET_VECTOR: "reset", INTERRUPT_VECTOR: "interrupt"}


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
    """A function or routine: its words run from `start` up to, but not including, `end`."""

    name: str
    start: int
    end: int
    ram_bytes: int = 0
    deepest_calls: int = 0
    """Stack levels that it needs below itself."""
    minimum_cycles: int | None = None
    maximum_cycles: int | None = None
    """Cycles from its first instruction to the end of its return; None where that is not known or, with
    `unbounded`, where it never returns or can take as long as you like.
    """
    unbounded: tuple[str, ...] = ()
    """Its loops and calls without a known end: "while at line 12"."""


@dataclass(frozen=True, slots=True)
class Listing:
    """Rows by address, functions by start, RAM variables, and the source texts by file name."""

    rows: tuple[ListingRow, ...]
    functions: tuple[ListedFunction, ...] = ()
    variables: tuple[tuple[int, str, int], ...] = ()
    """(address, name, bytes) of each variable; the compiler gives its temporaries last."""
    sources: tuple[tuple[str, str], ...] = ()
    """(file name, text) of each source file."""
    labels: tuple[tuple[str, int], ...] = ()
    """(name, address) of each label of the assembly in the sources, by address."""

    def __repr__(self) -> str:
        return f"<Listing of {len(self.rows)} words, {len(self.functions)} functions>"

    @property
    def words(self) -> dict[int, int]:
        """Return the program's words by address."""
        return {row.address: row.word for row in self.rows}

    def label(self, name: str) -> int:
        """Return the address of a label. Raises LookupError unless exactly one label has that name."""
        addresses = {address for label, address in self.labels if label == name}
        if len(addresses) != 1:
            raise LookupError(f"{len(addresses)} labels are called {name}")
        return addresses.pop()

    def variable(self, name: str) -> int:
        """Return the address of a global variable. Raises LookupError unless exactly one has that name."""
        addresses = [address for address, variable, _ in self.variables if variable == name]
        if len(addresses) != 1:
            raise LookupError(f"{len(addresses)} variables are called {name}")
        return addresses[0]


def routines(rows: Sequence[ListingRow], labels: Mapping[int, str]) -> tuple[ListedFunction, ...]:
    """Return the routines: the targets of calls and vectors, and where each ends.

    Assembly has no functions: a routine is assumed to extend from its label to the next routine or to a gap.
    `labels` are names by address; a row without cycles is data, which belongs to no routine.
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


def listing_text(listing: Listing) -> str:
    """Return the .lst file: each source line with its words, then the functions, then the map of RAM."""
    parts = [_code(listing), _functions(listing), _ram(listing)]
    return "\n".join(line for part in parts for line in part) + "\n"


def _code(listing: Listing) -> Iterator[str]:
    lines = {name: text.splitlines() for name, text in listing.sources}
    shown = dict.fromkeys(lines, 0)
    last: tuple[str | None, int | None] = (None, None)
    yield f"{len(listing.rows)} of {PROGRAM_WORDS} program words"
    yield ""
    yield "addr  word  cycles  instruction"
    for row in listing.rows:
        if row.line is not None and row.file in lines and (row.file, row.line) != last:
            if row.file != last[0]:
                yield f"{row.file}:"
            first = shown[row.file] + 1 if row.line > shown[row.file] else row.line
            for number in range(first, row.line + 1):
                source = lines[row.file][number - 1] if number <= len(lines[row.file]) else ""
                yield f"{number:>28}: {source.expandtabs()}".rstrip()
            shown[row.file] = max(shown[row.file], row.line)
        last = (row.file, row.line)
        yield f"{row.address:04X}  {row.word:04X}  {row.cycles:<6}  {row.assembly}"
    yield ""


def _functions(listing: Listing) -> Iterator[str]:
    if not listing.functions:
        return
    width = max(len("function"), *(len(function.name) for function in listing.functions))
    yield f"{'function':<{width}}  start  words  bytes of RAM  deepest calls  cycles"
    for function in listing.functions:
        cycles = _range(function)
        yield (
            f"{function.name:<{width}}  {function.start:04X}   {function.end - function.start:>5}  "
            f"{function.ram_bytes:>12}  "
            f"{function.deepest_calls:>13}  {cycles}"
        )
    for function in listing.functions:
        if function.unbounded:
            yield f"{function.name:<{width}}  unbounded: {', '.join(function.unbounded)}"
    yield ""


def _range(function: ListedFunction) -> str:
    minimum, maximum = function.minimum_cycles, function.maximum_cycles
    if minimum is None:
        return "never returns" if function.unbounded else "unknown"
    if minimum == maximum:
        return str(minimum)
    return f"{minimum} to {'unbounded' if maximum is None else maximum}"


def _ram(listing: Listing) -> Iterator[str]:
    """Yield the variables, and which of the chip's bytes are free."""
    if not listing.variables:
        return
    yield "addr  bytes  variable"
    for address, name, size in listing.variables:
        yield f"{address:04X}  {size:>5}  {name}"
    used = {address + offset for address, _, size in listing.variables for offset in range(size)}
    yield f"{len(used)} of {RAM_BYTES} bytes of RAM"
    yield ""
    for start in range(RAM_FIRST & ~0xF, RAM_LAST + 1, 16):
        marks = "".join(_mark(address, used) for address in range(start, start + 16))
        yield f"{start:04X}  {marks}"
    yield "X used, - free"


def _mark(address: int, used: set[int]) -> str:
    if not RAM_FIRST <= address <= RAM_LAST:
        return " "
    return "X" if address in used else "-"
