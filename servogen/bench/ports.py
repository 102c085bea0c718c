"""Serial ports: opened for one process alone, with errors that say what is wrong with the port.

In: a path. Out: an open `Port`, or `ToolError`.
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from servogen.errors import Location, ServogenError, ToolError

if os.name == "posix":
    import fcntl

if TYPE_CHECKING:
    import serial

try:
    from termios import error as _terminal_error  # which is not an OSError
except ImportError:  # not on POSIX
    _FAILURES: tuple[type[Exception], ...] = (OSError, ValueError)
else:
    _FAILURES = (OSError, ValueError, _terminal_error)
"""What pyserial raises where it opens a port; a terminal error where the port goes away meanwhile."""

POLL_S = 0.05
"""The time that one read of the port waits for bytes."""


class Unplugged(ServogenError):
    """Raised when a port disappears while in use."""

    exit_code = ToolError.exit_code


@dataclass(frozen=True, slots=True)
class Port:
    """An open port."""

    path: str
    line: serial.Serial

    def write(self, data: bytes) -> None:
        """Send all of `data`. Raises Unplugged."""
        try:
            self.line.write(data)
            self.line.flush()
        except Exception as error:  # termios.error is not an OSError
            raise self.unplugged() from error

    def read(self, most: int, seconds: float) -> bytes:
        """Return what arrives within `seconds`, at most `most` bytes, as soon as there are any.

        After that it is looked once more: this process may not have had a turn meanwhile. Raises Unplugged.
        """
        end = time.monotonic() + seconds
        while True:
            over = time.monotonic() >= end
            try:
                self.line.timeout = POLL_S
                data: bytes = self.line.read(max(1, min(most, self.line.in_waiting)))
            except (OSError, TypeError) as error:  # TypeError: pyserial's, where the port closes under it
                raise self.unplugged() from error
            if data or over:
                return data

    def read_whole(self, count: int, seconds: float) -> bytes:
        """Return `count` bytes, or fewer if the rest does not arrive within `seconds`."""
        data = b""
        end = time.monotonic() + seconds
        while len(data) < count:
            more = self.read(count - len(data), max(0.0, end - time.monotonic()))
            if not more and time.monotonic() >= end:
                break
            data += more
        return data

    def clear(self) -> None:
        """Discard received bytes that have not been read."""
        try:
            self.line.reset_input_buffer()
        except Exception as error:  # termios.error is not an OSError
            raise self.unplugged() from error

    def unplugged(self) -> Unplugged:
        return Unplugged(
            "port-lost", "the device disappeared while it was in use", Location(self.path), "plug it in again"
        )


@contextmanager
def open_port(path: str, baud: int) -> Iterator[Port]:
    """Yield the port at `path`, opened for this process alone. Raises ToolError."""
    import serial

    try:
        line = serial.Serial(path, baud, timeout=POLL_S, write_timeout=5, exclusive=True)
    except _FAILURES as error:
        refuse(path, error)
    try:
        yield Port(path, line)
    finally:
        close(line)


@contextmanager
def held(path: str) -> Iterator[None]:
    """Reserve the port for this process and the programs that it starts; no other servogen opens it
    meanwhile.
    """
    if os.name != "posix":  # elsewhere only one program at a time can open a port
        yield
        return
    try:
        handle = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        refuse(path, error)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            refuse(path, error)
        if not os.isatty(handle):
            raise ToolError("no-such-port", "is not a serial port", Location(path))
        yield
    finally:
        os.close(handle)


def close(line: serial.Serial) -> None:
    """Close a port that may already have disappeared."""
    try:
        line.close()
    except OSError:
        return


def refuse(path: str, error: Exception) -> NoReturn:
    """Raise the ToolError for an error on opening `path`."""
    code = error.errno if isinstance(error, OSError) else None
    place = Location(path)
    if code in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        raise ToolError(
            "no-such-port", "there is no such port", place, "`servogen doctor` lists the ports"
        ) from error
    if code in (errno.EBUSY, errno.EAGAIN):
        raise ToolError(
            "port-busy", "is in use by another program", place, "close the other program"
        ) from error
    if code in (errno.EACCES, errno.EPERM):
        hint = "join the group that owns it (sudo usermod -aG dialout $USER), and log in again"
        raise ToolError("port-denied", "cannot be opened: permission denied", place, hint) from error
    raise ToolError("no-such-port", f"cannot be opened as a serial port: {error}", place) from error
