"""The samples for VS Code: the tasks run, and their problem matcher finds what servogen reports."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.bench.conftest import Ran, Run, run  # noqa: F401 - a fixture

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / ".vscode"
TASKS: list[dict[str, Any]] = json.loads((FOLDER / "tasks.json").read_text())["tasks"]
JOB = (ROOT / "jobs" / "lab8-exercise.toml").read_text("utf-8")

C = """#include <xc.h>
void main(void) {
    unsigned char n = 300;
    n = bad;
    m = 1;
}
"""
ASSEMBLY = """    list p=16f84
    movlw 5
    movfw nowhere
    end
"""


def task(label: str) -> dict[str, Any]:
    (found,) = (each for each in TASKS if label in each["label"])
    return found


Start = Callable[[str, Path, str], Ran]


@pytest.fixture
def ran(run: Run, monkeypatch: pytest.MonkeyPatch) -> Start:  # noqa: F811
    """Run a task on a file, with the variables that VS Code replaces."""

    def start(label: str, folder: Path, file: str) -> Ran:
        variables = {
            "file": str(folder / file),
            "fileDirname": str(folder),
            "fileBasenameNoExtension": Path(file).stem,
            "workspaceFolder": str(folder),
        }
        given = task(label)
        arguments = [
            re.sub(r"\$\{(\w+)\}", lambda found: variables[found[1]], each) for each in given["args"]
        ]
        assert given["command"] == "servogen"
        monkeypatch.chdir(folder)
        return run(*arguments)

    return start


def problems(label: str, output: str) -> list[dict[str, str]]:
    """Return what the task's problem matcher finds in the lines of its output."""
    pattern = task(label)["problemMatcher"]["pattern"]
    groups = {name: number for name, number in pattern.items() if name != "regexp"}
    found = (re.search(pattern["regexp"], line) for line in output.splitlines())
    return [{name: match[number] for name, number in groups.items()} for match in found if match]


WRONG = [
    ("check the job", "arm.toml", JOB.replace('"RB0"', '"RB9"'), [("error", "unknown-pin", '"RB9"')]),
    ("build the job", "arm.toml", JOB.replace("repeat", "repeet"), [("error", "unknown-key", "repeet")]),
    ("compile the C", "main.c", C, [("error", "c-undeclared", "bad"), ("error", "c-undeclared", "m = 1")]),
    ("assemble", "main.asm", ASSEMBLY, [("error", None, "nowhere")]),
]


@pytest.mark.parametrize(("label", "name", "text", "expected"), WRONG, ids=[each[0] for each in WRONG])
def test_the_problem_matcher_finds_every_problem_at_its_place(
    ran: Start, tmp_path: Path, label: str, name: str, text: str, expected: list[tuple[str, str | None, str]]
) -> None:
    (tmp_path / name).write_text(text, "utf-8")
    done = ran(label, tmp_path, name)
    assert done.code == 2
    found = [each for each in problems(label, done.err) if each["severity"] == "error"]
    assert len(found) == len(expected), done.err
    for each, (severity, code, word) in zip(found, expected, strict=True):
        assert each["file"] == str(tmp_path / name)
        assert word in text.splitlines()[int(each["line"]) - 1]
        assert each["severity"] == severity and each["code"] == (code or each["code"])
        assert int(each["column"] or 1) >= 1 and each["message"]
    reported = re.findall(r"^.*\b(?:error|warning|note): .*\]$", done.err, re.M)
    assert len(problems(label, done.err)) == len(reported), "a line that the matcher does not find"


def test_a_warning_is_found_too(ran: Start, tmp_path: Path) -> None:
    text = "#include <xc.h>\nvoid main(void) { PORTB = 0x1FF; while (1) ; }\n"
    (tmp_path / "main.c").write_text(text)
    done = ran("compile the C", tmp_path, "main.c")
    assert done.code == 0
    assert {each["severity"] for each in problems("compile the C", done.err)} == {"warning"}, done.err


def test_a_right_file_has_no_problems_and_the_task_writes_what_it_says(ran: Start, tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(JOB, "utf-8")
    done = ran("check the job", tmp_path, "arm.toml")
    assert done.code == 0 and problems("check the job", done.out + done.err) == []
    (tmp_path / ".vscode").mkdir()
    assert ran("schema of job files", tmp_path, "arm.toml").code == 0
    associations = json.loads((FOLDER / "settings.json").read_text())["evenBetterToml.schema.associations"]
    ((pattern, schema),) = associations.items()
    assert (tmp_path / schema).is_file()
    assert re.search(pattern, str(ROOT / "jobs" / "lab8-exercise.toml"))
    assert re.search(pattern, r"C:\robots\jobs\arm.toml")
    assert not re.search(pattern, str(ROOT / "pyproject.toml"))
