"""Draws mutants of servogen/ at random and runs the tests that execute them.

A mutant is the program with one small fault: a comparison, number, operator or condition changed, a
statement deleted, a value not returned. A test that fails kills it. What survives is a fault that nobody
would notice, or a change that makes no difference: read the survivors, and write the missing test.
The parts in C (the simulator's core, the checker's chip) have mutants as well; their library is compiled
for each.

    python tools/mutants.py                         # 20 mutants of the whole of servogen/
    python tools/mutants.py cli report --count 40   # of two packages
    python tools/mutants.py core --seed 3           # of all packages but cli and report
    python tools/mutants.py report --tests tests/cli tests/report   # judged by these tests only
    python tools/mutants.py simulator/ports.py --list --count 1000
    python tools/mutants.py checker/chip.c simulator/core/timer.h   # of C

The seed and the sources determine what is drawn. Each worker (--jobs) has a copy of the tree in the
temporary folder; yours is only read. Which test executes which line is recorded once, with coverage.py, and
kept in the user's cache until servogen/ changes; a test file that changes is recorded again. The tests of a
mutant are those that execute its line, in the files named most like its module first, then the others of
these files, until one fails; no more are chosen than take --seconds. A test that takes longer than
--test-seconds has failed, and a process that does not come back is killed. A test that fails without the
mutant as well does not count, and is named at the end.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
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
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from itertools import groupby
from pathlib import Path
from typing import Any, TypeVar

from coverage import Coverage, CoverageData

ROOT = Path(__file__).parent.parent
PACKAGE = "servogen"
READ_BY_PEOPLE = ("cli", "report")
"""The packages that are not `core`."""

NOT_COPIED = (".git", ".venv*", "build", "dist", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis")
GRACE_S = 20.0
"""How long a process may go on after its last test should have ended."""

MEMORY = 8 << 30
RECORD_S = 4 * 3600
RECORDED_TOGETHER = 8
"""How many test files are recorded at once: what is recorded is kept even if the rest is interrupted."""

SLOWER = 5
"""How many times longer tests may take than when they were recorded: the machine may be busy."""

OF_THE_TREE = (PACKAGE, "tests", "tools")
NOT_RUN = 99
NO_TESTS = 5
"""What pytest ends with if no test is left: a mutant may take away the cases that a test finds."""

TESTED_IN = {"isolation": ("test_isolation.py",)}
"""The tests of what coverage.py does not see: processes that may write no file."""

PARTS_IN_C = {"simulator/core": "simulator/core/__init__.py", "checker": "checker/chip.py"}
"""The folders of C, and the module that calls it: whoever executes that may execute any line of the C."""

COMPILE = "from servogen.native import parts\nfor part in parts():\n    part.refresh()\n"
COMPILER = "the compiler"
COMPILE_S = 300

POLL_S = 0.1
PYTEST = ("-q", "-p", "no:cacheprovider", "-o", "addopts=--import-mode=importlib")
SLOW_TO_IMPORT = ("pytest", "numpy", "hypothesis", "typer", "matplotlib.figure")
"""Modules that are imported once: the process of each mutant's tests is forked from this one."""

FIRST_CASES = 2
"""How many cases of a test function have their turn before the other files."""

EVERY_PROCESS = "import coverage\ncoverage.process_startup()\n"
COVERAGE = """[run]
parallel = true
data_file = {data}
source = {source}
context = ${{MUTANT_TEST-}}
patch = _exit
disable_warnings = no-data-collected,module-not-measured,module-not-imported
"""

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
IN_C = {
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "&&": "||",
    "||": "&&",
    "+": "-",
    "-": "+",
    "&": "|",
    "|": "&",
    "^": "&",
    "<<": ">>",
    ">>": "<<",
}
C_TEXT = r"/\*.*?\*/|//[^\n]*|^\#(?:\\\n|[^\n])*|\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*'"
"""What is read, not calculated: comments, directives of the preprocessor, strings."""

