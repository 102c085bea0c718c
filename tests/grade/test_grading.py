"""Many programs at a time: what is wrong with one never stops the others, on this machine or on a cluster."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from servogen import isolation
from servogen.errors import InputError, ToolError
from servogen.grade import Submission, load_lab
from servogen.isolation import WorkLimits
from servogen.programs import Program, read_submission
from servogen.workflows import grading
from servogen.workflows.grading import Graded, GradingTask, grade_in_fresh_process, grade_submissions
from tests.bench.conftest import Run, run  # noqa: F401 - a fixture

PROGRAMS = Path(__file__).parent / "programs"
RIGHT = PROGRAMS / "lab8-right" / "delays.c"
WRONG = PROGRAMS / "lab8-wrong" / "order.c"

BOMB = "\n".join(
    (
        "#include <xc.h>",
        *(f"#define A{n} A{n + 1} A{n + 1} A{n + 1} A{n + 1}" for n in range(30)),
        "void main(void) { A0 }",
    )
)
"""A preprocessor that does as it is asked never ends."""


def spin() -> None:
    while True:
        pass


def hoard() -> None:
    kept = []
    while True:
        kept.append(bytearray(1_000_000))


def recurse() -> None:
    recurse()


def stutter() -> None:
    raise InputError("wrong", "x" * 100_000 + "\n" + "y\n" * 1_000_000)


def fail() -> None:
    raise RuntimeError("a defect")


def need_a_tool() -> None:
    raise ToolError("tool-missing", "a tool is missing")


def flood() -> None:
    while True:
        os.write(1, b"x" * 4096)


EVIL: dict[str, tuple[Callable[[], object], str, bool]] = {
    "spin.c": (spin, "compiling it took more than 1 s of processor time", False),
    "flood.c": (flood, "compiling it took more than 1 s of processor time", False),
    "stdin.c": (lambda: os.read(0, 1) or os._exit(6), "exit code 6", True),
    "hoard.c": (hoard, "compiling it needed more than 200 MB of memory", False),
    "segfault.c": (lambda: os.kill(os.getpid(), signal.SIGSEGV), "signal 11", True),
    "killed.c": (lambda: os.kill(os.getpid(), signal.SIGKILL), "signal 9", True),
    "exit.c": (lambda: os._exit(7), "exit code 7", True),
    "recurse.c": (recurse, "RecursionError", True),
    "fail.c": (fail, "RuntimeError: a defect", True),
    "tool.c": (need_a_tool, "servogen: error: a tool is missing [tool-missing]", True),
    "stutter.c": (stutter, "the program cannot be run:\nservogen: error: xxx", False),
}
"""What reading a file of this name does; the reason that its page gives; whether that is servogen's fault."""


def read(submission: Submission) -> Program:
    """As servogen reads, but for files that a compiler would hang on, fail on or crash on."""
    if submission.file.name in EVIL:
        EVIL[submission.file.name][0]()
    return read_submission(submission)


def task(read: grading.Read = read) -> GradingTask:
    return GradingTask(load_lab("lab8-exercise"), read, WorkLimits(seconds=1, memory_mb=200, elapsed_s=60))


def submissions(folder: Path, names: Sequence[str]) -> list[Submission]:
    """`right…` and `wrong…` are such programs; others are evil ones, which are never looked into."""
    for name in names:
        source = RIGHT if name.startswith("right") else WRONG
        (folder / name).write_text(source.read_text())
    return [Submission(name, folder / name, folder) for name in names]


def passed(graded: Sequence[Graded]) -> list[str]:
    return [each.submission.name for each in graded if each.grade.passed]


def require_evil_is_named(graded: Sequence[Graded]) -> None:
    for each in graded:
        if each.submission.name in EVIL:
            _, reason, defect = EVIL[each.submission.name]
            assert reason in each.grade.reasons[0]
            assert bool(each.defect) is defect, each


def test_no_program_costs_another_its_grade(tmp_path: Path) -> None:
    names = ["right1.c", *EVIL, "wrong.c", "right2.c"]
    graded = grade_submissions(submissions(tmp_path, names), task(), at_once=3)
    assert [each.submission.name for each in graded] == names
    assert passed(graded) == ["right1.c", "right2.c"]
    require_evil_is_named(graded)
    assert "the order is" in graded[-2].grade.reasons[0]


def test_a_message_is_cut_to_a_page(tmp_path: Path) -> None:
    (graded,) = grade_submissions(submissions(tmp_path, ["stutter.c"]), task())
    (reason,) = graded.grade.reasons
    assert len(reason) < 60 * 510
    assert reason.endswith("more lines")


def test_running_a_program_has_a_limit_of_its_own(tmp_path: Path) -> None:
    short = GradingTask(load_lab("lab8-exercise"), read, WorkLimits(), WorkLimits(seconds=0.001))
    (graded,) = grade_submissions(submissions(tmp_path, ["right.c"]), short)
    assert graded.grade.reasons == ("running it for 100 s of the chip's time took more than 0.001 s",)
    assert not graded.defect


