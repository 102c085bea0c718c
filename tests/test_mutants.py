"""tools/mutants.py: what it changes, what it draws, and that tests kill what they should."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("coverage", reason="the extra 'dev' is not installed as pyproject.toml has it now")

from tools.mutants import (
    COMPILE,
    ROOT,
    Fate,
    Limits,
    Mutant,
    Record,
    draw,
    judge_all,
    made,
    main,
    mutants_of,
    place_of,
    summary,
)

COUNTING = """\
def down(n):
    while n > 0:
        n -= 1
    return n


def unread(n):
    return n + 1


def unnoticed(n, step=2):
    return n - step


LIMIT = 7


def limited(n):
    return min(n, LIMIT)
"""

TESTS = """\
import subprocess
import sys

import pytest
from servogen.counting import down, limited, unnoticed


def test_down():
    assert down(3) == 0


def test_a_process():
    code = "from servogen.counting import down; print(down(1))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_that_sees_nothing():
    unnoticed(3)


def test_that_is_skipped():
    unnoticed(3)
    pytest.skip("not here")


def test_limit():
    assert limited(9) == 7


def test_that_always_fails():
    assert False
"""


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project of one module and one test file, of which one test fails whatever the module does."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # those of servogen are not in the toy
    root = tmp_path / "toy"
    for name in ("tests/time_limit.py", "tools/mutation_limits.py", "tools/line_record.py"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)
    (root / "servogen").mkdir()
    (root / "servogen" / "__init__.py").touch()
    (root / "servogen" / "counting.py").write_text(COUNTING)
    (root / "tests" / "test_counting.py").write_text(TESTS)
    return root


@pytest.mark.parametrize(
    ("source", "changes"),
    [
        ("x = a < b", ["(a <= b)"]),
        ("x = a == b", ["(a != b)"]),
        ("x = a is None", ["(a is not None)"]),
        ("x = a + b", ["(a - b)"]),
        ("x = a >> b", ["(a << b)"]),
        ("x = a and b", ["(a or b)"]),
        ("x = not a", ["(a)"]),
        ("x = -a", ["(a)"]),
        ("x = 7", ["8"]),
        ("x = 0.5", ["1.5"]),
        ("x = True", ["False"]),
        ("x = a if b else c", ["(c if b else a)"]),
        ("if a:\n    b = c", ["(not a)"]),
        ("f(a)", ["pass"]),
        ("a += b", ["pass"]),
        ("raise a", ["pass"]),
        ("def f():\n    return a", ["None"]),
        ("def f():\n    return True", ["False"]),
        ("def f():\n    return None", []),
        ("x = zip(a, b, strict=True)", []),
        ("def f(a: Literal[7] = b) -> Literal[7]: ...", []),
        ("def f():\n    return None", []),
        ("x = 'text'", []),
        ("x = f'{a + 1}'", []),
        ("if TYPE_CHECKING:\n    x = 7", []),
    ],
)
def test_each_kind_of_fault_is_made_and_no_other(source: str, changes: list[str]) -> None:
    assert [each.new.replace("not (a)", "not a") for each in mutants_of(source, "x.py")] == changes


@pytest.mark.parametrize(
    ("source", "changes"),
    [
        ("    if (a < b && *p)", ["if (a < b || *p)", "if (a <= b && *p)"]),
        ("    return a->x - -b;", ["return a->x + -b;"]),
        ("    s = 0x1F;", [";", "s = 32;"]),
        ("    *s = f(a,\n        b);", [";"]),
        ("    f(&a);", [";"]),
        ("    a->x[B] |= c << d;", [";", "a->x[B] |= c >> d;"]),
        ("    continue;", [";"]),
        ("    i64 *a = b;\n    Chip c;", []),
        ("    /* a < 1 */ // a < 1\n#if A < 1", []),
        ("    char c = '1', *d = \" < \";", []),
    ],
)
def test_each_kind_of_fault_is_made_in_c_and_no_other(source: str, changes: list[str]) -> None:
    """Of an operator and a number its line is shown as well."""
    text = f"\n{source}\n"
    for suffix in ("c", "h"):
        assert [each.new.strip() for each in mutants_of(text, f"x.{suffix}")] == changes


def test_every_mutant_of_a_module_is_another_program_that_can_be_parsed() -> None:
    file = ROOT / "servogen" / "report" / "drawing.py"  # has signs of more than one byte
    source = file.read_bytes()
    found = mutants_of(source.decode(), "servogen/report/drawing.py")
    assert len(found) > 100
    unchanged = ast.dump(ast.parse(source))
    for each in found:
        assert source[each.start : each.end].decode() == each.old
        assert f":{each.line}: " in each.text()
    for each in found[::4]:
        changed = (source[: each.start] + each.new.encode() + source[each.end :]).decode()
        assert ast.dump(ast.parse(changed)) != unchanged


def test_the_seed_and_the_packages_determine_the_draw(tmp_path: Path) -> None:
    for package in ("cli", "pic", "report", "simulator"):
        (tmp_path / "servogen" / package).mkdir(parents=True)
        for name in ("one", "two"):
            (tmp_path / "servogen" / package / f"{name}.py").write_text(COUNTING)
    first = draw(tmp_path, ["cli", "report"], 10, 1)
    assert first == draw(tmp_path, ["report", "cli"], 10, 1) != draw(tmp_path, ["cli", "report"], 10, 2)
    assert {each.package for each in first} == {"cli", "report"}
    assert {each.package for each in draw(tmp_path, ["core"], 1000, 1)} == {"pic", "simulator"}
    with pytest.raises(ValueError, match="'clii' is not"):
        draw(tmp_path, ["clii"], 1, 1)


@pytest.mark.parametrize(
    ("line", "lines", "names"),
    [
        (1, set(), {"LIMIT"}),
        (4, {5, 6, 7, 8, 9, 10, 18}, set()),  # a default: whoever calls the function or registers it
        (5, {5}, set()),
        (6, {6}, set()),
        (9, {7, 8, 9, 10}, set()),  # any line of the statement
        (14, set(), {"size", "Box"}),
        (18, {18}, set()),
    ],
)
def test_a_mutant_is_reached_by_who_executes_its_statement(
    line: int, lines: set[int], names: set[str]
) -> None:
    source = """\