C_STATEMENT = (
    r"(?<=\n)\ +(?P<statement>\**\w+(?:\ [-+*&|^<>]*=|\(|\[|->|\.|\+\+|--)[^;{}]*;|(?:break|continue);)"
)
"""An assignment, a call, or a jump at the beginning of a line: a declaration has two words there."""

C_OPERATOR = r"(?<=\ )(?P<operator><<|>>|<=|>=|==|!=|&&|\|\||[-<>+&|^])(?=[\ \n])"
SHOWN_OF_C = 20
"""Characters before and after what changes, which show where in its line it is."""

C_NUMBER = r"\b(?P<number>0[xX][0-9A-Fa-f]+|[0-9]+)\b"


Task = TypeVar("Task")
FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef


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
    """Return every mutant of a module or of a file of C, in the order of its text.

    Left alone are strings (messages are read, not calculated), annotations, the options of decorators
    (`slots=True` has no effect that a test could see), what only a type checker runs, and `strict` of `zip`,
    which is an assertion. A returned True or False is changed into the other, not into None.
    """
    if is_c(file):
        return sorted(_mutants_of_c(source, file))
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
    if isinstance(node, ast.keyword) and node.arg == "strict":
        return
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
        case ast.Return(ast.expr() as value) if not _is_constant(value, None, True, False):
            yield value, "None"


def _is_constant(node: ast.expr, *values: object) -> bool:
    return isinstance(node, ast.Constant) and any(node.value is value for value in values)


def is_c(file: str) -> bool:
    """Return whether a file is of C."""
    return file.endswith((".c", ".h"))


def _mutants_of_c(source: str, file: str) -> Iterator[Mutant]:
    """Yield the mutants of C: each token by itself, for which the house's layout is enough.

    An operator with a space on either side has two operands; a number is one more.
    """
    inside = re.compile(f"{C_TEXT}|{C_OPERATOR}|{C_NUMBER}", re.DOTALL | re.MULTILINE)
    whole = re.compile(f"{C_TEXT}|{C_STATEMENT}", re.DOTALL | re.MULTILINE)
    for found in (*inside.finditer(source), *whole.finditer(source)):
        kind = found.lastgroup
        if kind is None:
            continue
        old, (start, end) = found[kind], found.span(kind)
        new = {"operator": IN_C.get(old, ""), "statement": ";"}.get(kind) or str(int(old, 0) + 1)
        first, last = source.rfind("\n", 0, start) + 1, source.find("\n", end)
        before, after = (
            source[max(first, start - SHOWN_OF_C) : start],
            source[end : min(last, end + SHOWN_OF_C)],
        )
        at, line = len(source[: start - len(before)].encode()), source.count("\n", 0, start) + 1
        old, new = (f"{before}{each}{after}" for each in (old, new))
        yield Mutant(file, line, at, at + len(old.encode()), old, new)


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
                for file in _below(folder, folder)
                if file.relative_to(folder).parts[0] not in READ_BY_PEOPLE
            }
        elif path.is_dir():
            files |= _below(folder, path)
        elif path.is_file() and (path.suffix == ".py" or is_c(path.name)):
            files.add(path)
        else:
            raise ValueError(f"'{each}' is not 'core', a package of {PACKAGE}/ or a file in it")
    return sorted(files)


def _below(package: Path, folder: Path) -> set[Path]:
    parts = (file for part in PARTS_IN_C for file in (package / part).glob("*.[ch]"))
    return {*folder.rglob("*.py"), *(file for file in parts if file.is_relative_to(folder))}


