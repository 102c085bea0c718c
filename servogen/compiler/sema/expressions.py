"""Semantic analysis of operators: pycparser nodes to the typed tree.

In: an expression node and the names in scope. Out: a typed expression with every conversion explicit and
constants folded; errors and warnings to the reporter.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pycparser import c_ast

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import COMPARISONS, compare, has_effect, interval
from servogen.compiler.ast.types import (
    U8,
    U16,
    VOID,
    CType,
    FloatType,
    IntType,
    PointerType,
    VoidType,
    common,
    promote,
    same,
)
from servogen.compiler.sema.accessors import Accessor, evaluated_once, load, store
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.conversions import (
    NUMBERS,
    address_int,
    arithmetic,
    balance,
    cast,
    convert,
    decay,
    keep_const,
    promoted,
    rvalue,
    truth,
)
from servogen.compiler.sema.floats import OPERATORS, float_operator, negated
from servogen.compiler.sema.floats import one as one_of_float
from servogen.compiler.sema.lvalues import (
    address_of,
    assignable,
    binary,
    dereference,
    pointer_plus,
    scaled,
    sizeof,
)
from servogen.compiler.sema.names import expression, named
from servogen.errors import Location


def unary_op(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse a unary operator (ISO C 6.5.3)."""
    op, place = node.op, analyser.place(node)
    if op == "sizeof":
        return sizeof(analyser, node)
    if op in ("++", "--", "p++", "p--"):
        return _step(analyser, node)
    if op == "&":
        return address_of(analyser, node)
    operand = condition_operand(analyser, node.expr) if op == "!" else expression(analyser, node.expr)
    if op == "*":
        return dereference(analyser, operand, node)
    if op == "!":
        operand = truth(analyser, operand)
        if isinstance(operand, tree.Num):
            return analyser.number(int(not operand.value), analyser.int_type, place)
        return tree.Unary("!", operand, analyser.int_type, place)
    operand = rvalue(analyser, operand)
    if isinstance(operand.type, FloatType) and op in "+-":
        return negated(operand, place) if op == "-" else operand
    operand = promoted(analyser, operand)
    assert isinstance(operand.type, IntType)
    if op == "+":
        return operand
    if isinstance(operand, tree.Num):
        value = -operand.value if op == "-" else ~operand.value
        return analyser.number(value, operand.type, place)
    return tree.Unary(op, operand, operand.type, place)


def condition_operand(analyser: Analyser, node: Any) -> tree.Expr:
    """Return the operand of a condition; in C2C, a bare bit name means the bit here."""
    return named(analyser, node, as_bit=True) if isinstance(node, c_ast.ID) else expression(analyser, node)


