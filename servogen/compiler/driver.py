"""The complete compilation: from source texts and options to an image and its listing.

In: `Source`s and `Options`. Out: a `Compilation`, or InputError with every diagnostic.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count

import servogen.compiler.library as library
from servogen.compiler.codegen.loop_counters import simplify_counters
from servogen.compiler.codegen.program import ProgramGenerator
from servogen.compiler.codegen.startup import RESET, arrange
from servogen.compiler.diagnostics import Fatal, Reporter
from servogen.compiler.emit.delays import expand_delays
from servogen.compiler.emit.layout import allocate, lay_out
from servogen.compiler.emit.listing import make_listing
from servogen.compiler.emit.timing import function_times
from servogen.compiler.frontend.assembly import AsmBlock
from servogen.compiler.frontend.dialects import (
    DIALECTS,
    FLOAT_BITS,
    NAMES,
    float_type,
    headers,
    is_ours,
    macros,
    other_compiler,
)
from servogen.compiler.frontend.extensions import Rewritten, rewrite_tokens
from servogen.compiler.frontend.preprocessor import Preprocessed, preprocess
from servogen.compiler.frontend.settings import PragmaSettings
from servogen.compiler.ir.function import Function, text_of
from servogen.compiler.options import LEVELS, Options, Source
from servogen.compiler.passes.bank_select import banked, exit_banks, switch_banks
from servogen.compiler.passes.call_depth import check_stack
from servogen.compiler.passes.manager import PASSES, PassManager
from servogen.compiler.passes.outlining import outline
from servogen.compiler.sema.call_graph import CallGraph, call_graph, check_calls, globals_of
from servogen.compiler.sema.checks import check_program
from servogen.compiler.sema.translation_unit import analyse
from servogen.errors import Diagnostic, InputError, Location, SourceLines, check_known, did_you_mean
from servogen.graph import reached
from servogen.pic.device import CONFIG_WATCHDOG_ON, Device
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.units import Clock, counted


@dataclass(frozen=True, slots=True)
class Compilation:
    """The result of a compilation. `words` are the program words without the configuration, `diagnostics` the
    warnings.
    """

    image: Image
    listing: Listing
    clock: Clock | None
    device: Device
    words: int
    ram_bytes: int
    diagnostics: tuple[Diagnostic, ...]
    source_lines: SourceLines
    """The lines that the diagnostics point to."""
    saved: Mapping[str, int]
    """Instructions that each pass has removed."""
    ir: str
    """The intermediate form after the pass that was asked for."""

    def __repr__(self) -> str:
        size = f"{counted(self.words, 'word')}, {counted(self.ram_bytes, 'byte')} of RAM"
        return f"<Compilation: {size}, {counted(len(self.diagnostics), 'warning')}>"


def compile_sources(sources: Sequence[Source], options: Options | None = None) -> Compilation:
    """Compile the source files of one program. Raises InputError with all errors and warnings."""
    options = options or Options()
    check_known("bad-option", options.dialect, DIALECTS, f"unknown dialect '{options.dialect}'")
    check_known("bad-option", options.optimise, LEVELS, f"unknown level of optimisation '{options.optimise}'")
    if options.dump_ir is not None and options.dump_ir not in PASSES:
        raise InputError(
            "bad-option", f"unknown pass '{options.dump_ir}'", hint=did_you_mean(options.dump_ir, PASSES)
        )
    if options.float_bits not in (None, *FLOAT_BITS):
        raise InputError("bad-option", f"'float' has 24 or 32 bits, not {options.float_bits}")
    if not sources:
        raise InputError("missing-option", "there is no source file to compile")
    try:
        return _reported(sources, options)
    except _TooFast:
        assert options.faster_device is not None
        return _reported(sources, replace(options, device=options.faster_device, faster_device=None))


class _TooFast(Exception):
    """Raised where the clock is too fast for the device, and there is a faster one."""


def _reported(sources: Sequence[Source], options: Options) -> Compilation:
    """Compile; raise InputError where a reported error ends the compilation."""
    reporter = Reporter(options.unwanted)
    try:
        return _compile(sources, options, reporter)
    except Fatal:
        error = reporter.failure()
    except RecursionError:
        reporter.too_deep(Location(sources[0].file))
        error = reporter.failure()
    except InputError as failure:
        error = failure
    raise _for_other_compiler(error, sources) or error


def _for_other_compiler(error: InputError, sources: Sequence[Source]) -> InputError | None:
    """Return the one error that stands for all, if an error's line is written for another compiler."""
    if any(is_ours(source.text) for source in sources):
        return None
    for diagnostic in error.diagnostics:
        place = diagnostic.location or Location()
        line = error.source_lines.get((place.file or "", place.line or 0), "")
        if place.line is None and diagnostic.code == "c-undefined":  # there is no main
            line = "\n".join(source.text for source in sources)
        if diagnostic.severity == "error" and (name := other_compiler(line)):
            single = InputError(
                "c-dialect",
                f"this is written for {name}, another compiler",
                place,
                hint=f"there are the dialects {', '.join(NAMES.values())}",
            )
            single.source_lines = error.source_lines
            return single
    return None


