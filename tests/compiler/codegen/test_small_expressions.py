"""Conditions and operators of every integer type by themselves, against the arithmetic of Python.

The code of one expression is executed for operands at the ends of their types; the library's routines are
the true ones.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from itertools import product
from types import SimpleNamespace
from typing import Any

from servogen.compiler.ast.nodes import (
    GREATER,
    AddressByte,
    Assign,
    Binary,
    BlockStatement,
    Builtin,
    CaseLabel,
    Cast,
    Choice,
    Deref,
    Expr,
    ExprStmt,
    Jump,
    Logic,
    Num,
    Ref,
    Stmt,
    Switch,
    Symbol,
    Unary,
    Update,
)
from servogen.compiler.ast.types import (
    BIT,
    BOOL,
    S8,
    S16,
    S32,
    U8,
    U16,
    U32,
    ArrayType,
    FloatType,
    IntType,
    PointerType,
)
from servogen.compiler.codegen.expressions import effect, into
from servogen.compiler.codegen.float_routines import FLOAT_ROUTINES, build_float
from servogen.compiler.codegen.generator import Context, FunctionGenerator
from servogen.compiler.codegen.program import LOWERING
from servogen.compiler.codegen.routines import Routines
from servogen.compiler.codegen.runtime import build
from servogen.compiler.codegen.statements import statement
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import FSR, INDF, Byte, Instruction, Loc
from servogen.errors import Location
from tests.compiler.cases import every
from tests.compiler.codegen.routines import Library
from tests.compiler.float_reference import binary, from_integer, square_root, to_integer
from tests.compiler.ir.assembly import Chip

AT = Location("main.c", 1)
TYPES = (U8, S8, U16, S16, U32, S32)
COMPARISONS = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt,
    ">=": operator.ge,
}  # fmt: skip


def divided(left: int, right: int) -> int:
    """The quotient rounded towards zero (ISO C 6.5.5)."""
    return abs(left) // abs(right) * (1 if (left < 0) == (right < 0) else -1)


OPERATORS: dict[str, Callable[[int, int], int]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": divided, "%": lambda left,
    right: left - right * divided(left, right), "&": operator.and_, "|": operator.or_, "^": operator.xor,
    "<<": operator.lshift, ">>": operator.rshift,
}  # fmt: skip


def wrapped(value: int, kind: IntType) -> int:
    """A number as a type holds it."""
    value &= (1 << 8 * kind.size) - 1
    return value - (1 << 8 * kind.size) if kind.signed and value > kind.high else value


def numbers(kind: IntType) -> list[int]:
    """The ends of a type, and numbers of which a byte is 0 or 255."""
    found = {
        0, 1, kind.high, kind.high - 1, kind.low, kind.low + 1, 100, -2, -100, 0x80, 0xFF, 0x100, 0x1200,
        0x12FF,
    }  # fmt: skip
    return sorted({wrapped(value, kind) for value in found})


def variable(name: str, kind: IntType) -> Ref:
    return Ref(Symbol(name, kind, "global"), 0, None, kind, AT)


def _build(kind: str, *given: Any) -> None:
    """Write a routine of either kind."""
    (build_float if kind in FLOAT_ROUTINES else build)(kind, *given)


class Code:
    """What a generator emits for an expression of variables, with the routines that it calls."""

    def __init__(self, emit: Callable[[FunctionGenerator], object]) -> None:
        self.function = Function("f")
        self.library = Library(_build)
        context = Context(
            signature=lambda name: self.function,
            symbol_map=lambda symbol: symbol,
            library=self.library,
            routines=Routines([]),
            asm_symbols={},
            reporter=Reporter(),
            isr=False,
        )
        definition: Any = SimpleNamespace(name="f", place=AT)
        emit(FunctionGenerator(definition, context, LOWERING))

    def run(self, values: dict[Symbol, int]) -> Chip:
        chip = Chip({"f": self.function} | self.library.functions)
        chip.w, chip.c, chip.z = 0xA5, True, True
        for routine in self.library.functions.values():
            for symbol in routine.own:
                chip.store(symbol, 0xC3C3C3C3, symbol.size)
        for symbol in self.function.own:
            chip.store(symbol, 0x3C3C3C3C, symbol.size)
        for symbol, value in values.items():
            chip.store(symbol, value, symbol.size)
        chip.call("f")
        return chip


def condition(expr: Expr, *, sense: bool) -> Code:
    """Code that counts in W whether a condition has the truth value `sense`."""

    def emit(gen: FunctionGenerator) -> None:
        gen.lower.jump(gen, expr, sense, "yes")
        gen.emit("RETLW", k=0)
        gen.label("yes")
        gen.emit("RETLW", k=1)

    return Code(emit)


@every("kind", TYPES)
@every("op", COMPARISONS)
def test_comparisons_with_constants(op: str, kind: IntType) -> None:
    x = variable("x", kind)
    bounds = {
        bound + step for bound in (0, 1, 0x80, 0xFF, 0x1234, kind.low, kind.high) for step in (-1, 0, 1)
    }
    for at, bound in enumerate(sorted(bounds)):
        constant = Num(bound, S32 if bound <= S32.high else U32, AT)
        swapped, sense = bool(at & 1), bool(at & 2)
        left, right = (constant, x) if swapped else (x, constant)
        made = condition(Binary(op, left, right, U8, AT), sense=sense)
        for value in {*numbers(kind), *(wrapped(bound + step, kind) for step in (-1, 0, 1))}:
            one, two = (bound, value) if swapped else (value, bound)
            assert made.run({x.symbol: value}).w == (COMPARISONS[op](one, two) == sense), (bound, value)


@every(("left", "right"), [*product((U8, S8, U16, S16), repeat=2), (U32, U8), (S32, S16), (U32, U32)])
@every("op", ["==", "<", "<=", ">", "!="])
def test_comparisons_of_two_variables(op: str, left: IntType, right: IntType) -> None:
    x, y = variable("x", left), variable("y", right)
    made = condition(Binary(op, x, y, U8, AT), sense=left.signed)
    for one, two in product(numbers(left)[::3], numbers(right)[::2]):
        assert made.run({x.symbol: one, y.symbol: two}).w == (COMPARISONS[op](one, two) == left.signed)


@every("kind", TYPES)
def test_tests_of_bits_and_of_zero(kind: IntType) -> None:
    x, work = variable("x", kind), max((S16, kind), key=lambda each: (each.size, not each.signed))
    masks = {1, 0x80, 0x81, kind.high, 0xFF, 0x100 & kind.high, 1 << 8 * kind.size - 2, 0x300 & kind.high, 0}
    for mask, swapped, sense in product(masks, (False, True), (False, True)):
        constant, wide = Num(mask, work, AT), Cast(x, work, AT)
        left, right = (constant, wide) if swapped else (wide, constant)
        masked = Binary("&", left, right, work, AT)
        plain = condition(masked, sense=sense)
        whole = condition(Binary("==", masked, constant, U8, AT), sense=sense)
        for value in numbers(kind):
            assert plain.run({x.symbol: value}).w == (bool(value & mask) == sense)
            assert whole.run({x.symbol: value}).w == ((value & mask == mask) == sense)
    made = condition(Unary("!", x, U8, AT), sense=True)
    narrow = condition(Cast(x, U8, AT), sense=True)
    for value in numbers(kind):
        assert made.run({x.symbol: value}).w == (value == 0)
        assert narrow.run({x.symbol: value}).w == (value & 0xFF != 0)


@every("kind", [U8, S8, U16])
@every("op", "+-")
def test_a_variable_is_counted_and_tested(op: str, kind: IntType) -> None:
    x = variable("x", kind)
    for post, sense in product((False, True), repeat=2):
        expr = Update(op, x, Num(1, kind, AT), kind, post=post, type=kind, place=AT)
        made = condition(expr, sense=sense)
        for value in numbers(kind):
            chip = made.run({x.symbol: value})
            after = value + (1 if op == "+" else -1) & (1 << 8 * kind.size) - 1
            assert chip.number(x.symbol, kind.size) == after
            tested = value if post else after
            assert chip.w == (bool(tested) == sense), (value, post, sense)


def stored(expr: Expr, target: Ref, size: int) -> Code:
    return Code(lambda gen: into(gen, expr, [Byte(target.symbol, at) for at in range(size)]))


@every(
    ("left", "right"), [(U8, U8), (S8, U8), (S8, S8), (U16, U8), (S16, S8), (U16, U16), (S16, S16), (S32, U8)]
)
@every("op", OPERATORS)
def test_an_operator_of_two_variables(op: str, left: IntType, right: IntType) -> None:
    """In the type of C's usual conversions, extended to four bytes or cut to one."""
    work = max((S16, left, right), key=lambda kind: (kind.size, not kind.signed))
    x, y, result = variable("x", left), variable("y", right), variable("result", U32)
    one, two = (Cast(each, work, AT) for each in (x, y))
    expr = Binary(op, one, y if op in ("<<", ">>") else two, work, AT)
    codes = {size: stored(expr, result, size) for size in (1, work.size, 4)}
    for a, b in product(numbers(left)[::3], numbers(right)[::2]):
        if (op in "/%" and b == 0) or (op in ("<<", ">>") and not 0 <= b < 8 * work.size):
            continue
        exact = OPERATORS[op](wrapped(a, work), b if op in ("<<", ">>") else wrapped(b, work))
        if work.signed and not work.low <= exact <= work.high:
            continue  # undefined in C
        for size, made in codes.items():
            found = made.run({x.symbol: a, y.symbol: b, result.symbol: 0x55555555})
            assert found.number(result.symbol, size) == wrapped(exact, work) & (1 << 8 * size) - 1, (
                a,
                b,
                size,
            )


