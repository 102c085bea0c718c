"""Products and quotients: one routine for each size, as narrow as the divisors and factors allow."""

from __future__ import annotations

import random
from functools import cache
from itertools import product

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine, SimulatorOptions
from servogen.units import Clock

A, B, RESULT, REST = 0x40, 0x44, 0x48, 0x4C
"""Addresses that the program does not clear: their contents at power-up are its operands."""


@cache
def compiled(kind: str, other: str, statements: str) -> Compilation:
    text = (
        "#include <xc.h>\n#include <stdint.h>\n"
        f"volatile {kind} a @ {A:#x}, result @ {RESULT:#x}, rest @ {REST:#x}; volatile {other} b @ {B:#x};\n"
        f"void main(void) {{ {statements} while (1); }}\n"
    )
    options = Options(dialect="xc8", clock_hz=4_000_000, verify_ir=True)
    return compile_sources([Source(text, "main.c")], options)


def run(made: Compilation, a: int, b: int, size: int) -> tuple[int, int]:
    start = [(f"0x{A + at:02X}", a >> 8 * at & 0xFF) for at in range(4)]
    start += [(f"0x{B + at:02X}", b >> 8 * at & 0xFF) for at in range(4)]
    machine = Machine(made.image, Clock(4_000_000), options=SimulatorOptions(start=tuple(start)))
    machine.run(8_000)
    ram = machine.state().ram
    one, two = (
        int.from_bytes(ram[at - RAM_FIRST : at - RAM_FIRST + size], "little") for at in (RESULT, REST)
    )
    return one, two


def routines(made: Compilation) -> set[str]:
    names = (each.name for each in made.listing.functions)
    return {name for name in names if name.startswith(("__divide", "__sdivide", "__mul", "__smul"))}


def dividends(bits: int) -> list[int]:
    dice = random.Random(bits)
    ends = [0, 1, 9, 10, 99, 127, 128, 129, 254, 255, 256, 257, (1 << bits - 1) - 1, 1 << bits - 1]
    return [*ends, (1 << bits) - 1, (1 << bits) - 2, *(dice.getrandbits(bits) for _ in range(6))]


@pytest.mark.parametrize(
    ("divisor", "routine"),
    [
        (3, "__divide_2_1_0"), (100, "__divide_2_1_0"), (127, "__divide_2_1_0"), (129, "__divide_2_1_1"),
        (255, "__divide_2_1_1"), (257, "__divide_2_2_0"), (32767, "__divide_2_2_0"),
        (32769, "__divide_2_2_1"), (65535, "__divide_2_2_1"),
    ],
)  # fmt: skip
def test_a_constant_divisor_gets_the_narrowest_routine(divisor: int, routine: str) -> None:
    made = compiled("uint16_t", "uint16_t", f"result = a / {divisor}u; rest = a % {divisor}u;")
    assert routines(made) == {routine}
    for value in dividends(16):
        assert run(made, value, 0, 2) == divmod(value, divisor)


