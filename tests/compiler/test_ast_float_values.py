"""Constant floating-point arithmetic with zeros, infinities, NaN and subnormals (IEEE 754)."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from servogen.compiler.ast.float_values import (
    compare_float,
    decode,
    encode,
    fold_float,
    fold_square_root,
    is_finite,
    is_nan,
    whole_part,
)
from servogen.compiler.ast.types import FloatType
from tests.compiler.float_reference import OPERATORS, RELATIONS, binary, canonical, relation

SPECIAL = [
    0x00000000, 0x00000100, 0x007FFF00, 0x00800000, 0x3F000000, 0x3F800000, 0x3F800100,
    0x40000000, 0x40400000, 0x4B000000, 0x7F7FFF00, 0x7F800000, 0x7FC00000, 0x7F800100,
]  # fmt: skip
"""Bits of binary32 whose last byte is 0, so that the first three are the same value in 24 bits."""


@pytest.mark.parametrize("width", [24, 32])
def test_operators_and_comparisons_of_special_values(width: int) -> None:
    kind = FloatType(width // 8)
    values = [(bits | sign) >> 32 - width for bits in SPECIAL for sign in (0, 0x80000000)]
    for left, right in product(values, values):
        for op in OPERATORS:
            found = canonical(fold_float(op, left, right, kind), width)
            assert found == binary(op, left, right, width), f"{left:X} {op} {right:X}"
        for op in RELATIONS:
            holds = compare_float(op, left, right, kind)
            assert holds == relation(op, left, right, width), f"{left:X} {op} {right:X}"


def test_roots_and_kinds_of_special_values() -> None:
    kind = FloatType(4)
    for bits in [each | sign for each in SPECIAL for sign in (0, 0x80000000)]:
        value = np.uint32(bits).view(np.float32)
        with np.errstate(all="ignore"):
            root = canonical(int(np.sqrt(value).view(np.uint32)), 32)
        assert canonical(fold_square_root(bits, kind), 32) == root, f"{bits:X}"
        assert (is_nan(bits, kind), is_finite(bits, kind)) == (
            bool(np.isnan(value)),
            bool(np.isfinite(value)),
        )
        assert whole_part(bits, kind) == (int(value) if np.isfinite(value) else 0)
        number = decode(bits, kind)
        assert (number is None) == (not np.isfinite(value))
        if number is not None:
            assert float(number) == float(value)
            assert encode(number, kind, negative=bool(bits >> 31)) == bits
