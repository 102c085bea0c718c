"""Work done in a separate process, with limits on its time, memory, open files and result size.

In: functions without arguments and their `WorkLimits`. Out: what each function returns or raises;
`LimitExceeded` if it was stopped, `ProcessDied` if its process ended without an answer.

    this process ──fork──▶ child: sets its limits, reads nothing, prints nothing, does the work
         ▲                                                  │
         └── pipe: (returned | raised) ◀────────────────────┘      at the deadline: SIGKILL

The child is a copy of this process and imports nothing again, so starting it takes only milliseconds. Its
standard streams are /dev/null, and it cannot write files.
"""

from __future__ import annotations

import gc
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
from threading import Event
from typing import Any, TypeVar

from servogen.errors import ServogenError

if os.name == "posix":
    import fcntl

T = TypeVar("T")

MEGABYTE = 1_000_000


@dataclass(frozen=True, slots=True)
class WorkLimits:
    """The limits of one piece of work: processor time, elapsed time, memory, size of the result.

    The limit on elapsed time, by default equal to that on processor time, stops work that only waits.
    `memory_mb` includes what the process already holds when the work begins; work that begins in a large
    process, such as a notebook, still gets at least half of it.
    """

    seconds: float = 10.0
    memory_mb: int = 300
    result_mb: int = 16
    open_files: int = 32
    elapsed_s: float | None = None

    @classmethod
    def patient(cls, seconds: float, memory_mb: int) -> WorkLimits:
        """Return limits with which nothing depends on the load of the machine: work may wait, too."""
        return cls(seconds, memory_mb, elapsed_s=PATIENCE * seconds)

    @property
    def deadline_s(self) -> float:
        return self.seconds if self.elapsed_s is None else self.elapsed_s


STOP_S = 0.05
"""The interval between two looks at whether work is still wanted."""
PATIENCE = 4
"""The elapsed time of patient limits in multiples of their processor time."""
COMPILING = WorkLimits.patient(10.0, 300)
"""The limits for compiling or assembling one program. Programs that fit the chip use a tenth of them."""


class Resource(Enum):
    """The resource that ran out."""

    TIME = "time"
    """Processor time or elapsed time."""
    MEMORY = "memory"
    RESULT = "result"


class LimitExceeded(Exception):
    """The work was stopped at a limit."""

    def __init__(self, resource: Resource, limits: WorkLimits) -> None:
        super().__init__(resource, limits)
        self.resource = resource
        self.limits = limits

    def __str__(self) -> str:
        """Return the rest of a sentence that begins with "compiling it" or "running it"."""
        if self.resource is Resource.TIME:
            if self.limits.deadline_s == self.limits.seconds:
                return f"took more than {self.limits.seconds:g} s"
            return (
                f"took more than {self.limits.seconds:g} s of processor time or {self.limits.deadline_s:g} s"
            )
        if self.resource is Resource.MEMORY:
            return f"needed more than {self.limits.memory_mb} MB of memory"
        return f"gave more than {self.limits.result_mb} MB of results and messages"


class Stopped(Exception):
    """The work was stopped because its result is no longer wanted."""


class ProcessDied(Exception):
    """The process ended without an answer; the text says whether it was killed or crashed."""


def missing_limits() -> str:
    """Return a sentence about the limits that this system cannot enforce; empty if it enforces all."""
    if not can_fork():
        return (
            f"{sys.platform} cannot limit the memory and the open files of a process: "
            "programs are read with neither limit"
        )
    if not sys.platform.startswith("linux"):
        return f"{sys.platform} does not limit the memory of a process: programs are read without that limit"
    return ""


def run(work: Callable[[], T], limits: WorkLimits, stop: Event | None = None) -> T:
    """Do `work` in a separate process; return what it returns, or raise what it raises.

    Raises Stopped soon after another thread has set `stop`. On systems that cannot fork, `work` is done in
    this process without limits: see `missing_limits`.
    """
    ((_, result),) = run_each([work], limits, stop=stop)
    if isinstance(result, Exception):
        raise result
    return result


def run_each(
    works: Sequence[Callable[[], T]], limits: WorkLimits, at_once: int = 1, stop: Event | None = None
) -> Iterator[tuple[int, T | Exception]]:
    """Do `works`, up to `at_once` at a time, and yield (index, returned or raised) as each one ends.

    Raises Stopped soon after `stop` is set. Each runs in a separate process. All of them have ended when the
    iteration ends, for whatever reason.
    """
    if not can_fork():
        yield from each_here(works)
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
                if stop is not None and stop.is_set():
                    raise Stopped
                left = max(0.0, min(child.deadline for child in running) - time.monotonic())
                for key, _ in selector.select(left if stop is None else min(left, STOP_S)):
                    key.data.receive()
                for child in running:
                    if child.done or time.monotonic() >= child.deadline:
                        selector.unregister(child.pipe)
                        yield child.index, child.result()
        finally:
            for key in selector.get_map().values():
                key.data.kill()


