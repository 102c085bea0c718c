"""The library: multiplication, division, tables, variable delays, EEPROM, serial; each routine made on demand.

In: the name of a routine and its sizes. Out: its `Code`, with parameters and result like any function's.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.emitter import Code

Library = Callable[[str, tuple[int, ...]], Code]


def build(kind: str, key: tuple[int, ...], code: Code, library: Library) -> None:
    raise NotImplementedError(kind)
