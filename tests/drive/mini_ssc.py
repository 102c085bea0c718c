"""A Mini SSC controller, written from its manual alone: three bytes, sync 255, servo number, position."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from servogen.bench.ports import Unplugged
from servogen.drive.serial_link import Time
from servogen.errors import Location, ToolError

BITS = 10


@dataclass
class Decoder:
    """Takes bytes one at a time; `moves` is (servo number, position) of every whole command."""

    moves: list[tuple[int, int]] = field(default_factory=list)
    ignored: int = 0
    _state: int = 0
    _number: int = 0

    def take(self, byte: int) -> None:
        if byte == 255:
            self.ignored += self._state
            self._state = 1
        elif self._state == 1:
            self._number, self._state = byte, 2
        elif self._state == 2:
            self.moves.append((self._number, byte))
            self._state = 0
        else:
            self.ignored += 1

    @property
    def positions(self) -> dict[int, int]:
        return dict(self.moves)


@dataclass
class Robot:
    """A controller at the end of a line of `baud` in a time that only passes while someone waits.

    `arrived`: (moment at which the last bit of a command is in, number, position). `faults`: the moments from
    which on the line is away, and for how long.
    """

    baud: int
    faults: list[tuple[float, float]] = field(default_factory=list)
    now: float = 0.0
    decoder: Decoder = field(default_factory=Decoder)
    arrived: list[tuple[float, int, int]] = field(default_factory=list)
    opened: int = 0
    open_now: int = 0
    after_wait: Callable[[], None] = lambda: None
    _free: float = 0.0

    def time(self) -> Time:
        return Time(lambda: self.now, self._sleep)

    def _sleep(self, seconds: float) -> None:
        assert seconds >= 0
        self.now += seconds
        self.after_wait()

    def _away(self) -> bool:
        return any(begin <= self.now < begin + length for begin, length in self.faults)

    def write(self, data: bytes) -> None:
        if self._away():
            raise Unplugged("port-lost", "the device disappeared while it was in use", Location("/dev/robot"))
        assert self.now >= self._free - 1e-9, "bytes pile up before the line"
        self._free = self.now
        for byte in data:
            self._free += BITS / self.baud
            before = len(self.decoder.moves)
            self.decoder.take(byte)
            for number, position in self.decoder.moves[before:]:
                self.arrived.append((self._free, number, position))

    @contextmanager
    def open(self) -> Iterator["Robot"]:
        if self._away():
            raise ToolError("no-such-port", "there is no such port", Location("/dev/robot"))
        self.opened += 1
        self.open_now += 1
        try:
            yield self
        finally:
            self.open_now -= 1
