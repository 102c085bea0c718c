"""A pseudo-terminal that programs of libserialport open as a serial port (sigrok-cli is one).

libserialport (0.1.1, 0.1.2) opens nothing that has no link below /sys/class/tty, and nothing that answers no
TIOCMGET; a pseudo-terminal has neither. In: a C compiler. Out: a library that, loaded before the others
(LD_PRELOAD), answers both for pseudo-terminals: all modem lines are off.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from servogen.errors import Location, ToolError

if os.name == "posix":
    import fcntl

SOURCE = """\
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

static const char CLASS[] = "/sys/class/tty/pts/", TARGET[] = "../../devices/virtual/tty/pts";

static int is_terminal(const char *path, struct stat *found)
{
    if (strncmp(path, CLASS, sizeof CLASS - 1))
        return 0;
    if (found) {
        memset(found, 0, sizeof *found);
        found->st_mode = S_IFLNK | 0777;
    }
    return 1;
}

int lstat(const char *path, struct stat *found)
{
    int (*real)(const char *, struct stat *) = dlsym(RTLD_NEXT, "lstat");
    return is_terminal(path, found) ? 0 : real(path, found);
}

int __lxstat(int version, const char *path, struct stat *found)
{
    int (*real)(int, const char *, struct stat *) = dlsym(RTLD_NEXT, "__lxstat");
    return is_terminal(path, found) ? 0 : real(version, path, found);
}

ssize_t readlink(const char *path, char *target, size_t size)
{
    ssize_t (*real)(const char *, char *, size_t) = dlsym(RTLD_NEXT, "readlink");
    if (!is_terminal(path, 0))
        return real(path, target, size);
    size = size < sizeof TARGET - 1 ? size : sizeof TARGET - 1;
    memcpy(target, TARGET, size);
    return size;
}

int ioctl(int file, unsigned long request, ...)
{
    va_list rest;
    va_start(rest, request);
    void *argument = va_arg(rest, void *);
    va_end(rest);
    int (*real)(int, unsigned long, ...) = dlsym(RTLD_NEXT, "ioctl");
    int result = real(file, request, argument);
    if (result < 0 && errno == ENOTTY && request == TIOCMGET)
        return *(int *)argument = 0;
    if (result < 0 && errno == ENOTTY && (request == TIOCMSET || request == TIOCMBIS || request == TIOCMBIC))
        return 0;
    return result;
}
"""

TERMINAL = re.compile(r"/dev/pts/\d+")


def is_terminal(text: str) -> bool:
    """Return whether `text`, a sigrok driver with its connection, names a pseudo-terminal."""
    return TERMINAL.search(text) is not None


def compiler() -> str | None:
    """Return the C compiler that builds the library; None if there is none, or the system is not Linux."""
    return (shutil.which("cc") or shutil.which("gcc")) if sys.platform == "linux" else None


@contextmanager
def library() -> Iterator[Path]:
    """Yield the library, which exists until the block ends. Raises ToolError if it cannot be built."""
    found = compiler()
    if found is None:
        raise ToolError(
            "tool-missing",
            "a pseudo-terminal has no modem lines, and no C compiler is here to add them",
            hint="gcc",
        )
    with tempfile.TemporaryDirectory(prefix="servogen-") as folder:
        source, made = Path(folder) / "modem_lines.c", Path(folder) / "modem_lines.so"
        source.write_text(SOURCE, encoding="ascii")
        command = (found, "-shared", "-fPIC", "-O1", "-o", str(made), str(source), "-ldl")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise ToolError(
                "tool-failed", "the library that adds modem lines cannot be made", hint=done.stderr.strip()
            )
        yield made


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
"""How long one look at the port waits for bytes."""


class PortError(ToolError):
    """Raised when a port cannot be opened or used."""


class Unplugged(PortError):
    """Raised when a port disappears while in use."""


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

        Raises Unplugged.
        """
        end = time.monotonic() + seconds
        while True:
            try:
                self.line.timeout = POLL_S
                data: bytes = self.line.read(max(1, min(most, self.line.in_waiting)))
            except (OSError, TypeError) as error:  # TypeError: pyserial's, where the port closes under it
                raise self.unplugged() from error
            if data or time.monotonic() >= end:
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
            "port-lost", "the device went away while it was used", Location(self.path), "plug it in again"
        )


@contextmanager
def open_port(path: str, baud: int) -> Iterator[Port]:
    """Yield the port at `path`, opened for this process alone. Raises PortError."""
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
            raise PortError("no-such-port", "is not a serial port", Location(path))
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
    """Raise the PortError for an error on opening `path`."""
    code = error.errno if isinstance(error, OSError) else None
    place = Location(path)
    if code in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        raise PortError(
            "no-such-port", "there is no such port", place, "`servogen doctor` lists the ports"
        ) from error
    if code in (errno.EBUSY, errno.EAGAIN):
        raise PortError(
            "port-busy", "is in use by another program", place, "close the other program"
        ) from error
    if code in (errno.EACCES, errno.EPERM):
        hint = "join the group that owns it, as: sudo usermod -aG dialout $USER, and log in again"
        raise PortError("port-denied", "may not be opened: permission denied", place, hint) from error
    raise PortError("no-such-port", f"cannot be opened as a serial port: {error}", place) from error
