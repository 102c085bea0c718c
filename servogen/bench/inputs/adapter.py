"""`InputAdapter`: drives the chip's inputs while an analyser looks, by a board that speaks Firmata.

In: an open port, the wiring, and `BoardInput`s: what to do, at which millisecond of a run. Out: levels at the
chip's pins. A board with the scheduler (ConfigurableFirmata) stores a run and plays it by its own clock; with
any other one (StandardFirmata) this process sends each change when it is due.

    load    the run is stored on the board, or kept here
    start   MARK rises: moment 0 of the run, at which the analyser starts too

An analyser sends nothing until its memory is full, and equal samples fill it slowly: after a run MARK changes
all the time.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from servogen.bench.inputs import firmata
from servogen.bench.inputs.firmata import (
    BAUDS,
    FirmataCommand,
    Message,
    MessageReader,
    Mode,
    SchedulerCommand,
)
from servogen.bench.inputs.wiring import MARK, Contact, InputWiring
from servogen.bench.ports import Port, open_port
from servogen.errors import InputError, Location, ToolError

ANSWER_S = 0.7
START_S = 8.0
"""Opening its port resets an Arduino, whose boot loader runs for up to two seconds."""
QUERY_S = 2.0
MAX_TALK = 5
"""The multiple of a timeout for which a device may send other messages."""
RUN, FILLER = 1, 2
"""The numbers of the tasks on the board."""
RUN_DELAY_MS = 5
"""The time from the message that starts a stored run to its moment 0."""
FILLS = 9
"""Changes of MARK in each millisecond after a run; an odd number."""
HOST_FILLS = 1000
"""Changes and back again after a run that this process plays, each half a millisecond long."""
SMALL_BOARD_PINS = 30
"""The most pins that Firmata counts on a board with 2 or 2.5 KB of memory: 20 on an Uno, 30 on a Leonardo."""
SMALL_TASK, LARGE_TASK = 400, 4000
"""The bytes of a run that fit into the memory of such a board, and of a Mega (8 KB, 70 pins)."""


@dataclass(frozen=True, slots=True)
class DrivePin:
    """Drives what a board's pin is wired to, a pin of the chip, MCLR, VDD or MARK; None lets it go."""

    name: str
    level: int | None


@dataclass(frozen=True, slots=True)
class Close:
    """Closes or opens a contact."""

    contact: Contact
    closed: bool


@dataclass(frozen=True, slots=True)
class Send:
    """Sends bytes to a pin."""

    pin: str
    data: bytes
    baud: int


@dataclass(frozen=True, slots=True)
class BoardInput:
    at_ms: int
    what: DrivePin | Close | Send


@dataclass(frozen=True, slots=True)
class BoardFacts:
    """What a board says of itself."""

    firmware: str
    pins: int
    serial_ports: tuple[int, ...]
    scheduler: bool
    """Whether it stores runs and plays them by its own clock."""


@dataclass(frozen=True, slots=True)
class SerialAdapter:
    """A USB serial adapter whose TX is wired to a pin of the chip."""

    port: Port
    pin: str

    def send(self, data: bytes, baud: int) -> None:
        self.port.line.baudrate = baud
        self.port.write(data)


