"""Function pointers: a function whose address is taken has a number, and a call through a pointer goes to
a dispatcher, a function that calls the one with that number.

In: functions and types of functions. Out: numbers, dispatchers. There is one dispatcher for each type; it
calls every function whose address is taken and whose parameters and result have the sizes of that type's, so
that the call graph knows all candidates, those behind a cast among them. A pointer is one byte; 0 is not a
function, and calling it does nothing and yields 0.
"""

from __future__ import annotations

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import U8, FuncType, PointerType, VoidType, same
from servogen.compiler.sema.analyser import Analyser
from servogen.errors import Location

MAX_FUNCTIONS = 255
DISPATCHER = "__call"
"""How the names of dispatchers begin."""


def type_of(function: tree.FunctionDefinition) -> FuncType:
    parameters = tuple(parameter.type for parameter in function.parameters) if function.prototyped else None
    return FuncType(function.result, parameters)


def address(analyser: Analyser, function: tree.FunctionDefinition, place: Location) -> tree.Num:
    """Return a function's number as a pointer to it."""
    if function.interrupt:
        raise analyser.fail(
            "c-interrupt", f"the interrupt function '{function.name}' cannot be called", place
        )
    numbers = analyser.function_numbers
    if len(numbers) == MAX_FUNCTIONS and function.name not in numbers:
        raise analyser.fail(
            "program-too-large", f"the addresses of more than {MAX_FUNCTIONS} functions are taken", place
        )
    analyser.called.add(function.name)
    return tree.Num(
        numbers.setdefault(function.name, len(numbers) + 1), PointerType(type_of(function)), place
    )


def dispatcher(analyser: Analyser, kind: FuncType) -> tree.FunctionDefinition:
    """Return the dispatcher of a type of function; its parameters are the function's and the number."""
    for known, definition in analyser.dispatchers:
        if same(known, kind):
            return definition
    name = f"{DISPATCHER}{len(analyser.dispatchers) + 1}"
    parameters = [
        tree.Symbol(f"argument{number}", parameter.plain(), "param", function=name)
        for number, parameter in enumerate(kind.parameters or (), 1)
    ]
    number = tree.Symbol("number", U8, "param", function=name)
    definition = tree.FunctionDefinition(
        name, kind.result, [*parameters, number], Location(), body=tree.BlockStatement([])
    )
    analyser.program.functions[name] = definition
    analyser.defined.add(definition)
    analyser.dispatchers.append((kind, definition))
    return definition


def finish(analyser: Analyser) -> None:
    """Give the dispatchers their bodies, once every function whose address is taken is known."""
    for kind, definition in analyser.dispatchers:
        *parameters, number = definition.parameters
        place = definition.place
        cases: list[tuple[int, tree.CaseLabel]] = []
        body: list[tree.Stmt] = []
        for name, value in analyser.function_numbers.items():
            function = analyser.program.functions[name]
            if not _fits(type_of(function), kind):
                continue
            label = tree.CaseLabel(place)
            cases.append((value, label))
            given = [
                tree.Ref(argument, 0, None, wanted.type.plain(), place)
                for argument, wanted in zip(parameters, function.parameters, strict=True)
            ]
            call = tree.Call(name, list(given), definition.result.plain(), place)
            # a call that returns nothing needs a return of its own before the next case
            empty = isinstance(function.result, VoidType)
            body += [
                label,
                *([tree.ExprStmt(call), tree.Return(None, place)] if empty else [tree.Return(call, place)]),
            ]
        assert definition.body is not None
        value_of = tree.Ref(number, 0, None, U8, place)
        definition.body.body = [tree.Switch(value_of, cases, None, tree.BlockStatement(body), place)]
        if kind.result.scalar:
            definition.body.body.append(tree.Return(tree.Num(0, kind.result.plain(), place), place))


def _fits(function: FuncType, kind: FuncType) -> bool:
    """Return whether a pointer of a type may lead to a function: its arguments lie in the same places."""
    one, two = function.parameters or (), kind.parameters or ()
    if [parameter.size for parameter in one] != [parameter.size for parameter in two]:
        return False
    results = [isinstance(side.result, VoidType) or side.result.size for side in (function, kind)]
    return results[0] == results[1]
