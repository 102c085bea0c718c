"""Only regular files of a bounded size are read, and a pipe is refused without waiting for a writer."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.inputs import MAX_TEXT_BYTES, open_input, read_input


def fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def listening_socket(path: Path) -> Path:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


@pytest.mark.parametrize(
    ("made", "kind"),
    [
        (fifo, "a named pipe"),
        (listening_socket, "a socket"),
        (folder, "a directory"),
        (lambda path: Path("/dev/zero"), "a device"),
        (lambda path: Path("/dev/null"), "a device"),
    ],
)
@pytest.mark.parametrize("through_link", [False, True])
def test_what_is_not_a_regular_file_is_refused_unread(
    tmp_path: Path, made: Callable[[Path], Path], kind: str, through_link: bool
) -> None:
    path = made(tmp_path / "input")
    if through_link:
        link = tmp_path / "link"
        link.symlink_to(path)
        path = link
    with pytest.raises(InputError, match=f"{path}: error: is {kind}: only regular files are read"):
        open_input(path)


def test_a_file_of_the_largest_size_is_read_and_one_byte_more_is_not(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"x" * MAX_TEXT_BYTES)
    assert len(read_input(path)) == MAX_TEXT_BYTES
    path.write_bytes(b"x" * (MAX_TEXT_BYTES + 1))
    with pytest.raises(InputError, match="is larger than 1 MiB"):
        read_input(path)


def test_a_file_of_many_gigabytes_is_not_read_into_memory(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.touch()
    os.truncate(path, 1 << 40)  # a hole: it takes no room on the disk
    with pytest.raises(InputError, match="is larger than"):
        read_input(path)


@pytest.mark.parametrize("name", ["no such file", "a\0b", "x" * 300])
def test_a_name_that_opens_nothing_is_an_input_error(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_input(f"{tmp_path}/{name}")
