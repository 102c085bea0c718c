"""What every command shares: exit codes, streams that fail, messages about options; in this process."""

from __future__ import annotations

import errno
import gc
import importlib
import io
import json
import sys
from collections.abc import Callable
from typing import Any

import pytest
import typer

from servogen import __version__
from servogen.cli import main as main_module
from servogen.cli import show
from servogen.errors import InputError, Location, ToolError
from tests.cli.conftest import Run

main: Any = sys.modules["servogen.cli.main"]
commands: Any = importlib.import_module("servogen.cli.app")
assert main_module is not None


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Callable[[Any], None]:
    """`ends(result)`: every command returns this, or raises it."""

    def end(result: Any) -> None:
        def app(arguments: list[str], prog_name: str, standalone_mode: bool) -> Any:
            assert (prog_name, standalone_mode) == ("servogen", False)
            if isinstance(result, BaseException):
                raise result
            if callable(result):
                return result()
            return result

        monkeypatch.setattr(commands, "app", app)

    return end


@pytest.mark.parametrize(
    ("result", "code", "err"),
    [
        (None, 0, ""),
        (0, 0, ""),
        (1, 1, ""),
        ("text", 0, ""),
        (SystemExit(), 0, ""),
        (SystemExit(0), 0, ""),
        (SystemExit(7), 7, ""),
        (SystemExit("why"), 1, ""),
        (typer.Abort(), 130, ""),
        (KeyboardInterrupt(), 130, ""),
        (BrokenPipeError(), 141, ""),
        (InputError("code", "wrong", Location("a.toml")), 2, "a.toml: error: wrong [code]\n"),
        (ToolError("code", "gone"), 3, "gone [code]\n"),
        (
            OSError(errno.EACCES, "Permission denied", "a.hex"),
            2,
            "a.hex: error: Permission denied [unreadable-file]\n",
        ),
        (OSError(errno.EIO, "I/O error"), 2, "I/O error [unreadable-file]\n"),
        (OSError("odd"), 2, "odd [unreadable-file]\n"),
        (MemoryError(), 3, "out of memory: the input is too large for this machine [out-of-memory]\n"),
        (ValueError("bug"), 3, "please report it with the lines above [internal-error]\n"),
    ],
)
def test_every_end_of_a_command_has_its_exit_code(
    run: Run, ends: Callable[[Any], None], result: Any, code: int, err: str
) -> None:
    """docs and `servogen --help`: 0, 1, 2 bad input, 3 a tool, 130 interrupted, 141 nobody reads."""
    ends(result)
    ran = run("check")
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.endswith(err) if err else ran.err == ""
    assert ("Traceback" in ran.err) == isinstance(result, ValueError)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InputError("a-code", "wrong"), "a-code"),
        (OSError("odd"), "unreadable-file"),
        (MemoryError(), "out-of-memory"),
        (ValueError("bug"), "internal-error"),
    ],
)
def test_an_error_is_json_on_standard_output_if_json_is_wanted(
    run: Run, ends: Callable[[Any], None], error: BaseException, code: str
) -> None:
    ends(error)
    ran = run("check", "--json")
    (found,) = json.loads(ran.out)["diagnostics"]
    assert found["code"] == code
    assert f"[{code}]" in ran.err
    assert run("check", "--", "--json").out == ""


def test_without_arguments_the_help_is_shown(run: Run) -> None:
    ran = run()
    assert (ran.code, ran.err) == (0, "")
    assert "Usage: servogen" in ran.out
    assert ran.out == run("--help").out == run("-h").out


def test_the_version_is_printed_alone(run: Run) -> None:
    ran = run("--version")
    assert (ran.code, ran.out, ran.err) == (0, f"servogen {__version__}\n", "")


