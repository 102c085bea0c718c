"""The listing: each word with its source line, and the size, call depth and times of each function.

In: the layout. Out: `pic.listing.Listing`.
"""

from __future__ import annotations

from collections.abc import Mapping
from operator import itemgetter

from servogen.compiler.codegen.inline_asm import source_label
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.emit.layout import CodeLayout, MemoryMap, PlacedWord, file_address
from servogen.compiler.emit.timing import FunctionTimes
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import TARGETED
from servogen.compiler.passes.call_depth import depths
from servogen.pic.device import RAM_FIRST, RAM_LAST, register_at
from servogen.pic.isa import by_mnemonic
from servogen.pic.listing import ListedFunction, Listing, ListingRow


def make_listing(
    layout: CodeLayout,
    memory: MemoryMap,
    functions: dict[str, Function],
    times: Mapping[str, FunctionTimes],
    reporter: Reporter,
) -> Listing:
    """Return the listing of a program."""
    rows = tuple(_row(word, memory) for word in layout.words)
    chains = depths(functions)
    listed = tuple(
        ListedFunction(
            name,
            start,
            end,
            sum(symbol.size for symbol in functions[name].own),
            len(chains[name]),
            *_times(times.get(name)),
        )
        for name, (start, end) in layout.starts.items()
        if end > start
    )
    return Listing(rows, listed, _variables(memory), tuple(reporter.texts.items()), _labels(layout))


def _labels(layout: CodeLayout) -> tuple[tuple[str, int], ...]:
    """Return the labels of inline assembly by address, under the names that they have in the source."""
    named = [(source_label(name), address) for name, address in layout.labels.items()]
    return tuple(
        sorted(((name, address) for name, address in named if name is not None), key=itemgetter(1, 0))
    )


def _variables(memory: MemoryMap) -> tuple[tuple[int, str, int], ...]:
    """Return the program's own variables by address, then the bytes that each function and routine needs in
    addition.
    """
    named: list[tuple[int, str, int]] = []
    unnamed: dict[str, set[int]] = {}
    for symbol, address in memory.addresses.items():
        if symbol.kind in ("temp", "result") or (symbol.function or "").startswith("__"):
            unnamed.setdefault(symbol.function or "", set()).update(range(address, address + symbol.size))
        else:
            name = f"{symbol.function}.{symbol.name}" if symbol.function else symbol.name
            named.append((address, name, symbol.size))
    runs = [
        (first, f"{name} (temporary)", size) for name, used in unnamed.items() for first, size in _runs(used)
    ]
    return (*sorted(named), *sorted(runs))


def _runs(addresses: set[int]) -> list[tuple[int, int]]:
    """Return (first, count) of each run of consecutive addresses."""
    runs: list[tuple[int, int]] = []
    for address in sorted(addresses):
        if runs and sum(runs[-1]) == address:
            runs[-1] = (runs[-1][0], runs[-1][1] + 1)
        else:
            runs.append((address, 1))
    return runs


def _times(times: FunctionTimes | None) -> tuple[int | None, int | None, tuple[str, ...]]:
    return (times.shortest, times.longest, times.unbounded) if times is not None else (None, None, ())


def _row(word: PlacedWord, memory: MemoryMap) -> ListingRow:
    """Return the listing's row of a word."""
    ins = word.ins
    row = by_mnemonic()[ins.op]
    parts = []
    for field in row.operands:
        if field == "f":
            parts.append(_register_name(file_address(ins, memory)))
        elif field == "d":
            parts.append("WF"[ins.d])
        elif field == "b":
            parts.append(str(ins.b))
        elif ins.op in TARGETED:
            parts.append(f"0x{word.value & 0x7FF:03X}")
        else:
            parts.append(f"0x{word.value & 0xFF:02X}")
    cycles = f"{row.cycles}(2)" if row.skips else str(row.cycles)
    place = ins.place
    return ListingRow(
        word.address,
        word.value,
        f"{ins.op} {', '.join(parts)}".strip(),
        cycles,
        place.file if place else None,
        place.line if place else None,
    )


def _register_name(address: int) -> str:
    """Return the name of a special function register, or the address of a variable."""
    if RAM_FIRST <= address & 0x7F <= RAM_LAST:
        return f"0x{address & 0x7F:02X}"
    register = register_at(address)
    return register.name if register else f"0x{address & 0x7F:02X}"
