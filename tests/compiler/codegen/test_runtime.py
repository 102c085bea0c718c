"""The library's routines by themselves: results, words, exact cycles, bounds, the order of stores."""

from __future__ import annotations

import random
from collections.abc import Callable
from itertools import pairwise, product

from servogen.compiler.codegen.runtime import build, min_units
from servogen.compiler.ir.instruction import DELAY, Byte, Instruction, Loc
from tests.compiler.cases import every
from tests.compiler.codegen.routines import Library
from tests.compiler.ir.assembly import Chip, Names, shown


class Routine:
    """One routine; its variables by name, or as its parameters and result."""

    def __init__(self, kind: str, *key: int, chip: Callable[..., Chip] = Chip) -> None:
        self.library = Library(build)
        self.function = self.library(kind, key)
        self.make = chip

    def symbol(self, name: str) -> Byte:
        own = [each for function in self.library.functions.values() for each in function.own]
        return Byte(next(each for each in own if each.name == name), 0)

    def call(self, *arguments: int, registers: dict[str, int] | None = None) -> Chip:
        names = Names()
        chip = self.make(
            self.library.functions, {names.loc(name): value for name, value in (registers or {}).items()}
        )
        for function in self.library.functions.values():
            for symbol in function.own:
                chip.store(symbol, 0xC3C3C3C3, symbol.size)
        for parameter, value in zip(self.function.parameters, arguments, strict=True):
            if parameter is self.function.w_parameter:
                chip.w = value
            else:
                chip.store(parameter, value, parameter.size)
        chip.call(self.function.name)
        return chip

    def call_w(self, value: int) -> Chip:
        """Call it with its argument in W."""
        chip = self.make(self.library.functions)
        chip.w = value
        chip.call(self.function.name)
        return chip

    def result(self, *arguments: int) -> int:
        symbol = self.function.result
        assert symbol is not None
        return self.call(*arguments).number(symbol, symbol.size)


def values(size: int) -> list[int]:
    dice = random.Random(size)
    top = 1 << 8 * size - 1
    return [
        0, 1, 2, 3, top - 1, top, top + 1, 2 * top - 2, 2 * top - 1,
        *(dice.randrange(2 * top) for _ in range(5)),
    ]  # fmt: skip


@every(
    ("width", "factor", "size"),
    [(1, 1, 1), (1, 1, 2), (2, 1, 2), (2, 2, 2), (3, 1, 3), (3, 3, 3), (4, 1, 4), (4, 4, 4)],
)
def test_a_product(width: int, factor: int, size: int) -> None:
    routine = Routine("mul", width, factor, size)
    a, b = routine.function.parameters
    # RRF of the factor, a test, the sum in place, RLF, the test for the last bit; of bytes: RRF thrice
    words = 13 if (width, factor, size) == (1, 1, 2) else 6 * size + 2 * factor + 5
    assert routine.function.size == words
    for one, two in product(values(a.size)[::2], values(b.size)):
        assert routine.result(one, two) == one * two & (1 << 8 * size) - 1
    ((label, bound),) = routine.function.bounds.items()
    # a factor with its highest bit set needs a turn for each bit
    assert bound == 8 * factor == routine.call(1, 1 << 8 * factor - 1).passed[label]
    assert routine.function.w_parameter == (b if (width, factor, size) == (1, 1, 2) else None)


@every(("width", "factor"), [(2, 1), (2, 2)])
def test_a_product_that_keeps_all_bits(width: int, factor: int) -> None:
    routine = Routine("mul", width, factor, width + factor)
    # CLRF of the upper half, MOVLW, MOVWF, RRF of the factor; a test, the sum in place; RRF of all, the count
    assert routine.function.size == width + 2 + factor + 2 + (4 * width - 2) + (width + factor) + 3
    for one, two in product(values(width)[::2], values(factor)):
        assert routine.result(one, two) == one * two


@every("carry", [0, 1])
@every(("size", "width"), [(1, 1), (2, 1), (2, 2), (3, 2), (4, 1), (4, 4)])
def test_a_quotient_and_its_remainder(size: int, width: int, carry: int) -> None:
    routine = Routine("divide", size, width, carry)
    # CLRF, MOVLW, MOVWF; RLF through both; a comparison and a subtraction; BSF, DECFSZ, GOTO, RETURN
    assert routine.function.size == 10 * width + size + 5 + 2 * carry
    most = (1 << 8 * width) - 1 if carry else (1 << 8 * width - 1) - 1
    quotient, remainder = routine.symbol("quotient"), routine.symbol("remainder")
    for one, two in product(values(size)[::2], values(width)[::2]):
        if not 0 < two <= most:
            continue
        chip = routine.call(one, two)
        found = chip.number(quotient.symbol, size), chip.number(remainder.symbol, width)
        assert found == divmod(one, two)