CONSTANTS = (1, 2, 3, 6, 7, 8, 10, 100, 128, 129, 255, 256, 257, 1000, 4096, -1, -8, -100)


@every("kind", [U8, S8, U16, S16, U32])
@every("op", OPERATORS)
def test_an_operator_of_a_variable_and_a_constant(op: str, kind: IntType) -> None:
    work = max((S16, kind), key=lambda each: (each.size, not each.signed))
    x, result = variable("x", kind), variable("result", U32)
    shifts = op in ("<<", ">>")
    for at, constant in enumerate((0, 1, 4, 7, 8, 9, 15) if shifts else CONSTANTS):
        number = wrapped(constant, work)
        expr = Binary(op, Cast(x, work, AT), Num(number, work, AT), work, AT)
        codes = {size: stored(expr, result, size) for size in (work.size, 4 if at % 2 else 1)}
        for value in numbers(kind)[at % 3 :: 3]:
            exact = OPERATORS[op](wrapped(value, work), number)
            if work.signed and not work.low <= exact <= work.high:
                continue
            for size, made in codes.items():
                found = made.run({x.symbol: value, result.symbol: 0x55555555}).number(result.symbol, size)
                assert found == wrapped(exact, work) & (1 << 8 * size) - 1, (constant, value, size)


@every("kind", [U8, S8, U16, S16, U32])
@every("op", OPERATORS)
def test_a_variable_is_changed_in_place(op: str, kind: IntType) -> None:
    work = max((S16, kind), key=lambda each: (each.size, not each.signed))
    x, y = variable("x", kind), variable("y", kind)
    for value in (y, Num(1, work, AT), Num(7, work, AT), x):
        expr = Update(op, x, value, work, post=False, type=kind, place=AT)
        made = Code(lambda gen, expr=expr: effect(gen, expr))  # type: ignore[misc]
        for a, b in product(numbers(kind)[::3], (1, 3, 6)):
            second = a if value is x else value.value if isinstance(value, Num) else b
            if (op in "/%" and second == 0) or (op in ("<<", ">>") and not 0 <= second < 8 * work.size):
                continue
            exact = OPERATORS[op](wrapped(a, work), second if op in ("<<", ">>") else wrapped(second, work))
            found = made.run({x.symbol: a, y.symbol: b})
            if not work.signed or work.low <= exact <= work.high:
                assert found.number(x.symbol, kind.size) == exact & (1 << 8 * kind.size) - 1, (a, second)
                assert found.number(y.symbol, kind.size) == b


