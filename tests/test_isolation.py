"""Work in a process of its own ends at its limits, whatever it does, and leaves this process as it was."""

import mmap
import os
import pickle
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Event, Timer

import pytest

from servogen import isolation
from servogen.errors import InputError, Location
from servogen.isolation import LimitExceeded, ProcessDied, Resource, Stopped, WorkLimits, run, run_each

SHORT = WorkLimits(seconds=0.5)


def spin() -> None:
    while True:
        pass


def swallow() -> None:
    """Goes on whatever is raised in it, as a bare `except` in a library does."""
    while True:
        with suppress(BaseException):
            spin()


def deaf() -> None:
    """Ignores what can be ignored."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGALRM, signal.SIGXCPU):
        signal.signal(number, signal.SIG_IGN)
    spin()


def hoard() -> None:
    """Takes memory in small pieces, 56 bytes and more each."""
    kept = []
    while True:
        kept.append([len(kept)])


def test_a_result_comes_back() -> None:
    assert run(lambda: {"answer": 42}, WorkLimits()) == {"answer": 42}


def test_an_error_comes_back_with_its_place_and_hint() -> None:
    def work() -> None:
        raise InputError("wrong", "is wrong", Location("a.c", 3, 4), "mend it")

    with pytest.raises(InputError) as caught:
        run(work, WorkLimits())
    assert str(caught.value) == "a.c:3:4: error: is wrong [wrong]\n  mend it"


@pytest.mark.parametrize("work", [spin, swallow, deaf, lambda: time.sleep(100)])
def test_work_that_never_ends_is_stopped(work: Callable[[], None]) -> None:
    with pytest.raises(LimitExceeded, match=r"took more than 0\.5 s") as caught:
        run(work, SHORT)
    assert caught.value.resource is Resource.TIME


def sleep_then_answer() -> int:
    time.sleep(1.5)
    return 5


def test_processor_time_and_elapsed_time_are_two_limits() -> None:
    assert run(sleep_then_answer, WorkLimits(seconds=1, elapsed_s=60)) == 5
    with pytest.raises(LimitExceeded, match="took more than 1 s of processor time or 600 s") as caught:
        run(deaf, WorkLimits(seconds=1, elapsed_s=600))
    assert caught.value.resource is Resource.TIME


@pytest.mark.parametrize("work", [hoard, lambda: bytearray(400_000_000)])
def test_work_that_takes_all_memory_is_stopped(work: Callable[[], object]) -> None:
    with pytest.raises(LimitExceeded, match="needed more than 150 MB of memory") as caught:
        run(work, WorkLimits(seconds=60, memory_mb=150, elapsed_s=600))
    assert caught.value.resource is Resource.MEMORY


def test_the_memory_of_the_process_stays_below_the_limit() -> None:
    """The kernel's own count of the pages that the child ever held, in KiB."""

    def work() -> int:
        import resource

        kept = []
        try:
            while True:
                kept.append(b"x" * 1_000_000)
        except MemoryError:
            kept.clear()
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    allowed = max(200_000_000, before + 100_000_000)
    slack = 20_000_000 + before // 20  # pages that the child shares with a large parent are counted unevenly
    assert 100_000_000 < run(work, WorkLimits(memory_mb=200)) * 1024 < allowed + slack


def test_work_that_fits_in_its_memory_is_done() -> None:
    assert run(lambda: len(bytearray(100_000_000)), WorkLimits(memory_mb=300)) == 100_000_000


def test_a_result_that_is_too_large_is_refused() -> None:
    with pytest.raises(LimitExceeded, match="gave more than 1 MB of results") as caught:
        run(lambda: b"x" * 2_000_000, WorkLimits(result_mb=1))
    assert caught.value.resource is Resource.RESULT


@pytest.mark.parametrize(
    ("number", "words"),
    [(signal.SIGSEGV, "signal 11"), (signal.SIGKILL, "signal 9"), (signal.SIGABRT, "signal 6")],
)
def test_a_crash_is_said_with_its_signal(number: int, words: str) -> None:
    with pytest.raises(ProcessDied, match=words):
        run(lambda: os.kill(os.getpid(), number), WorkLimits())


def test_an_end_without_an_answer_is_said_with_its_exit_code() -> None:
    with pytest.raises(ProcessDied, match="exit code 3"):
        run(lambda: os._exit(3), WorkLimits())


