"""The machine code of the instruction loop, kept across processes: never a wrong or a torn one."""

from __future__ import annotations

from pathlib import Path

import pytest

from servogen.simulator import native

CODE = b"\x7fELF not really"


@pytest.fixture
def folders(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Path]:
    """Two folders of our own to keep machine code in."""
    found = [tmp_path / "first", tmp_path / "second"]
    monkeypatch.setattr(native, "_folders", lambda: iter(found))
    return found


def test_what_is_kept_is_read_again(folders: list[Path]) -> None:
    native._keep("simulator-plain-1.o", CODE)
    assert native._kept(folders[0] / "simulator-plain-1.o") == CODE
    assert not folders[1].exists()


def test_a_torn_or_missing_file_counts_as_none(folders: list[Path]) -> None:
    native._keep("simulator-plain-1.o", CODE)
    path = folders[0] / "simulator-plain-1.o"
    path.write_bytes(path.read_bytes()[:-1])
    assert native._kept(path) is None
    assert native._kept(folders[0] / "simulator-plain-2.o") is None
    path.write_bytes(b"")
    assert native._kept(path) is None


def test_a_new_version_takes_the_place_of_the_old_one(folders: list[Path]) -> None:
    native._keep("simulator-plain-1.o", CODE)
    native._keep("simulator-observed-1.o", CODE)
    native._keep("simulator-plain-2.o", CODE)
    assert sorted(path.name for path in folders[0].iterdir()) == [
        "simulator-observed-1.o",
        "simulator-plain-2.o",
    ]


def test_where_the_first_folder_cannot_be_written_the_next_is_taken(folders: list[Path]) -> None:
    folders[0].write_text("a file is in the way")
    native._keep("simulator-plain-1.o", CODE)
    assert native._kept(folders[1] / "simulator-plain-1.o") == CODE


def test_the_name_says_what_the_code_was_made_of(monkeypatch: pytest.MonkeyPatch) -> None:
    before = native._digest()
    assert native._digest() == before
    monkeypatch.setattr(native, "OPS", {"NOP": 1})
    assert native._digest() != before


def test_code_that_needs_what_only_numba_has_is_refused() -> None:
    text = "declare void @NRT_Free(ptr)\ndefine i32 @f() {\n  call void @NRT_Free(ptr null)\n  ret i32 0\n}\n"
    with pytest.raises(native.ToolError, match="NRT_Free"):
        native._alone(text, "f")
    kept = native._alone("declare void @NRT_Free(ptr)\ndefine i32 @f() {\n  ret i32 0\n}\n", "f")
    assert f"@{native.ENTRY}()" in kept
