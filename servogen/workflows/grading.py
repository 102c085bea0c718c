"""Grades programs against a lab's task: compiles, runs and judges each program, many at a time.

In: submissions and a lab. Out: a `Graded` for each, in their order; an error in one does not stop the others.
The programs are not trusted: each is compiled and run in separate processes, see `isolation`.

    here        this process ──fork──▶ one process for each program
    a cluster   Dask worker ──▶ a fresh process for a batch ──fork──▶ one process for each program
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from importlib import import_module
from itertools import chain, islice
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

import servogen.compiler  # noqa: F401 - so that it is not loaded in the process of each program
from servogen.edges import PINS, EdgeChunk, EdgeTrace
from servogen.errors import Diagnostic, InputError, ServogenError, ToolError
from servogen.grade import (
    Check,
    ChipFacts,
    Fault,
    Grade,
    Lab,
    Submission,
    judge,
    message,
    refused,
    shown_name,
    visible,
)
from servogen.grade.film import Film, FilmSource, lines_around, make_film
from servogen.grade.watch import Watched, watch
from servogen.isolation import COMPILING, LimitExceeded, Resource, WorkLimits, can_fork, run_each
from servogen.pic.device import PROGRAM_WORDS
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.simulator import Machine, MachineState
from servogen.units import Clock, Cycles
from servogen.workflows.power_ups import (
    Chip,
    ChipDifference,
    cause,
    compared_values,
    condition,
    machine,
    other_chips,
    powered_again,
)

RUNNING = WorkLimits.patient(120.0, COMPILING.memory_mb)
"""The limits for running and judging one program, which usually takes a second."""

STARTING_S = 60
"""The time that a process may take to start on a busy machine."""

BATCH = 8
"""The number of programs that a worker of a cluster grades in one process."""

CONNECT_S = 10
"""The time allowed for connecting to a cluster's scheduler, and for its first worker to appear."""

WITHOUT_WORKERS_S = 60.0
"""The time after which a cluster that has lost its workers is given up."""

POLL_S = 1.0

MOST_REMARKS = 10
"""The greatest number of the compiler's warnings that a student is told."""

POWERED_AGAIN = 3
"""How often a program that writes the EEPROM is powered up with what the run before has left there."""

READ_UNWRITTEN = 4
"""The number of bytes of RAM, of those read before they are written, that are tried with several values."""

ODD_VALUES = 16
"""The number of those values, of those that change an edge, with which the program is judged."""


class Runnable(Protocol):
    """A program that can be run: its image, the clock that its source names, and remarks about its file."""

    @property
    def image(self) -> Image: ...

    @property
    def clock(self) -> Clock | None: ...

    @property
    def remarks(self) -> tuple[Diagnostic, ...]: ...

    @property
    def listing(self) -> Listing | None: ...


class ReadProgram(Runnable, Protocol):
    """A program as it was read, with the warnings of its compiler or assembler."""

    @property
    def warnings(self) -> tuple[Diagnostic, ...]: ...


Read = Callable[[Submission], ReadProgram]
"""Reads a HEX file, compiles C, assembles assembly. Raises InputError."""


@dataclass(frozen=True, slots=True)
class Compiled:
    """A program as the process that compiled it returns it."""

    image: Image
    clock: Clock | None
    remarks: tuple[Diagnostic, ...]
    listing: Listing | None = None


@dataclass(frozen=True, slots=True)
class Graded:
    """A program and its grade; `defect` is an error of servogen itself, not of the program."""

    submission: Submission
    grade: Grade
    defect: str = ""
    code: str = ""
    """A digest of its machine code; empty if it did not run."""


def copies(graded: Sequence[Graded]) -> list[tuple[str, ...]]:
    """Return the names of programs with the same machine code: names, comments and layout do not count."""
    groups: dict[str, list[str]] = {}
    for each in graded:
        if each.code:
            groups.setdefault(each.code, []).append(shown_name(each.submission.name))
    return [tuple(names) for names in groups.values() if len(names) > 1]