@dataclass(slots=True)
class InputAdapter:
    port: Port
    wiring: InputWiring
    board: BoardFacts
    serial: SerialAdapter | None = None
    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    _levels: dict[int, int | None] = field(default_factory=dict)
    """The level that each pin of the board drives; None: nothing."""
    _bauds: dict[int, int] = field(default_factory=dict)
    """The rates of the board's open serial ports."""
    _length_ms: int = 0
    """The length of the run that was loaded."""
    _loaded: list[tuple[int, Callable[[], None]]] = field(default_factory=list)
    """A run that this process plays: (ms, what to do)."""

    def release(self) -> None:
        """Let go of the chip: every wired pin of the board becomes an input, but MARK, which stays low."""
        self.stop()
        messages = b"".join(self._off(port) for port in list(self._bauds))
        for pin in sorted(self.wiring.outputs - {self.wiring.pins[MARK]}):
            messages += firmata.pin_mode(pin, Mode.INPUT)
            self._levels[pin] = None
        self.port.write(messages)

    def apply(self, inputs: Iterable[DrivePin | Close | Send]) -> None:
        """Do something now, without a capture."""
        self.port.write(b"".join(self._messages(change) for change in inputs))

    def stop(self) -> None:
        """End what the board still does of the last run; MARK is low then."""
        if self.board.scheduler:
            self.port.write(firmata.task(SchedulerCommand.RESET))
        self._levels[self.wiring.pins[MARK]] = None
        self.port.write(self._drive_bytes(self.wiring.pins[MARK], 0))

    def load(self, inputs: Sequence[BoardInput], length_ms: int) -> None:
        """Prepare a run. Raises InputError for what is not wired or does not fit, ToolError."""
        ordered = sorted(inputs, key=lambda input_: input_.at_ms)
        self._loaded = []
        self._length_ms = length_ms
        if self.board.scheduler and not any(self._by_adapter(input_.what) for input_ in ordered):
            self._store(ordered)
            return
        self._loaded = [(0, lambda: self.apply((DrivePin(MARK, 1),)))]
        for input_ in ordered:
            self._loaded.append((input_.at_ms, self._action(input_.what)))
        self._loaded.append((length_ms, lambda: self.port.write(HOST_FILLS * self._fill())))

    def start(self) -> None:
        """Begin the run that was loaded; where this process plays it, return when it is over."""
        if not self._loaded:
            self.port.write(firmata.schedule_task(RUN, RUN_DELAY_MS))
            self.port.write(firmata.schedule_task(FILLER, RUN_DELAY_MS + self._length_ms))
            return
        begin = self.now()
        for ms, act in self._loaded:
            self.sleep(max(0.0, begin + ms / 1000 - self.now()))
            act()

    def _fill(self) -> bytes:
        """Return messages that change MARK and change it back."""
        mark = self.wiring.pins[MARK]
        return firmata.pin_value(mark, 0) + firmata.pin_value(mark, 1)

    def _action(self, action: DrivePin | Close | Send) -> Callable[[], None]:
        serial = self.serial
        if isinstance(action, Send) and serial is not None and self._by_adapter(action):
            return lambda: serial.send(action.data, action.baud)
        return lambda: self.apply((action,))

    def _by_adapter(self, action: DrivePin | Close | Send) -> bool:
        return isinstance(action, Send) and self.serial is not None and self.serial.pin == action.pin

    def _store(self, inputs: Sequence[BoardInput]) -> None:
        messages, now = self._messages(DrivePin(MARK, 1)), 0
        for input_ in inputs:
            if input_.at_ms > now:
                messages += firmata.delay_ms(input_.at_ms - now)
                now = input_.at_ms
            messages += self._messages(input_.what)
        most = SMALL_TASK if self.board.pins <= SMALL_BOARD_PINS else LARGE_TASK
        if len(messages) > most:
            raise InputError(
                "out-of-range",
                f"the inputs of a run take {len(messages)} bytes, of which {most} fit into the input board",
                Location(self.port.path),
                "examine the chip more often, so that each run has fewer changes",
            )
        changes = FILLS * self._fill()
        half = len(changes) // 2
        filler = changes[:half] + firmata.delay_ms(1) + changes[half:] + firmata.delay_ms(1)
        self.port.write(firmata.task(SchedulerCommand.RESET))
        # FirmataScheduler puts the newest task first, and forgets those before a task that ends
        self.port.write(firmata.load_task(FILLER, filler) + firmata.load_task(RUN, messages))
        self.port.write(firmata.task(SchedulerCommand.QUERY, bytes((RUN,))))
        reply = ask(self.port, lambda message: message.is_command(FirmataCommand.SCHEDULER), QUERY_S)
        state = b"" if reply is None else firmata.unpacked(reply.data[3:])
        # time_ms (4 bytes), length (2), position (2): all of it has arrived where the two are the same
        if len(state) < 8 or state[4:6] != len(messages).to_bytes(2, "little") or state[6:8] != state[4:6]:
            raise ToolError(
                "tool-failed", "the input board did not store the run", Location(self.port.path), "try again"
            )

    def _messages(self, action: DrivePin | Close | Send) -> bytes:
        """Return what the board is sent for an input."""
        match action:
            case DrivePin(name, level):
                pin = self.wiring.pins.get(name)
                if pin is None:
                    raise InputError("unknown-pin", f"{name} is not wired to the input board")
                # A serial port of the board drives its pin for as long as it is open.
                closed = self._off(self.wiring.lines[name]) if name in self.wiring.lines else b""
                return closed + self._drive_bytes(pin, level)
            case Close(contact, closed_now):
                if contact not in self.wiring.contacts:
                    names = "-".join(sorted(contact))
                    raise InputError("unknown-pin", f"the input board has no contact {names}")
                return self._drive_bytes(self.wiring.contacts[contact], int(closed_now))
            case Send(pin_name, data, baud):
                port = self.wiring.lines.get(pin_name)
                if port is None:
                    raise InputError(
                        "unknown-pin", f"no serial port of the input board is wired to {pin_name}"
                    )
                idle = self._on(pin_name, port, baud)
                return idle + firmata.serial_write(port, data)

    def listen(self, pin: str, baud: int) -> None:
        """Let the line that is wired to a pin idle, so that a run may send on it."""
        if self.serial is not None and self.serial.pin == pin:
            self.apply([DrivePin(pin, None)] if pin in self.wiring.pins else [])
        else:
            self.port.write(self._on(pin, self.wiring.lines[pin], baud))

    def _on(self, pin: str, port: int, baud: int) -> bytes:
        driven = self._drive_bytes(self.wiring.pins[pin], None) if pin in self.wiring.pins else b""
        if self._bauds.get(port) == baud:
            return driven
        self._bauds[port] = baud
        return driven + firmata.serial_config(port, baud)

    def _off(self, port: int) -> bytes:
        return firmata.serial_close(port) if self._bauds.pop(port, None) is not None else b""

    def _drive_bytes(self, pin: int, level: int | None) -> bytes:
        before = self._levels.get(pin, None)
        if before == level and pin in self._levels:
            return b""
        self._levels[pin] = level
        if level is None:
            return firmata.pin_mode(pin, Mode.INPUT)
        mode = firmata.pin_mode(pin, Mode.OUTPUT) if before is None else b""
        return mode + firmata.pin_value(pin, level)


