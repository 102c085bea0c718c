"""A pytest plugin for tools/mutants.py: records which lines each test executes, and how long the test takes.

coverage.py has been started in this process, and starts in those that a test starts (`sitecustomize`), with
the configuration that COVERAGE_PROCESS_START names; there MUTANT_TEST is the context. MUTANT_RECORD is the
JSON file to write: for each context the test, its seconds, and whether it passed.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Generator
from pathlib import Path

import coverage
import pytest

_tests: dict[str, list[object]] = {}
_failed: set[str] = set()
_skipped: set[str] = set()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Record a test with its fixtures."""
    context = hashlib.sha256(item.nodeid.encode()).hexdigest()[:12]
    os.environ["MUTANT_TEST"] = context
    running = coverage.Coverage.current()
    assert running is not None
    running.switch_context(context)
    began = time.monotonic()
    try:
        return (yield)
    finally:
        _tests[context] = [item.nodeid, time.monotonic() - began]
        running.switch_context("")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note what did not pass: it can kill nothing."""
    if report.failed:
        _failed.add(report.nodeid)
    elif report.skipped:
        _skipped.add(report.nodeid)


def pytest_sessionfinish() -> None:
    """Write the tests that passed."""
    passed = {context: test for context, test in _tests.items() if test[0] not in _failed | _skipped}
    Path(os.environ["MUTANT_RECORD"]).write_text(json.dumps({"passed": passed, "failed": sorted(_failed)}))
