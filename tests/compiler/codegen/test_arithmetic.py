"""Sums, differences, bitwise operations, shifts and comparisons of one to four bytes: values and words."""

from __future__ import annotations

import operator
import random
from collections.abc import Callable, Sequence
from itertools import product

from servogen.compiler.ast.nodes import AddressByte
from servogen.compiler.codegen import arithmetic
from servogen.compiler.ir.builder import InstructionBuilder
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Byte, Imm, Loc, Operand
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Chip, Names, texts

T, A, B = "gt", "ga", "gb"
LAYOUTS = {"apart": (T, A, B), "left": (A, A, B), "right": (B, A, B), "twice": (A, A, A), "both": (T, A, A)}
"""Target, left and right operand."""


def numbers(size: int) -> list[int]:
    """Numbers whose bytes are at the ends of their range, so that carries pass from byte to byte."""
    if size == 1:
        return [0, 1, 2, 15, 16, 100, 127, 128, 129, 240, 254, 255]
    if size == 2:
        return [low | high << 8 for low, high in product((0, 1, 0x80, 0xFF), repeat=2)]
    dice = random.Random(size)
    ends = [sum(dice.choice((0, 1, 0xFF)) << 8 * at for at in range(size)) for _ in range(9)]
    return [0, (1 << 8 * size) - 1, *ends]


class Code:
    """Instructions of a builder, and what they leave behind."""

    def __init__(self, emit: Callable[[InstructionBuilder, Names], object]) -> None:
        self.names = Names()
        self.function = Function("f")
        emit(InstructionBuilder(self.function), self.names)

    @property
    def words(self) -> int:
        return self.function.size

    @property
    def texts(self) -> list[str]:
        return texts(self.function)

    def run(self, size: int, **values: int) -> Chip:
        chip = Chip({"f": self.function})
        chip.w, chip.c, chip.z = 0xA5, True, True
        for name in {T, A, B, *values}:
            chip.store(self.names[name], values.get(name, 0x5A5A5A5A), size)
        chip.call("f")
        return chip

    def left_in(self, size: int, name: str, **values: int) -> int:
        return self.run(size, **values).number(self.names[name], size)


def bytes_of(names: Names, name: str, size: int) -> list[Loc]:
    return [Byte(names[name], at) for at in range(size)]


def operation(op: str, target: str, left: str | int, right: str | int, size: int) -> Code:
    """The code of target = left op right, of variables or constants."""

    def emit(gen: InstructionBuilder, names: Names) -> None:
        operands: list[list[Operand]] = [
            arithmetic.imms(each, size) if isinstance(each, int) else list(bytes_of(names, each, size))
            for each in (left, right)
        ]
        to = bytes_of(names, target, size)
        if op in "&|^":
            arithmetic.bitwise(gen, op, to, *operands)
        else:
            (arithmetic.add if op == "+" else arithmetic.subtract)(gen, to, *operands)

    return Code(emit)


OPERATORS = {"+": operator.add, "-": operator.sub, "&": operator.and_, "|": operator.or_, "^": operator.xor}


@every("layout", LAYOUTS)
@every("size", [1, 2, 3, 4])
@every("op", OPERATORS)
def test_every_operator_of_two_variables(op: str, size: int, layout: str) -> None:
    target, left, right = LAYOUTS[layout]
    made = operation(op, target, left, right, size)
    mask = (1 << 8 * size) - 1
    for a, b in product(numbers(size), numbers(size)[:: 1 if left != right else 9]):
        second = a if right == A else b
        chip = made.run(size, ga=a, gb=b)
        assert chip.number(made.names[target], size) == OPERATORS[op](a, second) & mask
        for name, before in ((A, a), (B, b)):
            assert name == target or chip.number(made.names[name], size) == before
        # in place, C tells the carry out of the top byte, or that there was no borrow (DS35007 register 2-1)
        if layout == "left" and op in "+-":
            assert chip.c == (a + b > mask if op == "+" else a >= b)


