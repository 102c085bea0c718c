"""A set of files changes all at once: it is whole and of one build, whenever its writer is killed."""

import errno
import os
import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

from servogen import outputs
from servogen.errors import InputError, Location, ToolError
from servogen.outputs import atomic_write, replaced_files, write_text

NAMES = frozenset(f"f{number}" for number in range(8))


def write_set(folder: Path, text: str, names: frozenset[str] = NAMES) -> None:
    with replaced_files(folder, NAMES) as new:
        for name in names:
            write_text(new / name, text)


def contents(folder: Path) -> dict[str, str]:
    return {entry.name: entry.read_text() for entry in folder.iterdir() if entry.is_file()}


def test_the_new_set_takes_the_place_of_the_old_one_whole(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "out"
    write_set(folder, "old")
    assert contents(folder) == dict.fromkeys(NAMES, "old")
    write_set(folder, "new", NAMES - {"f3"})
    assert contents(folder) == dict.fromkeys(NAMES - {"f3"}, "new"), "a file of the old set would mix them"
    assert list(folder.parent.iterdir()) == [folder]


def test_nothing_changes_before_the_block_has_ended_or_after_an_error(tmp_path: Path) -> None:
    write_set(tmp_path / "out", "old")
    with pytest.raises(KeyboardInterrupt), replaced_files(tmp_path / "out", NAMES) as new:
        write_text(new / "f1", "new")
        assert contents(tmp_path / "out") == dict.fromkeys(NAMES, "old")
        raise KeyboardInterrupt
    assert contents(tmp_path / "out") == dict.fromkeys(NAMES, "old")
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]


def users_own(folder: Path) -> None:
    (folder / "notes.txt").write_text("mine")
    (folder / "more" / "deep").mkdir(parents=True)
    (folder / "more" / "deep" / "a").write_text("mine")
    (folder / "link").symlink_to("notes.txt")
    (folder / "dangling").symlink_to("nowhere")
    folder.chmod(0o750)


def check_users_own(folder: Path) -> None:
    assert (folder / "notes.txt").read_text() == "mine"
    assert (folder / "more" / "deep" / "a").read_text() == "mine"
    assert (folder / "link").readlink() == Path("notes.txt")
    assert (folder / "dangling").readlink() == Path("nowhere")
    assert folder.stat().st_mode & 0o777 == 0o750


@pytest.mark.parametrize("way", ["exchanged", "working directory", "no exchange", "through a link"])
def test_the_users_own_files_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    folder = tmp_path / "out"
    write_set(folder, "old")
    users_own(folder)
    named = folder
    if way == "working directory":
        monkeypatch.chdir(folder)
        named = Path()
    elif way == "no exchange":
        monkeypatch.setattr(outputs, "exchange_folders", no_exchange)
    elif way == "through a link":
        named = tmp_path / "link"
        named.symlink_to(folder)
    inode = folder.stat().st_ino
    write_set(named, "new")
    assert all((folder / name).read_text() == "new" for name in NAMES)
    check_users_own(folder)
    in_place = way in ("working directory", "no exchange")
    assert (folder.stat().st_ino == inode) == in_place
    assert sorted(entry.name for entry in tmp_path.iterdir()) == sorted({"out", named.name or "out"})


def no_exchange(first: Path, second: Path) -> None:
    raise OSError("not on this file system")


def test_without_an_exchange_sets_are_never_mixed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each file that moves in sees no file of the old set."""
    monkeypatch.setattr(outputs, "exchange_folders", no_exchange)
    write_set(tmp_path / "out", "old")
    move, seen = Path.replace, []

    def moved(self: Path, target: Path) -> Path:
        seen.append(set(contents(tmp_path / "out").values()))
        return move(self, target)

    with replaced_files(tmp_path / "out", NAMES) as new:
        for name in NAMES:
            write_text(new / name, "new")
        monkeypatch.setattr(Path, "replace", moved)
    assert len(seen) == len(NAMES)
    assert all("old" not in each for each in seen)


@pytest.mark.parametrize("system", ["nt", "posix"])
def test_a_system_that_cannot_exchange_folders_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, system: str
) -> None:
    """Neither Windows nor a C library without renameat2 and renamex_np; the set is written all the same."""
    library = SimpleNamespace()
    monkeypatch.setattr(outputs.ctypes, "CDLL", lambda *_args, **_options: library)
    with monkeypatch.context() as windows:
        windows.setattr(outputs.os, "name", system)
        with pytest.raises(OSError, match="cannot exchange two folders") as error:
            outputs.exchange_folders(tmp_path / "a", tmp_path / "b")
    assert error.value.errno == errno.ENOSYS
    write_set(tmp_path / "out", "old")
    write_set(tmp_path / "out", "new")
    assert set(contents(tmp_path / "out").values()) == {"new"}


@pytest.mark.parametrize("result", [0, -1])
@pytest.mark.parametrize("call", ["renameat2", "renamex_np"])
def test_an_exchange_is_asked_for_in_the_words_of_the_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str, result: int
) -> None:
    """RENAME_EXCHANGE (linux/fs.h) and RENAME_SWAP (sys/stdio.h of macOS) are both 2, AT_FDCWD is -100."""
    asked: list[tuple[object, ...]] = []
    library = SimpleNamespace(**{call: lambda *given: asked.append(given) or result})
    monkeypatch.setattr(outputs.ctypes, "CDLL", lambda *_args, **_options: library)
    monkeypatch.setattr(outputs.ctypes, "get_errno", lambda: errno.EXDEV)
    first, second = tmp_path / "a", tmp_path / "b"
    with nullcontext() if result == 0 else pytest.raises(OSError, match=os.strerror(errno.EXDEV)) as failed:
        outputs.exchange_folders(first, second)
    assert result == 0 or failed.value.errno == errno.EXDEV
    names = os.fsencode(first), os.fsencode(second)
    assert asked == [(-100, names[0], -100, names[1], 2) if call == "renameat2" else (*names, 2)]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root gives files away")
def test_a_folder_stays_its_owners_whoever_builds(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    write_set(folder, "old")
    os.chown(folder, 1234, 5678)
    inode = folder.stat().st_ino
    write_set(folder, "new")
    found = folder.stat()
    assert (found.st_uid, found.st_gid) == (1234, 5678)
    assert found.st_ino != inode, "exchanged"


def test_a_set_that_cannot_be_replaced_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder has the name of a file of the set, and the system does not exchange folders."""
    monkeypatch.setattr(outputs, "exchange_folders", no_exchange)
    folder = tmp_path / "out"
    (folder / "f1").mkdir(parents=True)
    with pytest.raises(ToolError, match="could not be written: ") as failed:
        write_set(folder, "new")
    assert (failed.value.code, failed.value.first.location) == ("write-failed", Location(str(folder)))
    assert list(tmp_path.iterdir()) == [folder]


