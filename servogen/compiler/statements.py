"""Semantic analysis of each form of statement.

In: pycparser statements. Out: statements of the typed tree.
"""

from __future__ import annotations

from typing import Any

from pycparser import c_ast

from servogen.compiler.blocks import Blocks
from servogen.compiler.ctypes import IntType, VoidType, promote
from servogen.compiler.program import (
    Block,
    CaseLabel,
    ExprStmt,
    If,
    Jump,
    LabelStmt,
    Loop,
    Return,
    Stmt,
    Switch,
)
from servogen.compiler.tree import Expr, Num


class Statements(Blocks):
    """Adds each form of statement: a method `_stmt_` and the node's name."""

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
