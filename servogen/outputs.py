"""Atomic output: files that are either complete or absent, and sets of files that change together.

In: a path and its text or bytes, or a folder and the names of a set. Out: the file, or all files of the set,
complete; after an error, an interrupt or a kill the old files remain unchanged. Leftovers of a killed process
are removed by the next process that writes the same files. Line ends are \\n on every system, so that the
same input gives the same bytes.

    folder/            ◀── exchanged in one step ──▶   .folder.1f2e3d4c.part/     the new set, written here
      main.hex  the old set                              main.hex  the new set
      notes.txt  the user's own    ── linked before ──▶  notes.txt
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import filecmp
import os
import re
import secrets
import shutil
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Literal, TextIO, overload

from servogen.errors import InputError, Location, ToolError

if os.name == "posix":
    import fcntl

PART = ".part"
"""The suffix of incomplete files and folders: `.NAME.1f2e3d4c.part`."""


@overload
def atomic_write(path: str | Path, mode: Literal["w"] = "w") -> contextlib.AbstractContextManager[TextIO]: ...


@overload
def atomic_write(path: str | Path, mode: Literal["wb"]) -> contextlib.AbstractContextManager[IO[bytes]]: ...


def atomic_write(path: str | Path, mode: str = "w") -> contextlib.AbstractContextManager[Any]:
    """Open a file, as UTF-8 text ("w") or bytes ("wb"), that is renamed to `path` when the block ends.

    After an error `path` stays as it was. Devices, pipes and open files of this process (/dev/null,
    /dev/stdout) are written in place, because they have no old content to keep. Raises InputError if the path
    cannot be written and ToolError if the disk fails.
    """
    return _open_output(Path(path), mode)


def make_folder(path: str | Path) -> Path:
    """Create the folder `path` if it does not exist, and return it. Raises InputError if it cannot be."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        problem = "is a file" if folder.exists() else "is below a file"
        raise InputError(
            "not-a-file", f"{problem}, but a folder is to be created there", Location(str(path))
        ) from error
    except OSError as error:
        raise InputError(
            "unwritable-file", f"the folder cannot be created: {_reason(error)}", Location(str(path))
        ) from error
    return folder


