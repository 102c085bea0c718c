"""The functions that the dialects have built in, as operations of the typed tree.

In: a call's name and arguments. Out: ordinary expressions on registers and bits where that is what the call
means, `Builtin` nodes for delays, NOP and the library.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from typing import Any

from pycparser import c_ast

from servogen.compiler.ctypes import BIT, U8, VOID, FuncType, IntType
from servogen.compiler.dialect import C2C, NAMES, XC8, ChipBit
from servogen.compiler.rewrite import CONFIG_NAME, EEPROM_NAME, Rewritten
from servogen.compiler.scopes import Constant, Scopes
from servogen.compiler.settings import Settings
from servogen.compiler.statements import Statements
from servogen.compiler.tree import (
    Assign,
    Binary,
    Builtin,
    Cast,
    Deref,
    Expr,
    Function,
    Num,
    Ref,
    Unary,
    Update,
)
from servogen.errors import Place
from servogen.pic.device import CONFIG_ADDRESS, EEPROM_BYTES, RAM_LAST, register_bits, registers
from servogen.pic.isa import WORD_MASK
from servogen.units import Clock

MAX_DELAY = 50_463_240
"""The longest `_delay(n)`, in cycles, as XC8 documents it."""

_UNITS_US = {"delay_us": 1, "delay_10us": 10, "delay_ms": 1000, "delay_s": 1_000_000}
_XC8_UNITS_US = {"__delay_us": 1, "__delay_ms": 1000}


class Builtins(Statements):
    """Adds the built-in functions."""

    clock: Clock | None = None
    serial_settings: dict[str, str]

    def begin_file(self, rewritten: Rewritten) -> None:
        """Start a new file: its own scope, the same program."""
        self.scopes = Scopes(lower_case=True)
        self.addresses = rewritten.addresses
        self.interrupts = rewritten.interrupts

    def head(self, unit: Any) -> Function:
        """Declare the function that a definition defines."""
        kind = self.declared_type(unit.decl.type)
        if not isinstance(kind, FuncType):
            raise self.fail(f"'{unit.decl.name}' is not a function but has a body", unit)
        if unit.param_decls:
            raise self.fail("parameters are declared inside the parentheses", unit.param_decls[0])
        return self.declare_function(unit.decl, kind, define=True)

    def file_assembly(self, rewritten: Rewritten, settings: Settings) -> None:
        """Assembly outside functions: `__config` is understood."""
        for number, place in rewritten.file_asm:
            for line, text in self.blocks[number].lines:
                words = text.split(";")[0].split(None, 1)
                where = Place(place.file, line)
                if words and words[0].lower() == "__config" and len(words) > 1:
                    settings.asm_config(words[1], where)
                elif words:
                    self.reporter.error("assembly outside functions can only be __config", where)

    def finish(self, settings: Settings) -> None:
        """What declarations said by their names: EEPROM data, configuration words."""
        for symbol in [each for each in self.program.symbols if each.name.startswith(EEPROM_NAME)]:
            self.program.symbols.remove(symbol)
            for offset, value in (symbol.initial or {}).items():
                at = len(self.program.eeprom)
                del offset
                if at >= EEPROM_BYTES:
                    self.reporter.error(f"__EEPROM_DATA gives more than {EEPROM_BYTES} bytes", symbol.place)
                    break
                self.program.eeprom[at] = value if isinstance(value, int) else 0
        for name, meaning in self.scopes.stack[0].names.items():
            if name.startswith(CONFIG_NAME) and isinstance(meaning, Constant):
                settings.config_mask = (meaning.value & WORD_MASK, Place())
        for symbol in self.program.symbols:
            if symbol.address == CONFIG_ADDRESS:
                low, high = ((symbol.initial or {}).get(offset, 0) for offset in (0, 1))
                if isinstance(low, int) and isinstance(high, int):
                    settings.config_mask = ((high << 8 | low) & WORD_MASK, symbol.place)

    def builtin_names(self) -> list[str]:
        return [name for name, (dialects, _, _) in _TABLE.items() if self.dialect in dialects]

    def builtin(self, name: str, node: Any, arguments: list[Any]) -> Expr | None:
        row = _TABLE.get(name)
        if row is None or self.dialect not in row[0]:
            if row is not None:
                raise self.fail(f"'{name}' belongs to the {NAMES[row[0][0]]} dialect", node)
            return None
        _, count, handler = row
        if len(arguments) != count:
            raise self.fail(
                f"'{name}' takes {count} argument{'s' * (count != 1)}, {len(arguments)} "
                f"{'is' if len(arguments) == 1 else 'are'} given",
                node,
            )
        return handler(self, name, node, arguments)

    # helpers

    def register_ref(self, name: str, place: Place) -> Ref:
        symbol = self.scopes.register(registers()[name])
        return Ref(symbol, 0, None, U8, place)

    def chip_bit(self, name: str, place: Place) -> Ref:
        register, bit = register_bits()[name]
        return Ref(self.scopes.register(register), 0, None, BIT, place, bit, 1)

    def set_bit(self, target: Ref | Deref, value: int) -> Expr:
        return Assign(target, Num(value, BIT, target.place), BIT, target.place)

    def _bit_number(self, node: Any) -> Expr:
        """A bit's number: a constant, or the name of a bit."""
        if isinstance(node, c_ast.ID):
            found = self.scopes.find(node.name)
            if isinstance(found, ChipBit):
                return Num(found.bit, self.int_type, self.place(node))
        return self.arithmetic(self.expr(node))

    def bit_target(self, variable: Any, number: Any, node: Any) -> Ref | Deref | tuple[Ref | Deref, Expr]:
        """The bit that set_bit and its kin mean; variable and number when the number is not a constant."""
        base = self.expr(variable)
        if not isinstance(base, (Ref, Deref)) or not isinstance(base.type, IntType):
            raise self.fail("the first argument must be a variable or a register", node)
        bit = self._bit_number(number)
        if isinstance(bit, Num):
            found = self.bit_of(base, bit.value, node)
            assert isinstance(found, (Ref, Deref))
            return found
        return base, bit

    def _mask(self, base: Ref | Deref, bit: Expr, place: Place) -> Expr:
        assert isinstance(base.type, IntType)
        work = base.type.plain()
        assert isinstance(work, IntType)
        return Binary("<<", Num(1, work, place), bit, work, place)

    def delay_cycles(self, us: Fraction, node: Any) -> int:
        """Whole cycles of a time; warns when it is rounded."""
        if self.clock is None:
            raise self.fail(
                "the clock frequency is not known",
                node,
                hint="say '#pragma CLOCK_FREQ 4000000', '#define _XTAL_FREQ 4000000' or --clock-hz",
            )
        rounded = self.clock.round_us(us)
        if not rounded.exact:
            self.reporter.warn(
                f"{_decimal(us)} µs is not a whole number of cycles at {self.clock.hz} Hz: "
                f"{rounded.cycles} cycles are {_decimal(rounded.achieved_us)} µs",
                self.place(node),
            )
        return rounded.cycles

    def constant_us(self, node: Any) -> Fraction | None:
        """A constant argument of a delay; fractions are allowed in XC8."""
        expr = self.rvalue(self.expr(node))
        return Fraction(expr.value) if isinstance(expr, Num) else None