def _step(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse `++` or `--`, before or after its operand (ISO C 6.5.2.4, 6.5.3.1)."""
    target = assignable(analyser, _target(analyser, node.expr), node)
    op = "+" if "+" in node.op else "-"
    post = node.op.startswith("p")
    place = analyser.place(node)
    if isinstance(target.type, FloatType):
        return _float_update(analyser, target, op, one_of_float(analyser, place), node, post=post)
    one = tree.Num(1, U8, place)
    if isinstance(target, (tree.WideField, tree.EepromObject)):
        return _computed(analyser, target, op, one, node, post=post)
    if isinstance(target.type, PointerType):
        one = tree.Num(target.type.target.size, U8, place)
        return tree.Update(op, target, one, address_int(target.type), post, target.type.plain(), place)
    if not isinstance(target.type, IntType):
        raise analyser.fail("c-type", f"'{node.op.lstrip('p')}' cannot be applied to '{target.type}'", node)
    return tree.Update(
        op, target, one, promote(target.type, c2c=analyser.c2c), post, target.type.plain(), place
    )


def _target(analyser: Analyser, node: Any) -> tree.Expr:
    return named(analyser, node, as_bit=True) if isinstance(node, c_ast.ID) else expression(analyser, node)


def binary_op(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse a binary operator (ISO C 6.5.5 to 6.5.14)."""
    op, place = node.op, analyser.place(node)
    if op in ("&&", "||"):
        left, right = (
            truth(analyser, condition_operand(analyser, node.left)),
            truth(analyser, condition_operand(analyser, node.right)),
        )
        return _logic(analyser, op, left, right, place)
    left, right = (
        rvalue(analyser, expression(analyser, node.left)),
        rvalue(analyser, expression(analyser, node.right)),
    )
    if isinstance(left.type, PointerType) or isinstance(right.type, PointerType):
        return _pointer_operator(analyser, op, left, right, node)
    if is_float_operator(op, left, right):
        return _float_binary(analyser, op, left, right, place)
    # the result has the type of the left operand, whatever the count's is (ISO C 6.5.7)
    if op in ("<<", ">>"):
        left, right = promoted(analyser, left), promoted(analyser, right)
        assert isinstance(left.type, IntType)
        if isinstance(right, tree.Num) and not 0 <= right.value < 8 * left.type.size:
            analyser.reporter.warn(
                "c-shift",
                f"shift by {right.value}, but '{left.type}' has only {8 * left.type.size} bits",
                place,
            )
        return binary(analyser, op, left, right, left.type, place)
    if op in COMPARISONS:
        _signs(analyser, left, right, place)
    left, right, kind = balance(analyser, left, right)
    if op in COMPARISONS:
        return _comparison(analyser, op, left, right, place)
    return binary(analyser, op, left, right, kind, place)


def is_float_operator(op: str, left: tree.Expr, right: tree.Expr) -> bool:
    """Return whether an operator computes with floating-point values; those for integers alone do not."""
    numbers = isinstance(left.type, NUMBERS) and isinstance(right.type, NUMBERS)
    floats = isinstance(left.type, FloatType) or isinstance(right.type, FloatType)
    return numbers and floats and (op in OPERATORS or op in COMPARISONS)


def _float_binary(
    analyser: Analyser, op: str, left: tree.Expr, right: tree.Expr, place: Location
) -> tree.Expr:
    kind = analyser.float_type
    return float_operator(analyser, op, cast(analyser, left, kind), cast(analyser, right, kind), place)


def _float_update(
    analyser: Analyser,
    target: tree.Ref | tree.Deref | Accessor,
    op: str,
    value: tree.Expr,
    node: Any,
    *,
    post: bool = False,
) -> tree.Expr:
    """Return `target op= value` where one of them is a floating-point value; with `post` it has the value
    from before.
    """
    place, kind = analyser.place(node), target.type.plain()
    before: list[tree.Expr] = []
    if isinstance(target, (tree.WideField, tree.EepromObject)):
        evaluated_once(analyser, target)
    else:
        target = _settled(analyser, target, before)
    now = rvalue(analyser, target)
    if post:
        previous = _in_temporary(analyser, now, before)
        now = previous
    result = cast(analyser, _float_binary(analyser, op, now, value, place), kind)
    if isinstance(target, (tree.WideField, tree.EepromObject)):
        update = store(analyser, target, result)
    else:
        update = tree.Assign(target, result, kind, place)
    return _in_order([*before, update, previous] if post else [*before, update])


def _in_temporary(analyser: Analyser, value: tree.Expr, before: list[tree.Expr]) -> tree.Ref:
    """Return a new variable, and add the assignment of a value to it to `before`."""
    if analyser.function is None:
        raise analyser.fail("c-not-constant", "the initialiser must be a constant", value)
    symbol = analyser.new_local("held", value.type.plain(), value.place)
    temporary = tree.Ref(symbol, 0, None, symbol.type, value.place)
    before.append(tree.Assign(temporary, value, symbol.type, value.place))
    return temporary


def _settled(
    analyser: Analyser, target: tree.Ref | tree.Deref, before: list[tree.Expr]
) -> tree.Ref | tree.Deref:
    """Return an object whose place is computed once, however often it is used; what computes it goes to
    `before`.
    """
    place_of_object = target.pointer if isinstance(target, tree.Deref) else target.index
    if place_of_object is None or not has_effect(place_of_object):
        return target
    temporary = _in_temporary(analyser, place_of_object, before)
    if isinstance(target, tree.Deref):
        return replace(target, pointer=temporary)
    return replace(target, index=temporary)


def _signs(analyser: Analyser, left: tree.Expr, right: tree.Expr, place: Location) -> None:
    """Warn about a comparison that takes a negative number for a large positive one. C2C's `int` is unsigned
    by itself.
    """
    left, right = promoted(analyser, left), promoted(analyser, right)
    assert isinstance(left.type, IntType) and isinstance(right.type, IntType)
    if analyser.c2c or common(left.type, right.type, c2c=False).signed:
        return
    for side in (left, right):
        assert isinstance(side.type, IntType)
        if side.type.signed and not isinstance(side, tree.Num) and interval(side)[0] < 0:
            analyser.reporter.warn(
                "c-sign-compare",
                "this compares a signed and an unsigned number: a negative one counts as large and positive",
                place,
                hint="declare both in the same way, or cast one",
            )


def _logic(analyser: Analyser, op: str, left: tree.Expr, right: tree.Expr, place: Location) -> tree.Expr:
    """Return `&&` or `||`, folded where the left operand decides it."""
    # a constant left operand decides, and the right one is not evaluated (ISO C 6.5.13, 6.5.14)
    if isinstance(left, tree.Num):
        decided = bool(left.value) == (op == "||")
        if decided:
            return analyser.number(int(op == "||"), analyser.int_type, place)
        if isinstance(right, tree.Num):
            return analyser.number(int(bool(right.value)), analyser.int_type, place)
    return tree.Logic(op, left, right, analyser.int_type, place)


def _comparison(analyser: Analyser, op: str, left: tree.Expr, right: tree.Expr, place: Location) -> tree.Expr:
    """Return a comparison; one that the ranges of its operands decide is folded, with a warning."""
    if isinstance(left, tree.Num) and isinstance(right, tree.Num):
        return analyser.number(int(compare(op, left.value, right.value)), analyser.int_type, place)
    (low, high), (right_low, right_high) = interval(left), interval(right)
    always: bool | None = None
    if op in ("<", ">="):
        always = True if high < right_low else False if low >= right_high else None
        always = always if op == "<" or always is None else not always
    elif op in (">", "<="):
        always = True if low > right_high else False if high <= right_low else None
        always = always if op == ">" or always is None else not always
    elif high < right_low or low > right_high:
        always = op == "!="
    if always is not None:
        analyser.reporter.warn(
            "c-comparison",
            f"this comparison is always {'true' if always else 'false'}",
            place,
            hint=f"the left side is {low} … {high}, the right side {right_low} … {right_high}",
        )
        if not has_effect(left) and not has_effect(right):
            return analyser.number(int(always), analyser.int_type, place)
    return tree.Binary(op, left, right, analyser.int_type, place)


def _pointer_operator(analyser: Analyser, op: str, left: tree.Expr, right: tree.Expr, node: Any) -> tree.Expr:
    """Return pointer arithmetic or a comparison of pointers (ISO C 6.5.6, 6.5.8)."""
    place = analyser.place(node)
    if op in COMPARISONS:
        # a pointer into RAM converts to one that may lead to flash as well, but not back
        kind = left.type if isinstance(left.type, PointerType) else right.type
        if isinstance(left.type, PointerType) and isinstance(right.type, PointerType):
            kind = left.type if left.type.size >= right.type.size else right.type
        return tree.Binary(
            op, cast(analyser, left, kind), cast(analyser, right, kind), analyser.int_type, place
        )
    if op == "+" and isinstance(right.type, PointerType) and isinstance(left.type, IntType):
        left, right = right, left
    if op in "+-" and isinstance(left.type, PointerType) and isinstance(right.type, IntType):
        return pointer_plus(analyser, left, right, op)
    if op == "-" and isinstance(left.type, PointerType) and isinstance(right.type, PointerType):
        # the distance of two pointers is signed and counts elements (ISO C 6.5.6)
        signed = analyser.types["int16_t"]
        assert isinstance(signed, IntType)
        work = U8 if left.type.size == right.type.size == 1 else U16
        one, two = (
            cast(analyser, cast(analyser, left, work), signed),
            cast(analyser, cast(analyser, right, work), signed),
        )
        difference = binary(analyser, "-", one, two, signed, place)
        return binary(
            analyser, "/", difference, tree.Num(left.type.target.size, signed, place), signed, place
        )
    raise analyser.fail("c-type", f"'{op}' cannot be applied to '{left.type}' and '{right.type}'", node)


def _warn_field(analyser: Analyser, target: tree.Ref | tree.Deref | Accessor, value: tree.Expr) -> None:
    """Warn about a constant that a bit-field does not hold."""
    width = 0 if isinstance(target, tree.EepromObject) else target.width
    kind = target.type
    if not width or not isinstance(value, tree.Num) or not isinstance(kind, IntType) or kind.is_bool:
        return
    low, high = (-(1 << width - 1), (1 << width) - 1)
    if not low <= value.value <= high:
        analyser.reporter.warn(
            "c-conversion", f"{value.value} does not fit a bit-field of {width} bits", value.place
        )


def _computed(
    analyser: Analyser, target: Accessor, op: str, value: tree.Expr, node: Any, *, post: bool = False
) -> tree.Expr:
    """Return `target op= value` for an object that is read and stored by expressions; with `post` it has the
    value from before.
    """
    evaluated_once(analyser, target)
    before: list[tree.Expr] = []
    now = load(analyser, target)
    if post:
        now = _in_temporary(analyser, now, before)
    if isinstance(target.type, PointerType):
        result = _pointer_operator(analyser, op, now, value, node)
    else:
        result = binary_of(analyser, op, now, value, analyser.place(node))
    update = store(analyser, target, cast(analyser, result, target.type))
    return _in_order([*before, update, now]) if post else update


def _in_order(steps: list[tree.Expr]) -> tree.Expr:
    """Return expressions evaluated one after the other, with the value of the last."""
    *earlier, value = steps
    for step in reversed(earlier):
        value = tree.Comma(step, value, value.type.plain(), value.place)
    return value


def binary_of(analyser: Analyser, op: str, left: tree.Expr, right: tree.Expr, place: Location) -> tree.Expr:
    """Return the value of an arithmetic operator on integers."""
    if op in ("<<", ">>"):
        left, right = promoted(analyser, left), promoted(analyser, right)
        return binary(analyser, op, left, right, left.type, place)
    left, right, kind = balance(analyser, left, right)
    return binary(analyser, op, left, right, kind, place)


def ternary_op(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse the conditional operator (ISO C 6.5.15)."""
    condition = truth(analyser, condition_operand(analyser, node.cond))
    yes, no = (
        decay(analyser, expression(analyser, node.iftrue)),
        decay(analyser, expression(analyser, node.iffalse)),
    )
    place = analyser.place(node)
    if isinstance(yes.type, VoidType) and isinstance(no.type, VoidType):
        return tree.Choice(condition, yes, no, VOID, place)
    if isinstance(yes.type, IntType) and isinstance(no.type, IntType):
        kind: CType = common(yes.type, no.type, c2c=analyser.c2c)
    elif isinstance(yes.type, NUMBERS) and isinstance(no.type, NUMBERS):
        kind = analyser.float_type
    elif isinstance(yes.type, PointerType):
        kind = yes.type if yes.type.size >= no.type.size or not isinstance(no.type, PointerType) else no.type
    elif isinstance(no.type, PointerType):
        kind = no.type
    elif same(yes.type, no.type):
        kind = yes.type
    else:
        raise analyser.fail(
            "c-type", f"the two values of '?:' have the types '{yes.type}' and '{no.type}'", node
        )
    yes, no = convert(analyser, yes, kind, "the first value"), convert(analyser, no, kind, "the second value")
    # both operands determine the type, even where one is never chosen (ISO C 6.5.15)
    if isinstance(condition, tree.Num):
        return yes if condition.value else no
    return tree.Choice(condition, yes, no, kind.plain(), place)


def assignment(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse an assignment, simple or compound (ISO C 6.5.16)."""
    target = assignable(analyser, _target(analyser, node.lvalue), node)
    place = analyser.place(node)
    kind = target.type.plain()
    if node.op == "=":
        value = convert(analyser, expression(analyser, node.rvalue), kind, "the assignment")
        _warn_field(analyser, target, value)
        if isinstance(target, tree.Ref) and isinstance(value, tree.Ref) and _same_variable(target, value):
            analyser.reporter.warn("c-no-effect", f"'{target.symbol.name}' is assigned to itself", place)
        if isinstance(target, (tree.WideField, tree.EepromObject)):
            return store(analyser, target, value)
        return tree.Assign(target, value, kind, place)
    op = node.op[:-1]
    value = rvalue(analyser, expression(analyser, node.rvalue))
    if isinstance(kind, NUMBERS) and is_float_operator(op, target, value):
        return _float_update(analyser, target, op, value, node)
    if isinstance(kind, FloatType):
        raise analyser.fail("c-type", f"'{node.op}' cannot be applied to '{kind}'", node)
    value = arithmetic(analyser, value)
    if isinstance(target, (tree.WideField, tree.EepromObject)):
        return _computed(analyser, target, op, value, node)
    if isinstance(kind, PointerType):
        if op not in "+-":
            raise analyser.fail("c-type", f"'{node.op}' cannot be applied to a pointer", node)
        step = scaled(analyser, value, kind.target.size, address_int(kind))
        return tree.Update(op, target, step, address_int(kind), False, kind, place)
    if not isinstance(kind, IntType):
        raise analyser.fail("c-type", f"'{node.op}' cannot be applied to '{kind}'", node)
    assert isinstance(value.type, IntType)
    if op in ("<<", ">>"):
        work = promote(kind, c2c=analyser.c2c)
        value = promoted(analyser, value)
        if isinstance(value, tree.Num) and not 0 <= value.value < 8 * work.size:
            analyser.reporter.warn(
                "c-shift", f"shift by {value.value}, but '{work}' has only {8 * work.size} bits", place
            )
    else:
        assert isinstance(value.type, IntType)
        work = common(kind, value.type, c2c=analyser.c2c)
        value = cast(analyser, value, work)
    if op in "/%" and isinstance(value, tree.Num) and value.value == 0:
        raise analyser.fail("c-division-by-zero", "division by zero", value)
    return tree.Update(op, target, value, work, False, kind, place)


def _same_variable(one: tree.Ref, two: tree.Ref) -> bool:
    """Return whether two references read the same bytes and reading them has no effect."""
    same_place = (one.symbol, one.offset, one.bit, one.width) == (two.symbol, two.offset, two.bit, two.width)
    steady = not one.symbol.volatile and one.symbol.kind != "fixed"
    return same_place and steady and one.index is None and two.index is None


def cast_expression(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse a cast (ISO C 6.5.4)."""
    kind = analyser.dispatch.declared_type(analyser, node.to_type)
    operand = decay(analyser, expression(analyser, node.expr))
    if isinstance(kind, VoidType):
        return tree.Cast(operand, VOID, analyser.place(node))
    operand = rvalue(analyser, operand)
    if not kind.scalar or not operand.type.scalar:
        if same(kind, operand.type):
            return operand
        raise analyser.fail("c-type", f"'{operand.type}' cannot be cast to '{kind}'", node)
    keep_const(analyser, operand, kind, "the cast")
    if (
        isinstance(operand, tree.AddressOf)
        and isinstance(kind, PointerType)
        and kind.size == operand.type.size
    ):
        return tree.AddressOf(operand.target, kind.plain(), operand.place)
    return cast(analyser, operand, kind)
