"""`VirtualBoard`: an Arduino Mega with Firmata, wired to the virtual chip.

In: bytes of the client. Out: bytes of the board, and levels, contacts and serial lines at the chip's pins, in
the chip's own time: a stored run is played when the chip reaches its moments. What the board cannot do it
refuses as ConfigurableFirmata does, with a text; a command of the wrong length has no effect.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from servogen.bench.inputs import firmata
from servogen.bench.inputs.firmata import (
    FirmataCommand,
    Message,
    MessageKind,
    MessageReader,
    Mode,
    SchedulerCommand,
)
from servogen.bench.inputs.wiring import MARK, MARK_CHANNEL, MCLR, VDD, InputWiring
from servogen.bench.virtual.chip import VirtualChip
from servogen.edges import HIGH, LOW, PINS, UNDRIVEN
from servogen.simulator.layout import MCLR_PIN
from servogen.simulator.sources import whole

PINS_OF_A_MEGA = 70
FIRST_PIN = 2
"""Pins 0 and 1 are the board's own line to the host."""
SERIAL_PINS = {1: (19, 18), 2: (17, 16), 3: (15, 14)}
"""RX and TX of each serial port."""
TX, RX = 1, 0
FIRMATA_VERSION = (2, 8)
FRAME_BITS = 10
HEAP_BYTES = 5000
"""The memory for stored runs."""
SHORTEST_CONFIG = 4
"""The bytes of a serial line's configuration: command and port, and its rate."""
TASK_TIME_BYTES = 4
SCHEDULER_SIZES: Mapping[int, range] = {
    SchedulerCommand.CREATE: range(3, 4),
    SchedulerCommand.DELETE: range(1, 2),
    SchedulerCommand.ADD: range(2, firmata.MAX_SYSEX_DATA),
    SchedulerCommand.SCHEDULE: range(6, 7),
    SchedulerCommand.QUERY_ALL: range(firmata.MAX_SYSEX_DATA),
    SchedulerCommand.QUERY: range(1, 2),
    SchedulerCommand.RESET: range(firmata.MAX_SYSEX_DATA),
}
"""The numbers of bytes that follow each command which the scheduler obeys, as in FirmataScheduler."""
TICK_MS = 1
"""A run is played in the millisecond after the one it was scheduled for, as FirmataScheduler does."""


@dataclass(frozen=True, slots=True)
class BoardOptions:
    """The kind of board, and its faults."""

    scheduler: bool = True
    """Whether it is ConfigurableFirmata with the scheduler, or else StandardFirmata."""
    silent: bool = False
    garbage: bool = False
    late_ms: int = 0
    """The time by which each delay of a stored run is too long."""
    unplug_after: int | None = None
    """Bytes from the client after which it disappears."""


@dataclass(slots=True)
class _Stored:
    """A run on the board."""

    size: int
    messages: bytearray = field(default_factory=bytearray)
    at: int = 0
    due: int | None = None
    """The chip's cycle at which it goes on."""


