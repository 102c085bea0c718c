"""Semantic analysis of operators: pycparser nodes to the typed tree.

In: an expression node and the names in scope. Out: a typed expression with every conversion explicit and
constants folded; errors and warnings to the reporter.
"""

from __future__ import annotations

from typing import Any

from pycparser import c_ast

from servogen.compiler.access import Access
from servogen.compiler.ctypes import (
    U8,
    U16,
    VOID,
    CType,
    IntType,
    PointerType,
    VoidType,
    common,
    promote,
    same,
)
from servogen.compiler.fold import COMPARISONS, compare, has_effect, interval
from servogen.compiler.tree import (
    AddressOf,
    Assign,
    Binary,
    Cast,
    Choice,
    Expr,
    Logic,
    Num,
    Unary,
    Update,
)
from servogen.errors import Place


class Expressions(Access):
    """Adds operators, assignments and casts."""

    def _UnaryOp(self, node: Any) -> Expr:
        op, place = node.op, self.place(node)
        if op == "sizeof":
            return self._sizeof(node)
        if op in ("++", "--", "p++", "p--"):
            return self._step(node)
        if op == "&":
            return self._address_of(node)
        operand = self.condition_operand(node.expr) if op == "!" else self.expr(node.expr)
        if op == "*":
            return self._dereference(operand, node)
        if op == "!":
            operand = self.truth(operand)
            if isinstance(operand, Num):
                return self.number(int(not operand.value), self.int_type, place)
            return Unary("!", operand, self.int_type, place)
        operand = self.promoted(operand)
        assert isinstance(operand.type, IntType)
        if op == "+":
            return operand
        if isinstance(operand, Num):
            value = -operand.value if op == "-" else ~operand.value
            return self.number(value, operand.type, place)
        return Unary(op, operand, operand.type, place)

    def condition_operand(self, node: Any) -> Expr:
        """An operand whose truth is asked: in C2C a bare bit name means the bit here."""
        return self.name(node, as_bit=True) if isinstance(node, c_ast.ID) else self.expr(node)

    def _step(self, node: Any) -> Expr:
        target = self.assignable(self._target(node.expr), node)
        op = "+" if "+" in node.op else "-"
        post = node.op.startswith("p")
        place = self.place(node)
        one = Num(1, U8, place)
        if isinstance(target.type, PointerType):
            one = Num(target.type.target.size, U8, place)
            return Update(op, target, one, self._address_int(target.type), post, target.type.plain(), place)
        if not isinstance(target.type, IntType):
            raise self.fail(f"'{target.type}' cannot be counted", node)
        return Update(op, target, one, promote(target.type, c2c=self.c2c), post, target.type.plain(), place)

    def _target(self, node: Any) -> Expr:
        return self.name(node, as_bit=True) if isinstance(node, c_ast.ID) else self.expr(node)

    def _BinaryOp(self, node: Any) -> Expr:
        op, place = node.op, self.place(node)
        if op in ("&&", "||"):
            left, right = (
                self.truth(self.condition_operand(node.left)),
                self.truth(self.condition_operand(node.right)),
            )
            return self._logic(op, left, right, place)
        left, right = self.rvalue(self.expr(node.left)), self.rvalue(self.expr(node.right))
        if isinstance(left.type, PointerType) or isinstance(right.type, PointerType):
            return self._pointer_operator(op, left, right, node)
        if op in ("<<", ">>"):
            left, right = self.promoted(left), self.promoted(right)
            assert isinstance(left.type, IntType)
            if isinstance(right, Num) and not 0 <= right.value < 8 * left.type.size:
                self.reporter.warn(
                    f"shift by {right.value} of '{left.type}', which has {8 * left.type.size} bits", place
                )
            return self.binary(op, left, right, left.type, place)
        left, right, kind = self.balance(left, right)
        if op in COMPARISONS:
            return self._comparison(op, left, right, place)
        return self.binary(op, left, right, kind, place)

    def _logic(self, op: str, left: Expr, right: Expr, place: Place) -> Expr:
        if isinstance(left, Num):
            decided = bool(left.value) == (op == "||")
            if decided:
                return self.number(int(op == "||"), self.int_type, place)
            if isinstance(right, Num):
                return self.number(int(bool(right.value)), self.int_type, place)
        return Logic(op, left, right, self.int_type, place)

    def _comparison(self, op: str, left: Expr, right: Expr, place: Place) -> Expr:
        if isinstance(left, Num) and isinstance(right, Num):
            return self.number(int(compare(op, left.value, right.value)), self.int_type, place)
        (low, high), (least, most) = interval(left), interval(right)
        always: bool | None = None
        if op in ("<", ">="):
            always = True if high < least else False if low >= most else None
            always = always if op == "<" or always is None else not always
        elif op in (">", "<="):
            always = True if low > most else False if high <= least else None
            always = always if op == ">" or always is None else not always
        elif high < least or low > most:
            always = op == "!="
        if always is not None:
            self.reporter.warn(
                f"this comparison is always {'true' if always else 'false'}",
                place,
                hint=f"the left side lies in {low} … {high}, the right side in {least} … {most}",
            )
            if not has_effect(left) and not has_effect(right):
                return self.number(int(always), self.int_type, place)
        return Binary(op, left, right, self.int_type, place)

    def _pointer_operator(self, op: str, left: Expr, right: Expr, node: Any) -> Expr:
        place = self.place(node)
        if op in COMPARISONS:
            kind = left.type if isinstance(left.type, PointerType) else right.type
            if isinstance(left.type, PointerType) and isinstance(right.type, PointerType):
                kind = left.type if left.type.size >= right.type.size else right.type
            return Binary(op, self.cast(left, kind), self.cast(right, kind), self.int_type, place)
        if op == "+" and isinstance(right.type, PointerType) and isinstance(left.type, IntType):
            left, right = right, left
        if op in "+-" and isinstance(left.type, PointerType) and isinstance(right.type, IntType):
            return self.pointer_plus(left, right, op)
        if op == "-" and isinstance(left.type, PointerType) and isinstance(right.type, PointerType):
            signed = self.types["int16_t"]
            assert isinstance(signed, IntType)
            work = U8 if left.type.size == right.type.size == 1 else U16
            one, two = self.cast(self.cast(left, work), signed), self.cast(self.cast(right, work), signed)
            difference = self.binary("-", one, two, signed, place)
            return self.binary("/", difference, Num(left.type.target.size, signed, place), signed, place)
        raise self.fail(f"'{op}' cannot combine '{left.type}' and '{right.type}'", node)

    def _TernaryOp(self, node: Any) -> Expr:
        condition = self.truth(self.condition_operand(node.cond))
        yes, no = self.decay(self.expr(node.iftrue)), self.decay(self.expr(node.iffalse))
        place = self.place(node)
        if isinstance(yes.type, VoidType) and isinstance(no.type, VoidType):
            return Choice(condition, yes, no, VOID, place)
        if isinstance(yes.type, IntType) and isinstance(no.type, IntType):
            kind: CType = common(yes.type, no.type, c2c=self.c2c)
        elif isinstance(yes.type, PointerType):
            kind = (
                yes.type if yes.type.size >= no.type.size or not isinstance(no.type, PointerType) else no.type
            )
        elif isinstance(no.type, PointerType):
            kind = no.type
        elif same(yes.type, no.type):
            kind = yes.type
        else:
            raise self.fail(f"the two values are of types '{yes.type}' and '{no.type}'", node)
        yes, no = self.convert(yes, kind, "the first value"), self.convert(no, kind, "the second value")
        if isinstance(condition, Num):
            return yes if condition.value else no
        return Choice(condition, yes, no, kind.plain(), place)

    def _Assignment(self, node: Any) -> Expr:
        target = self.assignable(self._target(node.lvalue), node)
        place = self.place(node)
        kind = target.type.plain()
        if node.op == "=":
            value = self.convert(self.expr(node.rvalue), kind, "the assignment")
            return Assign(target, value, kind, place)
        op = node.op[:-1]
        value = self.arithmetic(self.expr(node.rvalue))
        if isinstance(kind, PointerType):
            if op not in "+-":
                raise self.fail(f"'{node.op}' cannot change a pointer", node)
            step = self._scaled(value, kind.target.size, self._address_int(kind))
            return Update(op, target, step, self._address_int(kind), False, kind, place)
        if not isinstance(kind, IntType):
            raise self.fail(f"'{node.op}' cannot change '{kind}'", node)
        assert isinstance(value.type, IntType)
        if op in ("<<", ">>"):
            work = promote(kind, c2c=self.c2c)
            value = self.promoted(value)
            if isinstance(value, Num) and not 0 <= value.value < 8 * work.size:
                self.reporter.warn(
                    f"shift by {value.value} of '{kind}', which has {8 * work.size} bits", place
                )
        else:
            assert isinstance(value.type, IntType)
            work = common(kind, value.type, c2c=self.c2c)
            value = self.cast(value, work)
        if op in "/%" and isinstance(value, Num) and value.value == 0:
            raise self.fail("division by zero", value)
        return Update(op, target, value, work, False, kind, place)

    def _Cast(self, node: Any) -> Expr:
        kind = self.declared_type(node.to_type)
        operand = self.decay(self.expr(node.expr))
        if isinstance(kind, VoidType):
            return Cast(operand, VOID, self.place(node))
        operand = self.rvalue(operand)
        if not kind.scalar or not operand.type.scalar:
            if same(kind, operand.type):
                return operand
            raise self.fail(f"'{operand.type}' cannot be cast to '{kind}'", node)
        self.keep_const(operand, kind, "the cast")
        if (
            isinstance(operand, AddressOf)
            and isinstance(kind, PointerType)
            and kind.size == operand.type.size
        ):
            return AddressOf(operand.target, kind.plain(), operand.place)
        return self.cast(operand, kind)
