"""What commands share that move a robot over a serial line: the line, its keys, its end."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Annotated

import typer

from servogen.cli.options import baud_option
from servogen.drive.commands import KEYS, CommandSource, Keys, LineCommands, NoCommands, script, terminal_keys

KEYS_HELP = (
    "w a s d or the arrows, q e sideways, 1 to 9 poses, space stops, x ends; "
    "of a stream job: Tab selects a servo, + and - move it"
)
WALK_KEYS_HELP = "w a s d or the arrows (a robot with one button: Tab), space stops, q ends"

Port = Annotated[str | None, typer.Option("--port", "-p", help="The robot's serial port.")]
Baud = Annotated[int | None, baud_option("that of the job's stream table")]
RangeUs = Annotated[
    str | None,
    "The pulse widths of positions 0 and 254, such as 500,2500 (default: those of the job's stream table).",
]
First = Annotated[int, typer.Option(min=0, max=253, help="The first servo's number on the controller.")]


@dataclass(frozen=True, slots=True)
class WireOptions:
    """The serial line to the robot."""

    port: Port = None
    baud: Baud = None
    range_us: RangeUs = None
    first: First = 0
    patience: Annotated[
        float, typer.Option(min=0, help="How many seconds to wait for a port that has disappeared.")
    ] = 60.0
    dry_run: Annotated[bool, "Print the bytes without sending them."] = False


def was_interrupted(run: Callable[[], object]) -> bool:
    """Drive, and return whether Ctrl-C, or a signal that is taken for it, ended it."""
    try:
        with _signals_end_drive():
            run()
    except KeyboardInterrupt:
        return True
    return False


def command_source(
    steer: bool, dry_run: bool, keys: Keys | None = None, keys_help: str = KEYS_HELP
) -> AbstractContextManager[CommandSource]:
    """Return the source of commands: single keys, lines, or none."""
    if not steer:
        return nullcontext(NoCommands())
    if dry_run:
        return nullcontext(script(sys.stdin.read()))
    if sys.stdin.isatty():
        print(keys_help, file=sys.stderr)
        return terminal_keys(sys.stdin.fileno(), KEYS if keys is None else keys)
    return nullcontext(LineCommands(sys.stdin.fileno()))


@contextmanager
def _signals_end_drive() -> Iterator[None]:
    """End the drive at SIGTERM or a closed terminal as Ctrl-C does: the robot is stopped."""
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
