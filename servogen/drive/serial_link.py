"""`SerialLink`: bytes sent no faster than a serial line carries them, over a port that may disappear.

In: a function that opens the port, the baud rate, the time. Out: the same bytes; `Unplugged` when the port
disappears, and `reopen`, which waits until it is back. Time and port are parameters, so that tests do not
wait.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from typing import Protocol

from servogen.bench.ports import open_port
from servogen.errors import Diagnostic, ToolError

BITS_PER_BYTE = 10
"""The bits of a byte on the line: a start bit, eight data bits, a stop bit."""

RETRY_S = 0.5
"""The interval between attempts to open a port that has disappeared."""


class ByteSink(Protocol):
    """Something to which bytes can be written."""

    def write(self, data: bytes) -> None:
        """Write bytes. Raises `Unplugged` if the port has disappeared."""


Opener = Callable[[], AbstractContextManager[ByteSink]]
"""Opens the port. Raises ToolError."""


@dataclass(frozen=True, slots=True)
class Time:
    """A clock, in seconds from an arbitrary moment, and a function that waits."""

    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep


@dataclass(slots=True)
class VirtualTime:
    """A clock that advances only while something waits for it."""

    at: float = 0.0

    def time(self) -> Time:
        """Return this clock as a `Time`."""
        return Time(lambda: self.at, self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.at += max(0.0, seconds)


class NullWire:
    """The wire of a dry run."""

    def write(self, data: bytes) -> None:
        """Discard the bytes."""


def port_opener(path: str, baud: int) -> Opener:
    """Return a function that opens the serial port at `path`."""
    return lambda: open_port(path, baud)


class SerialLink:
    """An open serial line; `close` it, or use it in a `with` statement."""

    def __init__(self, opener: Opener, baud: int, time: Time, patience_s: float) -> None:
        """Open the line; `reopen` waits up to `patience_s` seconds for the port. Raises ToolError."""
        self.byte_s = BITS_PER_BYTE / baud
        self._opener = opener
        self._time = time
        self._patience_s = patience_s
        self._held = ExitStack()
        self._wire: ByteSink = self._held.enter_context(opener())
        self._free_at = time.now()

    def __enter__(self) -> SerialLink:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the port."""
        self._held.close()

    def send(self, data: bytes) -> float:
        """Write `data` after all earlier data is sent; return the time of its last stop bit. Raises
        Unplugged.
        """
        # The system's buffer would take much more at once, and send it when it is out of date.
        wait = self._free_at - self._time.now()
        if wait > 0:
            self._time.sleep(wait)
        begin = max(self._free_at, self._time.now())
        self._wire.write(data)
        self._free_at = begin + len(data) * self.byte_s
        return self._free_at

    def drain(self) -> None:
        """Wait until the last byte is sent."""
        self._time.sleep(max(0.0, self._free_at - self._time.now()))

    def reopen(self, waiting: Callable[[ToolError], None] = lambda error: None) -> float:
        """Open a port that has disappeared as soon as it is back; return the seconds that this took.

        `waiting` is called with each new reason why the port cannot be opened. Raises ToolError if the port
        is not back within the line's `patience_s`.
        """
        begin = self._time.now()
        self.close()
        reason: Diagnostic | None = None
        while True:
            try:
                self._wire = self._held.enter_context(self._opener())
            except ToolError as error:
                away = self._time.now() - begin
                if away + RETRY_S > self._patience_s:
                    raise ToolError(
                        "port-lost",
                        f"the port did not come back within {self._patience_s:g} s: {error.message}",
                        error.location,
                        error.hint,
                    ) from error
                if error.first != reason:
                    waiting(error)
                    reason = error.first
                self._time.sleep(RETRY_S)
                continue
            self._free_at = self._time.now()
            return self._free_at - begin
