"""A class of ten students, graded once, in every format that schools read.

The points are worked out by hand from the faults that the programs were written with. The formats are read by
others' readers where there are any (junitparser, csv), else by rules typed from their documentation.
"""

import base64
import csv
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import junitparser
import pytest
import yaml

from servogen.grade import Check, load_lab, refused
from servogen.grade.formats import GradedProgram, csv_text, gradescope_json, junit_xml
from tests.bench.conftest import Run, run  # noqa: F401 - a fixture

ROOT = Path(__file__).parents[2]
PROGRAMS = ROOT / "tests" / "grade" / "programs"
PAGE = (ROOT / "docs" / "grading.md").read_text("utf-8")
LAB8 = load_lab("lab8-exercise")

CLASS: dict[str, tuple[str, str]] = {
    # student: program, checks: p(assed), f(ailed), n(ot checked), in the order of `Check`
    "ana": ("lab8-right/delays.c", "ppppppppp"),
    "ben": ("lab8-wrong/pause.c", "ppppfpppn"),
    "cem": ("lab8-wrong/syntax.c", "fnnnnnnnn"),
    "dan": (
        "lab8-wrong/order.c",
        "pppfnnppn",
    ),  # where the order is wrong, no position is held when it should be
    "eva": ("lab8-wrong/period.c", "ppppppfpn"),
    "fay": ("lab8-wrong/angle.c", "ppfpnnppn"),  # 30° is 60°: its pause was not seen
    "gus": ("lab8-wrong/inputs.c", "pfnnnnnnn"),
    "hal": ("lab8-wrong/once.c", "ppppnnpfn"),  # the last position is never left
    "ida": ("lab8-wrong/watchdog.asm", "pfnnnnnnn"),
    "jon": ("lab8-wrong/two.c", "ppnfnnppn"),  # never at 120°
}
WORTH = (1, 1, 2, 1, 1, 1, 1, 1, 1)  # the lab's file
POINTS = {
    name: sum(w for w, s in zip(WORTH, states, strict=True) if s == "p")
    for name, (_, states) in CLASS.items()
}
assert list(POINTS.values()) == [10, 8, 0, 6, 8, 5, 1, 6, 1, 4]


