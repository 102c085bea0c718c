"""Semantic analysis of accesses: elements, members, bits, calls, addresses.

In: pycparser nodes. Out: typed references whose addresses are byte offsets, pointer arithmetic scaled.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pycparser import c_ast

import servogen.compiler.library as library
import servogen.compiler.sema.function_pointers as function_pointers
from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import fold
from servogen.compiler.ast.types import (
    BIT,
    U8,
    U16,
    ArrayType,
    CType,
    FloatType,
    FuncType,
    IntType,
    Member,
    PointerType,
    StructType,
    VoidType,
    qualified,
    same,
)
from servogen.compiler.diagnostics import Fatal
from servogen.compiler.frontend.dialects import ChipBit
from servogen.compiler.frontend.extensions import BIT_MEMBER
from servogen.compiler.sema.accessors import Accessor, element
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.conversions import (
    address,
    address_int,
    arithmetic,
    cast,
    convert,
    decay,
    offset_pointer,
    rvalue,
)
from servogen.compiler.sema.names import expression
from servogen.errors import Location, did_you_mean
from servogen.pic.device import RAM_FIRST, RAM_LAST, data_byte_exists

BITS_OF_BYTE = 8


def array_ref(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse `a[i]` (ISO C 6.5.2.1)."""
    base = expression(analyser, node.name)
    with analyser.access(True):
        index = expression(analyser, node.subscript)
    # a[i] and i[a] are the same (ISO C 6.5.2.1)
    if isinstance(index.type, (ArrayType, PointerType)):
        base, index = index, base
    index = arithmetic(analyser, index)
    if isinstance(base, tree.Ref) and isinstance(base.type, ArrayType):
        return _element(analyser, base, index, node)
    if isinstance(base, tree.EepromObject) and isinstance(base.type, ArrayType):
        kind = base.type.element
        return element(base, scaled(analyser, index, kind.size, U8), kind)
    base = decay(analyser, base)
    if not isinstance(base.type, PointerType):
        raise analyser.fail("c-type", f"'{base.type}' cannot be indexed", node)
    kind = base.type.target
    if isinstance(index, tree.Num) and not isinstance(base, tree.AddressOf):
        return _lvalue(analyser, tree.Deref(base, index.value * kind.size, kind, analyser.place(node)))
    return _lvalue(
        analyser, tree.Deref(pointer_plus(analyser, base, index, "+"), 0, kind, analyser.place(node))
    )


def _element(analyser: Analyser, base: tree.Ref, index: tree.Expr, node: Any) -> tree.Expr:
    """Return an element of an array variable; a constant index is part of its offset."""
    assert isinstance(base.type, ArrayType)
    element = base.type.element
    place = analyser.place(node)
    if isinstance(index, tree.Num):
        length = base.type.length
        if length is not None and not 0 <= index.value < max(length, 1):
            analyser.reporter.warn(
                "c-index",
                f"index {index.value} is outside the array of {length} element{'s' * (length != 1)}",
                index.place,
            )
        return _lvalue(
            analyser,
            tree.Ref(base.symbol, base.offset + index.value * element.size, base.index, element, place),
        )
    # an index that is not constant may reach every byte: they must lie side by side
    base.symbol.pinned = True
    offset = scaled(analyser, index, element.size, U8 if base.symbol.type.size <= 256 else U16)
    if base.index is not None:
        offset = binary(analyser, "+", base.index, offset, offset.type, place)
    return _lvalue(analyser, tree.Ref(base.symbol, base.offset, offset, element, place))


def _lvalue(analyser: Analyser, target: tree.Ref | tree.Deref) -> tree.Expr:
    """Return a part of an object; for one in flash at a known offset, its constant value."""
    if analyser.accessing and isinstance(target, tree.Deref) and isinstance(target.pointer, tree.Num):
        _check_memory(analyser, target.pointer, target)
    if (
        isinstance(target, tree.Ref)
        and target.symbol.kind == "flash"
        and target.index is None
        and target.symbol.initial is not None
        and isinstance(target.type, (IntType, FloatType))
        and 0 <= target.offset <= target.symbol.size - target.type.size
    ):
        data = [target.symbol.initial.get(target.offset + index, 0) for index in range(target.type.size)]
        if all(isinstance(byte, int) for byte in data):
            value = sum(byte << 8 * number for number, byte in enumerate(data) if isinstance(byte, int))
            if isinstance(target.type, FloatType):
                return tree.ConstNum(target, value)
            if target.width:
                value = value >> (target.bit or 0) & (1 << target.width) - 1
                if target.type.signed and value >> target.width - 1:
                    value -= 1 << target.width
            return tree.ConstNum(target, target.type.wrap(value))
    return target


