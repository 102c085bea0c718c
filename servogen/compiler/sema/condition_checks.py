"""Warnings about conditions that hardly test what was intended, read off the syntax tree of a function.

In: pycparser's tree of a function definition. Out: warnings: constants as operands of `&&` and `||`, `!` for
`~`, comparisons that are decided, loops whose condition nothing changes, enumerators without a case.
"""

from __future__ import annotations

from typing import Any

from pycparser import c_ast

from servogen.compiler.ast.constant_folding import COMPARISONS, MIRRORED, compare
from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import FloatType
from servogen.compiler.ast.walk import syntax_nodes
from servogen.compiler.frontend.dialects import chip_bits, chip_registers
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.lint import STEPS

_INTEGERS = ("int", "unsigned int", "long int", "unsigned long int", "long long int")


def check_conditions(analyser: Analyser, function: Any) -> None:
    """Report what is suspicious in the conditions of a function definition."""
    changing = _volatile_names(function)
    for node in syntax_nodes(function.body):
        match node:
            case c_ast.BinaryOp(op="&&" | "||"):
                _logical_constant(analyser, node)
                _decided(analyser, node)
            case c_ast.BinaryOp() if node.op in COMPARISONS:
                _with_itself(analyser, node, changing)
            case c_ast.Assignment(op="&=" | "|=" | "^="):
                _negated_mask(analyser, node.rvalue)
            case c_ast.For():
                _unchanged(analyser, node, function, changing)
            case c_ast.Switch():
                _missing_cases(analyser, node)
        if isinstance(node, c_ast.BinaryOp) and node.op in ("&", "|"):
            _negated_mask(analyser, node.left)
            _negated_mask(analyser, node.right)


def _volatile_names(function: Any) -> set[str]:
    """Return the names that a function declares volatile, or with a floating-point type: a NaN differs from
    itself.
    """
    return {
        node.declname
        for node in syntax_nodes(function)
        if isinstance(node, c_ast.TypeDecl) and node.declname and ("volatile" in node.quals or _floats(node))
    }


def _floats(node: Any) -> bool:
    names = getattr(node.type, "names", ())
    return "float" in names or "double" in names


def _number(node: Any) -> int | None:
    """Return the value of an integer literal, with its sign; None for anything else."""
    match node:
        case c_ast.Constant() if node.type in _INTEGERS:
            text = node.value.rstrip("uUlL")
            octal = text[0] == "0" and len(text) > 1 and text[1] not in "xX"
            return int(text, 8 if octal else 0)
        case c_ast.UnaryOp(op="-"):
            value = _number(node.expr)
            return None if value is None else -value
    return None


# constants as operands


def _logical_constant(analyser: Analyser, node: Any) -> None:
    """Warn about `PORTB && 0x04`, where `&` was intended: a constant that is neither 0 nor 1, or a mask."""
    for operand in (node.right, node.left):
        value = _number(operand)
        written_as_mask = isinstance(operand, c_ast.Constant) and operand.value[:2].lower() == "0x"
        if value is not None and (value not in (0, 1) or written_as_mask):
            single = node.op[0]
            analyser.reporter.warn(
                "c-logical-constant",
                f"'{node.op}' only tests whether this constant is 0",
                analyser.place(operand),
                hint=f"'{single}' combines the bits",
            )
            return


def _negated_mask(analyser: Analyser, node: Any) -> None:
    """Warn about `PORTB &= !0x04`, where `~` was intended."""
    if not isinstance(node, c_ast.UnaryOp) or node.op != "!" or not _constant(node.expr):
        return
    analyser.reporter.warn(
        "c-logical-constant",
        "'!' of a constant is 0 or 1",
        analyser.place(node),
        hint="'~' inverts each bit",
    )


def _constant(node: Any) -> bool:
    return all(
        isinstance(part, (c_ast.Constant, c_ast.BinaryOp, c_ast.UnaryOp)) for part in syntax_nodes(node)
    )


# comparisons that are decided


def _with_itself(analyser: Analyser, node: Any, changing: set[str]) -> None:
    """Warn about a variable that is compared with itself."""
    left, right = node.left, node.right
    if not isinstance(left, c_ast.ID) or not isinstance(right, c_ast.ID) or left.name != right.name:
        return
    if not _may_change(analyser, left.name, changing):
        analyser.reporter.warn("c-comparison", f"'{left.name}' is compared with itself", analyser.place(node))


def _may_change(analyser: Analyser, name: str, changing: set[str]) -> bool:
    """Return whether a variable may differ each time it is read, or from itself."""
    symbol = analyser.scopes.find(name)
    differs = isinstance(symbol, Symbol) and (symbol.volatile or isinstance(symbol.type, FloatType))
    return differs or name in changing or name in chip_registers() or name in chip_bits()


