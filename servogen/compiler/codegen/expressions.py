"""Code for expressions: values into bytes, into W, or evaluated only for their effect.

In: typed expressions. Out: instructions. Arithmetic uses the fewest bytes that give the same result.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import COMPARISONS, has_effect, interval
from servogen.compiler.ast.types import IntType, VoidType
from servogen.compiler.codegen.arithmetic import add, complement, imms, negate
from servogen.compiler.codegen.assignment import assign, assign_bytes, same_bytes, update
from servogen.compiler.codegen.effects import calls_something, is_condition, touches, updated, width_of
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.indirect import cut_to_field, indirect_load, into_field, settled
from servogen.compiler.codegen.operands import (
    address_operands,
    apart,
    extended,
    is_direct,
    negative_possible,
    operands_of,
    widen,
    widen_result,
)
from servogen.compiler.codegen.operators import right_shift, shift, simple, to_w
from servogen.compiler.ir.instruction import Byte, Loc, Operand, exposed


def into(gen: FunctionGenerator, expr: tree.Expr, target: list[Loc]) -> None:
    """Store the low len(target) bytes of a value, extending values that have fewer.

    A byte of a volatile object is stored once, with the result.
    """
    before = gen.place
    # a register must not show an intermediate result
    if not any(map(exposed, target)) or _stored_once(gen, expr, target):
        _INTO[type(expr)](gen, expr, target)
    elif len(target) == 1:
        to_w(gen, expr)
        gen.store(target[0])
    else:
        temporary: list[Loc] = gen.temp(len(target))
        _INTO[type(expr)](gen, expr, temporary)
        gen.move_all(target, list(temporary))
    gen.place = before


def _stored_once(gen: FunctionGenerator, expr: tree.Expr, target: list[Loc]) -> bool:
    """Return whether the code for a value stores each byte of its target at most once and never reads one
    back.
    """
    size = len(target)
    if size > expr.type.size and negative_possible(expr):
        return False
    match expr:
        case tree.Unary("-"):
            return size == 1 and not same_bytes(gen, expr.operand, target)
        case tree.Binary(op) if op not in COMPARISONS:
            return _operator_stores_once(gen, expr, target)
        case tree.Ref() | tree.Deref() if expr.width:
            return is_condition(expr)
    return True


def _operator_stores_once(gen: FunctionGenerator, expr: tree.Binary, target: list[Loc]) -> bool:
    """Return whether an operator's code stores each byte of its target at most once."""
    size = len(target)
    need = min(size, expr.type.size, width_of(*interval(expr))[0])
    if need < size and negative_possible(expr):
        return False
    match expr.op, expr.right:
        case ("&" | "|" | "^", _):
            return True
        case ("+" | "-", _):
            return size <= 2 or same_bytes(gen, expr.left, target)
        case (("<<" | ">>" | "*" | "/" | "%"), tree.Num(value)):
            return expr.op == "<<" and size == 1 and value in (1, 4)
    return True


def _into_num(gen: FunctionGenerator, expr: tree.Num, target: list[Loc]) -> None:
    gen.move_all(target, imms(expr.value, len(target)))


def _into_ref(gen: FunctionGenerator, expr: tree.Ref, target: list[Loc]) -> None:
    """Store an object: by copies of its bytes, or through FSR or the table that it lies in."""
    if is_direct(expr):
        operands = operands_of(gen, expr, len(target))
        for byte, operand in zip(target, operands, strict=True):
            if byte == operand and exposed(byte):  # x = x
                gen.load(byte)
                gen.store(byte)
        gen.move_all(target, operands)
    elif expr.width:
        into_field(gen, expr, target)
    elif expr.symbol.kind == "flash":
        gen.lower.from_flash(gen, expr, target)
    else:
        indirect_load(gen, expr, target)


def _into_deref(gen: FunctionGenerator, expr: tree.Deref, target: list[Loc]) -> None:
    """Store the object that a pointer leads to."""
    if expr.width:
        into_field(gen, expr, target)
    elif expr.pointer.type.size > 1:
        gen.lower.wide_load(gen, expr, target)
    else:
        indirect_load(gen, expr, target)


def _into_address_of(gen: FunctionGenerator, expr: tree.AddressOf, target: list[Loc]) -> None:
    """Store an address: a constant, plus an index where there is one."""
    if expr.target.index is None:
        gen.move_all(target, operands_of(gen, expr, len(target)))
        return
    index = expr.target.index
    base = address_operands(gen, expr.target, expr.type.size, min(len(target), expr.type.size))
    offset = operands_of(gen, index, len(base))
    add(gen, target[: len(base)], offset, base)
    gen.move_all(target[len(base) :], imms(0, len(target) - len(base)))


