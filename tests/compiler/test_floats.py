"""Floating-point routines on the simulated chip against IEEE 754: numpy's float32, fractions for 24 bits."""

from __future__ import annotations

import shutil
from fractions import Fraction
from itertools import islice, product

import numpy as np
import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.compiler.ast.float_values import compare_float, encode, fold_float, fold_square_root
from servogen.compiler.ast.types import FloatType
from servogen.errors import InputError
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from servogen.units import Clock
from tests.compiler.float_machine import FloatMachine
from tests.compiler.float_operations import OPERATIONS, Operation, mistakes
from tests.compiler.float_reference import (
    NAN,
    OPERATORS,
    RELATIONS,
    binary,
    canonical,
    edges,
    operands,
    relation,
    round24,
    square_root,
)
from tests.compiler.random_floats import compare, generate, host, target

WIDTHS = (24, 32)


CASES = [(operation, width) for operation in OPERATIONS for width in WIDTHS]
CASES = [*CASES[::4], *CASES[3::4], *CASES[1::4], *CASES[2::4]]
"""The first half has each operation, with one width or the other."""


@pytest.mark.parametrize(
    ("operation", "width"),
    [
        pytest.param(*case, marks=() if 2 * number < len(CASES) else pytest.mark.campaign)
        for number, case in enumerate(CASES)
    ],
    ids=lambda each: each.name if isinstance(each, Operation) else str(each),
)
def test_an_operation_gives_what_ieee_754_requires(operation: Operation, width: int) -> None:
    """`python -m tests.compiler.float_operations` does it with ten times as many operands."""
    count = 60 if operation.name in OPERATORS else 15
    assert list(mistakes(operation, width, count, seed=7)) == []


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_random_programs_leave_what_gccs_code_leaves() -> None:
    programs = [generate(seed) for seed in range(6)]
    outcomes = zip(programs, compare(programs), strict=True)
    assert [(program.seed, outcome) for program, outcome in outcomes if outcome.bad] == []


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_a_program_that_differs_is_seen() -> None:
    program = generate(0)
    (expected,) = host([program])
    assert target(program, expected).kind == "same"
    assert target(program, [expected[0] ^ 1, *expected[1:]]).kind == "different"


def test_the_random_programs_reach_every_operation() -> None:
    texts = " ".join(generate(seed).text for seed in range(200))
    updates = ("UPDATE(", "UPDATE_INT(", "ASSIGN_INT(", "AFTER(", "BEFORE(")
    for shape in (*updates, "fabs(", "FROM(INT(", "@call1(", "@table", "*p"):
        assert texts.count(shape) > 10, shape
    for op in (*OPERATORS, *RELATIONS, "&&", "||"):
        assert texts.count(f" {op}") > 10, op


def test_a_wrong_result_is_seen() -> None:
    machine = FloatMachine("z = x + y;", 32)
    one, two = (int(np.float32(value).view(np.uint32)) for value in (1, 2))
    machine(x=one, y=two)
    assert machine["z"] == binary("+", one, two, 32) == int(np.float32(3).view(np.uint32))
    assert machine["z"] != binary("-", one, two, 32)


@pytest.mark.parametrize("op", OPERATORS)
def test_the_exact_reference_for_24_bits_agrees_with_numpy_where_no_digit_is_lost(op: str) -> None:
    """A result of binary32 that ends with eight zero bits is exact, or its tail is known, in both formats."""
    for left, right in islice(operands(24, 3), 600):
        wide = binary(op, left << 8, right << 8, 32)
        if wide is NAN or wide & 0xFF == 0:
            expected = NAN if wide is NAN else wide >> 8
            if expected is not NAN and _rounded_twice(op, left, right):
                continue
            assert binary(op, left, right, 24) == expected


def _rounded_twice(op: str, left: int, right: int) -> bool:
    """Whether binary32 rounds the result, so that its zeros do not show that it is exact."""
    with np.errstate(all="ignore"):
        one, two = (np.float64(np.uint32(each << 8).view(np.float32)) for each in (left, right))
        exact = OPERATORS[op](one, two)  # type: ignore[arg-type]
        return bool(np.float64(np.float32(exact)) != exact) and bool(np.isfinite(exact))


@pytest.mark.parametrize("width", WIDTHS)
def test_constants_are_computed_as_the_chip_computes(width: int) -> None:
    kind = FloatType(width // 8)
    pairs = [*product(edges(width), repeat=2), *islice(operands(width, 11), 200)]
    for left, right in pairs:
        for op in OPERATORS:
            found = canonical(fold_float(op, left, right, kind), width)
            assert found == binary(op, left, right, width), (op, left, right)
        for op in RELATIONS:
            assert compare_float(op, left, right, kind) == relation(op, left, right, width)
        assert canonical(fold_square_root(left, kind), width) == square_root(left, width)


def test_literals_are_rounded_once() -> None:
    """A literal just above a tie of float32 that float64 would round onto the tie (2⁻²⁴ + 2⁻⁶⁰ above 1)."""
    value = 1 + Fraction(1, 2**24) + Fraction(1, 2**60)
    once = int(np.float32(1).view(np.uint32)) + 1
    assert int(np.float32(float(value)).view(np.uint32)) != once
    assert encode(value, FloatType(4)) == once
    assert encode(value, FloatType(3)) == round24(value, 0)


def test_the_size_of_float_is_the_dialects_unless_an_option_says_otherwise() -> None:
    text = (
        "#if __SIZEOF_FLOAT__ == {size} && __SIZEOF_DOUBLE__ == {size}\n"
        "float x; void main(void) {{ x = 1; }}\n#endif"
    )
    for dialect, bits, size in (
        ("xc8", None, 3),
        ("c2c", None, 4),
        ("sdcc", None, 4),
        ("xc8", 32, 4),
        ("c2c", 24, 3),
    ):
        source = Source(text.format(size=size), "main.c")
        found = compile_sources([source], Options(dialect=dialect, float_bits=bits))
        assert [(name, size) for _, name, size in found.listing.variables] == [("x", size)]
    with pytest.raises(InputError, match="'float' has 24 or 32 bits, not 16"):
        compile_sources([source], Options(float_bits=16))


def test_main_and_the_interrupt_compute_at_the_same_time() -> None:
    """The interrupt adds in the middle of main's multiplications; each has routines of its own."""
    text = """
#include <xc.h>
float sum, product = 1; unsigned char times, ticks;
void interrupt f(void) { T0IF = 0; TMR0 = 150; sum += 0.5; ticks++; }
void main(void) {
  OPTION_REG = 0x04; TMR0 = 150; INTCON = 0xA0;
  for (times = 0; times < 200; times++) product *= 1.0625;
  GIE = 0;
  while (1);
}"""
    found = compile_sources([Source(text, "main.c")], Options(dialect="xc8"))
    machine = Machine(found.image, Clock(4_000_000))
    machine.run(1_500_000)
    where = {name: (address - RAM_FIRST, size) for address, name, size in found.listing.variables}
    value = {
        name: int.from_bytes(machine.ram[at : at + size], "little") for name, (at, size) in where.items()
    }
    expected = 127 << 15
    for _ in range(200):
        expected = binary("*", expected, round24(Fraction(17, 16), 0), 24) or 0
    assert value["product"] == expected
    assert value["ticks"] > 20
    assert value["sum"] == round24(Fraction(value["ticks"], 2), 0)
