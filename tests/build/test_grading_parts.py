"""What becomes of a process that grades, and what a grade states of the chip and its source."""

from __future__ import annotations

import pickle
import subprocess
from concurrent.futures import CancelledError, Future
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from servogen.build import grading
from servogen.build.grading import Graded, GradingTask, grade_in_fresh_process, grade_submissions
from servogen.errors import ToolError
from servogen.grade import ChipFacts, Submission, load_lab
from servogen.isolation import COMPILING, WorkLimits
from servogen.pic.listing import Listing, ListingRow
from servogen.units import Clock

LAB = load_lab("lab8-exercise")
TASK = GradingTask(LAB, cast(Any, len), WorkLimits(seconds=2), WorkLimits(seconds=3, elapsed_s=30))
ONE, TWO = (Submission(name, Path(name), Path()) for name in ("one.c", "two.c"))


def graded(submission: Submission) -> Graded:
    return Graded(submission, cast(Any, f"grade of {submission.name}"))


def test_limits_of_a_task_are_those_asked_for_and_elapsed_time_is_four_times_as_long() -> None:
    """Compiling takes no longer than it may by default."""
    for seconds, compiling_s in ((3.0, 3.0), (600.0, COMPILING.seconds)):
        task = GradingTask.of(LAB, cast(Any, len), seconds, 250)
        for limits, own_s in ((task.compiling, compiling_s), (task.running, seconds)):
            assert (limits.seconds, limits.memory_mb, limits.elapsed_s) == (own_s, 250, 4 * own_s)


def test_grades_come_in_the_order_of_the_programs_wherever_they_are_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[object, ...]] = []
    for name in ("_in_forks", "_in_fresh_processes", "_on_cluster"):
        monkeypatch.setattr(
            grading,
            name,
            lambda given, task, where, name=name: (
                asked.append((name, where)) or iter([(1, graded(TWO)), (0, graded(ONE))])
            ),
        )
    monkeypatch.setattr("os.cpu_count", lambda: 6)
    for forks, scheduler, at_once, expected in (
        (True, None, None, ("_in_forks", 6)),
        (True, None, 2, ("_in_forks", 2)),
        (False, None, 2, ("_in_fresh_processes", 2)),
        (False, "tcp://a:1", None, ("_on_cluster", "tcp://a:1")),
    ):
        done: list[int] = []
        monkeypatch.setattr(grading, "can_fork", lambda forks=forks: forks)
        found = grade_submissions([ONE, TWO], TASK, scheduler, done.append, at_once)
        assert [each.submission for each in found] == [ONE, TWO]
        assert (asked.pop(), done) == (expected, [1, 2])


