"""A limit to the time that one piece of work may take, in whatever thread it runs.

In: seconds and the work. Out: what it gives, or `TookTooLong`. Python's own code is stopped wherever it is;
compiled code, as the simulator's loop, is stopped when it next comes back.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from typing import TypeVar

AGAIN_S = 0.2
"""What is raised in a destructor or a callback of the garbage collection is lost: it is raised again."""

T = TypeVar("T")


class TookTooLong(BaseException):
    """The time is over. It is no Exception, so that nothing on its way takes it for an error of its own."""


def within(seconds: float, work: Callable[[], T]) -> T:
    """What `work` gives. Raises TookTooLong where it takes longer."""
    watch = _Watch(threading.get_ident())
    try:
        threading.Thread(target=watch.run, args=(seconds,), daemon=True).start()
        return work()
    finally:
        try:
            watch.end()
        except TookTooLong:  # raised just now, as the work was done
            watch.end()


class _Watch:
    """Raises in a thread, again and again until it is ended."""

    def __init__(self, thread: int) -> None:
        self._thread = thread
        self._ended = threading.Event()
        self._lock = threading.Lock()

    def run(self, seconds: float) -> None:
        wait = seconds
        while not self._ended.wait(wait):
            wait = AGAIN_S
            with self._lock:
                if not self._ended.is_set():
                    _raise_in(self._thread, TookTooLong)

    def end(self) -> None:
        """Afterwards nothing is raised any more, nor is it still to come."""
        with self._lock:
            _raise_in(self._thread, None)
            self._ended.set()


def _raise_in(thread: int, kind: type[BaseException] | None) -> None:
    """CPython's way to raise in another thread, between two of its instructions; None takes it back."""
    what = ctypes.py_object() if kind is None else ctypes.py_object(kind)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), what)
