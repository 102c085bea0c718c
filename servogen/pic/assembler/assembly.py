"""`assemble`: translates a source in MPASM's language into an `Image` and its `Listing`.

Two passes over the same lines: the first determines the addresses of the labels, the second places the words.
`link` does the same with the sources of one program, whose sections it places between.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from servogen.errors import Diagnostic, InputError, Location, SourceLines, check_known
from servogen.inputs import read_input
from servogen.pic.assembler.blocks import EndOfSource, ExitMacro, OutOfBudget, Placed, TooManyErrors
from servogen.pic.assembler.control import CONTROL
from servogen.pic.assembler.definitions import DEFINITIONS
from servogen.pic.assembler.initial import InitialData
from servogen.pic.assembler.layout import LAYOUT
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.psect import begin, is_pic_as, without_comments
from servogen.pic.assembler.sections import EVERY_CHIP, LinkerScript, Sections, place
from servogen.pic.assembler.settings import SETTINGS
from servogen.pic.assembler.source import lines_of
from servogen.pic.assembler.state import Include, Pass, PlacedWords
from servogen.pic.assembler.symbols import Symbols
from servogen.pic.device import DEVICES, PROGRAM_WORDS, RAM_FIRST, RAM_LAST, Device
from servogen.pic.image import Image
from servogen.pic.isa import encode
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


@dataclass(frozen=True, slots=True)
class AssemblySource:
    """One source of a program. `include` returns the text of an include file, see `beside`; the chips' own
    headers are built in.
    """

    text: str
    file: str = "source.asm"
    include: Include = lambda name: None


def assemble(
    text: str, file: str = "source.asm", device: Device | None = None, include: Include | None = None
) -> Assembly:
    """Assemble one source. Raises InputError with every error found.

    If `device` is None, the source selects it, with the PIC16F84 as default.
    """
    return link([AssemblySource(text, file, include or (lambda name: None))], device)


def link(
    sources: Sequence[AssemblySource], device: Device | None = None, memory: LinkerScript = EVERY_CHIP
) -> Assembly:
    """Assemble the sources of one program, and place their sections. Raises InputError with all errors.

    Where a source opens sections, another pass measures them before the two that all sources take.
    """
    modules = [_Module(source, device) for source in sources]
    if any(module.pic_as for module in modules):
        memory = replace(memory, from_top=True)
    exports: dict[str, int] = {}
    words = PlacedWords()
    for module in modules:
        module.first_pass(exports, words)
    opened = {section.name for module in modules for section in module.sections}
    initial = None
    if opened:
        # Now it is known that a source has sections: an ORG before the first one is one, too.
        for module in modules:
            module.first_pass(exports, words)
            module.sections.measured()
        _refuse(modules)
        initial = InitialData([module.sections for module in modules])
        place([*(module.sections for module in modules), initial.sections], memory)
        exports |= initial.symbols()
        for module in modules:
            module.first_pass(exports, words)
    for module in modules:
        module.second_pass(exports, words)
    with suppress(TooManyErrors):
        if initial is not None:
            _put_initial(initial, modules[0].state, words)
        _report_twins(modules)
    _refuse(modules)
    for name in memory.at:
        check_known("asm-section", name, opened, f"no source opens section '{name}'")
    return _assembly(modules, words)


def _put_initial(initial: InitialData, state: Pass, words: PlacedWords) -> None:
    """Place the copies of initialised data, and their table."""
    for address, byte, line in initial.bytes():
        word = encode("RETLW", k=byte)
        try:
            words.put(address, word)
        except SourceError as error:
            state.report("error", error.code, error.text, line, hint=error.hint)
            return
        state.placed.append(Placed(address, word, line, True))


class _Module:
    """A source, and what is kept of it from one pass to the next."""

    def __init__(self, source: AssemblySource, device: Device | None) -> None:
        self.source = source
        self.symbols = Symbols()
        self.sections = Sections()
        self.pic_as = is_pic_as(source.text)
        self.lines = lines_of(without_comments(source.text) if self.pic_as else source.text, source.file)
        self._device = device
        self._spent = False
        self.state: Pass

    def first_pass(self, exports: dict[str, int], words: PlacedWords) -> None:
        """Find the addresses of the names, and how far the sections go."""
        self.symbols = Symbols()
        self._run(exports, words)

    def second_pass(self, exports: dict[str, int], words: PlacedWords) -> None:
        """Place the words."""
        self.symbols.second_pass()
        self._run(exports, words)

    def _run(self, exports: dict[str, int], words: PlacedWords) -> None:
        """Take a pass. One that ran out of its budget has the last word."""
        if self._spent:
            return
        self.sections.begin()
        state = self.state = Pass(
            self.symbols,
            self.source.include,
            DIRECTIVES,
            memory=words,
            sections=self.sections,
            exports=exports,
        )
        if self._device is not None:
            state.choose(self._device)
        if self.pic_as:
            begin(state)
        ended = False
        try:
            state.run(self.lines)
        except EndOfSource:
            ended = True
        except OutOfBudget:
            self._spent = True
        except (ExitMacro, TooManyErrors):
            pass
        state.close_section()
        with suppress(TooManyErrors):
            self._export(exports)
        if not state.first and not ended and not state.log.errors:
            last = Location(self.source.file, len(self.lines))
            state.log.add(Diagnostic("warning", "asm-no-end", "the source has no END", last))

    def _export(self, exports: dict[str, int]) -> None:
        for name, line in self.state.globals.items():
            symbol = self.symbols.find(name)
            if symbol is not None:
                exports[name] = symbol.value
            elif not self.state.pic_as:
                self.state.report(
                    "error", "asm-undefined-symbol", f"'{name}' is global, but not defined", line
                )

    @property
    def texts(self) -> dict[str, str]:
        return {self.source.file: self.source.text, **self.state.sources}


DIRECTIVES = {**DEFINITIONS, **LAYOUT, **CONTROL, **SETTINGS}


def _report_twins(modules: Sequence[_Module]) -> None:
    """Report each name that a source makes global although an earlier one does."""
    seen: set[str] = set()
    for module in modules:
        own = {name: line for name, line in module.state.globals.items() if module.symbols.defined(name)}
        for name, line in own.items():
            if name in seen:
                text = f"'{name}' is global in two sources"
                module.state.report("error", "asm-duplicate-symbol", text, line)
        seen |= own.keys()


def _refuse(modules: Sequence[_Module]) -> None:
    """Raise InputError if the last pass of a source found errors."""
    errors = [error for module in modules for error in module.state.log.errors]
    if errors:
        raise InputError.of(errors, _lines_of(errors, _texts(modules)))


def _texts(modules: Sequence[_Module]) -> dict[str, str]:
    """Return the text of each file that was read."""
    return {file: text for module in modules for file, text in module.texts.items()}


def _assembly(modules: Sequence[_Module], words: PlacedWords) -> Assembly:
    texts = _texts(modules)
    remarks = tuple(remark for module in modules for remark in module.state.log.remarks)
    addresses = [pair for module in modules for pair in module.symbols.addresses().items()]
    labels = sorted(addresses, key=lambda pair: (pair[1], pair[0]))
    device = next((module.state.device for module in modules if module.state.device), DEVICES[0])
    return Assembly(
        image=words.image(),
        listing=_listing([module.state for module in modules], labels, tuple(texts.items())),
        warnings=remarks,
        source_lines=_lines_of(remarks, texts),
        device=device,
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


def _listing(
    states: Sequence[Pass], labels: Sequence[tuple[str, int]], sources: tuple[tuple[str, str], ...]
) -> Listing:
    rows = _rows(placed for state in states for placed in state.placed)
    names = {address: name for name, address in reversed(labels)}
    return Listing(
        rows=rows,
        functions=routines(rows, names),
        variables=_variables(block for state in states for block in state.blocks),
        sources=sources,
        labels=tuple(labels),
    )


def _rows(words: Iterable[Placed]) -> tuple[ListingRow, ...]:
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
        for placed in sorted(words, key=lambda word: word.address)
        if placed.address < PROGRAM_WORDS
    )


def _variables(blocks: Iterable[tuple[int, str, int]]) -> tuple[tuple[int, str, int], ...]:
    """Return the entries of CBLOCK and of sections of data that lie in RAM: the variables of assembly."""
    return tuple(sorted(block for block in blocks if RAM_FIRST <= block[0] <= RAM_LAST))
