"""The decorator for functions of the instruction loop, which are compiled and work on pointers to vectors of
integers.

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
    """Mark `function` to be compiled when compiled code first calls it. No division here is ever by 0.

    Only the loop calls it: the wrappers that Python would need take a fifth of the time to compile.
    """
    options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(Function, njit(**options)(function))
