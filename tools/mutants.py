"""Draws mutants of servogen/ at random and runs the tests that reach them.

A mutant is the program with one small fault: a comparison, number, operator or condition changed, a
statement deleted, a value not returned. A test that fails kills it. What survives is a fault that nobody
would notice, or a change that makes no difference: read the survivors, and write the missing test.

    python tools/mutants.py                         # 20 mutants of the whole of servogen/
    python tools/mutants.py cli report --count 40   # of two packages
    python tools/mutants.py core --seed 3           # of all packages but cli and report
    python tools/mutants.py simulator/ports.py --list --count 1000

The seed and the sources determine what is drawn. Each worker (--jobs) has a copy of the tree in the
temporary folder; yours is only read. The tests of a mutant are the files from which its module can be reached
through imports, the nearest first, --files at most, until one fails or --seconds are
over. A test that takes longer than --test-seconds has failed, and a process that does not come back is
killed. A test that fails without the mutant as well does not count, and is named at the end.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import queue
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = "servogen"
READ_BY_PEOPLE = ("cli", "report")
"""The packages that are not `core`."""

NOT_COPIED = (".git", ".venv*", "build", "dist", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis")
GRACE_S = 20.0
"""How long a process may go on after its last test should have ended."""

MEMORY = 8 << 30
PREPARED = "servogen/simulator/aot_cache.py"
PREPARE = """
from servogen.simulator.aot_cache import loop
for observed, tracked in ((False, False), (True, False), (False, True)):
    loop(observed=observed, tracked=tracked)
