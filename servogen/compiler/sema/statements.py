"""Semantic analysis of function bodies: blocks, statements, unreachable code, inline assembly.

In: pycparser nodes. Out: blocks and statements of the typed tree.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

from pycparser import c_ast

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import interval
from servogen.compiler.ast.types import BIT, U8, IntType, VoidType, promote
from servogen.compiler.diagnostics import Fatal, is_own_file
from servogen.compiler.frontend.assembly import MARKER
from servogen.compiler.frontend.extensions import CRITICAL_LABEL
from servogen.compiler.sema.analyser import Analyser, Body
from servogen.compiler.sema.builtins import chip_bit, register_ref, set_bit
from servogen.compiler.sema.call_graph import has_assembly
from servogen.compiler.sema.condition_checks import check_conditions
from servogen.compiler.sema.conversions import convert, promoted, truth
from servogen.compiler.sema.declarations import declare
from servogen.compiler.sema.expressions import condition_operand
from servogen.compiler.sema.flow import breaks, check_flow
from servogen.compiler.sema.lint import check_syntax, used_names
from servogen.compiler.sema.names import constant, expression, value_of, warn_unused
from servogen.compiler.sema.scopes import Lost
from servogen.errors import Location, did_you_mean


def define_function(analyser: Analyser, function: tree.FunctionDefinition, node: Any) -> None:
    """Analyse the body of a function."""
    analyser.function = function
    analyser.body = Body()
    errors = analyser.reporter.errors
    analyser.declared_locals = []
    block = tree.BlockStatement([])
    with analyser.scopes.block():
        for symbol in function.parameters:
            analyser.scopes.here.names[symbol.name] = symbol
            analyser.asm_symbols[symbol.asm_name] = symbol
        items(analyser, node.body.block_items or [], block.body)
    for label, where in analyser.body.gotos:
        if label not in analyser.body.labels:
            hint = did_you_mean(label, analyser.body.labels) if analyser.body.labels else None
            analyser.reporter.error(
                "c-jump", f"there is no label '{label}' in '{function.name}'", analyser.place(where), hint
            )
    unused = set(analyser.body.labels) - {label for label, _ in analyser.body.gotos}
    labels = {label: analyser.body.labels[label] for label in unused}
    function.body = block
    analyser.function = None
    # after an error the tree is incomplete, and warnings about it would mislead
    if not is_own_file(function.place) and errors == analyser.reporter.errors:
        check_syntax(analyser, node)
        check_conditions(analyser, node)
        check_flow(function, analyser.declared_locals, used_names(node.body), analyser.reporter)
        _unused_labels(analyser, labels, function)


def _unused_labels(
    analyser: Analyser, labels: dict[str, Location], function: tree.FunctionDefinition
) -> None:
    """Warn about labels that no `goto` names; assembly may jump to one."""
    if function.body is not None and not has_assembly(function.body):
        for label, place in labels.items():
            analyser.reporter.warn("c-unused", f"nothing jumps to '{label}'", place)


def items(analyser: Analyser, nodes: list[Any], out: list[tree.Stmt]) -> None:
    """Analyse block items; an error in one does not suppress those of the next."""
    ended = False
    for node in nodes:
        # a `break` after a `return` is habit, not a mistake
        habit = isinstance(node, (c_ast.Break, c_ast.EmptyStatement, c_ast.Return))
        if ended and not habit and not _can_be_reached(node):
            analyser.reporter.warn("c-unreachable", "this is never reached", analyser.place(node))
        before = len(out)
        try:
            item(analyser, node, out)
        except Fatal:
            analyser.pending.clear()
        ended = len(out) > before and _leaves(out[-1])


def item(analyser: Analyser, node: Any, out: list[tree.Stmt]) -> None:
    """Analyse a declaration or a statement of a block."""
    if isinstance(node, (c_ast.Decl, c_ast.Typedef)):
        try:
            declare(analyser, node)
        except Fatal:
            if node.name:
                analyser.scopes.here.names.setdefault(node.name, Lost())
            raise
        out += analyser.pending
        analyser.pending = []
    else:
        out.append(statement(analyser, node))


def statement(analyser: Analyser, node: Any) -> tree.Stmt:
    """Return the typed form of a statement."""
    handler = _STATEMENTS.get(type(node))
    if handler is not None:
        return handler(analyser, node)
    if isinstance(node, c_ast.FuncCall) and isinstance(node.name, c_ast.ID) and node.name.name == MARKER:
        return asm_statement(analyser, int(node.args.exprs[0].value), analyser.place(node))
    expr = effect_of(analyser, node)
    return tree.ExprStmt(expr)


def asm_statement(analyser: Analyser, number: int, place: Location) -> tree.Asm:
    """Return a block of assembly with the variables and functions that it may name."""
    block = analyser.asm_blocks[number]
    lines = [(Location(block.file, line), text) for line, text in block.lines]
    names: dict[str, Any] = {}
    if analyser.function is not None:
        for scope in analyser.scopes.stack[1:]:
            names.update(
                {f"_{name}": meaning for name, meaning in scope.names.items() if hasattr(meaning, "asm_name")}
            )
    return tree.Asm(lines, names, list(_asm_calls(analyser, lines)), place)


def _asm_calls(analyser: Analyser, lines: list[tuple[Location, str]]) -> Iterator[tree.Call]:
    """Yield the C functions that lines of assembly call as `_name`."""
    for place, text in lines:
        match = re.match(r"(?i)(?:.*:)?\s*l?call\s+_(\w+)\s*(?:;|//|$)", text)
        called = analyser.scopes.find(match[1]) if match else None
        if isinstance(called, tree.FunctionDefinition):
            analyser.called.add(called.name)
            yield tree.Call(called.name, [], called.result, place)


def effect_of(analyser: Analyser, node: Any) -> tree.Expr:
    """Return an expression that is evaluated for its effect."""
    if isinstance(node, c_ast.UnaryOp) and node.op in ("p++", "p--"):
        return _step_alone(analyser, node)
    expr = value_of(analyser, expression(analyser, node))
    warn_unused(analyser, expr)
    return expr


def _step_alone(analyser: Analyser, node: Any) -> tree.Expr:
    """Return `x++` or `x--` whose value is not used: no value from before need be kept."""
    update = expression(analyser, c_ast.UnaryOp(node.op[1:], node.expr, node.coord))
    if isinstance(update, tree.Update):
        update.post = True
    return value_of(analyser, update)


def checked_condition(analyser: Analyser, node: Any) -> tree.Expr:
    """Return the condition of an `if` or loop; warns about an assignment that is not in parentheses."""
    meant = id(node) in analyser.parenthesised
    if isinstance(node, c_ast.Assignment) and node.op == "=" and not meant:
        analyser.reporter.warn(
            "c-assignment-condition",
            "an assignment is used as a condition",
            analyser.place(node),
            hint="'==' compares; write '((a = b))' if the assignment is meant",
        )
    return truth(analyser, condition_operand(analyser, node))


def nested(analyser: Analyser, node: Any) -> tree.Stmt:
    """Return the body of an `if` or loop as one statement."""
    out: list[tree.Stmt] = []
    items(analyser, [node], out)
    return out[0] if out else tree.BlockStatement([])


def _leaves(statement: tree.Stmt) -> bool:
    """Return whether the code after a statement can only be reached through a label."""
    match statement:
        case tree.Return() | tree.Jump():
            return True
        case tree.BlockStatement(body):
            return bool(body) and _leaves(body[-1])
        case tree.If(_, yes, no):
            return no is not None and _leaves(yes) and _leaves(no)
        case tree.Loop(None, body):
            return not breaks(body)
    return False


def _can_be_reached(node: Any) -> bool:
    """Return whether a node is a label, a case, a declaration, or a block that contains a label."""
    if isinstance(node, (c_ast.Label, c_ast.Case, c_ast.Default, c_ast.Decl, c_ast.Typedef)):
        return True
    return any(_can_be_reached(child) for child in node if not isinstance(child, c_ast.Decl))


def _stmt_compound(analyser: Analyser, node: Any) -> tree.Stmt:
    """Analyse a block, which is a scope (ISO C 6.8.2)."""
    block = tree.BlockStatement([])
    with analyser.scopes.block():
        items(analyser, node.block_items or [], block.body)
    return block


def _stmt_empty_statement(analyser: Analyser, node: Any) -> tree.Stmt:
    return tree.BlockStatement([])


def _stmt_if(analyser: Analyser, node: Any) -> tree.Stmt:
    """Analyse an `if` (ISO C 6.8.4.1)."""
    condition = checked_condition(analyser, node.cond)
    return tree.If(
        condition,
        nested(analyser, node.iftrue),
        nested(analyser, node.iffalse) if node.iffalse else None,
        analyser.place(node),
    )


def _loop(
    analyser: Analyser, node: Any, condition: tree.Expr | None, step: tree.Expr | None, post: bool
) -> tree.Stmt:
    """Return a loop; a condition that is a constant other than 0 is dropped."""
    kind = {c_ast.While: "while", c_ast.For: "for"}.get(type(node), "do")
    analyser.body.loops += 1
    analyser.body.breakable += 1
    inside = nested(analyser, node.stmt)
    analyser.body.loops -= 1
    analyser.body.breakable -= 1
    if isinstance(condition, tree.Num) and condition.value:
        condition = None
    return tree.Loop(condition, inside, step, post, analyser.place(node), kind)


def _stmt_while(analyser: Analyser, node: Any) -> tree.Stmt:
    return _loop(analyser, node, checked_condition(analyser, node.cond), None, False)


def _stmt_do_while(analyser: Analyser, node: Any) -> tree.Stmt:
    return _loop(analyser, node, checked_condition(analyser, node.cond), None, True)


def _stmt_for(analyser: Analyser, node: Any) -> tree.Stmt:
    """Analyse a `for`; what its first part declares is in a scope around the loop (ISO C 6.8.5)."""
    out: list[tree.Stmt] = []
    with analyser.scopes.block():
        if isinstance(node.init, c_ast.DeclList):
            for decl in node.init.decls:
                item(analyser, decl, out)
        elif node.init is not None:
            out.append(tree.ExprStmt(effect_of(analyser, node.init)))
        condition = checked_condition(analyser, node.cond) if node.cond is not None else None
        step = effect_of(analyser, node.next) if node.next is not None else None
        out.append(_loop(analyser, node, condition, step, False))
    return tree.BlockStatement(out)


def _stmt_switch(analyser: Analyser, node: Any) -> tree.Stmt:
    """Analyse a `switch`; the cases in its body add themselves (ISO C 6.8.4.2)."""
    value = promoted(analyser, expression(analyser, node.cond))
    assert isinstance(value.type, IntType)
    switch = tree.Switch(value, [], None, tree.BlockStatement([]), analyser.place(node))
    analyser.body.switches.append((switch, promote(value.type, c2c=analyser.c2c)))
    analyser.body.breakable += 1
    if isinstance(node.stmt, c_ast.Compound):
        first = next(iter(node.stmt.block_items or []), None)
        if first is not None and not _can_be_reached(first):
            analyser.reporter.warn(
                "c-unreachable",
                "this is never reached: it stands before the first case",
                analyser.place(first),
            )
        switch.body = _stmt_compound(analyser, node.stmt)
    else:
        switch.body = nested(analyser, node.stmt)
    analyser.body.breakable -= 1
    analyser.body.switches.pop()
    return switch


def _stmt_case(analyser: Analyser, node: Any) -> tree.Stmt:
    """Analyse a `case`, whose constant is converted to the type of the switch (ISO C 6.8.4.2)."""
    if not analyser.body.switches:
        raise analyser.fail("c-jump", "'case' outside a switch", node)
    switch, kind = analyser.body.switches[-1]
    number = constant(analyser, node.expr, "a case")
    value = kind.wrap(number)
    low, high = interval(switch.value)
    if not isinstance(switch.value, tree.Num) and not low <= number <= high:
        analyser.reporter.warn(
            "c-case-range",
            f"the case {number} is never reached: the value lies in {low} … {high}",
            analyser.place(node),
        )
    if any(value == known for known, _ in switch.cases):
        raise analyser.fail("c-jump", f"duplicate case {value}", node)
    label = tree.CaseLabel(analyser.place(node))
    switch.cases.append((value, label))
    return _labelled(analyser, label, node.stmts)


def _stmt_default(analyser: Analyser, node: Any) -> tree.Stmt:
    """Analyse a `default` (ISO C 6.8.4.2)."""
    if not analyser.body.switches:
        raise analyser.fail("c-jump", "'default' outside a switch", node)
    switch, _ = analyser.body.switches[-1]
    if switch.default is not None:
        raise analyser.fail("c-jump", "duplicate 'default'", node)
    switch.default = tree.CaseLabel(analyser.place(node))
    return _labelled(analyser, switch.default, node.stmts)


def _labelled(analyser: Analyser, label: tree.CaseLabel | tree.LabelStmt, nodes: list[Any]) -> tree.Stmt:
    block = tree.BlockStatement([label])
    items(analyser, nodes or [], block.body)
    return block


def _stmt_critical(analyser: Analyser, node: Any) -> tree.Stmt:
    """Analyse a block in which no interrupt comes. GIE is cleared until it reads 0, because an interrupt that
    comes during the BCF sets it again when it returns.
    """
    place = analyser.place(node)
    before = analyser.new_local("intcon", U8, place)
    # a jump out of the block would leave interrupts disabled
    outer = analyser.body.loops, analyser.body.breakable
    analyser.body.loops = analyser.body.breakable = 0
    analyser.body.critical.append(before)
    gie = chip_bit(analyser, "GIE", place)
    out: list[tree.Stmt] = [
        tree.ExprStmt(
            tree.Assign(
                tree.Ref(before, 0, None, U8, place), register_ref(analyser, "INTCON", place), U8, place
            )
        ),
        tree.Loop(gie, tree.ExprStmt(set_bit(gie, 0)), None, True, place, "do"),
        nested(analyser, node.stmt),
        _allow_again(analyser, before, place),
    ]
    analyser.body.critical.pop()
    analyser.body.loops, analyser.body.breakable = outer
    return tree.BlockStatement(out)


def _allow_again(analyser: Analyser, before: tree.Symbol, place: Location) -> tree.Stmt:
    """Return the statement that allows interrupts again if they were allowed before a critical block."""
    was = tree.Ref(before, 0, None, BIT, place, 7, 1)
    return tree.If(was, tree.ExprStmt(set_bit(chip_bit(analyser, "GIE", place), 1)), None, place)


def _stmt_label(analyser: Analyser, node: Any) -> tree.Stmt:
    """Analyse a label, or the critical block that a generated one stands for."""
    if node.name.startswith(CRITICAL_LABEL):
        return _stmt_critical(analyser, node)
    if node.name in analyser.body.labels:
        raise analyser.fail("c-jump", f"duplicate label '{node.name}'", node)
    analyser.body.labels[node.name] = analyser.place(node)
    return _labelled(analyser, tree.LabelStmt(node.name, analyser.place(node)), [node.stmt])


def _no_way_out(analyser: Analyser, word: str, enclosing: str, node: Any) -> Fatal:
    """Report a jump out of what does not enclose it; the caller raises the exception that is returned."""
    inside = (
        f" in a critical block cannot leave {enclosing} around it"
        if analyser.body.critical
        else f" outside {enclosing}"
    )
    return analyser.fail("c-jump", f"'{word}'{inside}", node)


def _stmt_break(analyser: Analyser, node: Any) -> tree.Stmt:
    if not analyser.body.breakable:
        raise _no_way_out(analyser, "break", "a loop or switch", node)
    return tree.Jump("break", "", analyser.place(node))


def _stmt_continue(analyser: Analyser, node: Any) -> tree.Stmt:
    if not analyser.body.loops:
        raise _no_way_out(analyser, "continue", "a loop", node)
    return tree.Jump("continue", "", analyser.place(node))


def _stmt_goto(analyser: Analyser, node: Any) -> tree.Stmt:
    if analyser.body.critical:
        raise analyser.fail("c-jump", "'goto' in a critical block is not supported", node)
    analyser.body.gotos.append((node.name, node))
    return tree.Jump("goto", node.name, analyser.place(node))


def _stmt_return(analyser: Analyser, node: Any) -> tree.Stmt:
    """Analyse a `return`, whose value is converted to the function's result type (ISO C 6.8.6.4)."""
    assert analyser.function is not None
    result = analyser.function.result
    place = analyser.place(node)
    if node.expr is None:
        if not isinstance(result, VoidType) and analyser.function.name != "main":
            analyser.reporter.warn("c-return", f"'{analyser.function.name}' should return '{result}'", place)
        return _leaving(analyser, None, place)
    expr = expression(analyser, node.expr)
    if isinstance(result, VoidType):
        if isinstance(expr.type, VoidType):
            return tree.Return(expr, place)
        raise analyser.fail(
            "c-return", f"'{analyser.function.name}' returns void and cannot return a value", node
        )
    value = convert(analyser, expr, result, "the result")
    if isinstance(value, tree.AddressOf) and value.target.symbol.kind in ("local", "param"):
        analyser.reporter.warn(
            "c-local-address",
            f"'{value.target.symbol.name}' no longer exists after '{analyser.function.name}' returns",
            place,
            hint="declare it static",
        )
    return _leaving(analyser, value, place)


