"""Each built-in function as an operation of the typed tree.

In: a call's name, its node and arguments. Out: ordinary expressions on registers and bits where that is what
the call means, `Builtin` nodes for delays, NOP and the library.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from pycparser import c_ast

from servogen.compiler.chip_access import ChipAccess
from servogen.compiler.ctypes import BIT, U8, VOID, IntType
from servogen.compiler.tree import Assign, Binary, Builtin, Cast, Expr, Num, Unary, Update

MAX_DELAY = 50_463_240
"""The longest `_delay(n)`, in cycles, as XC8 documents it."""

UNITS_US = {"delay_us": 1, "delay_10us": 10, "delay_ms": 1000, "delay_s": 1_000_000}
XC8_UNITS_US = {"__delay_us": 1, "__delay_ms": 1000}


def bit_function(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    place = self.place(node)
    found = self.bit_target(arguments[0], arguments[1], node)
    if isinstance(found, tuple):
        base, bit = found
        mask = self._mask(base, bit, place)
        assert isinstance(base.type, IntType)
        work = base.type.plain()
        assert isinstance(work, IntType)
        if name == "test_bit":
            return Binary(
                "!=", Binary("&", base, mask, work, place), Num(0, work, place), self.int_type, place
            )
        self.assignable(base, node)
        op = {"set_bit": "|", "clear_bit": "&", "toggle_bit": "^"}[name]
        value = Unary("~", mask, work, place) if name == "clear_bit" else mask
        return Cast(Update(op, base, value, work, False, work, place), VOID, place)
    if name == "test_bit":
        return found
    self.assignable(found, node)
    if name == "toggle_bit":
        return Cast(Update("^", found, Num(1, U8, place), U8, False, BIT, place), VOID, place)
    return Cast(self.set_bit(found, int(name == "set_bit")), VOID, place)


def port_write(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    register = {
        "set_tris_a": "TRISA",
        "set_tris_b": "TRISB",
        "output_port_a": "PORTA",
        "output_port_b": "PORTB",
        "set_option": "OPTION_REG",
    }[name]
    value = self.convert(self.expr(arguments[0]), U8, f"the argument of '{name}'")
    return Cast(
        Assign(self.register_ref(register, self.place(node)), value, U8, self.place(node)),
        VOID,
        self.place(node),
    )


def port_read(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    return self.register_ref("PORTA" if name.endswith("a") else "PORTB", self.place(node))


def port_bit(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    register = c_ast.ID("PORTA" if name.endswith("a") else "PORTB", node.coord)
    function = "set_bit" if "_high_" in name else "clear_bit"
    return bit_function(self, function, node, [register, arguments[0]])


def interrupt_bit(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    register = c_ast.ID("INTCON", node.coord)
    return bit_function(
        self, "set_bit" if name.startswith("enable") else "clear_bit", node, [register, arguments[0]]
    )


def global_interrupts(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    return Cast(
        self.set_bit(self.chip_bit("GIE", self.place(node)), int(name == "ei")), VOID, self.place(node)
    )


def instruction(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    mnemonic = {"nop": "NOP", "clear_wdt": "CLRWDT", "clrwdt": "CLRWDT", "sleep": "SLEEP"}.get(
        name.lower().strip("_"), ""
    )
    return Builtin("instruction", [], VOID, self.place(node), mnemonic)


def delay(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    place = self.place(node)
    unit = UNITS_US[name]
    value = self.constant_us(arguments[0])
    if value is not None:
        if not 0 <= value <= 255:
            raise self.fail(f"'{name}' takes 0 to 255, not {value}", arguments[0])
        return Builtin("delay", [], VOID, place, self.delay_cycles(value * unit, node))
    argument = self.convert(self.expr(arguments[0]), U8, f"the argument of '{name}'")
    cycles = self.delay_cycles(Fraction(unit), node)
    if cycles == 0:
        raise self.fail(
            f"'{name}' with a variable argument needs a clock whose cycle is at most {unit} µs", node
        )
    return Builtin("delay_variable", [argument], VOID, place, cycles)


def xc8_delay(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    place = self.place(node)
    value = self.constant_us(arguments[0], fractions=name != "_delay")
    if value is None:
        raise self.fail(
            f"'{name}' needs a constant argument",
            arguments[0],
            hint="call it in a loop that counts the variable",
        )
    if name == "_delay":
        cycles = int(value)
        if not 0 <= cycles <= MAX_DELAY:
            raise self.fail(f"'_delay' takes 0 to {MAX_DELAY} cycles, not {cycles}", arguments[0])
    else:
        if value < 0:
            raise self.fail(f"'{name}' takes no negative time", arguments[0])
        cycles = self.delay_cycles(value * XC8_UNITS_US[name], node, cut=True)
        if cycles > MAX_DELAY:
            raise self.fail(
                f"'{name}' takes at most {MAX_DELAY} cycles, these are {cycles}",
                arguments[0],
                hint="call it several times, or in a loop",
            )
    return Builtin("delay", [], VOID, place, cycles)


def eeprom_read(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    address = self.convert(self.expr(arguments[0]), U8, "the address")
    return Builtin("eeprom_read", [address], U8, self.place(node))


def eeprom_write(self: ChipAccess, name: str, node: Any, arguments: list[Any]) -> Expr:
    address = self.convert(self.expr(arguments[0]), U8, "the address")
    value = self.convert(self.expr(arguments[1]), U8, "the value")
    return Builtin("eeprom_write", [address, value], VOID, self.place(node))
