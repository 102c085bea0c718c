"""What marks a function of the instruction loop: it is compiled, and works on vectors of integers by pointer.

Such functions are typed as what they are in Python; numba makes machine code of them (`native.py`).
"""

from __future__ import annotations

from collections.abc import Callable, MutableSequence
from typing import Any, TypeVar, cast

from numba import njit

Vector = MutableSequence[int]
"""A pointer to int64 in machine code; in Python any sequence of integers that can be written."""

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile `function` when it is first called from compiled code. No division here is ever by 0."""
    return cast(Function, njit(error_model="numpy")(function))
