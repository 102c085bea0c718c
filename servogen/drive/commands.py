"""Orders: the words that a person types or keys stand for, and what takes them.

In: nothing. Out: `WAYS`, `Rates`, and the protocol `Steering`, a `Motion` without an end that takes orders.
"""

from __future__ import annotations

import os
import select
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from servogen.errors import InputError, ToolError, did_you_mean
from servogen.motion.trajectory import Floats

if os.name == "posix":
    import termios
    import tty

STOP = "stop"
WAYS: Mapping[str, tuple[int, int, int]] = {
    "forward": (1, 0, 0),
    "back": (-1, 0, 0),
    "left": (0, 0, 1),
    "right": (0, 0, -1),
    "sideways-left": (0, 1, 0),
    "sideways-right": (0, -1, 0),
}
"""Orders and what the body does: along x, along y, about z."""


@dataclass(frozen=True, slots=True)
class Rates:
    """How far a walking robot goes in a cycle, how fast a base goes in a second. None: as in the job."""

    way_mm: float | None = None
    turn_deg: float | None = None


class Steering(Protocol):
    """A `Motion` without an end that takes orders; `words` are those it knows."""

    @property
    def words(self) -> tuple[str, ...]: ...

    def order(self, word: str) -> None:
        """Raises InputError for a word that is none."""

    def at(self, seconds: float) -> Floats | None: ...


def unknown(word: str, words: Iterable[str]) -> InputError:
    return InputError("unknown-command", f"'{word}' is no order", hint=did_you_mean(word, words))


QUIT, WAIT = "quit", "wait"
READ_BYTES = 1024

KEYS: Mapping[str, tuple[bytes, ...]] = {
    "forward": (b"w", b"\x1b[A", b"\x1bOA"),
    "back": (b"s", b"\x1b[B", b"\x1bOB"),
    "right": (b"d", b"\x1b[C", b"\x1bOC"),
    "left": (b"a", b"\x1b[D", b"\x1bOD"),
    "sideways-left": (b"q",),
    "sideways-right": (b"e",),
    "stop": (b" ",),
    QUIT: (b"x", b"\x04"),
    **{str(digit): (str(digit).encode(),) for digit in range(1, 10)},
}
"""Words and their keys; arrows as a terminal sends them in either of its modes (ECMA-48, DEC VT100)."""


class Words(Protocol):
    """Where orders come from."""

    def since(self, seconds: float) -> list[str]:
        """What came since it was asked last, at that moment of the drive."""


class Silence:
    """No orders at all."""

    def since(self, seconds: float) -> list[str]:
        return []


@dataclass(slots=True)
class Lines:
    """One order a line, from a file descriptor that is never waited for."""

    descriptor: int
    _text: bytes = b""
    _ended: bool = False
    _waiting: deque[str] = field(default_factory=deque)
    _until: float = 0.0

    def since(self, seconds: float) -> list[str]:
        while not self._ended and _readable(self.descriptor):
            data = os.read(self.descriptor, READ_BYTES)
            self._ended = not data
            *lines, self._text = (self._text + (data or b"\n")).split(b"\n")
            self._waiting.extend(lines_of(b"\n".join(lines).decode("utf-8", "replace")))
            if self._ended:
                self._waiting.append(QUIT)
        return self._due(seconds)

    def _due(self, seconds: float) -> list[str]:
        words = []
        while self._waiting and seconds >= self._until:
            word = self._waiting.popleft()
            if word.split()[0] == WAIT:
                self._until = seconds + wait_of(word)
            else:
                words.append(word)
        return words


def script(text: str) -> Lines:
    """All orders of a text that is there already."""
    return Lines(-1, _ended=True, _waiting=deque([*lines_of(text), QUIT]))


def lines_of(text: str) -> list[str]:
    """Orders without empty lines and comments."""
    stripped = (line.partition("#")[0].strip() for line in text.splitlines())
    return [line for line in stripped if line]


def wait_of(line: str) -> float:
    """The seconds of `wait 1.5`. Raises InputError."""
    try:
        seconds = float(line.split(maxsplit=1)[1])
    except (IndexError, ValueError):
        seconds = -1.0
    if not 0 <= seconds < float("inf"):
        raise InputError("bad-command", f"'{line}' does not say how long", hint="wait 1.5")
    return seconds


@dataclass(slots=True)
class Keys:
    """Keys of a terminal, one at a time."""

    descriptor: int

    def since(self, seconds: float) -> list[str]:
        words: list[str] = []
        while _readable(self.descriptor):
            data = os.read(self.descriptor, READ_BYTES)
            if not data:
                return [*words, QUIT]
            words += words_of(data)
        return words


def words_of(data: bytes) -> list[str]:
    """The words of what a terminal sent; other keys are none."""
    words: list[str] = []
    while data:
        found = [(key, word) for word, keys in KEYS.items() for key in keys if data.startswith(key)]
        words += [word for _, word in found]
        data = data[len(found[0][0]) if found else 1 :]
    return words


@contextmanager
def keys(descriptor: int) -> Iterator[Keys]:
    """The terminal without echo and without waiting for Return; as it was when the block ends.

    Raises ToolError on systems without POSIX terminals.
    """
    if os.name != "posix":
        raise ToolError(
            "tool-missing", "single keys need a POSIX terminal", hint="pipe orders in, one a line"
        )
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor)
        yield Keys(descriptor)
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _readable(descriptor: int) -> bool:
    return bool(select.select([descriptor], (), (), 0)[0])
