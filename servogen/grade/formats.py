"""Grades in the formats that schools read: CSV, JUnit XML, Gradescope's and GitHub Classroom's results.

In: a lab and graded programs. Out: text, the same for the same grades: without dates, times and host names.
Gradescope's format is that of https://gradescope-autograders.readthedocs.io/en/latest/specs/, GitHub
Classroom's is version 1 of what its autograding-grading-reporter reads, JUnit's is what Jenkins accepts.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

from servogen.grade.display import shown_name, visible
from servogen.grade.judge import Grade
from servogen.grade.lab import Lab
from servogen.grade.points import WHOLE, CheckState, Outcome, headline, max_total, number, outcomes, total

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""The characters with which a formula begins in spreadsheets."""


@dataclass(frozen=True, slots=True)
class GradedProgram:
    """A graded program; `defect` is an error of servogen itself, not of the program."""

    name: str
    grade: Grade
    defect: str = ""

    @property
    def shown(self) -> str:
        return shown_name(self.name)


def csv_text(lab: Lab, entries: Sequence[GradedProgram]) -> str:
    """Return one row per program: its points, those of each check (empty: not checked), and why."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    keys = [check.value for check in lab.checks] + ([WHOLE] if lab.points_passed else [])
    writer.writerow(["program", "verdict", "points", "max_points", *(f"{key}_points" for key in keys), "why"])
    for entry in entries:
        results = outcomes(lab, entry.grade)
        verdict = "passed" if entry.grade.passed else "not passed"
        cells = [
            "" if outcome.state is CheckState.NOT_CHECKED else number(outcome.points) for outcome in results
        ]
        points = [number(total(results)), number(max_total(results))]
        why = "; ".join(
            " ".join(visible(reason).split()) for reason in entry.grade.reasons or [entry.grade.how_long]
        )
        writer.writerow([_no_formula(entry.shown), verdict, *points, *cells, _no_formula(why)])
    return out.getvalue()


def _no_formula(text: str) -> str:
    """Return a cell that a spreadsheet shows and does not compute: students name their files."""
    return f"'{text}" if text.startswith(FORMULA) else text


def junit_xml(lab: Lab, entries: Sequence[GradedProgram]) -> str:
    """Return JUnit XML: a suite for each program, a case for each check; what was not checked is skipped."""
    suites = [_suite(lab, entry) for entry in entries]
    root = ElementTree.Element("testsuites", name=visible(lab.title))
    for key in ("tests", "failures", "errors"):
        root.set(key, str(sum(int(suite.get(key, "0")) for suite in suites)))
    root.extend(suites)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _suite(lab: Lab, entry: GradedProgram) -> ElementTree.Element:
    results = outcomes(lab, entry.grade)
    suite = ElementTree.Element("testsuite", name=entry.shown)
    properties = ElementTree.SubElement(suite, "properties")
    for key, value in (("points", total(results)), ("max_points", max_total(results))):
        ElementTree.SubElement(properties, "property", name=key, value=number(value))
    for outcome in results:
        case = ElementTree.SubElement(suite, "testcase", classname=f"{shown_name(lab.name)}.{entry.shown}")
        case.set("name", outcome.title)
        tag = {CheckState.FAILED: "failure", CheckState.NOT_CHECKED: "skipped"}.get(outcome.state)
        if tag:
            tag = "error" if entry.defect and tag == "failure" else tag
            text = visible(outcome.text)
            ElementTree.SubElement(case, tag, message=headline(text), type=outcome.key).text = text
    counts = {"failures": "failure", "errors": "error", "skipped": "skipped"}
    suite.set("tests", str(len(results)))
    for key, tag in counts.items():
        suite.set(key, str(len(suite.findall(f"testcase/{tag}"))))
    return suite


def gradescope_json(lab: Lab, entry: GradedProgram) -> str:
    """Return the results.json of one submission: Gradescope adds up the points of its tests."""
    results = outcomes(lab, entry.grade)
    verdict = "passed" if entry.grade.passed else "not passed"
    notes = [remark.sentence for remark in entry.grade.remarks]
    return _json(
        {
            "output": "\n".join([f"{lab.title}. {entry.shown}: {verdict}.", *notes]),
            "output_format": "text",
            "test_output_format": "text",
            "test_name_format": "text",
            "visibility": "visible",
            "stdout_visibility": "hidden",
            "tests": [_gradescope_test(index, outcome) for index, outcome in enumerate(results, start=1)],
        }
    )


def _gradescope_test(index: int, outcome: Outcome) -> dict[str, object]:
    """Return one test; without points it is informative only and has no score."""
    points = {"score": outcome.points, "max_score": outcome.max_points} if outcome.max_points else {}
    status = "passed" if outcome.state is CheckState.PASSED else "failed"
    test = {"name": outcome.title, "number": str(index), **points, "status": status}
    return {**test, "output": outcome.text} if outcome.text else test


def gradescope_without_program(lab: Lab, why: str) -> str:
    """Return the results.json of a submission that cannot be graded: no points, and why."""
    return _json(
        {
            "score": 0.0,
            "output": f"{lab.title}. {why}",
            "output_format": "text",
            "stdout_visibility": "hidden",
            "tests": [{"name": "one program", "status": "failed", "output": why}],
        }
    )


def classroom_json(lab: Lab, entry: GradedProgram) -> str:
    """Return the result of one repository, of which GitHub Classroom's reporter reads the Base64."""
    results = outcomes(lab, entry.grade)
    status = "error" if entry.defect else "pass" if entry.grade.passed else "fail"
    tests = [
        _classroom_test(outcome.title, outcome.state is CheckState.PASSED, outcome.points, outcome.text)
        for outcome in results
    ]
    return _json({"version": 1, "status": status, "max_score": max_total(results), "tests": tests})


def classroom_without_program(lab: Lab, why: str) -> str:
    """Return the result of a repository that cannot be graded: no points, and why."""
    most = lab.points_passed + sum(worth for _, worth in lab.points)
    tests = [_classroom_test("one program", False, 0.0, why)]
    return _json({"version": 1, "status": "fail", "max_score": most, "tests": tests})


def _classroom_test(name: str, passed: bool, points: float, text: str) -> dict[str, object]:
    return {
        "name": name,
        "status": "pass" if passed else "fail",
        "score": points,
        "message": text or None,
        "test_code": "",
        "filename": "",
        "line_no": 0,
        "duration": 0,
    }


def _json(value: object) -> str:
    return json.dumps(value, indent=2) + "\n"
