"""Loops that count with constants: fewer instructions for the counter.

In: the typed tree of a function. Out: the same tree, in which

    for (i = 0; i < 20; i++) …     counts down to 0 if nothing else uses i
    for (i = 0; i < 8; i++) … i …  tests the bit that only 8 has
    for (int i = 0; i < 20; …      counts and compares the low byte only, since the other stays 0
    for (int i = 0; i < 300; …     counts down two bytes, or compares them without a sign

Nothing changes in loops whose variable the body may change, or that may be entered in the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import U8, U16, IntType
from servogen.compiler.ast.walk import CHILD_FIELDS, nodes

MAX_TRIPS = 256
"""A counter of one byte that begins with 0 reaches 0 again after 256."""

MAX_WIDE_TRIPS = 0xFF00
"""The greatest number for which the high byte of a counter of two bytes, rounded up, is at most 255."""


@dataclass(frozen=True, slots=True)
class _Counting:
    """`before; loop` that counts `variable` from `first` up to, but not including, `end`."""

    before: tree.ExprStmt
    loop: tree.Loop
    variable: tree.Ref
    first: int
    end: int


def simplify_counters(function: tree.FunctionDefinition) -> None:
    """Rewrite the counting loops of a function."""
    if function.body is None or _is_entered_in_the_middle(function.body):
        return
    for block in [node for node in nodes(function.body) if isinstance(node, tree.BlockStatement)]:
        for before, loop in zip(block.body, block.body[1:], strict=False):
            counting = _counting(before, loop)
            if counting is not None and not _may_change(counting):
                _rewrite(function, counting)


def _rewrite(function: tree.FunctionDefinition, counting: _Counting) -> None:
    """Rewrite a counting loop in the shortest of the forms in the module's description that applies."""
    before, loop, variable = counting.before, counting.loop, counting.variable
    low = tree.Ref(variable.symbol, variable.offset, None, U8, variable.place)
    one, place = tree.Num(1, U8, loop.place), loop.place
    trips = counting.end - counting.first
    if trips <= MAX_TRIPS and _is_only_counter(function, counting):
        before.expr = tree.Assign(low, tree.Num(trips % MAX_TRIPS, U8, place), U8, place)
        loop.condition = tree.Update("-", low, one, U8, post=False, type=U8, place=place)
        loop.step, loop.post = None, True
        return
    wide = variable.type.size == U16.size
    if wide and trips <= MAX_WIDE_TRIPS and _is_only_counter(function, counting):
        _count_down_two_bytes(counting, trips)
        return
    if counting.first < 0:
        return
    if counting.end >= MAX_TRIPS:
        if wide:  # unsigned, since it never is negative
            whole = tree.Ref(variable.symbol, variable.offset, None, U16, variable.place)
            loop.condition = tree.Binary("<", whole, tree.Num(counting.end, U16, place), U8, place)
            loop.post = True
        return
    if counting.end.bit_count() == 1:
        test = tree.Binary("&", low, tree.Num(counting.end, U8, place), U8, place)
        loop.condition = tree.Unary("!", test, U8, place)
    else:
        loop.condition = tree.Binary("<", low, tree.Num(counting.end, U8, place), U8, place)
    loop.step = tree.Update("+", low, one, U8, post=False, type=U8, place=place)
    loop.post = True
    if variable.type.size > 1:
        _narrow_reads(loop.body, variable)