@dataclass(frozen=True, slots=True)
class GradingTask:
    """How to grade: the lab, how programs are read, and the limits for compiling and running one.

    A task can be sent to a worker of a cluster.
    """

    lab: Lab
    read: Read
    compiling: WorkLimits = COMPILING
    running: WorkLimits = RUNNING

    @classmethod
    def of(cls, lab: Lab, read: Read, seconds: float, memory_mb: int) -> GradingTask:
        """Return the task in which running and compiling may each take `seconds` of processor time."""
        compiling = WorkLimits.patient(min(seconds, COMPILING.seconds), memory_mb)
        return cls(lab, read, compiling, WorkLimits.patient(seconds, memory_mb))


def grade_submissions(
    submissions: Sequence[Submission],
    task: GradingTask,
    scheduler: str | None = None,
    progress: Callable[[int], None] = lambda completed: None,
    at_once: int | None = None,
) -> list[Graded]:
    """Return the grades, in the order of `submissions`; `progress` is called with the number graded so far.

    The work is done on this machine, `at_once` programs at a time (default: one for each core), or on the
    Dask cluster at the address `scheduler`. Raises ToolError if there is no such cluster.
    """
    at_once = at_once or os.cpu_count() or 1
    graded: dict[int, Graded] = {}
    if scheduler is not None:
        results = _on_cluster(submissions, task, scheduler)
    elif can_fork():
        results = _in_forks(submissions, task, at_once)
    else:
        results = _in_fresh_processes(submissions, task, at_once)
    for index, result in results:
        graded[index] = result
        progress(len(graded))
    return [graded[index] for index in range(len(submissions))]


def grade_program(lab: Lab, program: Runnable) -> Grade:
    """Run the program on the lab's board and return the grade of its pulses.

    If it is right on the first chip, it is powered up on others, too: what depends on the chip is a fault.
    """
    first = _power_up(lab, program, (), tracked=True)
    dependent = (
        replace(warning, message=f"other chips may behave differently: {warning.message}")
        for warning in first.machine.chip_dependent
    )
    grade = replace(first.grade, remarks=(*first.grade.remarks, *dependent))
    if not grade.passed:
        return replace(grade, film=_film(lab, program, first.watched, grade))
    tried = [first]
    for chip in _chips(program, first):
        tried.append(_power_up(lab, program, chip))
        if not tried[-1].grade.passed:
            fault = Fault((Check.CHIPS,), _dependence(lab, program, chip, tried[-1].watched.end))
            return replace(grade, faults=(fault,), repeats=False)
    repeats = all(each.grade.repeats for each in tried)
    if not repeats:
        text = (
            f"watched for {grade.watched_s:g} s: the chip's state did not repeat, so nothing later is judged"
        )
        grade = replace(grade, remarks=(Diagnostic("note", "not-repeated", text), *grade.remarks))
    return replace(grade, chips=len(tried), repeats=repeats)


class PowerUp(NamedTuple):
    """A program on a chip: its grade there, its pulses, and the chip at the end."""

    grade: Grade
    watched: Watched
    machine: Machine


def _power_up(lab: Lab, program: Runnable, chip: Sequence[ChipDifference], tracked: bool = False) -> PowerUp:
    """Watch the program for the lab's time, and on until the state repeats or the longest time is over."""
    running = machine(program.image, lab.clock, chip, tracked=tracked)
    again = machine(program.image, lab.clock, chip)
    seen: set[bytes] = set()
    chunks: list[EdgeChunk] = []
    seconds = lab.watch_s
    while True:
        end = Cycles(lab.clock.round_seconds(seconds))
        more = _keep_chunks(running.stream(end - running.cycles), chunks)
        watched = watch(EdgeTrace(lab.clock, chain(tuple(chunks), more), end))
        grade = judge(lab, watched, _facts(running.state(), program))
        if grade.passed and _repeats(again, grade.rounds, seen):
            return PowerUp(replace(grade, repeats=True), watched, running)
        if not grade.passed or seconds >= lab.longest_watch_s:
            return PowerUp(grade, watched, running)
        seconds = min(2 * seconds, lab.longest_watch_s)