def _decimal(value: Fraction) -> str:
    return f"{float(value):.10g}"


_Handler = Callable[[Builtins, str, Any, list[Any]], Expr]


def _bit_function(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
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


def _port_write(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
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


def _port_read(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    return self.register_ref("PORTA" if name.endswith("a") else "PORTB", self.place(node))


def _port_bit(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    register = c_ast.ID("PORTA" if name.endswith("a") else "PORTB", node.coord)
    function = "set_bit" if "_high_" in name else "clear_bit"
    return _bit_function(self, function, node, [register, arguments[0]])


def _interrupt_bit(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    register = c_ast.ID("INTCON", node.coord)
    return _bit_function(
        self, "set_bit" if name.startswith("enable") else "clear_bit", node, [register, arguments[0]]
    )


def _global_interrupts(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    return Cast(
        self.set_bit(self.chip_bit("GIE", self.place(node)), int(name == "ei")), VOID, self.place(node)
    )


def _instruction(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    mnemonic = {"nop": "NOP", "clear_wdt": "CLRWDT", "clrwdt": "CLRWDT", "sleep": "SLEEP"}.get(
        name.lower().strip("_"), ""
    )
    return Builtin("instruction", [], VOID, self.place(node), mnemonic)


def _delay(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    place = self.place(node)
    unit = _UNITS_US[name]
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


def _xc8_delay(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    place = self.place(node)
    value = self.constant_us(arguments[0])
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
        cycles = self.delay_cycles(value * _XC8_UNITS_US[name], node)
        if cycles > MAX_DELAY:
            raise self.fail(
                f"'{name}' takes at most {MAX_DELAY} cycles, these are {cycles}",
                arguments[0],
                hint="call it several times, or in a loop",
            )
    return Builtin("delay", [], VOID, place, cycles)


def _eeprom_read(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    address = self.convert(self.expr(arguments[0]), U8, "the address")
    return Builtin("eeprom_read", [address], U8, self.place(node))


def _eeprom_write(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    address = self.convert(self.expr(arguments[0]), U8, "the address")
    value = self.convert(self.expr(arguments[1]), U8, "the value")
    return Builtin("eeprom_write", [address, value], VOID, self.place(node))


def _serial(self: Builtins, name: str, node: Any, arguments: list[Any]) -> Expr:
    wanted = ("TXPORT", "TXPIN", "BAUD") if name == "putchar" else ("RXPORT", "RXPIN", "BAUD")
    for each in wanted:
        if each not in self.serial_settings:
            raise self.fail(f"'{name}' needs '#pragma RS232_{each} …'", node)
    kind = wanted[0][:2]
    port = _serial_number(self, f"{kind}PORT", node)
    pin = _serial_number(self, f"{kind}PIN", node)
    baud = _serial_number(self, "BAUD", node)
    if not 0 <= pin <= 7 or not 0 <= port <= RAM_LAST:
        raise self.fail(f"the serial pin {port}.{pin} does not exist", node)
    if baud <= 0:
        raise self.fail(f"the baud rate must be positive, not {baud}", node)
    cycles = _bit_cycles(self, baud, node)
    inverted = self.serial_settings.get("TRUE", "1") == "0"
    data = (port, pin, cycles, inverted)
    if name == "putchar":
        value = self.convert(self.expr(arguments[0]), U8, "the argument of 'putchar'")
        return Builtin("putchar", [value], VOID, self.place(node), data)
    return Builtin("getchar", [], U8, self.place(node), data)


def _serial_number(self: Builtins, name: str, node: Any) -> int:
    text = self.serial_settings[name]
    if text.upper() in registers():
        return registers()[text.upper()].address
    if not re.fullmatch(r"0[xX][0-9a-fA-F]+|\d+", text):
        raise self.fail(f"'#pragma RS232_{name} {text}': a number is needed", node)
    return int(text, 16 if text[1:2] in ("x", "X") else 10)


def _bit_cycles(self: Builtins, baud: int, node: Any) -> int:
    if self.clock is None:
        self.delay_cycles(Fraction(1), node)
    assert self.clock is not None
    cycles = self.clock.round_us(Fraction(1_000_000, baud)).cycles
    if cycles < 16:
        raise self.fail(f"{baud} baud is too fast: a bit has only {cycles} cycles, 16 are needed", node)
    return cycles


_BOTH, _C, _X = (C2C, XC8), (C2C,), (XC8,)
_TABLE: dict[str, tuple[tuple[str, ...], int, _Handler]] = {
    **dict.fromkeys(("set_bit", "clear_bit", "test_bit", "toggle_bit"), (_C, 2, _bit_function)),
    **dict.fromkeys(
        ("set_tris_a", "set_tris_b", "output_port_a", "output_port_b", "set_option"), (_C, 1, _port_write)
    ),
    **dict.fromkeys(("input_port_a", "input_port_b"), (_C, 0, _port_read)),
    **{f"output_{level}_port_{port}": (_C, 1, _port_bit) for level in ("high", "low") for port in ("a", "b")},
    "enable_interrupt": (_C, 1, _interrupt_bit),
    "disable_interrupt": (_C, 1, _interrupt_bit),
    **dict.fromkeys(("nop", "clear_wdt", "sleep"), (_C, 0, _instruction)),
    **dict.fromkeys(("NOP", "CLRWDT", "SLEEP", "__nop"), (_X, 0, _instruction)),
    **dict.fromkeys(("ei", "di"), (_X, 0, _global_interrupts)),
    **dict.fromkeys(_UNITS_US, (_C, 1, _delay)),
    **dict.fromkeys(("__delay_us", "__delay_ms", "_delay"), (_X, 1, _xc8_delay)),
    "eeprom_read": (_X, 1, _eeprom_read),
    "eeprom_write": (_X, 2, _eeprom_write),
    "putchar": (_C, 1, _serial),
    "getchar": (_C, 0, _serial),
}