"""
PREPARE_S = COLLECT_S = 600
POLL_S = 0.5
PYTEST: tuple[str, ...] = (sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider")
PYTEST += ("-o", "addopts=--import-mode=importlib")

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
}


class ToolFailure(Exception):
    """What keeps the tests from being run at all."""


@dataclass(frozen=True, slots=True, order=True)
class Mutant:
    """One change: the bytes `start` to `end` of a file (relative to the root) become `new`."""

    file: str
    line: int
    start: int
    end: int
    old: str
    new: str

    def text(self) -> str:
        """Return file:line and the change, on one line."""
        old, new = (" ".join(each.split()) for each in (self.old, self.new))
        return f"{self.file}:{self.line}: {_short(old)}  →  {_short(new)}"

    @property
    def package(self) -> str:
        """Return the package of servogen/ that it is in, or the module beside the packages."""
        return Path(self.file).parts[1].removesuffix(".py")


def _short(text: str, most: int = 70) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def mutants_of(source: str, file: str) -> list[Mutant]:
    """Return every mutant of a module, in the order of its text.

    Left alone are strings (messages are read, not calculated), annotations, the options of decorators
    (`slots=True` has no effect that a test could see), and what only a type checker runs.
    """
    lines = source.encode().splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    whole = source.encode()
    found = []
    for node, new in _changes(ast.parse(source)):
        start = starts[node.lineno - 1] + node.col_offset
        end = starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)
        found.append(Mutant(file, node.lineno, start, end, whole[start:end].decode(), new))
    return sorted(set(found))


def _changes(node: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    """Yield (what is replaced, its replacement) of a node and of all below it."""
    if isinstance(node, ast.JoinedStr):  # before Python 3.12 its parts have no place of their own
        return
    if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
        return
    if isinstance(node, ast.expr):
        yield from ((node, new) for new in _of_expression(node))
    elif isinstance(node, ast.stmt):
        yield from _of_statement(node)
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _changes(child)


def _of_expression(node: ast.expr) -> Iterator[str]:
    match node:
        case ast.Compare(left, ops, comparators):
            for index, op in enumerate(ops):
                changed = [*ops[:index], COMPARISONS[type(op)](), *ops[index + 1 :]]
                yield f"({ast.unparse(ast.Compare(left, changed, comparators))})"
        case ast.BinOp(left, op, right) if type(op) in OPERATORS:
            yield f"({ast.unparse(ast.BinOp(left, OPERATORS[type(op)](), right))})"
        case ast.BoolOp(op, values):
            other = ast.Or() if isinstance(op, ast.And) else ast.And()
            yield f"({ast.unparse(ast.BoolOp(other, values))})"
        case ast.UnaryOp(ast.Not() | ast.USub(), operand):
            yield f"({ast.unparse(operand)})"
        case ast.Constant(bool() as value):
            yield str(not value)
        case ast.Constant(int() | float() as value):
            yield repr(value + 1)
        case ast.IfExp(test, yes, no):
            yield f"({ast.unparse(ast.IfExp(test, no, yes))})"


def _of_statement(node: ast.stmt) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    match node:
        case ast.If(test) | ast.While(test):
            yield test, f"(not ({ast.unparse(test)}))"
        case ast.Expr(ast.Call()) | ast.AugAssign() | ast.Raise() | ast.Continue() | ast.Break():
            yield node, "pass"
        case ast.Return(ast.expr() as value) if not (isinstance(value, ast.Constant) and value.value is None):
            yield value, "None"


def draw(root: Path, where: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """Return `count` mutants, or all if there are fewer, of the packages and files in `where`.

    Raises ValueError for one that does not exist.
    """
    every = [
        mutant for file in _files(root, where) for mutant in mutants_of(file.read_text(), _name(root, file))
    ]
    return random.Random(seed).sample(every, min(count, len(every)))


def _name(root: Path, file: Path) -> str:
    return file.relative_to(root).as_posix()


def _files(root: Path, where: Sequence[str]) -> list[Path]:
    folder = root / PACKAGE
    files: set[Path] = set()
    for each in where or [""]:
        path = folder / each
        if each == "core":
            files |= {
                file
                for file in folder.rglob("*.py")
                if file.relative_to(folder).parts[0] not in READ_BY_PEOPLE
            }
        elif path.is_dir():
            files |= set(path.rglob("*.py"))
        elif path.suffix == ".py" and path.is_file():
            files.add(path)
        else:
            raise ValueError(f"'{each}' is not 'core', a package of {PACKAGE}/ or a file in it")
    return sorted(files)


class Reach:
    """Which test files reach a module through imports, the nearest first."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.imports: dict[Path, set[Path]] = {}

    def tests_of(self, file: str) -> list[str]:
        """Return the test files that reach a module: those whose names share most words with its name come
        first, then those with the fewest imports between.
        """
        target, found = self.root / file, []
        for test in sorted((self.root / "tests").rglob("test_*.py")):
            distance = self._distance(test, target)
            if distance is not None:
                name = _name(self.root, test)
                found.append((-len(_words(file) & _words(name)), distance, name))
        return [name for *_, name in sorted(found)]

    def _distance(self, test: Path, target: Path) -> int | None:
        beside = [each / "conftest.py" for each in test.parents if each.is_relative_to(self.root / "tests")]
        first = [test, *(each for each in beside[:-1] if each.is_file())]
        distance = dict.fromkeys(first, 0)
        left = deque(first)
        while left:
            each = left.popleft()
            if each == target:
                return distance[each]
            for other in self._imports(each) - distance.keys():
                distance[other] = distance[each] + 1
                left.append(other)
        return None

    def _imports(self, file: Path) -> set[Path]:
        """Return the files of servogen/ and tests/ that a file imports or names as a module."""
        if file not in self.imports:
            text = file.read_text()
            names = set(re.findall(rf"\b(?:{PACKAGE}|tests)(?:\.\w+)+", text))
            if re.search(rf"[\"'](?:-m\W+)?{PACKAGE}[\"']", text):  # a command line
                names.add(f"{PACKAGE}.__main__")
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.ImportFrom):
                    module = node.module or ""
                    if node.level:
                        above = file.relative_to(self.root).parents[node.level - 1].parts
                        module = ".".join((*above, *filter(None, (module,))))
                    names |= {module, *(f"{module}.{each.name}" for each in node.names)}
            paths = (self._path(each) for each in names if each.split(".")[0] in (PACKAGE, "tests"))
            self.imports[file] = {path for path in paths if path} - {file}
        return self.imports[file]

    def _path(self, module: str) -> Path | None:
        base = self.root.joinpath(*module.split("."))
        return next(
            (each for each in (base.with_suffix(".py"), base / "__init__.py") if each.is_file()), None
        )


def _words(file: str) -> set[str]:
    """Return the words of a path, in the singular, without those that say nothing."""
    words = {each.removesuffix("s") for each in re.split(r"[/_.]", file)}
    return words - {PACKAGE, "py", "test", "command", "", "__init__"}


@dataclass(frozen=True, slots=True)
class Ran:
    """What became of a run: how many tests passed, which failed, and whether the time was up."""

    passed: int
    failed: str
    out_of_time: bool