def write_text(path: str | Path, text: str) -> None:
    """Write `text` as the whole contents of the file `path`."""
    with atomic_write(path) as file:
        file.write(text)


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write `data` as the whole contents of the file `path`."""
    with atomic_write(path, "wb") as file:
        file.write(data)


@contextmanager
def replaced_files(folder: str | Path, names: Collection[str]) -> Iterator[Path]:
    """Yield an empty folder; the files written there move to `folder` when the block ends without an error.

    `names` are all files that such a set may have. They change in one step: whenever the process is killed,
    `folder` has either the whole old set or the whole new one. Other files in it stay. If the system cannot
    exchange folders, or if `folder` is the working directory, the old set is removed before the new one takes
    its place, so that even then two sets never mix. Raises InputError if `folder` cannot be created.
    """
    folder = Path(folder)
    if folder.exists():
        make_folder(folder)
    target = folder.resolve()
    parent = make_folder(target.parent)
    if not os.access(parent, os.W_OK):
        parent = make_folder(target)
    _remove_abandoned(parent, target, names)
    with _staging_folder(parent, target, folder) as staging:
        yield staging
        _swap_in(staging, target, names)


@contextmanager
def _staging_folder(parent: Path, target: Path, shown: Path) -> Iterator[Path]:
    """Yield a new folder beside `target`; it is locked as long as this process lives, and finally removed."""
    with contextlib.ExitStack() as held:
        locked = False
        while not locked:
            staging = _part_name(parent / target.name)
            try:
                staging.mkdir()
            except OSError as error:
                raise InputError(
                    "unwritable-file", f"cannot be written: {_reason(error)}", Location(str(shown))
                ) from error
            held.callback(shutil.rmtree, staging, ignore_errors=True)
            if os.name != "posix":
                break
            with suppress(FileNotFoundError):  # another process may remove it as soon as it exists
                locked = lock_part(held.enter_context(_hold(os.open(staging, os.O_RDONLY))), staging)
        yield staging


def _swap_in(staging: Path, target: Path, names: Collection[str]) -> None:
    """Replace those of `names` that `target` has with the files in `staging`."""
    if not target.exists():
        staging.rename(target)
    elif _same_files(staging, target, names):
        return  # it remains the same folder for processes that work in it
    elif _exchange_sets(staging, target, names):
        _carry(staging, target, names)
    else:
        _replace_in_place(staging, target, names)


def _exchange_sets(staging: Path, target: Path, names: Collection[str]) -> bool:
    """Link other files of `target` into `staging` and exchange both; return False if impossible."""
    if Path.cwd().is_relative_to(target) or staging.is_relative_to(target):
        return False
    try:
        shutil.copystat(target, staging)
        old, new = target.stat(), staging.stat()
        if (old.st_uid, old.st_gid) != (new.st_uid, new.st_gid):
            os.chown(staging, old.st_uid, old.st_gid)
        for entry in _other_entries(target, names):
            if entry.is_symlink() or not entry.is_dir():
                os.link(entry, staging / entry.name, follow_symlinks=False)
        exchange_folders(staging, target)
    except OSError:
        return False
    return True


def _replace_in_place(staging: Path, target: Path, names: Collection[str]) -> None:
    """Remove the old set, then move the new one in: not atomic, but two sets never mix."""
    try:
        for name in names:
            (target / name).unlink(missing_ok=True)
        for entry in sorted(staging.iterdir()):
            if entry.name in names:
                entry.replace(target / entry.name)
    except OSError as error:
        raise ToolError(
            "write-failed", f"could not be written: {_reason(error)}", Location(str(target))
        ) from error


def _same_files(staging: Path, target: Path, names: Collection[str]) -> bool:
    """Return whether the old set equals the new one, byte for byte."""
    new = {entry.name for entry in staging.iterdir()}
    if new != {name for name in names if (target / name).is_file()}:
        return False
    return all(filecmp.cmp(staging / name, target / name, shallow=False) for name in new)


def _other_entries(folder: Path, names: Collection[str]) -> list[Path]:
    """Return the entries of `folder` that belong neither to the set nor to leftovers of killed processes."""
    return [
        entry
        for entry in folder.iterdir()
        if entry.name not in names and not any(_is_part_of(entry.name, name) for name in names)
    ]


def _carry(old: Path, target: Path, names: Collection[str]) -> None:
    """Move entries that only `old` has and that are not of the set to `target`: folders, and late files."""
    for entry in _other_entries(old, names):
        if not os.path.lexists(target / entry.name):
            with suppress(FileNotFoundError):  # another process that cleans up was faster
                entry.rename(target / entry.name)


def _remove_abandoned(parent: Path, target: Path, names: Collection[str]) -> None:
    """Remove what killed processes have left of the set; move other files back to `target`."""
    for entry in _abandoned_parts(parent, target.name):
        if entry.is_dir():
            if target.is_dir():
                _carry(entry, target, names)
            shutil.rmtree(entry, ignore_errors=True)
    if target.is_dir():
        for name in names:
            for entry in _abandoned_parts(target, name):
                entry.unlink(missing_ok=True)


def _abandoned_parts(folder: Path, name: str) -> Iterator[Path]:
    """Yield this user's parts of `name` whose process has ended, as their locks are no longer held."""
    if os.name != "posix":  # without such locks, it cannot be known
        return
    for entry in [part for part in folder.iterdir() if _is_part_of(part.name, name)]:
        with suppress(OSError), _hold(os.open(entry, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)) as handle:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(handle).st_uid == os.geteuid():
                yield entry  # the caller removes it under the lock, so no process can have just begun it


@contextmanager
def _hold(handle: int) -> Iterator[int]:
    try:
        yield handle
    finally:
        os.close(handle)


