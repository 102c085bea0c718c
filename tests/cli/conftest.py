"""Runs a command as `servogen` does, in this process."""

import sys
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from servogen.cli import main


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