def _leaving(analyser: Analyser, value: tree.Expr | None, place: Location) -> tree.Stmt:
    """Return a return statement; one in a critical block allows interrupts again once the value is
    computed.
    """
    if not analyser.body.critical:
        return tree.Return(value, place)
    allow = _allow_again(analyser, analyser.body.critical[0], place)
    if value is None or isinstance(value, tree.Num):
        return tree.BlockStatement([allow, tree.Return(value, place)])
    symbol = analyser.new_local("result", value.type, place)
    target = tree.Ref(symbol, 0, None, value.type, place)
    return tree.BlockStatement(
        [tree.ExprStmt(tree.Assign(target, value, value.type, place)), allow, tree.Return(target, place)]
    )


def _stmt_pragma(analyser: Analyser, node: Any) -> tree.Stmt:
    return tree.BlockStatement([])


def _stmt_static_assert(analyser: Analyser, node: Any) -> tree.Stmt:
    static_assertion(analyser, node)
    return tree.BlockStatement([])


def static_assertion(analyser: Analyser, node: Any) -> None:
    """Check a `_Static_assert`, inside or outside a function."""
    if not constant(analyser, node.cond, "a static assertion"):
        raise analyser.fail("c-user-message", "static assertion failed", node.cond)


_STATEMENTS: dict[type, Callable[[Analyser, Any], tree.Stmt]] = {
    c_ast.Break: _stmt_break,
    c_ast.Case: _stmt_case,
    c_ast.Compound: _stmt_compound,
    c_ast.Continue: _stmt_continue,
    c_ast.Default: _stmt_default,
    c_ast.DoWhile: _stmt_do_while,
    c_ast.EmptyStatement: _stmt_empty_statement,
    c_ast.For: _stmt_for,
    c_ast.Goto: _stmt_goto,
    c_ast.If: _stmt_if,
    c_ast.Label: _stmt_label,
    c_ast.Pragma: _stmt_pragma,
    c_ast.Return: _stmt_return,
    c_ast.StaticAssert: _stmt_static_assert,
    c_ast.Switch: _stmt_switch,
    c_ast.While: _stmt_while,
}
