"""Bit-fields of 9 to 15 bits, and objects in the EEPROM: their expressions carried out on bytes."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product

from servogen.compiler.ast.constant_folding import COMPARISONS, compare, fold
from servogen.compiler.ast.nodes import (
    AddressOf,
    Assign,
    Binary,
    Builtin,
    Cast,
    Comma,
    Deref,
    Expr,
    ExprStmt,
    Num,
    Ref,
    Symbol,
)
from servogen.compiler.ast.types import IntType
from tests.compiler.cases import every
from tests.compiler.marked import diagnostics, found_in, stated
from tests.compiler.test_sema_expressions_lvalues_conversions import analysed


@dataclass
class Memory:
    """Carries out expressions on the bytes of the RAM and of the EEPROM."""

    places: dict[str, int]
    """Where each variable begins."""
    ram: bytearray = field(default_factory=lambda: bytearray(128))
    eeprom: bytearray = field(default_factory=lambda: bytearray(64))

    def start(self, symbol: Symbol) -> int:
        """Return where a variable begins; one that the compiler adds is behind those of the program."""
        return self.places.setdefault(symbol.name, 64 + 4 * len(self.places))

    def address(self, target: Expr) -> int:
        if isinstance(target, Deref):
            return self.value(target.pointer) + target.offset
        assert isinstance(target, Ref)
        index = self.value(target.index) if target.index is not None else 0
        return self.start(target.symbol) + target.offset + index

    def value(self, expr: Expr) -> int:
        match expr:
            case Num(value):
                return value
            case Ref() | Deref():
                assert not expr.width
                at, signed = self.address(expr), isinstance(expr.type, IntType) and expr.type.signed
                return int.from_bytes(self.ram[at : at + expr.type.size], "little", signed=signed)
            case AddressOf(target):
                return self.address(target)
            case Cast(operand):
                return self.converted(self.value(operand), expr)
            case Binary(op, left, right):
                one, two = self.value(left), self.value(right)
                if op in COMPARISONS:
                    return int(compare(op, one, two))
                result = fold(op, one, two, expr.type) if isinstance(expr.type, IntType) else one + two
                assert result is not None
                return result
            case Comma(first, second):
                self.value(first)
                return self.value(second)
            case Assign(target, value):
                size = target.type.size
                given = (self.value(value) & (1 << 8 * size) - 1).to_bytes(size, "little")
                at = self.address(target)
                self.ram[at : at + size] = given
                return self.value(target)
            case Builtin("eeprom_read", [address]):
                return self.eeprom[self.value(address)]
            case Builtin("eeprom_write", [address, value]):
                self.eeprom[self.value(address)] = self.value(value)
                return 0
        raise AssertionError(expr)

    def converted(self, value: int, expr: Expr) -> int:
        return expr.type.wrap(value) if isinstance(expr.type, IntType) else value


def statements(text: str, dialect: str = "xc8") -> list[Expr]:
    """Return the expressions of a function `run`."""
    body = analysed(f"{text}\nvoid main(void) {{ run(); }}", dialect).program.functions["run"].body
    assert body is not None
    return [each.expr for each in body.body if isinstance(each, ExprStmt)]


WIDTHS = range(9, 16)
GIVEN = (1, -1, 0x5555, -32768)
Change = Callable[[int, int], int]
CHANGES: dict[str, tuple[Change, bool]] = {
    # what happens to the field w, from its value and i; whether the value of the whole goes to r
    "{0} = i;": (lambda w, i: i, False), "{0} = 257;": (lambda w, i: 257, False),
    "{0} = -2;": (lambda w, i: -2, False), "r = ({0} = i);": (lambda w, i: i, True),
    "r = ({0} = 20000);": (lambda w, i: 20000, True),
    "r = ({0} = -300);": (lambda w, i: -300, True),
    "r = {0};": (lambda w, i: w, True), "{0} += i;": (lambda w, i: w + i, False),
    "r = {0} -= 3;": (lambda w, i: w - 3, True), "{0} |= i;": (lambda w, i: w | i, False),
    "r = ++{0};": (lambda w, i: w + 1, True), "r = --{0};": (lambda w, i: w - 1, True),
    "{0} >>= 1;": (lambda w, i: w >> 1, False), "{0} <<= 3;": (lambda w, i: w << 3, False),
}  # fmt: skip


def wrapped(value: int, width: int, signed: bool) -> int:
    value %= 1 << width
    return value - (1 << width) if signed and value >= 1 << width - 1 else value


@every("dialect", ["xc8", "c2c"])
@every("signed", [False, True])
def test_a_wide_field_is_stored_between_its_neighbours_and_read_back(dialect: str, signed: bool) -> None:
    """ISO C 6.3.1.3 and 6.5.16: what does not fit wraps, and the value of an assignment is the field's."""
    sign = "signed" if signed else "unsigned"
    parts = "".join(
        f"unsigned char before{n}; {sign} w{n} : {n}; unsigned rest{n} : {16 - n};\n" for n in WIDTHS
    )
    text = f"int i, r; unsigned char k; struct s {{ {parts} }} o[2], *p;\nvoid run(void) {{\n"
    rows = [
        (width, where, form)
        for width, where, form in product(WIDTHS, ("o[1].w", "o[k].w", "p->w", "o[0].w"), CHANGES)
        if where == "o[1].w" or form in list(CHANGES)[3:7]
    ]
    lines = [form.format(f"{where}{width}") for width, where, form in rows]
    found = statements(text + "\n".join(lines) + "}", dialect)
    for (width, where, form), expr in zip(rows, found, strict=True):
        start = (0 if where == "o[0].w" else 3 * len(WIDTHS)) + 3 * (width - 9)
        for before, given in product(((1 << width - 1) - 1, 1 << width - 1), GIVEN):
            memory = Memory({"o": 0, "i": 60, "r": 62, "k": 58, "p": 56}, bytearray(range(100, 228)))
            rest = 0b1010101 & (1 << 16 - width) - 1
            memory.ram[start + 1 : start + 3] = (before | rest << width).to_bytes(2, "little")
            memory.ram[56], memory.ram[58] = 3 * len(WIDTHS), 1
            memory.ram[60:62] = struct.pack("<h", given)
            expected = memory.ram[:64]
            change, kept = CHANGES[form]
            value = wrapped(change(wrapped(before, width, signed), given), width, signed)
            expected[start + 1 : start + 3] = (value % (1 << width) | rest << width).to_bytes(2, "little")
            if kept:
                expected[62:64] = struct.pack("<h", value)
            memory.value(expr)
            assert memory.ram[:64] == expected, f"{where}{width}: {form} with {before} and {given}"


