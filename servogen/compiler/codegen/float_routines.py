"""The routines of floating-point arithmetic: unpacking, packing, + × ÷, comparison, conversions.

In: the kind of a routine and its sizes. Out: its `Function`. A value of 4 bytes is an IEEE 754 binary32; one
of 3 bytes has the same sign and exponent, and 15 bits of mantissa instead of 23. Results are rounded to the
nearest value, ties to even; denormals, infinities and NaN are those of IEEE 754, with one NaN.

The routines work in place. A value is unpacked to its mantissa with the hidden bit, and the exponent in the
top byte; the guard byte continues the mantissa downwards, and its lowest bit is sticky:

    as stored   [ mantissa … mantissa | e mantissa | s eeeeeee ]
    unpacked    [ mantissa … mantissa | 1 mantissa | eeeeeeee  ]   guard, sign

A denormal has no hidden bit and the exponent 1. The variables belong to the routine that packs, so that every
routine finds its first operand where the one before it left its result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from servogen.compiler.ast.float_values import INFINITE
from servogen.compiler.ast.nodes import EQUAL, GREATER, LESS
from servogen.compiler.ast.types import FLOAT_BIAS
from servogen.compiler.codegen.arithmetic import (
    add,
    negate,
    one_left,
    one_right,
    rotate_left,
    rotate_right,
    subtract,
    zero_test,
)
from servogen.compiler.codegen.arithmetic import compare_less as compare_bytes
from servogen.compiler.codegen.runtime import parameter, variable
from servogen.compiler.ir.builder import InstructionBuilder, Library
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import STATUS, Byte, C, Imm, Loc, Operand, Z

MAX_SHIFT = 300
"""More than the rounds of any loop that moves a mantissa until its exponent is right."""


@dataclass(frozen=True, slots=True)
class Registers:
    """The variables that the routines of one size share."""

    value: list[Loc]
    """The first operand, and the result."""
    guard: Loc
    high: Loc
    """The high byte of the exponent, while that is out of range."""
    sign: Loc
    """In bit 7."""

    @property
    def mantissa(self) -> list[Loc]:
        return self.value[:-1]

    @property
    def top(self) -> Loc:
        """Return the byte of the mantissa with the hidden bit."""
        return self.value[-2]

    @property
    def exponent(self) -> Loc:
        return self.value[-1]


def shared(library: Library, size: int) -> Registers:
    """Return the variables of the routines for values of `size` bytes."""
    own = {symbol.name: symbol for symbol in library("float_pack", (size,)).own}
    value = own["value"]
    guard, high, sign = (Byte(own[name], 0) for name in ("guard", "high", "sign"))
    return Registers([Byte(value, index) for index in range(size)], guard, high, sign)


def second_operand(library: Library, size: int) -> list[Loc]:
    """Return where the routines with two operands find the second one."""
    other = next(symbol for symbol in library("float_unpack", (size,)).own if symbol.name == "other")
    return [Byte(other, index) for index in range(size)]


def _returns_value(gen: InstructionBuilder, registers: Registers) -> None:
    """Declare the shared value as the parameter and the result of a routine."""
    symbol = registers.value[0]
    assert isinstance(symbol, Byte)
    gen.function.result = symbol.symbol
    gen.function.parameters = [symbol.symbol]


def _goto_if_zero(gen: InstructionBuilder, bytes_: Sequence[Loc], label: str) -> None:
    zero_test(gen, bytes_)
    gen.goto_if(Z, True, label)


def _goto_if_infinite(gen: InstructionBuilder, exponent: Loc, label: str) -> None:
    """Jump if an unpacked exponent is that of infinity and of what is not a number."""
    gen.emit("COMF", exponent, 0)
    gen.goto_if(Z, True, label)


def _goto_if_finite(gen: InstructionBuilder, exponent: Loc, label: str) -> None:
    gen.emit("COMF", exponent, 0)
    gen.goto_if(Z, False, label)


def _goto_if_either_infinite(gen: InstructionBuilder, one: Loc, two: Loc, label: str) -> None:
    gen.emit("COMF", one, 0)
    gen.skip_if(Z, True)
    _goto_if_infinite(gen, two, label)


def _keep_sticky(gen: InstructionBuilder, guard: Loc) -> None:
    """Keep the bit that a shift to the right has moved into the carry."""
    gen.skip_if(C, False)
    gen.emit("BSF", guard, b=0)


def _keep_rest(gen: InstructionBuilder, r: Registers, rest: list[Loc], packing: str) -> None:
    """Keep in the guard byte whether anything is left below it; jump to the packing if nothing is."""
    _goto_if_zero(gen, rest, packing)
    gen.emit("BSF", r.guard, b=0)


def _add_exponent(gen: InstructionBuilder, registers: Registers, operand: Operand) -> None:
    """Add a byte to the exponent of two bytes."""
    gen.load(operand)
    gen.emit("ADDWF", registers.exponent, 1)
    gen.skip_if(C, False)
    gen.emit("INCF", registers.high, 1)


def _subtract_exponent(gen: InstructionBuilder, registers: Registers, operand: Operand) -> None:
    """Subtract a byte from the exponent of two bytes."""
    gen.load(operand)
    gen.emit("SUBWF", registers.exponent, 1)
    gen.skip_if(C, True)
    gen.emit("DECF", registers.high, 1)


def _take(gen: InstructionBuilder, targets: list[Loc], sources: list[Loc]) -> None:
    """Copy bytes and clear where they were."""
    for target, source in zip(targets, sources, strict=True):
        gen.move(target, source)
        gen.emit("CLRF", source)


def _show_hidden_bit(gen: InstructionBuilder, top: Loc, exponent: Loc) -> None:
    """Set the hidden bit, or leave it away and count the exponent as 1 where the stored one is 0."""
    gen.emit("BSF", top, b=7)
    gen.emit("MOVF", exponent, 1)
    gen.skip_if(Z, False)
    gen.emit("BCF", top, b=7)  # which leaves Z alone
    gen.skip_if(Z, False)
    gen.emit("INCF", exponent, 1)


def _load_seven_bits(gen: InstructionBuilder, top: Loc, below: list[Loc]) -> None:
    """Load the low bits of a byte, or'ed with the bytes below it: Z says whether all of them are 0."""
    gen.load(top)
    gen.emit("ANDLW", k=0x7F)
    for byte in below:
        gen.emit("IORWF", byte, 0)