LIMIT = 7


def limited(n, least=2):
    if n > LIMIT:
        return least
    return n + min(
        n,
        LIMIT,
    )


class Box:
    size = 3


def register(app):
    app.command()(limited)
"""
    place = place_of(source, line)
    assert (place.lines, place.names) == (lines, names)


@pytest.mark.parametrize(
    "source",
    [
        "ROWS = (1, 2)\nTABLE = {row: row for row in ROWS}\n",
        "class Row:\n    key: int = 1\n\nclass TABLE:\n    rows: list[Row]\n",
    ],
)
def test_a_table_that_no_function_reads_is_judged_by_the_tests_that_read_it(
    toy: Path, tmp_path: Path, source: str
) -> None:
    """Or what is made from it; a test of another package may use the same name for something else."""
    (toy / "servogen" / "tables").mkdir()
    (toy / "servogen" / "tables" / "table.py").write_text(source)
    reader, other = (f"tests/test_{name}.py" for name in ("reader", "other"))
    (toy / reader).write_text("from servogen.tables.table import TABLE\ndef test_it(): assert 1 in TABLE\n")
    (toy / other).write_text("TABLE = 7\ndef test_it(): assert TABLE\n")
    record = Record(tmp_path, toy)
    for file in (reader, other):
        record.recorded.add(file)
        record.seconds[f"{file}::test_it"] = 1.0
    changed = next(each for each in mutants_of(source, "servogen/tables/table.py") if each.old == "1")
    assert record.tests_of(changed) == [f"{reader}::test_it"]


def test_a_line_that_is_not_seen_runs_in_all_tests_of_its_package(toy: Path, tmp_path: Path) -> None:
    """Those of processes that may write no file never are."""
    record = Record(tmp_path, toy)
    tests = ["tests/report/test_it.py::test", "tests/test_isolation.py::test"]
    record.seconds = dict.fromkeys(tests, 1.0)
    source = "def loop():\n    def run(n):\n        return n + 1\n    return run\n"
    for module, expected in (
        ("isolation.py", tests[1:]),
        ("report/core.py", []),
    ):
        file = toy / "servogen" / module
        file.parent.mkdir(exist_ok=True)
        file.write_text(source)
        mutants = mutants_of(source, f"servogen/{module}")
        added = next(each for each in mutants if each.old == "n + 1")
        assert record.tests_of(added) == expected


@pytest.mark.campaign
def test_killed_are_what_a_test_notices_and_what_hangs_and_nothing_else(
    toy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The test that always fails kills nothing; where no test executes a line, none runs for it."""
    every = {(each.old, each.new): each for each in mutants_of(COUNTING, "servogen/counting.py")}
    wrong, hanging = every["n > 0", "(n >= 0)"], every["n -= 1", "pass"]
    unread, unnoticed = every["n + 1", "(n - 1)"], every["n - step", "(n + step)"]
    default, constant = every["2", "3"], every["7", "8"]
    drawn = [wrong, hanging, unread, unnoticed, default, constant]
    before = {path: path.read_bytes() for path in toy.rglob("*") if path.is_file()}

    def judged(drawn: list[Mutant], seconds: float) -> dict[Mutant, tuple[str, int, int]]:
        fates, unsound = judge_all(toy, drawn, Limits(60, seconds), 1, ["tests"], tmp_path / "kept")
        assert unsound == {"tests/test_counting.py::test_that_always_fails"}
        return {each.mutant: (each.killer.rpartition("::")[2], each.passed, each.reaching) for each in fates}

    expected = {
        wrong: ("test_down", 0, 4),
        hanging: ("test_down", 0, 4),
        unread: ("", 0, 0),
        unnoticed: ("", 4, 4),
        default: ("", 4, 4),
        constant: ("test_limit", 0, 4),
    }
    # A slow machine needs seconds for the test's own process, and one that hangs takes all of its time.
    drawn.remove(hanging)
    assert judged(drawn, 60) | judged([hanging], 3) == expected
    assert {path: path.read_bytes() for path in toy.rglob("*") if path.is_file()} == before
    assert "recording tests/test_counting.py" in capsys.readouterr().out
    assert judged([constant], 60) == {constant: expected[constant]}
    assert "recording" not in capsys.readouterr().out  # the tests are as they were