EEPROM = """
__eeprom unsigned char c; __eeprom signed char s; __eeprom int n; __eeprom long l; __eeprom int a[3];
__eeprom struct { unsigned char x; int y[2]; } z[2]; int i, r; unsigned char k;
"""
OBJECTS = {
    # how an object is named: where it begins, its form
    "c": (0, "<B"), "s": (1, "<b"), "n": (2, "<h"), "l": (4, "<i"), "a[0]": (8, "<h"), "a[2]": (12, "<h"),
    "a[k]": (10, "<h"), "z[0].x": (14, "<B"), "z[1].y[1]": (22, "<h"), "z[k].x": (19, "<B"),
    "z[k].y[k]": (22, "<h"),
}  # fmt: skip
COUNTED: dict[str, Change] = {
    # what becomes of an object, from its value and i; r gets the value of the whole
    "r = {0};": lambda value, i: value,
    "r = ({0} = i);": lambda value, i: i,
    "r = ({0} = 100);": lambda value, i: 100,
    "r = ({0} += i);": lambda value, i: value + i,
    "r = ++{0};": lambda value, i: value + 1,
    "r = {0}++;": lambda value, i: value + 1,
    "r = {0}--;": lambda value, i: value - 1,
}


def test_an_object_in_the_eeprom_is_read_and_written_byte_by_byte() -> None:
    rows = list(product(OBJECTS, COUNTED))
    lines = "\n".join(form.format(name) for name, form in rows)
    found = statements(f"{EEPROM}void run(void) {{\n{lines}}}")
    for (name, form), expr in zip(rows, found, strict=True):
        start, shape = OBJECTS[name]
        size, signed = struct.calcsize(shape), shape != "<B"
        for given in (3, -300, 0x7FFF):
            memory = Memory({"i": 60, "r": 62, "k": 58}, eeprom=bytearray(range(0x7D, 0x7D + 64)))
            memory.ram[58], memory.ram[60:62] = 1, struct.pack("<h", given)
            (before,) = struct.unpack_from(shape, memory.eeprom, start)
            after = wrapped(COUNTED[form](before, given), 8 * size, signed)
            expected = bytearray(memory.eeprom)
            struct.pack_into(shape, expected, start, after)
            memory.value(expr)
            assert memory.eeprom == expected, f"{name}: {form}"
            value = before if form in ("r = {0}++;", "r = {0}--;") else after
            assert memory.ram[62:64] == (value % 65536).to_bytes(2, "little"), f"{name}: {form}"


TWICE = (
    "error c-unsupported: the address of this object would be computed twice, and computing it has a side "
    "effect // compute the index in a statement of its own"
)


@every(
    ("text", "said"),
    [
        ("o[i++].w = 5;", []), ("‸o[i++].w += 5;", [TWICE]), ("‸o[i++].w++;", [TWICE]),
        ("‸o[v].w += 5;", [TWICE]), ("o[i].w += 5;", []), ("p->w += 5;", []), ("(‸p++)->w += 5;", [TWICE]),
        ("(p + i)->w++;", []), ("‸e[i++] += 5;", [TWICE]), ("--‸e[v];", [TWICE]), ("e[i] += 5;", []),
        ("e[2] += 5;", []), ("e[i++] = 5;", []), ("n += 5;", []),
    ],
)  # fmt: skip
def test_an_object_that_an_operator_reads_and_stores_is_found_only_once(text: str, said: list[str]) -> None:
    head = (
        "__eeprom unsigned char e[3], n; struct { unsigned w : 9; } o[3], *p = o; char i; volatile char v;\n"
    )
    marked = f"{head}void main(void) {{ {text} }}"
    assert found_in(marked) == stated(marked, said)


@every("text", ["a = *‸e;", "p = (char *)‸e;", "a = ‸s->x;", "p = a ? ‸e : p;", "p = &‸e[1];"])
def test_nothing_points_into_the_eeprom(text: str) -> None:
    head = "__eeprom struct { char x; } s[2]; __eeprom char e[3]; char a, *p;"
    marked = f"{head} void main(void) {{ {text} }}"
    assert found_in(marked) == stated(marked, ["error c-unsupported: there are no pointers into the EEPROM"])


@every("text", ["o.w = y", "y = f", "f += 1", "e = y"])
def test_what_stores_is_not_a_constant(text: str) -> None:
    head = "int y; float f; struct { unsigned w : 9; } o; __eeprom char e;\n"
    messages = [each.message for each in diagnostics(f"{head}int x = ({text});\nvoid main(void) {{ }}")]
    assert messages == ["the initialiser must be a constant"]
