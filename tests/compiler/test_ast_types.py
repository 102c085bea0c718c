"""Types and constant arithmetic of the compiler against a second formulation of ISO C's rules."""

from __future__ import annotations

import operator
from collections.abc import Callable
from itertools import product

import pytest

from servogen.compiler.ast.constant_folding import (
    COMPARISONS,
    MIRRORED,
    compare,
    fold,
    has_effect,
    interval,
    type_interval,
)
from servogen.compiler.ast.nodes import (
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
    Symbol,
    Unary,
    Update,
)
from servogen.compiler.ast.types import (
    BIT,
    BOOL,
    C2C_INT,
    C2C_SIGNED,
    S8,
    S16,
    S24,
    S32,
    U8,
    U16,
    U24,
    U32,
    VOID,
    ArrayType,
    CType,
    FloatType,
    FuncType,
    IntType,
    Member,
    PointerType,
    StructLayout,
    StructType,
    common,
    differs_in_const,
    holds_volatile,
    is_const_object,
    promote,
    qualified,
    same,
)
from servogen.compiler.ast.walk import expressions, nodes
from servogen.compiler.frontend.dialects import C2C, SDCC, XC8, int_type
from servogen.errors import Location

HERE = Location("main.c", 1, 1)
F24, F32 = FloatType(3), FloatType(4)
INTEGERS = {
    # type: bytes, signed, as declared
    U8: (1, False, "unsigned char"), S8: (1, True, "signed char"), U16: (2, False, "unsigned int"),
    S16: (2, True, "int"), U24: (3, False, "unsigned short long"), S24: (3, True, "short long"),
    U32: (4, False, "unsigned long"), S32: (4, True, "long"), C2C_INT: (2, False, "int"),
    C2C_SIGNED: (2, True, "signed int"),
}  # fmt: skip


def converted(value: int, size: int, signed: bool) -> int:
    """Return a value modulo 2 to the number of bits, as its bytes are read again (ISO C 6.3.1.3)."""
    return int.from_bytes((value % 256**size).to_bytes(size, "little"), "little", signed=signed)


EDGES = sorted(
    {
        sign * (1 << bits) + step
        for bits in (0, 7, 8, 15, 16, 23, 24, 31, 32)
        for sign in (-1, 1)
        for step in (-1, 0, 1)
    }
)


@pytest.mark.parametrize("kind", INTEGERS, ids=str)
def test_an_integer_type_holds_what_its_bytes_hold(kind: IntType) -> None:
    size, signed, name = INTEGERS[kind]
    assert (kind.size, kind.signed, str(kind), kind.scalar) == (size, signed, name, True)
    assert [kind.wrap(value) for value in EDGES] == [converted(value, size, signed) for value in EDGES]
    held = [value for value in EDGES if kind.wrap(value) == value]
    assert (kind.low, kind.high) == (held[0], held[-1]) == type_interval(kind)


def test_a_bool_holds_whether_a_number_is_0_and_a_bit_its_lowest_bit() -> None:
    assert [BOOL.wrap(value) for value in (-1, 0, 1, 2, 256)] == [1, 0, 1, 1, 1]
    assert [BIT.wrap(value) for value in (-1, 0, 1, 2, 3, 256)] == [1, 0, 1, 0, 1, 0]
    for kind in (BOOL, BIT):
        assert (kind.size, kind.low, kind.high, type_interval(kind)) == (1, 0, 1, (0, 1))


