"""Pseudo-terminals with virtual devices behind them: one loop that transfers the bytes.

In: devices. Out: the paths that clients open. All of them are closed when the block ends.
"""

from __future__ import annotations

import ctypes
import errno
import os
import select
import struct
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from servogen.errors import ToolError

if os.name == "posix":
    import fcntl
    import termios
    import tty

READ_BYTES = 4096
POLL_S = 0.05
PASSED_ON_S = 0.2
STARTED_S = 0.5
"""The time from opening a port to the restart of its device, unless the client sends something earlier.

A client discards what it has received when it opens a port, and would miss what came at once.
"""
OPENED, CLOSED = 0x20, 0x18
"""IN_OPEN; IN_CLOSE_WRITE and IN_CLOSE_NOWRITE (sys/inotify.h)."""
EVENT = struct.Struct("iIII")
"""struct inotify_event: watch, mask, cookie, and the length of the name, 0 for what is not in a folder."""
EVENTS_BYTES = 4096
"""The bytes that are read at once; events beyond them are read the next time."""


class Worker(Protocol):
    """What has its turn again and again, while it is `working`."""

    @property
    def working(self) -> bool: ...

    def work(self) -> None: ...


class TerminalDevice(Worker, Protocol):
    """What is behind a port. `gone`: unplugged as soon as all of `outgoing` is sent. `reset`: it was reset,
    so that what it sent before and nobody has read is dropped.
    """

    outgoing: bytearray
    gone: bool
    reset: bool

    def received(self, data: bytes) -> None: ...


@runtime_checkable
class ResetByOpening(Protocol):
    """A device that the modem lines of its port reset when a client opens it."""

    told: bool
    """Whether it is told of each opening, and need not conclude it from a silence."""

    def restarted(self) -> None:
        """Begin anew, as after a reset."""


@dataclass(slots=True)
class _Terminal:
    device: TerminalDevice
    master: int
    slave: int
    """Kept open, so that the terminal outlives its clients."""
    sent_at: float = 0.0
    opened_at: float | None = None
    """When a client opened it whose device has not restarted yet."""


class Openings:
    """Notices when a client opens a pseudo-terminal, which resets an Arduino.

    This takes inotify, which only Linux has; on other systems nothing is noticed.
    """

    def __init__(self) -> None:
        self.handle: int | None = None
        """To be waited for; None where the system has no inotify."""
        self._paths: dict[int, str] = {}
        self._clients: dict[str, int] = {}
        if sys.platform.startswith("linux"):
            self._library = ctypes.CDLL(None, use_errno=True)
            self.handle = self._checked(self._library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC))

    def watch(self, path: str) -> bool:
        """Notice from now on who opens the terminal at `path`; return whether this system tells it."""
        if self.handle is None:
            return False
        watch = self._library.inotify_add_watch(self.handle, os.fsencode(path), OPENED | CLOSED)
        self._paths[self._checked(watch)] = path
        self._clients[path] = 0
        return True

    def changes(self) -> Iterator[tuple[str, bool]]:
        """Yield each path that got its first client (True) or lost its last one (False)."""
        if self.handle is None:
            return
        try:
            events = os.read(self.handle, EVENTS_BYTES)
        except BlockingIOError:
            return
        for watch, mask, _, _ in EVENT.iter_unpack(events):
            path = self._paths.get(watch)
            if path is None or not mask & (OPENED | CLOSED):
                continue
            before = self._clients[path]
            # inotify merges equal events that follow each other, so that the count may be too low
            self._clients[path] = before + 1 if mask & OPENED else max(0, before - 1)
            if bool(before) != bool(self._clients[path]):
                yield path, not before

    def close(self) -> None:
        """Stop noticing."""
        if self.handle is not None:
            os.close(self.handle)
            self.handle = None

    def _checked(self, result: int) -> int:
        if result < 0:
            raise ToolError("tool-failed", f"inotify: {os.strerror(ctypes.get_errno())}")
        return result


