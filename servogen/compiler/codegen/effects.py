"""The effects of an expression beyond its value, and the width that its value needs.

In: typed expressions. Out: whether evaluating one calls, changes or touches something; the number of bytes
that a range of values needs; what remains of an expression when only its lowest byte matters.
"""

from __future__ import annotations

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import COMPARISONS
from servogen.compiler.ast.types import IntType
from servogen.compiler.ast.walk import VALUES, evaluated
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
    return not all(isinstance(part, VALUES) for part in evaluated(expr))


def in_flash(expr: tree.Ref | tree.Deref) -> bool:
    """Return whether an object is, or may be, located in flash."""
    return expr.symbol.kind == "flash" if isinstance(expr, tree.Ref) else expr.pointer.type.size > 1


def calls_something(expr: tree.Expr) -> bool:
    """Return whether evaluating an expression may call a function or a library routine."""
    return any(map(_calls, evaluated(expr)))


def _calls(expr: tree.Expr) -> bool:
    match expr:
        case tree.Ref() | tree.Deref():
            return in_flash(expr)
        case tree.Binary(op) | tree.Update(op):
            return op in ("*", "/", "%")
    return not isinstance(expr, (*VALUES, tree.Assign))


def touches(expr: tree.Expr, locs: list[Loc]) -> bool:
    """Return whether evaluating `expr` may read or change one of the bytes (given as symbols of the tree)."""
    symbols = {loc.symbol for loc in locs if isinstance(loc, Byte)}
    registers = any(isinstance(loc, Reg) for loc in locs)
    return any(_touches(part, symbols, registers) for part in evaluated(expr))


def _touches(expr: tree.Expr, symbols: set[tree.Symbol], registers: bool) -> bool:
    """Return whether an expression itself may access one of the symbols, or a register if `registers`."""
    match expr:
        case tree.Ref(symbol):
            return symbol in symbols or (registers and symbol.kind == "fixed")
        case tree.Deref():
            return registers or any(watched.pinned for watched in symbols)
        case tree.Call():
            # a callee reaches what is static or has its address taken
            return registers or any(watched.static or watched.pinned for watched in symbols)
    return not isinstance(expr, (*VALUES, tree.Assign, tree.Update, tree.Builtin))


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
