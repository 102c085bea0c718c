"""`assemble`: translates a source in MPASM's language into an `Image` and its `Listing`.

Two passes over the same lines: the first determines the addresses of the labels, the second places the words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from servogen.errors import Diagnostic, InputError, Location, SourceLines
from servogen.inputs import read_input
from servogen.pic.assembler.blocks import EndOfSource, ExitMacro, OutOfBudget, TooManyErrors
from servogen.pic.assembler.control import CONTROL
from servogen.pic.assembler.definitions import DEFINITIONS
from servogen.pic.assembler.layout import LAYOUT
from servogen.pic.assembler.settings import SETTINGS
from servogen.pic.assembler.source import lines_of
from servogen.pic.assembler.state import Include, Pass
from servogen.pic.assembler.symbols import Symbols
from servogen.pic.device import (
    DEVICES,
    PROGRAM_WORDS,
    RAM_FIRST,
    RAM_LAST,
    Device,
)
from servogen.pic.image import Image
from servogen.pic.listing import Listing, ListingRow, routines
from servogen.pic.spelling import assembly_text, cycles_text


@dataclass(frozen=True, slots=True)
class Assembly:
    """The result of assembling a source. `warnings` are MPASM's warnings and messages, in source order."""

    image: Image
    listing: Listing
    warnings: tuple[Diagnostic, ...]
    source_lines: SourceLines
    """The lines that the warnings point to."""
    device: Device
    labels: tuple[tuple[str, int], ...]
    """Global labels and their word addresses, by address."""


def assemble(
    text: str, file: str = "source.asm", device: Device | None = None, include: Include | None = None
) -> Assembly:
    """Assemble a source. Raises InputError with every error found.

    If `device` is None, the source selects it, with the PIC16F84 as default. `include` returns the text of an
    include file, see `beside`; the chips' own headers are built in.
    """
    symbols = Symbols()
    directives = {**DEFINITIONS, **LAYOUT, **CONTROL, **SETTINGS}
    lines = lines_of(text, file)
    for number in (1, 2):
        if number == 2:
            symbols.second_pass()
        state = Pass(symbols, include or (lambda name: None), directives)
        if device is not None:
            state.choose(device)
        ended = False
        try:
            state.run(lines)
        except EndOfSource:
            ended = True
        except OutOfBudget:
            break
        except (ExitMacro, TooManyErrors):
            pass
        if number == 2 and not ended and not state.log.errors:
            place = Location(file, len(lines))
            state.log.add(Diagnostic("warning", "asm-no-end", "the source has no END", place))
    sources = {file: text, **state.sources}
    if state.log.errors:
        raise InputError.of(state.log.errors, _lines_of(state.log.errors, sources))
    labels = sorted(symbols.addresses().items(), key=lambda pair: (pair[1], pair[0]))
    return Assembly(
        image=state.memory.image(),
        listing=_listing(state, labels, ((file, text), *state.sources.items())),
        warnings=state.log.remarks,
        source_lines=_lines_of(state.log.remarks, sources),
        device=state.device or DEVICES[0],
        labels=tuple(labels),
    )


def _lines_of(diagnostics: Sequence[Diagnostic], sources: Mapping[str, str]) -> SourceLines:
    """Return the source lines that the diagnostics point to."""
    source_lines = {}
    rows = {file: [line.text.chars for line in lines_of(text, file)] for file, text in sources.items()}
    for diagnostic in diagnostics:
        place = diagnostic.location or Location()
        if place.file in rows and place.line and place.line <= len(rows[place.file]):
            source_lines[place.file, place.line] = rows[place.file][place.line - 1]
    return source_lines


def beside(directory: Path) -> Include:
    """Return a reader of include files in a directory; names match in any case, as DOS sources expect."""

    def read(name: str) -> str | None:
        wanted = directory / name.replace("\\", "/")
        if not wanted.is_file():
            same_names = [
                entry for entry in wanted.parent.glob("*") if entry.name.lower() == wanted.name.lower()
            ]
            if not same_names:
                return None
            wanted = same_names[0]
        return read_input(wanted).decode("latin-1")

    return read


def _listing(state: Pass, labels: Sequence[tuple[str, int]], sources: tuple[tuple[str, str], ...]) -> Listing:
    rows = _rows(state)
    names = {address: name for name, address in reversed(labels)}
    return Listing(
        rows=rows,
        functions=routines(rows, names),
        variables=_variables(state),
        sources=sources,
        labels=tuple(labels),
    )


def _rows(state: Pass) -> tuple[ListingRow, ...]:
    """Return the program words as listing rows; words outside the program are omitted."""
    return tuple(
        ListingRow(
            address=placed.address,
            word=placed.word,
            assembly=assembly_text(placed.word) if placed.is_code else f"dw 0x{placed.word:04X}",
            cycles=cycles_text(placed.word) if placed.is_code else "",
            file=placed.line.file,
            line=placed.line.number,
        )
        for placed in sorted(state.placed, key=lambda word: word.address)
        if placed.address < PROGRAM_WORDS
    )


def _variables(state: Pass) -> tuple[tuple[int, str, int], ...]:
    """Return the entries of CBLOCK that lie in RAM: the variables of an assembly source."""
    return tuple(sorted(block for block in state.blocks if RAM_FIRST <= block[0] <= RAM_LAST))