def _into_cast(gen: FunctionGenerator, expr: tree.Cast, target: list[Loc]) -> None:
    """Store a converted value: truncated, extended with zeros or its sign, or as 0 or 1 (ISO C 6.3.1)."""
    if isinstance(expr.type, VoidType):
        effect(gen, expr.operand)
        return
    if isinstance(expr.type, IntType) and expr.type.is_bool:
        boolean(gen, expr, target)
        return
    size = expr.type.size
    if len(target) <= size:
        if expr.operand.type.scalar:
            into(gen, expr.operand, target)
        else:
            gen.move_all(target, operands_of(gen, expr.operand, len(target)))
    else:
        into(gen, expr.operand, target[:size])
        widen(gen, target, size, signed=negative_possible(expr))


def _into_unary(gen: FunctionGenerator, expr: tree.Unary, target: list[Loc]) -> None:
    """Store `-x`, `~x` or `!x`."""
    if expr.op == "!":
        boolean(gen, expr, target)
        return
    size = min(len(target), expr.type.size)
    operand = operands_of(gen, expr.operand, size)
    part = target[:size]
    operand = apart(gen, part, operand)
    (partial(negate, gen) if expr.op == "-" else partial(complement, gen))(part, operand)
    if len(target) > size:
        widen(gen, target, size, signed=negative_possible(expr))


def _into_logic(gen: FunctionGenerator, expr: tree.Logic, target: list[Loc]) -> None:
    boolean(gen, expr, target)


def boolean(gen: FunctionGenerator, expr: tree.Expr, target: list[Loc]) -> None:
    """Store 0 or 1 according to a condition."""
    if target and not exposed(target[0]) and not touches(expr, target):
        # clearing first saves a jump, but the condition must not read the target
        gen.move_all(target, imms(0, len(target)))
        end = gen.new_label()
        gen.lower.jump(gen, expr, False, end)
        gen.emit("INCF", target[0], 1)
        gen.label(end)
        return
    condition_to_w(gen, expr)
    gen.store(target[0])
    gen.move_all(target[1:], imms(0, len(target) - 1))


def condition_to_w(gen: FunctionGenerator, expr: tree.Expr) -> None:
    """Load 1 into W if a condition holds, otherwise 0."""
    no, end = gen.new_label(), gen.new_label()
    gen.lower.jump(gen, expr, False, no)
    gen.emit("MOVLW", k=1)
    gen.goto(end)
    gen.label(no)
    gen.emit("MOVLW", k=0)
    gen.label(end)


def _into_choice(gen: FunctionGenerator, expr: tree.Choice, target: list[Loc]) -> None:
    """Store one of two values; only the chosen one is evaluated (ISO C 6.5.15)."""
    no, end = gen.new_label(), gen.new_label()
    part = target[: expr.type.size]
    gen.lower.jump(gen, expr.condition, False, no)
    into(gen, expr.yes, part)
    gen.goto(end)
    gen.label(no)
    into(gen, expr.no, part)
    gen.label(end)
    if len(target) > len(part):
        widen(gen, target, len(part), signed=negative_possible(expr))


def _into_comma(gen: FunctionGenerator, expr: tree.Comma, target: list[Loc]) -> None:
    effect(gen, expr.first)
    into(gen, expr.second, target)


def _into_assign(gen: FunctionGenerator, expr: tree.Assign, target: list[Loc]) -> None:
    """Store the value of an assignment, which is the value stored; a volatile object is not read back."""
    there = expr.target
    if not there.type.scalar:
        there = settled(gen, there) if has_effect(there) or calls_something(there) else there
        assign(gen, there, expr.value)
        into(gen, there, target)
        return
    if there.width and not has_effect(there):
        effect(gen, expr)
        into(gen, there, target)
        return
    if there.width:
        stored: tree.Expr = hold_value(gen, expr.value, there)
        assign(gen, there, stored)
        into(gen, stored, target)
        return
    # an assignment has the value of its target after it (ISO C 6.5.16)
    ready: list[Loc] = gen.temp(there.type.size)
    into(gen, expr.value, ready)
    assign_bytes(gen, there, list(ready))
    gen.move_all(target, extended(gen, list(ready), expr, len(target)))


def hold_value(gen: FunctionGenerator, value: tree.Expr, target: tree.Ref | tree.Deref) -> tree.Ref:
    """Return a temporary with a value as `target` holds it: for a bit-field, only its bits are kept."""
    size = target.type.size
    block = gen.temp() if size == 1 else gen.block_temp(size)
    into(gen, value, list(block))
    if target.width and not (isinstance(target.type, IntType) and target.type.is_bool):
        cut_to_field(gen, list(block), target)
    first = block[0]
    assert isinstance(first, Byte)
    return tree.Ref(first.symbol, 0, None, target.type.plain(), target.place)


def _into_update(gen: FunctionGenerator, expr: tree.Update, target: list[Loc]) -> None:
    """Update an object, and store the value that the expression has: the new one, or the previous one."""
    direct = isinstance(expr.target, tree.Ref) and is_direct(expr.target)
    # the address is evaluated once: an index or pointer with effects must not run twice
    source = expr.target if direct else settled(gen, expr.target)
    if has_effect(source):
        _volatile_update(gen, expr, source, target)
    elif expr.post:
        into(gen, source, target)
        update(gen, expr, source)
    else:
        update(gen, expr, source)
        into(gen, source, target)