class Record:
    """Which tests execute which lines of servogen/, in a folder of files.

    Each recording is a pair: `NAME.json` has the digest of each test file and, for each context, the test and
    its seconds; `NAME.lines` is coverage.py's data.
    """

    def __init__(self, folder: Path, root: Path, tests: Sequence[str] = ("tests",)) -> None:
        self.folder, self.root = folder, root
        self.digests = {
            _name(root, file): _digest(file)
            for file in (root / "tests").rglob("test_*.py")
            if _is_in(_name(root, file), tests)
        }
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()
        self.recorded: set[str] = set()
        self._parts: list[tuple[CoverageData, dict[str, str]]] = []
        self._adding = threading.Lock()
        for path in sorted(folder.glob("*.json")):
            self._read(path)

    def _read(self, path: Path) -> None:
        found = json.loads(path.read_text())
        current = {file for file, digest in found["files"].items() if self.digests.get(file) == digest}
        if not current:
            return
        data = CoverageData(str(path.with_suffix(".lines")))
        data.read()
        tests = {}
        for context, (test, seconds) in found["passed"].items():
            if test.partition("::")[0] in current:
                tests[context] = test
                self.seconds[test] = seconds
        self._parts.append((data, tests))
        self.recorded |= current
        self.failed |= {test for test in found["failed"] if test.partition("::")[0] in current}

    def add(self, name: str, lines: Iterable[Path], tests: dict[str, Any], files: Sequence[str]) -> None:
        """Keep what a run of test files has recorded: coverage.py's files, and what `line_record` writes."""
        with self._adding:
            self.folder.mkdir(parents=True, exist_ok=True)
            path = self.folder / f"{name}.json"
            together = Coverage(data_file=str(path.with_suffix(".lines")), config_file=False)
            together.combine([str(each) for each in lines if each.stat().st_size])
            together.save()
            path.write_text(json.dumps(tests | {"files": {file: self.digests[file] for file in files}}))
            self._read(path)

    def missing(self) -> list[list[str]]:
        """Return the test files that have not been recorded as they are now, in lists of one folder each."""
        files = sorted(self.digests.keys() - self.recorded)
        folders = [list(each) for _, each in groupby(files, lambda file: file.rpartition("/")[0])]
        return [
            each[start : start + RECORDED_TOGETHER]
            for each in folders
            for start in range(0, len(each), RECORDED_TOGETHER)
        ]

    def tests_of(self, mutant: Mutant) -> list[str]:
        """Return the tests that execute the mutant's lines, those first that are likely to notice it.

        The others of their files come last: they may use what a fixture or a cache of the file has made.
        These are the files whose names share most words with the module's, then those that take least time;
        of a file first the quickest cases of each function, and when all files have had their turn the rest.
        """
        reaching = self._reaching(mutant)
        files = {test.partition("::")[0] for test in reaching}
        beside = {test for test in self.seconds if test.partition("::")[0] in files} - reaching
        return [*self._in_order(reaching, mutant.file), *self._in_order(beside, mutant.file)]

    def _in_order(self, tests: set[str], file: str) -> list[str]:
        of_file: dict[str, list[tuple[int, float, str]]] = defaultdict(list)
        cases: Counter[str] = Counter()
        for test in sorted(tests, key=lambda test: (self.seconds[test], test)):
            function = test.partition("[")[0]
            of_file[test.partition("::")[0]].append((cases[function], self.seconds[test], test))
            cases[function] += 1
        files = sorted(
            of_file,
            key=lambda name: (-len(_words(file) & _words(name)), sum(each[1] for each in of_file[name])),
        )
        turns = [
            [each for each in of_file[name] if (each[0] < FIRST_CASES) == early]
            for early in (True, False)
            for name in files
        ]
        return [test for turn in turns for *_, test in sorted(turn)]

    def _reaching(self, mutant: Mutant) -> set[str]:
        if is_c(mutant.file):
            module = f"{PACKAGE}/{PARTS_IN_C[Path(mutant.file).parent.relative_to(PACKAGE).as_posix()]}"
            return self._executing(module, _of_functions((self.root / module).read_text()))
        source = (self.root / mutant.file).read_text()
        place = place_of(source, mutant.line)
        if place.lines:
            found = self._executing(mutant.file, place.lines)
            return found or self._beginning_with(TESTED_IN.get(mutant.package, ()))
        names = _derived(source, place.names)
        reading = self._reading(mutant.file, names)
        for file in (mutant.file, *(_name(self.root, each) for each in self.root.glob(f"{PACKAGE}/**/*.py"))):
            lines = _mentions((self.root / file).read_text(), names)
            if found := self._executing(file, lines):
                return found | reading
        return self._executing(mutant.file, _of_functions(source)) | reading

    def _reading(self, file: str, names: set[str]) -> set[str]:
        """Return the tests in files that import from a module's package and mention one of its names."""
        package = Path(file).parent.as_posix().replace("/", ".")
        texts = {each: (self.root / each).read_text() for each in self.recorded} if names else {}
        reading = {each for each, text in texts.items() if package in text and _word(names).search(text)}
        return {test for test in self.seconds if test.partition("::")[0] in reading}

    def _executing(self, file: str, lines: set[int]) -> set[str]:
        found = set()
        for data, tests in self._parts:
            for name in data.measured_files():
                if lines and name.endswith(f"/{file}"):
                    by_line = data.contexts_by_lineno(name)
                    contexts = {context for line in lines for context in by_line.get(line, ())}
                    found |= {tests[each] for each in contexts & tests.keys()}
        return found

    def _beginning_with(self, names: Sequence[str]) -> set[str]:
        starts = tuple(f"tests/{name}" for name in names)
        return {test for test in self.seconds if test.startswith(starts)}