@dataclass(slots=True)
class VirtualBoard:
    chip: VirtualChip
    wiring: InputWiring
    options: BoardOptions = BoardOptions()
    outgoing: bytearray = field(default_factory=bytearray)
    gone: bool = False
    reset: bool = False
    taken: int = 0
    told: bool = False
    _reader: MessageReader = field(default_factory=lambda: MessageReader(asks_version=True))
    _modes: dict[int, int] = field(default_factory=dict)
    _levels: dict[int, int] = field(default_factory=dict)
    _tasks: dict[int, _Stored] = field(default_factory=dict)
    _bauds: dict[int, int] = field(default_factory=dict)
    _sent_until: dict[int, int] = field(default_factory=dict)
    _reported: dict[int, int] = field(default_factory=dict)
    """The levels that the client knows of each port whose changes it asked for."""

    def __post_init__(self) -> None:
        self.chip.alarms.append(self)
        self.chip.listeners.append(lambda levels, cycle: self._report_changes())
        self._restart()

    def restarted(self) -> None:
        """Begin anew and say what the board is, as an Arduino does whose port is opened."""
        if self.options.silent or self.options.garbage or self.gone:
            return
        self.outgoing.clear()
        self._reader = MessageReader(asks_version=True)
        self._restart()
        self._version()
        self._firmware(b"")

    @property
    def name(self) -> str:
        return "ConfigurableFirmata" if self.options.scheduler else "StandardFirmata"

    @property
    def working(self) -> bool:
        """Return whether a run waits for its time, which passes only while the chip runs."""
        return self.next_at() is not None

    def work(self) -> None:
        """Let the chip run to what is due next."""
        due = self.next_at()
        if due is not None:
            self.chip.run(self.chip.due(max(1, due - self.chip.now)))

    def received(self, data: bytes) -> None:
        """Take bytes of the client and obey each complete message."""
        self.taken += len(data)
        if self.options.unplug_after is not None and self.taken >= self.options.unplug_after:
            self.gone = True
        if self.options.silent or self.gone:
            return
        if self.options.garbage:
            self.outgoing += bytes(byte & 0x7F for byte in data)
            return
        for message in self._reader.read(data):
            self._obey(message)
        self._report_changes()

    def next_at(self) -> int | None:
        """Return the chip's cycle at which a stored run goes on."""
        return min((task.due for task in self._tasks.values() if task.due is not None), default=None)

    def ring(self) -> None:
        """Play what is due."""
        for number, task in list(self._tasks.items()):
            if task.due is not None and task.due <= self.chip.now:
                self._play(number, task)

    def _play(self, number: int, task: _Stored) -> None:
        begun, task.due = task.due, None
        reader = MessageReader(asks_version=True)
        assert begun is not None  # the caller looked
        at = task.at
        while at < len(task.messages) and task.due is None:
            byte = bytes((task.messages[at],))
            at += 1
            for message in reader.read(byte):
                delay = _delay(message)
                if delay is None:
                    self._obey(message)
                else:
                    task.due = begun + self._cycles(delay + self.options.late_ms)
        if task.due is None:
            self._tasks.pop(number, None)
        task.at = at if at < len(task.messages) else 0  # a delay at the end: over and over again

    def _cycles(self, ms: int) -> int:
        return whole(Fraction(ms, 1000) * self.chip.cycles_per_second)

    def _restart(self) -> None:
        """Forget modes, runs and reports, as after a reset: StandardFirmata drives all its pins low."""
        self._tasks.clear()
        self._reported.clear()
        mode = Mode.INPUT if self.options.scheduler else Mode.OUTPUT
        for pin in range(FIRST_PIN, PINS_OF_A_MEGA):
            self._modes[pin], self._levels[pin] = mode, 0
        for pin in sorted(self.wiring.outputs):
            self._wire(pin)

    def _obey(self, message: Message) -> None:
        if message.kind == MessageKind.SYSEX:
            self._command(message.data[:1], message.data[1:])
        elif message.kind == MessageKind.PIN_MODE:
            self._set_mode(*message.data)
        elif message.kind == MessageKind.PIN_VALUE:
            self._set_level(*message.data)
        elif message.kind & 0xF0 == MessageKind.DIGITAL:
            levels = message.data[0] | message.data[1] << 7
            for bit in range(8):
                self._set_level(8 * (message.kind & 0x0F) + bit, levels >> bit & 1)
        elif message.kind & 0xF0 == MessageKind.REPORT_DIGITAL:
            self._set_reporting(message.kind & 0x0F, bool(message.data[0]))
        elif message.kind == MessageKind.VERSION:
            self._version()
        elif message.kind == MessageKind.RESET:
            self._restart()

    def _set_mode(self, pin: int, mode: int) -> None:
        if not self._has_mode(pin, mode):
            self._say("Unknown pin mode")
            return
        self._modes[pin] = mode
        if self.options.scheduler and mode == Mode.OUTPUT:
            self._levels[pin] = 0  # as ConfigurableFirmata does
        self._wire(pin)

    def _has_mode(self, pin: int, mode: int) -> bool:
        if mode == Mode.SERIAL:
            return self.options.scheduler and any(pin in ends for ends in SERIAL_PINS.values())
        return pin in self._modes and mode in (Mode.INPUT, Mode.OUTPUT, Mode.PULL_UP)

    def _say(self, text: str) -> None:
        """Send the client a text."""
        self.outgoing += firmata.sysex(FirmataCommand.TEXT, firmata.split_bytes(text.encode()))

    def _set_level(self, pin: int, level: int) -> None:
        if self._modes.get(pin) == Mode.OUTPUT:
            self._levels[pin] = HIGH if level else LOW
            self._wire(pin)

    def _wire(self, pin: int) -> None:
        """Let the pin's level have its effect on what it is wired to."""
        driven = self._modes[pin] == Mode.OUTPUT
        level = self._levels[pin] if driven else HIGH if self._modes[pin] == Mode.PULL_UP else UNDRIVEN
        for name, own in self.wiring.pins.items():
            if own != pin:
                continue
            if name == MARK:
                self.chip.set_channel(MARK_CHANNEL, level == HIGH)
            elif name == VDD:
                self.chip.supply(level != LOW)
            elif name == MCLR:
                self.chip.drive(MCLR_PIN, LOW if level == LOW else HIGH)
            else:
                self.chip.drive(PINS.index(name), level)
        for contact, own in self.wiring.contacts.items():
            if own == pin:
                self.chip.connect(frozenset(PINS.index(name) for name in contact), level == HIGH)

    def _set_reporting(self, port: int, wanted: bool) -> None:
        """Report a port's inputs now and whenever they change, or no longer."""
        self._reported.pop(port, None)
        if wanted:
            self._report(port, self._inputs(port))

    def _report_changes(self) -> None:
        """Report the inputs that are not as the client knows them."""
        for port, known in list(self._reported.items()):
            levels = self._inputs(port)
            if levels != known:
                self._report(port, levels)

    def _report(self, port: int, levels: int) -> None:
        self._reported[port] = levels
        self.outgoing += bytes((MessageKind.DIGITAL | port, levels & 0x7F, levels >> 7))

    def _inputs(self, port: int) -> int:
        """Return the levels at a port's pins that are inputs; the others are 0."""
        word = self.chip.word
        wired = {pin: PINS.index(name) for name, pin in self.wiring.pins.items() if name in PINS}
        levels = 0
        for bit in range(8):
            pin = 8 * port + bit
            mode = self._modes.get(pin)
            if pin in wired and mode in (Mode.INPUT, Mode.PULL_UP):
                levels |= (word >> wired[pin] & 1) << bit
            elif mode == Mode.PULL_UP:
                levels |= 1 << bit
        return levels

    def _version(self) -> None:
        self.outgoing += bytes((MessageKind.VERSION, *FIRMATA_VERSION))

    def _command(self, number: bytes, data: bytes) -> None:
        """Obey a command. Analogue values need no answer, and there are no pins for them."""
        commands: dict[int, Callable[[bytes], None]] = {
            FirmataCommand.FIRMWARE: self._firmware,
            FirmataCommand.CAPABILITY_QUERY: self._capabilities,
            FirmataCommand.ANALOG_MAPPING_QUERY: self._analog,
            FirmataCommand.PIN_STATE_QUERY: self._pin_state,
            FirmataCommand.EXTENDED_ANALOG: lambda data: None,
            FirmataCommand.SAMPLING_INTERVAL: lambda data: None,
        }
        if self.options.scheduler:
            commands |= {FirmataCommand.SERIAL: self._serial, FirmataCommand.SCHEDULER: self._scheduler}
        if number and number[0] in commands:
            commands[number[0]](data)
        elif number and self.options.scheduler:
            self._say(f"Unhandled sysex command: {number[0]:#x} (len: {len(data)})")

    def _firmware(self, data: bytes) -> None:
        name = firmata.split_bytes(self.name.encode())
        self.outgoing += firmata.sysex(FirmataCommand.FIRMWARE, bytes(FIRMATA_VERSION) + name)

    def _capabilities(self, data: bytes) -> None:
        modes = bytearray()
        ends = {
            pin: 2 * port + end
            for port, pins in SERIAL_PINS.items()
            for end, pin in zip((RX, TX), pins, strict=True)
        }
        for pin in range(PINS_OF_A_MEGA):
            if pin >= FIRST_PIN:
                modes += bytes((Mode.INPUT, 1, Mode.PULL_UP, 1, Mode.OUTPUT, 1))
                if self.options.scheduler and pin in ends:
                    modes += bytes((Mode.SERIAL, ends[pin]))
            modes.append(firmata.NO_MORE_MODES)
        self.outgoing += firmata.sysex(FirmataCommand.CAPABILITIES, bytes(modes))

    def _analog(self, data: bytes) -> None:
        self.outgoing += firmata.sysex(
            FirmataCommand.ANALOG_MAPPING, bytes([firmata.NO_MORE_MODES] * PINS_OF_A_MEGA)
        )

    def _pin_state(self, data: bytes) -> None:
        if data and data[0] in self._modes:
            pin, mode = data[0], self._modes[data[0]]
            level = self._levels[pin] if mode == Mode.OUTPUT else int(mode == Mode.PULL_UP)
            state = bytes((pin, mode, level))
            self.outgoing += firmata.sysex(FirmataCommand.PIN_STATE, state)

    def _serial(self, data: bytes) -> None:
        if not data:
            return
        command, port = data[0] & 0x70, data[0] & 0x0F
        names = [name for name, own in self.wiring.lines.items() if own == port]
        if port not in SERIAL_PINS:
            return
        if command == firmata.SERIAL_CONFIG:
            baud = sum(part << 7 * place for place, part in enumerate(data[1:SHORTEST_CONFIG]))
            if len(data) < SHORTEST_CONFIG or not baud:
                return
            self._bauds[port] = baud
            for name in names:
                self.chip.drive(PINS.index(name), HIGH)
        elif command == firmata.SERIAL_CLOSE:
            self._bauds.pop(port, None)
            for name in names:
                self.chip.drive(PINS.index(name), UNDRIVEN)
        elif command == firmata.SERIAL_WRITE and port in self._bauds:
            for name in names:
                self._transmit(PINS.index(name), port, firmata.joined_bytes(data[1:]))

    def _transmit(self, pin: int, port: int, data: bytes) -> None:
        bit = self.chip.cycles_per_second / self._bauds[port]
        begin = Fraction(max(self.chip.now, self._sent_until.get(port, 0)))
        for byte in data:
            for place, level in enumerate((LOW, *(byte >> n & 1 for n in range(8)), HIGH)):
                self.chip.drive_at(whole(begin + place * bit), pin, level)
            begin += FRAME_BITS * bit
        self._sent_until[port] = whole(begin)

    def _scheduler(self, data: bytes) -> None:
        command, data = (data[0], data[1:]) if data else (None, data)
        if command is None or len(data) not in SCHEDULER_SIZES.get(command, ()):
            return
        number = data[0] if data else 0
        task = self._tasks.get(number)
        if command == SchedulerCommand.RESET:
            self._tasks.clear()
        elif command == SchedulerCommand.QUERY_ALL:
            self.outgoing += firmata.task(SchedulerCommand.ALL, bytes(self._tasks))
        elif command == SchedulerCommand.QUERY:
            self._report_task(SchedulerCommand.STATE, number)
        elif command == SchedulerCommand.DELETE:
            self._tasks.pop(number, None)
        elif command == SchedulerCommand.CREATE and task is None:
            size = data[1] | data[2] << 7
            if size + sum(stored.size for stored in self._tasks.values()) <= HEAP_BYTES:
                self._tasks[number] = _Stored(size)
        elif task is None or command == SchedulerCommand.CREATE:
            self._report_task(SchedulerCommand.ERROR, number)
        elif command == SchedulerCommand.ADD:
            more = firmata.unpacked(data[1:])
            if len(task.messages) + len(more) <= task.size:
                task.messages += more
        else:
            ms = int.from_bytes(firmata.unpacked(data[1:]), "little")
            task.at, task.due = 0, self.chip.now + self._cycles(ms + TICK_MS)

    def _report_task(self, reply: SchedulerCommand, number: int) -> None:
        """Send the number of a task and, if there is one, its time, length, position and messages."""
        task, state = self._tasks.get(number), b""
        if task is not None:
            ms = 0 if task.due is None else int(task.due * 1000 / self.chip.cycles_per_second) - TICK_MS
            at = len(task.messages) if task.due is None else task.at
            parts = ((ms, TASK_TIME_BYTES), (task.size, 2), (at, 2))
            head = b"".join(value.to_bytes(size, "little") for value, size in parts)
            state = firmata.packed(head + bytes(task.messages))
        self.outgoing += firmata.task(reply, bytes((number,)) + state)


def _delay(message: Message) -> int | None:
    """Return the milliseconds of a delay in a stored run."""
    if not message.is_command(FirmataCommand.SCHEDULER) or message.data[1:2] != bytes(
        (SchedulerCommand.DELAY,)
    ):
        return None
    return int.from_bytes(firmata.unpacked(message.data[2:]), "little")
