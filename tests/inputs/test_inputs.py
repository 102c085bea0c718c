"""Only regular files of a bounded size are read, and a pipe is refused without waiting for a writer."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.inputs import MAX_TEXT_BYTES, count_in, number_in, open_input, read_input, size_text
from tests.time_limit import time_limit


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


def test_a_pipe_that_replaces_a_file_as_it_is_opened_is_refused_and_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The path is that of a file when it is looked at first; no writer of the pipe is waited for."""
    file, pipe = tmp_path / "file", fifo(tmp_path / "pipe")
    file.touch()
    of_file = file.stat()
    opened = []
    open_as = os.fdopen

    def noted(handle: int, mode: str) -> object:
        opened.append(open_as(handle, mode))
        return opened[-1]

    monkeypatch.setattr(os, "fdopen", noted)
    monkeypatch.setattr(Path, "stat", lambda path: of_file)
    with time_limit(60), pytest.raises(InputError, match="is a named pipe: only regular files are read"):
        open_input(pipe)
    assert [each.closed for each in opened] == [True]


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="only Linux has this file")
def test_a_file_that_fails_as_it_is_read_is_an_input_error() -> None:
    """The memory of this process from address 0 on, where nothing is mapped: EIO."""
    with pytest.raises(InputError, match=r"/proc/self/mem: error: cannot be read: Input/output error"):
        read_input("/proc/self/mem")


@pytest.mark.parametrize(
    ("size", "text"),
    [
        *((0, "0 bytes"), (1023, "1023 bytes"), (1024, "1 KiB"), (1536, "1.5 KiB")),
        *((1 << 20, "1 MiB"), (16 << 20, "16 MiB"), (1 << 30, "1 GiB")),
    ],
)
def test_a_size_is_in_the_largest_unit_that_it_fills(size: int, text: str) -> None:
    assert size_text(size) == text


@pytest.mark.parametrize(
    ("text", "number"),
    [("1", 1), (" 2.5 ", 2.5), ("-.5", -0.5), ("+3.", 3), ("1e-3", 0.001), ("2.5E+2", 250)],
)
def test_a_number_in_a_file_is_its_whole_text(text: str, number: float) -> None:
    assert number_in(text) == number


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1_000",
        "nan",
        "inf",
        "0,5",
        "1 2",
        "1e",
        "1.2.3",
        "0x10",
        "5mm",
        "9" * 21,
        "1e9999",
        "\N{FULLWIDTH DIGIT ONE}",
    ],
)
def test_what_is_only_in_part_a_number_is_none(text: str) -> None:
    assert number_in(text) is None


def test_a_count_is_digits_alone_and_few() -> None:
    assert [count_in(text) for text in ("0", " 12 ", "9" * 20)] == [0, 12, 10**20 - 1]
    wrong = ("", "-1", "1.0", "1e3", "1_000", "1 2", "\N{SUPERSCRIPT TWO}", "9" * 21, "9" * 5000)
    assert not [text for text in wrong if count_in(text) is not None]
