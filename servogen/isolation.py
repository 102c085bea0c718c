"""Work done in a process of its own that is stopped at limits of time, memory, open files and result size.

In: functions without arguments and their `Limits`. Out: what each returns or raises; `LimitExceeded` where it
was stopped, `ProcessDied` where its process ended without an answer.

    this process ──fork──▶ child: sets its limits, reads nothing, prints nothing, does the work
         ▲                                                  │
         └── pipe: (returned | raised) ◀────────────────────┘      at the deadline: SIGKILL

The child is a copy of this process, so that nothing is imported twice: it costs milliseconds. Its standard
streams are /dev/null and it can write no file.
"""

from __future__ import annotations

import math
import os
import pickle
import selectors
import signal
import struct
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from servogen.errors import ServogenError

if os.name == "posix":
    import fcntl

T = TypeVar("T")

MEGABYTE = 1_000_000


@dataclass(frozen=True, slots=True)
class Limits:
    """What one piece of work may use: processor time, elapsed time, memory, the size of what it returns.

    The elapsed time, by default the processor time, is a second limit: for work that waits, and for a person
    who does. `memory_mb` counts what the process holds when the work begins. Work that begins in a large
    process, as in a notebook, has at least half of it.
    """

    seconds: float = 10.0
    memory_mb: int = 300
    result_mb: int = 16
    open_files: int = 32
    elapsed_s: float | None = None

    @property
    def deadline_s(self) -> float:
        return self.seconds if self.elapsed_s is None else self.elapsed_s


COMPILING = Limits()
"""What compiling or assembling any one program may use. The programs that fit the chip use a tenth."""


class Resource(Enum):
    """What ran out."""

    TIME = "time"
    """Of the processor, or elapsed."""
    MEMORY = "memory"
    RESULT = "result"


class LimitExceeded(Exception):
    """The work was stopped at a limit."""

    def __init__(self, resource: Resource, limits: Limits) -> None:
        super().__init__(resource, limits)
        self.resource = resource
        self.limits = limits

    def __str__(self) -> str:
        """Returns what follows "compiling it" or "running it" in a sentence."""
        if self.resource is Resource.TIME:
            if self.limits.deadline_s == self.limits.seconds:
                return f"took more than {self.limits.seconds:g} s"
            return (
                f"took more than {self.limits.seconds:g} s of processor time or {self.limits.deadline_s:g} s"
            )
        if self.resource is Resource.MEMORY:
            return f"needed more than {self.limits.memory_mb} MB of memory"
        return f"gave more than {self.limits.result_mb} MB of results and messages"


class ProcessDied(Exception):
    """The process ended without an answer: it was killed or crashed. Its text says how."""


def missing_limits() -> str:
    """Returns a sentence on the limits that this system does not enforce; empty where it enforces all."""
    if not can_fork():
        return (
            f"{sys.platform} cannot limit the memory and the open files of a process: "
            "programs are read with neither limit"
        )
    if not sys.platform.startswith("linux"):
        return f"{sys.platform} does not limit the memory of a process: programs are read without that limit"
    return ""


def run(work: Callable[[], T], limits: Limits) -> T:
    """Returns what `work` returns, done in a process of its own; raises what it raises.

    Where processes cannot be forked, `work` is done in this process without limits: see `missing_limits`.
    """
    ((_, result),) = run_each([work], limits)
    if isinstance(result, Exception):
        raise result
    return result


def run_each(
    works: Sequence[Callable[[], T]], limits: Limits, at_once: int = 1
) -> Iterator[tuple[int, T | Exception]]:
    """Yields (index, what it returned or raised) for each of `works` as it ends, `at_once` at a time.

    Each has a process of its own. All of them have ended when the iteration ends, whatever ends it.
    """
    if not can_fork():
        yield from ((index, _in_this_process(work)) for index, work in enumerate(works))
        return
    waiting = iter(enumerate(works))
    with selectors.DefaultSelector() as selector:
        try:
            while True:
                while len(selector.get_map()) < at_once and (following := next(waiting, None)) is not None:
                    child = _start(*following, limits)
                    selector.register(child.pipe, selectors.EVENT_READ, child)
                running = [key.data for key in selector.get_map().values()]
                if not running:
                    return
                soonest = min(child.deadline for child in running)
                for key, _ in selector.select(max(0.0, soonest - time.monotonic())):
                    key.data.receive()
                for child in running:
                    if child.done or time.monotonic() >= child.deadline:
                        selector.unregister(child.pipe)
                        yield child.index, child.result()
        finally:
            for key in selector.get_map().values():
                key.data.kill()


def can_fork() -> bool:
    """Whether work can be done in a process of its own here."""
    return hasattr(os, "fork") and _resource is not None


def _in_this_process(work: Callable[[], T]) -> T | Exception:
    try:
        return work()
    except Exception as error:
        return error


try:
    import resource as _resource
except ImportError:  # Windows
    _resource = None  # type: ignore[assignment]

_LENGTH = struct.Struct("<Q")
_OUT_OF_MEMORY = b"memory"
"""In place of a pickled answer: to pickle one there may be too little memory left."""