@contextmanager
def input_adapter(
    path: str, wiring: InputWiring, serial: SerialAdapter | None = None
) -> Iterator[InputAdapter]:
    """Yield the adapter at a port, with the chip let go of. Raises InputError, ToolError."""
    with open_port(path, BAUDS[0]) as port:
        board = identify(port)
        _check(board, wiring, path)
        adapter = InputAdapter(port, wiring, board, serial)
        adapter.release()
        yield adapter


def identify(port: Port) -> BoardFacts:
    """Return what the board is. Raises ToolError where nothing answers as Firmata does."""
    end = time.monotonic() + START_S
    answer = None
    heard = False
    while answer is None and time.monotonic() < end:
        for baud in BAUDS:
            port.line.baudrate = baud
            port.write(firmata.sysex(FirmataCommand.FIRMWARE))
            answer, others = _ask(port, lambda message: message.is_command(FirmataCommand.FIRMWARE), ANSWER_S)
            heard = heard or others
            if answer is not None:
                break
    if answer is None:
        place = Location(port.path)
        hint = "is this its port, and is StandardFirmata or ConfigurableFirmata on it?"
        if heard:
            raise ToolError("wrong-device", "the device is not a Firmata board", place, hint)
        raise ToolError("no-answer", "the input board does not answer", place, hint)
    name = firmata.joined_bytes(answer.data[3:]).decode("latin-1")
    version = ".".join(str(byte) for byte in answer.data[1:3])
    port.write(firmata.sysex(FirmataCommand.CAPABILITY_QUERY))
    capabilities = ask(port, lambda message: message.is_command(FirmataCommand.CAPABILITIES), QUERY_S)
    if capabilities is None:
        raise ToolError("wrong-device", "the board does not report what its pins can do", Location(port.path))
    modes = list(pin_modes(capabilities.data[1:]))
    senders = {
        mode[Mode.SERIAL] // 2 for mode in modes if mode.get(Mode.SERIAL, 0) % 2 and Mode.SERIAL in mode
    }
    port.write(firmata.task(SchedulerCommand.QUERY_ALL))
    # a board without a scheduler answers nothing, or a text that it does not know the command
    said = ask(
        port,
        lambda message: (
            message.is_command(FirmataCommand.SCHEDULER) or message.is_command(FirmataCommand.TEXT)
        ),
        ANSWER_S,
    )
    return BoardFacts(
        f"{name} {version}",
        len(modes),
        tuple(sorted(senders)),
        said is not None and said.is_command(FirmataCommand.SCHEDULER),
    )


def pin_modes(data: bytes) -> Iterator[Mapping[int, int]]:
    """Yield the modes of each pin with their resolutions, from the answer to `CAPABILITY_QUERY`."""
    modes: dict[int, int] = {}
    offset = 0
    while offset < len(data):
        if data[offset] == firmata.NO_MORE_MODES:
            yield modes
            modes, offset = {}, offset + 1
        else:
            if offset + 1 < len(data):
                modes[data[offset]] = data[offset + 1]
            offset += 2


def ask(port: Port, wanted: Callable[[Message], bool], seconds: float) -> Message | None:
    """Return the first message that is wanted; None if it does not come in time."""
    return _ask(port, wanted, seconds)[0]


def _ask(port: Port, wanted: Callable[[Message], bool], seconds: float) -> tuple[Message | None, bool]:
    """Return the message, and whether the device sent anything at all; `seconds` of silence end the wait."""
    reader = MessageReader()
    heard = False
    end = time.monotonic() + MAX_TALK * seconds
    while time.monotonic() < end and (data := port.read(1 << 10, seconds)):
        heard = True
        for message in reader.read(data):
            if wanted(message):
                return message, heard
    return None, heard


def _check(board: BoardFacts, wiring: InputWiring, path: str) -> None:
    place = Location(path)
    beyond = next((pin for pin in sorted(wiring.outputs) if pin >= board.pins), None)
    if beyond is not None:
        raise InputError(
            "out-of-range", f"the input board has {board.pins} pins, and pin {beyond} is wired", place
        )
    missing = next((port for port in wiring.lines.values() if port not in board.serial_ports), None)
    if missing is not None:
        known = ", ".join(f"TX{port}" for port in board.serial_ports) or "none"
        raise InputError(
            "out-of-range",
            f"the input board has no serial port TX{missing}",
            place,
            f"it has {known}; a USB serial adapter can send as well",
        )
