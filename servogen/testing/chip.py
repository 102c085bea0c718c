"""`Chip`: a simulated chip with a program, as a test uses it.

In: a program, and what the test does to the chip's pins. Out: levels, edges, variables, registers; and, when
the test fails, the waves and the source line that ran.

    chip = servogen_machine("blink.c")
    chip.press("RA4", bounce_ms=5)
    chip.run_ms(20)
    assert chip.pin("RB0") == 1
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from heapq import heappop, heappush
from itertools import count, islice, takewhile
from math import isfinite
from typing import Protocol

from servogen.bench.virtual.connections import ShortCircuit, Wiring
from servogen.debug.breakpoints import (
    INDIRECT,
    AtAddress,
    AtCondition,
    AtEdge,
    Breakpoint,
    parse_breakpoint,
    run_to,
)
from servogen.debug.pins import explain_pin
from servogen.debug.symbols import ListedLine, current_line, line_at, variable
from servogen.debug.time_machine import TimeMachine
from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeChunk, EdgeTrace, join
from servogen.errors import InputError, did_you_mean
from servogen.pic.device import registers
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.pic.listing import Listing
from servogen.simulator import BouncingButton, LevelChange, Levels, Serial, SimulatorOptions, Stimuli
from servogen.simulator.devices import PinDevice, Running, on_pins
from servogen.simulator.layout import MCLR_PIN
from servogen.simulator.pin_levels import at_the_pins
from servogen.simulator.sources import whole
from servogen.simulator.stimulus import file_inputs
from servogen.testing.signals import Signals, pin_index
from servogen.testing.targets import SeenPins
from servogen.testing.waves import wave_lines
from servogen.units import Clock, Cycles
from servogen.verify.measurement import time_words

MAX_RUN_S = 3600
"""The maximum time of one run; a longer one is more likely a wrong unit."""
MAX_EDGES = 1_000_000
"""The maximum number of edges that a test can examine: 40 minutes of the pulses of eight servos."""
MAX_STIMULUS = 100_000
"""The maximum number of a stimulus's changes that are shown in the waves."""
SHOWN_EDGES = 6
"""The number of edges that are listed with their source lines if a test fails."""
NUMBER_BYTES = 4
"""The maximum size of a variable that is read as a number."""
OPTION_REG = registers()["OPTION_REG"].address
SENT_BITS = 10
"""The bits of a byte on a serial line: a start bit, eight of data, a stop bit."""