def test_it_has_no_standard_input_and_its_output_goes_nowhere(capfd: pytest.CaptureFixture[str]) -> None:
    def work() -> bytes:
        os.write(1, b"out")
        os.write(2, b"err")
        return os.read(0, 100)

    assert run(work, WorkLimits()) == b""
    assert capfd.readouterr() == ("", "")


def test_it_has_none_of_this_process_open_files(tmp_path: Path) -> None:
    with (tmp_path / "secret").open("w+") as secret:
        number = secret.fileno()
        with pytest.raises(OSError, match="Bad file descriptor"):
            run(lambda: os.read(number, 1), WorkLimits())


def test_it_can_open_few_files_and_write_none(tmp_path: Path) -> None:
    def flood() -> None:
        for _ in range(100):
            os.open(os.devnull, os.O_RDONLY)

    with pytest.raises(OSError, match="Too many open files"):
        run(flood, WorkLimits(open_files=32))
    with pytest.raises(OSError, match="File too large"):
        run(lambda: (tmp_path / "file").write_bytes(b"x"), WorkLimits())


def test_what_it_starts_ends_with_it(tmp_path: Path) -> None:
    """The child of the child tells its process id through a named pipe before both hang."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reading = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)

    def work() -> None:
        if os.fork() == 0:
            os.write(os.open(pipe, os.O_WRONLY), str(os.getpid()).encode())
        spin()

    with pytest.raises(LimitExceeded):
        run(work, WorkLimits(seconds=1, elapsed_s=60))
    grandchild = int(os.read(reading, 100))
    os.close(reading)
    state = Path(f"/proc/{grandchild}/stat")
    while state.exists() and state.read_text().split()[2] not in "ZX":  # killed: its entry goes in a moment
        time.sleep(0.01)


def test_one_that_crashes_costs_no_other_its_result() -> None:
    works: list[Callable[[], object]] = [
        lambda: 1,
        lambda: os.kill(os.getpid(), signal.SIGSEGV),
        lambda: bytearray(400_000_000),
        spin,
        lambda: 5,
        lambda: b"x" * 20_000_000,
        lambda: 7,
    ]
    found = dict(run_each(works, WorkLimits(seconds=1, memory_mb=100, elapsed_s=90), at_once=2))
    assert [found[index] for index in (0, 4, 6)] == [1, 5, 7]
    assert isinstance(found[1], ProcessDied)
    stopped = [found[2], found[3], found[5]]
    assert [each.resource for each in stopped if isinstance(each, LimitExceeded)] == [
        Resource.MEMORY,
        Resource.TIME,
        Resource.RESULT,
    ]


def test_all_end_when_nobody_wants_more_results() -> None:
    children = Path(f"/proc/self/task/{os.getpid()}/children")
    before = set(children.read_text().split())  # those of other tests in this process
    results = run_each([lambda: 1, spin, spin], WorkLimits(seconds=600), at_once=3)
    assert next(results) == (0, 1)
    assert len(set(children.read_text().split()) - before) == 2
    results.close()
    assert set(children.read_text().split()) <= before


def test_an_exception_that_cannot_be_sent_is_said_in_words() -> None:
    class Odd(Exception):
        def __init__(self, one: int, two: int) -> None:
            super().__init__(f"{one} and {two}")

    def work() -> None:
        raise Odd(1, 2)

    with pytest.raises(RuntimeError, match="Odd: 1 and 2"):
        run(work, WorkLimits())


def test_a_system_without_these_limits_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isolation.missing_limits() == ""
    monkeypatch.setattr(isolation.sys, "platform", "darwin")
    assert "darwin does not limit the memory" in isolation.missing_limits()
    monkeypatch.setattr(isolation.sys, "platform", "win32")
    monkeypatch.setattr(isolation, "unix_limits", None)
    assert "win32 cannot limit the memory and the open files" in isolation.missing_limits()
    assert run(os.getpid, WorkLimits()) == os.getpid()


def test_as_many_as_allowed_run_at_once_and_no_more() -> None:
    def alone() -> tuple[float, float]:
        begin = time.monotonic()
        time.sleep(0.02)
        return begin, time.monotonic()

    spans = sorted(span for _, span in run_each([alone] * 3, WorkLimits()) if isinstance(span, tuple))
    assert len(spans) == 3
    assert all(end < begin for (_, end), (begin, _) in pairwise(spans))

    here = mmap.mmap(-1, 3)  # shared with the processes

    def together(number: int) -> bool:
        here[number] = 1
        while here[:] != b"\1\1\1":
            time.sleep(0.001)
        return True

    works = [partial(together, number) for number in range(3)]
    assert dict(run_each(works, WorkLimits(), at_once=3)) == {0: True, 1: True, 2: True}
    assert list(run_each([], WorkLimits())) == []


def test_a_result_as_large_as_allowed_comes_back() -> None:
    """A million bytes are the eight of the length, the result and what pickling adds to it."""
    overhead = 8 + len(pickle.dumps(bytes(999_000))) - 999_000
    assert run(lambda: bytes(1_000_000 - overhead), WorkLimits(result_mb=1)) == bytes(1_000_000 - overhead)
    with pytest.raises(LimitExceeded, match="gave more than 1 MB of results and messages"):
        run(lambda: bytes(1_000_001 - overhead), WorkLimits(result_mb=1))


def test_a_defect_comes_back_with_where_it_happened_and_an_error_of_ones_own_without() -> None:
    def defect() -> None:
        raise KeyError("lost")

    with pytest.raises(KeyError) as caught:
        run(defect, WorkLimits())
    (note,) = caught.value.__notes__
    assert note.startswith("Traceback") and "in defect" in note and 'raise KeyError("lost")' in note

    def mistake() -> None:
        raise InputError("wrong", "is wrong")

    with pytest.raises(InputError) as own:
        run(mistake, WorkLimits())
    assert not hasattr(own.value, "__notes__")


def test_the_limits_of_a_process_are_those_that_the_kernel_holds() -> None:
    """Processor time ends softly at the limit and hard a second later; it writes neither files nor cores."""

    def work() -> list[tuple[int, int]]:
        import resource

        kinds = (resource.RLIMIT_CPU, resource.RLIMIT_NOFILE, resource.RLIMIT_FSIZE, resource.RLIMIT_CORE)
        return [resource.getrlimit(kind) for kind in kinds]

    found = run(work, WorkLimits(seconds=6.2, open_files=20))
    assert found == [(7, 8), (20, 20), (0, 0), (0, 0)]

    def lower() -> list[tuple[int, int]]:
        import resource

        resource.setrlimit(resource.RLIMIT_NOFILE, (15, 18))
        return run(work, WorkLimits(seconds=6.2, open_files=20))

    assert run(lower, WorkLimits())[1] == (18, 18)


def test_signals_are_those_of_a_new_process() -> None:
    """A handler of the parent, or one that ignores, does not reach the work."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM, signal.SIGXCPU)
    before = {number: signal.signal(number, signal.SIG_IGN) for number in numbers}
    try:
        seen = run(lambda: [signal.getsignal(number) for number in numbers], WorkLimits())
        group = run(lambda: (os.getpid(), os.getpgid(0)), WorkLimits())
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert seen == [signal.SIG_DFL] * len(numbers)
    assert group[0] == group[1] != os.getpid()


