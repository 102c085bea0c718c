"""The functions built into the dialects: registers, bits, delays, EEPROM, the serial line.

In: the name and arguments of a call. Out: ordinary expressions on registers and bits if the call means that,
`Builtin` nodes for delays, NOP and the library.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from fractions import Fraction
from typing import Any

from pycparser import c_ast

import servogen.compiler.sema.formats as formats
from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import interval
from servogen.compiler.ast.float_values import decode
from servogen.compiler.ast.types import BIT, S8, U8, U16, U32, VOID, FloatType, IntType
from servogen.compiler.frontend.dialects import C2C, DIALECTS, NAMES, XC8, ChipBit
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.conversions import arithmetic, cast, convert, rvalue
from servogen.compiler.sema.floats import square_root, without_sign
from servogen.compiler.sema.lvalues import assignable, bit_of
from servogen.compiler.sema.names import characters, expression
from servogen.errors import Location
from servogen.pic.device import RAM_LAST, WATCHDOG_US, register_bits, registers
from servogen.units import Clock, Cycles, counted


def register_ref(analyser: Analyser, name: str, place: Location) -> tree.Ref:
    symbol = analyser.scopes.register(registers()[name])
    return tree.Ref(symbol, 0, None, U8, place)


def chip_bit(analyser: Analyser, name: str, place: Location) -> tree.Ref:
    register, bit = register_bits()[name]
    return tree.Ref(analyser.scopes.register(register), 0, None, BIT, place, bit, 1)


def set_bit(target: tree.Ref | tree.Deref, value: int) -> tree.Expr:
    return tree.Assign(target, tree.Num(value, BIT, target.place), BIT, target.place)


def _bit_number(analyser: Analyser, node: Any) -> tree.Expr:
    """Return the number of a bit, given as a constant or as the name of a bit."""
    if isinstance(node, c_ast.ID):
        symbol = analyser.scopes.find(node.name)
        if isinstance(symbol, ChipBit):
            return tree.Num(symbol.bit, analyser.int_type, analyser.place(node))
    return arithmetic(analyser, expression(analyser, node))


def bit_target(
    analyser: Analyser, variable: Any, number: Any, node: Any
) -> tree.Ref | tree.Deref | tuple[tree.Ref | tree.Deref, tree.Expr]:
    """Return the bit that set_bit and similar functions refer to, or variable and number if the number is not
    constant.
    """
    base = expression(analyser, variable)
    if not isinstance(base, (tree.Ref, tree.Deref)) or not isinstance(base.type, IntType):
        raise analyser.fail("c-argument", "the first argument must be a variable or a register", node)
    bit = _bit_number(analyser, number)
    if isinstance(bit, tree.Num):
        target = bit_of(analyser, base, bit.value, node)
        assert isinstance(target, (tree.Ref, tree.Deref))
        return target
    return base, bit


def bit_mask(base: tree.Ref | tree.Deref, bit: tree.Expr, place: Location) -> tree.Expr:
    assert isinstance(base.type, IntType)
    work = base.type.plain()
    assert isinstance(work, IntType)
    return tree.Binary("<<", tree.Num(1, work, place), bit, work, place)


def delay_cycles(analyser: Analyser, us: Fraction, node: Any, *, cut: bool = False) -> int:
    """Return a time in whole cycles, rounded to the nearest or down; warns in both cases."""
    if analyser.clock is None:
        raise analyser.fail(
            "c-clock",
            "the clock frequency is not known",
            node,
            hint="write '#pragma CLOCK_FREQ 4000000' or '#define _XTAL_FREQ 4000000', or give --clock-hz",
        )
    cycles = Cycles(us // analyser.clock.cycle_us) if cut else analyser.clock.round_us(us).cycles
    achieved = analyser.clock.us(cycles)
    if achieved != us:
        analyser.reporter.warn(
            "delay-rounded",
            f"{_decimal(us)} µs is not a whole number of cycles at {analyser.clock.hz} Hz: "
            f"{counted(cycles, 'cycle')} {'is' if cycles == 1 else 'are'} {_decimal(achieved)} µs",
            analyser.place(node),
        )
    return cycles


def constant_us(analyser: Analyser, node: Any, *, fractions: bool = False) -> Fraction | None:
    """Return the constant argument of a delay; with `fractions`, floating constants are allowed too."""
    exact = _fraction(analyser, node) if fractions else None
    if exact is not None:
        return exact
    expr = rvalue(analyser, expression(analyser, node))
    if isinstance(expr, tree.Num) and isinstance(expr.type, FloatType):
        value = decode(expr.value, expr.type) if fractions else None
        if value is None:
            raise analyser.fail("c-argument", "the time must be a whole number", node)
        return value
    return Fraction(expr.value) if isinstance(expr, tree.Num) else None


def _fraction(analyser: Analyser, node: Any) -> Fraction | None:
    """Return the exact value of `2.5` or `2.5 * 3`; None if there is no floating constant or no constant
    value.
    """
    match node:
        case c_ast.Constant(type="float" | "double" | "long double", value=text):
            return Fraction(text.rstrip("fFlL")) if _SHORT_FLOAT.fullmatch(text) else None
        case c_ast.UnaryOp(op="+" | "-", expr=inner):
            value = _fraction(analyser, inner)
            return -value if value is not None and node.op == "-" else value
        case c_ast.BinaryOp(op="+" | "-" | "*" | "/"):
            left, right = _fraction(analyser, node.left), _fraction(analyser, node.right)
            if left is None and right is None:
                return None  # an expression of integers follows the integer rules of C
            left = constant_us(analyser, node.left) if left is None else left
            right = constant_us(analyser, node.right) if right is None else right
            if left is None or right is None or (node.op == "/" and right == 0):
                return None
            return _ARITHMETIC[node.op](left, right)
    return None


_SHORT_FLOAT = re.compile(r"[\d.]{1,30}([eE][+-]?\d{1,2})?[fFlL]?")
"""A number that is short enough to be a time."""
_ARITHMETIC: dict[str, Callable[[Fraction, Fraction], Fraction]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}


def _decimal(value: Fraction) -> str:
    return f"{float(value):.10g}"


MAX_DELAY = 50_463_240
"""The longest `_delay(n)`, in cycles, as XC8 documents it."""

UNKNOWN_CLOCK_HZ = 4_000_000
"""The clock by which delays are counted where nothing states one: the crystal of most boards."""

UNITS_US = {"delay_us": 1, "delay_10us": 10, "delay_100us": 100, "delay_ms": 1000, "delay_s": 1_000_000}
XC8_UNITS_US = {"__delay_us": 1, "__delay_ms": 1000, "__delaywdt_us": 1, "__delaywdt_ms": 1000}


def bit_function(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    """Return the meaning of set_bit, clear_bit, toggle_bit or test_bit."""
    place = analyser.place(node)
    target = bit_target(analyser, arguments[0], arguments[1], node)
    if isinstance(target, tuple):
        base, bit = target
        mask = bit_mask(base, bit, place)
        assert isinstance(base.type, IntType)
        work = base.type.plain()
        assert isinstance(work, IntType)
        if name == "test_bit":
            return tree.Binary(
                "!=",
                tree.Binary("&", base, mask, work, place),
                tree.Num(0, work, place),
                analyser.int_type,
                place,
            )
        assignable(analyser, base, node)
        op = {"set_bit": "|", "clear_bit": "&", "toggle_bit": "^"}[name]
        value = tree.Unary("~", mask, work, place) if name == "clear_bit" else mask
        return tree.Cast(tree.Update(op, base, value, work, False, work, place), VOID, place)
    if name == "test_bit":
        return target
    assignable(analyser, target, node)
    if name == "toggle_bit":
        return tree.Cast(tree.Update("^", target, tree.Num(1, U8, place), U8, False, BIT, place), VOID, place)
    return tree.Cast(set_bit(target, int(name == "set_bit")), VOID, place)


def port_write(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    """Return the assignment to a port, TRIS or OPTION register."""
    register = {
        "set_tris_a": "TRISA",
        "set_tris_b": "TRISB",
        "output_port_a": "PORTA",
        "output_port_b": "PORTB",
        "set_option": "OPTION_REG",
    }[name]
    value = convert(analyser, expression(analyser, arguments[0]), U8, f"the argument of '{name}'")
    return tree.Cast(
        tree.Assign(register_ref(analyser, register, analyser.place(node)), value, U8, analyser.place(node)),
        VOID,
        analyser.place(node),
    )


def port_read(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    return register_ref(analyser, "PORTA" if name.endswith("a") else "PORTB", analyser.place(node))


def port_bit(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    register = c_ast.ID("PORTA" if name.endswith("a") else "PORTB", node.coord)
    function = "set_bit" if "_high_" in name else "clear_bit"
    return bit_function(analyser, function, node, [register, arguments[0]])


def port_input(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    register = c_ast.ID("PORTA" if name.endswith("a") else "PORTB", node.coord)
    return bit_function(analyser, "test_bit", node, [register, arguments[0]])


def interrupt_bit(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    register = c_ast.ID("INTCON", node.coord)
    return bit_function(
        analyser, "set_bit" if name.startswith("enable") else "clear_bit", node, [register, arguments[0]]
    )


def global_interrupts(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    """Return `ei()` or `di()`: GIE set or cleared (DS35007 section 6.8)."""
    return tree.Cast(
        set_bit(chip_bit(analyser, "GIE", analyser.place(node)), int(name == "ei")),
        VOID,
        analyser.place(node),
    )


def instruction(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    mnemonic = {"nop": "NOP", "clear_wdt": "CLRWDT", "clrwdt": "CLRWDT", "sleep": "SLEEP"}.get(
        name.lower().strip("_"), ""
    )
    clears = mnemonic in ("CLRWDT", "SLEEP")
    return tree.Builtin("instruction", [], VOID, analyser.place(node), mnemonic, clears_watchdog=clears)


def delay(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    """Return a delay of BoostC: constant, or a routine's with a variable argument of 8 bits."""
    place = analyser.place(node)
    unit = UNITS_US[name]
    value = constant_us(analyser, arguments[0])
    if value is not None:
        if not 0 <= value <= 255:
            raise analyser.fail("c-argument", f"'{name}' takes 0 to 255, not {value}", arguments[0])
        return tree.Builtin("delay", [], VOID, place, delay_cycles(analyser, value * unit, node))
    given = rvalue(analyser, expression(analyser, arguments[0]))
    if interval(given)[1] > U8.high:
        analyser.reporter.warn(
            "c-conversion",
            f"'{name}' takes 0 to 255: only the low 8 bits of this '{given.type}' are used",
            analyser.place(arguments[0]),
            hint="call it in a loop",
        )
    argument = convert(analyser, given, U8, f"the argument of '{name}'")
    cycles = delay_cycles(analyser, Fraction(unit), node)
    if cycles == 0:
        raise analyser.fail(
            "c-clock",
            f"'{name}' with a variable argument needs a clock whose cycle is at most {unit} µs",
            node,
        )
    return tree.Builtin("delay_variable", [argument], VOID, place, cycles)