@dataclass(eq=False, slots=True)
class _Child:
    """A process at work, seen from the process that started it."""

    index: int
    process: int
    pipe: int
    limits: Limits
    deadline: float
    received: bytearray = field(default_factory=bytearray)
    done: bool = False
    """Whether it has closed its pipe or sent too much."""

    def receive(self) -> None:
        part = os.read(self.pipe, 1 << 20)
        self.received += part
        self.done = not part or len(self.received) > self.limits.result_mb * MEGABYTE

    def result(self) -> Any:
        """Returns what the work returned or the exception that it raised; the process has ended then."""
        if not self.done:
            self.kill()
            return LimitExceeded(Resource.TIME, self.limits)
        if len(self.received) > self.limits.result_mb * MEGABYTE:
            self.kill()
            return LimitExceeded(Resource.RESULT, self.limits)
        status, seconds = self._wait()
        whole, rest = self.received[: _LENGTH.size], self.received[_LENGTH.size :]
        if len(whole) == _LENGTH.size and _LENGTH.unpack(whole)[0] == len(rest):
            if rest == _OUT_OF_MEMORY:
                return LimitExceeded(Resource.MEMORY, self.limits)
            return pickle.loads(rest)
        if os.WIFSIGNALED(status):
            if os.WTERMSIG(status) == signal.SIGXCPU or seconds >= self.limits.seconds:
                return LimitExceeded(Resource.TIME, self.limits)
            name = signal.strsignal(os.WTERMSIG(status)) or "unknown"
            return ProcessDied(f"its process was ended by signal {os.WTERMSIG(status)} ({name})")
        return ProcessDied(f"its process ended with exit code {os.WEXITSTATUS(status)}")

    def kill(self) -> None:
        """Ends the process and all that it has started."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process, signal.SIGKILL)
        self._wait()

    def _wait(self) -> tuple[int, float]:
        """Returns the status that it ended with, and the seconds of processor time that it took."""
        os.close(self.pipe)
        try:
            _, status, used = os.wait4(self.process, 0)
        except ChildProcessError:  # somebody else has waited for it
            return 0, 0.0
        return status, used.ru_utime + used.ru_stime


def _start(index: int, work: Callable[[], object], limits: Limits) -> _Child:
    reading, writing = os.pipe()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # closed, or none
            stream.flush()
    process = os.fork()
    if process == 0:
        _be_child(work, limits, writing)
    with suppress(OSError):  # the child does so, too: whichever comes first
        os.setpgid(process, process)
    os.close(writing)
    return _Child(index, process, reading, limits, time.monotonic() + limits.deadline_s)


def _be_child(work: Callable[[], object], limits: Limits, writing: int) -> None:
    """Does the work, sends the answer and ends the process; never returns."""
    code = 1
    try:
        writing = _shut_off(writing)
        answer = _OUT_OF_MEMORY
        _set_limits(limits)
        # Without memory there is none to say so with; the answer for that is ready.
        with suppress(MemoryError):
            answer = _answer(work)
        _send(writing, answer)
        code = 0
    finally:
        os._exit(code)


def _answer(work: Callable[[], object]) -> bytes:
    try:
        return pickle.dumps(work())
    except MemoryError:
        return _OUT_OF_MEMORY
    except Exception as error:
        try:
            if not isinstance(error, ServogenError):  # a defect: say where
                error.add_note("".join(traceback.format_exception(error)))
            pickled = pickle.dumps(error)
            pickle.loads(pickled)  # not every exception comes back
            return pickled
        except MemoryError:
            return _OUT_OF_MEMORY
        except Exception:
            return pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))


def _send(writing: int, answer: bytes) -> None:
    left = memoryview(_LENGTH.pack(len(answer)) + answer)
    while left:
        left = left[os.write(writing, left) :]


def _shut_off(writing: int) -> int:
    """Closes all that is the parent's but the pipe `writing`; returns the number that it has now."""
    os.setpgid(0, 0)
    signal.set_wakeup_fd(-1)
    for event in (
        signal.SIGINT,
        signal.SIGTERM,
        signal.SIGHUP,
        signal.SIGALRM,
        signal.SIGCHLD,
        signal.SIGXCPU,
    ):
        signal.signal(event, signal.SIG_DFL)
    answers = fcntl.fcntl(writing, fcntl.F_DUPFD, 3)  # where the parent had no standard streams, it is one
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    for number in [int(entry.name) for entry in Path("/dev/fd").iterdir()]:
        if number > 2 and number != answers:
            with suppress(OSError):  # the one that the folder was read through
                os.close(number)
    return answers


def _set_limits(limits: Limits) -> None:
    used = _memory_used()
    if used is not None:
        data, resident = used
        most = limits.memory_mb * MEGABYTE
        _limit("RLIMIT_DATA", data + max(most - resident, most // 2))
    _limit(
        "RLIMIT_CPU", math.ceil(limits.seconds), 1
    )  # a second later the kernel kills what ignores the signal
    _limit("RLIMIT_NOFILE", limits.open_files)
    _limit("RLIMIT_FSIZE", 0)
    _limit("RLIMIT_CORE", 0)


def _limit(name: str, value: int, beyond: int = 0) -> None:
    """Sets a limit, and the hard one by so much `beyond`; a lower one that is set already stays."""
    number = getattr(_resource, name)
    _, hard = _resource.getrlimit(number)
    most = value + beyond if hard == _resource.RLIM_INFINITY else min(value + beyond, hard)
    _resource.setrlimit(number, (min(value, most), most))


def _memory_used() -> tuple[int, int] | None:
    """Returns the bytes of private data and the resident bytes of this process; None where it is unknown."""
    try:
        pages = [int(number) for number in Path("/proc/self/statm").read_text().split()]
    except OSError:
        return None
    return pages[5] * os.sysconf("SC_PAGE_SIZE"), pages[1] * os.sysconf("SC_PAGE_SIZE")
