"""tools/changed_tests.py: which tests a change reaches, in which order, and what it leaves out."""

import subprocess
from pathlib import Path

import pytest

from tools import changed_tests
from tools.changed_tests import changed_files, main, nearest_tests

TREE = {
    "servogen/__init__.py": "",
    "servogen/leaf.py": "",
    "servogen/room/__init__.py": "",
    "servogen/room/user.py": "def late():\n    from servogen.leaf import x\n",
    "servogen/room/far.py": "from servogen.room import user\n",
    "servogen/room/table.py": 'ROWS = ("far",)\n',
    "servogen/aside.py": "",
    "servogen/pages.py": 'PAGE = "pages/page.j2"\n',
    "templates/pages/page.j2": "",
    "tests/conftest.py": "",
    "tests/room/conftest.py": 'START = "from servogen.room.table import x"\n',
    "tests/room/test_room.py": "",
    "tests/test_aside.py": "import servogen.aside\n",
    "tests/test_far.py": "from servogen.room.far import x\n",
    "tests/test_leaf_itself.py": 'CALLED = "python -m servogen.room.far"\n',
    "tests/test_near.py": "import servogen.leaf\n",
    "tests/test_pages.py": "from servogen import pages\n",
}


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name, text in TREE.items():
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return tmp_path


def reached(tree: Path, *changed: str) -> list[str]:
    return [Path(file).stem for _, file in nearest_tests(tree, changed)]


def test_the_tests_that_bear_the_name_are_first_and_then_the_nearest(tree: Path) -> None:
    """leaf < user < far < table, which names far, < conftest of room."""
    assert nearest_tests(tree, ["servogen/leaf.py"]) == [
        (3, "tests/test_leaf_itself.py"),
        (1, "tests/test_near.py"),
        (3, "tests/test_far.py"),
        (5, "tests/room/test_room.py"),
    ]


def test_what_does_not_import_it_is_not_run(tree: Path) -> None:
    assert reached(tree, "servogen/aside.py") == ["test_aside"]
    assert reached(tree, "servogen/room/table.py") == ["test_room"]
    assert reached(tree) == []


def test_a_test_reaches_itself_and_a_conftest_what_is_below_it(tree: Path) -> None:
    assert reached(tree, "tests/test_near.py") == ["test_near"]
    assert reached(tree, "tests/room/conftest.py") == ["test_room"]
    assert len(reached(tree, "tests/conftest.py")) == 6


def test_a_module_that_is_gone_is_still_missed_by_its_importers(tree: Path) -> None:
    (tree / "servogen/aside.py").unlink()
    assert reached(tree, "servogen/aside.py") == ["test_aside"]


def test_what_is_not_python_reaches_who_names_it(tree: Path) -> None:
    assert reached(tree, "templates/pages/page.j2") == ["test_pages"]
    assert reached(tree, "templates/pages/another.j2") == ["test_pages"]
    assert reached(tree, "docs/another.md") == []


def git(folder: Path, *words: str) -> None:
    identity = ("-c", "user.name=n", "-c", "user.email=e", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True)


def test_changed_is_what_differs_from_where_the_branch_began(
    tree: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    git(tree, "init", "--initial-branch=main")
    git(tree, "add", ".")
    git(tree, "commit", "-m", "1")
    assert changed_files(tree) == []
    git(tree, "switch", "-c", "branch")
    (tree / "servogen/leaf.py").write_text("x = 1\n")
    git(tree, "commit", "-am", "2")
    git(tree, "switch", "main")
    (tree / "servogen/pages.py").write_text("")
    git(tree, "commit", "-am", "3")
    git(tree, "switch", "branch")
    (tree / "servogen/aside.py").write_text("y = 2\n")
    (tree / "tests/test_new.py").write_text("")
    assert changed_files(tree) == ["servogen/aside.py", "servogen/leaf.py", "tests/test_new.py"]

    monkeypatch.setattr(changed_tests, "ROOT", tree)
    monkeypatch.setattr("sys.argv", ["changed_tests.py", "--list"])
    assert main() == 0
    said, *files = capsys.readouterr().out.splitlines()
    assert said == "3 changed files, which 6 test files import"
    assert files[:2] == ["  1 tests/test_aside.py", "  3 tests/test_leaf_itself.py"]
    assert "  0 tests/test_new.py" in files