@dataclass(frozen=True, slots=True)
class Place:
    """Where a mutant is: the lines one of which a test executes if it executes the mutant's statement.

    Without any where the statement runs when the module is imported; `names` then have its effect.
    """

    lines: set[int]
    names: set[str]


def place_of(source: str, line: int) -> Place:
    """Return where a line of a module is."""
    inside: list[ast.stmt] = []
    for node in ast.walk(ast.parse(source)):  # from the outside to the inside
        if isinstance(node, ast.stmt) and _first_line(node) <= line <= (node.end_lineno or 0):
            inside.append(node)
    statement, around = inside[-1], inside[:-1]
    if any(isinstance(each, FUNCTION) for each in around):
        body = getattr(statement, "body", None) or [
            part for each in getattr(statement, "cases", ()) for part in each.body
        ]
        end = body[0].lineno - 1 if body else statement.end_lineno or line
        return Place({line, *range(statement.lineno, max(statement.lineno, end) + 1)}, set())
    if isinstance(statement, FUNCTION):  # a default, or a decorator's option
        body = set(range(statement.body[0].lineno, (statement.end_lineno or line) + 1))
        return Place(body | _mentions(source, {statement.name}), set())
    names = _names(statement, ast.Store)
    return Place(set(), names | {each.name for each in around if isinstance(each, ast.ClassDef)})


def _first_line(node: ast.stmt) -> int:
    return min(each.lineno for each in (node, *getattr(node, "decorator_list", ())))


def _mentions(source: str, names: set[str]) -> set[int]:
    """Return the lines of functions that contain one of these names."""
    found = {n for n, line in enumerate(source.splitlines(), 1) if names and _word(names).search(line)}
    return found & _of_functions(source) if found else found


def _word(names: Iterable[str]) -> re.Pattern[str]:
    return re.compile(rf"\b(?:{'|'.join(map(re.escape, sorted(names)))})\b")


def _derived(source: str, names: set[str]) -> set[str]:
    """Return names of a module, those to which it assigns values made from them, and classes with them."""
    made: list[tuple[set[str], set[str]]] = []
    for each in ast.parse(source).body:
        if isinstance(each, ast.ClassDef):
            made.append(({each.name}, _names(each, ast.Load)))
        elif isinstance(each, ast.Assign | ast.AnnAssign):
            made.append((_names(each, ast.Store), _names(each, ast.Load)))
    derived = set(names)
    while more := set().union(*(stored for stored, used in made if derived & used)) - derived:
        derived |= more
    return derived


def _names(statement: ast.stmt, context: type[ast.expr_context]) -> set[str]:
    found = (each for each in ast.walk(statement) if isinstance(each, ast.Name))
    return {each.id for each in found if isinstance(each.ctx, context)}


def _of_functions(source: str) -> set[int]:
    """Return the lines of the bodies of functions: the others are executed by whoever imports the module."""
    functions = (each for each in ast.walk(ast.parse(source)) if isinstance(each, FUNCTION))
    return {line for each in functions for line in range(each.body[0].lineno, (each.end_lineno or 0) + 1)}


