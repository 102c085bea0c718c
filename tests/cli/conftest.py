"""Runs a command as `servogen` does, in this process."""

import csv
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import jsonschema
import pytest

from servogen.cli import main
from servogen.job import load, plan_job
from servogen.workflows.job_build import build, write
from servogen.workflows.output_schema import output_schema

ROOT = Path(__file__).parents[2]


@cache
def output_validator(command: str) -> jsonschema.Draft7Validator:
    """The schema of what a command prints."""
    return jsonschema.Draft7Validator(output_schema(command))


@dataclass(frozen=True)
class Ran:
    """What a command left behind."""

    code: int
    out: str
    err: str


Run = Callable[..., Ran]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """`run("build", path, ...)`: exit code, standard output and standard error."""

    def command(*args: object) -> Ran:
        monkeypatch.setattr(sys, "argv", ["servogen", *(str(arg) for arg in args)])
        with pytest.raises(SystemExit) as ended:
            main()
        captured = capsys.readouterr()
        return Ran(int(ended.value.code or 0), captured.out, captured.err)

    return command


@pytest.fixture(scope="session")
def lab8(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of lab 8's exercise, built: it is only read."""
    folder = tmp_path_factory.mktemp("lab8")
    write(build(plan_job(load(ROOT / "jobs" / "lab8-exercise.toml"))), folder)
    return folder


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file."""
    with path.open() as file:
        return list(csv.DictReader(file))


def wrong(command: str, printed: str) -> list[str]:
    """Where what a command printed, a line each, is not what its schema says."""
    lines = [json.loads(line) for line in printed.splitlines()]
    assert lines
    return [_deepest(error) for line in lines for error in output_validator(command).iter_errors(line)]


def _deepest(error: jsonschema.ValidationError) -> str:
    """The error of the alternative that is nearest: with the fewest errors, then farthest inside."""
    alternatives: dict[object, list[jsonschema.ValidationError]] = {}
    for each in error.context or ():
        alternatives.setdefault(each.schema_path[0], []).append(each)
    if alternatives:
        nearest = min(alternatives.values(), key=lambda errors: (len(errors), -len(errors[0].absolute_path)))
        return _deepest(nearest[0])
    return f"{'.'.join(map(str, error.absolute_path))}: {error.message[:200]}"