def test_other_types_have_their_sizes() -> None:
    """A pointer to RAM is a byte; one to const has two, since it may lead to flash."""
    const = IntType("unsigned char", 1, False, const=True)
    both = IntType("unsigned char", 1, False, const=True, volatile=True)
    assert [
        PointerType(kind).size for kind in (U8, U32, const, both, ArrayType(const, 3), PointerType(const))
    ] == [
        1, 1, 2, 1, 2, 1,
    ]  # fmt: skip
    assert [kind.size for kind in (VOID, F24, F32, ArrayType(S24, 5), ArrayType(U8, None))] == [
        1, 3, 4, 15, 0,
    ]  # fmt: skip
    assert FuncType(VOID, ()).size == 1
    assert [kind.scalar for kind in (F24, PointerType(VOID), VOID, ArrayType(U8, 1))] == [
        True,
        True,
        False,
        False,
    ]
    assert (F24.bits, F24.sign_bit, F32.bits, F32.sign_bit) == (U24, 0x800000, U32, 0x80000000)
    assert type_interval(PointerType(const)) == (0, 65535)
    assert type_interval(F24) == (0, 0xFFFFFF)
    assert type_interval(VOID) == (0, 0)


def structure(
    tag: str = "s",
    size: int | None = 2,
    *,
    union: bool = False,
    parts: tuple[Member, ...] = (Member("a", U8, 0),),
) -> StructType:
    layout = StructLayout(tag, union, {part.name: part for part in parts}, list(parts), size)
    return StructType(layout)


CONST_U8 = qualified(U8, const=True, volatile=False)


def test_types_are_written_as_c_declares_them() -> None:
    written = {
        qualified(U8, const=True, volatile=True): "const volatile unsigned char",
        PointerType(CONST_U8): "const unsigned char *",
        PointerType(PointerType(S16)): "int * *",
        PointerType(U8, const=True): "unsigned char *const",
        PointerType(FuncType(S16, (U8, S32))): "int (*)(unsigned char, long)",
        PointerType(FuncType(VOID, None)): "void (*)()",
        FuncType(U8, (S16, PointerType(U8))): "unsigned char(int, unsigned char *)",
        ArrayType(ArrayType(S16, None), 3): "int[3][]",
        F24: "float",
        VOID: "void",
    }
    assert {kind: str(kind) for kind in written} == written
    assert str(structure("point")) == "struct point"
    assert str(qualified(structure("u", union=True), const=False, volatile=True)) == "volatile union u"


def test_qualifiers_are_added_and_taken_off() -> None:
    volatile = qualified(U8, const=False, volatile=True)
    assert (CONST_U8.const, CONST_U8.volatile, volatile.const, volatile.volatile) == (
        True,
        False,
        False,
        True,
    )
    assert qualified(volatile, const=True, volatile=False) == qualified(U8, const=True, volatile=True)
    assert [kind.plain() for kind in (CONST_U8, volatile, U8)] == [U8, U8, U8]
    assert U8.plain() is U8
    assert qualified(U8, const=False, volatile=False) is U8
    inner = qualified(ArrayType(ArrayType(U8, 2), 3), const=True, volatile=False)
    assert inner == ArrayType(ArrayType(CONST_U8, 2), 3)
    assert not inner.const
    assert [is_const_object(kind) for kind in (inner, CONST_U8, volatile, U8, PointerType(CONST_U8))] == [
        True, True, False, False, False,
    ]  # fmt: skip
    assert not is_const_object(qualified(U8, const=True, volatile=True))
    inside = structure(parts=(Member("a", U8, 0), Member("b", ArrayType(volatile, 1), 1)))
    assert [holds_volatile(kind) for kind in (volatile, U8, ArrayType(volatile, 2), inside, structure())] == [
        True, False, True, True, False,
    ]  # fmt: skip
    assert holds_volatile(structure(parts=(Member("s", inside, 0),)))


def node_type() -> StructType:
    """Return `struct node { struct node *next; }`, each call another one."""
    kind = structure("node", 1, parts=())
    kind.layout.parts.append(Member("next", PointerType(kind), 0))
    return kind


