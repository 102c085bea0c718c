"""Which tests `make test`, `make campaigns` and `make check` run, and what CI runs."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest

from tests.campaigns import sampled

ROOT = Path(__file__).parent.parent


def pytest_words(target: str) -> list[list[str]]:
    """The words behind `pytest` in what a target would run."""
    done = subprocess.run(["make", "-n", target], cwd=ROOT, capture_output=True, text=True, check=True)
    lines = (shlex.split(line.partition("&")[0]) for line in done.stdout.splitlines() if "/pytest" in line)
    return [words[1:] for words in lines]


@pytest.mark.parametrize(
    ("target", "ran"), [("test", ["-m", "not campaign"]), ("campaigns", ["-m", "campaign"]), ("check", [])]
)
def test_every_test_is_a_campaign_or_not_and_check_runs_both(target: str, ran: list[str]) -> None:
    assert pytest_words(target)[-1] == ran


def test_ci_runs_the_command_that_the_readme_asks_for_and_no_other_tests() -> None:
    script = (ROOT / ".ci" / "run").read_text()
    assert re.findall(r"^(?:make|.*pytest).*", script, re.M) == ["make check"]
    assert "has to pass `make check`" in (ROOT / "README.md").read_text()


def test_of_sampled_cases_every_change_runs_the_first_and_others_evenly_behind_it() -> None:
    cases = sampled([("a", 1), "b", "c", "d", "e", "f"], 2)
    assert [case.values for case in cases] == [("a", 1), ("b",), ("c",), ("d",), ("e",), ("f",)]
    assert [not case.marks for case in cases] == [True, False, False, True, False, False]
    assert {mark.name for case in cases for mark in case.marks} == {"campaign"}