def _count_down_two_bytes(counting: _Counting, trips: int) -> None:
    """Count down as `--low || --high` does, with two DECFSZ; the high byte is rounded up."""
    variable, loop = counting.variable, counting.loop
    place = loop.place
    # `--low` is 0 once in 256 turns: the high byte counts these, and the first round may be shorter
    low, high = trips % MAX_TRIPS, -(-trips // MAX_TRIPS)
    whole = tree.Ref(variable.symbol, variable.offset, None, U16, variable.place)
    counting.before.expr = tree.Assign(whole, tree.Num(high * MAX_TRIPS + low, U16, place), U16, place)
    less_low, less_high = (
        tree.Update(
            "-",
            tree.Ref(variable.symbol, variable.offset + byte, None, U8, variable.place),
            tree.Num(1, U8, place),
            U8,
            post=False,
            type=U8,
            place=place,
        )
        for byte in (0, 1)
    )
    loop.condition = tree.Logic("||", less_low, less_high, U8, place)
    loop.step, loop.post = None, True


def _narrow_reads(body: tree.Stmt, variable: tree.Ref) -> None:
    """Replace what reads a wide variable that stays below 256 by its low byte, in the wide type."""

    def narrow(value: object) -> object:
        if isinstance(value, list):
            return [narrow(item) for item in value]
        if not _is_same(value, variable):
            return value
        assert isinstance(value, tree.Ref)
        low = tree.Ref(value.symbol, value.offset, None, U8, value.place)
        return tree.Cast(low, value.type, value.place)

    for node in list(nodes(body)):
        for name in CHILD_FIELDS[node.__class__]:
            value = getattr(node, name)
            if isinstance(value, (tree.Ref, list)):
                setattr(node, name, narrow(value))


def _counting(before: tree.Stmt, loop: tree.Stmt) -> _Counting | None:
    """Return what two statements count, if they are a `for` that counts up by 1 between constants."""
    if not isinstance(loop, tree.Loop) or loop.post or not isinstance(before, tree.ExprStmt):
        return None
    assign, test, step = before.expr, loop.condition, loop.step
    if (
        not isinstance(assign, tree.Assign)
        or not isinstance(assign.value, tree.Num)
        or not isinstance(test, tree.Binary)
    ):
        return None
    variable, first = assign.target, assign.value.value
    if not isinstance(variable, tree.Ref) or not _is_plain(variable) or not isinstance(test.right, tree.Num):
        return None
    if not isinstance(step, tree.Update) or step.op != "+" or not _is_same(step.target, variable):
        return None
    if not isinstance(step.value, tree.Num) or step.value.value != 1 or not _reads(test.left, variable):
        return None
    ends = {"<": test.right.value, "!=": test.right.value, "<=": test.right.value + 1}
    end = ends.get(test.op)
    assert isinstance(variable.type, IntType)
    if end is None or not variable.type.low <= first < end <= variable.type.high:
        return None
    return _Counting(before, loop, variable, first, end)


def _is_plain(variable: tree.Ref) -> bool:
    """Return whether a variable is a whole local one that only this function can reach."""
    symbol = variable.symbol
    whole = variable.offset == 0 and variable.index is None and not variable.width
    private = symbol.kind in ("local", "param") and not symbol.volatile and not symbol.pinned
    integer = isinstance(variable.type, IntType) and not variable.type.is_bool and not variable.type.is_bit
    return whole and private and integer and symbol.type.size == variable.type.size


def _reads(expr: tree.Expr, variable: tree.Ref) -> bool:
    """Return whether an expression is the value of a variable, in the same or a wider type."""
    while (
        isinstance(expr, tree.Cast)
        and isinstance(expr.type, IntType)
        and isinstance(expr.operand.type, IntType)
    ):
        if not (expr.type.low <= expr.operand.type.low and expr.operand.type.high <= expr.type.high):
            return False
        expr = expr.operand
    return _is_same(expr, variable)


def _is_same(expr: object, variable: tree.Ref) -> bool:
    """Return whether an expression names a variable as a whole."""
    return (
        isinstance(expr, tree.Ref)
        and expr.symbol is variable.symbol
        and (expr.offset, expr.index, expr.width) == (0, None, 0)
        and expr.type.size == variable.type.size
    )


def _is_entered_in_the_middle(body: tree.BlockStatement) -> bool:
    """Return whether a `goto`, assembly or a `case` may lead into a loop."""
    below = list(nodes(body))
    if any(isinstance(node, (tree.Asm, tree.LabelStmt)) for node in below):
        return True
    for loop in [node for node in below if isinstance(node, tree.Loop)]:
        inside = list(nodes(loop.body))
        own = {id(label) for node in inside if isinstance(node, tree.Switch) for label in _labels(node)}
        if any(isinstance(node, tree.CaseLabel) and id(node) not in own for node in inside):
            return True
    return False


def _may_change(counting: _Counting) -> bool:
    """Return whether the body may change the variable."""
    symbol = counting.variable.symbol
    return any(
        isinstance(inner, (tree.Assign, tree.Update, tree.AddressOf))
        and getattr(inner.target, "symbol", None) is symbol
        for inner in nodes(counting.loop.body)
    )


def _labels(switch: tree.Switch) -> list[tree.CaseLabel]:
    """Return the labels of a switch, the default's among them."""
    labels = [label for _, label in switch.cases]
    return labels if switch.default is None else [*labels, switch.default]


def _is_only_counter(function: tree.FunctionDefinition, counting: _Counting) -> bool:
    """Return whether a variable is used for nothing but counting in this and in other such loops.

    Each other use must follow an assignment of its own, in a `for` that is not around this one.
    """
    symbol = counting.variable.symbol
    if symbol.kind != "local" or _uses(counting.loop.body, symbol):
        return False
    assert function.body is not None
    own: set[int] = set()
    for block in [node for node in nodes(function.body) if isinstance(node, tree.BlockStatement)]:
        for before, loop in zip(block.body, block.body[1:], strict=False):
            if (
                isinstance(before, tree.ExprStmt)
                and isinstance(loop, tree.Loop)
                and _assigns(before.expr, symbol)
            ):
                if loop is not counting.loop and any(node is counting.loop for node in nodes(loop)):
                    return False
                own |= _uses(before, symbol) | _uses(loop, symbol)
    return _uses(function.body, symbol) <= own


def _assigns(expr: tree.Expr, symbol: tree.Symbol) -> bool:
    """Return whether an expression is an assignment of the whole variable, by a constant."""
    return (
        isinstance(expr, tree.Assign)
        and isinstance(expr.target, tree.Ref)
        and expr.target.symbol is symbol
        and expr.target.index is None
        and isinstance(expr.value, tree.Num)
    )


def _uses(node: object, symbol: tree.Symbol) -> set[int]:
    """Return the identities of the nodes below a node that name a variable."""
    return {id(ref) for ref in nodes(node) if isinstance(ref, tree.Ref) and ref.symbol is symbol}
