"""Pseudo-terminals with virtual devices behind them: one loop that transfers the bytes.

In: devices. Out: the paths that clients open. All of them are closed when the block ends.
"""

from __future__ import annotations

import errno
import os
import select
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from servogen.errors import ToolError

if os.name == "posix":
    import fcntl
    import termios
    import tty

READ_BYTES = 4096
POLL_S = 0.05
PASSED_ON_S = 0.2


class Device(Protocol):
    """What is behind a port. `gone`: unplugged as soon as all of `outgoing` is sent. `reset`: it was reset,
    so that what it sent before and nobody has read is dropped.
    """

    outgoing: bytearray
    gone: bool
    reset: bool

    @property
    def working(self) -> bool: ...

    def received(self, data: bytes) -> None: ...

    def work(self) -> None: ...


@dataclass(slots=True)
class _Terminal:
    device: Device
    master: int
    slave: int
    """Kept open, so that the terminal outlives its clients."""
    sent_at: float = 0.0


class Terminals:
    """Open pseudo-terminals; `paths` by the devices' names. Raises ToolError on systems without them."""

    def __init__(self, devices: Mapping[str, Device]) -> None:
        if os.name != "posix":
            raise ToolError(
                "tool-missing",
                "the virtual bench needs pseudo-terminals, which this system does not have",
                hint="servogen simulate and servogen watch run programs without them",
            )
        self._open: dict[str, _Terminal] = {}
        self.paths: dict[str, str] = {}
        for name, device in devices.items():
            master, slave = os.openpty()
            tty.setraw(slave)
            os.set_blocking(master, False)
            self._open[name] = _Terminal(device, master, slave)
            self.paths[name] = os.ttyname(slave)

    def serve(self, ended: Callable[[], bool]) -> None:
        """Transfer bytes until `ended`."""
        while not ended():
            self._turn()

    def close(self) -> None:
        for name in list(self._open):
            self._unplug(name)

    def _turn(self) -> None:
        masters = {terminal.master: terminal for terminal in self._open.values()}
        sending = [fd for fd, terminal in masters.items() if terminal.device.outgoing]
        busy = any(terminal.device.working for terminal in masters.values())
        readable, writable, _ = select.select(list(masters), sending, (), 0 if busy else POLL_S)
        for fd in readable:
            _receive(masters[fd])
        for fd in writable:
            _send(masters[fd])
        for name, terminal in list(self._open.items()):
            if terminal.device.working:
                terminal.device.work()
            if terminal.device.gone and not terminal.device.outgoing and not _unread(terminal):
                self._unplug(name)

    def _unplug(self, name: str) -> None:
        terminal = self._open.pop(name)
        os.close(terminal.master)
        os.close(terminal.slave)


@contextmanager
def terminals(devices: Mapping[str, Device]) -> Iterator[Terminals]:
    """Yield terminals that are closed when the block ends."""
    opened = Terminals(devices)
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
