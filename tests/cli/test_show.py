"""Tables, JSON, warnings and progress: what is shown where."""

from __future__ import annotations

import io
import json
import sys
from typing import Any

import pytest

from servogen.cli import show
from servogen.errors import Diagnostic, InputError, Location, SourceLines
from tests.watch.browser import wait

Text = pytest.CaptureFixture[str]
ONE = Diagnostic("warning", "one", "first", Location("a.c", 2, 3))
TWO = Diagnostic("warning", "two", "second")


@pytest.fixture(autouse=True)
def first_command() -> None:
    show.begin()


def test_a_table_is_as_wide_as_its_rows_up_to_200_columns_in_a_pipe(capsys: Text) -> None:
    """A cell of 150 letters is not wrapped, one of 300 is folded."""
    show.table("T", ("a",), [("x" * 150,)])
    assert "x" * 150 in capsys.readouterr().out
    show.table("T", ("a",), [("x" * 300,)])
    lines = capsys.readouterr().out.splitlines()
    assert max(len(line) for line in lines) == 200
    assert sum(line.count("x") for line in lines) == 300


def test_markup_and_numbers_are_shown_as_they_are(capsys: Text) -> None:
    show.table("T", ("a", "b"), [("[red]x[/red]", "1")])
    out = capsys.readouterr().out
    assert "[red]x[/red]" in out
    assert "\x1b" not in out


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["check", "--json"], True),
        (["check"], False),
        (["check", "--", "--json"], False),
        (["--json", "--"], True),
        ([], False),
    ],
)
def test_json_is_wanted_if_it_is_an_option(words: list[str], wanted: bool) -> None:
    assert show.wants_json(words) is wanted


def test_json_has_the_diagnostics_of_the_command_first_and_once(capsys: Text) -> None:
    show.warn(ONE)
    assert capsys.readouterr().err == f"{ONE}\n"
    show.as_json({"a": 1}, [TWO, ONE])
    found = json.loads(capsys.readouterr().out)
    assert [each["code"] for each in found["diagnostics"]] == ["one", "two"]
    assert list(found) == ["diagnostics", "a"]
    show.begin()
    show.as_json({"µ": [-0.0, {"b": (-0.0, 1)}]})
    out = capsys.readouterr().out
    assert out == '{"diagnostics": [], "\\u00b5": [0.0, {"b": [0.0, 1]}]}\n'


def test_all_warnings_stand_below_their_number(capsys: Text) -> None:
    show.warn_of_all([])
    assert tuple(capsys.readouterr()) == ("", "")
    show.warn_of_all([ONE])
    assert capsys.readouterr().err.splitlines()[0] == "1 warning:"
    show.warn_of_all([ONE, TWO])
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["2 warnings:", *ONE.render(None).splitlines(), *TWO.render(None).splitlines()]


def test_what_was_printed_is_flushed_before_the_warnings(monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []

    class Out(io.StringIO):
        def flush(self) -> None:
            order.append("out")

    class Err(io.StringIO):
        def write(self, text: str) -> int:
            order.append("err")
            return len(text)

    monkeypatch.setattr(sys, "stdout", Out())
    monkeypatch.setattr(sys, "stderr", Err())
    show.warn_of_all([ONE])
    assert order[0] == "out"
    assert "err" in order


def test_an_error_is_text_and_if_wanted_json(capsys: Text) -> None:
    error = InputError("code", "wrong", Location("a.toml"))
    show.show_error(error, ["check"])
    assert tuple(capsys.readouterr()) == ("", f"{error}\n")
    show.show_error(error, ["check", "--json"])
    out, err = capsys.readouterr()
    assert (json.loads(out)["diagnostics"][0]["code"], err) == ("code", f"{error}\n")


def test_progress_and_status_are_for_terminals(monkeypatch: pytest.MonkeyPatch, capsys: Text) -> None:
    with show.progress("label", 10) as tell:
        tell(5)
    with show.status("text") as change:
        change("other")
    assert tuple(capsys.readouterr()) == ("", "")
    terminal: Any = io.StringIO()
    terminal.isatty = lambda: True
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", terminal)
    with show.progress("label [[chip]]", 10) as tell:
        tell(5)
    assert "label [[chip]]" in terminal.getvalue()
    assert " 50%" in terminal.getvalue()
    with show.status("text of [a].toml") as change:
        wait(lambda: "text of [a].toml" in terminal.getvalue())
        change("other [b]")
        wait(lambda: "other [b]" in terminal.getvalue())  # it is drawn ten times a second
    assert capsys.readouterr().out == ""


def test_lines_of_the_source_are_shown_with_a_warning(capsys: Text) -> None:
    lines: SourceLines = {("a.c", 2): "int x;"}
    show.warn_of_all([ONE], lines)
    assert "int x;" in capsys.readouterr().err
