"""Code for expressions: values into bytes, into W, or for their effect only.

In: typed expressions. Out: instructions. Arithmetic is done in the fewest bytes that give the same result.
"""

from __future__ import annotations

from servogen.compiler.adding import imms
from servogen.compiler.assigning import Assignments
from servogen.compiler.ctypes import IntType, StructType, VoidType
from servogen.compiler.effects import is_condition, touches, width_of
from servogen.compiler.fold import COMPARISONS, has_effect, interval
from servogen.compiler.machine import Byte, Loc, Operand, exposed
from servogen.compiler.tree import (
    AddressOf,
    Assign,
    Binary,
    Builtin,
    Call,
    Cast,
    Choice,
    Comma,
    Deref,
    Expr,
    Logic,
    Num,
    Ref,
    Unary,
    Update,
)


class Generator(Assignments):
    """Adds `into` and `effect`."""

    def into(self, expr: Expr, target: list[Loc]) -> None:
        """Store the low len(target) bytes of a value, widened where it has fewer.

        A byte of a volatile object is stored once, with the result.
        """
        before = self.place
        method = getattr(self, "_into_" + type(expr).__name__.removeprefix("Const"))
        if not any(map(exposed, target)) or self._stored_once(expr, target):
            method(expr, target)
        elif len(target) == 1:
            self.to_w(expr)
            self.store(target[0])
        else:
            held: list[Loc] = self.temp(len(target))
            method(expr, held)
            self.move_all(target, list(held))
        self.place = before

    def _stored_once(self, expr: Expr, target: list[Loc]) -> bool:
        """Return whether the code for a value stores no byte of its target twice and never reads one back."""
        size = len(target)
        if size > expr.type.size and self.negative_possible(expr):
            return False
        match expr:
            case Unary("-"):
                return size == 1 and not self._same_bytes(expr.operand, target)
            case Binary(op) if op not in COMPARISONS:
                return self._operator_stores_once(expr, target)
            case Ref() | Deref() if expr.width:
                return is_condition(expr)
        return True

    def _operator_stores_once(self, expr: Binary, target: list[Loc]) -> bool:
        size = len(target)
        need = min(size, expr.type.size, width_of(*interval(expr))[0])
        if need < size and self.negative_possible(expr):
            return False
        match expr.op, expr.right:
            case ("&" | "|" | "^", _):
                return True
            case ("+" | "-", _):
                return size <= 2 or self._same_bytes(expr.left, target)
            case (("<<" | ">>" | "*" | "/" | "%"), Num(value)):
                return expr.op == "<<" and size == 1 and value in (1, 4)
        return True

    def _into_Num(self, expr: Num, target: list[Loc]) -> None:
        self.move_all(target, imms(expr.value, len(target)))

    def _into_Ref(self, expr: Ref, target: list[Loc]) -> None:
        if self.direct(expr):
            operands = self.value(expr, len(target))
            for each, operand in zip(target, operands, strict=True):
                if each == operand and exposed(each):  # x = x
                    self.load(each)
                    self.store(each)
            self.move_all(target, operands)
        elif expr.width:
            self._into_field(expr, target)
        elif expr.symbol.kind == "flash":
            self._from_flash(expr, target)
        else:
            self._indirect_load(expr, target)

    def _into_Deref(self, expr: Deref, target: list[Loc]) -> None:
        if expr.width:
            self._into_field(expr, target)
        elif expr.pointer.type.size > 1:
            self._wide_load(expr, target)
        else:
            self._indirect_load(expr, target)

    def _into_AddressOf(self, expr: AddressOf, target: list[Loc]) -> None:
        if expr.target.index is None:
            self.move_all(target, self.value(expr, len(target)))
            return
        index = expr.target.index
        base = self._address_operands(expr.target, expr.type.size, min(len(target), expr.type.size))
        offset = self.value(index, len(base))
        self.add(target[: len(base)], offset, base)
        self.move_all(target[len(base) :], imms(0, len(target) - len(base)))

    def _into_Cast(self, expr: Cast, target: list[Loc]) -> None:
        if isinstance(expr.type, VoidType):
            self.effect(expr.operand)
            return
        if isinstance(expr.type, IntType) and expr.type.is_bool:
            self.boolean(expr, target)
            return
        size = expr.type.size
        if isinstance(expr.type, StructType):
            self.into(expr.operand, target)
        elif len(target) <= size:
            if expr.operand.type.scalar:
                self.into(expr.operand, target)
            else:
                self.move_all(target, self.value(expr.operand, len(target)))
        else:
            self.into(expr.operand, target[:size])
            self.widen(target, size, signed=self.negative_possible(expr))

    def _into_Unary(self, expr: Unary, target: list[Loc]) -> None:
        if expr.op == "!":
            self.boolean(expr, target)
            return
        size = min(len(target), expr.type.size)
        operand = self.value(expr.operand, size)
        part = target[:size]
        operand = self.apart(part, operand)
        (self.negate if expr.op == "-" else self.complement)(part, operand)
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    def _into_Logic(self, expr: Logic, target: list[Loc]) -> None:
        self.boolean(expr, target)

    def boolean(self, expr: Expr, target: list[Loc]) -> None:
        """0 or 1 by a condition."""
        if target and not exposed(target[0]) and not touches(expr, target):
            self.move_all(target, imms(0, len(target)))
            end = self.new_label()
            self.jump(expr, False, end)
            self.emit("INCF", target[0], 1)
            self.label(end)
            return
        self.condition_to_w(expr)
        self.store(target[0])
        self.move_all(target[1:], imms(0, len(target) - 1))

    def condition_to_w(self, expr: Expr) -> None:
        no, end = self.new_label(), self.new_label()
        self.jump(expr, False, no)
        self.emit("MOVLW", k=1)
        self.goto(end)
        self.label(no)
        self.emit("MOVLW", k=0)
        self.label(end)

    def _into_Choice(self, expr: Choice, target: list[Loc]) -> None:
        no, end = self.new_label(), self.new_label()
        part = target[: expr.type.size]
        self.jump(expr.condition, False, no)
        self.into(expr.yes, part)
        self.goto(end)
        self.label(no)
        self.into(expr.no, part)
        self.label(end)
        if len(target) > len(part):
            self.widen(target, len(part), signed=self.negative_possible(expr))

    def _into_Comma(self, expr: Comma, target: list[Loc]) -> None:
        self.effect(expr.first)
        self.into(expr.second, target)

    def _into_Assign(self, expr: Assign, target: list[Loc]) -> None:
        """The value is what has been stored; a volatile object is not read back."""
        there = expr.target
        if not there.type.scalar or (there.width and not has_effect(there)):
            self.effect(expr)
            self.into(there, target)
            return
        if there.width:
            held: Expr = self.held(expr.value, there)
            self._assign(there, held)
            self.into(held, target)
            return
        ready: list[Loc] = self.temp(there.type.size)
        self.into(expr.value, ready)
        self.assign_bytes(there, list(ready))
        self.move_all(target, self.extended(list(ready), expr, len(target)))

    def held(self, value: Expr, target: Ref | Deref) -> Ref:
        """Return a temporary with a value as `target` holds it: of a bit-field only its bits are kept."""
        size = target.type.size
        block = self.temp() if size == 1 else self.block_temp(size)
        self.into(value, list(block))
        if target.width and not (isinstance(target.type, IntType) and target.type.is_bool):
            self.cut_to_field(list(block), target)
        first = block[0]
        assert isinstance(first, Byte)
        return Ref(first.symbol, 0, None, target.type.plain(), target.place)

    def _into_Update(self, expr: Update, target: list[Loc]) -> None:
        direct = isinstance(expr.target, Ref) and self.direct(expr.target)
        # the address is evaluated once: an index or pointer with effects must not run twice
        source = expr.target if direct else self.settled(expr.target)
        if has_effect(source):
            self._volatile_update(expr, source, target)
        elif expr.post:
            self.into(source, target)
            self._update(expr, source)
        else:
            self._update(expr, source)
            self.into(source, target)

    def _volatile_update(self, expr: Update, source: Ref | Deref, target: list[Loc]) -> None:
        """Read the object once and store it once; the value comes from temporaries."""
        old = self.held(source, source) if expr.post else source
        new = self.held(self.updated(expr, old), source)
        self._assign(source, new)
        self.into(old if expr.post else new, target)

    def _into_Binary(self, expr: Binary, target: list[Loc]) -> None:
        if expr.op in COMPARISONS:
            self.boolean(expr, target)
            return
        need = min(len(target), expr.type.size, width_of(*interval(expr))[0])
        part = target[:need]
        match expr.op:
            case "+" | "-" | "&" | "|" | "^":
                self._simple(expr, part)
            case "<<":
                self._shift(expr, part, left=True)
            case ">>":
                self._right_shift(expr, part)
            case "*":
                self.multiply(expr, part)
            case _:
                self.divide(expr, part)
        if len(target) > need:
            self.widen(target, need, signed=self.negative_possible(expr))

    def _into_Call(self, expr: Call, target: list[Loc]) -> None:
        code = self.call(expr)
        if code.returns_w:
            self.store(target[0])
            self._widen_result(expr, target, 1)
            return
        assert code.result is not None
        result: list[Operand] = [Byte(code.result, each) for each in range(min(expr.type.size, len(target)))]
        self.move_all(target[: len(result)], result)
        self._widen_result(expr, target, len(result))

    def _into_Builtin(self, expr: Builtin, target: list[Loc]) -> None:
        self.builtin(expr)
        self.store(target[0])
        self.move_all(target[1:], imms(0, len(target) - 1))

    def _from_flash(self, expr: Ref, target: list[Loc]) -> None:
        raise NotImplementedError

    def _wide_load(self, expr: Deref, target: list[Loc]) -> None:
        raise NotImplementedError

    def effect(self, expr: Expr) -> None:
        """Evaluate for what it does."""
        before = self.place
        self.place = expr.place if expr.place.line else self.place
        self._effect(expr)
        self.place = before

    def _effect(self, expr: Expr) -> None:
        match expr:
            case Assign(target, value):
                self._assign(target, value)
            case Update():
                self._update(expr, self.settled(expr.target))
            case Cast(operand) | Unary(_, operand):
                self._effect(operand)
            case Binary(_, left, right):
                self._effect(left)
                self._effect(right)
            case Comma(first, second):
                self._effect(first)
                self._effect(second)
            case Logic(op, left, right):
                end = self.new_label()
                self.jump(left, op == "||", end)
                self._effect(right)
                self.label(end)
            case Choice(condition, yes, no):
                other, end = self.new_label(), self.new_label()
                self.jump(condition, False, other)
                self._effect(yes)
                self.goto(end)
                self.label(other)
                self._effect(no)
                self.label(end)
            case Call():
                self.call(expr)
            case Builtin():
                self.builtin(expr)
            case Ref() | Deref() if has_effect(expr) and expr.type.scalar:
                self.to_w(expr)
            case Ref(index=inner) | Deref(pointer=inner) | AddressOf(Ref(index=inner)) if inner is not None:
                self._effect(inner)
