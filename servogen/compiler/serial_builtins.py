"""putchar and getchar by the RS232 pragmas.

In: a call's node and arguments. Out: `Builtin` nodes that carry port, pin, cycles of a bit and polarity.
"""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

from servogen.compiler.chip_access import ChipAccess
from servogen.compiler.ctypes import U8, VOID
from servogen.compiler.tree import Builtin, Expr
from servogen.pic.device import RAM_LAST, registers


def serial(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    wanted = ("TXPORT", "TXPIN", "BAUD") if name == "putchar" else ("RXPORT", "RXPIN", "BAUD")
    for each in wanted:
        if each not in self.serial_settings:
            raise self.fail(f"'{name}' needs '#pragma RS232_{each} …'", node)
    kind = wanted[0][:2]
    port = serial_number(self, f"{kind}PORT", node)
    pin = serial_number(self, f"{kind}PIN", node)
    baud = serial_number(self, "BAUD", node)
    if not 0 <= pin <= 7 or not 0 <= port <= RAM_LAST:
        raise self.fail(f"the serial pin {port}.{pin} does not exist", node)
    if baud <= 0:
        raise self.fail(f"the baud rate must be positive, not {baud}", node)
    cycles = bit_cycles(self, baud, node)
    inverted = self.serial_settings.get("TRUE", "1") == "0"
    data = (port, pin, cycles, inverted)
    if name == "putchar":
        value = self.convert(self.expr(arguments[0]), U8, "the argument of 'putchar'")
        return Builtin("putchar", [value], VOID, self.place(node), data)
    return Builtin("getchar", [], U8, self.place(node), data)


def serial_number(self: ChipAccess, name: str, node: Any) -> int:
    text = self.serial_settings[name]
    if text.upper() in registers():
        return registers()[text.upper()].address
    if not re.fullmatch(r"0[xX][0-9a-fA-F]+|\d+", text):
        raise self.fail(f"'#pragma RS232_{name} {text}': a number is needed", node)
    return int(text, 16 if text[1:2] in ("x", "X") else 10)


def bit_cycles(self: ChipAccess, baud: int, node: Any) -> int:
    if self.clock is None:
        self.delay_cycles(Fraction(1), node)
    assert self.clock is not None
    cycles = self.clock.round_us(Fraction(1_000_000, baud)).cycles
    if cycles < 16:
        raise self.fail(f"{baud} baud is too fast: a bit has only {cycles} cycles, 16 are needed", node)
    return cycles
