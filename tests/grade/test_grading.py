"""Many programs at a time: what is wrong with one never stops the others, on this machine or on a cluster."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from servogen.cli.files import Program, read_program
from servogen.pipeline.grading import Graded, grade_files
from servogen.pipeline.time_limit import TookTooLong, within
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
"""A preprocessor that does as it is told never ends."""


def read(file: Path) -> Program:
    """As servogen reads, but for files that a compiler would hang on, fail on or crash on."""
    if file.name == "hangs.c":
        while True:
            time.sleep(0.001)
    if file.name == "fails.c":
        raise RuntimeError("a defect")
    if file.name == "crashes.c":
        os._exit(7)
    return read_program(file)


def graded(names: list[Path], **options: object) -> list[Graded]:
    return grade_files(names, "lab8-exercise", read, **options)  # type: ignore[arg-type]


def test_a_compiler_that_hangs_is_stopped_and_the_others_are_graded() -> None:
    files = [Path("hangs.c"), RIGHT, Path("hangs.c"), WRONG]
    found = graded(files, limit_s=3)
    assert [each.grade.passed for each in found] == [False, True, False, False]
    for hanging in (found[0], found[2]):
        assert hanging.grade.reasons[0].startswith(
            "it took too long: compiling it, and running it for 100 s of"
        )
        assert not hanging.defect
    assert "the order is" in found[3].grade.reasons[0]


def test_a_single_file_is_stopped_too() -> None:
    (found,) = graded([Path("hangs.c")], limit_s=0.2)
    assert "it took too long" in found.grade.reasons[0]


def test_a_simulation_that_takes_too_long_is_stopped() -> None:
    (found,) = graded([RIGHT], limit_s=0.001)
    assert "it took too long" in found.grade.reasons[0]


def test_a_defect_of_servogen_is_told_as_such_and_stops_no_other() -> None:
    found = graded([Path("fails.c"), RIGHT])
    assert (found[0].defect, found[1].grade.passed) == ("RuntimeError: a defect", True)


def test_a_worker_that_ends_takes_no_other_program_with_it() -> None:
    found = graded([RIGHT, Path("crashes.c"), WRONG, RIGHT])
    assert [each.grade.passed for each in found] == [True, False, False, True]
    assert "its worker ended" in found[1].defect
    assert [bool(each.defect) for each in found] == [False, True, False, False]


def test_the_command_says_it_in_the_table_and_goes_on(run: Run, tmp_path: Path) -> None:  # noqa: F811
    (tmp_path / "bomb.c").write_text(BOMB)
    (tmp_path / "right.c").write_text(RIGHT.read_text())
    done = run("grade", "lab8-exercise", tmp_path, "--timeout", 3)
    assert done.code == 1
    assert "it took too long" in done.out
    assert "1 of 2 passed" in done.out


def test_time_that_is_left_over_raises_nothing_later() -> None:
    assert [within(0.5, lambda: 5) for _ in range(50)] == [5] * 50
    time.sleep(0.6)
    with pytest.raises(TookTooLong):
        within(0.02, spin)


def spin() -> None:
    while True:
        pass


def test_what_swallows_the_exception_is_told_again() -> None:
    """As a destructor does, or a callback of the garbage collection."""
    swallowed = []

    def work() -> None:
        try:
            spin()
        except TookTooLong as error:
            swallowed.append(error)
        spin()

    with pytest.raises(TookTooLong):
        within(0.02, work)
    assert len(swallowed) == 1


# A cluster.


@contextmanager
def cluster() -> Iterator[str]:
    """The address of a scheduler with one worker of two threads, in this process."""
    distributed = pytest.importorskip("distributed", reason="needs Dask: pip install 'servogen[dask]'")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
    ) as found:
        yield found.scheduler_address


def test_on_a_cluster_too_a_compiler_that_hangs_is_stopped() -> None:
    with cluster() as scheduler:
        found = graded([Path("hangs.c"), RIGHT, WRONG], scheduler=scheduler, limit_s=3)
    assert [each.grade.passed for each in found] == [False, True, False]
    assert "it took too long" in found[0].grade.reasons[0]
