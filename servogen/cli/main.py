"""The process of `servogen`: its standard streams, and its exit code; `app` has the commands.

Exit codes: 0 done, and right if it was checked, 1 checked and found wrong, 2 bad input, 3 a tool or the bench
is missing or failed, 130 interrupted, 141 nobody reads the output: its reader has gone, or it was closed from
the start.
Output to a closed standard error is dropped, and does not change the exit code.
"""

from __future__ import annotations

import gc
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from servogen import NOBODY_READS, __version__
from servogen.cli.show import begin
from servogen.errors import Location, ToolError


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
    code = run_command()
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


def run_command() -> int:
    """Run one command and return its exit code."""
    if sys.argv[1:] == ["--version"]:
        print(f"servogen {__version__}")
        return 0
    # pydantic would read the metadata of every installed package to find plugins, of which servogen has none.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    gc.disable()  # imports make objects and no garbage; `app` switches it on when the command is loaded
    try:
        from servogen.cli.app import run  # typer alone takes longer than to print the version

        return run()
    finally:
        gc.enable()
