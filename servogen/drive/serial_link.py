"""`Line`: bytes to a robot no faster than its serial line carries them, over a port that may go away.

In: how to open the port, the baud rate, the time. Out: the same bytes; `Unplugged` where the port goes, and
`again`, which waits until it is back. Time and port are given, so that nothing here waits in a test.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from typing import Protocol

from servogen.bench.ports import PortError, open_port
from servogen.errors import ToolError

BITS_A_BYTE = 10
"""Start bit, eight of data, stop bit."""

RETRY_S = 0.5


class Wire(Protocol):
    """What bytes are written to. Raises `Unplugged` once it is gone."""

    def write(self, data: bytes) -> None: ...


Opener = Callable[[], AbstractContextManager[Wire]]
"""Opens the port. Raises PortError."""


@dataclass(frozen=True, slots=True)
class Time:
    """A clock, seconds from anywhere, and how to wait."""

    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep


@dataclass(slots=True)
class VirtualTime:
    """A clock that goes on only while it is waited for."""

    at: float = 0.0

    def time(self) -> Time:
        return Time(lambda: self.at, self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.at += max(0.0, seconds)


class Nowhere:
    """A wire of a drive that is only shown."""

    def write(self, data: bytes) -> None:
        return


def port_opener(path: str, baud: int) -> Opener:
    """Opens the serial port at `path`."""
    return lambda: open_port(path, baud)


class Line:
    """An open line; `close` it, or use it in a `with`."""

    def __init__(self, opener: Opener, baud: int, time: Time, patience_s: float) -> None:
        """Opens it. Raises PortError."""
        self.byte_s = BITS_A_BYTE / baud
        self._opener = opener
        self._time = time
        self._patience_s = patience_s
        self._held = ExitStack()
        self._wire: Wire = self._held.enter_context(opener())
        self._free_at = time.now()

    def __enter__(self) -> Line:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._held.close()

    def send(self, data: bytes) -> float:
        """Writes `data` once all before it is out; the moment of its last stop bit. Raises Unplugged."""
        wait = self._free_at - self._time.now()
        if wait > 0:
            self._time.sleep(wait)
        begin = max(self._free_at, self._time.now())
        self._wire.write(data)
        self._free_at = begin + len(data) * self.byte_s
        return self._free_at

    def drain(self) -> None:
        """Waits until the last byte is out."""
        self._time.sleep(max(0.0, self._free_at - self._time.now()))

    def again(self, waiting: Callable[[PortError], None] = lambda error: None) -> float:
        """Open a port that went away as soon as it is back, and return the seconds that took.

        `waiting` is called with each new reason why the port cannot be opened. Raises ToolError when it stays
        away for longer than `patience_s`.
        """
        begin = self._time.now()
        self.close()
        reason = ""
        while True:
            try:
                self._wire = self._held.enter_context(self._opener())
            except PortError as error:
                away = self._time.now() - begin
                if away + RETRY_S > self._patience_s:
                    raise ToolError(
                        "port-lost",
                        f"did not come back within {self._patience_s:g} s: {error.message}",
                        error.place,
                        error.hint,
                    ) from error
                if error.message != reason:
                    waiting(error)
                    reason = error.message
                self._time.sleep(RETRY_S)
                continue
            self._free_at = self._time.now()
            return self._free_at - begin
