"""A pytest plugin for tools/mutants.py: runs chosen tests, limits each, and writes what they came to.

The environment gives MUTANT_TESTS, a JSON file with the tests to run, in their order; MUTANT_RESULT, the JSON
file to write; and MUTANT_TEST_SECONDS, the most that one test may take.
"""

from __future__ import annotations

import json
import os
from collections.abc import Generator
from pathlib import Path

import pytest

from tests.time_limit import TooLong, time_limit

_failed: list[str] = []
_result: dict[str, object] = {"passed": 0, "failed": _failed}


def _write() -> None:
    Path(os.environ["MUTANT_RESULT"]).write_text(json.dumps(_result))


def _fails(test: str) -> None:
    if test not in _failed:
        _failed.append(test)
    _write()


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave the chosen tests, in their order."""
    order = {test: n for n, test in enumerate(json.loads(Path(os.environ["MUTANT_TESTS"]).read_text()))}
    items[:] = sorted((each for each in items if each.nodeid in order), key=lambda item: order[item.nodeid])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Limit a test with its fixtures."""
    _result["running"] = item.nodeid
    _write()
    try:
        with time_limit(float(os.environ["MUTANT_TEST_SECONDS"])):
            return (yield)
    except TooLong:
        _fails(item.nodeid)
        raise


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note the tests that fail, and how many pass."""
    if report.failed:
        _fails(report.nodeid)
    if report.passed and report.when == "call":
        _result["passed"] = int(str(_result["passed"])) + 1
    _write()


def pytest_collectreport(report: pytest.CollectReport) -> None:
    """Note a test file that cannot be imported."""
    if report.failed:
        _fails(report.nodeid)