def _compile(sources: Sequence[Source], options: Options, reporter: Reporter) -> Compilation:
    """Run all stages over a program and return its compilation; errors end it after the stage that reports
    them.
    """
    settings = PragmaSettings(options.device, reporter)
    blocks: list[AsmBlock] = []
    files = [read_source(source, options, reporter, blocks, number) for number, source in enumerate(sources)]
    # before the analysis, which turns delays into cycles
    clock = _clock([preprocessed for preprocessed, _ in files], options, settings)
    numbers = count(len(files))
    analysis = analyse(
        files,
        options.dialect,
        reporter,
        blocks,
        settings,
        clock,
        lambda name: read_source(
            Source(library.source(name), f"<{name}>"), options, reporter, blocks, next(numbers)
        ),
        float_type(options.dialect, options.float_bits),
    )
    reporter.stop_on_error()
    graph = call_graph(analysis.program)
    # recursion is reported first: what follows walks the calls without looking for cycles
    check_calls(graph, reporter)
    reporter.stop_on_error()
    check_program(graph, reporter, watchdog=bool(settings.config_word(clock) & CONFIG_WATCHDOG_ON))
    # before code is generated: `volatile` is what keeps the passes from assuming that main alone changes
    # these
    _mark_shared(graph)
    dump = _Dump(options.dump_ir)
    manager = PassManager(options.verify_ir, dump.keep)
    if options.optimise != "none":
        for definition in analysis.program.functions.values():
            simplify_counters(definition)
    generator = ProgramGenerator(graph, reporter, analysis.asm_symbols)
    functions = generator.generate()
    manager.finished_all("codegen", functions)
    reporter.stop_on_error()
    arrangement = arrange(generator, analysis.program)
    manager.finished_all("startup", functions)
    _transform(functions, arrangement.roots, options, manager)
    # before delays are expanded: one may become a call only where a level of the stack is free
    room = check_stack(functions, arrangement.roots, reporter)
    reporter.stop_on_error()
    in_interrupt = functions_called(functions, arrangement.roots[1:])
    expand_delays(functions, room, in_interrupt)
    manager.finished_all("delays", functions)
    # last, since expanding delays adds counters to the functions' frames
    memory = allocate(arrangement.roots, functions, arrangement.statics, reporter)
    layout = lay_out(
        arrangement.order(functions), memory, reporter, arrangement.tables, small=options.optimise == "size"
    )
    image = Image(
        {word.address: word.value for word in layout.words},
        settings.config_word(clock),
        analysis.program.eeprom,
        analysis.program.ids,
    )
    in_main = functions_called(functions, arrangement.roots[:1])
    times = function_times(layout, functions, main=in_main, interrupt=in_interrupt)
    return Compilation(
        image,
        make_listing(layout, memory, functions, times, reporter),
        clock,
        options.device,
        words=len(layout.words),
        ram_bytes=memory.used,
        diagnostics=reporter.ordered(),
        source_lines=reporter.source_lines(),
        saved=dict(+manager.saved),
        ir=dump.text(functions),
    )


