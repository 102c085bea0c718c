"""Commands of a person who drives a robot: typed words, or keys of a terminal.

In: a terminal, a pipe or a text. Out: a `CommandSource`, which returns the commands given since the last
call.
"""

from __future__ import annotations

import os
import select
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from servogen.errors import InputError, ToolError

if os.name == "posix":
    import termios
    import tty

FORWARD, BACK, LEFT, RIGHT = "forward", "back", "left", "right"
SIDEWAYS_LEFT, SIDEWAYS_RIGHT = "sideways-left", "sideways-right"
STOP, QUIT, WAIT = "stop", "quit", "wait"
NEXT, PREVIOUS, MORE, LESS, FINER, COARSER = "next", "previous", "+", "-", "finer", "coarser"
READ_BYTES = 1024

Keys = Mapping[str, tuple[bytes, ...]]
"""Commands and their keys."""

KEYS: Keys = {
    FORWARD: (b"w", b"\x1b[A", b"\x1bOA"),
    BACK: (b"s", b"\x1b[B", b"\x1bOB"),
    RIGHT: (b"d", b"\x1b[C", b"\x1bOC"),
    LEFT: (b"a", b"\x1b[D", b"\x1bOD"),
    SIDEWAYS_LEFT: (b"q",),
    SIDEWAYS_RIGHT: (b"e",),
    STOP: (b" ",),
    QUIT: (b"x", b"\x04"),
    NEXT: (b"\t",),
    PREVIOUS: (b"\x1b[Z",),
    MORE: (b"+", b"="),
    LESS: (b"-",),
    FINER: (b"[",),
    COARSER: (b"]",),
    **{str(digit): (str(digit).encode(),) for digit in range(1, 10)},
}
"""Commands and their keys; arrows as a terminal sends them in either of its modes (ECMA-48, DEC VT100)."""

WALK_KEYS: Keys = {
    **{command: KEYS[command] for command in (FORWARD, BACK, LEFT, RIGHT, STOP)},
    NEXT: KEYS[NEXT],
    QUIT: (b"q", *KEYS[QUIT]),
}
"""The keys of a walk on command."""


def segment_keys(names: Sequence[str]) -> Keys:
    """Return the keys of a motion whose segments are commanded: digits, in the order of the segments."""
    digits = {name: KEYS[str(number)] for number, name in enumerate(names, 1)}
    return {**digits, STOP: KEYS[STOP], QUIT: WALK_KEYS[QUIT]}


class CommandSource(Protocol):
    """A source of commands."""

    def since(self, seconds: float) -> list[str]:
        """Return the commands given since the last call; `seconds` is the time since the drive began."""


class NoCommands:
    """A source that gives no commands."""

    def since(self, seconds: float) -> list[str]:
        """Return an empty list."""
        return []


@dataclass(slots=True)
class LineCommands:
    """One command per line, read from a file descriptor without blocking; the end of the file is `quit`."""

    descriptor: int
    _text: bytes = b""
    _ended: bool = False
    _waiting: deque[str] = field(default_factory=deque)
    _until: float = 0.0

    def since(self, seconds: float) -> list[str]:
        """Return the commands that are due; commands after a `wait` are due once its time is over."""
        while not self._ended and _readable(self.descriptor):
            data = os.read(self.descriptor, READ_BYTES)
            self._ended = not data
            # The last line may lack its line end; a part of a line waits for the rest.
            *lines, self._text = (self._text + (data or b"\n")).split(b"\n")
            self._waiting.extend(commands_in(b"\n".join(lines).decode("utf-8", "replace")))
            if self._ended:
                self._waiting.append(QUIT)
        return self._due(seconds)

    def _due(self, seconds: float) -> list[str]:
        commands = []
        while self._waiting and seconds >= self._until:
            command = self._waiting.popleft()
            if command.split()[0] == WAIT:
                self._until = seconds + wait_seconds(command)
            else:
                commands.append(command)
        return commands


def script(text: str) -> LineCommands:
    """Return a source of the commands in a text, with `quit` at its end."""
    return LineCommands(-1, _ended=True, _waiting=deque([*commands_in(text), QUIT]))


def commands_in(text: str) -> list[str]:
    """Return the commands of a text, one per line, without empty lines and comments."""
    stripped = (line.partition("#")[0].strip() for line in text.splitlines())
    return [line for line in stripped if line]


def wait_seconds(command: str) -> float:
    """Return the seconds of `wait 1.5`. Raises InputError."""
    try:
        seconds = float(command.split(maxsplit=1)[1])
    except (IndexError, ValueError):
        seconds = -1.0
    if not 0 <= seconds < float("inf"):
        raise InputError("bad-command", f"'{command}' does not state how long to wait", hint="wait 1.5")
    return seconds


@dataclass(slots=True)
class KeyCommands:
    """The keys of a terminal, each of which is a command."""

    descriptor: int
    keys: Keys = field(default_factory=lambda: KEYS)

    def since(self, seconds: float) -> list[str]:
        """Return the commands of the keys pressed since the last call."""
        commands: list[str] = []
        while _readable(self.descriptor):
            data = os.read(self.descriptor, READ_BYTES)
            if not data:
                return [*commands, QUIT]
            commands += commands_of_keys(data, self.keys)
        return commands


def commands_of_keys(data: bytes, known: Keys = KEYS) -> list[str]:
    """Return the commands of the keys that a terminal sent; other keys are ignored."""
    commands: list[str] = []
    while data:
        matches = [(key, command) for command, keys in known.items() for key in keys if data.startswith(key)]
        commands += [command for _, command in matches]
        # An unknown key is skipped byte by byte.
        data = data[len(matches[0][0]) if matches else 1 :]
    return commands


@contextmanager
def terminal_keys(descriptor: int, keys: Keys = KEYS) -> Iterator[KeyCommands]:
    """Yield the keys of a terminal that neither echoes nor waits for Return; restore it afterwards.

    Raises ToolError on systems without POSIX terminals.
    """
    _require_posix()
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor)
        yield KeyCommands(descriptor, keys)
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _require_posix() -> None:
    """Raise ToolError on systems whose terminals and pipes cannot be polled."""
    if os.name != "posix":
        raise ToolError(
            "tool-missing",
            "steering needs a terminal or pipe that can be polled, which this system does not have",
            hint="without --keys, drive plays the job's motion or goes to a --pose",
        )


def _readable(descriptor: int) -> bool:
    _require_posix()
    return bool(select.select([descriptor], (), (), 0)[0])
