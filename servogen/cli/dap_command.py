"""`servogen dap`: the debugger of editors."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import typer

from servogen.cli.files import read_program
from servogen.cli.page_server import running_page
from servogen.dap import DebugSession, Messages, serve
from servogen.programs import Program


def dap() -> None:
    """Debug a program in an editor: speaks the Debug Adapter Protocol on standard input and output."""
    failures: list[str] = []
    session = DebugSession(Messages(sys.stdout.buffer).send, _read, running_page)
    # A stream of its own: Python would wait at its end for the thread that still reads from sys.stdin.
    stream = os.fdopen(os.dup(sys.stdin.fileno()), "rb")  # never closed: the thread may be reading
    serve(stream, session, failures.append)
    if failures:
        print(f"servogen dap: {failures[0]}", file=sys.stderr)
        raise typer.Exit(2)


def _read(path: Path, device: str | None) -> Program:
    return read_program(path, device)