_CYCLE = re.compile(r"cycle\s+(?P<cycle>[\d_]{1,15})", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Board:
    """A program, its clock, and what is around the chip from power-up on."""

    name: str
    image: Image
    clock: Clock
    listing: Listing | None = None
    options: SimulatorOptions = SimulatorOptions()  # noqa: RUF009 - frozen
    stimuli: Stimuli | None = None
    inputs: Mapping[str, int] = field(default_factory=dict)
    """Levels at which pins are held from power-up until the test drives them."""


class Chip(Signals):
    """A simulated chip under test; times count from power-up."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.clock = board.clock
        self._wiring = Wiring()
        self._outside: dict[int, int] = {}
        """The level of each pin that this class drives, as the simulator knows it."""
        for name, level in board.inputs.items():
            self._wiring.held[pin_index(name)] = checked_level(name, level)
        self._power_up(board.image)

    def __repr__(self) -> str:
        line = current_line(self._machine)
        return f"<Chip {self.board.name} at {self._now_words}{f', {line}' if line else ''}>"

    # Time

    @property
    def cycle(self) -> int:
        """Return the cycle in which the next instruction executes."""
        return int(self._machine.now)

    @property
    def us(self) -> float:
        return float(self.clock.us(self.cycle))

    @property
    def ms(self) -> float:
        return self.us / 1000

    def run_cycles(self, cycles: int) -> None:
        """Run for a number of instruction cycles; the last instruction may end one later."""
        self._check_time("cycles", cycles, 1 / self.clock.cycles_per_second)
        self._advance(self.cycle + int(cycles))

    def run_us(self, us: float) -> None:
        self._check_time("us", us, Fraction(1, 1_000_000))
        self._advance(self.cycle + self._cycles_in(us, 1))

    def run_ms(self, ms: float) -> None:
        self._check_time("ms", ms, Fraction(1, 1000))
        self._advance(self.cycle + self._cycles_in(ms, 1000))

    def run_s(self, s: float) -> None:
        self._check_time("s", s, Fraction(1))
        self._advance(self.cycle + self._cycles_in(s, 1_000_000))

    def run_until(self, what: str | Callable[[Chip], bool], *, within_ms: float = 1000) -> float:
        """Run until something happens, and return the time in µs. Fails if it does not within `within_ms`.

        `what` is an edge ("RB0 rise", "RB0 fall", "RB0"), a line or an address ("line 12", "main.c:12",
        "0x01F"), a function ("show()"), a comparison of a variable ("count > 3"), "cycle 20000"; or a Python
        function of the chip, which is called after each instruction and therefore slow.
        """
        __tracebackhide__ = True
        self._check_time("within_ms", within_ms, Fraction(1, 1000))
        end = self.cycle + self._cycles_in(within_ms, 1000)
        if not isinstance(what, str):
            return self._run_until_true(what, end, within_ms)
        if match := _CYCLE.fullmatch(what.strip()):
            wanted = int(match["cycle"])
            self._advance(min(end, wanted))
            if self.cycle < wanted:
                raise self._failure(what, within_ms)
            return self.us
        stop = parse_breakpoint(what, self.board.listing)
        if isinstance(stop, AtCondition) and stop.holds(self._machine):
            return self.us
        while self._advance(end, (stop,)) is not None:
            if not isinstance(stop, AtEdge) or self._is_change(stop.pin):
                return self.us
        raise self._failure(what, within_ms, stop)

    # Pins

    def pin(self, pin: str) -> int:
        """Return the level at a pin, whoever drives it."""
        return self._machine.machine.pins >> pin_index(pin) & 1

    def drives(self, pin: str) -> bool:
        """Return whether the chip itself drives a pin."""
        return self._machine.machine.levels[pin_index(pin)] != UNDRIVEN

    def drive(self, pin: str, level: int | None) -> None:
        """Drive a pin from outside to 0 or 1 from now on; None releases it."""
        self._apply(pin, [(self.cycle, UNDRIVEN if level is None else checked_level(pin, level))])

    def press(
        self,
        pin: str,
        *,
        bounce_ms: float = 0,
        bounces: int = 5,
        hold_ms: float | None = None,
        active: int = LOW,
        seed: int = 1,
    ) -> None:
        """Press a button, which connects a pin to ground, or with `active=1` to the supply.

        Its contact opens and closes `bounces` times at random moments within `bounce_ms`. With `hold_ms` it
        is released after that time and bounces again; run on to see it.
        """
        begin = self.cycle
        changes = self._contact(begin, checked_level(pin, active), bounce_ms, bounces, seed)
        if hold_ms is not None:
            self._check_time("hold_ms", hold_ms, Fraction(1, 1000))
            check_hold(self.clock, hold_ms, bounce_ms)
            released = begin + self._cycles_in(hold_ms, 1000)
            changes += self._contact(released, 1 - active, bounce_ms, bounces, seed + 1)
        self._apply(pin, changes)

    def release(
        self, pin: str, *, bounce_ms: float = 0, bounces: int = 5, active: int = LOW, seed: int = 1
    ) -> None:
        """Release a button: a resistor pulls its pin to the other level."""
        self._apply(pin, self._contact(self.cycle, 1 - checked_level(pin, active), bounce_ms, bounces, seed))

    def bounce(self, pin: str, *, ms: float, bounces: int = 5, seed: int = 1) -> None:
        """Let a pin flip at random moments within `ms` and end at the level that it has: a disturbance."""
        self._apply(pin, self._contact(self.cycle, self.pin(pin), ms, bounces, seed)[1:])

    def tie(self, *pins: str) -> None:
        """Connect pins of the chip by a wire, until `untie`.

        Each then has the level of the one that the chip drives. Two that it drives differently are a short
        circuit, and the test fails.
        """
        __tracebackhide__ = True
        for other in pins[1:] or pins:
            self.switch(pins[0], other, True)

    def untie(self, *pins: str) -> None:
        """Take the wire between pins away again."""
        __tracebackhide__ = True
        for other in pins[1:] or pins:
            self.switch(pins[0], other, False)

    def switch(
        self, pin: str, other: str, closed: bool, *, bounce_ms: float = 0, bounces: int = 5, seed: int = 1
    ) -> None:
        """Close or open a switch between two pins; its contact bounces as that of a button."""
        __tracebackhide__ = True
        one, two = pin_index(pin), pin_index(other)
        wire = frozenset((one, two))
        self._check_connectable(wire)
        if closed == (wire in self._wiring.wires):
            state = "connected already" if closed else "not connected"
            raise InputError("not-allowed", f"{pin} and {other} are {state}")
        changes = self._contact(self.cycle, HIGH if closed else LOW, bounce_ms, bounces, seed)
        self._busy[wire] = changes[-1][0]
        for cycle, level in changes:
            self._schedule(cycle, partial(self._wiring.connect if level else self._wiring.disconnect, wire))
        self._deliver()

    def keypad(self, rows: Sequence[str], columns: Sequence[str], keys: str) -> Keypad:
        """Connect a keypad, whose keys each connect a row to a column: `keys` names them, row by row."""
        keypad = Keypad(self, crossings(rows, columns, keys))
        for row, column in keypad.keys.values():
            self._check_connectable(frozenset((pin_index(row), pin_index(column))))
        return keypad

    # Devices on the pins

    def attach(self, device: PinDevice, **pins: str) -> None:
        """Connect a device, before the first run, by the names of its lines, each with a pull-up resistor:
        `chip.attach(EEPROM24(b"..."), scl="RA0", sda="RA1")`.
        """
        if self.cycle > 0:
            raise InputError("not-allowed", f"it is {self._now_words}: attach a device before the first run")
        options = self.board.options
        placed = on_pins(device, **pins)
        self.board = replace(self.board, options=replace(options, devices=(*options.devices, placed)))
        self._power_up(self.board.image)

    @property
    def devices(self) -> tuple[Running, ...]:
        """Return the attached devices as they are now, in the order of `attach`; an EEPROM has its content in
        `memory`.
        """
        return self._machine.machine.devices

    # The serial line

    def send(
        self,
        pin: str,
        data: bytes | str,
        baud: float,
        *,
        inverted: bool = False,
        baud_error_percent: float = 0,
    ) -> None:
        """Send bytes to a pin, lowest bit first, and run until the last stop bit is over.

        The line is idle for a byte's time before. A text is sent as UTF-8. `baud_error_percent` is by how
        much the sender is too fast.
        """
        rate = self.clock.cycles_per_second
        if not 0 < baud <= rate or not -50 < baud_error_percent < 50:
            raise InputError(
                "out-of-range",
                f"a bit at {baud:g} baud with an error of {baud_error_percent:g} % is shorter than a cycle",
                hint=f"a baud of at most {float(rate):g}, an error within 50 %",
            )
        error = Fraction(baud_error_percent) / 100
        bit = rate / (Fraction(baud) * (1 + error))
        begin = self.cycle + whole(SENT_BITS * bit)
        sent = data.encode() if isinstance(data, str) else bytes(data)
        source = Serial(pin_index(pin), sent, Fraction(baud), begin, error, inverted)
        idle, *changes = source.changes(self.clock)
        self._apply(pin, [(self.cycle, idle.level), *((change.cycle, change.level) for change in changes)])
        self._advance(begin + whole(SENT_BITS * len(sent) * bit))

    # Inside the chip

    def variable(self, name: str, *, signed: bool = False) -> int:
        """Return the value of a variable of up to four bytes, or of the byte at an address ("0x20")."""
        located = variable(name, self.board.listing)
        if located.size > NUMBER_BYTES:
            raise InputError(
                "not-allowed", f"'{name}' has {located.size} bytes, too many for a number", hint="use array()"
            )
        return located.number(self._machine.machine.ram, signed=signed)

    def array(self, name: str, *, item_bytes: int = 1, signed: bool = False) -> list[int]:
        """Return the values of an array whose items have `item_bytes` each."""
        address, size = located = variable(name, self.board.listing)
        if item_bytes < 1 or size % item_bytes:
            raise InputError(
                "out-of-range", f"the {size} bytes of '{name}' are not a number of items of {item_bytes}"
            )
        return [
            located._replace(address=address + offset, size=item_bytes).number(
                self._machine.machine.ram, signed=signed
            )
            for offset in range(0, size, item_bytes)
        ]

    def register(self, name: str) -> int:
        """Return a special function register; PORTA and PORTB are the levels at the pins, LATA and LATB the
        latches.
        """
        registers = self._machine.machine.state().registers
        if name.upper() not in registers:
            raise InputError(
                "unknown-name", f"there is no register '{name}'", hint=did_you_mean(name, registers)
            )
        return registers[name.upper()]

    @property
    def eeprom(self) -> bytes:
        return self._machine.machine.state().eeprom

    @property
    def asleep(self) -> bool:
        """Return whether the chip sleeps."""
        return self._machine.machine.state().sleeping

    @property
    def interrupts(self) -> int:
        """Return how many interrupts were taken since power-up."""
        return self._machine.machine.state().interrupts

    @property
    def resets(self) -> Mapping[str, int]:
        """Return how often the chip was reset since power-up, by cause: mclr, mclr_in_sleep, watchdog."""
        return self._machine.machine.state().resets

    @property
    def line(self) -> ListedLine | None:
        """Return the source line that runs; None where the program has no listing."""
        return current_line(self._machine)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what the simulator warns about."""
        return tuple(warning.sentence for warning in self._machine.machine.state().warnings)

    def reset(self, *, hold_ms: float = 1) -> None:
        """Pull MCLR low for `hold_ms`: the program starts again, RAM and EEPROM are kept."""
        self._check_time("hold_ms", hold_ms, Fraction(1, 1000))
        end = self.cycle + max(1, self._cycles_in(hold_ms, 1000))
        self._machine.apply([LevelChange(self.cycle, MCLR_PIN, LOW), LevelChange(end, MCLR_PIN, HIGH)])
        self._advance(end + 1)

    def power_cycle(self) -> None:
        """Switch the supply off and on: only the EEPROM is kept, and what devices on the pins keep; time
        begins again.
        """
        options = self.board.options
        kept = [
            replace(placed, device=running.off())
            for placed, running in zip(options.devices, self.devices, strict=True)
        ]
        self.board = replace(self.board, options=replace(options, devices=tuple(kept)))
        self._power_up(self._machine.machine.contents())

    # What was seen

    @property
    def name(self) -> str:
        return self.board.name

    @property
    def seen(self) -> list[SeenPins]:
        """Return the edges since power-up, as they are recorded."""
        return [SeenPins(self.pieces()[0], "the simulated chip")]

    def pieces(self) -> Sequence[EdgeTrace]:
        return (EdgeTrace(self.clock, (self._edges_so_far(),), Cycles(self.cycle)),)

    def levels(self) -> Sequence[EdgeTrace]:
        chunk = at_the_pins(self._edges_so_far(), self._inputs())
        return (EdgeTrace(self.clock, (chunk,), Cycles(self.cycle)),)

    def chip_clock(self) -> Clock:
        return self.clock

    def report(self) -> list[str]:
        """Return the waves, the last edges with the lines that made them, and the line that runs."""
        lines = wave_lines(join(self.levels()[0].chunks), self.cycle, self.clock)
        lines += self._last_edges()
        where = f"{self.board.name} at {self._now_words}"
        asleep = " (asleep)" if self.asleep else ""
        lines.append(f"{where}{asleep}: {self._here}")
        return [*lines, *(f"warning: {warning}" for warning in self.warnings)]

    # How it works

    def _power_up(self, image: Image) -> None:
        held = [Levels(pin, ((0, level),)) for pin, level in self._wiring.held.items()]
        sources = (*held, *(self.board.stimuli.sources if self.board.stimuli else ()))
        self._initial = Stimuli(sources)
        self._machine = TimeMachine(
            image, self.clock, self.board.options, self._initial if sources else None, self.board.listing
        )
        self._pull_ups_change = AtAddress("", after_option_writes(image))
        self._outside = dict(self._wiring.held)
        self._seen: list[EdgeChunk] = []
        self._seen_until = 0
        self._due: list[tuple[int, int, Callable[[], None]]] = []
        """The actions due on connected pins: (cycle, number, action)."""
        self._numbers = count()
        self._busy: dict[int | frozenset[int], int] = {}
        """By pin, or pair of pins of a switch, the cycle in which its current changes end."""
        self._settle()

    def _check_time(self, name: str, value: float, unit_s: Fraction) -> None:
        check_time(name, value, unit_s)

    def _cycles_in(self, value: float, unit_us: int) -> int:
        return int(self.clock.round_us(Fraction(str(value)) * unit_us).cycles)

    def _advance(self, end: int, stops: Sequence[Breakpoint] = ()) -> Breakpoint | None:
        """Run to `end` or to one of `stops`, which is returned."""
        __tracebackhide__ = True
        chip, image = self._machine, self._machine.machine.image
        begin = self.cycle
        while True:
            self._deliver()
            if self.cycle > begin and (stop := self._at_address(stops)):
                return stop
            if self.cycle >= end:
                return None
            watched: list[Breakpoint] = [AtEdge("", pin, None) for pin in sorted(self._wiring.connected)]
            if watched:
                watched.append(self._pull_ups_change)
            goal = min(end, self._due[0][0]) if self._due else end
            met = run_to(chip, goal, [*stops, *watched], image)
            self._settle()
            if stop := next((stop for stop in stops if stop in met), None):
                return stop

    def _is_change(self, pin: int) -> bool:
        """Return whether the last edge of a pin is one where an undriven pin counts as low."""
        edges = self._edges_so_far()
        last: list[int] = [UNDRIVEN, *edges.level[edges.pin == pin][-2:].tolist()][-2:]
        before, now = (level == HIGH for level in last)
        return before != now

    def _at_address(self, stops: Iterable[Breakpoint]) -> Breakpoint | None:
        chip = self._machine.machine
        here = (stop for stop in stops if isinstance(stop, AtAddress) and chip.pc in stop.addresses)
        return None if chip.asleep else next(here, None)

    def _run_until_true(self, holds: Callable[[Chip], bool], end: int, within_ms: float) -> float:
        __tracebackhide__ = True
        while not holds(self):
            if self.cycle >= end:
                raise self._failure(getattr(holds, "__name__", "the condition"), within_ms)
            self._deliver()
            before = self._machine.machine.edges_made
            self._machine.run(self.cycle + 1)
            if self._machine.machine.edges_made != before:
                self._settle()
        return self.us

    def _failure(self, what: str, within_ms: float, stop: Breakpoint | None = None) -> AssertionError:
        lines = [f"{what}: not within {within_ms:g} ms, at {self._now_words}", f"  {self._here}"]
        if isinstance(stop, AtEdge):
            lines += [f"  {sentence}" for sentence in explain_pin(self._machine, stop.pin)]
        if isinstance(stop, AtCondition):
            value = stop.variable.number(self._machine.machine.ram)
            lines.append(f"  it is {value}")
        if self._machine.machine.asleep:
            lines.append("  the chip sleeps, or is held in reset")
        return AssertionError("\n".join(lines))

    @property
    def _now_words(self) -> str:
        return time_words(self.cycle, self.clock)

    @property
    def _here(self) -> str:
        line = current_line(self._machine)
        return str(line) if line else f"address 0x{self._machine.machine.pc:03X}"

    def _contact(
        self, begin: int, level: int, bounce_ms: float, bounces: int, seed: int
    ) -> list[tuple[int, int]]:
        """Return (cycle, level) of a contact that settles at a level."""
        return contact_changes(self.clock, begin, level, bounce_ms, bounces, seed)

    def _apply(self, name: str, changes: Sequence[tuple[int, int]]) -> None:
        """Let a pin have these levels from these cycles on."""
        __tracebackhide__ = True
        pin = pin_index(name)
        self._check_free(pin)
        if not changes:
            return
        self._busy[pin] = changes[-1][0]
        if pin in self._wiring.connected:
            for cycle, level in changes:
                self._schedule(cycle, partial(self._hold, pin, level))
            self._deliver()
            return
        self._machine.apply([LevelChange(cycle, pin, level) for cycle, level in changes])
        self._hold(pin, changes[-1][1])
        self._outside.pop(pin, None)
        if pin in self._wiring.held:
            self._outside[pin] = self._wiring.held[pin]

    def _check_free(self, pins: int | frozenset[int]) -> None:
        """Raise InputError if what was begun on a pin, or on a switch between two, is not over."""
        if self._busy.get(pins, -1) > self.cycle:
            until = time_words(self._busy[pins], self.clock)
            names = " to ".join(PINS[pin] for pin in sorted({pins} if isinstance(pins, int) else pins))
            raise InputError(
                "not-allowed",
                f"{names} still changes from outside until {until}, and it is {self._now_words} now",
                hint="run until then first",
            )

    def _hold(self, pin: int, level: int) -> None:
        if level == UNDRIVEN:
            self._wiring.held.pop(pin, None)
        else:
            self._wiring.held[pin] = level

    def _schedule(self, cycle: int, action: Callable[[], None]) -> None:
        heappush(self._due, (cycle, next(self._numbers), action))

    def _deliver(self) -> None:
        """Do what is due to connected pins."""
        __tracebackhide__ = True
        while self._due and self._due[0][0] <= self.cycle:
            heappop(self._due)[2]()
            self._settle()

    def _settle(self) -> None:
        """Give connected pins, and those that were, the level that they now have from outside."""
        __tracebackhide__ = True
        if not self._wiring.wires and self._outside == self._wiring.held:
            return
        chip = self._machine.machine
        try:
            levels = self._wiring.levels(chip.levels, chip.pull_ups)
        except ShortCircuit as error:
            raise ShortCircuit(f"{error}, at {self._now_words}\n  {self._here}") from None
        wanted = {**self._wiring.held, **levels}
        changes = []
        for pin in sorted({*wanted, *self._outside}):
            level = wanted.get(pin, UNDRIVEN)
            if self._outside.get(pin, UNDRIVEN) != level:
                changes.append(LevelChange(self.cycle, pin, level))
        self._outside = {pin: level for pin, level in wanted.items() if level != UNDRIVEN}
        if changes:
            self._machine.apply(changes)

    def _check_connectable(self, wire: frozenset[int]) -> None:
        """Raise InputError where two pins cannot be connected or disconnected now."""
        if len(wire) < 2:
            raise InputError("not-allowed", f"{PINS[min(wire)]} cannot be connected to itself")
        stimulus = self.board.stimuli
        driven = file_inputs(stimulus, self.clock).pins if stimulus else ()
        for pin in sorted(wire):
            if pin in driven:
                raise InputError(
                    "not-allowed", f"{PINS[pin]} is driven by the stimulus and cannot be connected as well"
                )
            if pin not in self._wiring.connected:
                self._check_free(pin)
        self._check_free(wire)

    def _edges_so_far(self) -> EdgeChunk:
        """Return all edges since power-up. Raises InputError where there are too many."""
        if self._seen_until < self.cycle:
            edge_count = self._machine.machine.edges_made
            if edge_count > MAX_EDGES:
                raise InputError(
                    "out-of-range",
                    f"the pins have {edge_count} edges since power-up, more than {MAX_EDGES}",
                    hint="run for less",
                )
            self._seen.append(self._machine.edges(self._seen_until, self.cycle))
            self._seen_until = self.cycle
            self._seen = [join(self._seen)]
        return join(self._seen)

    def _inputs(self) -> list[LevelChange]:
        stimulus = takewhile(lambda change: change.cycle < self.cycle, self._initial.all_changes(self.clock))
        applied = (change for change in self._machine.inputs if change.cycle < self.cycle)
        return [*islice(stimulus, MAX_STIMULUS), *applied]

    def _last_edges(self) -> list[str]:
        edges = self._edges_so_far()
        last = list(zip(*(column[-SHOWN_EDGES:].tolist() for column in edges), strict=True))
        here = self.cycle
        lines = []
        for cycle, pin, level in last:
            self._machine.seek(cycle)
            source = line_at(self._machine, self._machine.machine.pc)
            now = ("= 0", "= 1", "let go")[level]
            text = str(source) if source else f"address 0x{self._machine.machine.pc:03X}"
            lines.append(f"  {time_words(cycle, self.clock):>14}  {PINS[pin]} {now:<6}  {text}")
        self._machine.seek(here)
        return ["last edges:", *lines] if lines else []


class Switched(Protocol):
    """A chip whose pins can be connected."""

    def switch(
        self, pin: str, other: str, closed: bool, *, bounce_ms: float = 0, bounces: int = 5, seed: int = 1
    ) -> None: ...


@dataclass(frozen=True, slots=True)
class Keypad:
    """A keypad on a chip; `keys` has the row's and the column's pin of each key."""

    chip: Switched
    keys: Mapping[str, tuple[str, str]]

    def press(self, key: str, *, bounce_ms: float = 0, bounces: int = 5, seed: int = 1) -> None:
        """Press a key, which connects its row to its column."""
        self.chip.switch(*self._pins(key), True, bounce_ms=bounce_ms, bounces=bounces, seed=seed)

    def release(self, key: str, *, bounce_ms: float = 0, bounces: int = 5, seed: int = 1) -> None:
        self.chip.switch(*self._pins(key), False, bounce_ms=bounce_ms, bounces=bounces, seed=seed)

    def _pins(self, key: str) -> tuple[str, str]:
        if key not in self.keys:
            raise InputError("unknown-name", f"there is no key '{key}'", hint=f"keys: {''.join(self.keys)}")
        return self.keys[key]


def crossings(rows: Sequence[str], columns: Sequence[str], keys: str) -> Mapping[str, tuple[str, str]]:
    """Return the row and the column of each key. Raises InputError."""
    if len(keys) != len(rows) * len(columns) or len(set(keys)) != len(keys):
        raise InputError(
            "not-allowed",
            f"keys = '{keys}' does not name each of the {len(rows) * len(columns)} keys once",
            hint=f"{len(rows)} rows of {len(columns)} keys, row by row",
        )
    return dict(zip(keys, ((row, column) for row in rows for column in columns), strict=True))


def check_time(name: str, value: float, unit_s: Fraction) -> None:
    """Raise InputError for a time that a chip cannot run."""
    if not isfinite(value) or not 0 <= value * float(unit_s) <= MAX_RUN_S:
        raise InputError(
            "out-of-range", f"{name} = {value:g} is not between 0 and {MAX_RUN_S / float(unit_s):g}"
        )


def check_hold(clock: Clock, hold_ms: float, bounce_ms: float) -> None:
    """Raise InputError for a button that is released before its contact has settled."""
    held, settled = (clock.round_us(Fraction(str(ms)) * 1000).cycles for ms in (hold_ms, bounce_ms))
    if held <= settled:
        raise InputError(
            "out-of-range", f"hold_ms = {hold_ms:g} is not longer than bounce_ms = {bounce_ms:g}"
        )


def contact_changes(
    clock: Clock, begin: int, level: int, bounce_ms: float, bounces: int, seed: int
) -> list[tuple[int, int]]:
    """Return (cycle, level) of a contact that bounces from cycle `begin` on and settles at a level."""
    check_time("bounce_ms", bounce_ms, Fraction(1, 1000))
    if not 0 <= bounces <= 1000:
        raise InputError("out-of-range", f"bounces = {bounces} is not between 0 and 1000")
    bounce = int(clock.round_us(Fraction(str(bounce_ms)) * 1000).cycles)
    end = begin + bounce + 2
    contact = BouncingButton(0, begin, end, bounces, bounce, seed, active=level)
    changes = takewhile(lambda change: change.cycle < end, contact.changes(clock))
    return [(change.cycle, change.level) for change in changes if change.cycle >= begin]


def after_option_writes(image: Image) -> frozenset[int]:
    """Return the addresses after the instructions that may write OPTION_REG, which switches the pull-ups."""
    addresses = set()
    for address, word in image.program.items():
        decoded = decode(word)
        if decoded is None:
            continue
        writes = decoded.instruction.writes_file(decoded.d) and decoded.f in (OPTION_REG & 0x7F, INDIRECT)
        if writes or decoded.instruction.mnemonic == "OPTION":
            addresses.add(address + 1)
    return frozenset(addresses)


def checked_level(pin: str, level: int) -> int:
    if level not in (LOW, HIGH):
        raise InputError("out-of-range", f"a level of {pin} is 0 or 1, not {level!r}")
    return level