class Terminals:
    """Open pseudo-terminals; `paths` by the devices' names. Raises ToolError on systems without them."""

    def __init__(self, devices: Mapping[str, TerminalDevice], beside: Worker | None = None) -> None:
        """Open a terminal for each device; what is `beside` them has its turn, too."""
        self._beside = beside
        if os.name != "posix":
            raise ToolError(
                "tool-missing",
                "the virtual bench needs pseudo-terminals, which this system does not have",
                hint="servogen simulate and servogen watch run programs without them",
            )
        self._open: dict[str, _Terminal] = {}
        self._openings = Openings()
        self.paths: dict[str, str] = {}
        for name, device in devices.items():
            master, slave = os.openpty()
            tty.setraw(slave)
            os.set_blocking(master, False)
            self._open[name] = _Terminal(device, master, slave)
            self.paths[name] = os.ttyname(slave)
            if isinstance(device, ResetByOpening):
                device.told = self._openings.watch(self.paths[name])

    def serve(self, ended: Callable[[], bool]) -> None:
        """Transfer bytes until `ended`."""
        while not ended():
            self._turn()

    def close(self) -> None:
        """Close all terminals."""
        for name in list(self._open):
            self._unplug(name)
        self._openings.close()

    def _turn(self) -> None:
        masters = {terminal.master: terminal for terminal in self._open.values()}
        sending = [fd for fd, terminal in masters.items() if terminal.device.outgoing]
        beside = self._beside if self._beside is not None and self._beside.working else None
        busy = beside is not None or any(terminal.device.working for terminal in masters.values())
        openings = [] if self._openings.handle is None else [self._openings.handle]
        readable, writable, _ = select.select([*masters, *openings], sending, (), 0 if busy else POLL_S)
        self._restart(readable)
        for fd in readable:
            if fd in masters:
                _receive(masters[fd])
        for fd in writable:
            _send(masters[fd])
        if beside is not None:
            beside.work()
        for name, terminal in list(self._open.items()):
            if terminal.device.working:
                terminal.device.work()
            if terminal.device.gone and not terminal.device.outgoing and not _unread(terminal):
                self._unplug(name)

    def _restart(self, readable: Sequence[int]) -> None:
        """Restart the devices whose ports have been opened, before they take what the client sends."""
        now = time.monotonic()
        for path, opened in self._openings.changes():
            for name, terminal in self._open.items():
                if self.paths[name] == path:
                    terminal.opened_at = now if opened else None
                    terminal.device.outgoing.clear()  # held in reset, or with nobody to send it to
        for terminal in self._open.values():
            due = terminal.opened_at is not None and now >= terminal.opened_at + STARTED_S
            if terminal.opened_at is not None and (due or terminal.master in readable):
                terminal.opened_at = None
                assert isinstance(terminal.device, ResetByOpening)  # no other one is watched
                terminal.device.restarted()

    def _unplug(self, name: str) -> None:
        terminal = self._open.pop(name)
        os.close(terminal.master)
        os.close(terminal.slave)


@contextmanager
def terminals(devices: Mapping[str, TerminalDevice], beside: Worker | None = None) -> Iterator[Terminals]:
    """Yield terminals that are closed when the block ends; see `Terminals`."""
    opened = Terminals(devices, beside)
    try:
        yield opened
    finally:
        opened.close()


def _receive(terminal: _Terminal) -> None:
    try:
        data = os.read(terminal.master, READ_BYTES)
    except OSError as error:
        if error.errno not in (errno.EIO, errno.EAGAIN):  # no client has it open, or nothing there
            raise
        return
    terminal.device.received(data)
    if terminal.device.reset:
        termios.tcflush(terminal.slave, termios.TCIFLUSH)
        terminal.device.reset = False


def _unread(terminal: _Terminal) -> bool:
    """Return whether bytes wait for the client, which would be lost if the terminal were closed.

    The system takes a moment to pass on what was just sent, and does not count it meanwhile.
    """
    if time.monotonic() < terminal.sent_at + PASSED_ON_S:
        return True
    waiting = fcntl.ioctl(terminal.slave, termios.FIONREAD, b"\0\0\0\0")
    return int.from_bytes(waiting, sys.byteorder) > 0


def _send(terminal: _Terminal) -> None:
    try:
        sent = os.write(terminal.master, terminal.device.outgoing)
    except BlockingIOError:
        return
    del terminal.device.outgoing[:sent]
    terminal.sent_at = time.monotonic()