def _keep_chunks(chunks: Iterable[EdgeChunk], kept: list[EdgeChunk]) -> Iterator[EdgeChunk]:
    """Yield chunks of edges, and keep them."""
    for chunk in chunks:
        kept.append(chunk)
        yield chunk


def _repeats(running: Machine, rounds: Sequence[int], seen: set[bytes]) -> bool:
    """Return whether the chip's whole state is the same at the beginnings of two rounds (cycles).

    `seen` has those of the rounds before `running`'s cycle.
    """
    for begin in rounds:
        if begin < running.cycles:
            continue
        running.run_until(cycle=begin + 1)
        state = (running.cycles - begin).to_bytes(1) + running.fingerprint()
        if state in seen:
            return True
        seen.add(state)
    return False


def _chips(program: Runnable, first: PowerUp) -> Iterator[Chip]:
    """Yield the other chips: last the first one, powered up again, as long as its EEPROM is a new one."""
    yield from other_chips(program.image)
    yield from islice(_odd_values(program, first), ODD_VALUES)
    before = first.machine
    for _ in range(POWERED_AGAIN):
        chip = powered_again(before)
        if chip is None:
            return
        yield chip
        before = machine(program.image, first.watched.clock, chip)
        before.run(first.watched.end)


def _odd_values(program: Runnable, first: PowerUp) -> Iterator[Chip]:
    """Yield chips with a value in RAM, read before it is written, that changes an edge of the first round."""
    clock, end = first.watched.clock, [*first.grade.rounds, first.watched.end][1]
    usual = machine(program.image, clock, ()).run(end)
    for chip in compared_values(program.image, first.machine.read_unwritten[:READ_UNWRITTEN]):
        edges = machine(program.image, clock, chip).run(end)
        if not _same(edges, usual):
            yield chip


def _same(edges: EdgeChunk, others: EdgeChunk) -> bool:
    pairs = ((edges.cycle, others.cycle), (edges.pin, others.pin), (edges.level, others.level))
    return all(np.array_equal(mine, theirs) for mine, theirs in pairs)


def _dependence(lab: Lab, program: Runnable, chip: Chip, cycles: int) -> str:
    """Return on what of a chip it depends that the program fails there within `cycles`, and how."""

    def grade_on(differences: Sequence[ChipDifference]) -> Grade:
        running = machine(program.image, lab.clock, differences)
        watched = watch(EdgeTrace(lab.clock, running.stream(cycles), Cycles(cycles)))
        return judge(lab, watched, _facts(running.state(), program))

    needed = cause(chip, lambda differences: not grade_on(differences).passed)
    return f"it depends on the chip: if {condition(needed)}, {grade_on(needed).reasons[0]}"


def _film(lab: Lab, program: Runnable, watched: Watched, grade: Grade) -> Film:
    """Return the film of a failed program: its servos' pins around the wrong moment."""
    named = dict(grade.pins)
    pins = [PINS.index(named.get(servo.servo.name, servo.pins[0])) for servo in lab.servos]
    at = (
        watched.end if grade.moment is None and not any(pin in watched.pins for pin in pins) else grade.moment
    )
    running = machine(program.image, lab.clock, ())
    running.run(
        at if at is not None else min(int(watched.pins[p].rise[0]) for p in pins if p in watched.pins)
    )
    source = _source(program.listing, running.pc, running.state().stack[: running.state().stack_depth])
    return make_film(watched, pins, 0 if at == watched.end else at, source)


def _source(listing: Listing | None, pc: int, returns: Sequence[int]) -> FilmSource | None:
    """Return the source around the instruction at `pc`: in a routine of the compiler, around its call."""
    rows = {row.address: row for row in listing.rows} if listing else {}
    texts = dict(listing.sources) if listing else {}
    for address in (pc, *(return_address - 1 for return_address in returns)):
        row = rows.get(address % PROGRAM_WORDS)
        if row is not None and row.file in texts and row.line is not None:
            return lines_around(Path(row.file).name, texts[row.file], row.line)
    return None


