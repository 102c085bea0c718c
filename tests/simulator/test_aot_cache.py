"""The machine code of the instruction loop, kept across processes: never a wrong or a torn one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from servogen.simulator import aot_cache

CODE = b"\x7fELF not really"


@pytest.fixture
def folders(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Path]:
    """Two folders of our own to keep machine code in."""
    found = [tmp_path / "first", tmp_path / "second"]
    monkeypatch.setattr(aot_cache, "_folders", lambda: iter(found))
    return found


def test_what_is_kept_is_read_again(folders: list[Path]) -> None:
    aot_cache._keep("simulator-plain-1.o", CODE)
    assert aot_cache._kept(folders[0] / "simulator-plain-1.o") == CODE
    assert not folders[1].exists()


def test_a_torn_or_missing_file_counts_as_none(folders: list[Path]) -> None:
    aot_cache._keep("simulator-plain-1.o", CODE)
    path = folders[0] / "simulator-plain-1.o"
    path.write_bytes(path.read_bytes()[:-1])
    assert aot_cache._kept(path) is None
    assert aot_cache._kept(folders[0] / "simulator-plain-2.o") is None
    path.write_bytes(b"")
    assert aot_cache._kept(path) is None


def test_a_new_version_takes_the_place_of_the_old_one(folders: list[Path]) -> None:
    aot_cache._keep("simulator-plain-1.o", CODE)
    aot_cache._keep("simulator-observed-1.o", CODE)
    aot_cache._keep("simulator-plain-2.o", CODE)
    assert sorted(path.name for path in folders[0].iterdir()) == [
        "simulator-observed-1.o",
        "simulator-plain-2.o",
    ]


def test_where_the_first_folder_cannot_be_written_the_next_is_taken(folders: list[Path]) -> None:
    folders[0].write_text("a file is in the way")
    aot_cache._keep("simulator-plain-1.o", CODE)
    assert aot_cache._kept(folders[1] / "simulator-plain-1.o") == CODE


def test_the_name_says_what_the_code_was_made_of(monkeypatch: pytest.MonkeyPatch) -> None:
    before = aot_cache._digest()
    assert aot_cache._digest() == before
    monkeypatch.setattr(aot_cache, "OPS", {"NOP": 1})
    assert aot_cache._digest() != before


def test_code_that_needs_what_only_numba_has_is_refused() -> None:
    text = "declare void @NRT_Free(ptr)\ndefine i32 @f() {\n  call void @NRT_Free(ptr null)\n  ret i32 0\n}\n"
    with pytest.raises(aot_cache.ToolError, match="NRT_Free"):
        aot_cache._alone(text, "f")
    kept = aot_cache._alone("declare void @NRT_Free(ptr)\ndefine i32 @f() {\n  ret i32 0\n}\n", "f")
    assert f"@{aot_cache.ENTRY}()" in kept


@pytest.mark.parametrize("mode", [0o664, 0o646, 0o666])
def test_a_file_that_others_can_write_is_not_loaded(folders: list[Path], mode: int) -> None:
    aot_cache._keep("simulator-plain-1.o", CODE)
    path = folders[0] / "simulator-plain-1.o"
    path.chmod(mode)
    assert aot_cache._kept(path) is None
    path.chmod(0o644)
    assert aot_cache._kept(path) == CODE


@pytest.mark.parametrize("mode", [0o775, 0o757, 0o1777])
@pytest.mark.parametrize("above", [0, 1])
def test_a_file_below_a_folder_that_others_can_write_is_not_loaded(
    folders: list[Path], tmp_path: Path, mode: int, above: int
) -> None:
    folders[0] = tmp_path / "above" / "first"
    aot_cache._keep("simulator-plain-1.o", CODE)
    path = folders[0] / "simulator-plain-1.o"
    path.parents[above].chmod(mode)
    sticky = mode == 0o1777  # there nobody can replace what is another's
    assert aot_cache._kept(path) == (CODE if sticky else None)


def test_a_file_of_another_user_is_not_loaded(folders: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    aot_cache._keep("simulator-plain-1.o", CODE)
    path = folders[0] / "simulator-plain-1.o"
    if os.geteuid() == 0:
        os.chown(path, 12345, 12345)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert aot_cache._kept(path) is None


def test_a_folder_of_another_user_is_neither_written_nor_read(folders: list[Path]) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can give a folder away")
    folders[0].mkdir()
    os.chown(folders[0], 12345, 12345)
    aot_cache._keep("simulator-plain-1.o", CODE)
    assert not list(folders[0].iterdir())
    assert aot_cache._kept(folders[1] / "simulator-plain-1.o") == CODE


def test_a_link_to_machine_code_is_not_loaded(folders: list[Path], tmp_path: Path) -> None:
    aot_cache._keep("simulator-plain-1.o", CODE)
    link = folders[0] / "simulator-plain-2.o"
    link.symlink_to(folders[0] / "simulator-plain-1.o")
    assert aot_cache._kept(link) is None


def test_what_is_made_is_the_users_alone_whatever_the_umask(folders: list[Path], tmp_path: Path) -> None:
    folders[0] = tmp_path / "cache" / "servogen"
    before = os.umask(0)
    try:
        aot_cache._keep("simulator-plain-1.o", CODE)
    finally:
        os.umask(before)
    assert aot_cache._kept(folders[0] / "simulator-plain-1.o") == CODE


def test_a_user_without_a_home_keeps_nothing_there(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless(self: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    monkeypatch.setattr(Path, "expanduser", homeless)
    assert [folder.name for folder in aot_cache._folders()] == ["__pycache__"]


def test_a_cache_that_depends_on_the_working_directory_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "not/absolute")
    assert [folder.name for folder in aot_cache._folders()] == ["__pycache__"]


def test_the_first_start_says_what_takes_so_long(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(aot_cache, "_folders", lambda: iter(()))
    monkeypatch.setattr(aot_cache, "compile_loop", lambda observed, tracked, visits: CODE)
    monkeypatch.setattr(aot_cache, "_load", lambda code: code)
    with caplog.at_level("INFO", "servogen"):
        assert aot_cache.loop.__wrapped__(False) == CODE
    assert "compiling the simulator for this processor, which takes several seconds" in caplog.text


def test_a_later_start_says_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(aot_cache, "_folders", lambda: iter((Path("kept"),)))
    monkeypatch.setattr(aot_cache, "_kept", lambda path: CODE)
    monkeypatch.setattr(aot_cache, "_load", lambda code: code)
    with caplog.at_level("INFO", "servogen"):
        assert aot_cache.loop.__wrapped__(False) == CODE
    assert caplog.text == ""