@every(
    ("op", "layout", "words"),
    [
        # MOVF b,W; ADDWF a,W; MOVWF t, above it MOVF a,W; MOVWF t; MOVF b,W; BTFSC C; INCFSZ b,W; ADDWF t,F,
        # on top MOVF a,W; BTFSC C; ADDLW 1; ADDWF b,W; MOVWF t
        ("+", "apart", (3, 8, 14, 20)),
        # MOVF b,W; ADDWF a,F, above it MOVF b,W; BTFSC C; INCFSZ b,W; ADDWF a,F
        ("+", "left", (2, 6, 10, 14)), ("+", "right", (2, 6, 10, 14)), ("-", "apart", (3, 8, 14, 20)),
        ("-", "left", (2, 6, 10, 14)),
        # the subtrahend is still needed: three bytes or more go through a temporary
        ("-", "right", (3, 8, 20, 28)), ("&", "apart", (3, 6, 9, 12)), ("|", "left", (2, 4, 6, 8)),
        ("^", "right", (2, 4, 6, 8)),
    ],
)  # fmt: skip
def test_the_words_of_an_operator(op: str, layout: str, words: tuple[int, ...]) -> None:
    assert tuple(operation(op, *LAYOUTS[layout], size).words for size in (1, 2, 3, 4)) == words


def constants(size: int) -> list[int]:
    parts = [0, 1, 2, 0x7F, 0x80, 0xFE, 0xFF]
    if size == 1:
        return parts
    if size == 2:
        return [low | high << 8 for low, high in product(parts, repeat=2)]
    dice = random.Random(size)
    ends = [1, (1 << 8 * size) - 1, 0x100, 0x10000, 0xFF00, 0x1234FF, 0xFF0034, 0x3400]
    return [*ends, *(sum(dice.choice(parts) << 8 * at for at in range(size)) for _ in range(25))]