A = Member("a", U8, 0)
CLASSES: list[list[CType]] = [
    # types of one list are compatible (ISO C 6.2.7, 6.7.6), those of different lists are not
    [U8, CONST_U8, IntType("byte", 1, False)], [S8], [U16, C2C_INT], [S16, C2C_SIGNED], [U24], [S32],
    [BOOL, BIT], [F24],
    [F32, qualified(F32, const=True, volatile=False)],
    [VOID],
    [PointerType(U8), PointerType(U8, const=True)],
    [PointerType(S8)], [PointerType(CONST_U8)], [PointerType(PointerType(U8))],
    [PointerType(PointerType(CONST_U8))], [ArrayType(U8, 3)], [ArrayType(U8, 4)], [ArrayType(S8, 3)],
    [structure(), structure()], [structure("t")], [structure(union=True)], [structure(size=3)],
    [structure(parts=(A, Member("b", U8, 1)))], [structure(parts=(Member("c", U8, 0),))],
    [structure(parts=(Member("a", U8, 1),))], [structure(parts=(Member("a", S8, 0),))],
    [structure(parts=(Member("a", U8, 0, 0, 3),))],
    [structure(parts=(Member("a", U8, 0, 1, 3),))],
    [structure(parts=(Member("a", U8, 0, 0, 4),))],
    [node_type(), node_type()], [FuncType(U8, (S16,))], [FuncType(U8, (U16,))], [FuncType(U8, (S16, S16))],
    [FuncType(S8, (S16,))], [FuncType(U8, ())],
]  # fmt: skip


def test_types_are_compatible_exactly_as_iso_c_says() -> None:
    every = [(number, kind) for number, kinds in enumerate(CLASSES) for kind in kinds]
    for (one, left), (two, right) in product(every, every):
        assert same(left, right) is (one == two), f"{left} and {right}"
    unknown = FuncType(U8, None)
    assert [same(unknown, FuncType(U8, (S16,))), same(FuncType(U8, ()), unknown)] == [True, True]
    assert not same(unknown, FuncType(S8, None))
    incomplete = ArrayType(U8, None)
    assert same(incomplete, ArrayType(U8, 3))
    assert same(ArrayType(U8, 3), incomplete)
    assert not same(incomplete, ArrayType(S8, 3))


def test_pointers_that_lead_to_const_on_one_side_only_are_found_wherever_they_stand() -> None:
    plain, const = PointerType(U8), PointerType(CONST_U8)
    wraps: list[Callable[[CType], CType]] = [
        lambda kind: kind,
        PointerType,
        lambda kind: ArrayType(kind, 2),
        lambda kind: FuncType(kind, ()),
        lambda kind: FuncType(VOID, (S16, kind)),
    ]
    for outer, inner in product(wraps, wraps):
        one, two = outer(inner(plain)), outer(inner(const))
        assert differs_in_const(one, two)
        assert differs_in_const(two, one)
        assert not differs_in_const(one, one)
        assert not differs_in_const(two, two)
    for kind in (plain, ArrayType(plain, 2), FuncType(plain, ())):
        assert [differs_in_const(U8, kind), differs_in_const(kind, U8)] == [False, False]
    assert not differs_in_const(FuncType(VOID, None), FuncType(VOID, (const,)))


# the arithmetic conversions


@pytest.mark.parametrize("c2c", [False, True])
def test_the_usual_arithmetic_conversions_of_all_pairs(c2c: bool) -> None:
    """ISO C 6.3.1.1 and 6.3.1.8 with ranks by size. In C2C, where `int` has no sign, a byte keeps its own."""
    kinds = [U8, S8, U16, S16, U24, S24, U32, S32, BOOL, BIT, C2C_INT, C2C_SIGNED]

    def promotion(kind: IntType) -> tuple[int, bool]:
        return (2, kind.signed or not c2c) if kind.size == 1 else (kind.size, kind.signed)

    for left, right in product(kinds, kinds):
        one, two = promotion(left), promotion(right)
        expected = (
            max(one, two, key=lambda each: each[0])
            if one[0] != two[0]
            else (one[0], one[1] and two[1])  # of equal rank the one without sign wins
        )
        found = common(left, right, c2c=c2c)
        assert (found.size, found.signed) == expected, f"{left} and {right}"
        assert found.size == 2 or found in (left, right)
    for kind in kinds:
        found = promote(kind, c2c=c2c)
        assert (found.size, found.signed) == promotion(kind)
        assert found is kind or kind.size == 1
    assert str(promote(U8, c2c=c2c)) == "int"


