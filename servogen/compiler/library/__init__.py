"""The standard library in C: functions that a program declares through a header and does not define.

In: the name of a function. Out: the source file that defines it. What a program does not call costs nothing.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib import resources

HEADERS = ("ctype.h", "math.h", "stdio.h", "stdlib.h", "string.h")
_SOURCES = ("ctype.c", "math.c", "printf.c", "sprintf.c", "stdlib.c", "string.c")

MISSING = frozenset(
    (
        *("acos", "asin", "atan", "atan2", "cos", "cosh", "exp", "fmod", "frexp", "ldexp"),
        *("log", "log10", "modf", "pow", "sin", "sinh", "tan", "tanh"),
    )
)
"""Functions of <math.h> that the library does not have."""


def _text(name: str) -> str:
    return (resources.files(__name__) / name).read_text(encoding="utf-8")


@cache
def header(name: str) -> str:
    """Return the text of a header."""
    return _text(name)


def declared_in(function: str) -> str | None:
    """Return the header that declares a function of the library; None if there is none."""
    declaring = (name for name in HEADERS if re.search(rf"\b{re.escape(function)}\(", header(name)))
    return next(declaring, None)


@cache
def source(name: str) -> str:
    """Return the text of a source file; `format.c` serves `printf` and `sprintf`."""
    if name in ("printf.c", "sprintf.c"):
        return f"#define TO_{name.removesuffix('.c').upper()}\n" + _text("format.c")
    return _text(name)


@cache
def sources() -> Mapping[str, str]:
    """Return, for each function of the library, the file that defines it."""
    return {
        function: name
        for name in _SOURCES
        for function in re.findall(r"^// defines: (\w+)$", source(name), re.MULTILINE)
        if name not in ("printf.c", "sprintf.c") or function.startswith(f"__{name[:-2]}")
    }