def servogen(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "servogen", *map(str, arguments)], cwd=cwd, capture_output=True, text=True
    )


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with everything that one run writes."""
    folder = tmp_path_factory.mktemp("class")
    for name, (program, _) in CLASS.items():
        source = PROGRAMS / program
        (folder / "class" / name).mkdir(parents=True)
        shutil.copy(source, folder / "class" / name / f"main{source.suffix}")
    options = (
        "--pages pages --csv grades.csv --junit grades.xml --gradescope gradescope --classroom classroom"
    )
    done = servogen("grade", "lab8-exercise", "class", "--json", *options.split(), cwd=folder)
    assert done.returncode == 1, done.stderr
    (folder / "grades.json").write_text(done.stdout)
    return folder


def student(program: str) -> str:
    return re.split(r"[/+]", program)[0]


def test_the_json_has_the_points(out: Path) -> None:
    programs = json.loads((out / "grades.json").read_text())["programs"]
    assert {student(each["program"]): each["points"] for each in programs} == POINTS
    states = {
        student(each["program"]): "".join(check["state"][0] for check in each["checks"].values())
        for each in programs
    }
    assert states == {name: expected for name, (_, expected) in CLASS.items()}
    assert all(each["max_points"] == 10 for each in programs)


def test_the_csv_has_a_row_for_each_student(out: Path) -> None:
    with (out / "grades.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {student(row["program"]): float(row["points"]) for row in rows} == POINTS
    for row in rows:
        cells = [row[f"{check}_points"] for check in Check]
        expected = [
            "" if state == "n" else str(worth) if state == "p" else "0"
            for state, worth in zip(CLASS[student(row["program"])][1], WORTH, strict=True)
        ]
        assert cells == expected, row
        assert row["verdict"] == ("passed" if student(row["program"]) == "ana" else "not passed")
        assert bool(row["why"]) == (row["verdict"] != "passed")


class Cells(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data: str) -> None:
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


def test_the_page_of_the_class_and_each_students_have_the_points(out: Path) -> None:
    cells = Cells()
    cells.feed((out / "pages" / "index.html").read_text("utf-8"))
    shown = {student(row[0]): row[1] for row in cells.rows[1:]}
    assert shown == {name: f"{points} of 10" for name, points in POINTS.items()}
    hal = (out / "pages" / "hal+main.c.md").read_text("utf-8")
    assert "Points: 6 of 10." in hal
    assert "| pauses: not checked | 0 of 1 |" in hal and "| endless repetition: failed | 0 of 1 |" in hal


def test_junitparser_reads_the_junit_xml(out: Path) -> None:
    suites = list(junitparser.JUnitXml.fromfile(str(out / "grades.xml")))
    assert len(suites) == 10
    kinds = {junitparser.Failure: "f", junitparser.Skipped: "n"}
    for suite in suites:
        name = student(suite.name)
        states = "".join(kinds[type(case.result[0])] if case.result else "p" for case in suite)
        assert states == CLASS[name][1]
        assert (suite.tests, suite.failures, suite.skipped, suite.errors) == (
            9,
            states.count("f"),
            states.count("n"),
            0,
        )
        properties = {each.name: each.value for each in suite.properties()}
        assert properties == {"points": str(POINTS[name]), "max_points": "10"}


JUNIT: Mapping[str, tuple[set[str], set[str], set[str]]] = {
    # element: required attributes, optional attributes, children; as in Jenkins' junit-10.xsd
    "testsuites": (set(), {"name", "time", "tests", "failures", "errors"}, {"testsuite"}),
    "testsuite": (
        {"name", "tests", "failures", "errors"},
        {"group", "time", "skipped", "timestamp", "hostname", "id", "package", "file", "log", "url"},
        {"testsuite", "properties", "testcase", "system-out", "system-err"},
    ),
    "properties": (set(), set(), {"property"}),
    "property": ({"name", "value"}, set(), set()),
    "testcase": ({"name"}, {"time", "classname", "group"}, {"skipped", "error", "failure", "system-out"}),
    "failure": (set(), {"type", "message"}, set()),
    "error": (set(), {"type", "message"}, set()),
    "skipped": (set(), {"type", "message"}, set()),
}


def junit_problems(root: ElementTree.Element) -> list[str]:
    """Return what Jenkins would not accept."""
    found = []
    for element in root.iter():
        required, optional, children = JUNIT[element.tag]
        given = set(element.attrib)
        found += [f"{element.tag}: {name}" for name in (required - given) | (given - required - optional)]
        found += [f"{element.tag}: <{child.tag}>" for child in element if child.tag not in children]
    return found


def test_the_junit_xml_has_the_elements_that_jenkins_accepts(out: Path) -> None:
    root = ElementTree.parse(out / "grades.xml").getroot()
    assert junit_problems(root) == []
    root[0].set("skips", "1")
    del root[1].attrib["errors"]
    assert junit_problems(root) == ["testsuite: skips", "testsuite: errors"]


VISIBILITY = {"hidden", "after_due_date", "after_published", "visible"}
FORMATS = {"text", "html", "simple_format", "md", "ansi"}
TOP: Mapping[str, Any] = {
    "score": (int, float),
    "execution_time": (int, float),
    "output": str,
    "output_format": FORMATS,
    "test_output_format": FORMATS,
    "test_name_format": FORMATS,
    "visibility": VISIBILITY,
    "stdout_visibility": VISIBILITY,
    "extra_data": dict,
    "tests": list,
    "leaderboard": list,
}
TEST: Mapping[str, Any] = {
    "score": (int, float),
    "max_score": (int, float),
    "status": {"passed", "failed"},
    "name": str,
    "name_format": FORMATS,
    "number": str,
    "output": str,
    "output_format": FORMATS,
    "tags": list,
    "visibility": VISIBILITY,
    "extra_data": dict,
}


def gradescope_problems(results: dict[str, Any]) -> list[str]:
    """Return what breaks the rules of Gradescope's "Autograder Specifications", section "Output format"."""
    found = []
    tests = results.get("tests", [])
    for table, rules in ((results, TOP), *((test, TEST) for test in tests)):
        for key, value in table.items():
            rule = rules.get(key)
            fits = value in rule if isinstance(rule, set) else rule is not None and isinstance(value, rule)
            if not fits or isinstance(value, bool):
                found.append(key)
    if "score" not in results:
        if not tests:
            found.append("neither score nor tests")
        found += [test["name"] for test in tests if "score" not in test and "status" not in test]
    found += [test["name"] for test in tests if test.get("score", 0) > test.get("max_score", 0)]
    return found


def gradescope_score(results: dict[str, Any]) -> float:
    """Return what Gradescope shows: the score, else the sum of the tests'."""
    return float(results.get("score", sum(test.get("score", 0) for test in results["tests"])))


def test_gradescope_adds_up_the_same_points(out: Path) -> None:
    files = sorted((out / "gradescope").glob("*.json"))
    assert len(files) == 10
    for file in files:
        results = json.loads(file.read_text())
        name = student(file.name)
        assert gradescope_problems(results) == []
        assert gradescope_score(results) == POINTS[name]
        assert sum(test.get("max_score", 0) for test in results["tests"]) == 10
        passed = "".join("p" if test["status"] == "passed" else "-" for test in results["tests"])
        assert passed == re.sub("[fn]", "-", CLASS[name][1])
    results["stdout_visibility"] = "shown"
    results["tests"][0]["score"] = 11.0
    assert gradescope_problems(results) == ["stdout_visibility", results["tests"][0]["name"]]