@every("target", [T, A])
@every("size", [1, 2, 3, 4])
@every("op", OPERATORS)
def test_every_operator_of_a_variable_and_a_constant(op: str, size: int, target: str) -> None:
    mask = (1 << 8 * size) - 1
    for constant in constants(size):
        for swapped in (False, True):
            operands: list[str | int] = [constant, A] if swapped else [A, constant]
            made = operation(op, target, operands[0], operands[1], size)
            edge = -constant & mask
            for a in {0, 1, 0xFF, mask, edge, edge - 1 & mask, constant & mask, mask // 3}:
                one, two = (constant, a) if swapped else (a, constant)
                assert made.left_in(size, target, ga=a) == OPERATORS[op](one, two) & mask


@every(
    ("target", "size", "constant", "expected"),
    [
        (A, 1, 1, "INCF ga,F"), (A, 1, 255, "DECF ga,F"), (T, 1, 1, "INCF ga,W; MOVWF gt"),
        (T, 1, 255, "DECF ga,W; MOVWF gt"), (A, 1, 2, "MOVLW 2; ADDWF ga,F"),
        (T, 1, 254, "MOVLW 254; ADDWF ga,W; MOVWF gt"),
        (A, 1, 0, ""), (T, 1, 0, "MOVF ga,W; MOVWF gt"), (A, 2, 1, "INCF ga,F; BTFSC Z; INCF ga+1,F"),
        (A, 2, 0xFFFF, "MOVF ga,F; BTFSC Z; DECF ga+1,F; DECF ga,F"),
        (A, 2, 0x0100, "INCF ga+1,F"), (A, 2, 0xFF00, "DECF ga+1,F"),
        (T, 2, 0x0100, "MOVF ga,W; MOVWF gt; INCF ga+1,W; MOVWF gt+1"),
        (A, 2, 0x0034, "MOVLW 52; ADDWF ga,F; BTFSC C; INCF ga+1,F"),
        (A, 2, 0xFF34, "MOVLW 52; ADDWF ga,F; BTFSS C; DECF ga+1,F"),
        (A, 2, 0x1234, "MOVLW 52; ADDWF ga,F; MOVLW 18; BTFSC C; MOVLW 19; ADDWF ga+1,F"),
        (T, 2, 0x0034, "MOVLW 52; ADDWF ga,W; MOVWF gt; MOVLW 0; BTFSC C; MOVLW 1; ADDWF ga+1,W; MOVWF gt+1"),
        (A, 3, 1, "INCF ga,F; BTFSC Z; INCF ga+1,F; BTFSC Z; INCF ga+2,F"),
        (A, 3, 0xFFFFFF, "MOVLW 1; SUBWF ga,F; BTFSS C; SUBWF ga+1,F; BTFSS C; DECF ga+2,F"),
        (A, 3, 0x34, "MOVLW 52; ADDWF ga,F; MOVLW 1; BTFSC C; ADDWF ga+1,F; BTFSC C; INCF ga+2,F"),
        (A, 3, 0xFF34, "MOVLW 52; ADDWF ga,F; MOVLW 255; BTFSS C; ADDWF ga+1,F; BTFSC C; INCF ga+2,F"),
        (A, 3, 0x561234, "MOVLW 52; ADDWF ga,F; MOVLW 18; BTFSC C; MOVLW 19; ADDWF ga+1,F;"
            "MOVLW 86; BTFSC C; MOVLW 87; ADDWF ga+2,F"),
        (A, 4, 0xFFFFFF00, "MOVLW 1; SUBWF ga+1,F; BTFSS C; SUBWF ga+2,F; BTFSS C; DECF ga+3,F"),
    ],
)  # fmt: skip
def test_a_constant_is_added_in_the_shortest_form(
    target: str, size: int, constant: int, expected: str
) -> None:
    wanted = [each.strip() for each in expected.split(";") if each]
    assert operation("+", target, A, constant, size).texts == wanted
    assert operation("+", target, constant, A, size).texts == wanted
    assert operation("-", target, A, -constant & (1 << 8 * size) - 1, size).texts == wanted


def test_a_volatile_word_counts_down_without_a_read_before_the_subtraction() -> None:
    made = operation("-", "va", "va", 1, 2)
    assert made.texts == ["MOVLW 1", "SUBWF va,F", "BTFSS C", "DECF va+1,F"]


def test_constants_on_both_sides_are_added_as_well() -> None:
    for size, one, two in ((1, 200, 100), (2, 0x12FF, 0x0101), (3, 0xFFFFFF, 1), (3, 0x80FFFF, 0x7F0001)):
        mask = (1 << 8 * size) - 1
        for op in ("+", "-", "&", "|", "^"):
            assert operation(op, T, one, two, size).left_in(size, T) == OPERATORS[op](one, two) & mask


@every("target", [T, A])
@every("size", [2, 3, 4])
@every("op", "+-")
def test_a_value_with_constant_bytes_at_its_top(op: str, size: int, target: str) -> None:
    """An unsigned byte or a negative one in more bytes: the others are 0 or 255."""
    mask = (1 << 8 * size) - 1
    for fill, swapped in product((0, 0xFF), (False, True)):

        def emit(gen: InstructionBuilder, names: Names, fill: int = fill, swapped: bool = swapped) -> None:
            narrow: list[Operand] = [Byte(names[B], 0), *[Imm(fill)] * (size - 1)]
            wide: list[Operand] = list(bytes_of(names, A, size))
            one, two = (narrow, wide) if swapped else (wide, narrow)
            function = arithmetic.add if op == "+" else arithmetic.subtract
            function(gen, bytes_of(names, target, size), one, two)

        made = Code(emit)
        for a, b in product((0, 1, 0xFF, 0x100, mask, mask - 0xFF, mask ^ 0xFF00), (0, 1, 0x80, 0xFF)):
            second = b | (mask & ~0xFF if fill else 0)
            expected = OPERATORS[op](second, a) if swapped else OPERATORS[op](a, second)
            assert made.left_in(size, target, ga=a, gb=b) == expected & mask


@every("own", [(0,), (1,), (1, 2), (0, 2, 3)])
@every("swapped", [False, True])
@every("op", OPERATORS)
def test_a_target_that_shares_some_bytes_with_an_operand(
    op: str, swapped: bool, own: tuple[int, ...]
) -> None:
    def emit(gen: InstructionBuilder, names: Names) -> None:
        to = bytes_of(names, T, 4)
        mixed: list[Operand] = [Byte(names[T if at in own else B], at) for at in range(4)]
        one, two = (mixed, list(bytes_of(names, A, 4))) if swapped else (list(bytes_of(names, A, 4)), mixed)
        if op in "&|^":
            arithmetic.bitwise(gen, op, to, one, two)
        else:
            (arithmetic.add if op == "+" else arithmetic.subtract)(gen, to, one, two)

    made = Code(emit)
    for a, b, t in product((1, 0xFF00FF01, 0xFFFFFFFF, 0x00FFFF80), repeat=3):
        if op == "-" and not swapped and not {1, 2}.isdisjoint(own):
            continue  # a middle byte is loaded with the minuend first: the caller makes a copy
        second = sum(((t if at in own else b) >> 8 * at & 0xFF) << 8 * at for at in range(4))
        expected = OPERATORS[op](second, a) if swapped else OPERATORS[op](a, second)
        assert made.left_in(4, T, ga=a, gb=b, gt=t) == expected & 0xFFFFFFFF


def with_address(emit: Callable[[InstructionBuilder, Names, list[Operand]], object], size: int) -> Code:
    """Code with the address of a table, in as many bytes, as an operand; the layout would place it later."""
    symbol = Names()["g"]
    address: list[Operand] = [Imm(AddressByte(symbol, 0, part)) for part in (0, 1)]
    made = Code(lambda gen, names: emit(gen, names, [*address, *arithmetic.imms(0, 2)][:size]))
    for ins in made.function.instructions():
        if isinstance(ins.k, AddressByte):
            ins.k = ADDRESS >> 8 * ins.k.part & 0xFF
    return made


ADDRESS = 0x83F0


@every("target", [T, A])
@every("size", [1, 2, 3, 4])
@every("op", OPERATORS)
def test_an_address_is_an_operand(op: str, size: int, target: str) -> None:
    mask = (1 << 8 * size) - 1
    for swapped in (False, True):

        def emit(
            gen: InstructionBuilder, names: Names, address: list[Operand], swapped: bool = swapped
        ) -> None:
            variable: list[Operand] = list(bytes_of(names, A, size))
            one, two = (address, variable) if swapped else (variable, address)
            if op in "&|^":
                arithmetic.bitwise(gen, op, bytes_of(names, target, size), one, two)
            else:
                function = arithmetic.add if op == "+" else arithmetic.subtract
                function(gen, bytes_of(names, target, size), one, two)

        made = with_address(emit, size)
        for a in (0, 1, 0x0F, 0x10, 0x7C10, 0xFF10, 0x10010, mask, -ADDRESS & mask, ~ADDRESS & mask):
            expected = OPERATORS[op](ADDRESS, a) if swapped else OPERATORS[op](a, ADDRESS)
            assert made.left_in(size, target, ga=a & mask) == expected & mask, hex(a)


@every("size", [1, 2, 3, 4])
def test_an_address_is_compared(size: int) -> None:
    mask = (1 << 8 * size) - 1
    address = ADDRESS & mask

    def emit(gen: InstructionBuilder, names: Names, given: list[Operand], swapped: bool) -> None:
        variable: list[Operand] = list(bytes_of(names, A, size))
        arithmetic.compare_less(gen, *((given, variable) if swapped else (variable, given)))

    right = with_address(lambda gen, names, given: emit(gen, names, given, False), size)
    left = with_address(lambda gen, names, given: emit(gen, names, given, True), size)
    for a in (0, mask, address, address - 1, address + 1, address ^ 0x80, 0x0083F0 & mask, 0xF083 & mask):
        assert right.run(size, ga=a).c == (a >= address)
        assert left.run(size, ga=a).c == (address >= a)


@every("tops", [(0, 0), (0xFF, 0xFF), (0, 0xFF), (0x12, 0x34), (0x1200, 0xFFFF), (0xFF00, 0x0100)])
@every("op", OPERATORS)
def test_values_of_which_both_have_constant_bytes(op: str, tops: tuple[int, int]) -> None:
    size = 2 if max(tops) <= 0xFF else 3
    mask = (1 << 8 * size) - 1

    def emit(gen: InstructionBuilder, names: Names) -> None:
        one, two = (
            [Byte(names[name], 0), *arithmetic.imms(top, size - 1)]
            for name, top in zip((A, B), tops, strict=True)
        )
        to = bytes_of(names, T, size)
        if op in "&|^":
            arithmetic.bitwise(gen, op, to, one, two)
        else:
            (arithmetic.add if op == "+" else arithmetic.subtract)(gen, to, one, two)

    made = Code(emit)
    for a, b in product((0, 1, 0x80, 0xFF), repeat=2):
        expected = OPERATORS[op](tops[0] << 8 | a, tops[1] << 8 | b)
        assert made.left_in(size, T, ga=a, gb=b) == expected & mask


def test_values_of_which_both_have_a_constant_byte_are_compared() -> None:
    for one, two in product((0, 5, 0x80, 0xFE, 0xFF), repeat=2):

        def emit(gen: InstructionBuilder, names: Names, one: int = one, two: int = two) -> None:
            arithmetic.compare_less(gen, [Byte(names[A], 0), Imm(one)], [Byte(names[B], 0), Imm(two)])

        made = Code(emit)
        for a, b in product((0, 1, 0xFF), repeat=2):
            assert made.run(1, ga=a, gb=b).c == (one << 8 | a >= two << 8 | b)


@every(
    ("op", "target", "constant", "expected"),
    [
        ("&", A, 0xFF, ""), ("|", A, 0, ""), ("^", A, 0, ""), ("&", T, 0xFF, "MOVF ga,W; MOVWF gt"),
        ("&", A, 0, "CLRF ga"), ("|", A, 0xFF, "MOVLW 255; MOVWF ga"), ("^", A, 0xFF, "COMF ga,F"),
        ("^", T, 0xFF, "COMF ga,W; MOVWF gt"), ("|", A, 0x01, "BSF ga,0"), ("|", A, 0x80, "BSF ga,7"),
        ("|", A, 0x81, "MOVLW 129; IORWF ga,F"),
        ("|", T, 0x80, "MOVF ga,W; IORLW 128; MOVWF gt"),
        ("&", A, 0xFE, "BCF ga,0"), ("&", A, 0x7F, "BCF ga,7"), ("&", A, 0x7E, "MOVLW 126; ANDWF ga,F"),
        ("&", T, 0x7F, "MOVF ga,W; ANDLW 127; MOVWF gt"),
        ("^", A, 0x80, "MOVLW 128; XORWF ga,F"), ("&", "vt", 0, "CLRF vt"),
    ],
)  # fmt: skip
def test_a_constant_mask_takes_the_shortest_form(op: str, target: str, constant: int, expected: str) -> None:
    wanted = [each.strip() for each in expected.split(";") if each]
    assert operation(op, target, A, constant, 1).texts == wanted
    assert operation(op, target, constant, A, 1).texts == wanted


def test_a_volatile_byte_is_read_where_its_value_does_not_matter() -> None:
    assert operation("&", T, "va", 0, 1).texts == ["MOVF va,W", "CLRF gt"]
    assert operation("|", T, "va", 0xFF, 1).texts == ["MOVF va,W", "MOVLW 255", "MOVWF gt"]


@every("size", [1, 2, 3, 4])
def test_negation_and_complement(size: int) -> None:
    mask = (1 << 8 * size) - 1
    for target in (T, A):
        for function, law in ((arithmetic.negate, operator.neg), (arithmetic.complement, operator.invert)):

            def emit(
                gen: InstructionBuilder, names: Names, function: object = function, target: str = target
            ) -> None:
                function(gen, bytes_of(names, target, size), list(bytes_of(names, A, size)))  # type: ignore[operator]

            made = Code(emit)
            for a in numbers(size):
                assert made.left_in(size, target, ga=a) == law(a) & mask
            # COMF a,F or COMF a,W; MOVWF t for each byte; negation then counts up: INCF, and BTFSC Z; INCF
            single = 1 if target == A else 2
            words = size * single
            if function is arithmetic.negate:
                words = words + 2 * size - 1 if size > 1 else words + 1
            assert made.words == words


def test_the_complement_of_a_constant() -> None:
    made = Code(lambda gen, names: arithmetic.complement(gen, [Byte(names[T], 0)], [Imm(0x35)]))
    assert made.left_in(1, T) == 0xCA


def shifted(target: str, size: int, count: int, direction: str) -> Code:
    def emit(gen: InstructionBuilder, names: Names) -> None:
        to, operand = bytes_of(names, target, size), list(bytes_of(names, A, size))
        if direction == "<<":
            arithmetic.shift_left(gen, to, list(operand), count)
        else:
            arithmetic.shift_right(gen, to, list(operand), count, signed=direction == "signed >>")

    return Code(emit)


def shift(value: int, size: int, count: int, direction: str) -> int:
    if direction == "<<":
        return value << count & (1 << 8 * size) - 1
    if direction == "signed >>" and value >> 8 * size - 1:
        value -= 1 << 8 * size
    return value >> count & (1 << 8 * size) - 1


@every("target", [T, A])
@every("size", [1, 2, 3, 4])
@every("direction", ["<<", ">>", "signed >>"])
def test_shifts_by_every_constant(direction: str, size: int, target: str) -> None:
    top = 1 << 8 * size - 1
    values = [0, 1, top, top - 1, 2 * top - 1, 0xA5C396E1 & 2 * top - 1, 0x5A3C691E & 2 * top - 1]
    for count in range(8 * size + 2):
        made = shifted(target, size, count, direction)
        for value in values:
            expected = shift(value, size, count, direction)
            assert made.left_in(size, target, ga=value) == expected, (count, value)


@every(
    ("direction", "target", "size", "words"),
    [
        # by 1: BCF C; RLF a,F. By 4: SWAPF; ANDLW; MOVWF. By 7: RRF a,W; CLRF t; RRF t,F. By 8: CLRF
        ("<<", A, 1, [0, 2, 4, 6, 3, 5, 7, 3, 1, 1]),
        ("<<", T, 1, [2, 3, 6, 8, 3, 5, 7, 3, 1, 1]),
        (">>", A, 1, [0, 2, 4, 6, 3, 5, 7, 3, 1, 1]),
        (">>", T, 1, [2, 3, 6, 8, 3, 5, 7, 3, 1, 1]),
        # RLF a,W; RRF a,F for each bit; from 7 on nothing but the sign is left
        ("signed >>", A, 1, [0, 2, 4, 6, 8, 10, 12, 14, 14]),
        ("signed >>", T, 1, [2, 4, 6, 8, 10, 12, 14, 16, 16]),
        # three for each bit; by 8: MOVF; MOVWF; CLRF; by 9 to 15 a shift of one byte and a CLRF
        ("<<", A, 2, [0, 3, 6, 9, 12, 15, 18, 21, 3, 4, 7, 9, 4, 6, 8, 4, 2, 2]),
        ("<<", T, 2, [4, 5, 10, 13, 16, 19, 22, 25, 3, 4, 7, 9, 4, 6, 8, 4, 2]),
        (">>", A, 2, [0, 3, 6, 9, 12, 15, 18, 21, 3, 4, 7, 9, 4, 6, 8, 4, 2, 2]),
        (">>", T, 2, [4, 5, 10, 13, 16, 19, 22, 25, 3, 4, 7, 9, 4, 6, 8, 4, 2]),
    ],
)
def test_the_words_of_a_shift(direction: str, target: str, size: int, words: list[int]) -> None:
    assert [shifted(target, size, count, direction).words for count in range(len(words))] == words


def test_a_shift_of_a_constant_byte() -> None:
    for count in range(1, 8):
        for function, expected in ((arithmetic.shift_left, 0xB7 << count & 0xFF), (None, 0xB7 >> count)):

            def emit(
                gen: InstructionBuilder, names: Names, count: int = count, function: object = function
            ) -> None:
                to: list[Loc] = [Byte(names[T], 0)]
                if function is None:
                    arithmetic.shift_right(gen, to, [Imm(0xB7)], count, signed=False)
                else:
                    arithmetic.shift_left(gen, to, [Imm(0xB7)], count)

            assert Code(emit).left_in(1, T) == expected


@every(("count", "read"), [(7, 0), (8, 1), (15, 1), (16, 2), (20, 2)])
def test_the_bytes_that_are_shifted_out_are_read_where_they_are_volatile(count: int, read: int) -> None:
    def reads(volatile: str) -> int:
        def emit(gen: InstructionBuilder, names: Names) -> None:
            operand: list[Operand] = list(bytes_of(names, volatile, 2))
            arithmetic.shift_left(gen, bytes_of(names, T, 2), operand, count)

        return Code(emit).words

    assert reads("va") - reads("ga") == read


def compare(left: str | int, right: str | int, size: int) -> Code:
    def emit(gen: InstructionBuilder, names: Names) -> None:
        operands: list[list[Operand]] = [
            arithmetic.imms(each, size) if isinstance(each, int) else list(bytes_of(names, each, size))
            for each in (left, right)
        ]
        arithmetic.compare_less(gen, *operands)

    return Code(emit)


@every("size", [1, 2, 3, 4])
def test_c_is_set_unless_the_left_value_is_less(size: int) -> None:
    made = compare(A, B, size)
    assert made.words == 2 + 4 * (size - 1)  # MOVF b,W; SUBWF a,W; above: MOVF, BTFSS C, INCFSZ b,W, SUBWF
    for a, b in product(numbers(size), repeat=2):
        assert made.run(size, ga=a, gb=b).c == (a >= b)


@every("size", [1, 2, 3])
def test_comparisons_with_constants(size: int) -> None:
    mask = (1 << 8 * size) - 1
    for bound in constants(size):
        bound &= mask
        right, left = compare(A, bound, size), compare(bound, A, size)
        for a in {
            0,
            mask,
            bound,
            bound - 1 & mask,
            bound + 1 & mask,
            bound ^ 0xFF,
            bound ^ 1 << 8 * size - 1,
        }:
            assert right.run(size, ga=a).c == (a >= bound)
            assert left.run(size, ga=a).c == (bound >= a)


@every(
    ("bound", "expected"),
    [
        (0x1234, "MOVLW 52; SUBWF ga,W; MOVLW 18; BTFSS C; MOVLW 19; SUBWF ga+1,W"),
        (0xFF34, "MOVLW 52; SUBWF ga,W; MOVLW 255; BTFSC C; SUBWF ga+1,W"),
        (0x1200, "MOVLW 18; SUBWF ga+1,W"),
        (0x0000, "MOVLW 0; SUBWF ga+1,W"),
    ],
)
def test_a_constant_bound_takes_the_shortest_form(bound: int, expected: str) -> None:
    assert compare(A, bound, 2).texts == expected.split("; ")


@every("size", [1, 2, 3, 4])
def test_a_biased_value_has_the_signed_order(size: int) -> None:
    half = 1 << 8 * size - 1

    def emit(gen: InstructionBuilder, names: Names) -> None:
        one, two = (arithmetic.biased(gen, list(bytes_of(names, name, size))) for name in (A, B))
        arithmetic.compare_less(gen, one, two)

    made = Code(emit)
    for a, b in product(numbers(size), repeat=2):
        assert made.run(size, ga=a, gb=b).c == ((a ^ half) - half >= (b ^ half) - half)
    constant = Code(lambda gen, names: arithmetic.biased(gen, [Imm(5), Imm(0x92)]))
    assert constant.words == 0
    assert arithmetic.biased(InstructionBuilder(Function("f")), [Imm(5), Imm(0x92)]) == [Imm(5), Imm(0x12)]


def test_the_byte_above_a_signed_one() -> None:
    found: list[Operand] = []
    made = Code(lambda gen, names: found.append(arithmetic.sign_byte(gen, Byte(names[A], 0))))
    for a in range(256):
        assert made.run(1, ga=a).memory[found[0]] == (0xFF if a >= 128 else 0)  # type: ignore[index]
    builder = InstructionBuilder(Function("f"))
    assert [arithmetic.sign_byte(builder, Imm(value)) for value in (0, 0x7F, 0x80, 0xFF)] == [
        Imm(0),
        Imm(0),
        Imm(0xFF),
        Imm(0xFF),
    ]


@every("signed", [False, True])
@every("size", [1, 2, 3])
def test_a_shift_by_one_bit_leaves_the_lost_bit_in_c(size: int, signed: bool) -> None:
    right = Code(lambda gen, names: arithmetic.one_right(gen, bytes_of(names, A, size), signed=signed))
    left = Code(lambda gen, names: arithmetic.one_left(gen, bytes_of(names, A, size)))
    assert right.words == left.words == size + 1
    for value in numbers(size):
        chip = right.run(size, ga=value)
        assert chip.c == bool(value & 1)
        expected = shift(value, size, 1, "signed >>" if signed else ">>")
        assert chip.number(right.names[A], size) == expected
        chip = left.run(size, ga=value)
        assert chip.c == bool(value >> 8 * size - 1)
        assert chip.number(left.names[A], size) == value << 1 & (1 << 8 * size) - 1


def test_operands_as_a_number() -> None:
    def number(operands: Sequence[Operand]) -> int | None:
        return arithmetic.const(list(operands))

    assert arithmetic.imms(0x12345, 2) == [Imm(0x45), Imm(0x23)]
    assert arithmetic.imms(-2, 3) == [Imm(0xFE), Imm(0xFF), Imm(0xFF)]
    assert number(arithmetic.imms(0x123456, 3)) == 0x123456
    assert number([Imm(1), Byte(Names()[A], 1)]) is None
    assert number([]) == 0
