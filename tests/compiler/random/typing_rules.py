"""The types of expressions by ISO C 6.3.1 and 6.5 on a chip whose `int` has 16 bits, written down a second
time.

In: an expression and the dialect. Out: its `Int` type. In C2C `char` and `int` are unsigned, a literal that
fits 15 bits is signed, and the promotion of an 8-bit type keeps its sign.
"""

from __future__ import annotations

from tests.compiler.random.program import (
    BIT,
    S16,
    S32,
    U16,
    U32,
    AddressOf,
    Array,
    Assign,
    Binary,
    Call,
    Cast,
    Choice,
    Comma,
    Deref,
    Divide,
    Element,
    Expr,
    Int,
    Logic,
    Member,
    MemberOf,
    Num,
    Part,
    Pointer,
    Shift,
    SizeOf,
    Step,
    Struct,
    TestBit,
    Type,
    Unary,
    Update,
    Var,
)

COMPARISONS = ("==", "!=", "<", ">", "<=", ">=")


def promote(kind: Int, dialect: str) -> Int:
    if kind.bits > 8:
        return kind
    return S16 if dialect == "xc8" or kind.signed else U16


def common(left: Int, right: Int, dialect: str) -> Int:
    """The usual arithmetic conversions: a wider type holds all values of a narrower one here."""
    left, right = promote(left, dialect), promote(right, dialect)
    if left.bits != right.bits:
        return max(left, right, key=lambda each: each.bits)
    return left if not left.signed else right


def literal(num: Num, dialect: str) -> Int:
    """6.4.4.1, with 16-bit int and 32-bit long."""
    ladder = {
        "": [S16, U16, S32, U32] if num.base != 10 or dialect == "c2c" else [S16, S32, U32],
        "U": [U16, U32],
        "L": [S32, U32],
        "UL": [U32],
    }[num.suffix]
    return next(each for each in ladder if each.wrap(num.value) == num.value)


def member_type(member: Member) -> Type:
    """Every value of a bit-field fits the 8-bit type of its sign, whose promotion is the same."""
    return member.type


def dims_of(array: Expr) -> tuple[int, ...]:
    """The lengths of what can be indexed: an array, or a pointer that is never moved."""
    if isinstance(array, Var) and isinstance(array.variable.type, Pointer):
        return (array.variable.limit,)
    kind = place_type(array)
    assert isinstance(kind, Array)
    return kind.dims


def place_type(expr: Expr) -> Type:
    """The type of something in memory."""
    match expr:
        case Var(variable):
            return variable.type
        case Element(array, _):
            kind = place_type(array)
            if isinstance(kind, Pointer):
                return kind.target
            assert isinstance(kind, Array)
            return kind.element
        case MemberOf(_, member):
            return member_type(member)
        case Deref(pointer):
            assert isinstance(pointer.type, Pointer)
            return pointer.type.target
    raise TypeError(expr)


def type_of(expr: Expr, dialect: str) -> Int:
    match expr:
        case Num():
            return literal(expr, dialect)
        case Var() | Element() | MemberOf() | Deref():
            kind = place_type(expr)
            assert isinstance(kind, Int), expr
            return kind
        case Unary("!") | Logic():
            return S16
        case Unary(_, operand):
            return promote(type_of(operand, dialect), dialect)
        case Binary(op) if op in COMPARISONS:
            return S16
        case Binary(_, left, right) | Divide(_, left, right) | Choice(_, left, right):
            return common(type_of(left, dialect), type_of(right, dialect), dialect)
        case Shift(_, left, _):
            return promote(type_of(left, dialect), dialect)
        case Comma(_, second):
            return type_of(second, dialect)
        case Cast(kind, _):
            return kind
        case SizeOf():
            return U16
        case Assign(target) | Update(_, target) | Step(_, target):
            return type_of(target, dialect)
        case Part(_, member):
            kind = member_type(member)
            assert isinstance(kind, Int)
            return kind
        case Call(function):
            assert isinstance(function.result, Int)
            return function.result
        case TestBit():
            return BIT
    raise TypeError(expr)


def is_pointer(expr: Expr) -> bool:
    return isinstance(expr, AddressOf) or (
        isinstance(expr, Var) and isinstance(expr.variable.type, (Pointer, Array))
    )


def is_struct(expr: Expr) -> bool:
    return isinstance(expr, (Var, Element, Deref)) and isinstance(place_type(expr), Struct)
