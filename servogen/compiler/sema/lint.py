"""Warnings about C that is legal and seldom meant, read off the syntax tree of a function.

In: pycparser's tree of a function's body. Out: warnings: precedence, `;` behind a loop, a dangling else,
strings compared by their addresses, changes in no order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from typing import Any

from pycparser import c_ast

from servogen.compiler.ast.constant_folding import COMPARISONS
from servogen.compiler.sema.analyser import Analyser

_BITWISE = ("&", "|", "^")
_SHIFTS = ("<<", ">>")


def check_syntax(analyser: Analyser, function: Any) -> None:
    """Report what is suspicious in a function definition."""
    for node in _nodes(function.body):
        match node:
            case c_ast.BinaryOp():
                _precedence(analyser, node)
                _compared_strings(analyser, node)
            case c_ast.If():
                _dangling_else(analyser, node)
            case c_ast.Compound():
                _empty_bodies(analyser, node)
    for expression in _full_expressions(function.body):
        _Order(analyser).of(expression)


def _nodes(node: Any) -> Iterator[Any]:
    yield node
    for _, child in node.children():
        yield from _nodes(child)


# precedence


def _precedence(analyser: Analyser, node: Any) -> None:
    """Warn about `a & b == c`, `!a & 1` and `a << b + c`, which lack the parentheses that were meant."""
    for operand in (node.left, node.right):
        if id(operand) in analyser.parenthesised:
            continue
        inner = operand.op if isinstance(operand, c_ast.BinaryOp) else ""
        if (node.op in _BITWISE and inner in COMPARISONS) or (node.op in _SHIFTS and inner in ("+", "-")):
            analyser.reporter.warn(
                "c-precedence",
                f"'{inner}' is evaluated before '{node.op}'",
                analyser.place(operand),
                hint="put parentheses around what belongs together",
            )
    negated = isinstance(node.left, c_ast.UnaryOp) and node.left.op == "!"
    tested = node.op in _BITWISE or node.op in COMPARISONS
    if (
        negated
        and tested
        and id(node.left) not in analyser.parenthesised
        and isinstance(node.right, c_ast.Constant)
    ):
        analyser.reporter.warn(
            "c-precedence",
            f"'!' is evaluated before '{node.op}'",
            analyser.place(node.left),
            hint=f"write !(… {node.op} …)",
        )


def _compared_strings(analyser: Analyser, node: Any) -> None:
    sides = (node.left, node.right)
    strings = [each for each in sides if isinstance(each, c_ast.Constant) and each.type == "string"]
    if node.op in COMPARISONS and strings:
        analyser.reporter.warn(
            "c-string-comparison",
            "this compares the address of a string, not its characters",
            analyser.place(strings[0]),
            hint="strcmp of <string.h> compares characters",
        )


# statements


def _dangling_else(analyser: Analyser, node: Any) -> None:
    inner = node.iftrue
    if node.iffalse is None and isinstance(inner, c_ast.If) and inner.iffalse is not None:
        analyser.reporter.warn(
            "c-dangling-else",
            "the 'else' belongs to this 'if'",
            analyser.place(inner),
            hint="put braces around the inner 'if'",
        )


def _empty_bodies(analyser: Analyser, node: Any) -> None:
    """Warn about a loop whose body is a `;` although a block or an indented statement follows."""
    for loop, after in pairwise(node.block_items or []):
        if not isinstance(loop, (c_ast.For, c_ast.While)) or not isinstance(loop.stmt, c_ast.EmptyStatement):
            continue
        here, there = analyser.place(loop), analyser.place(after)
        if analyser.place(loop.stmt).line != here.line:
            continue  # a `;` on a line of its own is meant
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


def used_names(node: Any) -> set[str]:
    """Return the names whose values a function uses: not those that are only assigned to or counted."""
    match node:
        case c_ast.ID():
            return {node.name}
        case c_ast.Assignment(lvalue=c_ast.ID()):
            return used_names(node.rvalue)
    alone = [*(node.block_items or [])] if isinstance(node, c_ast.Compound) else []
    alone += [node.next] if isinstance(node, c_ast.For) else []
    found: set[str] = set()
    for _, child in node.children():
        counted = isinstance(child, c_ast.UnaryOp) and child.op in _STEPS and child in alone
        if not (counted and isinstance(child.expr, c_ast.ID)):
            found |= used_names(child)
    return found


_STEPS = ("++", "--", "p++", "p--")


# the order of changes


def _full_expressions(node: Any) -> Iterator[Any]:
    """Yield the expressions of statements, initialisers and conditions, each as a whole (ISO C 6.8)."""
    for _, child in node.children():
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
        match node:
            case None:
                return _Effects()
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
                found = _Effects()
                for each in node.exprs:
                    found = found.merge(self.of(each))
                return found
            case c_ast.StructRef():
                return self.of(node.name)
            case c_ast.Cast():
                return self.of(node.expr)
        return self._unordered([child for _, child in node.children()], node)

    def _unordered(self, parts: list[Any], node: Any) -> _Effects:
        effects = [self.of(each) for each in parts]
        found = _Effects()
        for one, two in combinations(effects, 2):
            clash = one.changes & (two.changes | two.reads) | two.changes & one.reads
            self._say(clash, node)
        for each in effects:
            found = found.merge(each)
        return found

    def _assignment(self, node: Any) -> _Effects:
        value = self.of(node.rvalue)
        if isinstance(node.lvalue, c_ast.ID):
            name = node.lvalue.name
            self._say(value.changes & {name}, node)
            return _Effects(value.reads, value.changes | {name})
        place = self.of(node.lvalue)
        self._say(value.changes & (place.reads | place.changes) | place.changes & value.reads, node)
        return place.merge(value)

    def _say(self, names: set[str], node: Any) -> None:
        for name in sorted(names - self.said):
            self.said.add(name)
            self.analyser.reporter.warn(
                "c-unsequenced",
                f"'{name}' is changed and used in one expression, in no defined order",
                self.analyser.place(node),
                hint="divide it into several statements",
            )