def _volatile_update(
    gen: FunctionGenerator, expr: tree.Update, source: tree.Ref | tree.Deref, target: list[Loc]
) -> None:
    """Update a volatile object with one read and one store; the value is computed in temporaries."""
    old = hold_value(gen, source, source) if expr.post else source
    new = hold_value(gen, updated(expr, old), source)
    assign(gen, source, new)
    into(gen, old if expr.post else new, target)


def _into_binary(gen: FunctionGenerator, expr: tree.Binary, target: list[Loc]) -> None:
    """Compute an operator in as many bytes as its values need, and extend the result."""
    if expr.op in COMPARISONS:
        boolean(gen, expr, target)
        return
    need = min(len(target), expr.type.size, width_of(*interval(expr))[0])
    part = target[:need]
    match expr.op:
        case "+" | "-" | "&" | "|" | "^":
            simple(gen, expr, part)
        case "<<":
            shift(gen, expr, part, left=True)
        case ">>":
            right_shift(gen, expr, part)
        case "*":
            gen.lower.multiply(gen, expr, part)
        case _:
            gen.lower.divide(gen, expr, part)
    if len(target) > need:
        widen(gen, target, need, signed=negative_possible(expr))


def _into_call(gen: FunctionGenerator, expr: tree.Call, target: list[Loc]) -> None:
    """Store the result of a call, which is in W or in the callee's bytes."""
    function = gen.lower.call(gen, expr)
    if function.returns_w:
        gen.store(target[0])
        widen_result(gen, expr, target, 1)
        return
    assert function.result is not None
    result: list[Operand] = [
        Byte(function.result, index) for index in range(min(expr.type.size, len(target)))
    ]
    gen.move_all(target[: len(result)], result)
    widen_result(gen, expr, target, len(result))


def _into_builtin(gen: FunctionGenerator, expr: tree.Builtin, target: list[Loc]) -> None:
    """Store the result of an operation of the chip or the library."""
    result = gen.lower.builtin(gen, expr)
    if not result:
        gen.store(target[0])
        result = target[:1]
    have = min(len(target), len(result))
    gen.move_all(target[:have], list(result[:have]))
    widen_result(gen, expr, target, have)


def effect(gen: FunctionGenerator, expr: tree.Expr) -> None:
    """Evaluate an expression only for its effect."""
    before = gen.place
    gen.place = expr.place if expr.place.line else gen.place
    _evaluate(gen, expr)
    gen.place = before


def _evaluate(gen: FunctionGenerator, expr: tree.Expr) -> None:
    """Evaluate an expression for its effect, and of its operands only those that have one."""
    match expr:
        case tree.Assign(target, value):
            assign(gen, target, value)
        case tree.Update():
            update(gen, expr, settled(gen, expr.target))
        case tree.Cast(operand) | tree.Unary(_, operand):
            _evaluate(gen, operand)
        case tree.Binary(_, left, right):
            _evaluate(gen, left)
            _evaluate(gen, right)
        case tree.Comma(first, second):
            _evaluate(gen, first)
            _evaluate(gen, second)
        case tree.Logic(op, left, right):
            # the right operand is evaluated only if the left one does not decide (ISO C 6.5.13, 6.5.14)
            end = gen.new_label()
            gen.lower.jump(gen, left, op == "||", end)
            _evaluate(gen, right)
            gen.label(end)
        case tree.Choice(condition, yes, no):
            other, end = gen.new_label(), gen.new_label()
            gen.lower.jump(gen, condition, False, other)
            _evaluate(gen, yes)
            gen.goto(end)
            gen.label(other)
            _evaluate(gen, no)
            gen.label(end)
        case tree.Call():
            gen.lower.call(gen, expr)
        case tree.Builtin():
            gen.lower.builtin(gen, expr)
        case tree.Ref() | tree.Deref() if has_effect(expr) and expr.type.scalar:
            to_w(gen, expr)
        case tree.Ref(index=inner) | tree.Deref(pointer=inner) | tree.AddressOf(tree.Ref(index=inner)) if (
            inner is not None
        ):
            _evaluate(gen, inner)


_INTO: dict[type, Callable[[FunctionGenerator, Any, list[Loc]], None]] = {
    tree.Num: _into_num,
    tree.ConstNum: _into_num,
    tree.Ref: _into_ref,
    tree.Deref: _into_deref,
    tree.AddressOf: _into_address_of,
    tree.Cast: _into_cast,
    tree.Unary: _into_unary,
    tree.Logic: _into_logic,
    tree.Choice: _into_choice,
    tree.Comma: _into_comma,
    tree.Assign: _into_assign,
    tree.Update: _into_update,
    tree.Binary: _into_binary,
    tree.Call: _into_call,
    tree.Builtin: _into_builtin,
}