def test_the_same_set_again_leaves_the_folder_alone(tmp_path: Path) -> None:
    write_set(tmp_path / "out", "same")
    inodes = {entry.name: entry.stat().st_ino for entry in (tmp_path / "out").iterdir()}
    write_set(tmp_path / "out", "same")
    assert inodes == {entry.name: entry.stat().st_ino for entry in (tmp_path / "out").iterdir()}


def test_a_folder_whose_parent_cannot_be_written_is_written_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "out").mkdir()
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    write_set(tmp_path / "out", "new")
    assert contents(tmp_path / "out") == dict.fromkeys(NAMES, "new")
    assert len(list((tmp_path / "out").iterdir())) == len(NAMES)


def test_a_file_where_the_folder_is_to_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(InputError, match="is a file, but a folder is to be created there"):
        write_set(tmp_path / "out", "new")
    assert (tmp_path / "out").read_text() == "mine"


KILLED = """
import os, signal, sys
from pathlib import Path
from servogen import outputs
from servogen.outputs import atomic_write, replaced_files, write_text
folder, moment = Path(sys.argv[1]), sys.argv[2]
exchange = outputs.exchange_folders
def die(*_):
    os.kill(os.getpid(), signal.SIGKILL)
def exchanged(*names):
    exchange(*names)
    die()
if moment == "before the exchange":
    outputs.exchange_folders = die
if moment == "after the exchange":
    outputs.exchange_folders = exchanged
if moment == "in a file":
    with atomic_write(folder / "f0") as file:
        file.write("half")
        file.flush()
        die()
with replaced_files(folder, [f"f{n}" for n in range(8)]) as new:
    for n in range(8):
        write_text(new / f"f{n}", "killed")
        if moment == "while writing" and n == 4:
            die()
"""


@pytest.mark.parametrize(
    ("moment", "stands"),
    [
        ("in a file", "old"),
        ("while writing", "old"),
        ("before the exchange", "old"),
        ("after the exchange", "killed"),
    ],
)
def test_what_a_killed_process_leaves_is_whole_and_the_next_cleans_up(
    tmp_path: Path, moment: str, stands: str
) -> None:
    folder = tmp_path / "out"
    write_set(folder, "old")
    users_own(folder)
    ran = subprocess.run([sys.executable, "-c", KILLED, str(folder), moment])
    assert ran.returncode == -signal.SIGKILL
    assert {(folder / name).read_text() for name in NAMES} == {stands}
    parts = [*tmp_path.glob(".*.part"), *folder.glob(".*.part")]
    assert len(parts) == 1
    write_set(folder, "new")
    assert {(folder / name).read_text() for name in NAMES} == {"new"}
    check_users_own(folder)
    assert list(tmp_path.iterdir()) == [folder]
    assert not list(folder.glob(".*.part"))


def test_a_part_of_a_killed_process_is_removed_when_its_file_is_written_again(tmp_path: Path) -> None:
    (tmp_path / ".a.txt.0123abcd.part").write_text("half")
    (tmp_path / ".a.txt.mine.part").write_text("not a part")
    write_text(tmp_path / "a.txt", "new")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == [".a.txt.mine.part", "a.txt"]


def test_a_part_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    with atomic_write(tmp_path / "a.txt") as first:
        first.write("first")
        write_text(tmp_path / "a.txt", "second")
        assert len(list(tmp_path.glob(".a.txt.*.part"))) == 1
    assert (tmp_path / "a.txt").read_text() == "first"
    write_set(tmp_path / "out", "old")
    with replaced_files(tmp_path / "out", NAMES) as outer:
        write_set(tmp_path / "out", "inner")
        for name in NAMES:
            write_text(outer / name, "outer")
    assert contents(tmp_path / "out") == dict.fromkeys(NAMES, "outer")


def test_a_lone_surrogate_does_not_stop_a_file(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "of \udcff.c\n")
    assert (tmp_path / "a.txt").read_text() == "of \\udcff.c\n"


def test_a_folder_beside_which_nothing_can_be_written_says_why(tmp_path: Path) -> None:
    """A part's name is fifteen characters longer than that of its folder; file systems allow 255."""
    folder = tmp_path / ("a" * 245)
    with pytest.raises(InputError) as caught:
        write_set(folder, "new")
    assert str(caught.value) == f"{folder}: error: cannot be written: File name too long [unwritable-file]"
    assert list(tmp_path.iterdir()) == []