@pytest.mark.parametrize(("kind", "bits"), [("uint16_t", 16), ("uint32_t", 32)])
def test_a_variable_divisor_of_one_byte_may_have_any_value(kind: str, bits: int) -> None:
    made = compiled(kind, "uint8_t", "result = a / b; rest = a % b;")
    assert routines(made) == {f"__divide_{bits // 8}_1_1"}
    for value, divisor in product(dividends(bits)[::2], (1, 2, 127, 128, 129, 200, 254, 255)):
        assert run(made, value, divisor, bits // 8) == divmod(value, divisor)


def signed_division(value: int, divisor: int) -> tuple[int, int]:
    """The quotient, rounded towards zero, and the remainder, modulo 65536."""
    quotient = abs(value) // abs(divisor) * (1 if (value < 0) == (divisor < 0) else -1)
    return quotient & 0xFFFF, value - quotient * divisor & 0xFFFF


def test_a_signed_dividend_and_a_positive_divisor() -> None:
    """The remainder has the dividend's sign (C99 6.5.5)."""
    made = compiled("int16_t", "uint8_t", "result = a / b; rest = a % b;")
    assert routines(made) == {"__sdivide_2_2_0_0", "__divide_2_2_0"}, "a remainder of -254 needs two bytes"
    for value in (-32768, -32767, -1000, -256, -255, -1, 0, 1, 255, 1000, 32767):
        for divisor in (1, 10, 127, 128, 129, 255):
            assert run(made, value & 0xFFFF, divisor, 2) == signed_division(value, divisor)


@pytest.mark.parametrize(("divisor", "routine"), [(10, "1_0_0"), (128, ""), (127, "1_0_0"), (129, "2_0_0")])
def test_a_signed_dividend_and_a_constant(divisor: int, routine: str) -> None:
    made = compiled("int16_t", "uint8_t", f"result = a / {divisor}; rest = a % {divisor};")
    assert not routine or f"__sdivide_2_{routine}" in routines(made)
    for value in (-32768, -32767, -129, -128, -127, -1, 0, 1, 126, 127, 128, 32767):
        assert run(made, value & 0xFFFF, 0, 2) == signed_division(value, divisor)


def test_a_signed_remainder_beside_an_unsigned_one() -> None:
    made = compiled("int16_t", "uint8_t", "result = a % 10; rest = (uint16_t)a % b;")
    assert routines(made) == {"__sdivide_2_1_1_0", "__divide_2_1_1"}
    for value, divisor in product((-32768, -7, 0, 9, 32767), (1, 129, 255)):
        expected = signed_division(value, 10)[1], (value & 0xFFFF) % divisor
        assert run(made, value & 0xFFFF, divisor, 2) == expected


def test_a_signed_divisor_that_may_be_negative() -> None:
    made = compiled("int16_t", "int16_t", "result = a / b; rest = a % b;")
    assert routines(made) == {"__sdivide_2_2_0_1", "__divide_2_2_0"}
    for value in (-32768, -32767, -77, -1, 0, 5, 32767):
        for divisor in (-32768, -300, -1, 1, 7, 32767):
            assert run(made, value & 0xFFFF, divisor & 0xFFFF, 2) == signed_division(value, divisor)


def test_one_routine_serves_all_divisions_of_a_size() -> None:
    """The quotient by a constant goes through the routine that the wide divisor needs."""
    made = compiled("uint16_t", "uint16_t", "result = a / b; rest = a / 10;")
    assert routines(made) == {"__divide_2_2_1"}
    for value, divisor in product((0, 9, 10, 1000, 65535), (1, 255, 256, 40000, 65535)):
        assert run(made, value, divisor, 2) == (value // divisor, value // 10)


def test_what_an_assignment_divides_by_counts() -> None:
    made = compiled("uint16_t", "uint16_t", "result = a; result /= b; rest = a; rest %= 10;")
    assert routines(made) == {"__divide_2_2_1"}
    assert run(made, 50000, 300, 2) == (166, 0)


@pytest.mark.parametrize("kind", ["uint16_t", "uint32_t"])
def test_a_factor_of_one_byte(kind: str) -> None:
    size = {"uint16_t": 2, "uint32_t": 4}[kind]
    made = compiled(kind, "uint8_t", "result = a * b; rest = b * a;")
    assert routines(made) == {f"__mul_{size}_1_{size}"}
    for value, factor in product(dividends(8 * size)[::3], (0, 1, 2, 127, 128, 255)):
        expected = value * factor & (1 << 8 * size) - 1
        assert run(made, value, factor, size) == (expected, expected)


def test_one_routine_serves_all_products() -> None:
    made = compiled("uint16_t", "uint16_t", "result = a * b; rest = a * 25;")
    assert routines(made) == {"__mul_2_2_2"}
    for value, factor in ((0, 5), (300, 200), (65535, 65535), (256, 256)):
        assert run(made, value, factor, 2) == (value * factor & 0xFFFF, value * 25 & 0xFFFF)


@pytest.mark.parametrize(
    ("between", "calls"),
    [
        ("digits[n] = value % 10;", 1),  # an element of an array is no other object
        ("*where = value % 10;", 2),  # a pointer may lead to `value`
        ("digits[n] = value % 10; value += n;", 2),
        ("digits[n] = value % 10; other();", 2),
    ],
)
def test_the_quotient_behind_the_remainder_is_not_computed_again(between: str, calls: int) -> None:
    text = (
        "#include <xc.h>\nunsigned char digits[4], n, *where; unsigned int value;\n"
        "void other(void) { value++; }\n"
        f"void main(void) {{ n = PORTA; value = PORTB * 7; where = digits; {between} value /= 10; }}"
    )
    made = compile_sources([Source(text, "main.c")], Options(dialect="xc8", clock_hz=4_000_000))
    routine = next(each for each in made.listing.functions if each.name.startswith("__divide"))
    assert [row.assembly for row in made.listing.rows].count(f"CALL 0x{routine.start:03X}") == calls


KINDS = {"uint8_t": (0, 0xFF), "int8_t": (-0x80, 0x7F), "uint16_t": (0, 0xFFFF), "int16_t": (-0x8000, 0x7FFF)}


@pytest.mark.parametrize(
    ("left", "right", "kind", "names"),
    [
        ("uint16_t", "uint16_t", "uint32_t", {"__mul_2_2_4"}),
        ("uint16_t", "int16_t", "int32_t", {"__mul_2_2_4", "__smul_2_0"}),
        ("int16_t", "uint16_t", "int32_t", {"__mul_2_2_4", "__smul_2_0"}),
        ("int16_t", "int16_t", "int32_t", {"__mul_2_2_4", "__smul_2_1"}),
        ("int16_t", "int8_t", "int32_t", {"__mul_2_2_4", "__smul_2_1"}),
        ("uint16_t", "uint8_t", "uint32_t", {"__mul_2_1_3"}),
        ("uint8_t", "uint16_t", "int32_t", {"__mul_2_1_3"}),
        ("int16_t", "uint8_t", "int32_t", {"__mul_3_1_3"}),
        ("uint8_t", "uint8_t", "uint32_t", {"__mul_1_1_2"}),
    ],
)
def test_a_long_product_of_narrow_factors(left: str, right: str, kind: str, names: set[str]) -> None:
    """All pairs of corners, and random pairs, against Python's integers."""
    made = compiled("uint32_t", "uint32_t", f"result = ({kind})({left})a * ({right})b;")
    assert routines(made) == names
    (low, high), (least, most) = KINDS[left], KINDS[right]
    dice = random.Random(f"{left} {right}")
    pairs = [
        *product(corners(low, high), corners(least, most)),
        *((dice.randint(low, high), dice.randint(least, most)) for _ in range(40)),
    ]
    for a, b in pairs:
        assert run(made, a, b, 4)[0] == a * b & 0xFFFFFFFF, (a, b)


def corners(low: int, high: int) -> list[int]:
    return sorted({low, low + 1, -1 if low else 2, 0, 1, 0x55, high // 2, high // 2 + 1, high - 1, high})


@pytest.mark.parametrize(
    ("kind", "wide", "a", "b", "most"),
    [
        ("unsigned int", "unsigned long", 0x1234, 0x5678, 230),
        ("unsigned int", "unsigned long", 0xFFFF, 0xFFFF, 266),
        ("int", "long", -1, -1, 294),
    ],
)
def test_the_time_of_a_long_product(kind: str, wide: str, a: int, b: int, most: int) -> None:
    text = (
        f"#include <xc.h>\nvolatile {kind} a = {a}, b = {b};\nunsigned long r;\n"
        f"void main(void) {{ TRISA = 0; TRISB = 0; RA0 = 1; r = ({wide})a * b; RA0 = 0;"
        " PORTB = (unsigned char)(r >> 16); while (1); }\n"
    )
    made = compile_sources([Source(text, "main.c")], Options(dialect="xc8", clock_hz=4_000_000))
    machine = Machine(made.image, Clock(4_000_000))
    rise, fall = machine.run_to_edge(0, 1, 1_000), machine.run_to_edge(0, 0, 1_000)
    assert rise is not None and fall is not None
    machine.run(100)
    assert fall - rise <= most
    assert machine.pins >> 5 & 0xFF == (a * b >> 16) & 0xFF


def test_a_wide_product_brings_no_second_routine_for_a_byte() -> None:
    made = compiled(
        "uint32_t",
        "uint32_t",
        "result = (uint16_t)a * (uint32_t)(uint16_t)b; rest = (uint16_t)a * (uint32_t)(uint8_t)b;",
    )
    assert routines(made) == {"__mul_2_2_4"}
    for a, b in product((0, 1, 0x1234, 0xFFFF), (1, 0xFF, 0x100, 0xFFFF)):
        assert run(made, a, b, 4) == (a * b, a * (b & 0xFF))