def _move_to_top(
    gen: InstructionBuilder,
    mantissa: list[Loc],
    labels: tuple[str, str],
    bound: int,
    count: Callable[[], object],
) -> None:
    """Emit a loop, between its two labels, that moves a mantissa left until its top bit is set; `count` emits
    what each turn does to the exponent.
    """
    loop, complete = labels
    gen.label(loop, bound)
    gen.goto_if(7, True, complete, mantissa[-1])
    one_left(gen, mantissa)
    count()
    gen.goto(loop)
    gen.label(complete)


def _pack_infinity(gen: InstructionBuilder, r: Registers, packing: str) -> None:
    gen.move(r.exponent, Imm(INFINITE))
    gen.emit("BSF", r.top, b=7)
    gen.goto(packing)


def pack(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit the end of every routine: mantissa, exponent and sign become a value, rounded."""
    (size,) = key
    parameter(gen, "value", size)
    for name in ("guard", "high", "sign"):
        variable(gen, name, 1)
    r = shared(library, size)
    _returns_value(gen, r)
    small, right, left, normal, compose, put = gen.new_labels(
        "small", "right", "left", "normal", "compose", "put"
    )
    infinite, in_range = gen.new_label("infinite"), gen.new_label("in_range")
    # nothing is left of the mantissa: a zero with its sign, whatever the exponent says
    _goto_if_zero(gen, [*r.mantissa, r.guard], compose)
    # below the exponent 1 the mantissa moves right until the exponent is 1: a denormal
    gen.label(small, MAX_SHIFT)
    gen.goto_if(7, False, in_range, r.high)
    gen.label(right, MAX_SHIFT)
    one_right(gen, [r.guard, *r.mantissa], signed=False)
    _keep_sticky(gen, r.guard)
    gen.emit("INCF", r.exponent, 1)
    gen.skip_if(Z, False)
    gen.emit("INCF", r.high, 1)
    gen.goto(small)
    gen.label(in_range)
    gen.emit("MOVF", r.high, 1)
    gen.goto_if(Z, False, infinite)
    gen.emit("MOVF", r.exponent, 1)
    gen.goto_if(Z, True, right)
    # the hidden bit is missing: the mantissa moves left, but not below the exponent 1
    gen.label(left, MAX_SHIFT)
    gen.goto_if(7, True, normal, r.top)
    gen.emit("DECF", r.exponent, 0)
    gen.goto_if(Z, True, compose)
    one_left(gen, [r.guard, *r.mantissa])
    gen.emit("DECF", r.exponent, 1)
    gen.goto(left)
    gen.label(normal)
    gen.emit("INCFSZ", r.exponent, 0)
    gen.goto(compose)
    gen.label(infinite)
    gen.clear([r.guard, *r.mantissa])
    gen.move(r.exponent, Imm(INFINITE))
    gen.goto(put)
    gen.label(compose)
    gen.skip_if(7, True, r.top)
    gen.emit("CLRF", r.exponent)
    gen.label(put)
    # the hidden bit rotates out; sign and exponent rotate right, and the exponent's lowest bit takes its
    # place
    gen.emit("RLF", r.top, 1)
    gen.emit("RLF", r.sign, 0)
    gen.emit("RRF", r.exponent, 1)
    gen.emit("RRF", r.top, 1)
    # the guard byte is above one half, or is one half and the mantissa is odd
    gen.skip_if(0, False, r.mantissa[0])
    gen.emit("BSF", r.guard, b=0)
    gen.emit("MOVLW", k=0x7F)
    gen.emit("ADDWF", r.guard, 0)
    gen.skip_if(C, True)
    gen.emit("RETURN")
    # a carry out of the mantissa makes the exponent one larger: the next value, be it normal or infinite
    for byte in r.value[:-1]:
        gen.emit("INCF", byte, 1)
        gen.skip_if(Z, False)
    gen.emit("INCF", r.exponent, 1)
    gen.emit("RETURN")


def not_a_number(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit the routine that returns the NaN, with exponent 255 and the highest bit of the mantissa set."""
    r = shared(library, key[0])
    _returns_value(gen, r)
    gen.function.also_calls = (library("float_pack", key).name,)
    gen.clear(r.mantissa[:-1])
    gen.move(r.top, Imm(0xC0))
    gen.move(r.exponent, Imm(0x7F))
    gen.emit("RETURN")


def unpack(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit the beginning of every routine with two operands. `sign` is whether their signs differ; C is set
    if one of them is not a number.
    """
    r = shared(library, key[0])
    gen.function.also_calls = (library("float_pack", key).name,)
    other = parameter(gen, "other", key[0])
    gen.load(other[-1])
    gen.emit("XORWF", r.value[-1], 0)
    gen.store(r.sign)
    for operand in (r.value, other):
        # the lowest bit of the exponent is stored in the byte below; the sign rotates out
        gen.emit("RLF", operand[-2], 0)
        gen.emit("RLF", operand[-1], 1)
        _show_hidden_bit(gen, operand[-2], operand[-1])
    gen.clear([r.guard, r.high])
    gen.emit("BCF", STATUS, b=C)
    second = gen.new_label()
    for operand in (r.value, other):
        gen.emit("COMF", operand[-1], 0)
        gen.skip_if(Z, True)
        if operand is r.value:
            gen.goto(second)
        else:
            gen.emit("RETURN")
        _load_seven_bits(gen, operand[-2], operand[:-2])
        # 255 plus a byte carries unless that is 0: C says that the value is not a number
        gen.emit("ADDLW", k=0xFF)
        if operand is r.value:
            gen.skip_if(C, False)
            gen.emit("RETURN")
            gen.label(second)
        else:
            gen.emit("RETURN")


def _begin(gen: InstructionBuilder, size: int, library: Library) -> tuple[str, str]:
    """Emit the unpacking of two operands; return the names of the routines that end an operation: the packing
    one, and the one for what is not a number.
    """
    _returns_value(gen, shared(library, size))
    nan = library("float_nan", (size,)).name
    gen.emit("CALL", target=library("float_unpack", (size,)).name)
    gen.goto_if(C, True, nan)
    return library("float_pack", (size,)).name, nan


def addition(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit an addition: the mantissa of the smaller exponent is shifted right until the exponents agree;
    signs that differ make it a subtraction.
    """
    (size,) = key
    r, other = shared(library, size), second_operand(library, size)
    first_sign, other_guard = variable(gen, "first_sign", 1)[0], variable(gen, "other_guard", 1)[0]
    gen.move(first_sign, r.value[-1])
    packing, nan = _begin(gen, size, library)
    wide, wide_other = [r.guard, *r.mantissa], [other_guard, *other[:-1]]
    gen.emit("CLRF", other_guard)
    names = ("infinite", "finite", "align", "shift_other", "aligned", "larger", "of_first", "of_second")
    infinite, finite, align, shift_other, aligned, larger, of_first, of_second = gen.new_labels(*names)
    _goto_if_infinite(gen, r.exponent, infinite)
    _goto_if_finite(gen, other[-1], finite)
    gen.move(r.exponent, other[-1])
    gen.emit("BSF", r.top, b=7)
    gen.goto(of_second)
    gen.label(infinite)
    _goto_if_finite(gen, other[-1], of_first)
    gen.goto_if(7, False, of_first, r.sign)
    # infinity minus infinity
    gen.goto(nan)
    gen.label(finite)
    for one, two in ((r.value, other), (other, r.value)):  # a zero need not be shifted
        after = gen.new_label()
        zero_test(gen, one[:-1])
        gen.goto_if(Z, False, after)
        gen.move(one[-1], two[-1])
        gen.label(after)
    gen.label(align, MAX_SHIFT)
    gen.load(other[-1])
    gen.emit("SUBWF", r.exponent, 0)
    gen.goto_if(Z, True, aligned)
    gen.goto_if(C, True, shift_other)
    # C is 0 here, since SUBWF has borrowed, and enters at the top
    rotate_right(gen, wide)
    _keep_sticky(gen, r.guard)
    gen.emit("INCF", r.exponent, 1)
    gen.goto(align)
    gen.label(shift_other)
    one_right(gen, wide_other, signed=False)
    _keep_sticky(gen, other_guard)
    gen.emit("INCF", other[-1], 1)
    gen.goto(align)
    gen.label(aligned)
    differ = gen.new_label("differ")
    gen.goto_if(7, True, differ, r.sign)
    add(gen, wide, list(wide), list(wide_other))
    gen.goto_if(C, False, of_first)
    # the carry of the sum becomes its top bit
    rotate_right(gen, wide)
    _keep_sticky(gen, r.guard)
    gen.emit("INCF", r.exponent, 1)
    gen.goto(of_first)
    gen.label(differ)
    subtract(gen, wide, list(wide), list(wide_other))
    gen.goto_if(C, True, larger)
    # the second operand was the greater one: the difference has its sign
    negate(gen, wide, list(wide))
    gen.label(of_second)
    gen.load(r.sign)
    gen.emit("XORWF", first_sign, 1)
    gen.goto(of_first)
    gen.label(larger)
    zero_test(gen, wide)
    gen.skip_if(Z, False)
    gen.emit("CLRF", first_sign)  # the difference of equal values is +0
    gen.label(of_first)
    gen.move(r.sign, first_sign)
    gen.goto(packing)


def multiplication(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a shift-and-add multiplication: the product replaces the first mantissa in `low` and above it."""
    (size,) = key
    low = variable(gen, "low", size - 2)
    count = variable(gen, "count", 1)[0]
    r, other = shared(library, size), second_operand(library, size)
    packing, nan = _begin(gen, size, library)
    multiplier = [*low, r.guard]
    loop, skip, normalise, normalised, zero, infinite = gen.new_labels(
        "loop", "skip", "normalise", "done", "zero", "infinite"
    )
    for operand in (r.value, other):
        _goto_if_zero(gen, operand[:-1], zero)
    _goto_if_either_infinite(gen, r.exponent, other[-1], infinite)
    # both exponents contain the bias, of which the product's has one
    _add_exponent(gen, r, other[-1])
    _subtract_exponent(gen, r, Imm(FLOAT_BIAS - 1))
    _take(gen, multiplier, r.mantissa)
    gen.move(count, Imm(8 * (size - 1)))
    gen.label(loop, 8 * (size - 1))
    gen.emit("BCF", STATUS, b=C)
    gen.goto_if(0, False, skip, multiplier[0])
    add(gen, r.mantissa, list(r.mantissa), list(other[:-1]))
    gen.label(skip)
    # the carry of the addition, or the 0 from before it, enters at the top
    rotate_right(gen, [*multiplier, *r.mantissa])
    gen.emit("DECFSZ", count, 1)
    gen.goto(loop)
    product, labels = [*multiplier, *r.mantissa], (normalise, normalised)
    _move_to_top(gen, product, labels, 16 * size, lambda: _subtract_exponent(gen, r, Imm(1)))
    # what lies below the guard byte only matters as being there or not
    _keep_rest(gen, r, low, packing)
    gen.goto(packing)
    # zero times infinity is not a number
    gen.label(zero)
    _goto_if_either_infinite(gen, r.exponent, other[-1], nan)
    gen.clear(r.mantissa)
    gen.goto(packing)
    gen.label(infinite)
    _pack_infinity(gen, r, packing)


def division(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a bit-by-bit division, which ends when the highest bit of the quotient is set."""
    (size,) = key
    rest = variable(gen, "rest", size - 1)
    r, other = shared(library, size), second_operand(library, size)
    packing, nan = _begin(gen, size, library)
    divisor = other[:-1]
    names = ("finite", "infinite", "no_dividend", "zero", "scale", "loop", "take", "bit", "done", "start")
    finite, infinite, no_dividend, zero, scale, loop, take, bit, complete, start = gen.new_labels(*names)
    _goto_if_finite(gen, r.exponent, finite)
    _goto_if_infinite(gen, other[-1], nan)
    gen.label(infinite)
    _pack_infinity(gen, r, packing)
    gen.label(no_dividend)
    _goto_if_zero(gen, divisor, nan)
    gen.label(zero)
    gen.clear(r.mantissa)
    gen.goto(packing)
    gen.label(finite)
    _goto_if_infinite(gen, other[-1], zero)
    _goto_if_zero(gen, r.mantissa, no_dividend)
    _goto_if_zero(gen, divisor, infinite)
    _subtract_exponent(gen, r, other[-1])
    _add_exponent(gen, r, Imm(FLOAT_BIAS + 8 * size))
    # a denormal divisor is normalised, so that each turn gives one bit of the quotient
    _move_to_top(gen, divisor, (scale, start), 8 * size, lambda: _add_exponent(gen, r, Imm(1)))
    _take(gen, rest, r.mantissa)
    gen.label(loop, 16 * size)
    compare_bytes(gen, list(rest), list(divisor))
    gen.goto_if(C, False, bit)
    gen.label(take, 16 * size)
    subtract(gen, rest, list(rest), list(divisor))
    # the bit of the quotient; where the remainder had overflowed, subtract has not set C
    gen.emit("BSF", STATUS, b=C)
    gen.label(bit)
    rotate_left(gen, (r.guard, *r.mantissa))
    _subtract_exponent(gen, r, Imm(1))
    gen.goto_if(7, True, complete, r.top)
    one_left(gen, rest)
    gen.goto_if(C, True, take)
    gen.goto(loop)
    gen.label(complete)
    # a remainder makes the guard byte sticky
    _keep_rest(gen, r, rest, packing)
    gen.goto(packing)


def comparison(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a comparison; W is LESS, EQUAL or GREATER, or 0 where an operand is not a number."""
    (size,) = key
    r, other = shared(library, size), second_operand(library, size)
    first_sign = variable(gen, "first_sign", 1)[0]
    _returns_value(gen, r)
    gen.function.result = None
    gen.function.returns_w = True
    gen.move(first_sign, r.value[-1])
    gen.emit("CALL", target=library("float_unpack", key).name)
    gen.skip_if(C, False)
    gen.emit("RETLW", k=0)
    same, differ, first_larger = gen.new_labels("same", "differ", "first_larger")
    gen.goto_if(7, False, same, r.sign)
    zero_test(gen, [*r.mantissa, *other[:-1]])
    gen.skip_if(Z, False)
    gen.emit("RETLW", k=EQUAL)
    gen.label(first_larger)
    gen.skip_if(7, False, first_sign)
    gen.emit("RETLW", k=LESS)
    gen.emit("RETLW", k=GREATER)
    gen.label(same)
    # equal signs: the unpacked bytes are in the order of the values, the exponent first
    for one, two in zip(reversed(r.value), reversed(other), strict=True):
        gen.load(two)
        gen.emit("SUBWF", one, 0)
        gen.goto_if(Z, False, differ)
    gen.emit("RETLW", k=EQUAL)
    gen.label(differ)
    gen.goto_if(C, True, first_larger)
    gen.skip_if(7, False, first_sign)
    gen.emit("RETLW", k=GREATER)
    gen.emit("RETLW", k=LESS)


def to_integer(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit the conversion to an integer of 32 bits, rounding towards zero; the low bits where it has more."""
    (size,) = key
    value = parameter(gen, "value", size)
    integer = value if size == 4 else variable(gen, "whole", 4)
    sign, count = variable(gen, "sign", 1)[0], variable(gen, "count", 1)[0]
    assert isinstance(integer[0], Byte)
    gen.function.result = integer[0].symbol
    right, left, signed = gen.new_labels("right", "left", "signed")
    gen.move(sign, value[-1])
    gen.emit("RLF", value[-2], 0)
    gen.emit("RLF", value[-1], 0)
    gen.store(count)
    mantissa = integer[: size - 1]
    for target, source in zip(mantissa, value, strict=False):
        gen.move(target, source)
    gen.emit("BSF", mantissa[-1], b=7)
    gen.clear(integer[size - 1 :])
    # the mantissa as an integer has this exponent; the difference is the shift
    gen.emit("MOVLW", k=FLOAT_BIAS + 8 * (size - 1) - 1)
    gen.emit("SUBWF", count, 1)
    gen.goto_if(C, True, left)
    # a negative difference is 256 minus the shift: INCFSZ counts it up to 0
    gen.label(right, MAX_SHIFT)
    one_right(gen, mantissa, signed=False)
    gen.emit("INCFSZ", count, 1)
    gen.goto(right)
    gen.goto(signed)
    gen.label(left, MAX_SHIFT)
    gen.emit("MOVF", count, 1)
    gen.goto_if(Z, True, signed)
    one_left(gen, integer)
    gen.emit("DECF", count, 1)
    gen.goto(left)
    gen.label(signed)
    gen.skip_if(7, True, sign)
    gen.emit("RETURN")
    negate(gen, integer, list(integer))
    gen.emit("RETURN")


def integer_places(r: Registers, extra: list[Loc], integer_bytes: int) -> list[Loc]:
    """Return where the conversion from an integer expects its bytes: as high as they fit."""
    wide = [*extra, r.guard, *r.mantissa]
    return wide[len(wide) - integer_bytes :]


def from_integer(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit the conversion from an integer of 16 or 32 bits, which lies in the mantissa already."""
    size, integer_bytes, signed = key
    r = shared(library, size)
    packing = library("float_pack", (size,)).name
    extra = variable(gen, "extra", 1) if integer_bytes > size else []
    _returns_value(gen, r)
    places = integer_places(r, extra, integer_bytes)
    positive = gen.new_label("positive")
    gen.clear([r.sign, r.high])
    gen.clear(byte for byte in [r.guard, *r.mantissa] if byte not in places)
    if signed:
        gen.goto_if(7, False, positive, places[-1])
        gen.emit("BSF", r.sign, b=7)
        negate(gen, places, list(places))
        gen.label(positive)
    gen.move(r.exponent, Imm(FLOAT_BIAS + 8 * integer_bytes - 1))
    if extra:
        loop, normalised = gen.new_label("loop"), gen.new_label("done")
        _goto_if_zero(gen, places, packing)
        labels, bits = (loop, normalised), 8 * integer_bytes
        _move_to_top(gen, places, labels, bits, lambda: gen.emit("DECF", r.exponent, 1))
        _keep_rest(gen, r, extra, packing)
    gen.goto(packing)


def square_root(gen: InstructionBuilder, key: tuple[int, ...], library: Library) -> None:
    """Emit a square root, one bit of the root for two of the radicand. It finds two bits more than the
    mantissa has, and packing moves them to its top.
    """
    (size,) = key
    r = shared(library, size)
    _returns_value(gen, r)
    packing, nan = (library(kind, key).name for kind in ("float_pack", "float_nan"))
    radicand, rest, trial = (
        variable(gen, name, length)
        for name, length in (("radicand", size - 1), ("rest", size), ("trial", size))
    )
    count = variable(gen, "count", 1)[0]
    bits = 8 * (size - 1) + 2
    _return_special_root(gen, r, packing, nan)
    _show_hidden_bit(gen, r.top, r.exponent)
    _add_exponent(gen, r, Imm(FLOAT_BIAS))
    normalise, ready, loop = gen.new_labels("normalise", "ready", "loop")
    labels = normalise, ready
    _move_to_top(gen, r.mantissa, labels, 8 * size, lambda: gen.emit("DECF", r.exponent, 1))
    _take(gen, radicand, r.mantissa)
    gen.clear(rest)
    _find_first_bit(gen, r, radicand, rest)
    gen.move(count, Imm(bits - 1))
    gen.label(loop, bits)
    _find_next_bit(gen, [r.guard, *r.mantissa], radicand, rest, trial)
    gen.emit("DECFSZ", count, 1)
    gen.goto(loop)
    gen.emit("MOVLW", k=8 * size - bits)
    gen.emit("ADDWF", r.exponent, 1)
    _keep_rest(gen, r, rest, packing)
    gen.goto(packing)


def _return_special_root(gen: InstructionBuilder, r: Registers, packing: str, nan: str) -> None:
    """End the routine for zeros, negative numbers, infinity and what is no number; of any other number leave
    the exponent without the sign.
    """
    finite = gen.new_label("finite")
    _load_seven_bits(gen, r.exponent, r.mantissa)
    gen.skip_if(Z, False)
    gen.emit("RETURN")  # the root of a zero is that zero
    gen.goto_if(7, True, nan, r.exponent)
    gen.clear((r.guard, r.high, r.sign))
    gen.emit("RLF", r.top, 0)
    gen.emit("RLF", r.exponent, 1)
    _goto_if_finite(gen, r.exponent, finite)
    _load_seven_bits(gen, r.top, r.mantissa[:-1])
    gen.goto_if(Z, False, nan)
    gen.goto(packing)
    gen.label(finite)


def _find_first_bit(gen: InstructionBuilder, r: Registers, radicand: list[Loc], rest: list[Loc]) -> None:
    """Halve the exponent and set the root's first bit, which is 1: of the radicand's first two bits 0, 1 or 2
    is left.
    """
    start = gen.new_label("start")
    # The exponent's lowest bit, then in `high`, says that the radicand counts twice.
    gen.emit("RRF", r.high, 1)
    gen.emit("RRF", r.exponent, 1)
    gen.emit("RLF", r.high, 1)
    gen.emit("INCF", r.guard, 1)
    one_left(gen, radicand)
    gen.goto_if(0, False, start, r.high)
    gen.emit("INCF", rest[0], 1)
    one_left(gen, radicand)
    gen.skip_if(C, False)
    gen.emit("INCF", rest[0], 1)
    gen.label(start)
    gen.emit("CLRF", r.high)


def _find_next_bit(
    gen: InstructionBuilder, root: list[Loc], radicand: list[Loc], rest: list[Loc], trial: list[Loc]
) -> None:
    """Append a bit to the root: 1 if the rest with two more bits of the radicand is 4 * root + 1 or more."""
    smaller = gen.new_label("smaller")
    for _ in range(2):
        one_left(gen, [*radicand, *rest])
    gen.emit("BCF", STATUS, b=C)
    for target, source in zip(trial, root, strict=True):
        gen.emit("RLF", source, 0)
        gen.store(target)
    gen.emit("BSF", STATUS, b=C)
    rotate_left(gen, trial)
    compare_bytes(gen, list(rest), list(trial))
    gen.goto_if(C, False, smaller)
    subtract(gen, rest, list(rest), list(trial))
    gen.label(smaller)
    rotate_left(gen, root)


FLOAT_ROUTINES: dict[str, Callable[[InstructionBuilder, tuple[int, ...], Library], None]] = {
    "float_pack": pack,
    "float_nan": not_a_number,
    "float_unpack": unpack,
    "float_add": addition,
    "float_multiply": multiplication,
    "float_divide": division,
    "float_compare": comparison,
    "float_to_integer": to_integer,
    "float_from_integer": from_integer,
    "float_square_root": square_root,
}


def build_float(kind: str, key: tuple[int, ...], function: Function, library: Library) -> None:
    """Fill `function` with the instructions of a routine of floating-point arithmetic."""
    FLOAT_ROUTINES[kind](InstructionBuilder(function), key, library)
