"""The machine code of the instruction loop, kept across processes: never a wrong or a torn one."""

from __future__ import annotations

import logging
import os
import threading
from concurrent.futures import ThreadPoolExecutor
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


@pytest.mark.skipif(os.name != "posix", reason="there each process compiles for itself")
def test_a_process_waits_for_another_that_compiles_the_same(
    folders: list[Path], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    waiting = threading.Event()

    class Listening(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            waiting.set()

    def compiled_again(*kind: bool) -> bytes:
        raise AssertionError("the other process was about to keep it")

    monkeypatch.setattr(aot_cache, "compile_loop", compiled_again)
    monkeypatch.setattr(aot_cache, "_load", lambda code: code)
    monkeypatch.setattr(logging.getLogger(aot_cache.__name__), "handlers", [Listening()])
    with caplog.at_level("INFO", "servogen"), ThreadPoolExecutor() as threads:
        with aot_cache._one_at_a_time():
            found = threads.submit(aot_cache.loop.__wrapped__, False)
            assert waiting.wait(60)
            aot_cache._keep(f"simulator-plain-{aot_cache._digest()}.o", CODE)
        assert found.result() == CODE


def test_the_name_depends_on_every_source_and_on_the_processor(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(aot_cache, "__file__", str(tmp_path / "aot_cache.py"))
    names = set()

    def note() -> None:
        name = aot_cache._digest()
        assert len(name) == 24 and int(name, 16) >= 0
        names.add(name)

    (tmp_path / "a.py").write_text("1")
    note()
    (tmp_path / "notes.txt").write_text("no source")
    note()
    assert len(names) == 1
    (tmp_path / "b.py").write_text("2")
    note()
    (tmp_path / "b.py").write_text("3")
    note()
    monkeypatch.setattr(aot_cache, "_features", lambda: "+avx1024")
    note()
    monkeypatch.setattr(aot_cache.llvmlite, "__version__", "0.0")
    note()
    monkeypatch.setattr(aot_cache, "REGISTERS", ())
    note()
    assert len(names) == 6


def test_each_kind_of_loop_has_its_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[Path] = []
    compiled: list[tuple[bool, bool, bool]] = []

    def compile_loop(*kind: bool) -> bytes:
        compiled.append(kind)
        return CODE

    monkeypatch.setattr(aot_cache, "_folders", lambda: iter((tmp_path / "one", tmp_path / "two")))
    monkeypatch.setattr(aot_cache, "_kept", asked.append)
    monkeypatch.setattr(aot_cache, "_keep", lambda name, code: asked.append(Path(name)))
    monkeypatch.setattr(aot_cache, "_load", lambda code: code)
    monkeypatch.setattr(aot_cache, "compile_loop", compile_loop)
    kinds = [
        ("plain", ()),
        ("observed", (True,)),
        ("tracked", (False, True)),
        ("visits", (False, False, True)),
    ]
    for kind, flags in kinds:
        asked.clear()
        assert aot_cache.loop.__wrapped__(*flags) == CODE
        name = f"simulator-{kind}-{aot_cache._digest()}.o"
        places = [tmp_path / "one" / name, tmp_path / "two" / name]
        assert asked == [*places, *places, Path(name)]  # once more under the lock
    assert compiled == [(False,) * 3, (True, False, False), (False, True, False), (False, False, True)]


def test_machine_code_is_kept_beside_the_sources_or_in_the_users_cache(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    beside = Path(aot_cache.__file__).parent / "__pycache__"
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    assert list(aot_cache._folders()) == [beside, tmp_path / "home" / ".cache" / "servogen"]
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    assert list(aot_cache._folders()) == [beside, tmp_path / "local" / "servogen"]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert list(aot_cache._folders()) == [beside, tmp_path / "xdg" / "servogen"]


def test_everybody_may_read_the_file_and_nobody_enter_the_new_folders(
    folders: list[Path], tmp_path: Path
) -> None:
    folders[0] = tmp_path / "cache" / "servogen"
    aot_cache._keep("simulator-plain-1.o", CODE)
    modes = [path.stat().st_mode & 0o777 for path in (folders[0].parent, folders[0], *folders[0].iterdir())]
    assert modes == [0o700, 0o700, 0o644]


def machine_code(body: str, name: str = aot_cache.ENTRY) -> bytes:
    """Return an object file with a function of the loop's arguments: %a0 to %a11, behind result and error."""
    kinds = {"p": "ptr", "i": "i64"}
    arguments = ", ".join(f"{kinds[kind]} %a{n}" for n, kind in enumerate(aot_cache.SIGNATURE))
    text = f"define i32 @{name}(ptr %result, ptr %error, {arguments}) {{\n{body}\n}}\n"
    module = aot_cache.llvm.parse_assembly(text)
    return bytes(aot_cache._target().emit_object(module))


def test_loaded_code_is_called_with_addresses_and_integers_and_returns_its_result() -> None:
    far = (1 << 62) + 1
    store = "store i64 %{0}, ptr %result\nret i32 0"
    whole = aot_cache._load(machine_code("%sum = sub i64 %a1, %a9\n" + store.format("sum")))
    assert whole(0, far, *[0] * 7, 3, 0, 0) == far - 3
    address = aot_cache._load(machine_code("%number = ptrtoint ptr %a11 to i64\n" + store.format("number")))
    assert address(*[0] * 11, far) == far


def test_code_that_fails_or_has_no_entry_is_said() -> None:
    failing = aot_cache._load(machine_code("ret i32 1"))
    with pytest.raises(aot_cache.ToolError, match="the compiled simulator failed"):
        failing(*[0] * 12)
    with pytest.raises(aot_cache.ToolError, match="the compiled simulator cannot be loaded"):
        aot_cache._load(machine_code("ret i32 0", "other"))


def test_only_the_loop_is_left_of_what_numba_makes() -> None:
    """Its wrappers are taken away; functions of LLVM itself, and what is only declared, may stay."""
    text = (
        "declare i64 @llvm.smax.i64(i64, i64)\ndeclare void @NRT_Free(ptr)\ndeclare void @_unused(ptr)\n"
        'define i64 @"cfunc._ZN3runB"(ptr %x) {\n  call void @NRT_Free(ptr %x)\n  ret i64 1\n}\n'
        "define ptr @cpython.wrapper(ptr %x) {\n  call void @NRT_Free(ptr %x)\n  ret ptr null\n}\n"
        'define linkonce i32 @"_ZN3runB"(ptr %x) {\n'
        "  %1 = call i64 @llvm.smax.i64(i64 1, i64 2)\n  ret i32 0\n}\n"
    )
    kept = aot_cache._alone(text, "_ZN3runB")
    assert "cfunc" not in kept and "cpython" not in kept
    assert f"define linkonce i32 @{aot_cache.ENTRY}(ptr %x) {{" in kept
