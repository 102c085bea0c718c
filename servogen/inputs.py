"""Input files of commands: only regular files, up to the size that their reader allows.

In: a path and, for a file that is read whole, its maximum size in bytes. Out: an open binary file, or the
bytes. Named pipes, devices, sockets and directories are refused before they are opened, because reading them
could block or never end.
"""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from typing import IO

from servogen.errors import InputError, Location

MAX_TEXT_BYTES = 1 << 20
"""The maximum size of a text that is read whole: a job, a program, a HEX file. Real ones have a tenth."""

_NUMBER = re.compile(r"[-+]?(\d{1,20}(\.\d{0,20})?|\.\d{1,20})([eE][-+]?\d{1,3})?", re.ASCII)
_COUNT = re.compile(r"\d{1,20}", re.ASCII)


def number_in(text: str) -> float | None:
    """Return the number that is the whole `text`, spaces aside: plain decimal notation, not all of Python's
    (`1_000`, `nan`, `infinity`, other digits), and so short that its exact value does not fill the memory.
    """
    return float(text) if _NUMBER.fullmatch(text.strip()) else None


def count_in(text: str) -> int | None:
    """Return the number that is the whole `text`, spaces aside: up to 20 digits."""
    return int(text) if _COUNT.fullmatch(text.strip()) else None


_KINDS = (
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def open_input(path: str | Path) -> IO[bytes]:
    """Return the regular file at `path`, open for reading. Raises InputError."""
    name = os.fspath(path)
    try:
        _require_regular(name, Path(name).stat().st_mode)
        # Non-blocking, because the file may have been replaced by a named pipe a moment ago.
        file = os.fdopen(os.open(name, os.O_RDONLY | _FLAGS), "rb")
    except OSError as error:
        raise InputError("unreadable-file", f"cannot be read: {error.strerror}", Location(name)) from error
    except ValueError as error:  # a NUL in the name, or a character that the file system cannot encode
        raise InputError(
            "unreadable-file", "cannot be read: this is not a valid file name", Location(name)
        ) from error
    try:
        _require_regular(name, os.fstat(file.fileno()).st_mode)
    except InputError:
        file.close()
        raise
    return file


_FLAGS = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)


def read_input(path: str | Path, limit: int = MAX_TEXT_BYTES) -> bytes:
    """Return the contents of the regular file at `path`, at most `limit` bytes. Raises InputError."""
    with open_input(path) as file:
        try:
            data = file.read(limit + 1)
        except OSError as error:
            raise InputError(
                "unreadable-file", f"cannot be read: {error.strerror}", Location(os.fspath(path))
            ) from error
    if len(data) > limit:
        raise InputError(
            "file-too-large",
            f"is larger than {size_text(limit)}",
            Location(os.fspath(path)),
            "files of this kind are smaller",
        )
    return data


def size_text(size: int) -> str:
    """Return a number of bytes as text: `1 MiB`, `600 bytes`."""
    for factor, unit in ((1 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size} bytes"


def _require_regular(name: str, mode: int) -> None:
    for is_kind, kind in _KINDS:
        if is_kind(mode):
            raise InputError("not-a-file", f"is {kind}: only regular files are read", Location(name))