def test_a_fresh_process_is_tried_again_for_each_program_if_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may take a minute to start, and 2 s to compile and 30 s to run each program."""
    runs: list[tuple[list[str], float]] = []

    def run(command: object, *, input: bytes, capture_output: bool, timeout: float) -> Any:
        given, _ = pickle.loads(input[len(pickle.dumps(grading.sys.path)) :])
        runs.append(([each.name for each in given], timeout))
        if len(given) > 1:
            raise subprocess.TimeoutExpired("python", timeout)
        if given[0].name == "one.c":
            return SimpleNamespace(returncode=0, stdout=pickle.dumps([graded(given[0])]))
        return SimpleNamespace(returncode=3, stderr=b"Traceback\nMemoryError: no room\n")

    monkeypatch.setattr(subprocess, "run", run)
    task = GradingTask(LAB, cast(Any, len), TASK.compiling, TASK.running)
    found = grade_in_fresh_process([ONE, TWO], task)
    assert runs == [(["one.c", "two.c"], 60 + 2 * 32), (["one.c"], 92), (["two.c"], 92)]
    assert found[0] == graded(ONE)
    assert "its process ended with exit code 3: MemoryError: no room" in found[1].defect

    def late(command: object, **given: Any) -> None:
        raise subprocess.TimeoutExpired("python", 92)

    monkeypatch.setattr(subprocess, "run", late)
    (slow,) = grade_in_fresh_process([ONE], task)
    assert (slow.grade.reasons, slow.defect) == (("compiling and running it took more than 92 s",), "")


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ValueError("odd"), "its worker ended: ValueError: odd"),
        (CancelledError(), "the connection to the cluster was lost"),
        (None, "the cluster no longer has a worker"),
    ],
)
def test_a_batch_that_a_cluster_loses_is_failed_program_by_program(
    error: Exception | None, text: str
) -> None:
    future: Future[list[Graded]] = Future()
    if isinstance(error, CancelledError):
        future.cancel()
    elif error is not None:
        future.set_exception(error)
    found = grading._results(future, [ONE, TWO], TASK)
    assert [each.submission for each in found] == [ONE, TWO]
    assert all(text in each.defect and not each.grade.passed for each in found)
    done: Future[list[Graded]] = Future()
    done.set_result([graded(ONE)])
    assert grading._results(done, [ONE], TASK) == [graded(ONE)]


def test_a_cluster_has_a_worker_or_is_gone() -> None:
    def lost() -> None:
        raise OSError

    for info, found in (
        (lambda: {"workers": {"a": 1}}, True),
        (lambda: {"workers": {}}, False),
        (lost, False),
    ):
        assert grading._has_worker(SimpleNamespace(scheduler_info=info)) is found


def test_dask_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError

    monkeypatch.setattr(grading, "import_module", missing)
    with pytest.raises(ToolError, match="needs Dask") as error, grading._client("tcp://a:1"):
        pass
    assert error.value.code == "tool-missing"


def test_the_source_of_a_routine_of_the_compiler_is_that_around_its_call() -> None:
    """Line 3 is at address 0, a routine at 5, whose call at address 1 returns to 2."""
    rows = (
        ListingRow(0, 0, "NOP", "1", "/home/a/main.c", 3),
        ListingRow(1, 0, "CALL 5", "2", "/home/a/main.c", 4),
        ListingRow(5, 0, "RETURN", "2"),
        ListingRow(6, 0, "NOP", "1", "lost.c", 1),
        ListingRow(7, 0, "NOP", "1", "/home/a/main.c", None),
    )
    listing = Listing(rows, sources=(("/home/a/main.c", "a\nb\nc\nd\n"),))
    for pc, returns, line in (
        (0, (), 3),
        (1024, (), 3),
        (5, (2,), 4),
        (5, (6, 2), 4),
        (6, (1,), 3),
        (7, (2,), 4),
    ):
        found = grading._source(listing, pc, returns)
        assert found is not None
        assert (found.file, found.line) == ("main.c", line)
    assert grading._source(listing, 5, ()) is None
    assert grading._source(None, 0, (1,)) is None


@pytest.mark.parametrize(("clock", "hz"), [(None, None), (Clock(8_000_000), 8_000_000)])
def test_facts_of_the_chip_at_the_end_of_the_watch(clock: Clock | None, hz: int | None) -> None:
    """TRISA = 0x11: RA0 and RA4 are inputs; TRISB = 0x82: RB1 and RB7."""
    state: Any = SimpleNamespace(
        registers={"TRISA": 0x11, "TRISB": 0x82},
        resets={"watchdog": 3},
        sleeping=True,
        warnings=[SimpleNamespace(code="other"), SimpleNamespace(code="erased-word")],
        stack_wraps=2,
    )
    program: Any = SimpleNamespace(image=SimpleNamespace(config=None), clock=clock)
    expected = ChipFacts(frozenset((0, 4, 6, 12)), 3, False, True, True, 2, hz)
    assert grading._facts(state, program) == expected
    state.warnings.pop()
    program.image.config = 0x3FF1
    facts = grading._facts(state, program)
    assert (facts.lost, facts.configured) == (False, True)