def test_the_remainder_needs_another_bit_with_divisors_above_half_of_the_range() -> None:
    routine = Routine("divide", 1, 1, 1)
    for one, two in product((0, 1, 126, 127, 128, 129, 200, 254, 255), (1, 2, 127, 128, 129, 200, 254, 255)):
        chip = routine.call(one, two)
        found = (chip.memory[routine.symbol(name)] for name in ("quotient", "remainder"))
        assert tuple(found) == divmod(one, two)


@every("negative", [0, 1])
@every("size", [1, 2])
def test_a_signed_quotient_is_rounded_towards_zero(size: int, negative: int) -> None:
    routine = Routine("sdivide", size, size, 0, negative)
    negated = 2 if size == 1 else size + 2 * size - 1
    # CLRF signs; for each operand a test, its negation, MOVLW, XORWF; CALL; each result's
    assert routine.function.size == 1 + (1 + negative) * (negated + 4) + 1 + 2 * (negated + 2) + 1
    half, mask = 1 << 8 * size - 1, (1 << 8 * size) - 1
    quotient, remainder = routine.symbol("quotient"), routine.symbol("remainder")
    for one, two in product(values(size), values(size)):
        a, b = ((each ^ half) - half for each in (one, two))
        if b == 0 or (b < 0 and not negative) or b == -half:
            continue
        chip = routine.call(one, two)
        expected = abs(a) // abs(b) * (-1 if (a < 0) != (b < 0) else 1)
        assert chip.number(quotient.symbol, size) == expected & mask
        assert chip.number(remainder.symbol, size) == a - expected * b & mask


LOAD_AND_CALL = 3


@every("unit", [1, 2, 3, 4, 5, 6, 10, 11, 12, 13, 20, 50, 1000])
def test_a_variable_delay_takes_its_units(unit: int) -> None:
    routine = Routine("delay", unit)
    arguments = range(256) if unit <= 4 else (0, 1, 2, 3, 4, 10, 100, 254, 255)
    least = min_units(unit)
    for argument in arguments:
        chip = routine.call_w(argument)
        expected = argument * unit - LOAD_AND_CALL if argument >= least else 1 + 1 + 2
        assert chip.cycles == expected, argument
    ((label, bound),) = routine.function.bounds.items()
    assert routine.call_w(255).passed[label] in (bound, bound + 1)
    assert all(
        line.fixed != (isinstance(line, Instruction) and line.op == DELAY)
        for line in routine.function.lines()
    )


@every(("unit", "least"), [(5, 3), (6, 2), (11, 2), (12, 1), (1000, 1)])
def test_no_smaller_argument_could_be_exact(unit: int, least: int) -> None:
    """The way through load, call, test, loop and return takes 12 cycles (docs/compiler.md)."""
    assert min_units(unit) == least


class Uart(Chip):
    """A chip whose pin RB4 receives a signal, and which notes when it is read."""

    signal: Callable[[int], int] = staticmethod(lambda cycle: 1)

    def read(self, loc: Loc | None) -> int:
        if loc == Names().loc("PORTB"):
            self.reads = [*getattr(self, "reads", []), self.cycles]
            return int(self.signal(self.cycles)) << 4
        return super().read(loc)


@every("inverted", [0, 1])
@every("cycles", [20, 104, 833])
@every("value", [0x00, 0xFF, 0x55, 0xA6])
def test_a_byte_is_sent_low_bit_first_with_equal_bits(value: int, cycles: int, inverted: int) -> None:
    chip = Routine("putchar", 6, 4, cycles, inverted).call(value, registers={"PORTB": 0})
    bits = [0, *(value >> at & 1 for at in range(8)), 1]
    times = [when for when, _, _ in chip.stores]
    assert [store >> 4 & 1 for _, _, store in chip.stores] == [bit ^ inverted for bit in bits]
    assert {two - one for one, two in pairwise(times)} == {cycles}
    # the stop bit is as long when the routine returns
    assert chip.cycles - times[-1] == cycles


@every("inverted", [0, 1])
@every("cycles", [20, 105, 833])
@every("value", [0x00, 0xFF, 0x55, 0xA6])
def test_a_byte_is_sampled_in_the_middle_of_its_bits(value: int, cycles: int, inverted: int) -> None:
    start = 50

    def level(cycle: int) -> int:
        number = (cycle - start) // cycles
        bit = 1 if cycle < start or number > 8 else 0 if number == 0 else value >> number - 1 & 1
        return bit ^ inverted

    made = Routine("getchar", 6, 4, cycles, inverted, chip=Uart)
    Uart.signal = staticmethod(level)
    chip = made.call()
    assert chip.w == value
    reads: list[int] = chip.reads[-9:]  # type: ignore[attr-defined]
    seen, *samples = reads
    assert start <= seen < start + 3  # a turn of BTFSC and GOTO
    # one bit and a half from the edge, less the cycle of the test that saw it
    assert samples[0] - seen == cycles + cycles // 2 - 1
    assert {two - one for one, two in pairwise(samples)} == {cycles}
    assert made.function.waits_for == "a start bit"


