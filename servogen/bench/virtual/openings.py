"""`Openings`: notices when a client opens a pseudo-terminal, which resets an Arduino.

In: paths. Out: those that were opened or closed, in order. This takes inotify, which only Linux has; on other
systems nothing is noticed.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from collections.abc import Iterator

from servogen.errors import ToolError

OPENED, CLOSED = 0x20, 0x18
"""IN_OPEN; IN_CLOSE_WRITE and IN_CLOSE_NOWRITE (sys/inotify.h)."""
EVENT = struct.Struct("iIII")
"""struct inotify_event: watch, mask, cookie, and the length of the name, 0 for what is not in a folder."""
EVENTS_BYTES = 4096


class Openings:
    def __init__(self) -> None:
        self.handle: int | None = None
        """To be waited for; None where the system has no inotify."""
        self._paths: dict[int, str] = {}
        self._clients: dict[str, int] = {}
        if sys.platform.startswith("linux"):
            self._library = ctypes.CDLL(None, use_errno=True)
            self.handle = self._checked(self._library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC))

    def watch(self, path: str) -> None:
        """Notice from now on who opens the terminal at `path`."""
        if self.handle is not None:
            watch = self._library.inotify_add_watch(self.handle, os.fsencode(path), OPENED | CLOSED)
            self._paths[self._checked(watch)] = path
            self._clients[path] = 0

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
        if self.handle is not None:
            os.close(self.handle)
            self.handle = None

    def _checked(self, result: int) -> int:
        if result < 0:
            raise ToolError("tool-failed", f"inotify: {os.strerror(ctypes.get_errno())}")
        return result
