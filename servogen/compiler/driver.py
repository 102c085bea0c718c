"""The whole way: source texts and options to an image and its listing.

In: `Source`s and `Options`. Out: a `Compilation`, or CompileError with every diagnostic.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pycparser import c_ast

from servogen.compiler.backend import Backend, globals_of
from servogen.compiler.banks import banked, exit_banks, switch_banks
from servogen.compiler.builtins import Builtins
from servogen.compiler.checks import check_program
from servogen.compiler.delay_sites import expand_delays
from servogen.compiler.diagnostics import CompileError, Diagnostic, Fatal, Reporter
from servogen.compiler.dialect import DIALECTS, headers, macros, named_types
from servogen.compiler.emitter import Code
from servogen.compiler.layout import allocate, lay_out
from servogen.compiler.optimise import optimise
from servogen.compiler.parse import parse
from servogen.compiler.preprocess import Preprocessed, preprocess
from servogen.compiler.rawtext import AsmBlock
from servogen.compiler.report import make_listing
from servogen.compiler.rewrite import Rewritten, rewrite_tokens
from servogen.compiler.settings import Settings
from servogen.compiler.sharing import share
from servogen.compiler.stack import check_stack
from servogen.compiler.startup import RESET, arrange
from servogen.compiler.syntax_errors import place_of
from servogen.compiler.timing import all_times
from servogen.errors import InputError, Place, nearest
from servogen.pic.device import Device, device
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.units import Clock


@dataclass(frozen=True, slots=True)
class Source:
    """One C file: its text and the name that messages give it."""

    text: str
    file: str = "main.c"


LEVELS = {
    "none": "as the code generator writes it",
    "speed": "fewest cycles, then fewest words; nothing is shared that would take longer",
    "size": "fewest words: equal runs of instructions become subroutines",
}
"""Levels of optimisation."""


@dataclass(frozen=True, slots=True)
class Options:
    """How to compile. `include` maps (name, including file) to (file name, text) or None."""

    dialect: str = "c2c"
    device: Device = field(default_factory=lambda: device("PIC16F84A"))
    clock_hz: int | None = None
    optimise: str = "speed"
    """One of `LEVELS`."""
    include: Callable[[str, str], tuple[str, str] | None] | None = None
    defines: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Compilation:
    """What came out. `words` are program words without the configuration, `diagnostics` the warnings."""

    image: Image
    listing: Listing
    clock: Clock | None
    words: int
    ram_bytes: int
    diagnostics: tuple[Diagnostic, ...]


def compile_sources(sources: Sequence[Source], options: Options | None = None) -> Compilation:
    """Compile the source files of one program. Raises CompileError with all errors and warnings."""
    options = options or Options()
    if options.dialect not in DIALECTS:
        raise InputError(f"unknown dialect '{options.dialect}'", hint=nearest(options.dialect, DIALECTS))
    if options.optimise not in LEVELS:
        raise InputError(
            f"unknown level of optimisation '{options.optimise}'", hint=nearest(options.optimise, LEVELS)
        )
    if not sources:
        raise InputError("there is no source file to compile")
    reporter = Reporter()
    try:
        return _compile(sources, options, reporter)
    except Fatal:
        raise CompileError(reporter.ordered()) from None
    except RecursionError:
        reporter.too_deep(Place(sources[0].file))
        raise CompileError(reporter.ordered()) from None


def _compile(sources: Sequence[Source], options: Options, reporter: Reporter) -> Compilation:
    settings = Settings(options.device, reporter)
    blocks: list[AsmBlock] = []
    files = [_read(source, options, reporter, blocks, number) for number, source in enumerate(sources)]
    all_macros: dict[str, Any] = {}
    for found, _ in files:
        all_macros.update(found.macros)
        for pragma in found.pragmas:
            settings.pragma(pragma)
    clock = settings.clock(all_macros, options.clock_hz)
    analysis = analyse(files, options, reporter, blocks, settings, clock)
    reporter.stop_on_error()
    backend = Backend(analysis.program, reporter, analysis.asm_symbols)
    backend.check()
    reporter.stop_on_error()
    check_program(backend, reporter)
    _mark_shared(backend)
    codes = backend.generate()
    reporter.stop_on_error()
    arrangement = arrange(backend, analysis.program, settings, reporter)
    for code in codes.values():
        if options.optimise != "none":
            optimise(code)
    reaching = banked(codes)
    leaving = exit_banks(codes, reaching)
    for code in codes.values():
        switch_banks(code, reaching, leaving)
    drop_unused(codes, arrangement.roots)
    if options.optimise == "size":
        share(codes, arrangement.roots)
    room = check_stack(codes, arrangement.roots, reporter)
    reporter.stop_on_error()
    times = all_times(codes)
    times |= expand_delays(codes, room, reached(codes, arrangement.roots[1:]))
    memory = allocate(arrangement.roots, codes, arrangement.statics, reporter)
    layout = lay_out(
        arrangement.order(codes), memory, reporter, arrangement.tables, small=options.optimise == "size"
    )
    reporter.stop_on_error()
    image = Image(
        {word.address: word.value for word in layout.words},
        settings.config_word(clock),
        analysis.program.eeprom,
    )
    listing = make_listing(layout, memory, codes, times, reporter)
    return Compilation(image, listing, clock, len(layout.words), memory.used, reporter.ordered())


def _read(
    source: Source, options: Options, reporter: Reporter, blocks: list[AsmBlock], number: int
) -> tuple[Preprocessed, Rewritten]:
    found = preprocess(
        source.text,
        source.file,
        defines={**macros(options.dialect, options.device), **options.defines},
        headers=headers(options.dialect),
        resolver=options.include,
        reporter=reporter,
        blocks=blocks,
    )
    return found, rewrite_tokens(found.tokens, blocks, reporter, number * 1000)


def analyse(
    files: list[tuple[Preprocessed, Rewritten]],
    options: Options,
    reporter: Reporter,
    blocks: list[AsmBlock],
    settings: Settings,
    clock: Clock | None,
) -> Builtins:
    """Parse and check every file; heads first, so that functions may be called before they are written."""
    analysis = Builtins(options.dialect, reporter)
    analysis.clock, analysis.serial_settings, analysis.blocks = clock, settings.serial, blocks
    bodies: list[tuple[Any, Any, Any]] = []
    for _, rewritten in files:
        units = parse(rewritten.tokens, named_types(), reporter)
        analysis.begin_file(rewritten)
        for unit in units:
            try:
                if isinstance(unit, c_ast.FuncDef):
                    bodies.append((analysis.head(unit), unit, analysis.scopes))
                elif isinstance(unit, (c_ast.Decl, c_ast.Typedef)):
                    analysis.declare(unit)
                elif isinstance(unit, c_ast.StaticAssert):
                    analysis.static_assertion(unit)
            except RecursionError:
                raise reporter.too_deep(place_of(unit.coord)) from None
            except Fatal:
                declared = unit.decl if isinstance(unit, c_ast.FuncDef) else unit
                reporter.lost.update(filter(None, [getattr(declared, "name", None)]))
        analysis.file_assembly(rewritten, settings)
    for function, unit, scopes in bodies:
        analysis.scopes = scopes
        try:
            analysis.define_function(function, unit)
        except RecursionError:
            raise reporter.too_deep(function.place) from None
    analysis.finish(settings)
    return analysis


def reached(codes: dict[str, Code], roots: list[str]) -> set[str]:
    """The functions that the roots call, directly or not, themselves included."""
    found = set(roots)
    waiting = list(roots)
    while waiting:
        more = [name for name in codes[waiting.pop()].calls() if name in codes and name not in found]
        found.update(more)
        waiting += more
    return found


def drop_unused(codes: dict[str, Code], roots: list[str]) -> None:
    """Forget functions and routines that nothing calls any more."""
    wanted = reached(codes, roots)
    for name in [
        name
        for name, code in codes.items()
        if name not in wanted and code.table is None and code.name != RESET
    ]:
        del codes[name]
    for name, code in codes.items():
        if code.table is not None and name not in wanted:  # only its address is used
            code.w_parameter, code.own = None, []


def _mark_shared(backend: Backend) -> None:
    """Variables that the interrupt names are read and written as they stand."""
    for symbol in globals_of(backend.program, backend.isr):
        if symbol.static:
            symbol.volatile = True
