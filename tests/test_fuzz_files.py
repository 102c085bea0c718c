"""A few mutants of every kind of file; `python -m tests.fuzz_files` makes thousands."""

from pathlib import Path

import pytest

from tests import fuzz_files
from tests.campaigns import sampled

MUTANTS = 8


@pytest.mark.parametrize("kind", sampled(fuzz_files.KINDS, 6))
def test_mutants_are_read_or_refused(tmp_path: Path, kind: str) -> None:
    failures: list[str] = []
    counts = fuzz_files.run_kind(kind, MUTANTS, 0, tmp_path, failures.append)
    assert not failures, failures[0]
    assert counts.total() == MUTANTS


def test_a_good_file_is_done_and_a_defect_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    job = str(fuzz_files.JOBS / "lab8-exercise.toml")
    assert fuzz_files.outcome(("check", job)) == "done"
    assert fuzz_files.outcome(("check", "no such file")) == "refused"

    def defect(*_: object) -> None:
        raise KeyError("a defect")

    monkeypatch.setattr("servogen.cli.job_commands.load", defect)
    assert "KeyError: 'a defect'" in fuzz_files.outcome(("check", job))


def test_a_command_that_does_not_end_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    def endless(*_: object) -> None:
        while True:
            pass

    monkeypatch.setattr("servogen.cli.job_commands.load", endless)
    monkeypatch.setattr(fuzz_files, "MAX_CPU_S", 0.05)
    assert "OverBudget" in fuzz_files.outcome(("check", "any"))
