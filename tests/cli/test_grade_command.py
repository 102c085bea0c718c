"""`servogen grade`: table, JSON, pages and exit codes."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

PROGRAMS = Path(__file__).parents[1] / "grade" / "programs"

Run = Callable[..., Any]


def test_a_right_program_passes_with_exit_code_0(run: Run) -> None:
    ran = run("grade", "lab8-exercise", PROGRAMS / "lab8-right" / "delays.c")
    assert ran.code == 0
    assert "1 of 1 passed" in ran.out


def test_a_folder_is_graded_in_parallel_with_a_page_for_each(run: Run, tmp_path: Path) -> None:
    for folder, name in (("lab8-right", "held.c"), ("lab8-wrong", "pause.c"), ("lab8-wrong", "syntax.c")):
        (tmp_path / "class" / name[0]).mkdir(parents=True)
        shutil.copy(PROGRAMS / folder / name, tmp_path / "class" / name[0] / "main.c")
    ran = run("grade", "lab8-exercise", tmp_path / "class", "--json", "--pages", tmp_path / "pages")
    assert ran.code == 1
    programs = json.loads(ran.out)["programs"]
    assert [(each["program"], each["passed"]) for each in programs] == [
        ("h/main.c", True),
        ("p/main.c", False),
        ("s/main.c", False),
    ]
    pages = {path.name: path.read_text() for path in (tmp_path / "pages").glob("[!.]*")}
    assert sorted(pages) == ["h+main.c.md", "index.html", "p+main.c.html", "p+main.c.md", "s+main.c.md"]
    assert pages["h+main.c.md"].startswith("# h/main.c: passed")
    assert "endlessly." in pages["h+main.c.md"].splitlines()[-1]
    assert "- after 90° there are no pulses for 4.02 s" in pages["p+main.c.md"]
    assert "syntax error before 'for'" in pages["s+main.c.md"]


def test_grading_again_leaves_nothing_of_an_earlier_class_and_keeps_the_teachers_own(
    run: Run, tmp_path: Path
) -> None:
    """Eva's and Ben's programs are wrong, so they have films; then Ben hands in a right one, and Eva none."""
    students, pages, results = tmp_path / "class", tmp_path / "pages", tmp_path / "results"
    for name in ("ben", "eva"):
        (students / name).mkdir(parents=True)
        shutil.copy(PROGRAMS / "lab8-wrong" / "syntax.c", students / name / "main.c")
    shutil.copy(PROGRAMS / "lab8-wrong" / "stuck.c", students / "ben" / "main.c")
    given = "grade", "lab8-exercise", students, "--pages", pages, "--gradescope", results
    assert run(*given).code == 1
    before = {path.name for path in (*pages.glob("[!.]*"), *results.glob("[!.]*"))}
    assert before == {"index.html", "ben+main.c.md", "ben+main.c.html", "eva+main.c.md", "ben+main.c.json",
                      "eva+main.c.json"}  # fmt: skip
    (pages / "notes.txt").write_text("the teacher's")
    shutil.copy(PROGRAMS / "lab8-wrong" / "syntax.c", students / "ben" / "main.c")
    shutil.rmtree(students / "eva")
    assert run(*given).code == 1
    after = {path.name for path in (*pages.glob("[!.]*"), *results.glob("[!.]*"))}
    assert after == {"index.html", "ben+main.c.md", "ben+main.c.json", "notes.txt"}


def test_a_list_of_earlier_files_leads_nowhere_else(run: Run, tmp_path: Path) -> None:
    kept = tmp_path / "kept.md"
    kept.write_text("kept")
    pages = tmp_path / "pages"
    pages.mkdir()
    (pages / ".graded-pages").write_text(f"../kept.md\n{kept}\n..\n\nindex.html\n")
    run("grade", "lab8-exercise", PROGRAMS / "lab8-wrong" / "syntax.c", "--pages", pages)
    assert kept.read_text() == "kept" and (pages / "index.html").is_file()


def test_the_same_machine_code_is_listed_for_the_teacher_alone(run: Run, tmp_path: Path) -> None:
    """Ben's is Ana's with other names, comments and layout; Cem's differs by a microsecond."""
    students, pages = tmp_path / "class", tmp_path / "pages"
    text = (PROGRAMS / "lab8-wrong" / "stuck.c").read_text()
    renamed = "/* my own */\n" + re.sub(r"\bi\b", "counter", text).replace("\n", "\n\n")
    assert "counter" in renamed
    other = text.replace("PORTB = 0", "PORTB = 2")
    assert other != text
    for name, program in (("ana", text), ("ben", renamed), ("cem", other)):
        (students / name).mkdir(parents=True)
        (students / name / "main.c").write_text(program)
    ran = run("grade", "lab8-exercise", students, "--pages", pages)
    assert "the same machine code: ana/main.c, ben/main.c\n" in ran.out
    assert "<li>ana/main.c, ben/main.c</li>" in (pages / "index.html").read_text()
    assert "ben" not in (pages / "ana+main.c.md").read_text() + (pages / "ana+main.c.html").read_text()
    found = json.loads(run("grade", "lab8-exercise", students, "--json").out)
    assert found["same_code"] == [["ana/main.c", "ben/main.c"]]


