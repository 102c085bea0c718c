"""Semantic analysis of access: elements, members, bits, calls, addresses.

In: pycparser nodes. Out: typed references whose addresses are byte offsets, pointer arithmetic scaled.
"""

from __future__ import annotations

from typing import Any

from pycparser import c_ast

from servogen.compiler.ctypes import (
    BIT,
    U8,
    U16,
    ArrayType,
    CType,
    IntType,
    Member,
    PointerType,
    StructType,
    VoidType,
    qualified,
    same,
)
from servogen.compiler.diagnostics import Fatal
from servogen.compiler.dialect import ChipBit
from servogen.compiler.fold import fold
from servogen.compiler.names import ConstNum, Names
from servogen.compiler.program import Function
from servogen.compiler.rewrite import BIT_MEMBER
from servogen.compiler.tree import AddressOf, Assign, Binary, Call, Comma, Deref, Expr, Num, Ref, Symbol
from servogen.errors import Place, nearest
from servogen.pic.device import RAM_FIRST, RAM_LAST, data_byte_exists


class Access(Names):
    """Adds postfix expressions, `*` and `&`."""

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
        """Return a part of an object; one in flash at a known offset is its constant value."""
        if isinstance(target, Deref) and isinstance(target.pointer, Num) and target.pointer.type.size == 1:
            self._check_memory(target.pointer.value + target.offset, target)
        if (
            isinstance(target, Ref)
            and target.symbol.kind == "flash"
            and target.index is None
            and target.symbol.initial is not None
            and isinstance(target.type, IntType)
            and 0 <= target.offset <= target.symbol.size - target.type.size
        ):
            data = [target.symbol.initial.get(target.offset + each, 0) for each in range(target.type.size)]
            if all(isinstance(each, int) for each in data):
                value = sum(each << 8 * number for number, each in enumerate(data) if isinstance(each, int))
                if target.width:
                    value = value >> (target.bit or 0) & (1 << target.width) - 1
                    if target.type.signed and value >> target.width - 1:
                        value -= 1 << target.width
                return ConstNum(target, target.type.wrap(value))
        return target

    def _check_memory(self, address: int, target: Deref) -> None:
        """Refuse a constant address where the chip has no memory."""
        size = target.type.size
        if not all(data_byte_exists(address + each) for each in range(size)):
            raise self.fail(
                f"there is no memory at 0x{address:02X} for {size} byte{'s' * (size != 1)}",
                target,
                hint=f"RAM is 0x{RAM_FIRST:02X} to 0x{RAM_LAST:02X}",
            )

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
        place = self.place(node)
        if isinstance(base, (Ref, Deref)):
            return self._member(base, member, place)
        if self.function is None:
            raise self.fail("a function cannot be called outside functions", node)
        held = Symbol(f"held{len(self.function.locals)}", base.type, "local", place)
        held.function, held.pinned = self.function.name, True
        self.function.locals.append(held)
        target = Ref(held, 0, None, base.type, place)
        value = self._member(target, member, place)
        return Comma(Assign(target, base, base.type, place), value, value.type, place)

    def _member(self, base: Ref | Deref, member: Member, place: Place) -> Expr:
        kind = qualified(member.type, const=base.type.const, volatile=base.type.volatile)
        if isinstance(base, Ref):
            target: Ref | Deref = Ref(
                base.symbol, base.offset + member.offset, base.index, kind, place, member.bit, member.width
            )
        else:
            target = Deref(base.pointer, base.offset + member.offset, kind, place, member.bit, member.width)
        return self._lvalue(target)

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
            if name in self.reporter.lost:
                raise Fatal(name)
            known = [each for each, what in self.scopes.stack[0].names.items() if isinstance(what, Function)]
            hint = nearest(name, known + self.builtin_names())
            raise self.fail(
                f"the function '{name}' is not declared", node, hint=hint if hint.startswith("did") else None
            )
        return self._call(meaning, arguments, node)

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
            target = target.reference
        if isinstance(target, Deref) and not target.width:
            return self.offset_pointer(self.rvalue(target.pointer), target.offset, PointerType(target.type))
        if not isinstance(target, Ref) or target.width:
            what = "a bit" if isinstance(target, (Ref, Deref)) else "this"
            raise self.fail(f"{what} has no address", node)
        return self.address(target, PointerType(target.type))

    def assignable(self, target: Expr, node: Any) -> Ref | Deref:
        if isinstance(target, ConstNum):
            raise self.fail(f"'{target.reference.symbol.name}' is const and cannot be changed", node)
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
