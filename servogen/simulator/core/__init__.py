"""The instruction loop, which is in C: `core.c` and the headers that it includes.

Out: the loop as a function of Python. The struct of the state, the addresses, bits, and numbers of
instructions in `layout.h` are made from `layout.py`, `words.py` and `pic.device`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path

from servogen.native import Native, constants, struct
from servogen.pic import device
from servogen.simulator import layout, words

ARGUMENTS = "pipppppppipp"
"""Pointers to 64-bit integers (p), and such integers (i): the arguments of `VARIANT` in core.c."""

Loop = Callable[..., int]


def layout_header() -> str:
    """Return the text of `layout.h`."""
    slots = {row.name for row in layout.ROWS} | {row.unknown_name for row in layout.ROWS}
    numbers = {
        name: value for name, value in {**vars(device), **vars(layout)}.items() if _is_number(name, value)
    }
    bits = {
        name: 1 << bit
        for register in ("STATUS", "INTCON", "OPTION_REG", "EECON1")
        for bit, name in enumerate(device.registers()[register].bit_names())
        if name
    }
    codes = {name: value for name, value in vars(words).items() if name.endswith(("_BIT", "_SHIFT"))}
    codes |= {"OP_MASK": words.OP_MASK, "FILE_OPS": words.FILE_OPS}
    codes |= {f"OP_{name}": number for name, number in words.OPS.items()}
    codes |= {f"OP_{name}": getattr(words, name) for name in words.MARKS}
    plain = {name: number for name, number in numbers.items() if name not in slots}
    return constants(bits | codes | plain) + struct("Chip", dict(layout.FIELDS))


def _is_number(name: str, value: object) -> bool:
    return name.isupper() and isinstance(value, int)


NATIVE = Native(Path(__file__).parent, "core", layout_header)


@cache
def loop(observed: bool = False, tracked: bool = False, visits: bool = False) -> Loop:
    """Return a variant of the loop: it takes the addresses of vectors, and returns why it stopped."""
    variant = "observed" if observed else "tracked" if tracked else "visits" if visits else "plain"
    run = NATIVE.load()[variant]
    run.restype = ctypes.c_int64
    run.argtypes = [ctypes.c_void_p if kind == "p" else ctypes.c_int64 for kind in ARGUMENTS]
    return run
