"""Makes a failing program smaller while it still fails in the same way.

In: a program and its outcome. Out: the smallest program found, and its outcome. Statements are left out,
bodies put in the place of what controls them, expressions replaced by their parts or by a number; variables
and functions that nothing names go too. Guards are made when printing, so every cut program is still well
defined.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any

from tests.compiler.random.compare import Outcome, compare, host, target
from tests.compiler.random.program import (
    AddressOf,
    Block,
    Call,
    Case,
    Deref,
    Element,
    Expr,
    Function,
    If,
    Int,
    Loop,
    Num,
    Pointer,
    Program,
    Skip,
    Step,
    Struct,
    Switch,
    Type,
    Var,
    Variable,
    Walk,
)
from tests.compiler.random.typing_rules import place_type

_STATEMENT_FIELDS = frozenset(("body", "yes", "no"))
_BATCH = 16


def shrink(program: Program, outcome: Outcome, *, most: int = 4000) -> tuple[Program, Outcome]:
    """Cut until nothing more can be cut, or `most` programs were tried."""
    tried = 0
    progress = True
    while progress and tried < most:
        progress = False
        pending: list[Program] = []
        for candidate in candidates(program):
            pending.append(candidate)
            tried += 1
            if len(pending) < _BATCH:
                continue
            found = _first(pending, outcome)
            pending = []
            if found is not None:
                program, outcome = found
                progress = True
                break
        else:
            found = _first(pending, outcome)
            if found is not None:
                program, outcome = found
                progress = True
    return program, outcome


def _first(programs: list[Program], like: Outcome) -> tuple[Program, Outcome] | None:
    """The first of some programs that fails like another."""
    found = []
    for program in programs:
        try:
            if like.kind in ("refused", "crash"):
                outcome = target(program, None)
                if outcome.kind == like.kind and _gist(outcome) == _gist(like):
                    host([program])
                    return program, outcome
            else:
                found.append(program)
        except Exception:
            continue
    if not found:
        return None
    try:
        outcomes = compare(found)
    except Exception:
        outcomes = []
        for each in found:
            try:
                outcomes += compare([each])
            except Exception:
                outcomes.append(Outcome("same"))
    for program, outcome in zip(found, outcomes, strict=True):
        if outcome.kind == like.kind and outcome.expected is not None:
            return program, outcome
    return None


def _gist(outcome: Outcome) -> str:
    lines = outcome.message.strip().splitlines()
    return lines[-1][:30] if lines else ""


def candidates(program: Program) -> Iterator[Program]:
    """Smaller programs, the boldest cuts first."""
    if program.interrupt:
        yield replace(program, interrupt=False)
    if program.files != "one":
        yield replace(program, files="one")
    yield from _without_unused(program)
    for function in reversed(program.functions):
        for body in _cut_bodies(function.body):
            yield _with(program, function, body=body)
        for variable in function.locals:
            if (
                variable.initial is not None
                and not isinstance(variable.initial, tuple)
                and isinstance(variable.type, Int)
            ):
                yield _renamed(program, function, variable)
    for function in reversed(program.functions):
        for number, stmt in enumerate(function.body):
            for smaller in _smaller(stmt):
                yield _with(
                    program, function, body=(*function.body[:number], smaller, *function.body[number + 1 :])
                )


def _with(program: Program, function: Function, **changes: Any) -> Program:
    """The program with one function changed, in every call as well."""
    new = Function(
        **{each.name: changes.get(each.name, getattr(function, each.name)) for each in fields(function)}
    )
    swapped = {function: new}
    functions: list[Function] = []
    for each in program.functions:
        if each is function:
            functions.append(new)
            continue
        body = _replaced(each.body, swapped)
        if body is each.body:
            functions.append(each)
        else:
            other = Function(**{one.name: getattr(each, one.name) for one in fields(each)})
            other.body = body
            swapped[each] = other
            functions.append(other)
    return replace(program, functions=tuple(functions))


def _renamed(program: Program, function: Function, variable: Variable) -> Program:
    """A local that starts as 0 in place of an expression."""
    new = replace_variable(variable, initial=(0,))
    changed = _with(
        program, function, locals=tuple(new if each is variable else each for each in function.locals)
    )
    target_function = next(each for each in changed.functions if each.name == function.name)
    target_function.body = _replaced(target_function.body, {variable: new})
    return changed


def replace_variable(variable: Variable, **changes: Any) -> Variable:
    return Variable(
        **{each.name: changes.get(each.name, getattr(variable, each.name)) for each in fields(variable)}
    )


def _replaced(node: Any, swapped: dict[Any, Any]) -> Any:
    """A copy of a tree with some functions or variables exchanged; the same object when nothing changes."""
    if isinstance(node, (Function, Variable)):
        return swapped.get(node, node)
    if isinstance(node, tuple):
        items = tuple(_replaced(each, swapped) for each in node)
        return node if all(a is b for a, b in zip(items, node, strict=True)) else items
    if is_dataclass(node) and not isinstance(node, type) and not isinstance(node, (Int, Struct)):
        changes = {}
        for each in fields(node):
            old = getattr(node, each.name)
            new = _replaced(old, swapped)
            if new is not old:
                changes[each.name] = new
        return replace(node, **changes) if changes else node
    return node


def _used(node: Any, into: set[Any]) -> None:
    if isinstance(node, Variable):
        if node in into:
            return
        into.add(node)
        if node.storage == "counter":
            into.add(node.name)
        if not isinstance(node.initial, tuple):
            _used(node.initial, into)
    elif isinstance(node, Function):
        into.add(node)
    elif isinstance(node, tuple):
        for each in node:
            _used(each, into)
    elif is_dataclass(node) and not isinstance(node, type) and not isinstance(node, (Int, Struct)):
        for each in fields(node):
            _used(getattr(node, each.name), into)


def _without_unused(program: Program) -> Iterator[Program]:
    """Without functions, variables and structures that nothing names."""
    used: set[Any] = set()
    for function in program.functions:
        _used((function.body, function.returns), used)
        names = used.copy()
        kept = [each for each in function.locals if each in names or each.name in names]
        for each in kept:
            _used(each, used)
    functions = [each for each in program.functions[:-1] if each in used]
    if len(functions) + 1 < len(program.functions):
        yield replace(program, functions=(*functions, program.functions[-1]))
    for function in program.functions:
        mine: set[Any] = {function.returns}
        _used(function.body, mine)
        for each in function.locals:
            if each in mine:
                _used(each.initial, mine) if not isinstance(each.initial, tuple) else None
        kept = [each for each in function.locals if each in mine or each.name in mine]
        if len(kept) < len(function.locals):
            yield _with(program, function, locals=tuple(kept))
    globals_ = [each for each in program.globals if each in used]
    if len(globals_) < len(program.globals):
        yield replace(program, globals=tuple(globals_))
    kinds = {each for variable in program.globals for each in _structs(variable.type)}
    kinds |= {
        kind for function in program.functions for each in function.parameters for kind in _structs(each.type)
    }
    structs = tuple(each for each in program.structs if each in kinds)
    if len(structs) < len(program.structs):
        yield replace(program, structs=structs)


def _structs(kind: Type) -> Iterator[Struct]:
    if isinstance(kind, Struct):
        yield kind
    elif isinstance(kind, Pointer):
        yield from _structs(kind.target)
    elif hasattr(kind, "element"):
        yield from _structs(kind.element)


def _cut_bodies(body: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
    """A list of statements with a part left out, or unwrapped, or with the same done inside one of them."""
    step = len(body) // 2
    while step > 1:
        for at in range(0, len(body), step):
            yield body[:at] + body[at + step :]
        step //= 2
    for at, stmt in enumerate(body):
        yield body[:at] + body[at + 1 :]
        match stmt:
            case If(_, yes, no):
                yield body[:at] + yes + body[at + 1 :]
                yield body[:at] + no + body[at + 1 :]
            case Block((), inner) | Skip(_, _, inner):
                yield body[:at] + inner + body[at + 1 :]
            case Block(variables, inner):
                for each in variables:
                    rest = tuple(one for one in variables if one is not each)
                    yield (*body[:at], Block(rest, inner), *body[at + 1 :])
            case Loop(condition=None) if stmt.rounds > 1:
                yield (*body[:at], replace(stmt, rounds=1), *body[at + 1 :])
            case Loop() if stmt.condition is not None:
                yield (*body[:at], replace(stmt, condition=None), *body[at + 1 :])
            case Walk() if stmt.value is not None or stmt.target is not None:
                yield (*body[:at], replace(stmt, value=None, target=None), *body[at + 1 :])
            case Switch(value, cases):
                for number, case in enumerate(cases):
                    yield (*body[:at], Switch(value, cases[:number] + cases[number + 1 :]), *body[at + 1 :])
                    yield body[:at] + case.body + body[at + 1 :]
                    for inner in _cut_bodies(case.body):
                        changed = (*cases[:number], replace(case, body=inner), *cases[number + 1 :])
                        yield (*body[:at], Switch(value, changed), *body[at + 1 :])
                    if len(case.values) > 1:
                        changed = (
                            *cases[:number],
                            replace(case, values=case.values[:1]),
                            *cases[number + 1 :],
                        )
                        yield (*body[:at], Switch(value, changed), *body[at + 1 :])
        if is_dataclass(stmt) and not isinstance(stmt, Switch):
            for each in fields(stmt):
                inner = getattr(stmt, each.name)
                if each.name in _STATEMENT_FIELDS and isinstance(inner, tuple):
                    for smaller in _cut_bodies(inner):
                        yield (*body[:at], replace(stmt, **{each.name: smaller}), *body[at + 1 :])  # type: ignore[type-var]


_EXPRESSIONS: tuple[type, ...] = Expr.__args__  # type: ignore[attr-defined]


def _is_value(node: Any) -> bool:
    """An expression that a number could stand for."""
    if not isinstance(node, _EXPRESSIONS) or isinstance(node, AddressOf):
        return False
    if isinstance(node, (Var, Element, Deref)):
        return isinstance(place_type(node), Int)
    return not (isinstance(node, Call) and not isinstance(node.function.result, Int))


def _parts(node: Any) -> Iterator[Any]:
    """The values directly inside an expression."""
    for each in fields(node):
        inner = getattr(node, each.name)
        for part in inner if isinstance(inner, tuple) else (inner,):
            if _is_value(part):
                yield part


def _smaller(node: Any) -> Iterator[Any]:
    """The same statement or expression with one expression in it replaced by something smaller."""
    for each in fields(node):
        old = getattr(node, each.name)
        if (each.name == "target" and not isinstance(node, Walk)) or each.name in (
            "function",
            "variable",
            "pointer",
            "place",
            "start",
            "never",
        ):
            if _is_value(old) and isinstance(old, Element):
                for smaller in _smaller(old):
                    yield replace(node, **{each.name: smaller})
            continue
        if isinstance(old, tuple):
            for number, part in enumerate(old):
                if isinstance(part, (Variable, int)):
                    continue
                for smaller in _choices(part):
                    yield replace(node, **{each.name: (*old[:number], smaller, *old[number + 1 :])})
        elif is_dataclass(old) and not isinstance(old, (Variable, Function, Int, Struct)):
            for smaller in _choices(old):
                yield replace(node, **{each.name: smaller})


def _choices(node: Any) -> Iterator[Any]:
    if _is_value(node):
        if not isinstance(node, Num):
            yield Num(0)
            yield Num(1)
            if not isinstance(node, (Step, Element)):
                yield from _parts(node)
        elif node.value > 1:
            yield from (Num(value) for value in (0, 1, 2) if value < node.value)
            if node.base != 10 or node.suffix:
                yield Num(node.value)
    if is_dataclass(node):
        yield from _smaller(node)


__all__ = ["Callable", "Case", "shrink"]
