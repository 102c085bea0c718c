"""A text file in blocks: whole lines of a few megabytes, with the number of the first line; and where a
trace ends.

In: a path. Out: bytes with line ends \\n; the last line, read from the end of the file without the rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from servogen.edges import EdgeChunk, EdgeTrace
from servogen.errors import InputError, Location
from servogen.inputs import open_input, size_text
from servogen.units import Clock, Cycles

BLOCK_BYTES = 1 << 22
TAIL_BYTES = 1 << 12
MAX_LINE_BYTES = 1 << 20
"""The maximum length of a line: without it, a file without line ends would be held in memory completely."""


def line_blocks(path: Path, start: int = 0, line: int = 1) -> Iterator[tuple[int, bytes]]:
    """Yield (number of the first line, whole lines) from byte `start`, the start of line `line`.

    Raises InputError for a line that is longer than MAX_LINE_BYTES.
    """
    with open_input(path) as file:
        file.seek(start)
        rest = b""
        while data := file.read(BLOCK_BYTES):
            whole, feed, after = data.rpartition(b"\n")
            if feed:
                block = (rest + whole + feed).replace(b"\r\n", b"\n")
                yield line, block
                line += block.count(b"\n")
                rest = after
            else:
                rest += after
            if len(rest) > MAX_LINE_BYTES:
                raise _too_long(path, line)
        if rest:
            yield line, rest.removesuffix(b"\r") + b"\n"


def last_line(path: Path) -> bytes:
    """Return the last line that is not blank, stripped; empty if there is none. Raises InputError."""
    with open_input(path) as file:
        size = file.seek(0, 2)
        wanted = TAIL_BYTES
        while True:
            file.seek(max(0, size - wanted))
            tail = file.read().rstrip()
            if b"\n" in tail or wanted >= size:
                return tail.rpartition(b"\n")[2].strip()
            if wanted > MAX_LINE_BYTES:
                raise _too_long(path, None)
            wanted *= 8


def first_lines(path: Path, count: int) -> list[bytes]:
    """Return the first `count` lines with their line ends; empty ones after the end. Raises InputError."""
    with open_input(path) as file:
        lines = [file.readline(MAX_LINE_BYTES + 1) for _ in range(count)]
    for number, line in enumerate(lines, 1):
        if len(line) > MAX_LINE_BYTES:
            raise _too_long(path, number)
    return lines


def _too_long(path: Path, line: int | None) -> InputError:
    which = "the last line" if line is None else "the line"
    return InputError(
        "file-too-large", f"{which} is longer than {size_text(MAX_LINE_BYTES)}", Location(str(path), line)
    )


def ended(clock: Clock, chunks: Iterable[EdgeChunk], known: Cycles, end: int | None) -> EdgeTrace:
    """Return the edges up to `end`, which may cut the trace or extend it; by default up to `known`, the end
    given in the file.
    """
    if end is None:
        return EdgeTrace(clock, chunks, known)
    return EdgeTrace(clock, chunks, Cycles(max(known, end))).until(end)