def test_the_compilers_warnings_are_on_the_page_without_the_teachers_folders(
    run: Run, tmp_path: Path
) -> None:
    text = (PROGRAMS / "lab8-wrong" / "stuck.c").read_text()
    strange = "".join(f"#pragma strange{number}\n" for number in range(12))
    (tmp_path / "ana.c").write_text(strange + text)
    assert run("grade", "lab8-exercise", tmp_path / "ana.c", "--pages", tmp_path / "pages").code == 1
    page = (tmp_path / "pages" / "ana.c.md").read_text()
    told = page.replace("\\", "")
    assert all(f"- ana.c:{number + 1}:1: unknown #pragma strange{number}\n" in told for number in range(10))
    assert "strange10" not in told and "- and 2 more warnings\n" in told
    assert str(tmp_path) not in page.partition("## Good to know")[2].partition("##")[0]


def test_a_hex_file_beside_its_source_is_not_graded_twice(run: Run, tmp_path: Path) -> None:
    shutil.copy(PROGRAMS / "lab8-right" / "delays.c", tmp_path / "ana.c")
    (tmp_path / "ana.hex").write_text(":00000001FF\n")
    ran = run("grade", "lab8-exercise", tmp_path, "--json")
    assert ran.code == 0
    assert "ana.hex: warning: not graded, as its source lies beside it" in ran.err


def test_an_empty_folder_and_an_unknown_lab_are_bad_input(run: Run, tmp_path: Path) -> None:
    assert run("grade", "lab8-exercise", tmp_path).code == 2
    assert run("grade", "lab7", PROGRAMS / "lab8-right").code == 2


@pytest.mark.parametrize("program", ["lab8-right/delays.c", "lab8-wrong/pause.c"])
def test_a_file_that_is_not_there_and_an_empty_folder_are_bad_input_beside_which_others_are_graded(
    run: Run, tmp_path: Path, program: str
) -> None:
    """They get no grade: a file that does not exist is not a program that is wrong."""
    (tmp_path / "empty").mkdir()
    given = tmp_path / "none.c", PROGRAMS / program, tmp_path / "empty"
    ran = run("grade", "lab8-exercise", *given, "--csv", tmp_path / "a.csv", "--json")
    assert ran.code == 2
    assert "none.c: error: there is no such file or folder [no-program]" in ran.err
    assert "empty: error: holds no program" in ran.err
    (graded,) = json.loads(ran.out)["programs"]
    assert (graded["program"], graded["passed"]) == (Path(program).name, program.startswith("lab8-right"))
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 2


def test_where_no_file_is_there_nothing_was_graded(run: Run, tmp_path: Path) -> None:
    ran = run("grade", "lab8-exercise", tmp_path / "none.c", "--gradescope", tmp_path / "results.json")
    assert ran.code == 2
    assert "none.c: error: there is no such file or folder" in ran.err
    assert "no program was handed in" in (tmp_path / "results.json").read_text()


def test_a_scheduler_that_is_not_there_is_a_missing_tool(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without Dask as without a cluster: exit code 3 and one sentence."""
    monkeypatch.setattr("servogen.workflows.grading.CONNECT_S", 1)
    ran = run("grade", "lab8-exercise", PROGRAMS / "lab8-right", "--scheduler", "tcp://127.0.0.1:9")
    assert ran.code == 3
    assert "Dask" in ran.err


@pytest.mark.campaign
def test_a_dask_cluster_gives_the_same_grades(run: Run) -> None:
    files = [PROGRAMS / "lab8-right" / "delays.c", PROGRAMS / "lab8-wrong" / "pause.c"]
    alone = run("grade", "lab8-exercise", *files, "--json")
    import distributed  # slow: only a campaign needs it

    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, protocol="tcp"
    ) as cluster:
        together = run("grade", "lab8-exercise", *files, "--json", "--scheduler", cluster.scheduler_address)
    assert together.out == alone.out
    assert together.code == alone.code == 1


def test_an_empty_folder_in_a_class_is_named(run: Run, tmp_path: Path) -> None:
    for name in ("ana", "dan", ".git"):
        (tmp_path / name).mkdir()
    shutil.copy(PROGRAMS / "lab8-right" / "delays.c", tmp_path / "ana" / "main.c")
    ran = run("grade", "lab8-exercise", tmp_path, "--json")
    assert ran.code == 0
    assert ran.err.count("not graded: it holds no program") == 1
    assert "dan: warning: not graded: it holds no program" in ran.err


def test_two_formats_never_share_a_file(run: Run, tmp_path: Path) -> None:
    program, out = PROGRAMS / "lab8-right" / "delays.c", tmp_path / "g.csv"
    ran = run("grade", "lab8-exercise", program, "--csv", out, "--junit", out)
    assert ran.code == 2 and "g.csv: error: is written already" in ran.err and not out.exists()
    ran = run("grade", "lab8-exercise", program, "--gradescope", tmp_path, "--classroom", tmp_path)
    assert ran.code == 2 and not list(tmp_path.iterdir())


def test_an_unknown_lab_is_answered_with_the_known_ones(run: Run) -> None:
    ran = run("grade", "lab99", PROGRAMS)
    assert ran.code == 2
    assert "error: unknown lab 'lab99'" in ran.err
    assert "known: lab8-exercise, lab9-exercise. A lab of your own" in ran.err
