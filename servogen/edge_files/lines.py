"""A file of lines in blocks: whole lines of a few megabytes, with the number of the first.

In: a path. Out: bytes, line ends made \\n; the last line, from the end of the file, without reading the rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO

from servogen.errors import InputError, Place

BLOCK_BYTES = 1 << 22
TAIL_BYTES = 1 << 12


def open_input(path: Path) -> IO[bytes]:
    """The file at `path`, or an InputError that says why it cannot be read."""
    try:
        return path.open("rb")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", Place(str(path))) from error


def line_blocks(path: Path, start: int = 0, line: int = 1) -> Iterator[tuple[int, bytes]]:
    """(number of the first line, whole lines) from byte `start`, which is the start of line `line`."""
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
        if rest:
            yield line, rest.removesuffix(b"\r") + b"\n"


def last_line(path: Path) -> bytes:
    """The last line that is not blank, stripped; empty when there is none."""
    with open_input(path) as file:
        size = file.seek(0, 2)
        wanted = TAIL_BYTES
        while True:
            file.seek(max(0, size - wanted))
            tail = file.read().rstrip()
            if b"\n" in tail or wanted >= size:
                return tail.rpartition(b"\n")[2].strip()
            wanted *= 8