@every("kind", [U8, S8])
@every(
    ("bit", "width"),
    [(bit, width) for width in range(1, 8) for bit in (0, 1, 4, 8 - width) if bit + width <= 8],
)
def test_a_bit_field_is_read_and_written_between_its_neighbours(bit: int, width: int, kind: IntType) -> None:
    byte, y, result = Symbol("x", U8, "global"), variable("y", U8), variable("result", U32)
    field = Ref(byte, 0, None, kind, AT, bit=bit, width=width)
    mask = (1 << width) - 1

    def value(bits: int) -> int:
        """The bits as a number; the highest one is the sign of a signed field."""
        bits &= mask
        return bits - (mask + 1) if kind.signed and bits >> width - 1 else bits

    reads = {size: stored(field, result, size) for size in (1, 2, 4)}
    other: Expr = Cast(y, BIT, AT) if width == 1 and kind is U8 else y
    again = stored(Assign(field, other, kind, AT), result, 2)
    for before, number in ((0x00, 0xFF), (0xFF, 0x00), (0xA5, 0x5A), (0x5A, 0x01), (0x3C, 0x92)):
        given = {byte: before, y.symbol: number, result.symbol: 0x55555555}
        for size, made in reads.items():
            found = made.run(given)
            assert found.number(result.symbol, size) == value(before >> bit) & (1 << 8 * size) - 1
            assert found.number(byte, 1) == before
        after = before & ~(mask << bit) & 0xFF | (number & mask) << bit
        constant: Expr = Num(value(number), kind, AT)
        for assigned in (constant, other):
            made = Code(lambda gen, assigned=assigned: effect(gen, Assign(field, assigned, kind, AT)))  # type: ignore[misc]
            assert made.run(given).number(byte, 1) == after
        # the value of the assignment is what the field holds
        found = again.run(given)
        assert (found.number(byte, 1), found.number(result.symbol, 2)) == (after, value(number) & 0xFFFF)
        for op in "+-^":
            expr = Update(op, field, Num(1, S16, AT), S16, post=True, type=kind, place=AT)
            found = stored(expr, result, 2).run(given)
            changed = OPERATORS[op](value(before >> bit), 1)
            expected = before & ~(mask << bit) & 0xFF | (changed & mask) << bit
            if width == 1 and kind is U8 and op != "^":
                continue  # sema makes a conversion to a bit of these
            assert (found.number(byte, 1), found.number(result.symbol, 2)) == (
                expected,
                value(before >> bit) & 0xFFFF,
            )