def _in_forks(
    submissions: Sequence[Submission], task: GradingTask, at_once: int
) -> Iterator[tuple[int, Graded]]:
    """Compile all, then run those that compile, each program in its own process; yield (index, grade)."""
    compiled: dict[int, Compiled] = {}
    works = [partial(_compile, task.read, submission) for submission in submissions]
    for index, result in run_each(works, task.compiling, at_once):
        if isinstance(result, Compiled):
            compiled[index] = result
        else:
            yield index, _failure(submissions[index], task.lab, "compiling it", result)
    indices = sorted(compiled)
    runs = [partial(grade_program, task.lab, compiled[index]) for index in indices]
    for number, grade in run_each(runs, task.running, at_once):
        index = indices[number]
        if isinstance(grade, Grade):
            remarks = (*grade.remarks, *compiled[index].remarks)
            code = sha256(repr(sorted(compiled[index].image.program.items())).encode()).hexdigest()
            yield index, Graded(submissions[index], replace(grade, remarks=remarks), code=code)
        else:
            activity = f"running it for {float(task.lab.watch_s):g} s of the chip's time"
            yield index, _failure(submissions[index], task.lab, activity, grade)


def _compile(read: Read, submission: Submission) -> Compiled:
    submission.require_readable()
    program = read(submission)
    said = (*program.remarks, *program.warnings)
    remarks = tuple(map(_for_students, said[:MOST_REMARKS]))
    if len(said) > MOST_REMARKS:
        more = f"and {len(said) - MOST_REMARKS} more warnings"
        remarks += (Diagnostic("note", "more-warnings", more),)
    return Compiled(program.image, program.clock, remarks, program.listing)


def _for_students(remark: Diagnostic) -> Diagnostic:
    """Return a warning that does not name the folders above the file, and shows every character."""
    place = remark.location
    if place and place.file:
        place = replace(place, file=visible(Path(place.file).name))
    return replace(remark, message=visible(remark.message), location=place)


def _failure(submission: Submission, lab: Lab, activity: str, error: Exception) -> Graded:
    """Return the grade of a program that failed with `error` during `activity`."""
    if isinstance(error, InputError):
        return Graded(submission, refused(lab.name, message(f"the program cannot be run:\n{error}")))
    if isinstance(error, LimitExceeded):
        return Graded(submission, refused(lab.name, f"{activity} {error}"))
    shown = str(error) if isinstance(error, ServogenError) else f"{type(error).__name__}: {error}"
    text = message(shown)
    return Graded(submission, refused(lab.name, f"servogen failed on it: {text}"), text)


# In a fresh process: for workers of a cluster, which have threads and must not fork, and for systems
# without fork.


def _in_fresh_processes(
    submissions: Sequence[Submission], task: GradingTask, at_once: int
) -> Iterator[tuple[int, Graded]]:
    with ThreadPoolExecutor(at_once) as pool:
        futures = {
            pool.submit(grade_in_fresh_process, [submission], task): index
            for index, submission in enumerate(submissions)
        }
        waiting = set(futures)
        while waiting:
            finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in finished:
                yield futures[future], future.result()[0]


def grade_in_fresh_process(submissions: Sequence[Submission], task: GradingTask) -> list[Graded]:
    """Return the grades of `submissions`, graded one after the other in one fresh process.

    If that process fails, each submission is tried in one of its own.
    """
    each_s = task.compiling.deadline_s + task.running.deadline_s
    command = "import pickle, sys; sys.path[:] = pickle.load(sys.stdin.buffer); "
    command += f"from {__name__} import serve; serve()"
    try:
        process = subprocess.run(
            [sys.executable, "-c", command],
            input=pickle.dumps(sys.path) + pickle.dumps((submissions, task)),
            capture_output=True,
            timeout=STARTING_S + len(submissions) * each_s,
        )
        if process.returncode == 0:
            graded: list[Graded] = pickle.loads(process.stdout)
            return graded
        last = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
        why = ": ".join([f"its process ended with exit code {process.returncode}", *last])
    except subprocess.TimeoutExpired as error:
        if len(submissions) == 1:  # where processes cannot be forked
            late = LimitExceeded(Resource.TIME, WorkLimits(seconds=error.timeout))
            return [_failure(submissions[0], task.lab, "compiling and running it", late)]
        why = f"its process had not ended after {error.timeout:g} s"
    if len(submissions) > 1:
        return [graded for submission in submissions for graded in grade_in_fresh_process([submission], task)]
    return [_failure(submissions[0], task.lab, "", ToolError("grading-failed", why))]