def _digest(*files: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def _is_in(file: str, where: Sequence[str]) -> bool:
    return any(file == each or file.startswith(f"{each.rstrip('/')}/") for each in where)


def _words(file: str) -> set[str]:
    """Return the words of a path, in the singular, without those that say nothing."""
    words = {each.removesuffix("s") for each in re.split(r"[/_.]", file)}
    return words - {PACKAGE, "py", "test", "command", "", "__init__"}


@dataclass(frozen=True, slots=True)
class Ran:
    """What became of a run: how many tests passed, and which failed."""

    passed: int
    failed: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Fate:
    """`killer`: the test that failed, or "" where the mutant survived the `passed` tests that ran, of the
    `reaching` ones that execute it.
    """

    mutant: Mutant
    killer: str
    passed: int
    reaching: int

    def text(self) -> str:
        """Return one line for people."""
        if self.killer:
            return f"killed    {self.mutant.text()}  [{self.killer}]"
        ran = f"{self.passed} of {self.reaching} tests" if self.reaching else "not executed"
        return f"SURVIVED  {self.mutant.text()}  [{ran}]"


@dataclass(slots=True)
class Limits:
    """Seconds for a mutant's tests altogether, as they took when recorded, and for one of them."""

    seconds: float
    test_seconds: float


@dataclass(slots=True)
class Workshop:
    """A copy of the tree in which tests are recorded and one mutant after another is made and tested."""

    root: Path
    copy: Path
    limits: Limits
    tests: Record
    stop: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        left_out = shutil.ignore_patterns(*NOT_COPIED)
        shutil.copytree(
            self.root,
            self.copy,
            ignore=lambda folder, names: left_out(folder, names) if Path(folder) == self.root else set(),
            symlinks=True,
        )

    def record(self, files: Sequence[str]) -> None:
        """Run test files and keep which line each test executes.

        Raises ToolFailure if they cannot be run.
        """
        name = _digest(*(self.copy / file for file in files))
        work = self.copy.parent / f"{self.copy.name}.record"
        site = work / "site"
        site.mkdir(parents=True)
        (site / "sitecustomize.py").write_text(EVERY_PROCESS)
        settings = work / "coveragerc"
        settings.write_text(COVERAGE.format(data=work / "lines", source=self.copy / PACKAGE))
        result = work / "tests.json"
        given = {
            "PYTHONPATH": os.pathsep.join((str(site), str(self.copy))),
            "COVERAGE_PROCESS_START": str(settings),
            "MUTANT_RECORD": str(result),
        }
        code = self._start(
            [sys.executable, "-m", "pytest", *PYTEST, "-p", "tools.line_record", *files], given, RECORD_S
        )
        if self.stop.is_set():
            return
        if code not in (0, 1) or not result.exists():
            raise ToolFailure(
                f"without a mutant, {files[0]} and others cannot be run: pytest ended with {code}"
            )
        self.tests.add(name, work.glob("lines.*"), json.loads(result.read_text()), files)
        shutil.rmtree(work)

    def judge(self, mutant: Mutant, left_out: Collection[str] = ()) -> Fate:
        """Return what the tests that execute a mutant make of it."""
        reaching = [each for each in self.tests.tests_of(mutant) if each not in left_out]
        chosen, seconds = [], 0.0
        for test in reaching:
            # A test that may take too long without a mutant cannot show that it takes too long with one.
            if self.tests.seconds[test] < self.limits.test_seconds / 4:
                seconds += self.tests.seconds[test]
                if seconds > self.limits.seconds:
                    break
                chosen.append(test)
        with made(self.copy, mutant):
            if is_c(mutant.file) and self._start([sys.executable, "-c", COMPILE], {}, COMPILE_S):
                return Fate(mutant, COMPILER, 0, len(reaching))
            ran = self.run(chosen, "-x")
        return Fate(mutant, ran.failed[0] if ran.failed else "", ran.passed, len(reaching))

    def run(self, tests: Sequence[str], *options: str) -> Ran:
        """Run tests in this order."""
        if not tests:
            return Ran(0, ())
        chosen, result = (self.copy.parent / f"{self.copy.name}.{name}.json" for name in ("tests", "result"))
        result.unlink(missing_ok=True)
        chosen.write_text(json.dumps(tests))
        given = {
            "MUTANT_TESTS": str(chosen),
            "MUTANT_RESULT": str(result),
            "MUTANT_TEST_SECONDS": str(self.limits.test_seconds),
        }
        files = dict.fromkeys(test.partition("::")[0] for test in tests)
        seconds = SLOWER * sum(self.tests.seconds[test] for test in tests)
        code = self._fork(
            [*PYTEST, *options, "-p", "tools.mutation_limits", *files],
            given,
            seconds + self.limits.test_seconds + GRACE_S,
        )
        found = json.loads(result.read_text()) if result.exists() else {}
        failed = found.get("failed", [])
        if not failed and code not in (0, NO_TESTS):  # a hang, a crash, or conftest.py cannot be imported
            failed = [found.get("running") or tests[0]]
        return Ran(found.get("passed", 0), tuple(failed))

    def _environment(self) -> dict[str, str]:
        return {"PYTHONPATH": str(self.copy), "XDG_CACHE_HOME": str(self.copy / ".cache")}

    def _start(self, command: Sequence[str], given: Mapping[str, str], seconds: float) -> int | None:
        """Run a process in the copy. Returns its exit code, or None where it had to be killed."""
        process = subprocess.Popen(
            command,
            cwd=self.copy,
            env={**os.environ, **self._environment(), **given},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY, MEMORY))
        return self._wait(process.pid, seconds)

    def _fork(self, arguments: Sequence[str], given: Mapping[str, str], seconds: float) -> int | None:
        """Run pytest in the copy, in a fork of this process. Returns as `_start` does."""
        pid = os.fork()
        if pid:
            return self._wait(pid, seconds)
        try:
            os.setsid()
            nowhere = os.open(os.devnull, os.O_RDWR)
            for stream in range(3):
                os.dup2(nowhere, stream)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            os.chdir(self.copy)
            os.environ.update({**self._environment(), **given})
            sys.path.insert(0, str(self.copy))
            for name in [each for each in sys.modules if each.partition(".")[0] in OF_THE_TREE]:
                del sys.modules[name]
            os._exit(int(import_module("pytest").main(list(arguments))))
        finally:
            os._exit(NOT_RUN)

    def _wait(self, pid: int, seconds: float) -> int | None:
        """Return a process's exit code; kill it, and what it started, where it takes longer: then None."""
        end = time.monotonic() + seconds
        try:
            while time.monotonic() < end and not self.stop.is_set():
                ended, status = os.waitpid(pid, os.WNOHANG)
                if ended:
                    pid = 0
                    return int(os.waitstatus_to_exitcode(status))
                time.sleep(POLL_S)
            return None
        finally:
            if pid:
                os.killpg(pid, signal.SIGKILL)
                os.waitpid(pid, 0)