@pytest.mark.campaign
def test_a_mutant_of_c_is_compiled_for_its_tests_only(toy: Path, tmp_path: Path) -> None:
    """What the compiler refuses is killed, and the library is as it was."""
    part = toy / "servogen" / "checker"
    part.mkdir()
    source = 'int twice(int n)\n{\n    _Static_assert(2 > 1, "two");\n    return n + n;\n}\n'
    (part / "chip.c").write_text(source)
    (part / "chip.py").write_text(
        "import ctypes\nfrom pathlib import Path\nLIBRARY = str(Path(__file__).with_name('libchip.so'))\n"
        "def twice(n):\n    return ctypes.CDLL(LIBRARY).twice(n)\n"
    )
    (toy / "servogen" / "native.py").write_text(
        "import subprocess\nfrom pathlib import Path\nclass Part:\n    def refresh(self):\n"
        "        command = 'cc -shared -fPIC -o libchip.so chip.c'\n"
        "        subprocess.run(command.split(), cwd=Path(__file__).parent / 'checker', check=True)\n"
        "def parts():\n    return [Part()]\n"
    )
    subprocess.run([sys.executable, "-c", COMPILE], cwd=toy, check=True)
    (toy / "tests" / "test_counting.py").write_text(
        "from servogen.checker.chip import twice\ndef test_twice(): assert twice(4) == 8\n"
    )
    compiled = (part / "libchip.so").read_bytes()
    every = mutants_of(source, "servogen/checker/chip.c")
    drawn = [each for each in every if "n - n" in each.new or "2 > 2" in each.new]
    fates, unsound = judge_all(toy, drawn, Limits(60, 60), 1, ["tests"], tmp_path / "kept")
    assert (unsound, [each.killer for each in fates]) == (
        set(),
        ["the compiler", "tests/test_counting.py::test_twice"],
    )
    with made(toy, drawn[1]):
        subprocess.run([sys.executable, "-c", COMPILE], cwd=toy, check=True)
        assert (part / "libchip.so").read_bytes() != compiled
    assert (part / "libchip.so").read_bytes() == compiled


def test_a_test_file_that_changed_is_recorded_again(toy: Path, tmp_path: Path) -> None:
    record = Record(tmp_path, toy)
    assert record.missing() == [["tests/test_counting.py"]]
    test = "tests/test_counting.py::test_down"
    record.add("one", [], {"passed": {"c": [test, 0.5]}, "failed": []}, ["tests/test_counting.py"])
    again = Record(tmp_path, toy)
    assert (again.missing(), again.seconds) == ([], {test: 0.5})
    (toy / "tests" / "test_counting.py").write_text(TESTS + "\n")
    changed = Record(tmp_path, toy)
    assert (changed.missing(), changed.seconds) == ([["tests/test_counting.py"]], {})
    assert Record(tmp_path, toy, ["tests/other"]).missing() == []


def test_a_mutant_is_in_its_file_only_while_it_is_judged(toy: Path) -> None:
    file = toy / "servogen" / "counting.py"
    date = file.stat().st_mtime_ns
    (mutant,) = (each for each in mutants_of(COUNTING, "servogen/counting.py") if each.new == "(n - 1)")
    with made(toy, mutant):
        assert file.read_text() == COUNTING.replace("n + 1", "(n - 1)")
    assert (file.read_text(), file.stat().st_mtime_ns) == (COUNTING, date)


def test_rates_are_counted_for_each_package() -> None:
    one, two = (Mutant(f"servogen/{name}/x.py", 1, 0, 1, "1", "2") for name in ("cli", "report"))
    fates = [Fate(one, "", 3, 3), Fate(one, "a test", 3, 9), Fate(two, "a test", 3, 9)]
    assert [line.split() for line in summary(fates)] == [
        ["cli", "1", "of", "2", "killed", "50.0%"],
        ["report", "1", "of", "1", "killed", "100.0%"],
        ["all", "2", "of", "3", "killed", "66.7%"],
    ]


@pytest.mark.parametrize("wrong", [("--count", "0"), ("nowhere",), ("--seconds", "-1")])
def test_a_wrong_command_line_is_exit_code_2(wrong: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(wrong)
    assert ended.value.code == 2