def can_fork() -> bool:
    """Return whether this system can do work in a separate process."""
    return hasattr(os, "fork") and unix_limits is not None


def each_here(works: Sequence[Callable[[], T]]) -> Iterator[tuple[int, T | Exception]]:
    """Do `works` in this process, without limits; yield what `run_each` does."""
    return ((index, _in_this_process(work)) for index, work in enumerate(works))


def _in_this_process(work: Callable[[], T]) -> T | Exception:
    try:
        return work()
    except Exception as error:
        return error


try:
    import resource as unix_limits
except ImportError:  # Windows
    unix_limits = None  # type: ignore[assignment]

_LENGTH = struct.Struct("<Q")
_OUT_OF_MEMORY = b"memory"
"""Sent in place of a pickled answer if too little memory may be left to pickle one."""


@dataclass(eq=False, slots=True)
class _Child:
    """A child process, as seen from its parent."""

    index: int
    process: int
    pipe: int
    limits: WorkLimits
    deadline: float
    received: bytearray = field(default_factory=bytearray)
    done: bool = False
    """Whether the child has closed its pipe or sent too much."""

    def receive(self) -> None:
        part = os.read(self.pipe, 1 << 20)
        self.received += part
        self.done = not part or len(self.received) > self.limits.result_mb * MEGABYTE

    def result(self) -> Any:
        """Return what the work returned, or the exception that it raised, once the process has ended."""
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
        """Kill the process and all processes that it has started."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process, signal.SIGKILL)
        self._wait()

    def _wait(self) -> tuple[int, float]:
        """Return the exit status of the process and its processor time in seconds."""
        os.close(self.pipe)
        try:
            _, status, used = os.wait4(self.process, 0)
        except ChildProcessError:  # another part of the program has waited for it
            return 0, 0.0
        return status, used.ru_utime + used.ru_stime


def _start(index: int, work: Callable[[], object], limits: WorkLimits) -> _Child:
    reading, writing = os.pipe()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # closed, or none
            stream.flush()
    process = os.fork()
    if process == 0:
        _be_child(work, limits, writing)
    with suppress(OSError):  # the child does this too: whichever comes first
        os.setpgid(process, process)
    os.close(writing)
    return _Child(
        index=index,
        process=process,
        pipe=reading,
        limits=limits,
        deadline=time.monotonic() + limits.deadline_s,
    )


def _be_child(work: Callable[[], object], limits: WorkLimits, writing: int) -> None:
    """Do the work, send the answer and end the process; never return."""
    code = 1
    try:
        writing = _shut_off(writing)
        answer = _OUT_OF_MEMORY
        _set_limits(limits)
        # What the parent holds is not this process's to collect: looking through it takes time and memory.
        gc.freeze()
        # Once memory has run out, there is none left to build an answer; this one is ready.
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
            if not isinstance(error, ServogenError):  # a defect: add where it happened
                error.add_note("".join(traceback.format_exception(error)))
            pickled = pickle.dumps(error)
            pickle.loads(pickled)  # not every exception can be unpickled
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
    """Close all inherited files except the pipe `writing`; return the pipe's new descriptor."""
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
    answers = fcntl.fcntl(writing, fcntl.F_DUPFD, 3)  # 0 to 2 if the parent has no standard streams
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    for number in [int(entry.name) for entry in Path("/dev/fd").iterdir()]:
        if number > 2 and number != answers:
            with suppress(OSError):  # the descriptor used for reading the folder itself
                os.close(number)
    return answers


def _set_limits(limits: WorkLimits) -> None:
    used = _memory_used()
    if used is not None:
        data, resident = used
        most = limits.memory_mb * MEGABYTE
        _limit("RLIMIT_DATA", data + max(most - resident, most // 2))
    _limit(
        "RLIMIT_CPU", math.ceil(limits.seconds), 1
    )  # a process that ignores the signal is killed by the kernel a second later
    _limit("RLIMIT_NOFILE", limits.open_files)
    _limit("RLIMIT_FSIZE", 0)
    _limit("RLIMIT_CORE", 0)


def _limit(name: str, value: int, beyond: int = 0) -> None:
    """Set a limit, and the hard limit to `beyond` more; limits that are already lower stay."""
    number = getattr(unix_limits, name)
    _, hard = unix_limits.getrlimit(number)
    most = value + beyond if hard == unix_limits.RLIM_INFINITY else min(value + beyond, hard)
    unix_limits.setrlimit(number, (min(value, most), most))


def _memory_used() -> tuple[int, int] | None:
    """Return the private and the resident bytes of this process; None if they are not known."""
    try:
        pages = [int(number) for number in Path("/proc/self/statm").read_text().split()]
    except OSError:
        return None
    return pages[5] * os.sysconf("SC_PAGE_SIZE"), pages[1] * os.sysconf("SC_PAGE_SIZE")