@contextmanager
def made(root: Path, mutant: Mutant) -> Iterator[None]:
    """Keep the mutant in its file while the block runs; then the file is as it was, its date too, and the
    library beside it."""
    file = root / mutant.file
    source, dates = file.read_bytes(), file.stat()
    libraries = {each: each.read_bytes() for each in file.parent.glob("lib*.so")} if is_c(mutant.file) else {}
    try:
        file.write_bytes(source[: mutant.start] + mutant.new.encode() + source[mutant.end :])
        yield
    finally:
        file.write_bytes(source)
        for library, compiled in libraries.items():
            library.write_bytes(compiled)
        for each in file.parent.glob(f"__pycache__/{file.stem}.*.pyc"):
            each.unlink()
        os.utime(file, ns=(dates.st_atime_ns, dates.st_mtime_ns))


def judge_all(
    root: Path, mutants: Sequence[Mutant], limits: Limits, jobs: int, tests: Sequence[str], kept: Path
) -> tuple[list[Fate], set[str]]:
    """Judge mutants in `jobs` copies at once, printing each. Returns the fates and the tests that fail
    without a mutant.

    `tests` are the files and folders of tests that may judge; `kept` is the folder for what is recorded.
    """
    fates: list[Fate] = []
    stop = threading.Event()

    def judge(workshop: Workshop, mutant: Mutant) -> None:
        fate = workshop.judge(mutant)
        if not stop.is_set():
            fates.append(fate)
            print(f"{len(fates):4} {fate.text()}", flush=True)

    def recorded(workshop: Workshop, files: Sequence[str]) -> None:
        print(f"recording {files[0]} and {len(files) - 1} more", flush=True)
        workshop.record(files)

    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        record = Record(kept / _digest(*(root / PACKAGE).rglob("*.py")), root, tests)
        workshops = [Workshop(root, Path(folder) / f"copy{n}", limits, record, stop) for n in range(jobs)]
        _share(workshops, record.missing(), recorded, stop)
        _share(workshops, mutants, judge, stop)
        unsound = set() if stop.is_set() else _again_without(workshops[0], fates)
    return fates, unsound | record.failed