SPELLINGS = {
    # without a sign: bytes in XC8 and SDCC, bytes in C2C, whose int and long have 16 bits
    "char": (1, 1), "short": (2, 2), "short int": (2, 2), "int short": (2, 2), "int": (2, 2),
    "short long": (3, 3), "short long int": (3, 3), "long short": (3, 3), "long": (4, 2), "long int": (4, 2),
    "int long": (4, 2),
}  # fmt: skip


@pytest.mark.parametrize("dialect", [C2C, XC8, SDCC])
@pytest.mark.parametrize("words", SPELLINGS)
def test_every_spelling_of_an_integer_type(words: str, dialect: str) -> None:
    """`char` has no sign in all three; in C2C the types of 16 bits have none either unless they say so."""
    size = SPELLINGS[words][dialect == C2C]
    bare_is_signed = words != "char" and not (dialect == C2C and size == 2)
    for text, signed in ((words, bare_is_signed), (f"signed {words}", True), (f"unsigned {words}", False)):
        for order in (text.split(), text.split()[::-1]):
            found = int_type(tuple(order), dialect)
            assert found is not None
            assert (found.size, found.signed, found.is_bool) == (size, signed, False), text


def test_words_that_are_not_a_type() -> None:
    for words in (
        "signed unsigned",
        "signed unsigned int",
        "char int",
        "long long",
        "",
        "float",
        "signed bool",
    ):
        assert int_type(tuple(words.split()), XC8) is None, words
    assert int_type(("_Bool",), XC8) is BOOL
    for dialect, size in ((XC8, 2), (C2C, 2)):
        for sign in ("signed", "unsigned"):
            found = int_type((sign,), dialect)
            assert found is not None
            assert (found.size, found.signed) == (size, sign == "signed")


# constant arithmetic