def xc8_delay(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    return tree.Builtin("delay", [], VOID, analyser.place(node), _xc8_cycles(analyser, name, node, arguments))


def watched_delay(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    """Return a delay that clears the watchdog when it begins, and again before the shortest time after which
    a watchdog without prescaler resets the chip.
    """
    cycles = _xc8_cycles(analyser, name, node, arguments)
    clock = analyser.clock or Clock(UNKNOWN_CLOCK_HZ)
    unwatched = int(WATCHDOG_US[0] // clock.cycle_us)
    data = (cycles, unwatched)
    return tree.Builtin("delay_watched", [], VOID, analyser.place(node), data, clears_watchdog=True)


def reset(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    """Return a jump to address 0; the chip has no instruction that resets it."""
    return tree.Builtin("restart", [], VOID, analyser.place(node), returns=False)


def _xc8_cycles(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> int:
    """Return the cycles of a delay of XC8, whose argument is constant."""
    counted = name in ("_delay", "_delaywdt")
    value = constant_us(analyser, arguments[0], fractions=not counted)
    if value is None:
        raise analyser.fail(
            "c-argument",
            f"'{name}' needs a constant argument",
            arguments[0],
            hint="call it in a loop that counts the variable",
        )
    if counted:
        cycles = int(value)
        if not 0 <= cycles <= MAX_DELAY:
            raise analyser.fail(
                "c-argument", f"'{name}' takes 0 to {MAX_DELAY} cycles, not {cycles}", arguments[0]
            )
    else:
        if value < 0:
            raise analyser.fail("c-argument", f"'{name}' cannot take a negative time", arguments[0])
        cycles = delay_cycles(analyser, value * XC8_UNITS_US[name], node, cut=True)
        if cycles > MAX_DELAY:
            raise analyser.fail(
                "c-argument",
                f"'{name}' takes at most {MAX_DELAY} cycles, not {cycles}",
                arguments[0],
                hint="call it several times, or in a loop",
            )
    return cycles


def eeprom_read(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    address = convert(analyser, expression(analyser, arguments[0]), U8, "the address")
    return tree.Builtin("eeprom_read", [address], U8, analyser.place(node), pure=True)


def eeprom_write(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    address = convert(analyser, expression(analyser, arguments[0]), U8, "the address")
    value = convert(analyser, expression(analyser, arguments[1]), U8, "the value")
    return tree.Builtin("eeprom_write", [address, value], VOID, analyser.place(node))


def formatted(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    """Return the calls that write the parts of a constant format string, one for each conversion and for the
    text between two.
    """
    place = analyser.place(node)
    fixed = 2 if name == "sprintf" else 1
    if len(arguments) < fixed:
        raise analyser.fail("c-argument", f"'{name}' needs a format string", node)
    text = arguments[fixed - 1]
    if not isinstance(text, c_ast.Constant) or text.type != "string":
        raise analyser.fail("c-unsupported", f"the format of '{name}' must be a string constant", text)
    rest = list(arguments[fixed:])
    target = [expression(analyser, arguments[0])] if name == "sprintf" else []
    steps = [_library_call(analyser, f"__{name}_begin", target, node)]
    for part in formats.parts(bytes(characters(analyser, text.value, place))):
        if part.problem:
            raise analyser.fail("c-unsupported", f"the format of '{name}': {part.problem}", text)
        values: list[tree.Expr] = []
        if part.takes_value:
            if not rest:
                raise analyser.fail("c-argument", f"'{name}': there is no argument for {part.spelling}", node)
            values = [_value_to_format(analyser, name, part, rest.pop(0))]
        elif part.function == "text":
            values = [analyser.string([*part.text, 0], place)]
        numbers: list[tree.Expr] = [tree.Num(byte, U8, place) for byte in part.numbers]
        steps.append(_library_call(analyser, f"__{name}_{part.function}", values + numbers, node))
    if rest:
        raise analyser.fail(
            "c-argument", f"'{name}': the format has no conversion for this argument", rest[0]
        )
    printing = _library_call(analyser, f"__{name}_end", [], node)
    for step in reversed(steps):
        printing = tree.Comma(step, printing, printing.type, place)
    return printing


def _value_to_format(analyser: Analyser, name: str, part: formats.FormatPart, argument: Any) -> tree.Expr:
    """Return the argument of a conversion as the library function of its kind takes it."""
    value = rvalue(analyser, expression(analyser, argument))
    wanted = 4 if part.function == "long" else 2
    if (
        part.function not in ("text", "string")
        and isinstance(value.type, IntType)
        and value.type.size > wanted
    ):
        analyser.reporter.warn(
            "c-conversion",
            f"'{name}': {part.spelling} prints only the low {8 * wanted} bits of '{value.type}'",
            analyser.place(argument),
            hint=f"%l{part.spelling[-1]} prints 32 bits" if wanted == 2 else None,
        )
    if isinstance(value.type, FloatType):
        raise analyser.fail(
            "c-argument",
            f"'{name}': {part.spelling} cannot print '{value.type}'",
            argument,
            hint="convert it to an integer with a cast",
        )
    if isinstance(value.type, IntType) and "hh" in part.spelling:
        value = cast(analyser, value, S8 if part.spelling[-1] in "di" else U8)
    kinds = {"int": U16, "long": U32, "char": U8}
    if isinstance(value.type, IntType) and part.function in kinds:
        return cast(analyser, value, kinds[part.function])
    return value


def _library_call(analyser: Analyser, name: str, arguments: list[tree.Expr], node: Any) -> tree.Expr:
    """Return the call of a library function on converted arguments."""
    function = analyser.dispatch.library(analyser, name)
    analyser.called.add(function.name)
    converted = [
        convert(analyser, given, parameter.type, f"the argument of '{name.split('_')[2]}'")
        for given, parameter in zip(arguments, function.parameters, strict=True)
    ]
    return tree.Call(function.name, converted, function.result.plain(), analyser.place(node))


def of_float(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    """Return the expression for a function of <math.h> that needs no routine."""
    role = f"the argument of '{name.strip('_')}'"
    value = convert(analyser, expression(analyser, arguments[0]), analyser.float_type, role)
    function = without_sign if name == "__fabs" else square_root
    return function(value, analyser.place(node))


def serial(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr:
    """Return the meaning of putchar or getchar, on the pin and at the rate that `#pragma RS232_…` gives."""
    wanted = ("TXPORT", "TXPIN", "BAUD") if name == "putchar" else ("RXPORT", "RXPIN", "BAUD")
    for function in wanted:
        if function not in analyser.serial_settings:
            raise analyser.fail("c-argument", f"'{name}' needs '#pragma RS232_{function} …'", node)
    kind = wanted[0][:2]
    port = serial_number(analyser, f"{kind}PORT", node)
    pin = serial_number(analyser, f"{kind}PIN", node)
    baud = serial_number(analyser, "BAUD", node)
    if not 0 <= pin <= 7 or not 0 <= port <= RAM_LAST:
        raise analyser.fail("c-argument", f"the serial pin {port}.{pin} does not exist", node)
    if baud <= 0:
        raise analyser.fail("c-argument", f"the baud rate must be positive, not {baud}", node)
    cycles = bit_cycles(analyser, baud, node)
    inverted = analyser.serial_settings.get("TRUE", "1") == "0"
    data = (port, pin, cycles, inverted)
    if name == "putchar":
        value = convert(analyser, expression(analyser, arguments[0]), U8, "the argument of 'putchar'")
        return tree.Builtin("putchar", [value], VOID, analyser.place(node), data)
    return tree.Builtin("getchar", [], U8, analyser.place(node), data)


def serial_number(analyser: Analyser, name: str, node: Any) -> int:
    """Return a number of a `#pragma RS232_…`: a register's address, or a literal."""
    text = analyser.serial_settings[name]
    if text.upper() in registers():
        return registers()[text.upper()].address
    if not re.fullmatch(r"0[xX][0-9a-fA-F]+|\d+", text):
        raise analyser.fail("c-argument", f"'#pragma RS232_{name} {text}': a number is needed", node)
    return int(text, 16 if text[1:2] in ("x", "X") else 10)


def bit_cycles(analyser: Analyser, baud: int, node: Any) -> int:
    """Return the cycles of one bit at a baud rate."""
    if analyser.clock is None:
        delay_cycles(analyser, Fraction(1), node)
    assert analyser.clock is not None
    cycles = analyser.clock.round_us(Fraction(1_000_000, baud)).cycles
    if cycles < 16:
        raise analyser.fail(
            "c-argument", f"{baud} baud is too fast: a bit has only {cycles} cycles, 16 are needed", node
        )
    return cycles


def builtin_names(analyser: Analyser) -> list[str]:
    return [name for name, (dialects, _, _) in BUILTINS.items() if analyser.dialect in dialects]


def builtin(analyser: Analyser, name: str, node: Any, arguments: list[Any]) -> tree.Expr | None:
    """Return the meaning of a call of a built-in function; None if the name is not one."""
    row = BUILTINS.get(name)
    if row is None or analyser.dialect not in row[0]:
        if row is not None:
            raise analyser.fail(
                "c-unsupported",
                f"'{name}' belongs to the {NAMES[row[0][0]]} dialect",
                node,
                hint=f"the option --dialect {row[0][0]} selects it",
            )
        return None
    _, count, handler = row
    if count is not None and len(arguments) != count:
        raise analyser.fail(
            "c-argument",
            f"'{name}' takes {count} argument{'s' * (count != 1)}, {len(arguments)} "
            f"{'is' if len(arguments) == 1 else 'are'} given",
            node,
        )
    return handler(analyser, name, node, arguments)


_Handler = Callable[[Analyser, str, Any, list[Any]], tree.Expr]
_BOTH, _C, _X = (C2C, XC8), (C2C,), (XC8,)
BUILTINS: dict[str, tuple[tuple[str, ...], int | None, _Handler]] = {
    # name: dialects, number of arguments (None: any), meaning
    **dict.fromkeys(("set_bit", "clear_bit", "test_bit", "toggle_bit"), (_C, 2, bit_function)),
    **dict.fromkeys(
        ("set_tris_a", "set_tris_b", "output_port_a", "output_port_b", "set_option"), (_C, 1, port_write)
    ),
    **dict.fromkeys(("input_port_a", "input_port_b"), (_C, 0, port_read)),
    **{f"output_{level}_port_{port}": (_C, 1, port_bit) for level in ("high", "low") for port in ("a", "b")},
    **dict.fromkeys(("input_pin_port_a", "input_pin_port_b"), (_C, 1, port_input)),
    "enable_interrupt": (_C, 1, interrupt_bit),
    "disable_interrupt": (_C, 1, interrupt_bit),
    **dict.fromkeys(("nop", "clear_wdt", "sleep"), (_C, 0, instruction)),
    **dict.fromkeys(("NOP", "CLRWDT", "SLEEP", "__nop"), (_X, 0, instruction)),
    **dict.fromkeys(("ei", "di"), (_X, 0, global_interrupts)),
    **dict.fromkeys(UNITS_US, (_C, 1, delay)),
    **dict.fromkeys(("__delay_us", "__delay_ms", "_delay"), (_X, 1, xc8_delay)),
    **dict.fromkeys(("printf", "sprintf"), (DIALECTS, None, formatted)),
    **dict.fromkeys(("__fabs", "__sqrt"), (DIALECTS, 1, of_float)),
    "reset": (_C, 0, reset),
    **dict.fromkeys(("_delaywdt", "__delaywdt_us", "__delaywdt_ms"), (_X, 1, watched_delay)),
    "eeprom_read": (_BOTH, 1, eeprom_read),
    "eeprom_write": (_BOTH, 2, eeprom_write),
    "EEPROM_READ": (_X, 1, eeprom_read),
    "EEPROM_WRITE": (_X, 2, eeprom_write),
    "putchar": (_C, 1, serial),
    "getchar": (_C, 0, serial),
}