@every("kind", TYPES)
def test_conversions_and_operators_of_one_variable(kind: IntType) -> None:
    x, result = variable("x", kind), variable("result", U32)
    work = max((S16, kind), key=lambda each: (each.size, not each.signed))
    conversions = {to: stored(Cast(x, to, AT), result, 4) for to in TYPES}
    truths = {size: stored(Cast(x, BOOL, AT), result, size) for size in (1, 3)}
    bit = stored(Cast(x, BIT, AT), result, 1)
    negation = stored(Unary("!", x, S16, AT), result, 2)
    in_place = Code(lambda gen: effect(gen, Assign(x, Unary("!", x, S16, AT), kind, AT)))
    for value in numbers(kind):
        given = {x.symbol: value, result.symbol: 0x55555555}
        for to, made in conversions.items():
            assert made.run(given).number(result.symbol, 4) == wrapped(value, to) & 0xFFFFFFFF, (
                value,
                to.name,
            )
        for size, made in truths.items():
            assert made.run(given).number(result.symbol, size) == (value != 0)
        assert bit.run(given).number(result.symbol, 1) == value & 1
        assert negation.run(given).number(result.symbol, 2) == (value == 0)
        assert in_place.run(given).number(x.symbol, kind.size) == (value == 0)
    for op, law in (("-", operator.neg), ("~", operator.invert)):
        expr = Unary(op, Cast(x, work, AT), work, AT)
        codes = {size: stored(expr, result, size) for size in (1, work.size, 4)}
        changed = Code(lambda gen, expr=expr: effect(gen, Assign(x, Cast(expr, kind, AT), kind, AT)))  # type: ignore[misc]
        for value in numbers(kind):
            exact = law(wrapped(value, work))
            if work.signed and exact > work.high:
                continue
            given = {x.symbol: value, result.symbol: 0x55555555}
            for size, made in codes.items():
                found = made.run(given).number(result.symbol, size)
                assert found == wrapped(exact, work) & (1 << 8 * size) - 1, (op, value, size)
            assert changed.run(given).number(x.symbol, kind.size) == exact & (1 << 8 * kind.size) - 1


