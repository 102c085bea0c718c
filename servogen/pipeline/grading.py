"""Programs held against a lab's task: each is run on the simulator and judged; many at a time, in parallel.

In: files and a lab. Out: a `Graded` for each, in their order; what is wrong with one never stops the others.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Protocol

from servogen.edges import PINS, EdgeTrace
from servogen.errors import InputError, ServogenError, ToolError
from servogen.grade import ChipFacts, Grade, Lab, judge, load_lab, refused
from servogen.grade.watch import watch
from servogen.pic.image import Image
from servogen.pipeline.time_limit import TookTooLong, within
from servogen.simulator import Machine, Options, Repeat, State, find_repeat
from servogen.units import Clock, Cycles

BOARD = Options(ra4_pull_up=True)

LIMIT_S = 120.0
"""Of compiling and running one program, which takes a second; one that hangs must not stop the others."""

CONNECT_S = 10
"""To a cluster's scheduler."""


class Runnable(Protocol):
    """A program that can be run: its image, and the clock that its source names."""

    @property
    def image(self) -> Image: ...

    @property
    def clock(self) -> Clock | None: ...


Read = Callable[[Path], Runnable]
"""Reads a HEX file, compiles C, assembles assembly. Raises InputError."""


@dataclass(frozen=True, slots=True)
class Graded:
    """A file and its grade; `defect` is what went wrong in servogen itself, not in the program."""

    file: Path
    grade: Grade
    defect: str = ""


def grade_program(lab: Lab, program: Runnable) -> Grade:
    """Runs the program for the lab's time on the lab's board and judges its pulses."""
    span = Cycles(lab.clock.round_seconds(lab.watch_s))
    machine = Machine(program.image, lab.clock, BOARD)
    watched = watch(EdgeTrace(lab.clock, machine.stream(span), span))
    grade = judge(lab, watched, _facts(machine.state(), program))
    if not grade.passed:
        return grade
    pin = PINS.index(grade.pins[0][1])
    repeat = find_repeat(program.image, lab.clock, pin=pin, limit=span, options=BOARD)
    return replace(grade, for_ever=isinstance(repeat, Repeat))


def grade_file(file: Path, lab_name: str, read: Read, limit_s: float = LIMIT_S) -> Graded:
    """Grades one file. A worker of any kind can run it: all that it is given can be pickled."""
    lab = load_lab(lab_name)
    try:
        return Graded(file, within(limit_s, lambda: _grade_file(file, lab, read)))
    except TookTooLong:
        return Graded(
            file,
            refused(
                lab.name,
                f"it took too long: compiling it, and running it for {float(lab.watch_s):g} s "
                f"of the chip's time, had not ended after {limit_s:g} s",
            ),
        )
    except ServogenError:
        raise
    except Exception as error:  # one program must not stop the others
        text = f"{type(error).__name__}: {error}"
        return Graded(file, refused(lab.name, f"servogen failed on it: {text}"), text)


def _grade_file(file: Path, lab: Lab, read: Read) -> Grade:
    try:
        return grade_program(lab, read(file))
    except InputError as error:
        return refused(lab.name, f"the program cannot be run:\n{error}")


def grade_files(
    files: Sequence[Path],
    lab_name: str,
    read: Read,
    scheduler: str | None = None,
    progress: Callable[[int], None] = lambda done: None,
    limit_s: float = LIMIT_S,
) -> list[Graded]:
    """Grades all files over the machine's cores, or over the Dask cluster at `scheduler`.

    None may take longer than `limit_s`.
    """
    if scheduler is None and len(files) == 1:
        return [grade_file(files[0], lab_name, read, limit_s)]
    with _executor(scheduler, len(files)) as executor:
        futures = [executor.submit(grade_file, file, lab_name, read, limit_s) for file in files]
        for done, _ in enumerate(as_completed(futures), 1):
            progress(done)
    return [
        _alone(file, lab_name, read, limit_s)
        if isinstance(future.exception(), BrokenExecutor)
        else _result(future, file, lab_name)
        for future, file in zip(futures, files, strict=True)
    ]


def _alone(file: Path, lab_name: str, read: Read, limit_s: float) -> Graded:
    """Grades a file in a process of its own: a worker that ended took all that waited with it."""
    with ProcessPoolExecutor(max_workers=1) as pool:
        future = pool.submit(grade_file, file, lab_name, read, limit_s)
        return _result(future, file, lab_name)


def _result(future: Future[Graded], file: Path, lab_name: str) -> Graded:
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, ServogenError):
        raise error
    text = f"its worker ended: {error or type(error).__name__}"
    return Graded(file, refused(lab_name, f"servogen failed on it: {text}"), text)


@contextmanager
def _executor(scheduler: str | None, files: int) -> Iterator[Executor]:
    if scheduler is None:
        with ProcessPoolExecutor(max_workers=max(1, min(files, os.cpu_count() or 1))) as pool:
            yield pool
        return
    try:
        distributed = import_module("dask.distributed")
    except ImportError as error:
        raise ToolError(
            "grading on a cluster needs Dask", hint="pip install 'servogen[dask]', or leave out --scheduler"
        ) from error
    try:
        client = distributed.Client(scheduler, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise ToolError(f"there is no Dask scheduler at {scheduler}: {error}") from error
    with client:
        yield client.get_executor(pure=False)


def _facts(state: State, program: Runnable) -> ChipFacts:
    tris = {"A": state.registers["TRISA"], "B": state.registers["TRISB"]}
    return ChipFacts(
        inputs=frozenset(number for number, pin in enumerate(PINS) if tris[pin[1]] >> int(pin[2]) & 1),
        watchdog_resets=state.resets["watchdog"],
        configured=program.image.config is not None,
        sleeping=state.sleeping,
        lost=any(warning.kind == "erased-word" for warning in state.warnings),
        stack_wraps=state.stack_wraps,
        written_for_hz=program.clock.hz if program.clock else None,
    )
