"""The floating-point routines by themselves at the ends of the formats, and how often their loops turn."""

from __future__ import annotations

import random
from itertools import product

import pytest

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


def special(width: int) -> list[int]:
    """Zero, denormals, the least normal value, 1, infinity and what is not a number, of both signs."""
    stored = width - 9
    infinity = 255 << stored
    sizes = (0, 1, (1 << stored) - 1, 1 << stored, 127 << stored, infinity, infinity + 1, infinity + 0x100)
    return [size | sign << width - 1 for size in sizes for sign in (0, 1)]


def ties(width: int) -> list[tuple[int, int]]:
    """Numbers and about half a unit in their last place, in both orders and with all signs."""
    stored = width - 9
    one, half = 127 << stored, 126 - stored << stored
    numbers = (one, one + 1, one + (1 << stored) - 1)
    pairs = [(number, half + more) for number in numbers for more in (-1, 0, 1)]
    signs = [(left << width - 1, right << width - 1) for left, right in product((0, 1), repeat=2)]
    both = [(a | left, b | right) for a, b in pairs for left, right in signs]
    return [*both, *((b, a) for a, b in both)]


@pytest.mark.campaign
@every("size", [3, 4])
@every(("kind", "op"), [("float_add", "+"), ("float_multiply", "*"), ("float_divide", "/")])
def test_two_operands(kind: str, op: str, size: int) -> None:
    library = FloatLibrary()
    routine = library(kind, (size,))
    value, other = shared(library, size).value, second_operand(library, size)
    assert isinstance(value[0], Byte) and isinstance(other[0], Byte)
    pairs = (
        *product(some(8 * size), some(8 * size)[::3]),
        *product(special(8 * size), repeat=2),
        *(ties(8 * size) if op == "+" else ()),
    )
    for left, right in pairs:
        chip = library.chip()
        chip.store(value[0].symbol, left, size)
        chip.store(other[0].symbol, right, size)
        library.called(chip, routine.name)
        found = canonical(chip.number(value[0].symbol, size), 8 * size)
        assert found == binary(op, left, right, 8 * size), (hex(left), hex(right))


