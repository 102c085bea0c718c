"""Semantic analysis of statements and function bodies.

In: pycparser statements. Out: statements of the typed tree; warnings for what is never reached.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from pycparser import c_ast

from servogen.compiler.ctypes import IntType, VoidType, promote
from servogen.compiler.declarations import Declarations
from servogen.compiler.diagnostics import Fatal
from servogen.compiler.rawtext import MARKER, AsmBlock
from servogen.compiler.tree import (
    Asm,
    Block,
    Call,
    CaseLabel,
    Expr,
    ExprStmt,
    Function,
    If,
    Jump,
    LabelStmt,
    Loop,
    Num,
    Return,
    Stmt,
    Switch,
)
from servogen.errors import Place, nearest


@dataclass(slots=True)
class _Body:
    """What a function body collects while it is read."""

    labels: dict[str, Place] = field(default_factory=dict)
    gotos: list[tuple[str, Any]] = field(default_factory=list)
    loops: int = 0
    breakable: int = 0
    switches: list[tuple[Switch, IntType]] = field(default_factory=list)


class Statements(Declarations):
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
                if not isinstance(node, (c_ast.Break, c_ast.EmptyStatement)):
                    self.reporter.warn("this is never reached", self.place(node))
                ended = False
            try:
                self._item(node, out)
            except Fatal:
                self.pending.clear()
                continue
            if _leaves(node):
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

    def _stmt_Compound(self, node: Any) -> Stmt:
        self.scopes.push()
        block = Block([])
        self._items(node.block_items or [], block.body)
        self.scopes.pop()
        return block

    def _stmt_EmptyStatement(self, node: Any) -> Stmt:
        return Block([])

    def _stmt_DeclList(self, node: Any) -> Stmt:
        block = Block([])
        for each in node.decls:
            self._item(each, block.body)
        return block

    def _stmt_If(self, node: Any) -> Stmt:
        condition = self.condition(node.cond)
        if isinstance(node.iftrue, c_ast.EmptyStatement) and node.iffalse is None:
            self.reporter.warn("this 'if' controls an empty statement", self.place(node.iftrue))
        return If(
            condition,
            self._nested(node.iftrue),
            self._nested(node.iffalse) if node.iffalse else None,
            self.place(node),
        )

    def _loop(
        self, node: Any, condition: Expr | None, step: Expr | None, post: bool, body: Any = None
    ) -> Stmt:
        kind = {c_ast.While: "while", c_ast.For: "for"}.get(type(node), "do")
        self.body.loops += 1
        self.body.breakable += 1
        inside = self._nested(node.stmt)
        self.body.loops -= 1
        self.body.breakable -= 1
        if isinstance(condition, Num) and condition.value:
            condition = None
        return Loop(condition, inside, step, post, self.place(node), kind)

    def _stmt_While(self, node: Any) -> Stmt:
        return self._loop(node, self.condition(node.cond), None, False)

    def _stmt_DoWhile(self, node: Any) -> Stmt:
        return self._loop(node, self.condition(node.cond), None, True)

    def _stmt_For(self, node: Any) -> Stmt:
        self.scopes.push()
        out: list[Stmt] = []
        if isinstance(node.init, c_ast.DeclList):
            for each in node.init.decls:
                self._item(each, out)
        elif node.init is not None:
            out.append(ExprStmt(self._effect(node.init)))
        condition = self.condition(node.cond) if node.cond is not None else None
        step = self._effect(node.next) if node.next is not None else None
        loop = self._loop(node, condition, step, False)
        self.scopes.pop()
        return Block([*out, loop])

    def _stmt_Switch(self, node: Any) -> Stmt:
        value = self.promoted(self.expr(node.cond))
        assert isinstance(value.type, IntType)
        switch = Switch(value, [], None, Block([]), self.place(node))
        self.body.switches.append((switch, promote(value.type, c2c=self.c2c)))
        self.body.breakable += 1
        if isinstance(node.stmt, c_ast.Compound):
            switch.body = self._stmt_Compound(node.stmt)
        else:
            switch.body = self._nested(node.stmt)
        self.body.breakable -= 1
        self.body.switches.pop()
        return switch

    def _stmt_Case(self, node: Any) -> Stmt:
        if not self.body.switches:
            raise self.fail("'case' outside a switch", node)
        switch, kind = self.body.switches[-1]
        value = kind.wrap(self.constant(node.expr, "a case"))
        if any(value == known for known, _ in switch.cases):
            raise self.fail(f"the case {value} is there twice", node)
        label = CaseLabel(self.place(node))
        switch.cases.append((value, label))
        return self._labelled(label, node.stmts)

    def _stmt_Default(self, node: Any) -> Stmt:
        if not self.body.switches:
            raise self.fail("'default' outside a switch", node)
        switch, _ = self.body.switches[-1]
        if switch.default is not None:
            raise self.fail("'default' is there twice", node)
        switch.default = CaseLabel(self.place(node))
        return self._labelled(switch.default, node.stmts)

    def _labelled(self, label: CaseLabel | LabelStmt, nodes: list[Any]) -> Stmt:
        block = Block([label])
        self._items(nodes or [], block.body)
        return block

    def _stmt_Label(self, node: Any) -> Stmt:
        if node.name in self.body.labels:
            raise self.fail(f"the label '{node.name}' is there twice", node)
        self.body.labels[node.name] = self.place(node)
        return self._labelled(LabelStmt(node.name, self.place(node)), [node.stmt])

    def _stmt_Break(self, node: Any) -> Stmt:
        if not self.body.breakable:
            raise self.fail("'break' outside a loop or switch", node)
        return Jump("break", "", self.place(node))

    def _stmt_Continue(self, node: Any) -> Stmt:
        if not self.body.loops:
            raise self.fail("'continue' outside a loop", node)
        return Jump("continue", "", self.place(node))

    def _stmt_Goto(self, node: Any) -> Stmt:
        self.body.gotos.append((node.name, node))
        return Jump("goto", node.name, self.place(node))

    def _stmt_Return(self, node: Any) -> Stmt:
        assert self.function is not None
        result = self.function.result
        place = self.place(node)
        if node.expr is None:
            if not isinstance(result, VoidType) and self.function.name != "main":
                self.reporter.warn(f"'{self.function.name}' should return '{result}'", place)
            return Return(None, place)
        expr = self.expr(node.expr)
        if isinstance(result, VoidType):
            if isinstance(expr.type, VoidType):
                return Return(expr, place)
            raise self.fail(f"'{self.function.name}' returns void, not a value", node)
        return Return(self.convert(expr, result, "the result"), place)

    def _stmt_Pragma(self, node: Any) -> Stmt:
        return Block([])

    def _stmt_StaticAssert(self, node: Any) -> Stmt:
        self.static_assertion(node)
        return Block([])

    def static_assertion(self, node: Any) -> None:
        """`_Static_assert`, in a function or outside."""
        if not self.constant(node.cond, "a static assertion"):
            raise self.fail("static assertion failed", node.cond)


def _leaves(node: Any) -> bool:
    return isinstance(node, (c_ast.Return, c_ast.Break, c_ast.Continue, c_ast.Goto))


def _can_be_reached(node: Any) -> bool:
    """A label, a case, a declaration, or a block that holds a label."""
    if isinstance(node, (c_ast.Label, c_ast.Case, c_ast.Default, c_ast.Decl, c_ast.Typedef)):
        return True
    if isinstance(node, c_ast.Node):
        return any(
            _can_be_reached(child) for _, child in node.children() if not isinstance(child, c_ast.Decl)
        )
    return False
