"""The base of the library: emits one routine.

In: an empty `Code`. Out: its instructions, parameters and variables.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.arith import Arithmetic
from servogen.compiler.ctypes import U8, U16, U24, U32, IntType
from servogen.compiler.emitter import Code
from servogen.compiler.machine import Byte, Loc, Reg
from servogen.compiler.tree import Symbol
from servogen.pic.device import register_bits, registers

Library = Callable[[str, tuple[int, ...]], Code]
_UNSIGNED: tuple[IntType, ...] = (U8, U16, U24, U32)
_EEDATA, _EEADR, _EECON1, _EECON2 = (
    Reg(registers()[name].address) for name in ("EEDATA", "EEADR", "EECON1", "EECON2")
)
_GIE, _RD, _WR, _WREN = (register_bits()[name][1] for name in ("GIE", "RD", "WR", "WREN"))


class Routine(Arithmetic):
    """Emits a library routine."""

    def __init__(self, code: Code) -> None:
        self.code = code
        self.place = None
        self._labels = 0
        self._temps = 0

    def variable(self, name: str, size: int, *, parameter: bool = False, in_w: bool = False) -> list[Loc]:
        symbol = Symbol(name, _UNSIGNED[size - 1], "param" if parameter else "temp", function=self.code.name)
        self.code.own.append(symbol)
        if parameter:
            self.code.parameters.append(symbol)
        if in_w:
            self.code.w_parameter = symbol
        return [Byte(symbol, each) for each in range(size)]

    def parameter(self, name: str, size: int, *, in_w: bool = False) -> list[Loc]:
        return self.variable(name, size, parameter=True, in_w=in_w)
