"""The effects of an expression beyond its value, and the width that its value needs.

In: typed expressions. Out: whether evaluating one calls, changes or touches something; the number of bytes
that a range of values needs; what remains of an expression when only its lowest byte matters.
"""

from __future__ import annotations

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import COMPARISONS
from servogen.compiler.ast.types import IntType
from servogen.compiler.ir.instruction import Byte, Loc, Reg


def width_of(low: int, high: int) -> tuple[int, bool]:
    """Return (bytes, signed) of the narrowest type that holds every value from `low` to `high`."""
    signed = low < 0
    size = 1
    while not (-(1 << 8 * size - 1) <= low and high < 1 << 8 * size - 1 if signed else high < 1 << 8 * size):
        size += 1
    return size, signed


def changes(expr: tree.Expr) -> bool:
    """Return whether evaluating an expression may change a variable; reading a volatile one does not
    count.
    """
    match expr:
        case tree.Num():
            return False
        case tree.Ref(index=index):
            return index is not None and changes(index)
        case tree.Deref(pointer):
            return changes(pointer)
        case tree.AddressOf(target):
            return changes(target)
        case tree.Cast(operand) | tree.Unary(_, operand):
            return changes(operand)
        case tree.Binary(_, left, right) | tree.Logic(_, left, right) | tree.Comma(left, right):
            return changes(left) or changes(right)
        case tree.Choice(condition, yes, no):
            return changes(condition) or changes(yes) or changes(no)
    return True


def in_flash(expr: tree.Ref | tree.Deref) -> bool:
    """Return whether an object is, or may be, located in flash."""
    return expr.symbol.kind == "flash" if isinstance(expr, tree.Ref) else expr.pointer.type.size > 1


def calls_something(expr: tree.Expr) -> bool:
    """Return whether evaluating an expression may call a function or a library routine."""
    match expr:
        case tree.Num():
            return False
        case tree.Ref(_, _, index):
            return in_flash(expr) or (index is not None and calls_something(index))
        case tree.Deref(pointer):
            return in_flash(expr) or calls_something(pointer)
        case tree.AddressOf(target):
            return target.index is not None and calls_something(target.index)
        case tree.Cast(operand) | tree.Unary(_, operand):
            return calls_something(operand)
        case tree.Binary(op, left, right):
            return op in ("*", "/", "%") or calls_something(left) or calls_something(right)
        case tree.Logic(_, left, right) | tree.Comma(left, right):
            return calls_something(left) or calls_something(right)
        case tree.Choice(condition, yes, no):
            return calls_something(condition) or calls_something(yes) or calls_something(no)
        case tree.Assign(target, value):
            return calls_something(target) or calls_something(value)
        case tree.Update(_, target, value):
            return expr.op in ("*", "/", "%") or calls_something(target) or calls_something(value)
    return True


def touches(expr: tree.Expr, locs: list[Loc]) -> bool:
    """Return whether evaluating `expr` may read or change one of the bytes (given as symbols of the tree)."""
    symbols = {loc.symbol for loc in locs if isinstance(loc, Byte)}
    registers = any(isinstance(loc, Reg) for loc in locs)
    return _touches(expr, symbols, registers)


def _touches(expr: tree.Expr, symbols: set[tree.Symbol], registers: bool) -> bool:
    """Return whether an expression may access one of the symbols, or a register if `registers`."""
    match expr:
        case tree.Num():
            return False
        case tree.Ref(symbol, _, index):
            here = symbol in symbols or (registers and symbol.kind == "fixed")
            return here or (index is not None and _touches(index, symbols, registers))
        case tree.Deref(pointer):
            return (
                registers
                or any(watched.pinned for watched in symbols)
                or _touches(pointer, symbols, registers)
            )
        case tree.AddressOf(target):
            return target.index is not None and _touches(target.index, symbols, registers)
        case tree.Cast(operand) | tree.Unary(_, operand):
            return _touches(operand, symbols, registers)
        case tree.Binary(_, left, right) | tree.Logic(_, left, right) | tree.Comma(left, right):
            return _touches(left, symbols, registers) or _touches(right, symbols, registers)
        case tree.Choice(condition, yes, no):
            return any(_touches(part, symbols, registers) for part in (condition, yes, no))
        case tree.Assign(target, value) | tree.Update(_, target, value):
            return _touches(target, symbols, registers) or _touches(value, symbols, registers)
        case tree.Call(_, arguments):
            # a callee reaches what is static or has its address taken, and its arguments
            outside = registers or any(watched.static or watched.pinned for watched in symbols)
            return outside or any(_touches(argument, symbols, registers) for argument in arguments)
        case tree.Builtin(_, arguments):
            return any(_touches(argument, symbols, registers) for argument in arguments)
    return True


def stripped(expr: tree.Expr) -> tree.Expr:
    """Return an expression without the integer conversions that leave its low byte unchanged."""
    while isinstance(expr, tree.Cast) and isinstance(expr.type, IntType) and not expr.type.is_bool:
        if not expr.operand.type.scalar:
            break
        expr = expr.operand
    return expr


def is_condition(expr: tree.Expr) -> bool:
    """Return whether the value of an expression is 0 or 1, best computed by jumps or a bit test."""
    if isinstance(expr, tree.Logic) or (isinstance(expr, tree.Unary) and expr.op == "!"):
        return True
    if isinstance(expr, (tree.Ref, tree.Deref)) and expr.width == 1 and isinstance(expr.type, IntType):
        return not expr.type.signed
    return isinstance(expr, tree.Binary) and expr.op in COMPARISONS


def updated(expr: tree.Update, old: tree.Ref | tree.Deref) -> tree.Expr:
    """Return the value that `op=` stores, computed from the previous value of the object."""
    kind, right = old.type, update_operand(expr)
    left: tree.Expr = old if kind.plain() == expr.work else tree.Cast(old, expr.work, expr.place)
    boolean = isinstance(kind, IntType) and kind.is_bool
    # an OR of a volatile object with 0 is still read and written, but without an operation
    same = isinstance(right, tree.Num) and not boolean and leaves_alone(expr.op, right.value, kind.size)
    whole = left if same else tree.Binary(expr.op, left, right, expr.work, expr.place)
    if isinstance(kind, IntType) and kind.plain() != expr.work:
        return tree.Cast(whole, kind.plain(), expr.place)
    return whole


def update_operand(expr: tree.Update) -> tree.Expr:
    """Return the right operand of `op=` in the type of the computation; a shift count keeps its own type."""
    right = expr.value
    if expr.op in ("<<", ">>") or right.type.plain() == expr.work:
        return right
    if isinstance(right, tree.Num):
        return tree.Num(right.value, expr.work, expr.place)
    return tree.Cast(right, expr.work, expr.place)


def leaves_alone(op: str, value: int, size: int) -> bool:
    """Return whether `op= value` leaves every value of `size` bytes unchanged."""
    mask = (1 << 8 * size) - 1
    match op:
        case "+" | "-" | "|" | "^":
            return value & mask == 0
        case "&":
            return value & mask == mask
        case "<<" | ">>":
            return value == 0
        case "*" | "/":
            return value == 1
    return False