def _clock(files: Sequence[Preprocessed], options: Options, settings: PragmaSettings) -> Clock | None:
    """Read the pragmas and macros of all files, and return the clock that they or the options state. Raises
    _TooFast.
    """
    macros_of_program = {name: (value, Location()) for name, value in options.defines.items()}
    for preprocessed in files:
        macros_of_program.update(preprocessed.macros)
        for pragma in preprocessed.pragmas:
            settings.pragma(pragma)
    clock = settings.clock(macros_of_program, options.clock_hz)
    too_fast = clock is not None and clock.hz > options.device.max_clock_hz
    if too_fast and options.faster_device is not None:
        raise _TooFast
    return clock


def _transform(
    functions: dict[str, Function], roots: list[str], options: Options, manager: PassManager
) -> None:
    """Run the passes over each function, then the passes over the whole program."""
    if options.optimise != "none":
        for function in functions.values():
            manager.optimise(function)
    # after the passes that move instructions; outlining may share switches like any other code
    reaching = banked(functions)
    leaving = exit_banks(functions, reaching)
    for function in functions.values():
        switch_banks(function, reaching, leaving)
    manager.finished_all("bank-select", functions)
    drop_unused(functions, roots)
    if options.optimise == "size":
        manager.saved["outlining"] += outline(functions, roots)
        manager.finished_all("outlining", functions)


class _Dump:
    """Records the text of each function as one pass leaves it."""

    def __init__(self, after: str | None) -> None:
        self.after = after
        self._texts: dict[str, str] = {}

    def keep(self, name: str, function: Function) -> None:
        if name == self.after:
            self._texts[function.name] = text_of(function)

    def text(self, functions: Mapping[str, Function]) -> str:
        """Return the functions that remain, in order."""
        return "\n".join(self._texts[name] for name in functions if name in self._texts)


def read_source(
    source: Source, options: Options, reporter: Reporter, blocks: list[AsmBlock], number: int
) -> tuple[Preprocessed, Rewritten]:
    """Preprocess a file and rewrite the dialect's extensions; `number` keeps generated names distinct."""
    preprocessed = preprocess(
        source.text,
        source.file,
        defines={
            **macros(options.dialect, options.device, float_type(options.dialect, options.float_bits)),
            **options.defines,
        },
        headers=headers(options.dialect),
        resolver=options.include,
        reporter=reporter,
        blocks=blocks,
    )
    return preprocessed, rewrite_tokens(preprocessed.tokens, blocks, reporter, number * 1000)


def functions_called(functions: dict[str, Function], roots: list[str]) -> set[str]:
    """Return the functions that the roots call, directly or indirectly, including the roots."""
    return set(reached(roots, lambda name: filter(functions.__contains__, functions[name].calls())))


def drop_unused(functions: dict[str, Function], roots: list[str]) -> None:
    """Remove the functions and routines that nothing calls any more."""
    wanted = functions_called(functions, roots)
    for name in [
        name
        for name, function in functions.items()
        if name not in wanted and function.table is None and function.name != RESET
    ]:
        del functions[name]
    for name, function in functions.items():
        if function.table is not None and name not in wanted:  # only its address is used
            function.w_parameter, function.own = None, []


def _mark_shared(graph: CallGraph) -> None:
    """Mark the variables that the interrupt refers to, so that their reads and writes are kept."""
    for symbol in globals_of(graph.program, graph.isr):
        if symbol.static:
            symbol.volatile = True
