"""Files that are whole or not there: written under a temporary name, then renamed.

In: a path and its text or bytes. Out: the file, complete; after an error or an interrupt the old file, if
there was one, as it was. Line ends are \\n on every system, so that the same input gives the same bytes.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Literal, TextIO, overload

from servogen.errors import InputError, Place, ToolError


@overload
def atomic_write(path: str | Path, mode: Literal["w"] = "w") -> contextlib.AbstractContextManager[TextIO]: ...


@overload
def atomic_write(path: str | Path, mode: Literal["wb"]) -> contextlib.AbstractContextManager[IO[bytes]]: ...


def atomic_write(path: str | Path, mode: str = "w") -> contextlib.AbstractContextManager[Any]:
    """A file, UTF-8 text ("w") or bytes ("wb"), that takes the name `path` when the block ends without error.

    A device or a pipe (/dev/null, /dev/stdout) is written in place: it has no old content to keep.
    Raises InputError where the path cannot be written and ToolError where the disk fails.
    """
    return _opened(Path(path), mode)


def make_folder(path: str | Path) -> Path:
    """The folder `path`, made where it is not there. Raises InputError where it cannot be."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        what = "is a file" if folder.exists() else "is below a file"
        raise InputError(f"{what}, where a folder is to be made", Place(str(path))) from error
    except OSError as error:
        raise InputError(f"the folder cannot be made: {_reason(error)}", Place(str(path))) from error
    return folder


def write_text(path: str | Path, text: str) -> None:
    """`text` as the whole of the file `path`."""
    with atomic_write(path) as file:
        file.write(text)


def write_bytes(path: str | Path, data: bytes) -> None:
    """`data` as the whole of the file `path`."""
    with atomic_write(path, "wb") as file:
        file.write(data)


@contextmanager
def _opened(path: Path, mode: str) -> Iterator[IO[Any]]:
    target = _target(path)
    in_place = target.exists() and not target.is_file()
    name = target if in_place else target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    text = {} if "b" in mode else {"encoding": "utf-8", "newline": "\n"}
    try:
        file: IO[Any] = name.open(mode, **text)  # type: ignore[call-overload]
    except OSError as error:
        raise InputError(f"cannot be written: {_reason(error)}", Place(str(path))) from error
    try:
        with file:
            yield file
        if not in_place:
            name.replace(target)
    except OSError as error:
        ours = error.filename in (None, str(name))  # a write names no file; others are the block's own
        if ours and not isinstance(error, BrokenPipeError):
            raise ToolError(f"could not be written: {_reason(error)}", Place(str(path))) from error
        raise
    finally:
        if not in_place:
            name.unlink(missing_ok=True)


def _target(path: Path) -> Path:
    """The file itself where `path` is a link to it, so that the link stays."""
    if path.is_dir():
        raise InputError("is a directory, where a file is to be written", Place(str(path)))
    if path.is_symlink():
        path = path.resolve()
    if not path.parent.is_dir():
        raise InputError(
            "cannot be written: there is no such directory", Place(str(path)), f"make {path.parent}"
        )
    return path


def _reason(error: OSError) -> str:
    return os.strerror(error.errno) if error.errno else str(error)
