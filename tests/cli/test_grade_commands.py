"""What `grade` shows, writes and ends with, of grades made by hand."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen import grade as grade_package
from servogen.cli.grade_commands import Browsing, GradeFiles
from servogen.errors import Diagnostic, InputError, Location, ToolError
from servogen.grade import formats, points
from servogen.workflows import grading
from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in

NEXT = "next: open p/index.html, or grade again with --watch"


def graded(name: str, passed: bool = True, defect: Any = None, reasons: tuple[str, ...] = ()) -> Any:
    remarks = [SimpleNamespace(sentence="a remark")]
    grade = SimpleNamespace(
        passed=passed, reasons=list(reasons), remarks=remarks, film=None, to_json=lambda: {"passed": passed}
    )
    return SimpleNamespace(
        submission=SimpleNamespace(name=name, file=Path(f"{name}.c")), grade=grade, defect=defect, code=""
    )


OUTCOMES = [
    SimpleNamespace(key="runs", state="passed", points=2.0, max_points=2.0),
    SimpleNamespace(key="pauses", state="failed", points=0.0, max_points=1.5),
]


@pytest.fixture
def grading_of(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """`grade` grades seen["graded"]; what it is asked."""
    lab = SimpleNamespace(name="lab", title="Lab", task="Do it")
    task = SimpleNamespace(lab=lab)
    seen: dict[str, Any] = {
        "graded": [graded("anna")],
        "tables": [],
        "warnings": (),
        "errors": (),
        "served": None,
    }

    def of(lab: Any, read: Any, timeout: float, memory: int) -> Any:
        seen["limits"] = (timeout, memory)
        return task

    def find(files: Any, sources: Any, images: Any, level: int) -> Any:
        seen["level"], seen["images"], seen["sources"] = level, images, sources
        if "refused" in seen:
            raise seen["refused"]
        submissions = [each.submission for each in seen["graded"]]
        return SimpleNamespace(submissions=submissions, warnings=seen["warnings"], errors=seen["errors"])

    def submissions(found: Any, task: Any, scheduler: Any, tell: Any) -> Any:
        seen["scheduler"] = scheduler
        return seen["graded"]

    stand_in(monkeypatch, grading, "GradingTask", SimpleNamespace(of=of))
    stand_in(monkeypatch, grading, "grade_submissions", submissions)
    stand_in(monkeypatch, grade_package, "load_lab", lambda name: name)
    stand_in(monkeypatch, grade_package, "find_submissions", find)
    stand_in(monkeypatch, grade_package, "page_names", lambda names: [f"{name}.md" for name in names])
    stand_in(monkeypatch, grade_package, "shown_name", lambda name: name)
    stand_in(monkeypatch, points, "outcomes", lambda lab, grade: OUTCOMES)
    stand_in(monkeypatch, "servogen.cli.show", "table", lambda *given: seen["tables"].append(given))
    stand_in(monkeypatch, "servogen.isolation", "missing_limits", lambda: seen.get("limits_missing", ""))
    stand_in(monkeypatch, formats, "csv_text", lambda lab, entries: f"csv {len(entries)}\n")
    stand_in(monkeypatch, formats, "junit_xml", lambda lab, entries: f"junit {len(entries)}\n")
    for name in ("gradescope", "classroom"):
        stand_in(monkeypatch, formats, f"{name}_json", lambda lab, entry, kind=name: f"{kind} {entry.name}")
        stand_in(
            monkeypatch, formats, f"{name}_without_program", lambda lab, why, kind=name: f"{kind}: {why}"
        )
    monkeypatch.chdir(tmp_path)
    return seen


def test_the_table_has_verdicts_points_and_reasons(run: Run, grading_of: dict[str, Any]) -> None:
    reasons = ("first line\n   second line\nthird line", "another")
    grading_of["graded"] = [graded("anna"), graded("ben", False, None, reasons)]
    ran = run("grade", "lab", "a.c")
    assert (ran.code, ran.out) == (1, "1 of 2 passed\n")
    rows = [
        ("anna", "passed", "2 of 3.5", "a remark"),
        ("ben", "NOT PASSED", "2 of 3.5", "first line second line\nanother"),
    ]
    columns = ("program", "verdict", "points", "why, or what is good to know")
    assert grading_of["tables"] == [("Lab: Do it", columns, rows)]


def test_the_defaults_of_grade_are_the_documented_ones(run: Run, grading_of: dict[str, Any]) -> None:
    """docs/grading.md: 120 s and 300 MB a program; students' folders one level below a given one."""
    run("grade", "lab", "a.c")
    assert (grading_of["limits"], grading_of["level"], grading_of["scheduler"]) == ((120.0, 300), 1, None)
    run("grade", "lab", "a.c", "--timeout", 5, "--memory-mb", 77, "--level", 0, "--scheduler", "tcp://x")
    assert (grading_of["limits"], grading_of["level"], grading_of["scheduler"]) == ((5.0, 77), 0, "tcp://x")
    assert ".obj" not in grading_of["images"]
    assert ".hex" in grading_of["images"]
    assert set(grading_of["sources"]).isdisjoint({".hex", ".obj"})
    assert ".c" in grading_of["sources"]