def reported(environment: Mapping[str, str], runners: str) -> tuple[float, float, str]:
    """Return points, greatest points and status, as autograding-grading-reporter works them out."""
    points = most = 0.0
    status = "pass"
    for runner in runners.split(","):
        text = base64.b64decode(environment[f"{runner.strip().upper()}_RESULTS"], validate=True)
        results = json.loads(text)
        assert results["version"] == 1 and results["status"] in {"pass", "fail", "error"}
        status = status if results["status"] == "pass" else results["status"]
        most += results["max_score"]
        for test in results["tests"]:
            assert test["name"] and test["status"] in {"pass", "fail", "error"}
            points += test["score"]
    return points, most, status


def test_github_classrooms_reporter_adds_up_the_same_points(out: Path) -> None:
    for file in (out / "classroom").glob("*.json"):
        name = student(file.name)
        encoded = base64.b64encode(file.read_bytes()).decode()
        expected = (POINTS[name], 10, "pass" if name == "ana" else "fail")
        assert reported({"LAB8_RESULTS": encoded}, "lab8") == expected


@pytest.mark.campaign
def test_the_workflow_of_the_page_grades_a_repository(out: Path, tmp_path: Path) -> None:
    """The step is run as it stands, by bash as on GitHub's machines, and read as the reporter does."""
    (block,) = re.findall(r"^```yaml\n(.*?)^```", PAGE, re.M | re.S)
    steps = yaml.safe_load(block)["jobs"]["run-autograding-tests"]["steps"]
    (step,) = (each for each in steps if each.get("id") == "lab8")
    reporter = steps[-1]
    assert reporter["env"] == {"LAB8_RESULTS": "${{ steps.lab8.outputs.result }}"}
    repository = tmp_path / "repository"
    shutil.copytree(out / "class" / "gus", repository)
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    files = {"RUNNER_TEMP": str(tmp_path), "GITHUB_OUTPUT": str(tmp_path / "output"), "PATH": path}
    subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],
        cwd=repository,
        env={**os.environ, **files},
        check=True,
        capture_output=True,
    )
    key, _, value = (tmp_path / "output").read_text().strip().partition("=")
    assert key == "result"
    assert reported({"LAB8_RESULTS": value}, reporter["with"]["runners"]) == (1, 10, "fail")


@pytest.mark.parametrize("count", [0, 2])
def test_a_submission_without_one_program_gets_no_points_and_the_reason(
    run: Run,  # noqa: F811
    tmp_path: Path,
    count: int,
) -> None:
    (tmp_path / "submission").mkdir()
    for number in range(count):
        shutil.copy(PROGRAMS / "lab8-wrong" / "syntax.c", tmp_path / "submission" / f"main{number}.c")
    files = ("--gradescope", tmp_path / "results.json", "--classroom", tmp_path / "result.json")
    done = run("grade", "lab8-exercise", tmp_path / "submission", "--level", 0, *files)
    assert done.code == 2
    assert ("no-program" if count == 0 else "several-programs") in done.err
    results = json.loads((tmp_path / "results.json").read_text())
    assert gradescope_problems(results) == [] and gradescope_score(results) == 0
    assert ("no program" if count == 0 else "main0.c, main1.c") in results["output"]
    encoded = base64.b64encode((tmp_path / "result.json").read_bytes()).decode()
    assert reported({"A_RESULTS": encoded}, "a") == (0, 10, "fail")


EVIL = GradedProgram(
    "=cmd|'/c calc'!A1/\x1b[31m\udcff<&\".c", refused("lab8-exercise", "@SUM(1)\n]]>\x00\ufffe</failure>")
)


def test_the_headline_of_a_reason_never_ends_with_its_colon() -> None:
    entry = GradedProgram(
        "a.c", refused("lab8-exercise", "it cannot be run:\na.c:2:27: error: syntax error\n  the line")
    )
    (suite,) = junitparser.JUnitXml.fromstring(junit_xml(LAB8, [entry]).encode())
    messages = {result.message for case in suite for result in case.result}
    headline = "it cannot be run: a.c:2:27: error: syntax error"
    assert messages == {headline, f"could not be checked: {headline}"}


def test_names_and_reasons_of_strangers_stay_text() -> None:
    (row,) = csv.DictReader(csv_text(LAB8, [EVIL]).splitlines())
    assert row["program"].startswith("'=cmd") and row["why"].startswith("'@SUM")
    (suite,) = junitparser.JUnitXml.fromstring(junit_xml(LAB8, [EVIL]).encode())
    assert suite.name.endswith(".c") and '<&"' in suite.name
    assert "\x1b" not in junit_xml(LAB8, [EVIL])
    assert gradescope_problems(json.loads(gradescope_json(LAB8, EVIL))) == []


def test_a_defect_of_servogen_is_an_error_not_a_failure_of_the_student() -> None:
    text = junit_xml(
        LAB8, [GradedProgram("a.c", refused("lab8-exercise", "servogen failed on it"), "it failed")]
    )
    (suite,) = junitparser.JUnitXml.fromstring(text.encode())
    assert (suite.errors, suite.failures, suite.skipped) == (1, 0, 8)
