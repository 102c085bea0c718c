"""`servogen`: the commands put together, and what every command shares: exit codes and how an error is shown.

Exit codes: 0 done or proven, 1 checked and found wrong, 2 bad input, 3 a tool or the bench is missing or
failed, 130 interrupted, 141 nobody reads the output any more.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, TextIO

import typer

from servogen import __version__
from servogen.cli import (
    bench_commands,
    calibrate_commands,
    chip_commands,
    doctor_commands,
    drive_commands,
    gait_commands,
    grade_commands,
    job_commands,
    motion_commands,
    plan_commands,
    report_commands,
    robot_commands,
    signal_commands,
    simulate_commands,
    tune_commands,
)
from servogen.errors import ServogenError, ToolError

INTERRUPTED = 130
NOBODY_READS = 141
"""What a shell says of a program that a closed pipe has ended."""

app = typer.Typer(
    name="servogen",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="From a robot's job file to a PIC16F84 HEX whose every servo pulse edge is proven.",
    epilog="Exit codes: 0 done or proven, 1 found wrong, 2 bad input, 3 a tool is missing or failed, "
    "130 interrupted.",
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


GROUPS = (
    job_commands,
    chip_commands,
    simulate_commands,
    signal_commands,
    robot_commands,
    motion_commands,
    plan_commands,
    doctor_commands,
    bench_commands,
    drive_commands,
    calibrate_commands,
    gait_commands,
    grade_commands,
    report_commands,
    tune_commands,
)
for group in GROUPS:
    group.register(app)


class _Output:
    """Standard output that remembers whether its reader has gone away: libraries make that an exit with 1."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.closed_by_reader = False

    def write(self, text: str) -> int:
        with self._noticing():
            return self._stream.write(text)

    def flush(self) -> None:
        with self._noticing():
            self._stream.flush()

    @contextmanager
    def _noticing(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            self.closed_by_reader = True
            raise

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)


def main() -> None:
    """Runs one command and exits with the code that scripts rely on; a reader that goes away is no error."""
    for each in (sys.stdout, sys.stderr):
        if isinstance(each, io.TextIOWrapper):
            each.reconfigure(errors="replace")  # a locale without µ gets a question mark, not a traceback
    stream = sys.stdout
    output = _Output(stream)
    sys.stdout = output
    try:
        try:
            _run()
        finally:
            output.flush()
    except (BrokenPipeError, SystemExit):
        if not output.closed_by_reader:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # what is left is for nobody
        sys.exit(NOBODY_READS)


def _run() -> None:
    """One command; shows errors without a traceback."""
    try:
        app(prog_name="servogen")
    except ServogenError as error:
        _say(str(error))
        sys.exit(error.exit_code)
    except KeyboardInterrupt:  # before or after the command itself
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        raise
    except OSError as error:
        _say(f"{error.filename}: {error.strerror}" if error.filename else str(error))
        sys.exit(2)
    except Exception:  # a defect of servogen: never the exit code of a verdict
        import traceback

        traceback.print_exc()
        _say("this is a defect of servogen itself; please report it with the lines above")
        sys.exit(ToolError.exit_code)


def _say(text: str) -> None:
    print(f"servogen: {text}", file=sys.stderr)