def _check_memory(analyser: Analyser, pointer: tree.Num, target: tree.Deref) -> None:
    """Reject a constant address in RAM at which the chip has no memory."""
    address, size = pointer.value + target.offset, target.type.size
    if pointer.type.size == 1 and not all(data_byte_exists(address + index) for index in range(size)):
        raise analyser.fail(
            "c-address",
            f"there is no memory at 0x{address:02X} for {size} byte{'s' * (size != 1)}",
            target,
            hint=f"RAM is 0x{RAM_FIRST:02X} to 0x{RAM_LAST:02X}",
        )


def scaled(analyser: Analyser, index: tree.Expr, size: int, kind: IntType) -> tree.Expr:
    """Return an index in bytes."""
    index = cast(analyser, index, kind)
    if size == 1:
        return index
    return binary(analyser, "*", index, tree.Num(size, kind, index.place), kind, index.place)


def pointer_plus(analyser: Analyser, pointer: tree.Expr, index: tree.Expr, op: str) -> tree.Expr:
    """Return a pointer moved by a number of elements (ISO C 6.5.6)."""
    assert isinstance(pointer.type, PointerType)
    kind = pointer.type
    if isinstance(pointer, tree.AddressOf) and op == "+" and not isinstance(index, tree.Num):
        target = pointer.target
        step = scaled(analyser, index, kind.target.size, U8 if target.symbol.size <= 256 else U16)
        whole = (
            step
            if target.index is None
            else binary(analyser, "+", target.index, step, step.type, pointer.place)
        )
        return tree.AddressOf(
            tree.Ref(target.symbol, target.offset, whole, target.type, target.place), kind, pointer.place
        )
    if isinstance(pointer, tree.AddressOf) and isinstance(index, tree.Num):
        target = pointer.target
        move = index.value * kind.target.size * (1 if op == "+" else -1)
        moved = tree.Ref(target.symbol, target.offset + move, target.index, target.type, target.place)
        return tree.AddressOf(moved, kind, pointer.place)
    step = scaled(analyser, index, kind.target.size, address_int(kind))
    return tree.Binary(op, pointer, step, kind, pointer.place)