class Failing(io.StringIO):
    """A stream whose writes or flushes fail."""

    def __init__(self, error: Exception, flushing: bool) -> None:
        super().__init__()
        self.error, self.flushing = error, flushing

    def write(self, text: str) -> int:
        if not self.flushing:
            raise self.error
        return super().write(text)

    def flush(self) -> None:
        if self.flushing:
            raise self.error


def outcome(monkeypatch: pytest.MonkeyPatch, stream: Any, result: int = 0) -> tuple[int, str]:
    """The exit code of a command that prints a line on `stream`, and its messages."""
    messages = io.StringIO()
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", messages)
    monkeypatch.setattr(main, "run_command", lambda: print("line") or result)
    with pytest.raises(SystemExit) as ended:
        main.main()
    return int(ended.value.code or 0), messages.getvalue()


def test_the_end_of_a_command_depends_on_its_output(monkeypatch: pytest.MonkeyPatch) -> None:
    assert outcome(monkeypatch, io.StringIO()) == (0, "")
    assert outcome(monkeypatch, io.StringIO(), 1) == (1, "")
    assert outcome(monkeypatch, Failing(BrokenPipeError(), True), 1) == (141, "")
    code, text = outcome(monkeypatch, Failing(OSError(errno.ENOSPC, "No space left"), True))
    assert (code, text) == (3, "standard output: error: could not be written: No space left [write-failed]\n")


def test_an_output_that_typer_has_replaced_was_a_broken_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    monkeypatch.setattr(sys, "stderr", io.StringIO())

    def run() -> int:
        sys.stdout = io.StringIO()
        return 1

    monkeypatch.setattr(main, "run_command", run)
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert ended.value.code == 141


def test_letters_that_a_locale_lacks_are_question_marks(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.setattr(main, "run_command", lambda: print("1 µs") or 0)
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert (ended.value.code, raw.getvalue()) == (0, b"1 ?s\n")


def test_garbage_is_collected_while_a_command_works_and_after_it(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only its import does without; a list of commands and a wrong one import none."""
    from servogen.kinematics import queries

    seen: list[bool] = []

    def robot_list() -> list[Any]:
        seen.append(gc.isenabled())
        return []

    monkeypatch.setattr(queries, "robot_list", robot_list)
    for words in (("robots",), ("--help",), ("gaits",), ("robots", "--nothing")):
        run(*words)
        assert gc.isenabled(), words
    assert seen == [True]


def test_warnings_of_an_earlier_command_are_forgotten(run: Run, ends: Callable[[Any], None]) -> None:
    from servogen.errors import Diagnostic

    def warned() -> None:
        show.warn(Diagnostic("warning", "a-code", "text"))
        show.as_json({})

    ends(warned)
    for _ in range(2):
        assert len(json.loads(run("check").out)["diagnostics"]) == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("gait", "--lift-mm", "-1"), "'--lift-mm'"),
        (("gait", "--leg"), "requires an argument"),
        (("gait", "--nothing"), "No such option: --nothing"),
        (("gaits",), "No such command 'gaits'"),
        (("schema", "nothing"), "'nothing' is not one of"),
    ],
)
def test_a_wrong_command_line_is_exit_code_2_with_where_to_read_on(
    run: Run, words: tuple[str, ...], said: str
) -> None:
    ran = run(*words)
    assert (ran.code, ran.out) == (2, "")
    assert said in ran.err
    assert "[usage]" in ran.err
    named = f"servogen {words[0]}" if words[0] in ("gait", "schema") else "servogen"
    assert f"see: {named} --help" in ran.err


def test_commands_are_listed_in_the_order_of_their_groups() -> None:
    group: Any = typer.main.get_command(commands.app)
    context = typer.Context(group)
    names = group.list_commands(context)
    assert names == [
        name for modules in commands.GROUPS.values() for each in modules.values() for name in each
    ]
    assert len(names) == len(set(names))
    assert group.get_command(context, "robots").rich_help_panel == "Robots and motion"
    assert group.get_command(context, "nothing") is None