@every(("kind", "other"), [(U8, S8), (S8, U16), (U16, S16), (S16, U8)])
def test_a_chosen_value_is_extended_with_its_own_sign(kind: IntType, other: IntType) -> None:
    x, y, result = variable("x", kind), variable("y", other), variable("result", U32)
    work = max((S16, kind, other), key=lambda each: (each.size, not each.signed))
    choice = Choice(Binary("<", x, Num(100, S16, AT), U8, AT), Cast(x, work, AT), Cast(y, work, AT), work, AT)
    both = Logic("&&", x, y, S16, AT)
    either = Logic("||", x, Binary("==", y, Num(1, S16, AT), U8, AT), S16, AT)
    made = {size: stored(choice, result, size) for size in (1, 2, 4)}
    for a, b in product(numbers(kind)[::2], numbers(other)[::2]):
        given = {x.symbol: a, y.symbol: b, result.symbol: 0x55555555}
        for size, code in made.items():
            chosen = wrapped(a if a < 100 else b, work)
            assert code.run(given).number(result.symbol, size) == chosen & (1 << 8 * size) - 1
    for expr, law in ((both, lambda a, b: a and b), (either, lambda a, b: a or b == 1)):
        code = stored(expr, result, 2)
        own = Code(lambda gen, expr=expr: effect(gen, Assign(x, expr, kind, AT)))  # type: ignore[misc]
        for sense in (False, True):
            tested = condition(expr, sense=sense)
            for a, b in product((0, 1, -1, 0x80), (0, 1, 2, 0x100)):
                one, two = wrapped(a, kind), wrapped(b, other)
                given = {x.symbol: one, y.symbol: two, result.symbol: 0x55555555}
                truth = bool(law(one, two))
                assert tested.run(given).w == (truth == sense)
                assert code.run(given).number(result.symbol, 2) == truth
                assert own.run(given).number(x.symbol, kind.size) == truth


@every("kind", TYPES)
@every("with_default", [False, True])
def test_a_switch_goes_to_the_case_of_its_value(with_default: bool, kind: IntType) -> None:
    x, result = variable("x", kind), variable("result", U8)
    values = [0, 1, 0x80, 0xFF, 0x100, -1, 0x1234, 0x12FF, -0x8000]
    for cases in (values, values[::-1], values[1:], [0x100], [70_000]):
        labels = [(case, CaseLabel(AT)) for case in cases]
        default = CaseLabel(AT) if with_default else None
        body: list[Stmt] = []
        for number, label in enumerate([*(label for _, label in labels), *([default] if default else [])], 1):
            store = ExprStmt(Assign(result, Num(number, U8, AT), U8, AT))
            body += [label, store, Jump("break", "", AT)]
        node = Switch(x, labels, default, BlockStatement(body), AT)
        made = Code(lambda gen, node=node: statement(gen, node))  # type: ignore[misc]
        for value in {*numbers(kind), *(wrapped(case, kind) for case in cases)}:
            found = made.run({x.symbol: value, result.symbol: 0}).number(result.symbol, 1)
            expected = cases.index(value) + 1 if value in cases else len(cases) + 1 if with_default else 0
            assert found == expected, (cases, value)


