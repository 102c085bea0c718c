"""A limit to the time that one piece of work may take, in whatever thread it runs.

In: seconds. Out: `TookTooLong` is raised inside the block where they pass. Python's own code is stopped
wherever it is; compiled code, as the simulator's loop, is stopped when it next comes back.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class TookTooLong(BaseException):
    """The time is over. It is no Exception, so that nothing on its way takes it for an error of its own."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raises TookTooLong in this thread once the block takes longer."""
    lock, ended = threading.Lock(), threading.Event()
    thread = threading.get_ident()

    def stop() -> None:
        with lock:
            if not ended.is_set():
                _raise_in(thread, TookTooLong)

    timer = threading.Timer(seconds, stop)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            ended.set()
        timer.cancel()


def _raise_in(thread: int, kind: type[BaseException]) -> None:
    """CPython's way to raise in another thread; it is raised there between two of its instructions."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(kind))
