"""Warnings about a function's variables and its end: unused, read before they are set, no return.

In: a function's typed tree. Out: warnings; none about a function with assembly, which may do anything.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import VoidType
from servogen.compiler.ast.walk import expressions
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.sema.call_graph import has_assembly, statements


def check_flow(
    function: tree.FunctionDefinition, declared: Sequence[tree.Symbol], used: set[str], reporter: Reporter
) -> None:
    """Report unused variables and parameters, variables read before they are set, and a missing return.
    `declared` are the variables that the program declares in the function, `used` the names that its text
    uses, also where constants have replaced them in the tree.
    """
    body = function.body
    if body is None or has_assembly(body):
        return
    _unused(body, declared, used, reporter)
    _unused_parameters(function, used, reporter)
    _missing_return(function, body, reporter)
    if not any(isinstance(statement, tree.LabelStmt) for statement in statements(body)):
        _Uninitialised(body, declared, reporter).report()


# unused


def _unused(
    body: tree.BlockStatement, declared: Sequence[tree.Symbol], used: set[str], reporter: Reporter
) -> None:
    """Warn about variables that are never used, or only set."""
    written = {
        expr.target.symbol
        for expr in expressions(body)
        if isinstance(expr, (tree.Assign, tree.Update)) and isinstance(expr.target, tree.Ref)
    }
    for symbol in declared:
        if symbol.volatile or symbol.name in used:
            continue
        if symbol in written:
            reporter.warn("c-unused", f"'{symbol.name}' is set and never used", symbol.place)
        else:
            reporter.warn("c-unused", f"'{symbol.name}' is never used", symbol.place)


def _unused_parameters(function: tree.FunctionDefinition, used: set[str], reporter: Reporter) -> None:
    """Warn about parameters that are never used."""
    for symbol in function.parameters:
        if symbol.place.line and symbol.name not in used:
            reporter.warn(
                "c-unused",
                f"the parameter '{symbol.name}' is never used",
                symbol.place,
                hint=f"'(void){symbol.name};' marks it as intentional",
            )


# the end of a function


def _missing_return(function: tree.FunctionDefinition, body: tree.BlockStatement, reporter: Reporter) -> None:
    """Warn about a function that can end without a value; main returns 0 by itself (ISO C 5.1.2.2.3)."""
    if isinstance(function.result, VoidType) or function.name == "main" or function.naked:
        return
    if _completes(body):
        reporter.warn(
            "c-missing-return",
            f"'{function.name}' can reach its end without returning a value",
            function.place,
        )


def _completes(node: tree.Stmt) -> bool:
    """Return whether the statement after this one can be reached through it."""
    match node:
        case tree.Return() | tree.Jump():
            return False
        case tree.ExprStmt(tree.Builtin(returns=False)):
            return False
        case tree.BlockStatement(body):
            reachable = True
            for statement in body:
                reachable = reachable or _has_label(statement)
                reachable = reachable and _completes(statement)
            return reachable
        case tree.If(_, yes, no):
            return no is None or _completes(yes) or _completes(no)
        case tree.Loop(condition, body):
            return condition is not None or breaks(body)
        case tree.Switch(_, _, default, body):
            return default is None or breaks(body) or _completes(body)
    return True


def _has_label(node: tree.Stmt) -> bool:
    return any(isinstance(inner, (tree.CaseLabel, tree.LabelStmt)) for inner in statements(node))


def breaks(node: tree.Stmt) -> bool:
    """Return whether a `break` in a body ends the loop or switch that it is the body of."""
    match node:
        case tree.Jump("break"):
            return True
        case tree.BlockStatement(body):
            return any(map(breaks, body))
        case tree.If(_, yes, no):
            return breaks(yes) or (no is not None and breaks(no))
    return False


# read before set


@dataclass(slots=True)
class _Uninitialised:
    """Follows a body in the order of the text. `set_` are the variables that some path has set so far, `sure`
    those that every path has set; a loop or switch counts as if its body ran.
    """

    body: tree.BlockStatement
    declared: Sequence[tree.Symbol]
    reporter: Reporter
    set_: set[tree.Symbol] = field(default_factory=set)
    sure: set[tree.Symbol] = field(default_factory=set)
    in_loop: set[tree.Symbol] = field(default_factory=set)
    """What the loops around the present place set, perhaps in an earlier round."""
    conditional: int = 0

    def report(self) -> None:
        """Follow the body; variables whose address is taken may be set elsewhere and are not watched."""
        pointed = {expr.target.symbol for expr in expressions(self.body) if isinstance(expr, tree.AddressOf)}
        self.watched = {
            symbol
            for symbol in self.declared
            if symbol.type.scalar and symbol.kind == "local" and symbol not in pointed and not symbol.volatile
        }
        self.statement(self.body)

    watched: set[tree.Symbol] = field(default_factory=set)

    def statement(self, node: tree.Stmt | None) -> None:
        """Follow a statement, in the order of its evaluation."""
        match node:
            case tree.ExprStmt(expr):
                self.expression(expr)
            case tree.BlockStatement(body):
                for inner in body:
                    self.statement(inner)
            case tree.If(condition, yes, no):
                self.expression(condition)
                ends = not _completes(yes), no is not None and not _completes(no)
                self.branches(lambda: self.statement(yes), lambda: self.statement(no), ends=ends)
            case tree.Loop():
                self.loop(node)
            case tree.Switch(value, _, _, body):
                self.expression(value)
                self.branches(lambda: self.statement(body), lambda: None)
                # whether the cases cover all values is not followed: better no warning than a wrong one
                self.sure |= self.set_
            case tree.Return(value) if value is not None:
                self.expression(value)

    def branches(
        self, one: Callable[[], None], two: Callable[[], None], ends: tuple[bool, bool] = (False, False)
    ) -> None:
        """Follow two alternatives; `ends`: whether what follows is not reached through each."""
        before, sure = set(self.set_), set(self.sure)
        sets, sures = [], []
        self.conditional += 1
        for part in (one, two):
            self.set_, self.sure = set(before), set(sure)
            part()
            sets.append(self.set_)
            sures.append(self.sure)
        self.conditional -= 1
        self.set_ = sets[0] | sets[1]
        through = [path for path, ended in zip(sures, ends, strict=True) if not ended]
        self.sure = set.intersection(*through) if through else set(self.set_)

    def loop(self, node: tree.Loop) -> None:
        """Follow a loop as if its body ran once."""
        outside = set(self.in_loop)
        self.in_loop |= {
            expr.target.symbol
            for part in (node.condition, node.body, node.step)
            for expr in expressions(part)
            if isinstance(expr, (tree.Assign, tree.Update)) and isinstance(expr.target, tree.Ref)
        }
        if node.condition is not None and not node.post:
            self.expression(node.condition)
        self.statement(node.body)
        if node.condition is not None and node.post:
            self.expression(node.condition)
        if node.step is not None:
            self.expression(node.step)
        self.in_loop = outside

    def expression(self, expr: tree.Expr) -> None:
        """Follow an expression, in the order of its evaluation."""
        match expr:
            case tree.Assign(target, value):
                self.expression(value)
                if isinstance(target, tree.Ref):
                    if target.index is not None:
                        self.expression(target.index)
                    self.set(target.symbol)
                else:
                    self.expression(target)
            case tree.Update(_, target, value):
                self.expression(value)
                self.expression(target)
                if isinstance(target, tree.Ref):
                    self.set(target.symbol)
            case tree.Logic(_, left, right):
                self.expression(left)
                self.branches(lambda: self.expression(right), lambda: None)
            case tree.Choice(condition, yes, no):
                self.expression(condition)
                self.branches(lambda: self.expression(yes), lambda: self.expression(no))
            case tree.Ref(symbol, _, index):
                if index is not None:
                    self.expression(index)
                self.read(symbol, expr)
            case tree.Num():
                pass
            case _:
                for name in expr.__dataclass_fields__:
                    part = getattr(expr, name)
                    for operand in part if isinstance(part, list) else [part]:
                        if isinstance(operand, tree.Expr):
                            self.expression(operand)

    def set(self, symbol: tree.Symbol) -> None:
        self.set_.add(symbol)
        self.sure.add(symbol)

    def read(self, symbol: tree.Symbol, expr: tree.Ref) -> None:
        """Warn about a read of a variable that no path, or not every path, has set."""
        if symbol not in self.watched or symbol in self.sure:
            return
        if symbol in self.set_:
            if not self.conditional and symbol not in self.in_loop:
                self.watched.discard(symbol)
                self.reporter.warn(
                    "c-uninitialised",
                    f"'{symbol.name}' is set only if a condition holds, but is read in any case",
                    expr.place,
                )
            return
        if self.conditional and symbol in self.in_loop:
            return  # perhaps an earlier round has set it
        self.watched.discard(symbol)
        self.reporter.warn("c-uninitialised", f"'{symbol.name}' is read before it is set", expr.place)