@pytest.mark.parametrize(
    ("results", "code"),
    [
        ([graded("a")], 0),
        ([graded("a"), graded("b", False)], 1),
        ([graded("a"), graded("b", False, "broken")], 3),
        ([graded("a", True, "broken")], 3),
    ],
)
def test_the_exit_code_of_grade(run: Run, grading_of: dict[str, Any], results: list[Any], code: int) -> None:
    grading_of["graded"] = results
    assert run("grade", "lab", "a.c").code == code
    shown = run("grade", "lab", "a.c", "--json")
    assert (shown.code, len(shown.out.splitlines())) == (code, 1)
    grading_of["errors"] = (Diagnostic("error", "no-program", "gone", Location("x.c")),)
    beside = run("grade", "lab", "a.c", "x.c")
    assert (beside.code, beside.err) == (max(code, 2), "x.c: error: gone [no-program]\n")


def test_the_json_of_grade_has_points_and_perhaps_pages(
    run: Run, grading_of: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = json.loads(run("grade", "lab", "a.c", "--json").out)
    (program,) = found.pop("programs")
    assert found == {"diagnostics": [], "lab": "lab", "title": "Lab", "task": "Do it", "same_code": []}
    assert program == {
        "program": "anna",
        "file": "anna.c",
        "passed": True,
        "points": 2.0,
        "max_points": 3.5,
        "checks": {
            "runs": {"state": "passed", "points": 2.0, "max_points": 2.0},
            "pauses": {"state": "failed", "points": 0.0, "max_points": 1.5},
        },
    }
    assert grading_of["tables"] == []
    stand_in(monkeypatch, "servogen.cli.grade_commands", "_write_pages", lambda *_: None)
    with_pages = json.loads(run("grade", "lab", "a.c", "--pages", "p", "--json").out)
    assert with_pages["programs"][0]["page"] == "anna.md"


def test_a_page_that_cannot_be_written_fails_after_all_is_shown(
    run: Run, grading_of: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(
        monkeypatch,
        "servogen.cli.grade_commands",
        "_write_pages",
        lambda *_: ToolError("write-failed", "full"),
    )
    ran = run("grade", "lab", "a.c", "--pages", "p")
    assert (ran.code, ran.out, "full" in ran.err) == (3, f"1 of 1 passed\n{NEXT}\n", True)


def test_warnings_name_files_without_their_folders(
    run: Run, grading_of: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch, grade_package, "visible", lambda name: f"<{name}>")
    grading_of["warnings"] = (
        Diagnostic("warning", "one", "text", Location("a.c")),
        Diagnostic("warning", "two", "text"),
        Diagnostic("warning", "three", "text", Location(key="k")),
    )
    grading_of["limits_missing"] = "no limits here"
    ran = run("grade", "lab", "a.c")
    lines = ran.err.splitlines()
    assert [line.rsplit(" ", 1)[-1] for line in lines] == ["[no-limits]", "[one]", "[two]", "[three]"]
    assert ["<a.c>" in line for line in lines] == [False, True, False, False]
    grading_of["limits_missing"] = ""
    assert "[no-limits]" not in run("grade", "lab", "a.c").err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--watch", "--json"), "--watch prints an address: without --json"),
        (("--port", 8000), "--port is for --watch"),
    ],
)
def test_options_of_the_server_are_for_the_server(
    run: Run, grading_of: dict[str, Any], words: tuple[object, ...], message: str
) -> None:
    ran = run("grade", "lab", "a.c", *words)
    assert (ran.code, message in ran.err, "limits" in grading_of) == (2, True, False)


