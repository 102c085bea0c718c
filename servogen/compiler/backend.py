"""From the typed tree to code of every function that is reached: main's, the interrupt's, the library's.

In: a Program. Out: `Code` by name. Functions that both main and the interrupt reach are made twice, each
with its own variables, so that an interrupt in the middle of one cannot change it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from servogen.compiler.ctypes import IntType, VoidType
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.emitter import ISR_SUFFIX, Code
from servogen.compiler.functions import FunctionGenerator
from servogen.compiler.inline_asm import AsmError
from servogen.compiler.limits import INSTRUCTIONS
from servogen.compiler.program import Asm, Block, ExprStmt, Function, Program
from servogen.compiler.runtime import build
from servogen.compiler.tree import AddressOf, Call, Expr, Ref, Symbol
from servogen.errors import Place
from servogen.pic.device import PROGRAM_WORDS

_TREES = ("servogen.compiler.tree", "servogen.compiler.program")


def called(function: Function) -> dict[str, Call]:
    """The functions that a function calls, and where."""
    found: dict[str, Call] = {}
    if function.body is not None:
        for expr in expressions(function.body):
            if isinstance(expr, Call):
                found.setdefault(expr.function, expr)
    return found


def expressions(node: object) -> Iterator[Expr]:
    """Every expression in a statement or expression, itself included."""
    if isinstance(node, (list, tuple)):
        for each in node:
            yield from expressions(each)
    elif isinstance(node, (Symbol, str, int)) or node is None:
        return
    elif hasattr(node, "__dataclass_fields__") and node.__class__.__module__ in _TREES:
        if not isinstance(node, (Block, ExprStmt, Asm)) and hasattr(node, "type"):
            yield node  # type: ignore[misc]
        for name in node.__dataclass_fields__:
            if name not in ("type", "place", "work", "symbol", "names"):
                yield from expressions(getattr(node, name))


def reachable(program: Program, start: str) -> list[str]:
    """Functions that `start` reaches, itself first."""
    found: dict[str, None] = {}
    waiting = [start]
    while waiting:
        name = waiting.pop(0)
        if name in found or name not in program.functions:
            continue
        found[name] = None
        waiting += called(program.functions[name])
    return list(found)


class Backend:
    """Makes code on demand and keeps it."""

    def __init__(self, program: Program, reporter: Reporter, asm_symbols: dict[str, Symbol]) -> None:
        self.program = program
        self.reporter = reporter
        self.asm_symbols = asm_symbols
        self.codes: dict[str, Code] = {}
        self._clones: dict[Symbol, Symbol] = {}
        self.main = reachable(program, "main")
        handlers = [name for name, function in program.functions.items() if function.interrupt]
        self.handler = handlers[0] if handlers else None
        self.isr = reachable(program, self.handler) if self.handler else []
        self.shared = set(self.main) & set(self.isr)

    def check(self) -> None:
        """Errors of the call graph: no main, several interrupts, undefined functions, recursion."""
        functions = self.program.functions
        if "main" not in functions or functions["main"].body is None:
            file = next(iter(self.reporter.texts), None)
            self.reporter.error("there is no function 'main'", Place(file))
            return
        handlers = [function for function in functions.values() if function.interrupt]
        for extra in handlers[1:]:
            self.reporter.error(
                "there is a second interrupt function",
                extra.place,
                hint=f"the first is '{handlers[0].name}' at {handlers[0].place}",
            )
        for handler in handlers:
            if handler.parameters or not isinstance(handler.result, VoidType):
                self.reporter.error("an interrupt function takes and returns nothing", handler.place)
        for name in dict.fromkeys([*self.main, *self.isr]):
            for callee, call in called(functions[name]).items():
                if functions[callee].body is None:
                    self.reporter.error(f"the function '{callee}' is declared but not defined", call.place)
        self._recursion()

    def _recursion(self) -> None:
        state: dict[str, int] = {}

        def visit(name: str, path: list[str]) -> bool:
            state[name] = 1
            for callee, call in called(self.program.functions[name]).items():
                if state.get(callee) == 1:
                    cycle = [*path[path.index(callee) :], callee]
                    self.reporter.error(
                        f"recursion is not possible on this chip: {' → '.join(cycle)}",
                        call.place,
                        hint="variables of functions have fixed places; use a loop",
                    )
                    return True
                if callee not in state and visit(callee, [*path, callee]):
                    return True
            state[name] = 2
            return False

        for start in ("main", self.handler):
            if start and start not in state and visit(start, [start]):
                return

    def generate(self) -> dict[str, Code]:
        for name in self.main:
            self._function(name, isr=False)
        for name in self.isr:
            self._function(name, isr=True)
        return self.codes

    def _function(self, name: str, *, isr: bool) -> None:
        backend = self

        class Generator(FunctionGenerator):
            def asm_symbol(self, name: str) -> Symbol | None:
                return backend.asm_symbols.get(name)

            def asm_error(self, error: AsmError, place: Place) -> None:
                backend.reporter.error(f"assembly: {error.message}", place, error.hint)

        function = self.program.functions[name]
        generator = Generator(
            function,
            lambda called_name: self.signature(called_name, isr=isr),
            isr,
            lambda symbol: self._symbol(symbol, isr=isr),
            lambda kind, key: self._library(kind, key, isr=isr),
        )
        try:
            generator.generate()
        except RecursionError:
            raise self.reporter.too_deep(generator.place or function.place) from None
        made = sum(len(code.ins) for code in self.codes.values())
        if made > INSTRUCTIONS:
            raise self.reporter.too_large(
                f"the program has {made} instructions up to here, the chip has {PROGRAM_WORDS} words",
                function.place,
            )

    def _symbol(self, symbol: Symbol, *, isr: bool) -> Symbol:
        """The interrupt's own copy of a local of a shared function."""
        if not isr or symbol.function not in self.shared or symbol.kind not in ("local", "param", "result"):
            return symbol
        if symbol not in self._clones:
            self._clones[symbol] = replace(symbol)
        return self._clones[symbol]

    def signature(self, name: str, *, isr: bool) -> Code:
        """The callee's parameters and result, before or after its code is made."""
        full = name + ISR_SUFFIX if isr and name in self.shared else name
        if full not in self.codes:
            function = self.program.functions[name]
            code = Code(full, place=function.place)
            code.parameters = [self._symbol(each, isr=isr) for each in function.parameters]
            result = function.result
            if not isinstance(result, VoidType):
                if result.size == 1 and result.scalar:
                    code.returns_w = True
                else:
                    code.result = Symbol(
                        f"{full}.result",
                        result,
                        "result",
                        function=name,
                        pinned=not isinstance(result, IntType),
                    )
                    code.own.append(code.result)
            one_byte = [each for each in code.parameters if each.size == 1 and each.type.scalar]
            code.w_parameter = one_byte[-1] if one_byte else None
            locals_ = [self._symbol(each, isr=isr) for each in function.locals]
            code.own += [*code.parameters, *locals_]
            self.codes[full] = code
        return self.codes[full]

    def _library(self, kind: str, key: tuple[int, ...], *, isr: bool) -> Code:
        name = "__" + "_".join([kind, *map(str, key)]) + (ISR_SUFFIX if isr and self.main_uses else "")
        if name not in self.codes:
            code = Code(name)
            self.codes[name] = code
            build(kind, key, code, lambda other, other_key: self._library(other, other_key, isr=isr))
        return self.codes[name]

    @property
    def main_uses(self) -> bool:
        return True


def globals_of(program: Program, names: list[str]) -> set[Symbol]:
    """The variables that functions name."""
    found: set[Symbol] = set()
    for name in names:
        body = program.functions[name].body
        for expr in expressions(body) if body is not None else ():
            if isinstance(expr, Ref):
                found.add(expr.symbol)
            elif isinstance(expr, AddressOf):
                found.add(expr.target.symbol)
    return found