def struct_ref(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse `s.m` and `p->m` (ISO C 6.5.2.3); `.7` and `.RB7` name bits of a byte."""
    base = expression(analyser, node.name)
    name = node.field.name
    if node.type == "->":
        base = decay(analyser, base)
        if not isinstance(base.type, PointerType):
            raise analyser.fail("c-type", f"'->' needs a pointer to a structure, not '{base.type}'", node)
        kind = base.type.target
        if isinstance(base, tree.AddressOf):
            found_at = base.target
            base = tree.Ref(found_at.symbol, found_at.offset, found_at.index, kind, base.place)
        else:
            base = tree.Deref(base, 0, kind, base.place)
    if name.startswith(BIT_MEMBER):
        return bit_of(analyser, base, int(name[len(BIT_MEMBER) :]), node)
    if isinstance(base.type, IntType) and isinstance(base, (tree.Ref, tree.Deref)):
        symbol = analyser.scopes.find(name)
        if isinstance(symbol, ChipBit):
            return bit_of(analyser, base, symbol.bit, node)
    if not isinstance(base.type, StructType):
        raise analyser.fail("c-undeclared", f"'{base.type}' has no members", node.field)
    member = base.type.layout.members.get(name)
    if member is None:
        if base.type.layout.size is None:
            raise analyser.fail("c-undefined", f"'{base.type}' is not defined", node)
        hint = did_you_mean(name, base.type.layout.members) if base.type.layout.members else None
        raise analyser.fail("c-undeclared", f"'{base.type}' has no member '{name}'", node.field, hint=hint)
    place = analyser.place(node)
    if isinstance(base, tree.EepromObject):
        if member.width:
            raise analyser.fail("c-unsupported", "bit-fields cannot be kept in the EEPROM", node)
        return element(base, tree.Num(member.offset, U8, place), member.type)
    if isinstance(base, (tree.Ref, tree.Deref)):
        return _member(analyser, base, member, place)
    if analyser.function is None:
        raise analyser.fail("c-not-constant", "a function cannot be called outside functions", node)
    # a function's result has no place of its own: it is stored so that its member can be named
    result = analyser.new_local("held", base.type, place)
    result.pinned = True
    target = tree.Ref(result, 0, None, base.type, place)
    value = _member(analyser, target, member, place)
    return tree.Comma(tree.Assign(target, base, base.type, place), value, value.type, place)


def _member(analyser: Analyser, base: tree.Ref | tree.Deref, member: Member, place: Location) -> tree.Expr:
    """Return a member of a structure, with the structure's qualifiers."""
    kind = qualified(member.type, const=base.type.const, volatile=base.type.volatile)
    if member.width > BITS_OF_BYTE:
        whole = _member(analyser, base, replace(member, width=0, bit=None), place)
        if isinstance(whole, tree.ConstNum):
            whole = whole.reference
        assert isinstance(whole, (tree.Ref, tree.Deref))
        return tree.WideField(whole, member.width, kind, place)
    if isinstance(base, tree.Ref):
        target: tree.Ref | tree.Deref = tree.Ref(
            base.symbol, base.offset + member.offset, base.index, kind, place, member.bit, member.width
        )
    else:
        target = tree.Deref(base.pointer, base.offset + member.offset, kind, place, member.bit, member.width)
    return _lvalue(analyser, target)


def bit_of(analyser: Analyser, base: tree.Expr, bit: int, node: Any) -> tree.Expr:
    """Return one bit of an integer variable."""
    if not isinstance(base, (tree.Ref, tree.Deref)) or not isinstance(base.type, IntType) or base.width:
        raise analyser.fail("c-bit", "only an integer variable has bits", node)
    if bit >= 8 * base.type.size:
        raise analyser.fail("c-bit", f"'{base.type}' has no bit {bit}", node)
    place = analyser.place(node)
    if isinstance(base, tree.Ref):
        return tree.Ref(base.symbol, base.offset + bit // 8, base.index, BIT, place, bit % 8, 1)
    return tree.Deref(base.pointer, base.offset + bit // 8, BIT, place, bit % 8, 1)


def func_call(analyser: Analyser, node: Any) -> tree.Expr:
    """Analyse a call: of a function, a built-in one, or through a pointer (ISO C 6.5.2.2)."""
    arguments = list(node.args.exprs) if node.args is not None else []
    if not isinstance(node.name, c_ast.ID):
        return indirect_call(analyser, expression(analyser, node.name), arguments, node)
    name = node.name.name
    meaning = analyser.scopes.find(name)
    if isinstance(meaning, tree.Symbol) and isinstance(meaning.type, PointerType):
        return indirect_call(analyser, expression(analyser, node.name), arguments, node)
    if not isinstance(meaning, tree.FunctionDefinition):
        # a function of the program hides a built-in one with its name
        special = analyser.dispatch.builtin(analyser, name, node, arguments)
        if special is not None:
            return special
        if meaning is not None and not isinstance(meaning, ChipBit):
            raise analyser.fail("c-type", f"'{name}' is not a function", node)
        if name in analyser.reporter.lost:
            raise Fatal(name)
        if name.removesuffix("f") in library.MISSING:
            raise analyser.fail(
                "c-unsupported",
                f"the library has no '{name}'",
                node,
                hint="of <math.h> it has fabs, sqrt, floor and ceil",
            )
        functions = [
            declared
            for declared, its_meaning in analyser.scopes.stack[0].names.items()
            if isinstance(its_meaning, tree.FunctionDefinition)
        ]
        hint = did_you_mean(name, functions + analyser.dispatch.builtin_names(analyser))
        if header := library.declared_in(name):
            hint = f"did you forget #include <{header}>?"
        raise analyser.fail(
            "c-undeclared",
            f"the function '{name}' is not declared",
            node,
            hint=hint if hint.startswith("did") else None,
        )
    return _call(analyser, meaning, arguments, node)


def indirect_call(analyser: Analyser, pointer: tree.Expr, arguments: list[Any], node: Any) -> tree.Expr:
    """Return the call of the function that a pointer leads to, through the dispatcher of its type."""
    pointer = rvalue(analyser, pointer)
    kind = pointer.type.target if isinstance(pointer.type, PointerType) else None
    if not isinstance(kind, FuncType):
        raise analyser.fail("c-type", f"'{pointer.type}' is not a function", node)
    dispatcher = function_pointers.dispatcher(analyser, kind)
    call = _call(analyser, dispatcher, arguments, node, pointer)
    assert isinstance(call, tree.Call)
    return call


def _call(
    analyser: Analyser,
    function: tree.FunctionDefinition,
    arguments: list[Any],
    node: Any,
    pointer: tree.Expr | None = None,
) -> tree.Expr:
    """Return a call whose arguments are converted to the parameters' types."""
    if function.interrupt:
        raise analyser.fail("c-interrupt", f"the interrupt function '{function.name}' cannot be called", node)
    analyser.called.add(function.name)
    wanted = function.parameters if pointer is None else function.parameters[:-1]
    named = f"'{function.name}'" if pointer is None else "the function"
    if len(arguments) != len(wanted):
        raise analyser.fail(
            "c-argument",
            f"{named} takes {len(wanted)} argument{'s' * (len(wanted) != 1)}, "
            f"{len(arguments)} {'is' if len(arguments) == 1 else 'are'} given",
            node,
            hint=f"it is declared at {function.place}",
        )
    converted = [
        convert(analyser, expression(analyser, given), parameter.type, f"argument {number} of {named}")
        for number, (given, parameter) in enumerate(zip(arguments, wanted, strict=True), 1)
    ]
    if pointer is not None:
        converted.append(cast(analyser, pointer, U8))
    return tree.Call(function.name, converted, function.result.plain(), analyser.place(node))


def sizeof(analyser: Analyser, node: Any) -> tree.Expr:
    """Return the size of a type or of an expression, which is not evaluated (ISO C 6.5.3.4)."""
    if isinstance(node.expr, c_ast.Typename):
        kind = analyser.dispatch.declared_type(analyser, node.expr)
    else:
        with analyser.access(False):
            kind = expression(analyser, node.expr).type
    if isinstance(kind, StructType) and kind.layout.size is None:
        raise analyser.fail("c-undefined", f"'{kind}' is not defined", node)
    return tree.Num(kind.size, U16, analyser.place(node))


def dereference(analyser: Analyser, operand: tree.Expr, node: Any) -> tree.Expr:
    """Return the object that a pointer points to (ISO C 6.5.3.2)."""
    operand = decay(analyser, operand)
    if not isinstance(operand.type, PointerType):
        raise analyser.fail("c-type", f"'*' needs a pointer, not '{operand.type}'", node)
    if isinstance(operand.type.target, FuncType):
        return operand
    if isinstance(operand.type.target, VoidType):
        raise analyser.fail("c-type", "a void pointer cannot be dereferenced; cast it first", node)
    if isinstance(operand, tree.AddressOf) and same(operand.type.target, operand.target.type):
        return operand.target
    target = operand.type.target
    if isinstance(operand, tree.AddressOf):
        variable = operand.target
        converted = tree.Ref(variable.symbol, variable.offset, variable.index, target, analyser.place(node))
        return _lvalue(analyser, converted)
    return _lvalue(analyser, tree.Deref(operand, 0, target, analyser.place(node)))


def address_of(analyser: Analyser, node: Any) -> tree.Expr:
    """Return the address of an object or function (ISO C 6.5.3.2)."""
    if isinstance(node.expr, c_ast.ID) and isinstance(
        analyser.scopes.find(node.expr.name), tree.FunctionDefinition
    ):
        return expression(analyser, node.expr)
    with analyser.access(False):
        target = expression(analyser, node.expr)
    if isinstance(target, tree.ConstNum):
        target = target.reference
    if isinstance(target, tree.Comma) and isinstance(node.expr, c_ast.CompoundLiteral):
        return _address_of_last(analyser, target)
    if isinstance(target, tree.EepromObject):
        raise analyser.fail("c-unsupported", "there are no pointers into the EEPROM", node)
    if isinstance(target, tree.Deref) and not target.width:
        return offset_pointer(rvalue(analyser, target.pointer), target.offset, PointerType(target.type))
    if not isinstance(target, tree.Ref) or target.width:
        subject = "a bit" if isinstance(target, (tree.Ref, tree.Deref)) else "this"
        raise analyser.fail("c-lvalue", f"{subject} has no address", node)
    return address(target, PointerType(target.type))


def _address_of_last(analyser: Analyser, expr: tree.Expr) -> tree.Expr:
    """Return the address of the variable that a compound literal is, after its assignments."""
    if isinstance(expr, tree.Comma):
        second = _address_of_last(analyser, expr.second)
        return tree.Comma(expr.first, second, second.type, expr.place)
    assert isinstance(expr, tree.Ref)
    return address(expr, PointerType(expr.type))


def assignable(analyser: Analyser, target: tree.Expr, node: Any) -> tree.Ref | tree.Deref | Accessor:
    """Return an object that may be assigned to; reject all others (ISO C 6.3.2.1)."""
    if isinstance(target, tree.ConstNum):
        raise analyser.fail(
            "c-const", f"'{target.reference.symbol.name}' is const and cannot be changed", node
        )
    if not isinstance(target, (tree.Ref, tree.Deref, tree.WideField, tree.EepromObject)):
        raise analyser.fail("c-lvalue", "this cannot be assigned to", node)
    if isinstance(target.type, ArrayType):
        raise analyser.fail("c-lvalue", "an array cannot be assigned to", node)
    if target.type.const:
        named = f"'{target.symbol.name}'" if isinstance(target, tree.Ref) else "this"
        raise analyser.fail("c-const", f"{named} is const and cannot be changed", node)
    if isinstance(target.type, StructType) and target.type.layout.size is None:
        raise analyser.fail("c-undefined", f"'{target.type}' is not defined", node)
    return target


def _exact(
    analyser: Analyser, op: str, left: tree.Num, right: tree.Num, kind: IntType, place: Location
) -> int | None:
    """Return a sum, difference or product of constants that its signed type does not hold, with a warning;
    C2C's users count on 16 bits without a sign.
    """
    if op not in ("+", "-", "*") or not kind.signed:
        return None
    one, two = (number.value if number.exact is None else number.exact for number in (left, right))
    exact = {"+": one + two, "-": one - two, "*": one * two}[op]
    high = 2 * kind.high + 1 if analyser.c2c else kind.high
    if not kind.low <= exact <= high:
        analyser.reporter.warn(
            "c-overflow",
            f"{one} {op} {two} is {exact}, which does not fit '{kind}', and becomes {kind.wrap(exact)}",
            place,
            hint="append L to one of them, to compute in 32 bits",
        )
        return None
    return exact if exact > kind.high else None


def binary(
    analyser: Analyser, op: str, left: tree.Expr, right: tree.Expr, kind: CType, place: Location
) -> tree.Expr:
    """Return an arithmetic node on converted operands, folded if constant."""
    if isinstance(right, tree.Num) and right.value == 0 and op in ("/", "%"):
        raise analyser.fail("c-division-by-zero", "division by zero", right)
    if isinstance(left, tree.Num) and isinstance(right, tree.Num) and isinstance(kind, IntType):
        value = fold(op, left.value, right.value, kind)
        return tree.Num(value or 0, kind, place, _exact(analyser, op, left, right, kind, place))
    if isinstance(right, tree.Num) and not isinstance(left, tree.Num):
        if right.value == 0 and op in ("+", "-", "|", "^", "<<", ">>"):
            return left
        if right.value == 1 and op in ("*", "/"):
            return left
    return tree.Binary(op, left, right, kind, place)