@pytest.mark.parametrize("watch", [True, False])
def test_the_pages_are_served_only_if_asked_for(
    run: Run, grading_of: dict[str, Any], monkeypatch: pytest.MonkeyPatch, watch: bool
) -> None:
    served: list[Any] = []
    stand_in(monkeypatch, "servogen.cli.page_server", "require_server", lambda: served.append("required"))
    stand_in(
        monkeypatch,
        "servogen.cli.grade_commands",
        "_serve",
        lambda task, names, *given: served.append((names, *given[1:])),
    )
    run("grade", "lab", "a.c", *(("--watch", "--port", 8000, "--no-browser") if watch else ()))
    assert served == (["required", (["anna.md"], Browsing(True, 8000, False))] if watch else [])
    if watch:
        served.clear()
        run("grade", "lab", "a.c", "--watch")
        assert served == ["required", (["anna.md"], Browsing(True))]


def test_an_empty_hand_in_has_its_files_too(run: Run, grading_of: dict[str, Any]) -> None:
    """Only for that reason; every other error writes nothing."""
    grading_of["refused"] = InputError("no-program", "nothing there")
    ran = run("grade", "lab", "a", "--gradescope", "g.json", "--classroom", "c.json")
    assert (ran.code, "nothing there" in ran.err) == (2, True)
    assert Path("g.json").read_text() == "gradescope: no program was handed in"
    assert Path("c.json").read_text() == "classroom: no program was handed in"
    grading_of["refused"] = InputError("other", "nothing there")
    assert run("grade", "lab", "a", "--gradescope", "h.json").code == 2
    assert not Path("h.json").exists()


def test_one_program_has_one_file_and_several_have_a_reason(run: Run, grading_of: dict[str, Any]) -> None:
    words = ("--csv", "a.csv", "--junit", "a.xml", "--gradescope", "g.json", "--classroom", "c.json")
    assert run("grade", "lab", "a.c", *words).code == 0
    files = {name: Path(name).read_text() for name in ("a.csv", "a.xml", "g.json", "c.json")}
    assert files == {
        "a.csv": "csv 1\n",
        "a.xml": "junit 1\n",
        "g.json": "gradescope anna",
        "c.json": "classroom anna",
    }
    grading_of["graded"] = [graded("anna"), graded("ben")]
    ran = run("grade", "lab", "a.c", *words)
    several = "2 programs were handed in, where one is graded: anna, ben"
    assert (ran.code, several in ran.err) == (2, True)
    assert Path("g.json").read_text() == f"gradescope: {several}"
    assert Path("c.json").read_text() == f"classroom: {several}"
    assert Path("a.csv").read_text() == "csv 2\n"


def test_several_programs_have_a_folder_of_files(run: Run, grading_of: dict[str, Any]) -> None:
    grading_of["graded"] = [graded("anna"), graded("ben")]
    assert run("grade", "lab", "a.c", "--gradescope", "g", "--classroom", "c").code == 0
    texts = {str(path): path.read_text() for path in sorted(Path().glob("?/[!.]*"))}
    assert texts == {
        "c/anna.json": "classroom anna",
        "c/ben.json": "classroom ben",
        "g/anna.json": "gradescope anna",
        "g/ben.json": "gradescope ben",
    }


@pytest.mark.parametrize(
    ("gradescope", "classroom", "one"),
    [
        (None, None, False),
        ("g.json", None, True),
        (None, "c.json", True),
        ("g", "c", False),
        ("g", "c.json", True),
    ],
)
def test_a_json_file_holds_one_program(gradescope: str | None, classroom: str | None, one: bool) -> None:
    paths = [None if name is None else Path(name) for name in (gradescope, classroom)]
    assert GradeFiles(None, None, *paths).wants_one is one
