"""A lab's bench: a program compiled and run with what is connected to its pins, and instruments.

In: a C file, sources of a stimulus. Out: `Pins`, and what decoders make of them: bytes of a serial line, text
on a display. The instruments know the devices' own data sheets and nothing of the compiler.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

from servogen.compiler import Options, Source, compile_sources
from servogen.edges import HIGH, LOW, PINS, UNDRIVEN
from servogen.simulator import Machine
from servogen.simulator.sources import SignalSource
from servogen.simulator.state import MachineState
from servogen.simulator.stimulus import Stimuli
from servogen.units import Clock

CLOCK = Clock(4_000_000)
US, MS, SECOND = 1, 1000, 1_000_000
"""Cycles at 4 MHz."""

Edges = list[tuple[int, int]]


@dataclass(frozen=True)
class Pins:
    """What a program did: the changes of each pin as (cycle, level), and the machine's last state."""

    changes: dict[str, Edges]
    state: MachineState

    def edges(self, pin: str) -> Edges:
        return self.changes[pin]

    def level(self, pin: str, cycle: int) -> int:
        """The level in a cycle."""
        edges = self.changes[pin]
        at = bisect_right(edges, cycle, key=lambda edge: edge[0]) - 1
        return edges[at][1] if at >= 0 else UNDRIVEN

    def number(self, pins: tuple[str, ...], cycle: int) -> int:
        """The pins' levels in a cycle as a number, the first pin the lowest bit."""
        return sum(1 << bit for bit, pin in enumerate(pins) if self.level(pin, cycle) == HIGH)

    def numbers(self, pins: tuple[str, ...]) -> Edges:
        """(cycle, number) whenever the number changes, from the first cycle in which all pins are driven."""
        found: Edges = []
        for cycle in sorted({cycle for pin in pins for cycle, _ in self.changes[pin]}):
            if all(self.level(pin, cycle) != UNDRIVEN for pin in pins):
                value = self.number(pins, cycle)
                if not found or found[-1][1] != value:
                    found.append((cycle, value))
        return found

    def pulses(self, pin: str) -> list[tuple[int, int]]:
        """(rise, length) of each whole high pulse."""
        rise, found = None, []
        for cycle, level in self.changes[pin]:
            if level == HIGH:
                rise = cycle
            elif rise is not None:
                found.append((rise, cycle - rise))
                rise = None
        return found


PORT_B = tuple(f"RB{bit}" for bit in range(8))
PORT_A = tuple(f"RA{bit}" for bit in range(4))
"""Without RA4, an open drain, which is never high by itself."""


def run(path: Path, dialect: str, cycles: int, *outside: SignalSource | Keypad) -> Pins:
    """Compile a program for 4 MHz and let it run. No lab program may give a warning or upset the chip."""
    compiled = compile_sources(
        [Source(path.read_text(), path.name)], Options(dialect=dialect, clock_hz=CLOCK.hz)
    )
    assert not compiled.diagnostics, "\n".join(map(str, compiled.diagnostics))
    keypad = next((each for each in outside if isinstance(each, Keypad)), None)
    machine = Machine(compiled.image, CLOCK, stimulus=keypad or (Stimuli(outside) if outside else None))
    if keypad:
        keypad.machine = machine
    chunk = machine.run(cycles)
    changes: dict[str, Edges] = {pin: [] for pin in PINS}
    for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
        changes[PINS[pin]].append((cycle, level))
    state = machine.state()
    assert not state.stack_wraps and not state.undefined_words, state.warnings
    return Pins(changes, state)


class Keypad:
    """A keypad with one key held: it joins a column, which the chip drives, with a row, which rests high.

    It looks at the chip every few cycles, so a row follows its column as late as contacts and lines make it.
    """

    LOOKS = 10

    def __init__(self, column: str, row: str) -> None:
        self.column, self.row = PORT_B.index(column), pressed(row)
        self.machine: Machine | None = None

    def changes(self, clock: Clock) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        """Pieces of the changes, as a machine takes them."""
        level = HIGH
        yield 1, np.array([self._packed(0, level)], dtype=np.int64)
        while True:
            assert self.machine is not None
            now, registers = self.machine.cycles, self.machine.state().registers
            low = not (registers["LATB"] | registers["TRISB"]) >> self.column & 1
            changed = low == (level == HIGH)
            level = LOW if low else HIGH
            found = [self._packed(now + 1, level)] if changed else []
            yield now + self.LOOKS, np.array(found, dtype=np.int64)

    def _packed(self, cycle: int, level: int) -> int:
        return cycle << 8 | self.row << 2 | level


def pressed(pin: str) -> int:
    """A pin's number for a source of the stimulus."""
    return PINS.index(pin)


def serial_bytes(pins: Pins, pin: str, baud: int, start: int = 0) -> bytes:
    """The bytes on a serial line, 8N1, sampled in the middle of each bit; framing errors are failures."""
    bit = CLOCK.cycles_per_second / Fraction(baud)
    found, free = [], start
    for cycle, level in pins.edges(pin):
        if level != LOW or cycle < free:
            continue
        sampled = [pins.level(pin, int(cycle + (n + Fraction(1, 2)) * bit)) for n in range(10)]
        assert sampled[0] == LOW, f"no start bit at cycle {cycle}"
        assert sampled[9] == HIGH, f"no stop bit behind cycle {cycle}"
        found.append(sum(level << n for n, level in enumerate(sampled[1:9])))
        free = int(cycle + Fraction(19, 2) * bit)
    return bytes(found)


SEGMENTS = {0x3F: 0, 0x06: 1, 0x5B: 2, 0x4F: 3, 0x66: 4, 0x6D: 5, 0x7D: 6, 0x07: 7, 0x7F: 8, 0x6F: 9}
"""Which segments (a the lowest bit, g bit 6) make which digit."""


@dataclass
class Display:
    """A HD44780 with two lines on four data lines: what it shows after all that came over its bus.

    From the data sheet: a nibble is taken on the falling edge of E; the interface has eight bits until the
    function set 0x2; 15 ms after power-up, 4.1 ms and 100 us between the first three; an instruction takes
    37 us, clear and home 1.52 ms.
    """

    pins: Pins
    data: tuple[str, str, str, str] = ("RB4", "RB5", "RB6", "RB7")
    select: str = "RA0"
    enable: str = "RA1"

    def lines(self) -> tuple[str, str]:
        memory: dict[int, str] = {}
        address, four, high = 0, False, None
        ready, wakes = 15 * MS, [4100, 100, 37]
        for rise, length in self.pins.pulses(self.enable):
            fall = rise + length
            nibble = self.pins.number(self.data, fall - 1)
            letter = self.pins.level(self.select, fall - 1) == HIGH
            assert rise >= ready, f"E rises at cycle {rise}, the display is busy until {ready}"
            if not four:
                assert not letter and nibble in (2, 3)
                four = nibble == 2
                ready = fall + (wakes.pop(0) if wakes and not four else 37)
                continue
            if high is None:
                high, ready = nibble, fall + 1
                continue
            byte, high = high << 4 | nibble, None
            ready = fall + 37
            if letter:
                memory[address] = chr(byte)
                address += 1
            elif byte & 0x80:
                address = byte & 0x7F
            elif byte == 1:
                memory, address, ready = {}, 0, fall + 1520
        return self._line(memory, 0x00), self._line(memory, 0x40)

    def _line(self, memory: dict[int, str], start: int) -> str:
        return "".join(memory.get(start + column, " ") for column in range(16)).rstrip()
