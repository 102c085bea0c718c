"""A file is whole or not there."""

import errno
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from servogen import outputs
from servogen.errors import InputError, ToolError
from servogen.outputs import atomic_write, make_folder, write_bytes, write_text


def test_the_text_is_written_as_utf8_with_line_feeds(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "1 µs\n2 µs\n")
    assert (tmp_path / "a.txt").read_bytes() == "1 µs\n2 µs\n".encode()


def test_bytes_are_written_as_they_are(tmp_path: Path) -> None:
    write_bytes(tmp_path / "a.bin", b"\r\n\x00")
    assert (tmp_path / "a.bin").read_bytes() == b"\r\n\x00"


def test_the_file_appears_only_when_the_block_has_ended(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with atomic_write(path) as file:
        file.write("x")
        assert not path.exists()
    assert path.read_text() == "x"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_after_an_error_the_old_file_is_as_it_was_and_nothing_is_left(
    tmp_path: Path, error: type[BaseException]
) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(error), atomic_write(path) as file:
        file.write("half of the new")
        raise error
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_a_link_and_its_file_is_written(tmp_path: Path) -> None:
    (tmp_path / "real.txt").write_text("old")
    link = tmp_path / "link.txt"
    link.symlink_to(tmp_path / "real.txt")
    write_text(link, "new")
    assert link.is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_a_link_to_itself_is_replaced(tmp_path: Path) -> None:
    link = tmp_path / "loop.txt"
    link.symlink_to(link)
    write_text(link, "new")
    assert link.read_text() == "new"


def test_a_device_is_written_in_place() -> None:
    write_text("/dev/null", "x")
    assert not Path("/dev/null").is_file()


def test_a_folder_is_made_with_those_above_it_and_may_be_there(tmp_path: Path) -> None:
    for _ in range(2):
        assert make_folder(tmp_path / "a b" / "ü").is_dir()


@pytest.mark.parametrize(("below", "says"), [("", "is a file"), ("/c", "is below a file")])
def test_a_folder_where_a_file_is_says_so(tmp_path: Path, below: str, says: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=f"file{below}: error: {says}, but a folder is to be created there"):
        make_folder(f"{tmp_path}/file{below}")


def test_a_missing_directory_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such directory"):
        write_text(tmp_path / "no" / "a.txt", "x")


def test_a_directory_is_not_a_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a directory"):
        write_text(tmp_path, "x")


def test_the_new_file_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    write_text(tmp_path / "a.txt", "x")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_an_open_file_of_the_process_is_written_where_it_stands(tmp_path: Path) -> None:
    """Not truncated, and not replaced: `> file` of a shell goes on behind what it holds."""
    path = tmp_path / "a.txt"
    for name in ("/dev/fd/{}", "/proc/self/fd/{}"):
        with path.open("w") as file:
            file.write("before\n")
            file.flush()
            write_text(name.format(file.fileno()), "1\n")
            write_bytes(name.format(file.fileno()), b"2\n")
            file.write("after\n")
        assert path.read_text() == "before\n1\n2\nafter\n"
    assert list(tmp_path.iterdir()) == [path]


def test_standard_output_and_error_are_written_behind_earlier_output(
    capfd: pytest.CaptureFixture[str],
) -> None:
    print("earlier")
    write_text("/dev/stdout", "out\n")
    write_text("/dev/stderr", "err\n")
    print("later")
    assert capfd.readouterr() == ("earlier\nout\nlater\n", "err\n")


def test_earlier_output_that_nobody_reads_is_not_an_error_of_the_file(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`servogen ... | head`: what was printed before is flushed first, into a pipe that is closed."""

    def closed() -> None:
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    monkeypatch.setattr(sys, "stdout", SimpleNamespace(flush=closed))
    with pytest.raises(BrokenPipeError):
        write_text("/dev/stdout", "text")


def test_a_descriptor_that_is_not_open_and_a_name_that_no_file_can_have_say_why(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        write_text("/dev/fd/4321", "x")
    assert str(caught.value).startswith("/dev/fd/4321: error: cannot be written: Bad file descriptor")
    with pytest.raises(InputError) as caught:
        write_text(tmp_path / ("a" * 300), "x")
    assert "cannot be written: File name too long [unwritable-file]" in str(caught.value)
    with pytest.raises(InputError, match=r"cannot be written: .*null"):
        write_text(f"{tmp_path}/a\0b", "x")
    with pytest.raises(InputError, match="the folder cannot be created: File name too long"):
        make_folder(tmp_path / ("a" * 300))
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_a_failure_and_an_error_of_the_block_is_its_own(tmp_path: Path) -> None:
    with pytest.raises(ToolError) as caught:
        write_text("/dev/full", "x")
    assert (
        str(caught.value) == "/dev/full: error: could not be written: No space left on device [write-failed]"
    )
    path = tmp_path / "a.txt"
    with pytest.raises(FileNotFoundError), atomic_write(path) as file:
        file.write((tmp_path / "missing").read_text())
    with pytest.raises(BrokenPipeError), atomic_write(path):
        raise BrokenPipeError
    failed = r"a\.txt: error: could not be written: Input/output error"
    with pytest.raises(ToolError, match=failed), atomic_write(path):
        raise OSError(errno.EIO, "Input/output error")
    assert list(tmp_path.iterdir()) == []


def test_only_parts_of_the_file_itself_are_removed(tmp_path: Path) -> None:
    """A part's name is `.NAME.`, eight digits and `.part`; a link of such a name leads elsewhere."""
    (tmp_path / "elsewhere").write_text("mine")
    others = {".a.txt.0123abc.part", ".a.txt.0123abcde.part", ".aXtxt.0123abcd.part", "a.txt.0123abcd.part"}
    for name in (*others, ".a.txt.0123abcd.part", ".a.txt.89efABCD.part"):
        (tmp_path / name).write_text("half")
    (tmp_path / ".a.txt.00000000.part").symlink_to("elsewhere")
    write_text(tmp_path / "a.txt", "new")
    left = {".a.txt.00000000.part", ".a.txt.89efABCD.part", "elsewhere", "a.txt"}
    assert {entry.name for entry in tmp_path.iterdir()} == others | left


def test_without_locks_files_are_written_and_no_part_is_taken_for_abandoned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_locks(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(outputs.fcntl, "flock", no_locks)
    part = tmp_path / ".a.txt.0123abcd.part"
    part.write_text("half")
    write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "new"
    assert part.exists()


def test_a_part_that_another_process_takes_for_abandoned_is_begun_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other one locks it first, or has removed it, before this one has its lock."""
    lock, tries = outputs.lock_part, []

    def late(handle: int, path: Path) -> bool:
        tries.append(path)
        if len(tries) == 1:
            with path.open() as other:
                outputs.fcntl.flock(other, outputs.fcntl.LOCK_EX)
                return lock(handle, path)
        if len(tries) == 2:
            path.unlink()
        if len(tries) == 3:
            path.rename(tmp_path / "moved")
            path.write_text("another file of the name")
        return lock(handle, path)

    monkeypatch.setattr(outputs, "lock_part", late)
    write_text(tmp_path / "a.txt", "new")
    assert len({*tries}) == 4
    assert (tmp_path / "a.txt").read_text() == "new"
