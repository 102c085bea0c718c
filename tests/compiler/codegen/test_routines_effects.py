"""Which routine a division needs, and what an expression's evaluation may touch."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from servogen.compiler.ast.nodes import (
    AddressOf,
    Assign,
    Binary,
    BlockStatement,
    Builtin,
    Call,
    Cast,
    Choice,
    Comma,
    Deref,
    Expr,
    ExprStmt,
    Logic,
    Num,
    Ref,
    Symbol,
    Unary,
    Update,
)
from servogen.compiler.ast.types import BIT, BOOL, S8, S16, S32, U8, U16, U32, IntType, PointerType
from servogen.compiler.codegen.effects import (
    calls_something,
    changes,
    in_flash,
    is_condition,
    leaves_alone,
    stripped,
    touches,
    width_of,
)
from servogen.compiler.codegen.routines import (
    Divisor,
    Quotient,
    Routines,
    halvings,
    is_byte,
    is_power_of_two,
    quotient,
)
from servogen.compiler.ir.instruction import Byte, Reg
from servogen.errors import Location
from tests.compiler.cases import every

AT = Location()


def ref(name: str = "x", kind: IntType = U8, where: str = "global") -> Ref:
    return Ref(Symbol(name, kind, where), 0, None, kind, AT)


def num(value: int, kind: IntType = U16) -> Num:
    return Num(value, kind, AT)


def binary(op: str, left: Expr, right: Expr, kind: IntType = U16) -> Binary:
    return Binary(op, left, right, kind, AT)


@every(
    ("low", "high", "expected"),
    [
        (0, 0, (1, False)), (0, 255, (1, False)), (0, 256, (2, False)), (0, 65535, (2, False)),
        (0, 65536, (3, False)), (0, 1 << 24, (4, False)), (-1, 0, (1, True)), (-128, 127, (1, True)),
        (-129, 0, (2, True)), (-1, 128, (2, True)), (-32768, 32767, (2, True)), (-32769, 0, (3, True)),
        (-1, 32768, (3, True)),
    ],
)  # fmt: skip
def test_the_narrowest_width(low: int, high: int, expected: tuple[int, bool]) -> None:
    assert width_of(low, high) == expected


@every(
    ("left", "right", "kind", "expected"),
    [
        (U8, U8, U16, Quotient(1, False, False, Divisor(1, True))),
        (U8, 10, U16, Quotient(1, False, False, Divisor(1, False))),
        (U16, U8, U16, Quotient(2, False, False, Divisor(1, True))),
        (U16, U16, U16, Quotient(2, False, False, Divisor(2, True))),
        (U16, 127, U16, Quotient(2, False, False, Divisor(1, False))),
        (U16, 128, U16, Quotient(2, False, False, Divisor(1, False))),
        (U16, 129, U16, Quotient(2, False, False, Divisor(1, True))),
        (U16, 255, U16, Quotient(2, False, False, Divisor(1, True))),
        (U16, 256, U16, Quotient(2, False, False, Divisor(2, False))),
        (U16, 32768, U16, Quotient(2, False, False, Divisor(2, False))),
        (U16, 32769, U16, Quotient(2, False, False, Divisor(2, True))),
        (U32, U16, U32, Quotient(4, False, False, Divisor(2, True))),
        # -128 / -1 is 128: a byte more than the operands
        (S8, S8, S16, Quotient(2, True, True, Divisor(2, False))),
        (S16, S16, S16, Quotient(2, True, True, Divisor(2, False))),
        (S16, 10, S16, Quotient(2, True, False, Divisor(1, False))),
        (S16, 128, S16, Quotient(2, True, False, Divisor(1, False))),
        (S16, 129, S16, Quotient(2, True, False, Divisor(2, False))),
        (S16, U8, S16, Quotient(2, True, False, Divisor(2, False))),
    ],
)
def test_how_a_division_is_computed(
    left: IntType, right: IntType | int, kind: IntType, expected: Quotient
) -> None:
    divisor = num(right, kind) if isinstance(right, int) else Cast(ref("y", right), kind, AT)
    for op in "/%":
        found = quotient(binary(op, Cast(ref("x", left), kind, AT), divisor, kind))
        if op == "/" or left != S8:
            assert found == expected, op


@every(
    ("op", "divisor", "size", "bits"),
    [
        ("/", 1, 2, 0), ("/", 2, 1, 1), ("/", 64, 1, 6), ("/", 128, 1, 0), ("/", 2, 2, 1), ("/", 128, 2, 7),
        ("/", 256, 2, 8), ("/", 16384, 2, 14), ("/", 32768, 2, 0),
        # 24 words of shifts at most: a byte more than the operand for each bit
        ("/", 128, 3, 0), ("/", 64, 3, 6), ("/", 16, 4, 4), ("/", 32, 4, 0), ("/", 256, 4, 8), ("/", 3, 2, 0),
        ("/", 6, 2, 0), ("/", -2, 2, 0), ("/", 0, 2, 0), ("%", 4, 2, 0),
    ],
)  # fmt: skip
def test_when_a_signed_division_is_a_shift(op: str, divisor: int, size: int, bits: int) -> None:
    assert halvings(binary(op, ref(kind=S16), num(divisor, S16), S16), size) == bits


def test_a_division_by_a_variable_is_no_shift() -> None:
    assert halvings(binary("/", ref(kind=S16), ref("y", S16), S16), 2) == 0
    assert [is_power_of_two(num(value)) for value in (0, 1, 2, 3, 4, 6, 128)] == [
        *(False, True, True, False, True, False, True),
    ]
    assert not is_power_of_two(ref())
    assert is_byte(num(0)) and is_byte(num(255)) and not is_byte(num(256)) and not is_byte(num(-1, S16))
    assert is_byte(ref()) and not is_byte(ref(kind=S8)) and not is_byte(ref(kind=U16))


def routines(*exprs: Expr) -> Routines:
    """Those of a program of one function."""
    function: Any = SimpleNamespace(body=BlockStatement([ExprStmt(expr) for expr in exprs]))
    return Routines([function])


def over(left: IntType, right: IntType | int, kind: IntType, op: str = "/") -> Binary:
    """A quotient of two variables, or of a variable and a constant."""
    divisor = num(right, kind) if isinstance(right, int) else Cast(ref("y", right), kind, AT)
    return binary(op, Cast(ref("x", left), kind, AT), divisor, kind)


def test_one_routine_serves_all_divisions_of_a_size() -> None:
    narrow, wide = over(U16, 10, U16), over(U16, U16, U16, "%")
    assert routines(narrow).divide(quotient(narrow)) == (2, 1, 0)
    assert routines(narrow, wide).divide(quotient(narrow)) == (2, 2, 1)
    assert routines(narrow, over(U16, U8, U16)).divide(quotient(narrow)) == (2, 1, 1)
    assert routines(over(U32, U32, U32), narrow).divide(quotient(narrow)) == (2, 1, 0)
    # in any place, also where a variable is divided
    inner = binary("+", num(1), Cast(wide, U16, AT))
    change = Update("%", ref("z", U16), ref("y", U16), U16, False, U16, AT)
    assert all(routines(narrow, each).divide(quotient(narrow)) == (2, 2, 1) for each in (inner, change))


def test_divisions_by_shifts_widen_no_routine() -> None:
    narrow = over(U16, 10, U16)
    assert routines(narrow, over(U16, 512, U16), over(U16, 1024, U16, "%")).divide(quotient(narrow)) == (
        2,
        1,
        0,
    )
    signed = over(S16, 10, S16)
    assert routines(signed, over(S16, 512, S16)).divide_signed(quotient(signed)) == (2, 1, 0, 0)
    # the remainder of a signed division is no shift
    assert routines(signed, over(S16, 512, S16, "%")).divide_signed(quotient(signed)) == (2, 2, 0, 0)


def test_only_where_a_divisor_may_be_negative_its_sign_is_looked_at() -> None:
    signed, negative = over(S16, 10, S16), over(S16, S16, S16)
    assert routines(signed).divide_signed(quotient(signed)) == (2, 1, 0, 0)
    assert routines(signed, negative).divide_signed(quotient(signed)) == (2, 2, 0, 1)
    assert routines(signed).divide_signed(quotient(negative)) == (2, 2, 0, 1)
    assert routines(signed, over(S32, S32, S32)).divide_signed(quotient(signed)) == (2, 1, 0, 0)


def test_the_narrowest_factors_that_all_products_allow() -> None:
    byte, word = ref("x"), ref("y", U16)
    wide, narrow = binary("*", word, word), binary("*", word, byte)
    for size in (1, 2):
        assert routines(wide).multiply(byte, byte, size) == (1, 1, size)
    assert routines().multiply(byte, byte, 4) == (1, 1, 2), "the rest is zero"
    for one, two in ((word, byte), (byte, word)):
        assert routines(narrow).multiply(one, two, 2) == (2, 1, 2)
        assert routines(narrow, wide).multiply(one, two, 2) == (2, 2, 2)
    assert routines(narrow).multiply(word, word, 2) == (2, 2, 2)
    assert routines(binary("*", byte, word)).multiply(word, byte, 3) == (2, 1, 3)
    change = Update("*", ref("z", U16), word, U16, False, U16, AT)
    assert routines(change).multiply(word, byte, 2) == (2, 2, 2)


VARIABLE, OTHER, CALL = ref("x"), ref("y"), Call("f", [], U8, AT)
FLASH = Ref(Symbol("c", U8, "flash"), 0, num(1), U8, AT)
CHANGE: Expr = Assign(OTHER, num(1), U8, AT)
NARROW, WIDE = (
    Ref(Symbol(name, kind, "global"), 0, None, kind, AT)
    for name, kind in (("p", PointerType(U8)), ("q", U16))
)


def wrapped(inner: Expr) -> list[Expr]:
    """Expressions that evaluate another one, in each of their operands."""
    plain = num(1)
    return [
        Cast(inner, U8, AT), Unary("-", inner, U8, AT), binary("+", inner, plain), binary("+", plain, inner),
        Logic("&&", inner, plain, U8, AT), Logic("||", plain, inner, U8, AT), Comma(inner, plain, U8, AT),
        Comma(plain, inner, U8, AT), Choice(inner, plain, plain, U8, AT), Choice(plain, inner, plain, U8, AT),
        Choice(plain, plain, inner, U8, AT),
        Ref(Symbol("a", U8, "global"), 0, inner, U8, AT),
        Deref(inner, 0, U8, AT),
        AddressOf(Ref(Symbol("a", U8, "global"), 0, inner, U8, AT), PointerType(U8), AT),
    ]  # fmt: skip


@every("number", range(14))
def test_what_an_operand_does_its_expression_does(number: int) -> None:
    of_call, of_change, of_variable, of_nothing = (
        wrapped(each)[number] for each in (Call("f", [], U8, AT), CHANGE, ref("x"), num(2, U8))
    )
    assert changes(of_call) and changes(of_change) and not changes(of_variable) and not changes(of_nothing)
    assert calls_something(of_call) and not calls_something(of_variable) and not calls_something(of_nothing)
    assert not calls_something(of_change)
    symbol = Symbol("x", U8, "global")
    inner = Ref(symbol, 0, None, U8, AT)
    assert touches(wrapped(inner)[number], [Byte(symbol, 0)])
    assert not touches(wrapped(inner)[number], [Byte(Symbol("z", U8, "local"), 0)])


def test_what_calls() -> None:
    assert [calls_something(binary(op, ref(), ref())) for op in ("*", "/", "%", "+", "<<", "==")] == [
        *(True, True, True, False, False, False),
    ]
    assert calls_something(FLASH) and in_flash(FLASH) and not in_flash(ref())
    assert not in_flash(Deref(NARROW, 0, U8, AT)) and in_flash(Deref(WIDE, 0, U8, AT))
    assert calls_something(Deref(WIDE, 0, U8, AT)) and not calls_something(Deref(NARROW, 0, U8, AT))
    for op, calls in (("*", True), ("/", True), ("%", True), ("+", False)):
        assert calls_something(Update(op, ref(), num(3), U8, False, U8, AT)) == calls
    assert calls_something(Update("+", ref(), CALL, U8, False, U8, AT))
    assert calls_something(Assign(ref(), CALL, U8, AT)) and calls_something(Assign(FLASH, num(1), U8, AT))
    assert calls_something(Builtin("instruction", [], U8, AT))


def test_what_is_touched() -> None:
    static, local, pinned = (
        Symbol("g", U8, "global"),
        Symbol("l", U8, "local"),
        Symbol("n", U8, "local", pinned=True),
    )
    fixed = Ref(Symbol("PORTA", U8, "fixed", address=5), 0, None, U8, AT)
    places = {
        "static": [Byte(static, 0)],
        "local": [Byte(local, 0)],
        "pinned": [Byte(pinned, 0)],
        "register": [Reg(6)],
    }

    def touched(expr: Expr) -> list[str]:
        return [name for name, locs in places.items() if touches(expr, list(locs))]

    assert touched(num(3)) == []
    assert touched(Ref(local, 0, None, U8, AT)) == ["local"]
    assert touched(fixed) == ["register"]
    assert touched(Deref(num(3), 0, U8, AT)) == ["pinned", "register"]
    assert touched(Call("f", [], U8, AT)) == ["static", "pinned", "register"]
    assert touched(Call("f", [Ref(local, 0, None, U8, AT)], U8, AT)) == [
        "static",
        "local",
        "pinned",
        "register",
    ]
    assert touched(Builtin("delay", [], U8, AT)) == []
    assert touched(Builtin("putchar", [Ref(local, 0, None, U8, AT)], U8, AT)) == ["local"]
    assert touched(Assign(Ref(local, 0, None, U8, AT), num(1), U8, AT)) == ["local"]
    assert touched(Assign(ref(), Ref(static, 0, None, U8, AT), U8, AT)) == ["static"]
    assert touched(Update("+", Ref(local, 0, None, U8, AT), num(1), U8, False, U8, AT)) == ["local"]


def test_conversions_that_leave_the_low_byte() -> None:
    inner = ref(kind=U16)
    assert stripped(Cast(Cast(inner, U8, AT), U16, AT)) is inner
    boolean = Cast(inner, BOOL, AT)
    assert stripped(boolean) is boolean and stripped(Cast(boolean, U16, AT)) is boolean


def test_values_that_are_0_or_1() -> None:
    assert is_condition(Logic("&&", ref(), ref(), U8, AT)) and is_condition(Unary("!", ref(), U8, AT))
    assert not is_condition(Unary("-", ref(), U8, AT)) and not is_condition(ref())
    assert all(is_condition(binary(op, ref(), ref())) for op in ("==", "!=", "<", "<=", ">", ">="))
    assert not is_condition(binary("+", ref(), ref()))
    one, wide, signed = (
        Ref(Symbol("b", U8, "global"), 0, None, kind, AT, bit=2, width=width)
        for kind, width in ((BIT, 1), (U8, 2), (S8, 1))
    )
    assert [is_condition(each) for each in (one, wide, signed)] == [True, False, False]


@every(
    ("op", "size", "alone", "not_alone"),
    [
        ("+", 1, (0, 256), (1, 255)), ("-", 2, (0, 65536), (256, 1)), ("|", 1, (0,), (1,)),
        ("^", 1, (0,), (255,)), ("&", 1, (255, 511), (254, 0)), ("&", 2, (65535,), (255, 65534)),
        ("<<", 1, (0,), (1, 256)), (">>", 1, (0,), (1,)), ("*", 1, (1,), (0, 2, 257)), ("/", 1, (1,), (2,)),
        ("%", 1, (), (0, 1, 2)),
    ],
)  # fmt: skip
def test_which_constants_change_nothing(
    op: str, size: int, alone: tuple[int, ...], not_alone: tuple[int, ...]
) -> None:
    assert all(leaves_alone(op, value, size) for value in alone)
    assert not any(leaves_alone(op, value, size) for value in not_alone)