def lock_part(handle: int, path: Path) -> bool:
    """Lock a new part as long as it is open; return False if a process that cleans up has removed it."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks, on which no process cleans up either
        return True
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False


def _part_name(target: Path) -> Path:
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}{PART}")


def _is_part_of(entry: str, name: str) -> bool:
    return re.fullmatch(rf"\.{re.escape(name)}\.[0-9a-f]{{8}}{re.escape(PART)}", entry) is not None


def exchange_folders(first: Path, second: Path) -> None:
    """Exchange the names of two folders in one step.

    Raises OSError if the file system or the operating system cannot do that.
    """
    if os.name != "posix":
        raise _no_exchange()
    library = ctypes.CDLL(None, use_errno=True)
    names = os.fsencode(first), os.fsencode(second)
    if hasattr(library, "renameat2"):
        here, exchange = -100, 2  # AT_FDCWD, RENAME_EXCHANGE of linux/fs.h
        failed = library.renameat2(here, names[0], here, names[1], exchange)
    elif hasattr(library, "renamex_np"):
        failed = library.renamex_np(*names, 2)  # RENAME_SWAP of macOS's sys/stdio.h
    else:
        raise _no_exchange()
    if failed:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def _no_exchange() -> OSError:
    return OSError(errno.ENOSYS, "this operating system cannot exchange two folders")


@contextmanager
def _open_output(path: Path, mode: str) -> Iterator[IO[Any]]:
    text = {} if "b" in mode else {"encoding": "utf-8", "newline": "\n", "errors": "backslashreplace"}
    descriptor = _descriptor(path)
    try:
        target = path if descriptor is not None else _target(path)
        in_place = descriptor is not None or (target.exists() and not target.is_file())
        if descriptor is not None:
            sys.stdout.flush()  # so that earlier output appears first
            name, file = target, os.fdopen(os.dup(descriptor), mode, **text)  # type: ignore[call-overload]
        elif in_place:
            name, file = target, target.open(mode, **text)  # type: ignore[call-overload]
        else:
            name, file = _open_part(target, mode, text)
    except BrokenPipeError:  # from earlier output
        raise
    except (OSError, ValueError) as error:  # ValueError: not a valid name on this system
        raise InputError(
            "unwritable-file", f"cannot be written: {_reason(error)}", Location(str(path))
        ) from error
    try:
        with file:
            yield file
        if not in_place:
            name.replace(target)
    except OSError as error:
        ours = error.filename in (None, str(name))  # errors of writes name no file; others are the block's
        if ours and not isinstance(error, BrokenPipeError):
            raise ToolError(
                "write-failed", f"could not be written: {_reason(error)}", Location(str(path))
            ) from error
        raise
    finally:
        if not in_place:
            name.unlink(missing_ok=True)


def _open_part(target: Path, mode: str, text: dict[str, str]) -> tuple[Path, IO[Any]]:
    """Create a file beside `target`, locked while it is open, after removing parts of killed processes."""
    for entry in _abandoned_parts(target.parent, target.name):
        entry.unlink(missing_ok=True)
    while True:
        name = _part_name(target)
        file: IO[Any] = name.open(mode.replace("w", "x"), **text)  # type: ignore[call-overload]
        if os.name != "posix" or lock_part(file.fileno(), name):
            return name, file
        file.close()


_DESCRIPTOR = re.compile(r"/dev/(?:(stdout)|(stderr)|fd/(\d{1,6}))|/proc/self/fd/(\d{1,6})")


def _descriptor(path: Path) -> int | None:
    """Return the descriptor of this process's open file that `path` names; opening it would truncate it."""
    match = _DESCRIPTOR.fullmatch(str(path))
    if match is None:
        return None
    return 1 if match[1] else 2 if match[2] else int(match[3] or match[4])


def _target(path: Path) -> Path:
    """Return the file that `path` links to, so that the link stays; `path` itself if it is not a link."""
    if path.is_dir():
        raise InputError(
            "not-a-file", "is a directory, but a file is to be written there", Location(str(path))
        )
    if path.is_symlink():
        path = Path(os.path.realpath(path))  # Path.resolve raises RuntimeError for a link to itself
    if not path.parent.is_dir():
        raise InputError(
            "unwritable-file",
            "cannot be written: there is no such directory",
            Location(str(path)),
            f"make {path.parent}",
        )
    return path


def _reason(error: OSError | ValueError) -> str:
    code = error.errno if isinstance(error, OSError) else None
    return os.strerror(code) if code else str(error)
