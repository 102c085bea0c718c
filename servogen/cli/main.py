"""`servogen`: the commands put together, and what every command shares: exit codes and how an error is shown.

Exit codes: 0 done, and right if it was checked, 1 checked and found wrong, 2 bad input, 3 a tool or the bench
is missing or failed, 130 interrupted, 141 nobody reads the output: its reader has gone, or it was closed from
the start.
Output to a closed standard error is dropped, and does not change the exit code.
"""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from itertools import pairwise
from math import isnan
from typing import TYPE_CHECKING, Annotated, TextIO

import typer
from typer.core import TyperGroup
from typer.exceptions import TyperException

from servogen import INTERRUPTED, __version__
from servogen.cli.show import begin, show_error
from servogen.errors import InputError, Location, ServogenError, ToolError

if TYPE_CHECKING:
    from typer._click.core import Command, Context  # typer has no public name for them

NOBODY_READS = 141
"""The exit code that shells report after a closed pipe; also used if standard output is closed."""

GROUPS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "Jobs": {
        "job_commands": ("new", "check", "build", "demo", "plan", "report", "tune"),
    },
    "Programs and signals": {
        "chip_commands": ("compile", "assemble", "disassemble"),
        "simulate_commands": ("simulate",),
        "signal_commands": ("verify", "measure", "plot"),
        "proof_commands": ("prove", "check-certificate"),
    },
    "Robots and motion": {
        "robot_commands": (
            *("robots", "servos", "fk", "ik", "jacobian", "statics"),
            *("transform", "orientation", "differential", "mobility"),
        ),
        "motion_commands": ("gait", "run-program"),
    },
    "Bench and robot": {
        "bench_commands": ("flash", "capture", "rig"),
        "drive_commands": ("drive", "calibrate"),
        "twin_commands": ("twin",),
        "watch_commands": ("watch",),
    },
    "Labs and tools": {
        "grade_commands": ("grade", "handout"),
        "schema_commands": ("schema",),
        "doctor_commands": ("doctor",),
    },
}
"""The groups of commands in `servogen --help`; in each the modules that define them, and their commands."""

COMMANDS = {module: names for modules in GROUPS.values() for module, names in modules.items()}
PANELS = {name: group for group, modules in GROUPS.items() for names in modules.values() for name in names}


class LazyCommands(TyperGroup):
    """The commands, of which only those of the module that is needed are loaded: the others cost no time."""

    def list_commands(self, ctx: Context) -> list[str]:
        return [name for names in COMMANDS.values() for name in names]

    def get_command(self, ctx: Context, cmd_name: str) -> Command | None:
        wanted = [module for module, names in COMMANDS.items() if cmd_name in names]
        for module in wanted or COMMANDS:  # all for an unknown name, which may be close to one of theirs
            self.commands.update(_commands_of(module))
        return super().get_command(ctx, cmd_name)


@cache
def _commands_of(module: str) -> Mapping[str, Command]:
    """Return the commands that a module defines, by name; to make them takes longer than many of them run."""
    part = typer.Typer()
    part.callback()(_options)  # makes it a group, even of a single command
    import_module(f"servogen.cli.{module}").register(part)
    commands = typer.main.get_group(part).commands
    for name, command in commands.items():
        command.rich_help_panel = PANELS[name]  # type: ignore[attr-defined]  # typer's own
    return commands


