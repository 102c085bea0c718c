"""A second model of the arithmetic, bit by bit with full adders, on arrays: independent of the simulator's.

Each function takes arrays of the same shape: the operand from the file register (or the literal), W, and C
before; and gives the result and STATUS's flags C, DC and Z, None where the instruction leaves the flag
alone. The flags that an instruction changes are those of DS35007 table 7-2.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.int64]
Flags = tuple[Bytes, Bytes | None, Bytes | None, Bytes | None]


def ripple(a: Bytes, b: Bytes, carry: Bytes) -> tuple[Bytes, Bytes, Bytes]:
    """Sum, carry out of bit 7, carry out of bit 3."""
    total = np.zeros_like(a)
    half = carry
    for bit in range(8):
        x, y = a >> bit & 1, b >> bit & 1
        total |= (x ^ y ^ carry) << bit
        carry = (x & y) | (carry & (x ^ y))
        if bit == 3:
            half = carry
    return total, carry, half


def zero(result: Bytes) -> Bytes:
    return (result == 0).astype(np.int64)


def add(f: Bytes, w: Bytes, c: Bytes) -> Flags:
    total, carry, half = ripple(f, w, np.zeros_like(f))
    return total, carry, half, zero(total)


def subtract(f: Bytes, w: Bytes, c: Bytes) -> Flags:
    """f - W by adding the two's complement: C and DC are the carries, so 1 means no borrow."""
    total, carry, half = ripple(f, w ^ 0xFF, np.ones_like(f))
    return total, carry, half, zero(total)


def logic(operation: Callable[[Bytes, Bytes], Bytes]) -> Callable[[Bytes, Bytes, Bytes], Flags]:
    def model(f: Bytes, w: Bytes, c: Bytes) -> Flags:
        result = operation(f, w)
        return result, None, None, zero(result)

    return model


def step(amount: int, *, flags: bool) -> Callable[[Bytes, Bytes, Bytes], Flags]:
    def model(f: Bytes, w: Bytes, c: Bytes) -> Flags:
        result = np.mod(f + amount, 256)
        return result, None, None, zero(result) if flags else None

    return model


def rotate_left(f: Bytes, w: Bytes, c: Bytes) -> Flags:
    nine = f * 2 + c
    return nine % 256, nine // 256, None, None


def rotate_right(f: Bytes, w: Bytes, c: Bytes) -> Flags:
    nine = f + 256 * c
    return nine // 2, nine % 2, None, None


def swap(f: Bytes, w: Bytes, c: Bytes) -> Flags:
    return f % 16 * 16 + f // 16, None, None, None


BYTE_ORIENTED = {
    "ADDWF": add,
    "ANDWF": logic(lambda f, w: f & w),
    "COMF": logic(lambda f, w: 255 - f),
    "DECF": step(-1, flags=True),
    "DECFSZ": step(-1, flags=False),
    "INCF": step(1, flags=True),
    "INCFSZ": step(1, flags=False),
    "IORWF": logic(lambda f, w: f | w),
    "MOVF": logic(lambda f, w: f),
    "RLF": rotate_left,
    "RRF": rotate_right,
    "SUBWF": subtract,
    "SWAPF": swap,
    "XORWF": logic(lambda f, w: f ^ w),
}
LITERAL = {
    "ADDLW": add,
    "ANDLW": logic(lambda k, w: k & w),
    "IORLW": logic(lambda k, w: k | w),
    "MOVLW": lambda k, w, c: (k, None, None, None),
    "SUBLW": subtract,
    "XORLW": logic(lambda k, w: k ^ w),
}
