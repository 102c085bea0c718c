"""Generates the code of every function that is reached: from main, from the interrupt, and the library.

In: a Program. Out: `Function`s by name. Functions that both main and the interrupt reach are generated twice,
each copy with variables of its own, so that an interrupt in the middle of one cannot corrupt it.
"""

from __future__ import annotations

from dataclasses import replace

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import FloatType, IntType, VoidType
from servogen.compiler.codegen.builtins import builtin
from servogen.compiler.codegen.calls import call, divide, multiply
from servogen.compiler.codegen.conditions import jump
from servogen.compiler.codegen.expressions import boolean, condition_to_w, into
from servogen.compiler.codegen.float_routines import FLOAT_ROUTINES, build_float
from servogen.compiler.codegen.generator import Context, FunctionGenerator, Lowering
from servogen.compiler.codegen.indirect import one_byte_indirect
from servogen.compiler.codegen.routines import Routines
from servogen.compiler.codegen.runtime import build
from servogen.compiler.codegen.statements import generate
from servogen.compiler.codegen.tables import flash_byte, from_flash, wide_load
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.ir.function import ISR_SUFFIX, Function
from servogen.compiler.limits import INSTRUCTIONS
from servogen.compiler.sema.call_graph import CallGraph
from servogen.pic.device import PROGRAM_WORDS


class ProgramGenerator:
    """Generates functions and library routines on demand, and caches them."""

    def __init__(self, graph: CallGraph, reporter: Reporter, asm_symbols: dict[str, Symbol]) -> None:
        self.graph = graph
        self.program = graph.program
        self.reporter = reporter
        self.asm_symbols = asm_symbols
        self.functions: dict[str, Function] = {}
        reached = dict.fromkeys((*graph.main, *graph.isr))
        self._routines = Routines(graph.program.functions[name] for name in reached)
        self._clones: dict[Symbol, Symbol] = {}

    def generate(self) -> dict[str, Function]:
        """Return the functions that main and the interrupt reach, with the routines that they need."""
        for name in self.graph.main:
            self._function(name, isr=False)
        for name in self.graph.isr:
            self._function(name, isr=True)
        return self.functions

    def _function(self, name: str, *, isr: bool) -> None:
        """Generate the code of one function; raise if the program has become hopelessly large."""
        definition = self.program.functions[name]
        context = Context(
            signature=lambda called_name: self.signature(called_name, isr=isr),
            symbol_map=lambda symbol: self._symbol(symbol, isr=isr),
            library=lambda kind, key: self._library(kind, key, isr=isr),
            routines=self._routines,
            asm_symbols=self.asm_symbols,
            reporter=self.reporter,
            isr=isr,
        )
        generator = FunctionGenerator(definition, context, LOWERING)
        try:
            generate(generator)
        except RecursionError:
            raise self.reporter.too_deep(generator.place or definition.place) from None
        # a bound on the compiler's own time, far above what fits after optimisation
        size = sum(function.size for function in self.functions.values())
        if size > INSTRUCTIONS:
            raise self.reporter.fatal(
                "program-too-large",
                f"the program has {size} instructions up to here, the chip has {PROGRAM_WORDS} words",
                definition.place,
            )

    def _symbol(self, symbol: Symbol, *, isr: bool) -> Symbol:
        """Return the symbol to use for a variable: for a local of a shared function, the interrupt's own
        copy.
        """
        if (
            not isr
            or symbol.function not in self.graph.shared
            or symbol.kind not in ("local", "param", "result")
        ):
            return symbol
        if symbol not in self._clones:
            self._clones[symbol] = replace(symbol)
        return self._clones[symbol]

    def signature(self, name: str, *, isr: bool) -> Function:
        """Return the callee, whose parameters and result are known even before its code is generated."""
        full = name + ISR_SUFFIX if isr and name in self.graph.shared else name
        if full not in self.functions:
            definition = self.program.functions[name]
            function = Function(full, place=definition.place)
            function.origin = definition.origin if full == name else None
            function.parameters = [self._symbol(symbol, isr=isr) for symbol in definition.parameters]
            result = definition.result
            if not isinstance(result, VoidType):
                if result.size == 1 and result.scalar:
                    function.returns_w = True
                else:
                    function.result = Symbol(
                        f"{full}.result",
                        result,
                        "result",
                        function=name,
                        pinned=not isinstance(result, (IntType, FloatType)),
                    )
                    function.own.append(function.result)
            one_byte = [symbol for symbol in function.parameters if symbol.size == 1 and symbol.type.scalar]
            function.w_parameter = one_byte[-1] if one_byte else None
            locals_ = [self._symbol(symbol, isr=isr) for symbol in definition.locals]
            function.own += [*function.parameters, *locals_]
            self.functions[full] = function
        return self.functions[full]

    def _library(self, kind: str, key: tuple[int, ...], *, isr: bool) -> Function:
        """Return a library routine; the interrupt has its own copy, since it may interrupt main's."""
        name = "__" + "_".join([kind, *map(str, key)]) + (ISR_SUFFIX if isr else "")
        if name not in self.functions:
            function = Function(name)
            self.functions[name] = function
            fill = build_float if kind in FLOAT_ROUTINES else build
            fill(kind, key, function, lambda other, other_key: self._library(other, other_key, isr=isr))
        return self.functions[name]


LOWERING = Lowering(
    into=into,
    boolean=boolean,
    condition_to_w=condition_to_w,
    jump=jump,
    call=call,
    builtin=builtin,
    multiply=multiply,
    divide=divide,
    flash_byte=flash_byte,
    from_flash=from_flash,
    wide_load=wide_load,
    one_byte_indirect=one_byte_indirect,
)
