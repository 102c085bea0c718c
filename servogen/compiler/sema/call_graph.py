"""The call graph: what main and the interrupt reach, and errors in the calls.

In: the typed tree of a program. Out: a `CallGraph`; errors for missing, duplicate and recursive functions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import VoidType
from servogen.compiler.ast.walk import expressions
from servogen.compiler.diagnostics import Reporter
from servogen.errors import Location
from servogen.pic.device import INTERRUPT_VECTOR


def _called(function: tree.FunctionDefinition) -> dict[str, tree.Call]:
    """Return the functions that a function calls, with the location of the call."""
    calls: dict[str, tree.Call] = {}
    if function.body is not None:
        for expr in expressions(function.body):
            if isinstance(expr, tree.Call):
                calls.setdefault(expr.function, expr)
    return calls


def statements(node: tree.Stmt) -> Iterator[tree.Stmt]:
    """Yield a statement and every statement inside it."""
    yield node
    match node:
        case tree.BlockStatement(body):
            for inner in body:
                yield from statements(inner)
        case tree.If(_, yes, no):
            yield from statements(yes)
            if no is not None:
                yield from statements(no)
        case tree.Loop(_, body) | tree.Switch(_, _, _, body):
            yield from statements(body)


def has_assembly(node: tree.Stmt) -> bool:
    """Return whether a statement is assembly or contains some."""
    return any(isinstance(statement, tree.Asm) for statement in statements(node))


def _reachable(calls: Mapping[str, Mapping[str, tree.Call]], start: str) -> list[str]:
    """Return the functions that `start` reaches, itself first."""
    reached: dict[str, None] = {}
    waiting = [start]
    while waiting:
        name = waiting.pop(0)
        if name not in reached and name in calls:
            reached[name] = None
            waiting += calls[name]
    return list(reached)


@dataclass(frozen=True, slots=True)
class CallGraph:
    """The functions that main and the interrupt reach, each list beginning with its root."""

    program: tree.ProgramTree
    calls: Mapping[str, Mapping[str, tree.Call]]
    """The calls in each function, by the function that they call."""
    main: list[str]
    handler: str | None
    """The interrupt function."""
    isr: list[str]
    program_has_assembly: bool
    """Whether a function contains assembly, which may do what the C does not show."""

    @property
    def shared(self) -> set[str]:
        """Return the functions that main and the interrupt both reach."""
        return set(self.main) & set(self.isr)


def call_graph(program: tree.ProgramTree) -> CallGraph:
    """Return the call graph of a program from main and from its interrupt function."""
    handler = next((name for name, function in program.functions.items() if function.interrupt), None)
    calls = {name: _called(function) for name, function in program.functions.items()}
    bodies = (function.body for function in program.functions.values())
    return CallGraph(
        program,
        calls,
        main=_reachable(calls, "main"),
        handler=handler,
        isr=_reachable(calls, handler) if handler else [],
        program_has_assembly=any(body is not None and has_assembly(body) for body in bodies),
    )


def check_calls(graph: CallGraph, reporter: Reporter) -> None:
    """Report errors in the call graph: no main, several interrupts, undefined functions, recursion."""
    functions = graph.program.functions
    if "main" not in functions or functions["main"].body is None:
        file = next(iter(reporter.texts), None)
        reporter.error("c-undefined", "there is no function 'main'", Location(file))
        return
    handlers = [function for function in functions.values() if function.interrupt]
    for extra in handlers[1:]:
        reporter.error(
            "c-interrupt",
            "there is a second interrupt function",
            extra.place,
            hint=f"the first is '{handlers[0].name}' at {handlers[0].place}",
        )
    for handler in handlers:
        if handler.parameters or not isinstance(handler.result, VoidType):
            reporter.error(
                "c-interrupt", "an interrupt function has no parameters and returns void", handler.place
            )
    for function in (functions["main"], *handlers):
        if function.origin not in (None, INTERRUPT_VECTOR if function.interrupt else None):
            reporter.error(
                "c-address",
                f"'{function.name}' cannot have this address: main lies anywhere, "
                f"an interrupt function at 0x{INTERRUPT_VECTOR:03X}",
                function.place,
            )
    # a function that nothing calls may stay undefined (ISO C 6.9)
    for name in dict.fromkeys([*graph.main, *graph.isr]):
        for callee, call in graph.calls[name].items():
            if functions[callee].body is None:
                reporter.error(
                    "c-undefined", f"the function '{callee}' is declared but not defined", call.place
                )
    _check_recursion(graph, reporter)


def _check_recursion(graph: CallGraph, reporter: Reporter) -> None:
    """Report the first cycle of calls: variables have fixed addresses, so that a function cannot be entered
    twice.
    """
    visited: set[str] = set()

    def visit(name: str, path: list[str]) -> bool:
        visited.add(name)
        for callee, call in graph.calls[name].items():
            if callee in path:
                cycle = [*path[path.index(callee) :], callee]
                reporter.error(
                    "c-call-depth",
                    f"recursion is not possible on this chip: {' → '.join(cycle)}",
                    call.place,
                    hint="the variables of a function have fixed addresses; use a loop",
                )
                return True
            if callee not in visited and visit(callee, [*path, callee]):
                return True
        return False

    for start in ("main", graph.handler):
        if start and start not in visited and visit(start, [start]):
            return


def globals_of(program: tree.ProgramTree, names: list[str]) -> set[tree.Symbol]:
    """Return the variables that functions refer to."""
    variables: set[tree.Symbol] = set()
    for name in names:
        body = program.functions[name].body
        for expr in expressions(body) if body is not None else ():
            if isinstance(expr, tree.Ref):
                variables.add(expr.symbol)
            elif isinstance(expr, tree.AddressOf):
                variables.add(expr.target.symbol)
    return variables
