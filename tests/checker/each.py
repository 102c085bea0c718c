"""The checker's chip for every operand, by loops in C (`native/each.c`)."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

import numpy as np

from servogen.checker import chip, layout
from servogen.native import Native


def _header() -> str:
    return f"{layout.NATIVE.layout()}\n/* of the chip {layout.NATIVE.digest()} */\n"


@cache
def _library() -> ctypes.CDLL:
    each = Native(Path(__file__).parent / "native", "each", _header)
    each.refresh()
    return each.load()


_results = chip.exported(_library, "results", None)
_execute_each = chip.exported(_library, "execute_each", None)


@cache
def result_table() -> chip.Ints:
    """By operation, `x` and `a`: the result, and the flags from bit 8 on."""
    table = np.zeros((len(layout.OPERATIONS), 256, 256), dtype=np.int64)
    for number, rows in enumerate(table):
        _results(number, rows)
    return table


def execute_each(
    start: chip.Ints, memory: chip.ChipMemory, board: layout.ChipSurroundings, inputs: chip.Ints
) -> chip.Ints:
    """Execute one instruction for each row (W, RAM, STATUS); return rows (W, RAM, STATUS, PC, cycle, GIE)."""
    out = np.zeros((len(inputs), 6), dtype=np.int64)
    _execute_each(start, memory, board, len(inputs), inputs, out)
    return out
