"""Warnings about C that is legal but seldom intended, read off the syntax tree of a function.

In: pycparser's tree of a function's body. Out: warnings: precedence, `;` behind a loop, a dangling else,
strings compared by their addresses, unsequenced changes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from typing import Any

from pycparser import c_ast

from servogen.compiler.ast.constant_folding import COMPARISONS
from servogen.compiler.ast.nodes import FunctionDefinition, Symbol
from servogen.compiler.ast.walk import syntax_nodes
from servogen.compiler.sema.analyser import Analyser

STEPS = ("++", "--", "p++", "p--")
"""The operators that count, as pycparser writes them."""
_BITWISE = ("&", "|", "^")
_LOOSER = {
    **dict.fromkeys(_BITWISE, COMPARISONS),
    **dict.fromkeys(("<<", ">>"), ("+", "-")),
    "|": (*COMPARISONS, "&", "^"),
    "^": (*COMPARISONS, "&"),
    "||": ("&&",),
}
"""For an operator, those that are evaluated before it where a reader may take them together the other way."""


def check_syntax(analyser: Analyser, function: Any) -> None:
    """Report what is suspicious in a function definition."""
    for node in syntax_nodes(function.body):
        match node:
            case c_ast.BinaryOp():
                _precedence(analyser, node)
                _compared_strings(analyser, node)
            case c_ast.If():
                _dangling_else(analyser, node)
                _empty_else(analyser, node)
            case c_ast.Compound():
                _empty_bodies(analyser, node)
                _indentation(analyser, node)
            case c_ast.UnaryOp(op="sizeof"):
                _sizeof_parameter(analyser, node, function)
    for expression in _full_expressions(function.body):
        _Order(analyser).of(expression)


# precedence


def _precedence(analyser: Analyser, node: Any) -> None:
    """Warn about `a & b == c`, `!a & 1`, `a << b + c`, `a || b && c` and `a | b & c`, which lack the
    parentheses that were meant, and about `2 ^ 8`, which is not a power.
    """
    for operand in (node.left, node.right):
        if id(operand) in analyser.parenthesised:
            continue
        inner = operand.op if isinstance(operand, c_ast.BinaryOp) else ""
        if inner in _LOOSER.get(node.op, ()):
            analyser.reporter.warn(
                "c-precedence",
                f"'{inner}' is evaluated before '{node.op}'",
                analyser.place(operand),
                hint="put parentheses around what belongs together",
            )
    constants = all(isinstance(side, c_ast.Constant) for side in (node.left, node.right))
    if node.op == "^" and constants and node.left.value in ("2", "10"):
        analyser.reporter.warn(
            "c-xor-power",
            "'^' is exclusive or, not a power",
            analyser.place(node),
            hint="1 << n is a power of two",
        )
    negated = isinstance(node.left, c_ast.UnaryOp) and node.left.op == "!"
    tested = node.op in _BITWISE or node.op in COMPARISONS
    both = isinstance(node.right, c_ast.UnaryOp) and node.right.op == "!"
    if negated and tested and not both and id(node.left) not in analyser.parenthesised:
        analyser.reporter.warn(
            "c-precedence",
            f"'!' is evaluated before '{node.op}'",
            analyser.place(node.left),
            hint=f"write !(… {node.op} …)",
        )


def _compared_strings(analyser: Analyser, node: Any) -> None:
    """Warn about a comparison with a string literal, which compares addresses."""
    sides = (node.left, node.right)
    strings = [side for side in sides if isinstance(side, c_ast.Constant) and side.type == "string"]
    if node.op in COMPARISONS and strings:
        analyser.reporter.warn(
            "c-string-comparison",
            "this compares the address of a string, not its characters",
            analyser.place(strings[0]),
            hint="strcmp of <string.h> compares characters",
        )


# statements


def _dangling_else(analyser: Analyser, node: Any) -> None:
    """Warn about `if (a) if (b) …; else …`: the `else` belongs to the nearest `if` (ISO C 6.8.4.1)."""
    inner = node.iftrue
    if node.iffalse is None and isinstance(inner, c_ast.If) and inner.iffalse is not None:
        analyser.reporter.warn(
            "c-dangling-else",
            "the 'else' belongs to this 'if'",
            analyser.place(inner),
            hint="put braces around the inner 'if'",
        )


def _empty_else(analyser: Analyser, node: Any) -> None:
    """Warn about an `else` whose statement is a `;` in its line."""
    for body, word in ((node.iftrue, "if"), (node.iffalse, "else")):
        if not isinstance(body, c_ast.EmptyStatement) or (word == "if" and node.iffalse is not None):
            continue
        analyser.reporter.warn(
            "c-empty-body",
            f"the body of this '{word}' is this ';'",
            analyser.place(body),
            hint="what follows runs in either case",
        )


def _indentation(analyser: Analyser, node: Any) -> None:
    """Warn about a statement that is indented like the body of the `if` or loop above it, which has no
    braces.
    """
    for above, after in pairwise(node.block_items or []):
        body = _last_body(above)
        if body is None or isinstance(body, (c_ast.Compound, c_ast.EmptyStatement)):
            continue
        if isinstance(after, (c_ast.Label, c_ast.Case, c_ast.Default)):
            continue
        head, inner, here = analyser.place(above), analyser.place(body), analyser.place(after)
        apart = (head.line or 0) < (inner.line or 0) < (here.line or 0)
        if apart and (head.column or 0) < (here.column or 0) == inner.column:
            analyser.reporter.warn(
                "c-indentation",
                "this is indented like the statement above it, but does not depend on the condition",
                here,
                hint="put braces around both",
            )


def _last_body(node: Any) -> Any:
    """Return the statement that ends an `if` or a loop; None for other statements."""
    match node:
        case c_ast.If():
            last = node.iftrue if node.iffalse is None else node.iffalse
            return _last_body(last) or last
        case c_ast.For() | c_ast.While():
            return node.stmt
    return None


def _sizeof_parameter(analyser: Analyser, node: Any, function: Any) -> None:
    """Warn about the size of a parameter that is declared as an array, which makes it a pointer."""
    arguments = function.decl.type.args
    arrays = {
        parameter.name
        for parameter in (arguments.params if arguments is not None else [])
        if isinstance(getattr(parameter, "type", None), c_ast.ArrayDecl)
    }
    if isinstance(node.expr, c_ast.ID) and node.expr.name in arrays:
        analyser.reporter.warn(
            "c-sizeof",
            f"'{node.expr.name}' is a pointer here: this is not the size of the array",
            analyser.place(node),
            hint="pass the length as another parameter",
        )


def _empty_bodies(analyser: Analyser, node: Any) -> None:
    """Warn about a loop whose body is a `;` although a block or an indented statement follows."""
    for loop, after in pairwise(node.block_items or []):
        if not isinstance(loop, (c_ast.For, c_ast.While)) or not isinstance(loop.stmt, c_ast.EmptyStatement):
            continue
        here, there = analyser.place(loop), analyser.place(after)
        if analyser.place(loop.stmt).line != here.line:
            continue  # a `;` on a line of its own is intentional
        below = (there.line or 0) > (here.line or 0) and not isinstance(after, c_ast.Decl)
        indented = below and (there.column or 0) > (here.column or 0)
        if isinstance(after, c_ast.Compound) or indented:
            word = "for" if isinstance(loop, c_ast.For) else "while"
            analyser.reporter.warn(
                "c-empty-body",
                f"the body of this '{word}' is this ';'",
                analyser.place(loop.stmt),
                hint="what follows runs once, after the loop",
            )


def check_statics(analyser: Analyser, units: list[Any]) -> None:
    """Report static functions and variables of a file that nothing in it names; headers may hold more than is
    used.
    """
    used = {node.name for unit in units for node in syntax_nodes(unit) if isinstance(node, c_ast.ID)}
    assembly = "\n".join(text for block in analyser.asm_blocks for _, text in block.lines)
    for unit in units:
        decl = unit.decl if isinstance(unit, c_ast.FuncDef) else unit
        if not isinstance(decl, c_ast.Decl) or "static" not in (decl.storage or []) or decl.name in used:
            continue
        place = analyser.place(decl)
        function = isinstance(decl.type, c_ast.FuncDecl)
        meaning = analyser.file_scopes[-1].stack[0].names.get(decl.name)
        wanted = (
            meaning.interrupt
            if isinstance(meaning, FunctionDefinition)
            else not isinstance(meaning, Symbol) or meaning.volatile or meaning.kind != "global"
        )
        in_header = (place.file or "").lower().endswith(".h") or "inline" in (decl.funcspec or [])
        defined = isinstance(unit, c_ast.FuncDef) or not function
        if defined and not wanted and not in_header and f"_{decl.name}" not in assembly:
            verb = "called" if function else "used"
            analyser.reporter.warn("c-unused", f"'{decl.name}' is never {verb}", place)


def used_names(node: Any) -> set[str]:
    """Return the names whose values a function uses: not those that are only assigned to or counted."""
    match node:
        case c_ast.ID():
            return {node.name}
        case c_ast.Assignment(lvalue=c_ast.ID()):
            return used_names(node.rvalue)
    alone = [*(node.block_items or [])] if isinstance(node, c_ast.Compound) else []
    alone += [node.next] if isinstance(node, c_ast.For) else []
    alone += [node.stmt] if isinstance(node, (c_ast.For, c_ast.While, c_ast.DoWhile)) else []
    alone += [node.iftrue, node.iffalse] if isinstance(node, c_ast.If) else []
    names: set[str] = set()
    for child in node:
        counted = isinstance(child, c_ast.UnaryOp) and child.op in STEPS and child in alone
        if not (counted and isinstance(child.expr, c_ast.ID)):
            names |= used_names(child)
    return names


# the order of changes


def _full_expressions(node: Any) -> Iterator[Any]:
    """Yield the expressions of statements, initialisers and conditions, each as a whole (ISO C 6.8)."""
    for child in node:
        if isinstance(child, _EXPRESSIONS):
            yield child
        else:
            yield from _full_expressions(child)


_EXPRESSIONS = (
    c_ast.ArrayRef,
    c_ast.Assignment,
    c_ast.BinaryOp,
    c_ast.Cast,
    c_ast.ExprList,
    c_ast.FuncCall,
    c_ast.TernaryOp,
    c_ast.UnaryOp,
)


@dataclass(slots=True)
class _Effects:
    """The variables that an expression reads and changes, with no sequence point in between."""

    reads: set[str] = field(default_factory=set)
    changes: set[str] = field(default_factory=set)

    def merge(self, other: _Effects) -> _Effects:
        return _Effects(self.reads | other.reads, self.changes | other.changes)


class _Order:
    """Finds variables that one expression changes and uses in no order (ISO C 6.5, paragraph 2)."""

    def __init__(self, analyser: Analyser) -> None:
        self.analyser = analyser
        self.said: set[str] = set()

    def of(self, node: Any) -> _Effects:
        """Return what an expression reads and changes, and warn about clashes in it."""
        match node:
            case c_ast.ID():
                return _Effects({node.name})
            case c_ast.UnaryOp(op="++" | "--" | "p++" | "p--", expr=c_ast.ID(name=name)):
                return _Effects(set(), {name})
            case c_ast.UnaryOp(op="sizeof"):
                return _Effects()
            case c_ast.BinaryOp(op="&&" | "||"):
                return self.of(node.left).merge(self.of(node.right))
            case c_ast.TernaryOp():
                return self.of(node.cond).merge(self.of(node.iftrue)).merge(self.of(node.iffalse))
            case c_ast.Assignment():
                return self._assignment(node)
            case c_ast.FuncCall():
                arguments = list(node.args.exprs) if node.args is not None else []
                return self._unordered(arguments, node)
            case c_ast.ExprList():
                effects = _Effects()
                for operand in node.exprs:
                    effects = effects.merge(self.of(operand))
                return effects
            case c_ast.StructRef():
                return self.of(node.name)
            case c_ast.Cast():
                return self.of(node.expr)
        return self._unordered([*node], node)

    def _unordered(self, parts: list[Any], node: Any) -> _Effects:
        """Return the effects of operands that may be evaluated in any order, and warn where two clash."""
        effects = [self.of(part) for part in parts]
        together = _Effects()
        for one, two in combinations(effects, 2):
            clash = one.changes & (two.changes | two.reads) | two.changes & one.reads
            self._say(clash, node)
        for effect in effects:
            together = together.merge(effect)
        return together

    def _assignment(self, node: Any) -> _Effects:
        """Return the effects of an assignment, whose target is changed after its value is computed."""
        value = self.of(node.rvalue)
        if isinstance(node.lvalue, c_ast.ID):
            name = node.lvalue.name
            self._say(value.changes & {name}, node)
            return _Effects(value.reads, value.changes | {name})
        place = self.of(node.lvalue)
        self._say(value.changes & (place.reads | place.changes) | place.changes & value.reads, node)
        return place.merge(value)

    def _say(self, names: set[str], node: Any) -> None:
        """Warn about variables, each once."""
        for name in sorted(names - self.said):
            self.said.add(name)
            self.analyser.reporter.warn(
                "c-unsequenced",
                f"'{name}' is changed and used in one expression, in an undefined order",
                self.analyser.place(node),
                hint="split it into several statements",
            )