@dataclass(frozen=True, slots=True)
class Fate:
    """`killer`: the test that failed, or "" where the mutant survived the `passed` tests that ran."""

    mutant: Mutant
    killer: str
    passed: int
    out_of_time: bool

    def text(self) -> str:
        """Return one line for people."""
        if self.killer:
            return f"killed    {self.mutant.text()}  [{self.killer}]"
        cut = ", then the time was up" if self.out_of_time else ""
        return f"SURVIVED  {self.mutant.text()}  [{self.passed} tests{cut}]"


@dataclass(slots=True)
class Limits:
    """Seconds for a mutant's tests altogether and for one of them; from how many files they come."""

    seconds: float
    test_seconds: float
    files: int = 30


@dataclass(slots=True)
class Workshop:
    """A copy of the tree in which one mutant after another is made and tested."""

    root: Path
    copy: Path
    limits: Limits
    stop: threading.Event = field(default_factory=threading.Event)
    unsound: set[str] = field(default_factory=set)
    """Tests that fail without a mutant, too."""

    sound: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        left_out = shutil.ignore_patterns(*NOT_COPIED)
        shutil.copytree(
            self.root,
            self.copy,
            ignore=lambda folder, names: left_out(folder, names) if Path(folder) == self.root else set(),
            symlinks=True,
        )
        code = self._start([*PYTEST, "--collect-only", "tests"], {}, COLLECT_S)
        if code != 0 and not self.stop.is_set():
            raise ToolFailure(f"without a mutant, the tests cannot be collected: pytest ended with {code}")
        self._prepare()
        # A mutant of the simulator replaces the compiled loops beside its sources; these stay.
        kept = self.copy / ".cache" / PACKAGE
        kept.mkdir(parents=True, mode=0o700, exist_ok=True)
        for each in (self.copy / PACKAGE).rglob("__pycache__/*.o"):
            shutil.copy(each, kept)

    def _prepare(self) -> None:
        """Compile the simulator's loops, if there are any, so that no test spends its time on that."""
        if (self.copy / PREPARED).is_file():
            self._start([sys.executable, "-c", PREPARE], {}, PREPARE_S)

    def judge(self, mutant: Mutant) -> Fate:
        """Return what the tests make of a mutant."""
        tests = Reach(self.copy).tests_of(mutant.file)[: self.limits.files]
        while True:
            with made(self.copy, mutant):
                self._prepare()
                ran = self._run(tests)
            killer = ran.failed
            if not killer or self._is_sound(killer):
                return Fate(mutant, killer, ran.passed, ran.out_of_time)

    def _is_sound(self, test: str) -> bool:
        """Return whether a test passes without a mutant."""
        if test not in self.sound | self.unsound:
            (self.unsound if self._run([test]).failed else self.sound).add(test)
        return test in self.sound

    def _run(self, tests: Sequence[str]) -> Ran:
        """Run tests, in this order, until one fails or the time is up."""
        if not tests:
            return Ran(0, "", False)
        result = self.copy.parent / f"{self.copy.name}.json"
        result.unlink(missing_ok=True)
        command = [*PYTEST, "-p", "tools.mutation_limits"]
        command += [part for each in sorted(self.unsound) for part in ("--deselect", each)]
        given = {
            "MUTANT_RESULT": str(result),
            "MUTANT_SECONDS": str(self.limits.seconds),
            "MUTANT_TEST_SECONDS": str(self.limits.test_seconds),
        }
        limit = self.limits.seconds + self.limits.test_seconds + GRACE_S
        code = self._start([*command, *tests], given, limit)
        found = json.loads(result.read_text()) if result.exists() else {}
        failed = found.get("failed", "")
        ended_well = code == 0 or (code == 2 and found.get("out_of_time"))
        if not failed and not ended_well:  # a hang, a crash, or conftest.py cannot be imported
            failed = found.get("running") or tests[0]
        return Ran(found.get("passed", 0), failed, found.get("out_of_time", False))

    def _start(self, command: Sequence[str], given: Mapping[str, str], seconds: float) -> int | None:
        """Run a process in the copy. Returns its exit code, or None where it had to be killed."""
        own = {
            "PYTHONPATH": str(self.copy),
            "PYTHONDONTWRITEBYTECODE": "1",
            "XDG_CACHE_HOME": str(self.copy / ".cache"),
        }
        process = subprocess.Popen(
            command,
            cwd=self.copy,
            env={**os.environ, **own, **given},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY, MEMORY))
            end = time.monotonic() + seconds
            while time.monotonic() < end and not self.stop.is_set():
                with suppress(subprocess.TimeoutExpired):
                    return process.wait(POLL_S)
            return None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