class Memory(Chip):
    """A chip on which FSR leads to the variables, which lie one behind the other from `FIRST` on."""

    FIRST = 0x20

    def __init__(self, functions: dict[str, Function], symbols: list[Symbol]) -> None:
        super().__init__(functions)
        self.at: dict[int, Byte] = {}
        self.addresses: dict[Symbol, int] = {}
        for symbol in symbols:
            self.addresses[symbol] = self.FIRST + len(self.at)
            self.at |= {self.FIRST + len(self.at) + at: Byte(symbol, at) for at in range(symbol.size)}
        for function in functions.values():
            for ins in function.instructions():
                if isinstance(ins.k, AddressByte):
                    ins.k = self.addresses[ins.k.symbol] + ins.k.offset

    def read(self, loc: Loc | None) -> int:
        return super().read(self.at[self.memory[FSR]] if loc == INDF else loc)

    def _write(self, ins: Instruction, value: int, *, to_file: bool) -> None:
        if to_file and ins.f == INDF:
            self.memory[self.at[self.memory[FSR]]] = value
        else:
            super()._write(ins, value, to_file=to_file)


@every("form", ["element", "pointer", "member"])
@every("kind", [U8, S8, U16, S16, U32])
def test_an_object_behind_an_address_is_read_and_changed(kind: IntType, form: str) -> None:
    work = max((S16, kind), key=lambda each: (each.size, not each.signed))
    table = Symbol("a", ArrayType(kind, 3), "global", pinned=True)
    i, y, result = variable("i", U8), variable("y", S8), variable("result", U32)
    p = Ref(Symbol("p", PointerType(kind), "global"), 0, None, PointerType(kind), AT)
    index = Binary("*", i, Num(kind.size, U8, AT), U8, AT)
    target: Ref | Deref = {
        "element": Ref(table, 0, index, kind, AT),
        "pointer": Deref(p, 0, kind, AT),
        "member": Deref(p, kind.size, kind, AT),
    }[form]
    size = kind.size
    one, wide = Num(1, work, AT), Cast(y, work, AT)
    effects: dict[str, tuple[Expr, Callable[[int, int], int]]] = {
        "= y": (Assign(target, y, kind, AT), lambda old, y: y),
        "= y + 1": (Assign(target, Binary("+", wide, one, work, AT), kind, AT), lambda old, y: y + 1),
        "= 0x1234": (Assign(target, Num(0x1234, work, AT), kind, AT), lambda old, y: 0x1234),
        "= x - y": (Assign(target, Binary("-", target, wide, work, AT), kind, AT), operator.sub),
    }
    for op, law in OPERATORS.items():
        if op in "+-&|^":
            expr = Update(op, target, y, work, post=False, type=kind, place=AT)
            effects[f"{op}= y"] = expr, law
        expr = Update(op, target, Num(3, work, AT), work, post=False, type=kind, place=AT)
        effects[f"{op}= 3"] = expr, lambda old, y, law=law: law(wrapped(old, work), 3)
    for post, op in product((False, True), "+-"):
        effects[f"{op}{post}"] = (
            Update(op, target, one, work, post=post, type=kind, place=AT),
            (lambda old, y, op=op: OPERATORS[op](old, 1)),
        )
    for name, (expr, law) in effects.items():
        for used in (False, True):
            made = stored(expr, result, 4) if used else Code(lambda gen, expr=expr: effect(gen, expr))  # type: ignore[misc]
            for old, other in ((0, 1), (kind.high, -1), (wrapped(0x12FF, kind), 2), (kind.low, 100)):
                functions = {"f": made.function} | made.library.functions
                chip = Memory(functions, [table, i.symbol, y.symbol, p.symbol, result.symbol])
                for each in functions.values():
                    for symbol in each.own:
                        chip.store(symbol, 0x3C3C3C3C, symbol.size)
                field = ((1 << 8 * size) - 1) << 8 * size
                before = 0xA1B2C3D4E5F60718293A4B5C & (1 << 24 * size) - 1 & ~field | old << 8 * size & field
                chip.store(table, before, 3 * size)
                chip.store(i.symbol, 1, 1)
                chip.store(y.symbol, other, 1)
                chip.store(p.symbol, chip.addresses[table] + (0 if form == "member" else size), 1)
                chip.store(result.symbol, 0x55555555, 4)
                chip.call("f")
                exact = law(old, other)
                new = wrapped(exact, kind)
                if work.signed and not work.low <= exact <= work.high:
                    continue
                found = chip.number(table, 3 * size)
                assert found & ~field == before & ~field, (name, hex(found))
                assert found & field == new << 8 * size & field, (name, old, other)
                if used:
                    expected = old if getattr(expr, "post", False) else new
                    assert chip.number(result.symbol, 4) == expected & 0xFFFFFFFF, (name, old, other)