OPERATORS: dict[str, Callable[[int, int], int]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "&": operator.and_,
    "|": operator.or_,
    "^": operator.xor,
    "/": lambda left, right: int(abs(left) // abs(right)) * (-1 if left * right < 0 else 1),
    "%": lambda left, right: abs(left) % abs(right) * (-1 if left < 0 else 1),
}


@pytest.mark.parametrize("kind", [*INTEGERS, BOOL], ids=str)
def test_constants_are_computed_as_c_does(kind: IntType) -> None:
    """ISO C 6.5: quotients rounded towards zero, remainders with the dividend's sign, results that wrap."""
    values = [value for value in EDGES if kind.low <= value <= kind.high] + [
        kind.low // 3,
        kind.high // 3,
        5 % (kind.high + 1),
    ]
    for op, left, right in product(OPERATORS, values, values):
        if op in "/%" and right == 0:
            assert fold(op, left, right, kind) is None
            continue
        exact = OPERATORS[op](left, right)
        expected = int(exact != 0) if kind.is_bool else converted(exact, kind.size, kind.signed)
        assert fold(op, left, right, kind) == expected, f"{left} {op} {right}"


def test_shifts_of_constants_count_in_one_byte() -> None:
    assert [fold("<<", 3, count, U16) for count in (0, 1, 15, 16, 256, 257)] == [3, 6, 0x8000, 0, 3, 6]
    assert [fold(">>", -256, count, S16) for count in (0, 1, 8, 255, 260)] == [-256, -128, -1, -1, -16]
    assert fold("<<", 1, 15, S16) == -32768
    with pytest.raises(ValueError, match="&&"):
        fold("&&", 1, 1, S16)


def test_comparisons_and_their_mirror_images() -> None:
    meanings = {
        "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq,
        "!=": operator.ne,
    }  # fmt: skip
    assert meanings.keys() == COMPARISONS
    for op, left, right in product(meanings, range(-1, 2), range(-1, 2)):
        assert compare(op, left, right) is bool(meanings[op](left, right))
        assert compare(MIRRORED[op], right, left) is compare(op, left, right)


# the values that an expression can have

BITS = {kind: Symbol("s" if kind.signed else "u", kind, "global") for kind in (U8, S8)}
"""Variables with a bit-field of two bits: its values are few enough to try all."""


def field(kind: IntType) -> Ref:
    return Ref(BITS[kind], 0, None, kind, HERE, 0, 2)


def values_of(expr: Expr, given: tuple[int, ...]) -> list[int]:
    """Return the value of an expression of two leaves, as a list; empty where it has none."""
    match expr:
        case Num(value):
            return [value]
        case Ref():
            return [given[0]]
        case Cast(operand):
            assert isinstance(expr.type, IntType)
            return [expr.type.wrap(value) for value in values_of(operand, given)]
        case Unary(op, operand):
            assert isinstance(expr.type, IntType)
            changes: dict[str, Callable[[int], int]] = {
                "-": operator.neg,
                "~": operator.invert,
                "!": operator.not_,
            }
            return [expr.type.wrap(int(changes[op](value))) for value in values_of(operand, given)]
        case Binary(op, left, right):
            one, two = values_of(left, given[:1]), values_of(right, given[1:])
            assert isinstance(expr.type, IntType)
            if op in COMPARISONS:
                return [int(compare(op, a, b)) for a in one for b in two]
            results = [fold(op, a, b, expr.type) for a in one for b in two]
            return [value for value in results if value is not None]
    raise AssertionError(expr)


TIGHT = ("+", "-", "*")
"""Operators of which the ends are reached: each grows or falls with each operand."""


@pytest.mark.parametrize("kind", [S8, S16, U8], ids=str)
@pytest.mark.parametrize("op", ["+", "-", "*", "&", "|", "^", "/", "%", "<<", ">>", *sorted(COMPARISONS)])
def test_every_value_of_an_operator_lies_in_its_interval(op: str, kind: IntType) -> None:
    """All values of two bit-fields of two bits are tried, also negated, inverted and moved."""

    def leaves(side: IntType) -> list[Expr]:
        work = Cast(field(side), kind, HERE)
        return [
            work,
            Unary("-", work, kind, HERE),
            Binary("+", work, Num(3, kind, HERE), kind, HERE),
            Num(2, kind, HERE),
        ]

    small = {U8: range(4), S8: range(-2, 2)}
    for one, two in product((U8, S8), (U8, S8)):
        for left, right in product(leaves(one), leaves(two)):
            expr = Binary(op, left, right, kind, HERE)
            found = [value for given in product(small[one], small[two]) for value in values_of(expr, given)]
            low, high = interval(expr)
            assert low <= min(found)
            assert max(found) <= high
            signed_fits = kind.signed or (
                one == two == U8
                and op != "-"
                and not isinstance(left, Unary)
                and not isinstance(right, Unary)
            )
            if op in TIGHT and signed_fits:
                assert (low, high) == (min(found), max(found)), f"{left} {op} {right}"


def ref(kind: CType, **fields: object) -> Ref:
    return Ref(Symbol("x", kind, "global"), 0, None, kind, HERE, **fields)  # type: ignore[arg-type]


def num(value: int, kind: IntType = S16) -> Num:
    return Num(value, kind, HERE)


def two(op: str, left: Expr, right: Expr, kind: IntType = S16) -> Binary:
    return Binary(op, left, right, kind, HERE)


BYTE: Expr = Cast(ref(U8), S16, HERE)
SMALL: Expr = two("&", BYTE, num(15))
"""0 … 15."""
SIGNED: Expr = Cast(ref(S8), S16, HERE)
INTERVALS: list[tuple[Expr, tuple[int, int]]] = [
    (num(-7), (-7, -7)), (ref(U8), (0, 255)), (ref(S16), (-32768, 32767)), (ref(U8, bit=2, width=3), (0, 7)),
    (ref(S8, bit=0, width=3), (-4, 3)),
    (Deref(ref(PointerType(U8)), 0, U8, HERE, 0, 5), (0, 31)),
    (Deref(ref(PointerType(U8)), 0, U8, HERE), (0, 255)),
    (BYTE, (0, 255)), (Cast(ref(S16), U8, HERE), (0, 255)), (Cast(SMALL, U8, HERE), (0, 15)),
    (Cast(SIGNED, U8, HERE), (0, 255)), (Cast(SIGNED, U16, HERE), (0, 65535)),
    (Cast(num(9), BOOL, HERE), (0, 1)), (Unary("!", BYTE, S16, HERE), (0, 1)),
    (Unary("-", BYTE, S16, HERE), (-255, 0)),
    (Unary("-", ref(S16), S16, HERE), (-32768, 32767)),
    (Unary("-", SMALL, U16, HERE), (0, 65535)),
    (Unary("~", BYTE, S16, HERE), (-32768, 32767)),
    (Logic("&&", BYTE, BYTE, S16, HERE), (0, 1)), (two("<", BYTE, BYTE), (0, 1)),
    (two("+", BYTE, BYTE), (0, 510)),
    (two("+", ref(S16), num(1)), (-32768, 32767)),
    (two("-", BYTE, SMALL), (-15, 255)),
    (two("-", ref(U16), num(1), U16), (0, 65535)),
    (two("*", SIGNED, SMALL), (-1920, 1905)), (two("*", SIGNED, SIGNED), (-16256, 16384)),
    (two("*", BYTE, BYTE), (-32768, 32767)), (two("&", SIGNED, SMALL), (0, 15)),
    (two("&", SMALL, SIGNED), (0, 15)), (two("&", BYTE, SMALL), (0, 15)),
    (two("&", SIGNED, SIGNED), (-32768, 32767)), (two("|", SMALL, num(16)), (0, 31)),
    (two("|", SMALL, num(15)), (0, 15)), (two("^", SMALL, BYTE), (0, 255)),
    (two("^", SIGNED, BYTE), (-32768, 32767)), (two("|", BYTE, SIGNED), (-32768, 32767)),
    (two("/", BYTE, num(10)), (0, 25)),
    (two("/", two("+", SMALL, num(32)), two("+", SMALL, num(2))), (1, 23)),
    (two("/", SIGNED, num(2)), (-32768, 32767)), (two("/", BYTE, num(1)), (0, 255)),
    (two("%", BYTE, num(1)), (0, 0)), (two("/", BYTE, SMALL), (-32768, 32767)),
    (two("%", BYTE, num(10)), (0, 9)), (two("%", SMALL, num(100)), (0, 15)),
    (two("%", SIGNED, num(10)), (-32768, 32767)), (two("%", BYTE, SMALL), (-32768, 32767)),
    (two(">>", BYTE, num(2)), (0, 63)), (two(">>", SIGNED, num(2)), (-32, 31)),
    (two(">>", BYTE, SMALL), (0, 255)), (two(">>", SIGNED, SMALL), (-32768, 32767)),
    (two(">>", SIGNED, num(-1)), (-32768, 32767)),
    (two("<<", SMALL, num(2)), (0, 60)), (two("<<", SIGNED, num(2)), (-512, 508)),
    (two("<<", SMALL, num(0)), (0, 15)), (two("<<", SMALL, num(12)), (-32768, 32767)),
    (two("<<", num(1), num(31), U32), (1 << 31, 1 << 31)),
    (two("<<", num(0), num(32), U32), (0, 0xFFFFFFFF)),
    (two("<<", num(1), SMALL), (-32768, 32767)),
    (Choice(BYTE, SMALL, num(-3), S16, HERE), (-3, 15)),
    (Choice(BYTE, num(20), SMALL, S16, HERE), (0, 20)),
    (Comma(BYTE, SMALL, S16, HERE), (0, 15)),
    (Assign(ref(U8), Cast(SMALL, U8, HERE), U8, HERE), (0, 15)),
    (Assign(ref(U8, bit=0, width=2), ref(U8), U8, HERE), (0, 3)),
    (Assign(ref(S8), SMALL, S8, HERE), (0, 15)),
    (Update("+", ref(U8), num(1), S16, False, U8, HERE), (0, 255)),
    (Call("f", [], U8, HERE), (0, 255)),
]  # fmt: skip


@pytest.mark.parametrize(("expr", "expected"), INTERVALS)
def test_the_interval_of_an_expression(expr: Expr, expected: tuple[int, int]) -> None:
    assert interval(expr) == expected


# effects

QUIET: Expr = ref(U8)
VOLATILE: Expr = Ref(Symbol("v", U8, "global", volatile=True), 0, None, U8, HERE)
LOUD: Expr = Call("f", [], U8, HERE)
ADDRESS = AddressOf(ref(U8), PointerType(U8), HERE)


def shapes(inner: Expr) -> list[Expr]:
    """Return expressions with one operand each; the others have no effect."""
    indexed = Ref(Symbol("a", ArrayType(U8, 3), "global"), 0, inner, U8, HERE)
    return [
        inner, indexed, Deref(inner, 0, U8, HERE), Cast(inner, S16, HERE), Unary("-", inner, S16, HERE),
        *(kind("+", *pair, S16, HERE) for kind in (Binary, Logic) for pair in ((inner, QUIET), (QUIET,
            inner))),
        Comma(inner, QUIET, U8, HERE), Comma(QUIET, inner, U8, HERE), Choice(inner, QUIET, QUIET, U8, HERE),
        Choice(QUIET, inner, QUIET, U8, HERE), Choice(QUIET, QUIET, inner, U8, HERE),
        Builtin("float_add", [QUIET, inner], F32, HERE),
        AddressOf(indexed, PointerType(U8), HERE),
    ]  # fmt: skip


def test_an_expression_has_an_effect_where_an_operand_has_one() -> None:
    for kind, one in enumerate(zip(shapes(QUIET), shapes(LOUD), shapes(VOLATILE), strict=True)):
        assert [has_effect(expr) for expr in one] == [False, True, True], kind
    assert [has_effect(expr) for expr in (num(1), ADDRESS)] == [False, False]
    assert has_effect(Builtin("nop", [], VOID, HERE))
    assert has_effect(Assign(ref(U8), QUIET, U8, HERE))
    assert has_effect(Update("+", ref(U8), QUIET, S16, False, U8, HERE))
    volatile = qualified(U8, const=False, volatile=True)
    assert has_effect(Ref(Symbol("x", U8, "global"), 0, None, volatile, HERE))
    assert has_effect(Deref(QUIET, 0, volatile, HERE))


def test_the_nodes_of_a_tree_come_in_the_order_of_the_text() -> None:
    call = Call("f", [num(1), two("+", num(2), num(3))], U8, HERE)
    tree = Choice(num(0), call, Unary("-", num(4), S16, HERE), S16, HERE)
    assert [node.value for node in nodes([tree, (num(5),)]) if isinstance(node, Num)] == [0, 1, 2, 3, 4, 5]
    assert [type(node).__name__ for node in expressions(tree)] == [
        "Choice", "Num", "Call", "Num", "Binary", "Num", "Num", "Unary", "Num",
    ]  # fmt: skip
    assert list(expressions(None)) == []