class Eeprom(Chip):
    """A chip whose WR stays set for some reads of EECON1."""

    left = 3

    def read(self, loc: Loc | None) -> int:
        value = super().read(loc)
        if loc == Names().loc("EECON1"):
            self.left -= 1
            if self.left <= 0:
                value &= ~0x02
        return value


@every("enabled", [0x00, 0x80])
def test_a_byte_is_written_to_the_eeprom(enabled: int) -> None:
    """DS35007 section 3.2: WREN, 0x55 and 0xAA to EECON2, WR, with no interrupt in between."""
    routine = Routine("eeprom_write", chip=Eeprom)
    registers = {"EEDATA": 0, "EEADR": 0, "EECON1": 0, "EECON2": 0, "INTCON": enabled | 0x10}
    chip = routine.call(0x21, 0x43, registers=registers)
    expected = [
        *(("EEDATA", 0x43), ("EEADR", 0x21), ("INTCON", 0x10), ("EECON1", 0x04)),
        *(("EECON2", 0x55), ("EECON2", 0xAA)),
    ]
    found = [(name, value) for _, name, value in chip.stores]
    assert found[:6] == expected
    assert found[6][0] == found[7][0] == "EECON1"
    assert found[6][1] & 0x06 == 0x06 and found[7][1] & 0x04 == 0
    assert found[8:] == ([("INTCON", 0x90)] if enabled else [])
    # the three stores that the chip wants one behind the other: MOVLW and MOVWF, MOVLW and MOVWF, BSF
    times = [when for when, _, _ in chip.stores]
    assert [times[5] - times[4], times[6] - times[5]] == [2, 1]
    assert routine.function.waits_for == "the EEPROM"


def test_the_end_of_a_write_is_waited_for() -> None:
    registers = {"EEDATA": 0, "EEADR": 0, "EECON1": 0, "EECON2": 0, "INTCON": 0}

    def cycles(reads: int) -> int:
        routine = Routine("eeprom_write", chip=Eeprom)
        Eeprom.left = 3 + reads
        return routine.call(1, 2, registers=registers).cycles

    # MOVF, ANDLW, BTFSS, GOTO
    assert [cycles(reads) - cycles(1) for reads in (1, 2, 3, 10)] == [0, 5, 10, 45]


def test_a_byte_is_read_from_the_eeprom() -> None:
    routine = Routine("eeprom_read")
    chip = Chip(
        routine.library.functions,
        {Names().loc(name): value for name, value in {"EEDATA": 0x77, "EEADR": 0, "EECON1": 0}.items()},
    )
    chip.w = 0x12
    chip.call(routine.function.name)
    assert [(name, value) for _, name, value in chip.stores] == [("EEADR", 0x12), ("EECON1", 0x01)]
    assert chip.w == 0x77


@every(
    ("kind", "key", "expected"),
    [
        # both factors and the product; the dividend and quotient, the divisor, the remainder, a counter
        ("mul", (1, 1, 2), 1 + 1 + 2), ("mul", (3, 1, 3), 3 + 1 + 3), ("divide", (4, 2, 0), 4 + 2 + 2 + 1),
        # the signs
        ("sdivide", (2, 2, 0, 1), 1), ("flash", (), 2),
        *(("delay", (unit,), int(unit != 4)) for unit in (1, 2, 3, 4, 5, 1000)),
        ("eeprom_read", (), 0),
        # the address, the value, whether interrupts were enabled
        ("eeprom_write", (), 3),
        # the value and a counter
        ("putchar", (6, 4, 104, 0), 2), ("getchar", (6, 4, 104, 0), 2),
    ],
)  # fmt: skip
def test_the_bytes_of_a_routine(kind: str, key: tuple[int, ...], expected: int) -> None:
    made = Routine(kind, *key).function
    assert sum(symbol.size for symbol in made.own) == expected
    # nothing lies behind it: it returns, jumps back, or jumps into a table
    last = list(made.instructions())[-1]
    assert last.op in ("RETURN", "GOTO") or shown(last) == "MOVWF PCL"


def test_the_routine_behind_a_pointer_to_flash() -> None:
    """Bit 7 of the high byte decides: FSR and INDF, or PCLATH and PCL."""
    routine = Routine("flash")
    names = Names()
    high, low = routine.function.parameters
    assert routine.function.w_parameter == low
    chip = Chip(routine.library.functions, {names.loc("INDF"): 0x5A, names.loc("FSR"): 0})
    chip.memory[Byte(high, 0)] = 0x00
    chip.w = 0x34
    chip.call(routine.function.name)
    assert [(name, value) for _, name, value in chip.stores] == [("FSR", 0x34)] and chip.w == 0x5A
    chip.memory[Byte(high, 0)] = 0x83
    chip.w, chip.stores = 0x21, []
    chip.call(routine.function.name)
    assert [(name, value) for _, name, value in chip.stores] == [("PCLATH", 0x83), ("PCL", 0x21)]
