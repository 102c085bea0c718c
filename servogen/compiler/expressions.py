"""Semantic analysis of expressions: pycparser nodes to the typed tree.

In: an expression node and the names in scope. Out: a typed expression with every conversion explicit and
constants folded; errors and warnings to the reporter.
"""

from __future__ import annotations

import re
from typing import Any

from pycparser import c_ast

from servogen.compiler.base import Base
from servogen.compiler.ctypes import (
    BIT,
    U8,
    U16,
    VOID,
    ArrayType,
    CType,
    IntType,
    PointerType,
    StructType,
    VoidType,
    common,
    promote,
    same,
)
from servogen.compiler.dialect import ChipBit, config_names
from servogen.compiler.fold import COMPARISONS, compare, fold, has_effect, interval
from servogen.compiler.rewrite import BIT_MEMBER
from servogen.compiler.scopes import Constant, TypeName
from servogen.compiler.tree import (
    AddressOf,
    Assign,
    Binary,
    Call,
    Cast,
    Choice,
    Comma,
    Deref,
    Expr,
    Function,
    Logic,
    Num,
    Ref,
    Symbol,
    Unary,
    Update,
)
from servogen.errors import Place, nearest

_ESCAPES = {
    "n": 10,
    "t": 9,
    "r": 13,
    "0": 0,
    "a": 7,
    "b": 8,
    "f": 12,
    "v": 11,
    "\\": 92,
    "'": 39,
    '"': 34,
    "?": 63,
}


