"""Arithmetic, bitwise and shift operators, computed in W where one byte is wanted.

In: typed expressions. Out: instructions. Sums, differences and bitwise operations use as many bytes as the
result has, because the low bytes of a sum depend only on the low bytes of its operands. A right shift is as
wide as the value range of its left operand requires.
"""

from __future__ import annotations

from servogen.compiler.ast.constant_folding import has_effect, interval
from servogen.compiler.ast.nodes import AddressByte, Binary, Builtin, Call, Deref, Expr, Num, Ref, Unary
from servogen.compiler.codegen.arithmetic import (
    WITH_FILE,
    add,
    bitwise,
    one_left,
    one_right,
    shift_left,
    shift_right,
    subtract,
)
from servogen.compiler.codegen.effects import calls_something, changes, is_condition, stripped, width_of
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.operands import (
    apart,
    is_constant,
    is_direct,
    is_simple_operand,
    operands_of,
    pair,
)
from servogen.compiler.ir.instruction import Byte, Imm, Loc, Operand, Z


def simple(gen: FunctionGenerator, expr: Binary, target: list[Loc]) -> None:
    """Emit target = left op right for a sum, a difference or a bitwise operation."""
    size = len(target)
    if size == 1 and _through_w(gen, expr, target[0]):
        return
    a, b = pair(gen, expr.left, expr.right, size)
    a, b = apart(gen, target, a), apart(gen, target, b)
    _apply(gen, expr.op, target, a, b)


def _apply(gen: FunctionGenerator, op: str, target: list[Loc], a: list[Operand], b: list[Operand]) -> None:
    """Emit target = a op b on operand bytes."""
    if op == "+":
        add(gen, target, a, b)
    elif op == "-":
        subtract(gen, target, a, b)
    else:
        bitwise(gen, op, target, a, b)


def _through_w(gen: FunctionGenerator, expr: Binary, target: Loc) -> bool:
    """Compute one byte in W and store it once; return False if the target is an operand."""
    left, right = expr.left, expr.right
    if is_simple_operand(left) and operands_of(gen, left, 1)[0] == target:
        return False
    if expr.op != "-" and is_simple_operand(right) and operands_of(gen, right, 1)[0] == target:
        return False
    binary_w(gen, expr)
    gen.store(target)
    return True


def binary_w(gen: FunctionGenerator, expr: Binary) -> None:
    """Load the low byte of a sum, difference or bitwise operation into W."""
    left, right, op = expr.left, expr.right, expr.op
    # where the order is free, the operand that needs code is computed in W, the other one read from memory
    if (op != "-" and is_simple_operand(left) and not is_simple_operand(right)) or (
        op != "-" and is_constant(left)
    ):
        left, right = right, left
    if is_constant(right):
        value = operands_of(gen, right, 1)[0]
        assert isinstance(value, Imm)
        if op == "-":
            if isinstance(value.value, int):
                to_w(gen, left)
                # x - n is x + (256 - n)
                _w_constant(gen, "+", -value.value & 0xFF)
                return
        else:
            to_w(gen, left)
            _w_constant(gen, op, value.value)
            return
    if op == "-" and is_constant(left):
        to_w(gen, right)
        value = operands_of(gen, left, 1)[0]
        assert isinstance(value, Imm)
        gen.emit("SUBLW", k=value.value)
        return
    mnemonic = WITH_FILE[op]
    # SUBWF computes f - W, so that the left operand must be in memory; all others commute
    in_memory, in_w = (left, right) if op == "-" else (right, left)
    if is_simple_operand(in_memory) and not changes(in_w):
        to_w(gen, in_w)
        gen.emit(mnemonic, operands_of(gen, in_memory, 1)[0], 0)  # type: ignore[arg-type]
        return
    temporary = gen.temp()[0]
    gen.lower.into(gen, left, [temporary])
    to_w(gen, right)
    gen.emit(mnemonic, temporary, 0)


def _w_constant(gen: FunctionGenerator, op: str, value: int | AddressByte) -> None:
    """Combine W with a constant, unless that leaves it as it is."""
    mnemonic = {"+": "ADDLW", "&": "ANDLW", "|": "IORLW", "^": "XORLW"}[op]
    neutral = 0xFF if op == "&" else 0
    if value != neutral:
        gen.emit(mnemonic, k=value)