@every("volatile", [False, True])
@every("kind", [U8, S8, U16, S16, U32])
def test_a_variable_is_assigned_what_reads_it(kind: IntType, volatile: bool) -> None:
    work = max((S16, kind), key=lambda each: (each.size, not each.signed))
    x, y = variable("x", kind), variable("y", kind)
    x.symbol.volatile = volatile
    one, two = Cast(x, work, AT), Cast(y, work, AT)

    def of(op: str, left: Expr, right: Expr) -> Expr:
        return Binary(op, left, right, work, AT)

    def num(value: int) -> Num:
        return Num(value, work, AT)

    laws: dict[str, tuple[Expr, Callable[[int, int], int]]] = {
        "y - x": (of("-", two, one), lambda x, y: y - x),
        "y + x": (of("+", two, one), lambda x, y: y + x),
        "5 - x": (of("-", num(5), one), lambda x, y: 5 - x),
        "x - (x + y)": (of("-", one, of("+", one, two)), lambda x, y: -y),
        "(x & y) - (x ^ y)": (of("-", of("&", one, two), of("^", one, two)), lambda x, y: (x & y) - (x ^ y)),
        "~x + y": (of("+", Unary("~", one, work, AT), two), lambda x, y: ~x + y),
        "-x": (Unary("-", one, work, AT), lambda x, y: -x),
        "x >> 3 | x << 2": (of("|", of(">>", one, num(3)), of("<<", one, num(2))), lambda x,
            y: x >> 3 | x << 2),
        "(y << 1) + x": (of("+", of("<<", two, num(1)), one), lambda x, y: (y << 1) + x),
        "x < y": (Binary("<", x, y, S16, AT), lambda x, y: x < y),
        "x == y ? y - 1 : x": (Choice(Binary("==", x, y, U8, AT), of("-", two, num(1)), one, work, AT),
            lambda x, y: y - 1 if x == y else x),
        "(unsigned char)x + y": (of("+", Cast(Cast(x, U8, AT), work, AT), two), lambda x, y: (x & 0xFF) + y),
        "y - (unsigned char)x": (of("-", two, Cast(Cast(x, U8, AT), work, AT)), lambda x, y: y - (x & 0xFF)),
    }  # fmt: skip
    for name, (expr, law) in laws.items():
        value = expr if kind == work else Cast(expr, kind, AT)
        made = Code(lambda gen, value=value: effect(gen, Assign(x, value, kind, AT)))  # type: ignore[misc]
        for a, b in product(numbers(kind)[::3], numbers(kind)[1::4]):
            exact = int(law(a, b)) if name == "x < y" else law(wrapped(a, work), wrapped(b, work))
            found = made.run({x.symbol: a, y.symbol: b})
            assert found.number(x.symbol, kind.size) == exact & (1 << 8 * kind.size) - 1, (name, a, b)
            assert found.number(y.symbol, kind.size) == b & (1 << 8 * kind.size) - 1