def mantissas(size: int, op: str) -> list[tuple[int, int]]:
    """Of each kind one pair whose product or quotient has 0x80 below its last place: even or odd, with more
    below that or, of products, exactly half a unit.
    """
    bits = 8 * (size - 1)
    dice = random.Random(size)
    found: dict[tuple[int, bool], tuple[int, int]] = {}
    while len(found) < (4 if op == "*" else 2):
        # a product of factors with this many zeros ends where half a unit in the last place is
        zeros = dice.choice(((0, 0), (bits // 2, bits - 1 - bits // 2))) if op == "*" else (0, 0)
        left, right = (dice.randrange(1 << bits - 1 - each, 1 << bits - each) << each for each in zeros)
        if op == "*":
            exact = left * right
            exact <<= 2 * bits - exact.bit_length()
            whole, rest = divmod(exact, 1 << bits - 8)
        else:
            whole, rest = divmod(left << bits + 7 + (left < right), right)
        if whole & 0xFF == 0x80:
            found[whole >> 8 & 1, rest != 0] = left, right
    return list(found.values())


@every("size", [3, 4])
@every(("kind", "op"), [("float_multiply", "*"), ("float_divide", "/")])
def test_what_lies_far_below_the_last_place_decides_at_a_half(kind: str, op: str, size: int) -> None:
    library = FloatLibrary()
    routine = library(kind, (size,))
    stored = 8 * size - 9
    value, other = shared(library, size).value, second_operand(library, size)
    assert isinstance(value[0], Byte) and isinstance(other[0], Byte)
    for pair in mantissas(size, op):
        left, right = (127 << stored | mantissa & (1 << stored) - 1 for mantissa in pair)
        chip = library.chip()
        chip.store(value[0].symbol, left, size)
        chip.store(other[0].symbol, right, size)
        library.called(chip, routine.name)
        assert chip.number(value[0].symbol, size) == binary(op, left, right, 8 * size), (
            hex(left),
            hex(right),
        )


@every("size", [3, 4])
@every(
    ("kind", "left", "right"),
    [
        ("float_add", "infinity", "-infinity"), ("float_add", "1", "other"),
        ("float_multiply", "0", "infinity"), ("float_divide", "0", "0"), ("float_divide", "other", "1"),
        ("float_square_root", "-infinity", ""), ("float_square_root", "other", ""),
    ],
)  # fmt: skip
def test_what_is_not_a_number_has_one_form(kind: str, left: str, right: str, size: int) -> None:
    """The greatest exponent and the highest bit of the mantissa, as IEEE 754 recommends for a quiet NaN."""
    stored = 8 * size - 9
    infinity = 255 << stored
    numbers = {
        "": 0, "0": 0, "1": 127 << stored, "infinity": infinity, "-infinity": infinity | 1 << 8 * size - 1,
        "other": infinity + 0x0100,
    }  # fmt: skip
    library = FloatLibrary()
    routine = library(kind, (size,))
    chip = library.chip()
    operands = [shared(library, size).value, *([second_operand(library, size)] if right else [])]
    for (byte, *_), number in zip(operands, (left, right), strict=False):
        assert isinstance(byte, Byte)
        chip.store(byte.symbol, numbers[number], size)
    library.called(chip, routine.name)
    assert routine.result is not None
    assert chip.number(routine.result, size) == infinity | 1 << stored - 1


@every("size", [3, 4])
def test_routines_take_and_leave_the_shared_value(size: int) -> None:
    library = FloatLibrary()
    byte = shared(library, size).value[0]
    assert isinstance(byte, Byte)
    kinds = ("pack", "nan", "add", "multiply", "divide", "square_root")
    routines = [library(f"float_{kind}", (size,)) for kind in kinds]
    for each in (*routines, library("float_from_integer", (size, 2, 0))):
        assert (each.result, each.parameters, each.returns_w) == (byte.symbol, [byte.symbol], False)
    order = library("float_compare", (size,))
    assert (order.result, order.parameters, order.returns_w) == (None, [byte.symbol], True)


@every("size", [3, 4])
def test_the_bytes_that_each_routine_needs_itself(size: int) -> None:
    """Beside the value, its guard byte, the exponent's high byte and the sign, which all of them share."""
    library = FloatLibrary()
    expected = {
        ("float_pack", size): size + 3,
        ("float_nan", size): 0,
        ("float_unpack", size): size,  # the second operand
        ("float_add", size): 2,  # the first operand's sign, the second one's guard byte
        ("float_multiply", size): size - 2 + 1,  # the low bytes of the product, a counter
        ("float_divide", size): size - 1,  # the remainder
        ("float_compare", size): 1,  # the first operand's sign
        ("float_to_integer", size): size + 2 + (0 if size == 4 else 4),  # the operand, its sign, a counter
        ("float_from_integer", size, 2, 1): 0,
        ("float_from_integer", size, 4, 1): 4 - size,  # what the mantissa and the guard byte do not hold
        ("float_square_root", size): size - 1 + 2 * size + 1,  # radicand; remainder, trial; a counter
    }
    for kind, *key in expected:
        library(str(kind), tuple(int(each) for each in key))
    assert all(each.blocks[-1].last.op in ("RETURN", "RETLW", "GOTO") for each in library.functions.values())
    found = {name: sum(symbol.size for symbol in each.own) for name, each in library.functions.items()}
    assert found == {"_".join(map(str, key)): count for key, count in expected.items()}


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
    for left, right in (*product(some(8 * size), repeat=2), *product(special(8 * size), repeat=2)):
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
    lost = [bits for bits in (8, 16) if bits < 8 * length - 1]
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
        # half a unit in the last place of an even and an odd number, and more than that
        *(top + (odd << bits) + (1 << bits - 1) + more for bits in lost for odd in (0, 1) for more in (0, 1)),
    ):
        chip = library.chip()
        chip.memory.update({byte: number >> 8 * at & 0xFF for at, byte in enumerate(places)})
        library.called(chip, routine.name)
        expected = number - 2 * top if signed and number >= top else number
        symbol = registers.value[0]
        assert isinstance(symbol, Byte) and number < 2 * top
        assert chip.number(symbol.symbol, size) == from_integer(expected, 8 * size), number