def test_progress_counts_every_program(tmp_path: Path) -> None:
    seen: list[int] = []
    names = ["right.c", "fail.c", "wrong.c"]
    grade_submissions(submissions(tmp_path, names), task(), progress=seen.append)
    assert seen == [1, 2, 3]


def test_the_command_goes_on_and_says_it(
    run: Run,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(grading, "COMPILING", WorkLimits(seconds=1))
    (tmp_path / "bomb.c").write_text(BOMB)
    (tmp_path / "right.c").write_text(RIGHT.read_text())
    done = run("grade", "lab8-exercise", tmp_path)
    assert done.code == 1
    assert "bomb.c    NOT PASSED" in done.out
    assert "1 of 2 passed" in done.out


@pytest.mark.campaign
def test_a_system_without_limits_is_said_to_be_one(
    run: Run,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As on Windows: each program in a fresh process, which can be killed, but no limit of memory."""
    (tmp_path / "right.c").write_text(RIGHT.read_text())
    monkeypatch.setattr(isolation, "unix_limits", None)
    done = run("grade", "lab8-exercise", tmp_path)
    assert (done.code, "1 of 1 passed" in done.out) == (0, True)
    assert "cannot limit the memory and the open files of a process" in done.err


# A process of their own, as on a cluster and on systems without fork.


@pytest.mark.campaign
def test_a_fresh_process_keeps_the_limits(tmp_path: Path) -> None:
    names = ["hoard.c", "right.c", "spin.c", "segfault.c"]
    graded = grade_in_fresh_process(submissions(tmp_path, names), task())
    assert passed(graded) == ["right.c"]
    require_evil_is_named(graded)


def kill_the_parent(submission: Submission) -> Program:
    if submission.file.name == "patricide.c":
        os.kill(os.getppid(), signal.SIGKILL)
        spin()
    return read_submission(submission)


@pytest.mark.campaign
def test_a_fresh_process_that_is_killed_costs_no_other_its_grade(tmp_path: Path) -> None:
    graded = grade_in_fresh_process(submissions(tmp_path, ["patricide.c", "right.c"]), task(kill_the_parent))
    assert passed(graded) == ["right.c"]
    assert "its process ended with exit code -9" in graded[0].defect


def test_a_fresh_process_that_hangs_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grading, "STARTING_S", 0.0)
    hasty = GradingTask(load_lab("lab8-exercise"), read, WorkLimits(seconds=0.05), WorkLimits(seconds=0.05))
    (graded,) = grade_in_fresh_process(submissions(tmp_path, ["spin.c"]), hasty)
    assert graded.grade.reasons == ("compiling and running it took more than 0.1 s",)


# A cluster.


@contextmanager
def cluster(workers: int = 1) -> Iterator[str]:
    """The address of a scheduler with workers of two threads, in this process."""
    import distributed

    with distributed.LocalCluster(
        n_workers=workers, threads_per_worker=2, processes=False, dashboard_address=None
    ) as found:
        yield found.scheduler_address


@pytest.mark.campaign
def test_on_a_cluster_no_program_costs_another_its_grade(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grading, "BATCH", 3)
    names = ["right1.c", "spin.c", "segfault.c", "wrong.c", "right2.c"]
    with cluster() as scheduler:
        graded = grade_submissions(submissions(tmp_path, names), task(), scheduler)
    assert [each.submission.name for each in graded] == names
    assert passed(graded) == ["right1.c", "right2.c"]
    require_evil_is_named(graded)


def test_a_cluster_without_workers_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import distributed

    waits = distributed.Client.wait_for_workers
    monkeypatch.setattr(
        distributed.Client, "wait_for_workers", lambda client, count, timeout: waits(client, count, 0.1)
    )
    with cluster(workers=0) as scheduler, pytest.raises(ToolError, match="has no worker"):
        grade_submissions(submissions(tmp_path, ["right.c"]), task(), scheduler)


def test_no_cluster_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grading, "CONNECT_S", 0.5)
    with pytest.raises(ToolError, match="there is no Dask scheduler at tcp:"):
        grade_submissions(submissions(tmp_path, ["right.c"]), task(), "tcp://127.0.0.1:9")


@pytest.mark.campaign
def test_a_cluster_that_loses_its_workers_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The program that it never came to has no grade, but a reason; that is not the student's fault."""
    import distributed

    monkeypatch.setattr(grading, "WITHOUT_WORKERS_S", 0.0)
    monkeypatch.setattr(grading, "has_worker", lambda client: False)
    monkeypatch.setattr(grading, "POLL_S", 0.01)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as found:
        (graded,) = grade_submissions(submissions(tmp_path, ["spin.c"]), task(), found.scheduler_address)
    assert "the cluster no longer has a worker" in graded.defect
