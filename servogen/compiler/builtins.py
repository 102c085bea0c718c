"""The functions that the dialects have built in: their names, dialects and counts of arguments.

In: a call's name and arguments. Out: what `builtin_functions` makes of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from servogen.compiler.builtin_functions import (
    UNITS_US,
    bit_function,
    delay,
    eeprom_read,
    eeprom_write,
    global_interrupts,
    instruction,
    interrupt_bit,
    port_bit,
    port_read,
    port_write,
    xc8_delay,
)
from servogen.compiler.chip_access import ChipAccess
from servogen.compiler.ctypes import FuncType
from servogen.compiler.dialect import C2C, NAMES, XC8
from servogen.compiler.program import Function
from servogen.compiler.rewrite import CONFIG_NAME, EEPROM_NAME, Rewritten
from servogen.compiler.scopes import Constant, Scopes
from servogen.compiler.serial_builtins import serial
from servogen.compiler.settings import Settings
from servogen.compiler.tree import Expr
from servogen.errors import Place
from servogen.pic.device import CONFIG_ADDRESS, EEPROM_BYTES
from servogen.pic.isa import WORD_MASK

EEPROM_DATA_VALUES = 8
"""What one `__EEPROM_DATA` holds (XC8 User's Guide, library functions)."""


class Builtins(ChipAccess):
    """Adds the built-in functions, and what files as a whole say."""

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
            if symbol.type.size != EEPROM_DATA_VALUES:
                self.reporter.error(
                    f"__EEPROM_DATA takes {EEPROM_DATA_VALUES} values, not {symbol.type.size}",
                    symbol.place,
                    hint="fill the rest with 0",
                )
            for value in (symbol.initial or {}).values():
                at = len(self.program.eeprom)
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


_Handler = Callable[[ChipAccess, str, Any, list[Any]], Expr]
_BOTH, _C, _X = (C2C, XC8), (C2C,), (XC8,)
_TABLE: dict[str, tuple[tuple[str, ...], int, _Handler]] = {
    **dict.fromkeys(("set_bit", "clear_bit", "test_bit", "toggle_bit"), (_C, 2, bit_function)),
    **dict.fromkeys(
        ("set_tris_a", "set_tris_b", "output_port_a", "output_port_b", "set_option"), (_C, 1, port_write)
    ),
    **dict.fromkeys(("input_port_a", "input_port_b"), (_C, 0, port_read)),
    **{f"output_{level}_port_{port}": (_C, 1, port_bit) for level in ("high", "low") for port in ("a", "b")},
    "enable_interrupt": (_C, 1, interrupt_bit),
    "disable_interrupt": (_C, 1, interrupt_bit),
    **dict.fromkeys(("nop", "clear_wdt", "sleep"), (_C, 0, instruction)),
    **dict.fromkeys(("NOP", "CLRWDT", "SLEEP", "__nop"), (_X, 0, instruction)),
    **dict.fromkeys(("ei", "di"), (_X, 0, global_interrupts)),
    **dict.fromkeys(UNITS_US, (_C, 1, delay)),
    **dict.fromkeys(("__delay_us", "__delay_ms", "_delay"), (_X, 1, xc8_delay)),
    "eeprom_read": (_X, 1, eeprom_read),
    "eeprom_write": (_X, 2, eeprom_write),
    "putchar": (_C, 1, serial),
    "getchar": (_C, 0, serial),
}
