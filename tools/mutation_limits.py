"""A pytest plugin for tools/mutants.py: stops a run whose time is up, and writes what it came to.

The environment gives MUTANT_RESULT, the JSON file to write; MUTANT_SECONDS, after which no further test
begins; and MUTANT_TEST_SECONDS, the most that one test may take.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Generator
from pathlib import Path

import pytest

from tests.time_limit import TooLong, time_limit

_BEGAN = time.monotonic()
_result: dict[str, object] = {"passed": 0, "failed": "", "out_of_time": False}


def _write() -> None:
    Path(os.environ["MUTANT_RESULT"]).write_text(json.dumps(_result))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Limit a test with its fixtures, and ends the session where the time is up."""
    if time.monotonic() - _BEGAN > float(os.environ["MUTANT_SECONDS"]):
        _result["out_of_time"] = True
        item.session.shouldstop = "the time is up"
    _result["running"] = item.nodeid
    _write()
    try:
        with time_limit(float(os.environ["MUTANT_TEST_SECONDS"])):
            return (yield)
    except TooLong:
        _result["failed"] = item.nodeid
        _write()
        raise


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note the first failure, and how many tests passed."""
    if report.failed and not _result["failed"]:
        _result["failed"] = report.nodeid
    if report.passed and report.when == "call":
        _result["passed"] = int(str(_result["passed"])) + 1
    _write()


def pytest_collectreport(report: pytest.CollectReport) -> None:
    """Note a test file that cannot be imported."""
    if report.failed and not _result["failed"]:
        _result["failed"] = report.nodeid
    _write()