app = typer.Typer(
    name="servogen",
    cls=LazyCommands,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    help="Turn a robot's job file into PIC16F84 firmware whose every servo pulse edge is exact.",
    epilog="Exit codes: 0 done, and right if it was checked, 1 checked and found wrong, 2 bad input, "
    "3 a tool is missing or failed, 130 interrupted, 141 the output's reader has gone (broken pipe).",
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"servogen {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


class _Output:
    """Standard output that notices when nobody reads it, which libraries turn into an exit with 1."""

    def __init__(self, stream: TextIO, closed: bool) -> None:
        self._stream = stream
        self._closed = closed
        self.unread = False
        """Whether output was written that has no reader."""

    def write(self, text: str) -> int:
        with self._noticing():
            self.unread |= self._closed and bool(text)
            return self._stream.write(text)

    def flush(self) -> None:
        with self._noticing():
            self._stream.flush()

    @contextmanager
    def _noticing(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            self.unread = True
            raise
        except OSError as error:
            raise ToolError(
                "write-failed", f"could not be written: {error.strerror}", Location("standard output")
            ) from error

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)


class _Messages:
    """Standard error that drops what cannot be written: a command's result does not depend on who listens."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with suppress(OSError):
            return self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            self._stream.flush()

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)


def main() -> None:
    """Run one command and exit with the code that scripts rely on."""
    stdout_closed = _open_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a locale without µ gets a question mark, not a traceback
    begin()
    stream = sys.stdout
    output = _Output(stream, stdout_closed)
    sys.stdout, sys.stderr = output, _Messages(sys.stderr)
    code = _run()
    if sys.stdout is not output:  # what typer does, with exit code 1, where any pipe is broken
        code = NOBODY_READS
    try:
        output.flush()
    except BrokenPipeError:
        code = NOBODY_READS
    except ToolError as error:
        print(error, file=sys.stderr)  # not as JSON: it is standard output that cannot be written
        code = error.exit_code
        _discard_output(stream)  # Python flushes once more at the end, and would exit with 120
    if output.unread or code == NOBODY_READS:
        code = NOBODY_READS
        _discard_output(stream)
    sys.exit(code)


def _discard_output(stream: TextIO) -> None:
    """Send the rest of standard output to the null device."""
    with suppress(OSError, ValueError):  # a stream of a test has no descriptor
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _open_closed_streams() -> bool:
    """Open the null device in place of closed standard streams; return whether standard output was closed.

    Otherwise the next file that is opened would take the stream's place, and every message would go there.
    """
    was_closed = sys.stdout is None
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:
                os.dup2(null, number)
                os.close(null)
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))
    return was_closed


def _run() -> int:
    """Run one command and return its exit code; show errors without a traceback."""
    try:
        code = app(sys.argv[1:] or ["--help"], prog_name="servogen", standalone_mode=False)
        return code if isinstance(code, int) else 0
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except TyperException as error:  # the command line is wrong
        text = error.format_message().rstrip(".").replace(": Value error, ", ": ")
        text = _with_value(text, error, sys.argv[1:])
        meant = _meant(text)
        text = (BY_LETTERS if meant else HELP_ALONE).sub("", text)
        hint = meant or f"see: {_command_of(error)} --help"
        show_error(InputError("usage", text, hint=hint), sys.argv[1:])
        return InputError.exit_code
    except typer.Abort:
        return INTERRUPTED
    except ServogenError as error:
        show_error(error, sys.argv[1:])
        return error.exit_code
    except KeyboardInterrupt:  # before or after the command itself
        return INTERRUPTED
    except BrokenPipeError:  # of standard output, or of a file that is a pipe
        return NOBODY_READS
    except OSError as error:
        where = Location(str(error.filename)) if error.filename else None
        show_error(InputError("unreadable-file", error.strerror or str(error), where), sys.argv[1:])
        return InputError.exit_code
    except MemoryError:
        text = "out of memory: the input is too large for this machine"
        show_error(ToolError("out-of-memory", text), sys.argv[1:])
        return ToolError.exit_code
    except Exception:  # a defect of servogen: never the exit code of a verdict
        import traceback

        traceback.print_exc()
        text = "this is a defect of servogen itself; please report it with the lines above"
        show_error(ToolError("internal-error", text), sys.argv[1:])
        return ToolError.exit_code
    return 0


MEANT = {"upload": "flash", "program": "flash", "burn": "flash", "run": "simulate", "sim": "simulate"}
MEANT |= {"init": "new", "create": "new", "asm": "assemble", "cc": "compile", "ui": "watch", "show": "watch"}
"""What other tools call a command."""
BY_LETTERS = re.compile(r"\. Did you mean .*$")
HELP_ALONE = re.compile(r" \(Possible options: --help\)$")


def _meant(text: str) -> str:
    """Return which command somebody means who types another tool's; empty where that is not known."""
    word = re.match(r"No such command '([\w-]+)'", text)
    command = MEANT.get(word[1]) if word else None
    return f"did you mean '{command}'?" if command else ""


def _with_value(text: str, error: TyperException, words: Sequence[str]) -> str:
    """Return an error message about an option's value, quoting the value if it was typed."""
    names: Sequence[str] = getattr(getattr(error, "param", None), "opts", [])
    values = [after for before, after in pairwise(words) if before in names]
    values += [word.partition("=")[2] for word in words if word.partition("=")[0] in names and "=" in word]
    if not values or repr(values[-1]) in text:
        return text
    value = values[-1]
    with suppress(ValueError):
        if isnan(float(value)):
            return f"Invalid value for '{names[0]}': '{value}' is not a number"
    return text.replace(": Input should", f": '{value}' should", 1)


def _command_of(error: TyperException) -> str:
    """Return the command whose arguments are wrong, as it is typed."""
    context = getattr(error, "ctx", None)
    if context:
        return str(context.command_path)
    # An option without its values has no context.
    named = [arg for arg in sys.argv[1:2] if arg in PANELS]
    return " ".join(["servogen", *named])


def _say(text: str) -> None:
    print(f"servogen: {text}", file=sys.stderr)
