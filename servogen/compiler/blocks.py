"""Semantic analysis of functions' bodies and blocks: items in order, what is never reached, assembly.

In: pycparser nodes. Out: blocks of the typed tree; each form of statement is made by `statements`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from pycparser import c_ast

from servogen.compiler.ctypes import IntType
from servogen.compiler.declarations import Declarations
from servogen.compiler.diagnostics import Fatal
from servogen.compiler.program import (
    Asm,
    Block,
    ExprStmt,
    Function,
    If,
    Jump,
    Loop,
    Return,
    Stmt,
    Switch,
)
from servogen.compiler.rawtext import MARKER, AsmBlock
from servogen.compiler.tree import Call, Expr
from servogen.errors import Place, nearest


@dataclass(slots=True)
class _Body:
    """What a function body collects while it is read."""

    labels: dict[str, Place] = field(default_factory=dict)
    gotos: list[tuple[str, Any]] = field(default_factory=list)
    loops: int = 0
    breakable: int = 0
    switches: list[tuple[Switch, IntType]] = field(default_factory=list)


class Blocks(Declarations):
    """Adds `define_function`."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.body = _Body()
        self.blocks: list[AsmBlock] = []

    def define_function(self, function: Function, node: Any) -> None:
        """Read the body of a function."""
        self.function = function
        self.body = _Body()
        self.scopes.push()
        for symbol in function.parameters:
            self.scopes.here.names[symbol.name] = symbol
            self.asm_symbols[symbol.asm_name] = symbol
        block = Block([])
        self._items(node.body.block_items or [], block.body)
        for label, where in self.body.gotos:
            if label not in self.body.labels:
                hint = nearest(label, self.body.labels) if self.body.labels else None
                self.reporter.error(
                    f"there is no label '{label}' in '{function.name}'", self.place(where), hint
                )
        self.scopes.pop()
        function.body = block
        self.function = None

    def _items(self, nodes: list[Any], out: list[Stmt]) -> None:
        """Block items; an error in one does not hide those of the next."""
        ended = False
        for node in nodes:
            if ended and not _can_be_reached(node):
                if not isinstance(node, (c_ast.Break, c_ast.EmptyStatement, c_ast.Return)):
                    self.reporter.warn("this is never reached", self.place(node))
                ended = False
            before = len(out)
            try:
                self._item(node, out)
            except Fatal:
                self.pending.clear()
                continue
            if len(out) > before and _leaves(out[-1]):
                ended = True
            elif _can_be_reached(node):
                ended = False

    def _item(self, node: Any, out: list[Stmt]) -> None:
        if isinstance(node, (c_ast.Decl, c_ast.Typedef)):
            try:
                self.declare(node)
            except Fatal:
                self._forget(node)
                raise
            out += self.pending
            self.pending = []
        elif isinstance(node, (c_ast.Struct, c_ast.Union, c_ast.Enum)):
            self._specified(node, node)
        else:
            out.append(self.statement(node))

    def _forget(self, node: Any) -> None:
        """After a wrong declaration the name is known all the same, so that its uses are not errors too."""
        name = getattr(node, "name", None)
        if name and self.scopes.here.names.get(name) is None and self.function is not None:
            from servogen.compiler.tree import Symbol

            symbol = Symbol(name, self.int_type, "local", self.place(node), function=self.function.name)
            self.scopes.here.names[name] = symbol

    def statement(self, node: Any) -> Stmt:
        method = getattr(self, "_stmt_" + type(node).__name__, None)
        if method is not None:
            found: Stmt = method(node)
            return found
        if isinstance(node, c_ast.FuncCall) and isinstance(node.name, c_ast.ID) and node.name.name == MARKER:
            return self.asm_statement(int(node.args.exprs[0].value), self.place(node))
        expr = self._effect(node)
        return ExprStmt(expr)

    def asm_statement(self, number: int, place: Place) -> Asm:
        block = self.blocks[number]
        lines = [(Place(block.file, line), text) for line, text in block.lines]
        names: dict[str, Any] = {}
        if self.function is not None:
            for scope in self.scopes.stack[1:]:
                names.update(
                    {f"_{name}": what for name, what in scope.names.items() if hasattr(what, "asm_name")}
                )
        return Asm(lines, names, list(self._asm_calls(lines)), place)

    def _asm_calls(self, lines: list[tuple[Place, str]]) -> Iterator[Call]:
        """The C functions that lines of assembly call as `_name`."""
        for place, text in lines:
            match = re.match(r"(?i)(?:.*:)?\s*call\s+_(\w+)\s*(?:;|//|$)", text)
            called = self.scopes.find(match[1]) if match else None
            if isinstance(called, Function):
                yield Call(called.name, [], called.result, place)

    def _effect(self, node: Any) -> Expr:
        """An expression evaluated for what it does."""
        expr = self.expr(node)
        self.warn_unused(expr)
        return expr

    def condition(self, node: Any) -> Expr:
        if isinstance(node, c_ast.Assignment) and node.op == "=":
            self.reporter.warn(
                "an assignment as a condition",
                self.place(node),
                hint="'==' compares; '((a = b) != 0)' says it is meant",
            )
        return self.truth(self.condition_operand(node))

    def _nested(self, node: Any) -> Stmt:
        if node is None:
            return Block([])
        out: list[Stmt] = []
        self._items([node], out)
        return out[0] if len(out) == 1 else Block(out)

    # each kind


def _leaves(made: Stmt) -> bool:
    """Whether what stands behind a statement can only be reached by a label."""
    match made:
        case Return() | Jump():
            return True
        case Block(body):
            return bool(body) and _leaves(body[-1])
        case If(_, yes, no):
            return no is not None and _leaves(yes) and _leaves(no)
        case Loop(None, body):
            return not _breaks(body)
    return False


def _breaks(made: Stmt) -> bool:
    """Whether a `break` in a loop's body, outside the loops and switches inside it, ends the loop."""
    match made:
        case Jump("break"):
            return True
        case Block(body):
            return any(map(_breaks, body))
        case If(_, yes, no):
            return _breaks(yes) or (no is not None and _breaks(no))
    return False


def _can_be_reached(node: Any) -> bool:
    """A label, a case, a declaration, or a block that holds a label."""
    if isinstance(node, (c_ast.Label, c_ast.Case, c_ast.Default, c_ast.Decl, c_ast.Typedef)):
        return True
    if isinstance(node, c_ast.Node):
        return any(
            _can_be_reached(child) for _, child in node.children() if not isinstance(child, c_ast.Decl)
        )
    return False
