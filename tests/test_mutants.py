"""tools/mutants.py: what it changes, what it draws, and that tests kill what they should."""

from __future__ import annotations

import ast
import shutil
from pathlib import Path

import pytest

from tools.mutants import ROOT, Fate, Limits, Mutant, Reach, draw, judge_all, made, main, mutants_of, summary

COUNTING = """\
def down(n):
    while n > 0:
        n -= 1
    return n


def unread(n):
    return n + 1
"""

TESTS = """\
from servogen.counting import down


def test_down():
    assert down(3) == 0


def test_that_always_fails():
    assert False
"""


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project of one module and one test file, of which one test fails whatever the module does."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # those of servogen are not in the toy
    root = tmp_path / "toy"
    for name in ("tests/time_limit.py", "tools/mutation_limits.py"):
        (root / name).parent.mkdir(parents=True)
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
        ("def f(a: Literal[7] = b) -> Literal[7]: ...", []),
        ("def f():\n    return None", []),
        ("x = 'text'", []),
        ("x = f'{a + 1}'", []),
        ("if TYPE_CHECKING:\n    x = 7", []),
    ],
)
def test_each_kind_of_fault_is_made_and_no_other(source: str, changes: list[str]) -> None:
    assert [each.new.replace("not (a)", "not a") for each in mutants_of(source, "x.py")] == changes


def test_every_mutant_of_a_module_is_another_program_that_can_be_parsed() -> None:
    file = ROOT / "servogen" / "report" / "drawing.py"  # has signs of more than one byte
    source = file.read_bytes()
    found = mutants_of(source.decode(), "servogen/report/drawing.py")
    assert len(found) > 100
    for each in found:
        assert source[each.start : each.end].decode() == each.old
        changed = (source[: each.start] + each.new.encode() + source[each.end :]).decode()
        assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(source))
        assert f":{each.line}: " in each.text()


def test_the_seed_and_the_packages_determine_the_draw() -> None:
    first = draw(ROOT, ["cli", "report"], 30, 1)
    assert first == draw(ROOT, ["report", "cli"], 30, 1) != draw(ROOT, ["cli", "report"], 30, 2)
    assert {each.package for each in first} == {"cli", "report"}
    assert not {each.package for each in draw(ROOT, ["core"], 200, 1)} & {"cli", "report"}
    with pytest.raises(ValueError, match="'clii' is not"):
        draw(ROOT, ["clii"], 1, 1)


def test_the_nearest_tests_come_first_and_those_that_do_not_reach_it_not_at_all(toy: Path) -> None:
    assert Reach(ROOT).tests_of("servogen/drive/sweep.py")[0] == "tests/drive/test_sweep.py"
    (toy / "tests" / "test_other.py").write_text("import json\n")
    assert Reach(toy).tests_of("servogen/counting.py") == ["tests/test_counting.py"]


def test_killed_are_what_a_test_notices_and_what_hangs_and_nothing_else(toy: Path) -> None:
    """The test that always fails kills nothing."""
    every = {(each.old, each.new): each for each in mutants_of(COUNTING, "servogen/counting.py")}
    wrong, hanging = every["n > 0", "(n >= 0)"], every["n -= 1", "pass"]
    unread = every["n + 1", "(n - 1)"]
    before = {path: path.read_bytes() for path in toy.rglob("*") if path.is_file()}
    fates, unsound = judge_all(toy, [wrong, hanging, unread], Limits(60, 3), 1)
    assert {each.mutant: each.killer.rpartition("::")[2] for each in fates} == {
        wrong: "test_down",
        hanging: "test_down",
        unread: "",
    }
    assert unsound == {"tests/test_counting.py::test_that_always_fails"}
    assert {path: path.read_bytes() for path in toy.rglob("*") if path.is_file()} == before


def test_a_mutant_is_in_its_file_only_while_it_is_judged(toy: Path) -> None:
    file = toy / "servogen" / "counting.py"
    date = file.stat().st_mtime_ns
    (mutant,) = (each for each in mutants_of(COUNTING, "servogen/counting.py") if each.new == "(n - 1)")
    with made(toy, mutant):
        assert file.read_text() == COUNTING.replace("n + 1", "(n - 1)")
    assert (file.read_text(), file.stat().st_mtime_ns) == (COUNTING, date)


def test_rates_are_counted_for_each_package() -> None:
    one, two = (Mutant(f"servogen/{name}/x.py", 1, 0, 1, "1", "2") for name in ("cli", "report"))
    fates = [Fate(one, "", 3, False), Fate(one, "a test", 3, False), Fate(two, "a test", 3, False)]
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