class Expressions(Base):
    """Adds `expr`."""

    def expr(self, node: Any) -> Expr:
        method = getattr(self, "_" + type(node).__name__, None)
        if method is None:
            raise self.fail(f"{type(node).__name__} is not supported", node)
        found: Expr = method(node)
        return found

    def declared_type(self, node: Any) -> CType:
        raise NotImplementedError

    def builtin(self, name: str, node: Any, arguments: list[Any]) -> Expr | None:
        raise NotImplementedError

    def constant(self, node: Any, what: str) -> int:
        """The value of a constant expression."""
        expr = self.arithmetic(self.expr(node))
        if not isinstance(expr, Num):
            raise self.fail(f"{what} must be a constant", node)
        return expr.value

    # primary expressions

    def _Constant(self, node: Any) -> Expr:
        place = self.place(node)
        if node.type == "string":
            return self.string([*self.characters(node.value, place), 0], place)
        if node.type == "char":
            values = self.characters(node.value, place)
            if len(values) != 1:
                raise self.fail("a character constant holds one character", node)
            return self.number(values[0], self.int_type, place)
        match = re.fullmatch(r"(0[xX][0-9a-fA-F]+|[0-9]+)([uUlL]*)", node.value)
        if not match:
            raise self.fail(f"'{node.value}' is not an integer", node)
        digits = match[1]
        octal = len(digits) > 1 and digits[0] == "0" and digits[1] not in "xX"
        value = int(digits, 8 if octal else 0)
        if value > 0xFFFFFFFF:
            raise self.fail(f"{digits} does not fit 32 bits", node)
        return Num(
            value, self.literal_type(value, match[2].lower(), digits[0] != "0" or digits == "0"), place
        )

    def characters(self, text: str, place: Place) -> list[int]:
        """The codes of a string or character literal with its quotes; adjacent strings already joined."""
        found = []
        for match in re.finditer(r"\\x([0-9a-fA-F]+)|\\([0-7]{1,3})|\\(.)|([^\\])", text[1:-1], re.DOTALL):
            if match[1]:
                found.append(int(match[1], 16) & 0xFF)
            elif match[2]:
                found.append(int(match[2], 8) & 0xFF)
            elif match[3]:
                if match[3] not in _ESCAPES:
                    self.reporter.warn(f"unknown escape '\\{match[3]}'", place)
                found.append(_ESCAPES.get(match[3], ord(match[3]) & 0xFF))
            else:
                encoded = match[4].encode("latin-1", "replace")
                if match[4] != "?" and encoded == b"?":
                    self.reporter.warn(f"the character '{match[4]}' is not in Latin-1 and becomes '?'", place)
                found.append(encoded[0])
        return found

    def _ID(self, node: Any) -> Expr:
        return self.name(node, as_bit=not self.c2c)

    def name(self, node: Any, *, as_bit: bool) -> Expr:
        """What a name stands for; that of a register's bit is the bit, or in C2C its number."""
        meaning = self.scopes.find(node.name)
        place = self.place(node)
        match meaning:
            case Symbol():
                return self.use(meaning, place)
            case Constant(value, kind):
                return Num(value, kind, place)
            case ChipBit(register, bit):
                if not as_bit:
                    return Num(bit, self.int_type, place)
                return Ref(self.scopes.register(register), 0, None, BIT, place, bit, 1)
            case Function():
                raise self.fail(
                    f"'{node.name}' is a function; function pointers are not supported",
                    node,
                    hint=f"to call it, write {node.name}()",
                )
            case TypeName():
                raise self.fail(f"'{node.name}' is a type, not a value", node)
        match = re.fullmatch(r"(\w+)bits", node.name)
        register_symbol = self.scopes.chip(match[1]) if match else None
        if isinstance(register_symbol, Symbol):
            return Ref(register_symbol, 0, None, StructType(_register_layout(match[1])), place)  # type: ignore[index]
        if self.reading_config and node.name in config_names():
            return Num(config_names()[node.name], self.int_type, place)
        raise self.fail(f"'{node.name}' is not declared", node, hint=self._suggest(node.name))

    def _suggest(self, name: str) -> str | None:
        hint = nearest(name, self.scopes.known())
        return hint if hint.startswith("did you") else None

    def use(self, symbol: Symbol, place: Place) -> Expr:
        kind = symbol.type
        if symbol.kind == "flash" and kind.scalar and symbol.initial is not None:
            data = [symbol.initial.get(offset, 0) for offset in range(kind.size)]
            if all(isinstance(each, int) for each in data) and isinstance(kind, IntType):
                value = sum(each << 8 * index for index, each in enumerate(data) if isinstance(each, int))
                return ConstNum(symbol, kind.wrap(value), kind.plain(), place)
        if isinstance(kind, IntType) and kind.is_bit:
            return Ref(symbol, 0, None, kind, place, 0, 1)
        return Ref(symbol, 0, None, kind, place)

    def _ExprList(self, node: Any) -> Expr:
        *before, last = node.exprs
        found = self.expr(last)
        for each in reversed(before):
            first = self.expr(each)
            self.warn_unused(first)
            found = Comma(first, found, found.type, self.place(each))
        return found

    # postfix

    def _ArrayRef(self, node: Any) -> Expr:
        base, index = self.expr(node.name), self.expr(node.subscript)
        if isinstance(index.type, (ArrayType, PointerType)):
            base, index = index, base
        index = self.arithmetic(index)
        if isinstance(base, Ref) and isinstance(base.type, ArrayType):
            return self._element(base, index, node)
        base = self.decay(base)
        if not isinstance(base.type, PointerType):
            raise self.fail(f"'{base.type}' cannot be indexed", node)
        kind = base.type.target
        if isinstance(index, Num) and not isinstance(base, AddressOf):
            return self._lvalue(Deref(base, index.value * kind.size, kind, self.place(node)))
        return self._lvalue(Deref(self.pointer_plus(base, index, "+"), 0, kind, self.place(node)))

    def _element(self, base: Ref, index: Expr, node: Any) -> Expr:
        assert isinstance(base.type, ArrayType)
        element = base.type.element
        place = self.place(node)
        if isinstance(index, Num):
            length = base.type.length
            if length is not None and not 0 <= index.value < max(length, 1):
                self.reporter.warn(
                    f"index {index.value} is outside the array of {length} elements", index.place
                )
            return self._lvalue(
                Ref(base.symbol, base.offset + index.value * element.size, base.index, element, place)
            )
        base.symbol.pinned = True
        offset = self._scaled(index, element.size, U8 if base.symbol.type.size <= 256 else U16)
        if base.index is not None:
            offset = self.binary("+", base.index, offset, offset.type, place)
        return self._lvalue(Ref(base.symbol, base.offset, offset, element, place))

    def _lvalue(self, target: Ref | Deref) -> Expr:
        """Elements of flash with a known offset are constants."""
        if isinstance(target.type, IntType) and target.type.is_bit:
            raise self.fail("bits cannot be elements; use a bit-field", target)
        if (
            isinstance(target, Ref)
            and target.symbol.kind == "flash"
            and target.index is None
            and target.symbol.initial is not None
            and isinstance(target.type, IntType)
            and not target.width
            and 0 <= target.offset <= target.symbol.size - target.type.size
        ):
            data = [target.symbol.initial.get(target.offset + each, 0) for each in range(target.type.size)]
            if all(isinstance(each, int) for each in data):
                value = sum(each << 8 * number for number, each in enumerate(data) if isinstance(each, int))
                return ConstNum(
                    target.symbol, target.type.wrap(value), target.type.plain(), target.place, target.offset
                )
        return target

    def _scaled(self, index: Expr, size: int, kind: IntType) -> Expr:
        index = self.cast(index, kind)
        if size == 1:
            return index
        return self.binary("*", index, Num(size, kind, index.place), kind, index.place)

    def pointer_plus(self, pointer: Expr, index: Expr, op: str) -> Expr:
        assert isinstance(pointer.type, PointerType)
        kind = pointer.type
        if isinstance(pointer, AddressOf) and op == "+" and not isinstance(index, Num):
            target = pointer.target
            step = self._scaled(index, kind.target.size, U8 if target.symbol.size <= 256 else U16)
            whole = (
                step
                if target.index is None
                else self.binary("+", target.index, step, step.type, pointer.place)
            )
            return AddressOf(
                Ref(target.symbol, target.offset, whole, target.type, target.place), kind, pointer.place
            )
        if isinstance(pointer, AddressOf) and isinstance(index, Num):
            target = pointer.target
            move = index.value * kind.target.size * (1 if op == "+" else -1)
            moved = Ref(target.symbol, target.offset + move, target.index, target.type, target.place)
            return AddressOf(moved, kind, pointer.place)
        step = self._scaled(index, kind.target.size, self._address_int(kind))
        return Binary(op, pointer, step, kind, pointer.place)

    def _StructRef(self, node: Any) -> Expr:
        base = self.expr(node.name)
        name = node.field.name
        if node.type == "->":
            base = self.decay(base)
            if not isinstance(base.type, PointerType):
                raise self.fail(f"'->' needs a pointer to a structure, this is '{base.type}'", node)
            kind = base.type.target
            if isinstance(base, AddressOf):
                found_at = base.target
                base = Ref(found_at.symbol, found_at.offset, found_at.index, kind, base.place)
            else:
                base = Deref(base, 0, kind, base.place)
        if name.startswith(BIT_MEMBER):
            return self.bit_of(base, int(name[len(BIT_MEMBER) :]), node)
        if isinstance(base.type, IntType) and isinstance(base, (Ref, Deref)):
            found = self.scopes.find(name)
            if isinstance(found, ChipBit):
                return self.bit_of(base, found.bit, node)
        if not isinstance(base.type, StructType):
            raise self.fail(f"'{base.type}' has no members", node.field)
        member = base.type.layout.members.get(name)
        if member is None:
            if base.type.layout.size is None:
                raise self.fail(f"'{base.type}' is not defined", node)
            hint = nearest(name, base.type.layout.members) if base.type.layout.members else None
            raise self.fail(f"'{base.type}' has no member '{name}'", node.field, hint=hint)
        if not isinstance(base, (Ref, Deref)):
            raise self.fail("take the member from a variable: store the structure first", node)
        return self._member(base, member, self.place(node))

    def _member(self, base: Ref | Deref, member: Any, place: Place) -> Expr:
        from dataclasses import replace

        kind = member.type
        if base.type.const or base.type.volatile:
            kind = replace(
                kind, const=kind.const or base.type.const, volatile=kind.volatile or base.type.volatile
            )
        if isinstance(base, Ref):
            target: Ref | Deref = Ref(
                base.symbol, base.offset + member.offset, base.index, kind, place, member.bit, member.width
            )
        else:
            target = Deref(base.pointer, base.offset + member.offset, kind, place, member.bit, member.width)
        return target if member.width else self._lvalue(target)

    def bit_of(self, base: Expr, bit: int, node: Any) -> Expr:
        """One bit of an integer variable."""
        if not isinstance(base, (Ref, Deref)) or not isinstance(base.type, IntType) or base.width:
            raise self.fail("a bit can only be taken of an integer variable", node)
        if bit >= 8 * base.type.size:
            raise self.fail(f"'{base.type}' has no bit {bit}", node)
        place = self.place(node)
        if isinstance(base, Ref):
            return Ref(base.symbol, base.offset + bit // 8, base.index, BIT, place, bit % 8, 1)
        return Deref(base.pointer, base.offset + bit // 8, BIT, place, bit % 8, 1)

    def _FuncCall(self, node: Any) -> Expr:
        arguments = list(node.args.exprs) if node.args is not None else []
        if not isinstance(node.name, c_ast.ID):
            raise self.fail("only functions can be called; function pointers are not supported", node)
        name = node.name.name
        meaning = self.scopes.find(name)
        if not isinstance(meaning, Function):
            found = self.builtin(name, node, arguments)
            if found is not None:
                return found
            if meaning is not None and not isinstance(meaning, ChipBit):
                raise self.fail(f"'{name}' is not a function", node)
            known = [each for each, what in self.scopes.stack[0].names.items() if isinstance(what, Function)]
            hint = nearest(name, known + self.builtin_names())
            raise self.fail(
                f"the function '{name}' is not declared", node, hint=hint if hint.startswith("did") else None
            )
        return self._call(meaning, arguments, node)

    def builtin_names(self) -> list[str]:
        raise NotImplementedError

    def _call(self, function: Function, arguments: list[Any], node: Any) -> Expr:
        if function.interrupt:
            raise self.fail(f"the interrupt function '{function.name}' cannot be called", node)
        wanted = function.parameters
        if len(arguments) != len(wanted):
            raise self.fail(
                f"'{function.name}' takes {len(wanted)} argument{'s' * (len(wanted) != 1)}, "
                f"{len(arguments)} {'is' if len(arguments) == 1 else 'are'} given",
                node,
                hint=f"it is declared at {function.place}",
            )
        converted = [
            self.convert(self.expr(given), parameter.type, f"argument {number} of '{function.name}'")
            for number, (given, parameter) in enumerate(zip(arguments, wanted, strict=True), 1)
        ]
        return Call(function.name, converted, function.result.plain(), self.place(node))

    # unary

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

    def _sizeof(self, node: Any) -> Expr:
        if isinstance(node.expr, c_ast.Typename):
            kind = self.declared_type(node.expr)
        else:
            kind = self.expr(node.expr).type
        if isinstance(kind, StructType) and kind.layout.size is None:
            raise self.fail(f"'{kind}' is not defined", node)
        return Num(kind.size, U16 if not self.c2c else self.types["uint16_t"], self.place(node))

    def _dereference(self, operand: Expr, node: Any) -> Expr:
        operand = self.decay(operand)
        if not isinstance(operand.type, PointerType):
            raise self.fail(f"'*' needs a pointer, this is '{operand.type}'", node)
        if isinstance(operand.type.target, VoidType):
            raise self.fail("a void pointer cannot be dereferenced; cast it first", node)
        if isinstance(operand, AddressOf) and same(operand.type.target, operand.target.type):
            return operand.target
        target = operand.type.target
        if isinstance(operand, AddressOf):
            found = operand.target
            return self._lvalue(Ref(found.symbol, found.offset, found.index, target, self.place(node)))
        return self._lvalue(Deref(operand, 0, target, self.place(node)))

    def _address_of(self, node: Any) -> Expr:
        if isinstance(node.expr, c_ast.ID) and isinstance(self.scopes.find(node.expr.name), Function):
            raise self.fail("function pointers are not supported", node)
        target = self.expr(node.expr)
        if isinstance(target, ConstNum):
            target = target.reference()
        if isinstance(target, Deref) and not target.width:
            return self.offset_pointer(self.rvalue(target.pointer), target.offset, PointerType(target.type))
        if not isinstance(target, Ref) or target.width:
            what = "a bit" if isinstance(target, (Ref, Deref)) else "this"
            raise self.fail(f"{what} has no address", node)
        return self.address(target, PointerType(target.type))

    def assignable(self, target: Expr, node: Any) -> Ref | Deref:
        if isinstance(target, ConstNum):
            raise self.fail(f"'{target.symbol.name}' is const and cannot be changed", node)
        if not isinstance(target, (Ref, Deref)):
            raise self.fail("this cannot be assigned to", node)
        if isinstance(target.type, ArrayType):
            raise self.fail("an array cannot be assigned to", node)
        if target.type.const:
            named = f"'{target.symbol.name}'" if isinstance(target, Ref) else "this"
            raise self.fail(f"{named} is const and cannot be changed", node)
        if isinstance(target.type, StructType) and target.type.layout.size is None:
            raise self.fail(f"'{target.type}' is not defined", node)
        return target

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

    # binary

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

    def binary(self, op: str, left: Expr, right: Expr, kind: CType, place: Place) -> Expr:
        """An arithmetic node on converted operands, folded."""
        if isinstance(right, Num) and right.value == 0 and op in ("/", "%"):
            raise self.fail("division by zero", right)
        if isinstance(left, Num) and isinstance(right, Num) and isinstance(kind, IntType):
            value = fold(op, left.value, right.value, kind)
            return Num(value or 0, kind, place)
        if isinstance(right, Num) and not isinstance(left, Num):
            if right.value == 0 and op in ("+", "-", "|", "^", "<<", ">>"):
                return left
            if right.value == 1 and op in ("*", "/"):
                return left
        return Binary(op, left, right, kind, place)

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
                self.reporter.warn(f"shift by {value.value} of '{kind}'", place)
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
        if (
            isinstance(operand, AddressOf)
            and isinstance(kind, PointerType)
            and kind.size == operand.type.size
        ):
            return AddressOf(operand.target, kind.plain(), operand.place)
        return self.cast(operand, kind)

    # warnings

    def warn_unused(self, expr: Expr) -> None:
        """A warning for a statement that does nothing."""
        if isinstance(expr, Cast) and isinstance(expr.type, VoidType):
            return
        if isinstance(expr, (Choice, Logic, Comma)) and has_effect(expr):
            return
        if isinstance(expr, Binary) and expr.op == "==":
            self.reporter.warn(
                "this comparison does nothing",
                expr.place,
                hint="'=' assigns, '==' compares" if expr.op == "==" else None,
            )
        elif not has_effect(expr):
            self.reporter.warn("this statement has no effect", expr.place)
        elif isinstance(expr, (Binary, Unary, Cast)) and has_effect(expr):
            self.reporter.warn("the result of this expression is not used", expr.place)


class ConstNum(Num):
    """The known value of a const object: a number that remembers where it lies, for `&`."""

    __slots__ = ("offset", "symbol")

    def __init__(self, symbol: Symbol, value: int, kind: CType, place: Place, offset: int = 0) -> None:
        super().__init__(value, kind, place)
        self.symbol = symbol
        self.offset = offset

    def reference(self) -> Ref:
        from dataclasses import replace

        return Ref(self.symbol, self.offset, None, replace(self.type, const=True), self.place)


def _register_layout(name: str) -> Any:
    from servogen.compiler.ctypes import Layout, Member
    from servogen.compiler.dialect import chip_bits, chip_registers

    register = chip_registers()[name]
    members = {
        bit_name: Member(bit_name, BIT, 0, bit.bit, 1)
        for bit_name, bit in chip_bits().items()
        if bit.register is register
    }
    return Layout(f"{register.name}bits", False, members, 1)