def to_w(gen: FunctionGenerator, expr: Expr) -> None:
    """Load the low byte of a value into W."""
    inner = stripped(expr)
    if isinstance(inner, Num) or is_direct(inner):
        gen.load(operands_of(gen, inner, 1)[0])
    elif isinstance(inner, Binary) and inner.op in ("+", "-", "&", "|", "^"):
        binary_w(gen, inner)
    elif isinstance(inner, Unary) and inner.op in ("-", "~"):
        _unary_w(gen, inner)
    elif isinstance(inner, Call):
        function = gen.lower.call(gen, inner)
        if not function.returns_w:
            assert function.result is not None
            gen.load(Byte(function.result, 0))
    elif isinstance(inner, Builtin):
        result = gen.lower.builtin(gen, inner)
        if result:
            gen.load(result[0])
    elif isinstance(inner, (Ref, Deref)) and gen.lower.one_byte_indirect(gen, inner):
        return
    elif is_condition(inner):
        gen.lower.condition_to_w(gen, inner)
    else:
        gen.load(operands_of(gen, inner, 1)[0])


def _unary_w(gen: FunctionGenerator, expr: Unary) -> None:
    """Load the low byte of `-x` or `~x` into W."""
    operand = stripped(expr.operand)
    if expr.op == "~":
        if is_direct(operand):
            gen.emit("COMF", operands_of(gen, operand, 1)[0], 0)  # type: ignore[arg-type]
        else:
            to_w(gen, operand)
            gen.emit("XORLW", k=0xFF)
    else:
        to_w(gen, operand)
        gen.emit("SUBLW", k=0)


def shift(gen: FunctionGenerator, expr: Binary, target: list[Loc], *, left: bool) -> None:
    """Emit a shift to the left, or one by a variable count."""
    size = len(target)
    count = expr.right
    if isinstance(count, Num):
        operand = apart(gen, target, operands_of(gen, expr.left, size))
        if left:
            shift_left(gen, target, operand, count.value & 0xFF)
        return
    _variable_shift(gen, expr, target, size, left=left, signed=False)


def right_shift(gen: FunctionGenerator, expr: Binary, target: list[Loc]) -> None:
    """Emit a shift to the right, in the bytes that the values of its left operand need."""
    low, high = interval(expr.left)
    size, signed = width_of(low, high)
    size = min(size, expr.left.type.size)
    count = expr.right
    size = max(size, len(target))
    work = target if len(target) == size else gen.temp(size)
    if isinstance(count, Num):
        operand = apart(gen, work, operands_of(gen, expr.left, size))
        shift_right(gen, work, operand, count.value & 0xFF, signed=signed)
    else:
        _variable_shift(gen, expr, work, size, left=False, signed=signed)
    if work is not target:
        gen.move_all(target, list(work[: len(target)]))


def _variable_shift(
    gen: FunctionGenerator, expr: Binary, target: list[Loc], size: int, *, left: bool, signed: bool
) -> None:
    """Emit a shift by a variable count as a loop over one-bit shifts of a copy."""
    shifted: list[Loc] = gen.temp(size)
    count = gen.temp()[0]
    if has_effect(expr.left) or calls_something(expr.right) or has_effect(expr.right):
        a, b = pair(gen, expr.left, expr.right, size)
        gen.move(count, b[0])
        gen.move_all(shifted, a)
    else:
        gen.lower.into(gen, expr.right, [count])
        gen.lower.into(gen, expr.left, shifted)
    loop, end = gen.new_label(), gen.new_label()
    # a count of 0 shifts nothing; DECFSZ would take it for 256
    gen.emit("MOVF", count, 1)
    gen.goto_if(Z, True, end)
    gen.label(loop)
    if left:
        one_left(gen, shifted)
    else:
        one_right(gen, shifted, signed=signed)
    gen.emit("DECFSZ", count, 1)
    gen.goto(loop)
    gen.label(end)
    gen.move_all(target, list(shifted))