@contextmanager
def made(root: Path, mutant: Mutant) -> Iterator[None]:
    """Keep the mutant in its file while the block runs; then the file is as it was, its date too."""
    file = root / mutant.file
    source, dates = file.read_bytes(), file.stat()
    try:
        file.write_bytes(source[: mutant.start] + mutant.new.encode() + source[mutant.end :])
        yield
    finally:
        file.write_bytes(source)
        os.utime(file, ns=(dates.st_atime_ns, dates.st_mtime_ns))


def judge_all(
    root: Path, mutants: Sequence[Mutant], limits: Limits, jobs: int
) -> tuple[list[Fate], set[str]]:
    """Judge mutants in `jobs` copies at once, printing each. Returns the fates and the unsound tests."""
    waiting: queue.SimpleQueue[Mutant] = queue.SimpleQueue()
    for each in mutants:
        waiting.put(each)
    fates: list[Fate] = []
    unsound: set[str] = set()
    failures: list[Exception] = []
    stop = threading.Event()

    def work(folder: Path) -> None:
        try:
            workshop = Workshop(root, folder, limits, stop)
            while not stop.is_set():
                try:
                    mutant = waiting.get_nowait()
                except queue.Empty:
                    break
                fate = workshop.judge(mutant)
                if stop.is_set():
                    break
                fates.append(fate)
                print(f"{len(fates):4} {fate.text()}", flush=True)
            unsound.update(workshop.unsound)
        except Exception as error:
            failures.append(error)
            stop.set()

    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        threads = [threading.Thread(target=work, args=(Path(folder) / f"copy{n}",)) for n in range(jobs)]
        for thread in threads:
            thread.start()
        try:
            for thread in threads:
                thread.join()
        except KeyboardInterrupt:
            stop.set()
            for thread in threads:
                thread.join()
    if failures:
        raise failures[0]
    return fates, unsound


def summary(fates: Sequence[Fate]) -> list[str]:
    """Return the rate of each package and of all."""
    drawn = Counter(each.mutant.package for each in fates)
    killed = Counter(each.mutant.package for each in fates if each.killer)
    rows = [(package, killed[package], drawn[package]) for package in sorted(drawn)]
    rows.append(("all", killed.total(), drawn.total()))
    return [
        f"{name:12} {dead:4} of {count:4} killed  {dead / count:6.1%}" for name, dead, count in rows if count
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line. Returns 1 where a mutant survived."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("where", nargs="*", help="packages or files of servogen/, or 'core'; default: all")
    parser.add_argument("--count", type=int, default=20, help="how many mutants (default 20)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (default 0)")
    parser.add_argument("--jobs", type=int, default=1, help="how many at once (default 1)")
    parser.add_argument("--seconds", type=float, default=300, help="for a mutant's tests (default 300)")
    parser.add_argument("--test-seconds", type=float, default=60, help="for one test (default 60)")
    parser.add_argument("--files", type=int, default=30, help="how many test files at most (default 30)")
    parser.add_argument("--list", action="store_true", help="print the mutants, run nothing")
    options = parser.parse_args(arguments)
    if min(options.count, options.jobs, options.seconds, options.test_seconds, options.files) <= 0:
        parser.error("--count, --jobs, --files, --seconds and --test-seconds must be greater than 0")
    try:
        mutants = draw(ROOT, options.where, options.count, options.seed)
    except ValueError as error:
        parser.error(str(error))
    if options.list:
        print(*(each.text() for each in mutants), sep="\n")
        return 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    limits = Limits(options.seconds, options.test_seconds, options.files)
    try:
        fates, unsound = judge_all(ROOT, mutants, limits, options.jobs)
    except ToolFailure as error:
        print(error, file=sys.stderr)
        return 3
    print(*summary(fates), sep="\n")
    for test in sorted(unsound):
        print(f"fails without a mutant, too, and was left out: {test}")
    return 0 if all(each.killer for each in fates) else 1


if __name__ == "__main__":
    raise SystemExit(main())
