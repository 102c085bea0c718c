"""The floating-point routines by themselves at the ends of the formats, and how often their loops turn."""

from __future__ import annotations

from itertools import product

from servogen.compiler.ast.nodes import EQUAL, GREATER, LESS
from servogen.compiler.codegen.float_routines import build_float, integer_places, second_operand, shared
from servogen.compiler.ir.instruction import Byte
from tests.compiler.cases import every
from tests.compiler.codegen.routines import Library
from tests.compiler.float_reference import (
    binary,
    canonical,
    edges,
    from_integer,
    relation,
    square_root,
    to_integer,
)
from tests.compiler.ir.assembly import Chip


class FloatLibrary(Library):
    """The floating-point routines of one program."""

    def __init__(self) -> None:
        super().__init__(build_float)

    def chip(self) -> Chip:
        chip = Chip(self.functions)
        for each in self.functions.values():
            for symbol in each.own:
                chip.store(symbol, 0xC3C3C3C3, symbol.size)
        return chip

    def called(self, chip: Chip, name: str) -> None:
        """Call a routine; no loop turns more often than its bound says."""
        chip.call(name)
        for each in self.functions.values():
            assert all(chip.passed[label] <= bound for label, bound in each.bounds.items()), each.name


def some(width: int) -> list[int]:
    """Every third of the values at which something changes."""
    return edges(width)[::3]


@every("size", [3, 4])
@every(("kind", "op"), [("float_add", "+"), ("float_multiply", "*"), ("float_divide", "/")])
def test_two_operands(kind: str, op: str, size: int) -> None:
    library = FloatLibrary()
    routine = library(kind, (size,))
    value, other = shared(library, size).value, second_operand(library, size)
    assert isinstance(value[0], Byte) and isinstance(other[0], Byte)
    for left, right in product(some(8 * size), some(8 * size)[::3]):
        chip = library.chip()
        chip.store(value[0].symbol, left, size)
        chip.store(other[0].symbol, right, size)
        library.called(chip, routine.name)
        found = canonical(chip.number(value[0].symbol, size), 8 * size)
        assert found == binary(op, left, right, 8 * size), (hex(left), hex(right))


@every("size", [3, 4])
def test_a_product_takes_a_turn_for_each_bit(size: int) -> None:
    library = FloatLibrary()
    routine = library("float_multiply", (size,))
    one = 127 << 8 * size - 9
    chip = library.chip()
    for byte in (shared(library, size).value[0], second_operand(library, size)[0]):
        assert isinstance(byte, Byte)
        chip.store(byte.symbol, one, size)
    library.called(chip, routine.name)
    assert [chip.passed[label] for label in routine.bounds if ".loop." in label] == [8 * (size - 1)]
    assert [bound for label, bound in routine.bounds.items() if ".loop." in label] == [8 * (size - 1)]


@every("size", [3, 4])
def test_an_order(size: int) -> None:
    library = FloatLibrary()
    routine = library("float_compare", (size,))
    value, other = shared(library, size).value[0], second_operand(library, size)[0]
    assert isinstance(value, Byte) and isinstance(other, Byte) and routine.returns_w
    for left, right in product(some(8 * size), repeat=2):
        chip = library.chip()
        chip.store(value.symbol, left, size)
        chip.store(other.symbol, right, size)
        library.called(chip, routine.name)
        orders = (("<", LESS), ("==", EQUAL), (">", GREATER))
        expected = sum(code for op, code in orders if relation(op, left, right, 8 * size))
        assert chip.w == expected, (hex(left), hex(right))


@every("size", [3, 4])
def test_roots_and_integers(size: int) -> None:
    library = FloatLibrary()
    root, whole = library("float_square_root", (size,)), library("float_to_integer", (size,))
    value = shared(library, size).value[0]
    assert isinstance(value, Byte) and whole.result is not None
    for bits in edges(8 * size):
        chip = library.chip()
        chip.store(value.symbol, bits, size)
        library.called(chip, root.name)
        assert canonical(chip.number(value.symbol, size), 8 * size) == square_root(bits, 8 * size), hex(bits)
        chip = library.chip()
        chip.store(whole.parameters[0], bits, size)
        if bits >> 8 * size - 9 & 0xFF < 127 + 40:
            library.called(chip, whole.name)
            assert chip.number(whole.result, 4) == to_integer(bits, 8 * size), hex(bits)


@every("size", [3, 4])
@every(("length", "signed"), [(2, 0), (2, 1), (3, 1), (4, 0), (4, 1)])
def test_from_an_integer(length: int, signed: int, size: int) -> None:
    library = FloatLibrary()
    routine = library("float_from_integer", (size, length, signed))
    registers = shared(library, size)
    extra = [Byte(symbol, 0) for symbol in routine.own if symbol.name == "extra"]
    places = integer_places(registers, list(extra), length)
    assert len(places) == length and bool(extra) == (length > size)
    top = 1 << 8 * length - 1
    for number in (
        0,
        1,
        2,
        255,
        256,
        top - 1,
        top,
        top + 1,
        2 * top - 1,
        2 * top - 256,
        top // 3,
        top // 2 - 1,
    ):
        chip = library.chip()
        chip.memory.update({byte: number >> 8 * at & 0xFF for at, byte in enumerate(places)})
        library.called(chip, routine.name)
        expected = number - 2 * top if signed and number >= top else number
        symbol = registers.value[0]
        assert isinstance(symbol, Byte)
        assert chip.number(symbol.symbol, size) == from_integer(expected, 8 * size), number