def _decided(analyser: Analyser, node: Any) -> None:
    """Warn about `a != 1 || a != 2` and `a < 3 && a > 7`, which no value of `a` makes false, or true."""
    one, two = _range(node.left), _range(node.right)
    if one is None or two is None or one[0] != two[0]:
        return
    (_, first, low), (_, second, high) = one, two
    values = {value + step for value in (low, high) for step in (-1, 0, 1)}
    results = {
        compare(first, value, low) or compare(second, value, high)
        if node.op == "||"
        else compare(first, value, low) and compare(second, value, high)
        for value in values
    }
    if len(results) == 1 and results == {node.op == "||"}:
        always = "true" if node.op == "||" else "false"
        analyser.reporter.warn(
            "c-comparison",
            f"these two comparisons together are always {always}",
            analyser.place(node),
            hint=f"'{'&&' if node.op == '||' else '||'}' may be meant",
        )


def _range(node: Any) -> tuple[str, str, int] | None:
    """Return (variable, operator, number) of a comparison with a number."""
    if not isinstance(node, c_ast.BinaryOp) or node.op not in COMPARISONS:
        return None
    for variable, number, op in (
        (node.left, node.right, node.op),
        (node.right, node.left, MIRRORED[node.op]),
    ):
        value = _number(number)
        if isinstance(variable, c_ast.ID) and value is not None:
            return variable.name, op, value
    return None


# loops


def _unchanged(analyser: Analyser, node: Any, function: Any, changing: set[str]) -> None:
    """Warn about `for (i = 0; i < 8; j++)`: nothing in the loop changes what its condition reads."""
    if node.cond is None or node.next is None:
        return
    parts = syntax_nodes(node.cond)
    if not all(isinstance(part, (c_ast.ID, c_ast.Constant, c_ast.BinaryOp)) for part in parts):
        return
    read = {part.name for part in parts if isinstance(part, c_ast.ID)}
    inside = [*syntax_nodes(node.next), *syntax_nodes(node.stmt)]
    leaves = (c_ast.Break, c_ast.Return, c_ast.Goto)
    if not read or any(isinstance(part, leaves) for part in inside) or not read <= _locals(function):
        return
    if read & changing or read & _changed(inside):
        return
    names = " and ".join(f"'{name}'" for name in sorted(read))
    analyser.reporter.warn(
        "c-loop-condition",
        f"the loop never changes {names}, which its condition tests",
        analyser.place(node.cond),
    )


def _locals(function: Any) -> set[str]:
    return {node.name for node in syntax_nodes(function) if isinstance(node, c_ast.Decl) and node.name}


def _changed(nodes: list[Any]) -> set[str]:
    """Return the names that are assigned to, counted, or whose address is taken."""
    names = set()
    for node in nodes:
        if isinstance(node, c_ast.Assignment) and isinstance(node.lvalue, c_ast.ID):
            names.add(node.lvalue.name)
        elif isinstance(node, c_ast.UnaryOp) and node.op in (*STEPS, "&") and isinstance(node.expr, c_ast.ID):
            names.add(node.expr.name)
    return names


# enumerations


def enumerated_names(units: list[Any]) -> dict[str, list[str]]:
    """Return the enumerators of each variable, parameter and member that a file declares with an `enum`."""
    known: dict[str, list[str]] = {}
    variables: dict[str, list[str]] = {}
    below = [node for unit in units for node in syntax_nodes(unit)]
    for node in below:
        if isinstance(node, c_ast.Enum) and node.values is not None and node.name:
            known[f"enum {node.name}"] = _enumerators(node)
    for node in below:
        if not isinstance(node, (c_ast.Decl, c_ast.Typedef)) or not isinstance(node.type, c_ast.TypeDecl):
            continue
        kind = node.type.type
        values: list[str] | None = None
        if isinstance(kind, c_ast.Enum):
            values = _enumerators(kind) if kind.values is not None else known.get(f"enum {kind.name}")
        elif isinstance(kind, c_ast.IdentifierType) and len(kind.names) == 1:
            values = known.get(kind.names[0])
        if values is not None and node.name:
            (known if isinstance(node, c_ast.Typedef) else variables)[node.name] = values
    return variables


def _enumerators(enum: Any) -> list[str]:
    """Return the names that an enumeration defines."""
    return [enumerator.name for enumerator in enum.values.enumerators]


def _missing_cases(analyser: Analyser, node: Any) -> None:
    """Warn about a `switch` over an enumeration that has neither all cases nor a default."""
    place = node.cond.field if isinstance(node.cond, c_ast.StructRef) else node.cond
    values = analyser.enumerated.get(place.name) if isinstance(place, c_ast.ID) else None
    if values is None:
        return
    labels = [label for label in syntax_nodes(node.stmt) if isinstance(label, (c_ast.Case, c_ast.Default))]
    if any(isinstance(label, c_ast.Default) for label in labels):
        return
    named = {label.expr.name for label in labels if isinstance(label.expr, c_ast.ID)}
    missing = [name for name in values if name not in named]
    if missing:
        analyser.reporter.warn(
            "c-case-missing",
            f"there is no case for {', '.join(missing)}",
            analyser.place(node),
            hint="add the case, or a default",
        )