def serve() -> None:
    """Grade what `grade_in_fresh_process` writes to standard input, and answer on standard output."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what anything else prints is not an answer
    submissions, task = pickle.load(sys.stdin.buffer)
    results = dict(_in_forks(submissions, task, 1))
    with answers:
        pickle.dump([results[index] for index in range(len(submissions))], answers)


# On a cluster.


def _on_cluster(
    submissions: Sequence[Submission], task: GradingTask, scheduler: str
) -> Iterator[tuple[int, Graded]]:
    starts = range(0, len(submissions), BATCH)
    with _client(scheduler) as client:
        executor = client.get_executor(pure=False)
        futures: dict[Future[list[Graded]], int] = {
            executor.submit(grade_in_fresh_process, list(submissions[start : start + BATCH]), task): start
            for start in starts
        }
        waiting = set(futures)
        seen = time.monotonic()
        while waiting:
            finished, waiting = wait(waiting, POLL_S, FIRST_COMPLETED)
            if finished or has_worker(client):
                seen = time.monotonic()
            elif time.monotonic() - seen > WITHOUT_WORKERS_S:
                finished, waiting = waiting, set()
            for future in finished:
                start = futures[future]
                batch = submissions[start : start + BATCH]
                yield from enumerate(_results(future, batch, task), start)


def _results(future: Future[list[Graded]], batch: Sequence[Submission], task: GradingTask) -> list[Graded]:
    if not future.done():
        error: BaseException | None = ToolError("grading-failed", "the cluster no longer has a worker")
    else:
        try:
            error = future.exception()
        except CancelledError:
            error = ToolError("grading-failed", "the connection to the cluster was lost")
    if error is None:
        return future.result()
    lost = ToolError("grading-failed", f"its worker ended: {type(error).__name__}: {error}")
    return [_failure(submission, task.lab, "", lost) for submission in batch]


@contextmanager
def _client(scheduler: str) -> Iterator[Any]:
    """Yield a client of the cluster, once it has a worker. Raises ToolError."""
    try:
        distributed = import_module("distributed")
    except ImportError as error:
        raise ToolError(
            "tool-missing",
            "grading on a cluster needs Dask",
            hint="pip install 'servogen[dask]', or omit --scheduler",
        ) from error
    try:
        client = distributed.Client(scheduler, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise ToolError("grading-failed", f"there is no Dask scheduler at {scheduler}: {error}") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_S)
        except TimeoutError as error:
            raise ToolError(
                "grading-failed",
                f"the Dask scheduler at {scheduler} has no worker",
                hint=f"start one: dask worker {scheduler}",
            ) from error
        yield client


def has_worker(client: Any) -> bool:
    try:
        return bool(client.scheduler_info()["workers"])
    except OSError:
        return False


def _facts(state: MachineState, program: Runnable) -> ChipFacts:
    tris = {"A": state.registers["TRISA"], "B": state.registers["TRISB"]}
    return ChipFacts(
        inputs=frozenset(number for number, pin in enumerate(PINS) if tris[pin[1]] >> int(pin[2]) & 1),
        watchdog_resets=state.resets["watchdog"],
        configured=program.image.config is not None,
        sleeping=state.sleeping,
        lost=any(warning.code == "erased-word" for warning in state.warnings),
        stack_wraps=state.stack_wraps,
        written_for_hz=program.clock.hz if program.clock else None,
    )