def _share(
    workshops: Sequence[Workshop],
    tasks: Iterable[Task],
    work: Callable[[Workshop, Task], None],
    stop: threading.Event,
) -> None:
    """Do tasks, each workshop one at a time, until all are done or `stop` is set, as Ctrl-C does.

    Raises the first exception that one of them has raised.
    """
    waiting: queue.SimpleQueue[Task] = queue.SimpleQueue()
    for each in tasks:
        waiting.put(each)
    failures: list[Exception] = []

    def share(workshop: Workshop) -> None:
        try:
            while not stop.is_set():
                work(workshop, waiting.get_nowait())
        except queue.Empty:
            pass
        except Exception as error:
            failures.append(error)
            stop.set()

    threads = [threading.Thread(target=share, args=(each,)) for each in workshops]
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


def _again_without(workshop: Workshop, fates: list[Fate]) -> set[str]:
    """Run the tests that killed without a mutant, and judge again what those killed that fail now."""
    unsound: set[str] = set()
    while killers := {each.killer for each in fates if each.killer and each.killer in workshop.tests.seconds}:
        failed = {*workshop.run(sorted(killers)).failed}
        if not failed:
            break
        unsound |= failed
        for index, fate in enumerate(fates):
            if fate.killer in failed:
                fates[index] = workshop.judge(fate.mutant, unsound)
                print(f"{index + 1:4} again: {fates[index].text()}", flush=True)
    return unsound


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
    parser.add_argument("--seconds", type=float, default=100, help="for a mutant's tests (default 100)")
    parser.add_argument("--test-seconds", type=float, default=60, help="for one test (default 60)")
    parser.add_argument(
        "--tests", nargs="+", default=["tests"], help="test files and folders (default tests)"
    )
    parser.add_argument("--list", action="store_true", help="print the mutants, run nothing")
    options = parser.parse_args(arguments)
    if min(options.count, options.jobs, options.seconds, options.test_seconds) <= 0:
        parser.error("--count, --jobs, --seconds and --test-seconds must be greater than 0")
    try:
        mutants = draw(ROOT, options.where, options.count, options.seed)
    except ValueError as error:
        parser.error(str(error))
    if options.list:
        print(*(each.text() for each in mutants), sep="\n")
        return 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    for name in SLOW_TO_IMPORT:
        import_module(name)
    limits = Limits(options.seconds, options.test_seconds)
    cache = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "servogen-mutants"
    try:
        fates, unsound = judge_all(ROOT, mutants, limits, options.jobs, options.tests, cache)
    except ToolFailure as error:
        print(error, file=sys.stderr)
        return 3
    print(*summary(fates), sep="\n")
    for test in sorted(unsound):
        print(f"fails without a mutant, too, and was left out: {test}")
    return 0 if all(each.killer for each in fates) else 1


if __name__ == "__main__":
    raise SystemExit(main())
