"""The listing: each word with its source line, and per function its size, depth and times.

In: the layout. Out: `pic.listing.Listing`.
"""

from __future__ import annotations

from collections.abc import Mapping

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.emitter import Code
from servogen.compiler.layout import Layout, Memory, Word, file_address
from servogen.compiler.stack import depths
from servogen.compiler.timing import Times
from servogen.pic.device import RAM_FIRST, RAM_LAST, registers
from servogen.pic.isa import by_mnemonic
from servogen.pic.listing import ListedFunction, Listing, ListingRow


def make_listing(
    layout: Layout, memory: Memory, codes: dict[str, Code], times: Mapping[str, Times], reporter: Reporter
) -> Listing:
    """The listing of a program."""
    rows = tuple(_row(word, memory) for word in layout.words)
    chains = depths(codes)
    functions = tuple(
        ListedFunction(
            name,
            start,
            end,
            sum(each.size for each in codes[name].own),
            len(chains[name]),
            *times.get(name, (None, None)),
        )
        for name, (start, end) in layout.starts.items()
        if end > start
    )
    variables = tuple(
        sorted(
            (address, f"{symbol.function}.{symbol.name}" if symbol.function else symbol.name, symbol.size)
            for symbol, address in memory.addresses.items()
        )
    )
    return Listing(rows, functions, variables, tuple(reporter.texts.items()))


def _row(word: Word, memory: Memory) -> ListingRow:
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
        elif ins.op in ("GOTO", "CALL"):
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
    if RAM_FIRST <= address & 0x7F <= RAM_LAST:
        return f"0x{address & 0x7F:02X}"
    for register in registers().values():
        if register.address == address:
            return register.name
    return f"0x{address & 0x7F:02X}"
