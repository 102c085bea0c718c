"""What commands share: tables, numbers of the command line, exit codes, and the log on standard error."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import typer

from servogen.cli.options import duration, number
from servogen.cli.show import table
from servogen.workflows.job_build import Build
from tests.cli.conftest import Ran

JOBS = Path(__file__).parents[2] / "jobs"
Run = Callable[..., Ran]


def test_columns_of_numbers_are_aligned_at_the_right(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [("a", 5, "5 mm"), ("bb", -100.5, "10 mm")]
    table("Things", ("name", "size", "width"), rows)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.split()[:1] in (["a"], ["bb"])]
    assert lines[0].index("5") + 1 == lines[1].index("-100.5") + len("-100.5")
    assert lines[0].index("5 mm") == lines[1].index("10 mm")  # a unit makes it text


def test_a_column_with_one_word_is_text(capsys: pytest.CaptureFixture[str]) -> None:
    table("Things", ("name", "size"), [("a", 5), ("bb", 1000), ("c", "none")])
    shown = capsys.readouterr().out.splitlines()
    five, thousand = (next(line for line in shown if text in line) for text in ("5", "1000"))
    assert five.index("5") == thousand.index("1000")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_cells_are_shown_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither is what stands in brackets taken for markup, nor are numbers coloured on a terminal."""
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    table("Things", ("name", "size"), [("[bold]a[/bold]", "7 mm")])
    (line,) = (line for line in terminal.getvalue().splitlines() if "7 mm" in line)
    assert line.split() == ["[bold]a[/bold]", "7", "mm"]


@pytest.mark.parametrize(("text", "seconds"), [("0", 0.0), ("1e9", 1e9), ("0.25", 0.25)])
def test_durations_are_up_to_thirty_years(text: str, seconds: float) -> None:
    assert duration(text) == seconds


@pytest.mark.parametrize("text", ["-0.1", "1000000001", "inf", "nan"])
def test_other_durations_are_refused_with_what_was_typed(text: str) -> None:
    with pytest.raises(typer.BadParameter, match=f"'{text}' is not between 0 and 1e\\+09 seconds"):
        duration(text)


@pytest.mark.parametrize(("text", "kind"), [("--sconds", "an option"), ("ten", "a number")])
def test_what_is_no_number_is_named_as_it_was_typed(text: str, kind: str) -> None:
    with pytest.raises(typer.BadParameter, match=f"'{text}' is not {kind}"):
        number(text)
    assert number("-5") == -5


@pytest.mark.parametrize("exact", [True, False])
def test_the_exit_code_of_build_is_its_verdict(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exact: bool
) -> None:
    monkeypatch.setattr(Build, "exact", property(lambda _: exact))
    ran = run("build", JOBS / "lab8-exercise.toml", "--output", tmp_path / "out")
    assert ran.code == (0 if exact else 1)
    assert f"{tmp_path / 'out'}: {'exact' if exact else 'NOT EXACT'};" in ran.out


def test_the_cycle_of_a_gait_is_rounded_up_as_its_help_says(run: Run) -> None:
    """A tripod lifts at half the cycle, on a frame: 0.39 s are 20 frames of 20 ms, 0.41 s are 22."""
    assert "a cycle: 20 frames, 0.4 s" in run("gait", "--cycle-s", "0.39").out
    assert "a cycle: 22 frames, 0.44 s" in run("gait", "--cycle-s", "0.41").out
    assert "a cycle: 20 frames, 0.4 s" in run("gait", "--cycle-s", "0.4").out
    assert re.search(r"cycle, rounded\W+up", run("gait", "--help").out)