@every("size", [1, 2, 3, 4])
def test_products_that_are_shifts_and_one_sum_need_no_routine(size: int) -> None:
    """A power of two, or two bits of the lowest four; of wider values, shifts would be longer than a call."""
    x, result = variable("x", U32), variable("result", U32)
    for factor in range(1, 40):
        short = factor.bit_count() == 1 or (factor.bit_count() == 2 and factor <= 12 and size <= 2)
        for swapped in (False, True):
            number = Num(factor, U32, AT)
            left, right = (number, x) if swapped else (x, number)
            made = stored(Binary("*", left, right, U32, AT), result, size)
            assert (not made.library.functions) == short, factor
            found = made.run({x.symbol: 0x12345678, result.symbol: 0})
            assert found.number(result.symbol, size) == 0x12345678 * factor & (1 << 8 * size) - 1


FLOATS = {"+": "float_add", "-": "float_subtract", "*": "float_multiply", "/": "float_divide"}


@every("size", [3, 4])
def test_operations_on_floats_in_every_order(size: int) -> None:
    """An operand may lie where the next routine wants it, at the other place, or come from a routine."""
    kind, width = FloatType(size), 8 * size
    stored_bits = width - 9
    names = {name: Ref(Symbol(name, kind, "global"), 0, None, kind, AT) for name in "xyz"}
    a, b, result = variable("a", U8), variable("b", U8), variable("result", U32)
    times = Binary("*", Cast(a, S16, AT), Cast(b, S16, AT), S16, AT)
    whole = Builtin("float_from_integer", [times], kind, AT, data=True)
    bits = {
        "x": 127 << stored_bits,
        "y": 129 << stored_bits | 0x155,
        "z": 1 << width - 1 | 130 << stored_bits,
    }
    integer = from_integer(200 * 7, width)

    def node(op: str, left: Expr, right: Expr) -> Expr:
        return Builtin(FLOATS[op], [left, right], kind, AT)

    def law(op: str, left: int, right: int) -> int:
        found = binary(op, left, right, width)
        assert found is not None
        return found

    x, y, z = names["x"], names["y"], names["z"]
    vx, vy, vz = bits["x"], bits["y"], bits["z"]
    for one, two in product(FLOATS, repeat=2):
        forms: list[tuple[Expr, int]] = [
            (node(two, node(one, x, y), z), law(two, law(one, vx, vy), vz)),
            (node(two, z, node(one, x, y)), law(two, vz, law(one, vx, vy))),
            (node(two, node(one, x, y), node(one, z, y)), law(two, law(one, vx, vy), law(one, vz, vy))),
            (node(two, whole, node(one, y, z)), law(two, integer, law(one, vy, vz))),
            (node(two, node(one, y, z), whole), law(two, law(one, vy, vz), integer)),
            (node(two, node(one, whole, x), whole), law(two, law(one, integer, vx), integer)),
        ]
        for number, (expr, expected) in enumerate(forms):
            made = stored(expr, result, size)
            given = {names[name].symbol: each for name, each in bits.items()}
            found = made.run(given | {a.symbol: 200, b.symbol: 7, result.symbol: 0})
            assert found.number(result.symbol, size) == expected, (one, two, number)
    root = Builtin("float_square_root", [node("*", y, y)], kind, AT)
    to_int = Builtin("float_to_integer", [node("-", whole, y)], S32, AT)
    order = Builtin("float_compare", [node("-", x, y), z], U8, AT)
    given = {names[name].symbol: each for name, each in bits.items()}
    given |= {a.symbol: 200, b.symbol: 7, result.symbol: 0x55555555}
    squared = square_root(law("*", vy, vy), width)
    assert stored(root, result, size).run(given).number(result.symbol, size) == squared
    exact = to_integer(law("-", integer, vy), width)
    for length in (1, 2, 4):
        found = stored(to_int, result, length).run(given)
        assert found.number(result.symbol, length) == exact & (1 << 8 * length) - 1
    long = variable("long", S32)
    for number in (0x12345678, -70_000, 5, -(1 << 31)):
        converted = Builtin("float_from_integer", [long], kind, AT, data=True)
        found = stored(converted, result, size).run({long.symbol: number, result.symbol: 0})
        assert found.number(result.symbol, size) == from_integer(number, width)
    # 1 - 4.04 is greater than -8: the outcome is in W, and extended with zeros
    assert stored(order, result, 2).run(given).number(result.symbol, 2) == GREATER