def test_a_system_that_cannot_fork_does_the_work_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        raise InputError("wrong", "is wrong")

    monkeypatch.setattr(isolation, "unix_limits", None)
    assert not isolation.can_fork()
    works: list[Callable[[], object]] = [os.getpid, fails, lambda: 3]
    (zero, own), (one, error), (two, three) = run_each(works, WorkLimits())
    assert (zero, one, two) == (0, 1, 2)
    assert (own, three) == (os.getpid(), 3)
    assert isinstance(error, InputError)


def test_what_ran_out_is_said_with_both_times_if_they_differ() -> None:
    for limits, text in (
        (WorkLimits(), "took more than 10 s"),
        (WorkLimits(2.5, elapsed_s=2.5), "took more than 2.5 s"),
        (WorkLimits(2.5, elapsed_s=60), "took more than 2.5 s of processor time or 60 s"),
    ):
        assert str(LimitExceeded(Resource.TIME, limits)) == text
    assert str(LimitExceeded(Resource.MEMORY, WorkLimits())) == "needed more than 300 MB of memory"
    assert str(LimitExceeded(Resource.RESULT, WorkLimits())) == "gave more than 16 MB of results and messages"


def test_work_that_is_no_longer_wanted_ends() -> None:
    stop = Event()
    Timer(0.2, stop.set).start()
    with pytest.raises(Stopped):  # not LimitExceeded, which it would be after a minute
        run(spin, WorkLimits(seconds=60), stop)
    assert run(lambda: 1, WorkLimits(), Event()) == 1
