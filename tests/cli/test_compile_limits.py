"""Compiling and assembling end within their limits of time and memory, whatever the source is."""

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

import servogen.cli.compile_command  # binds the compiler before a test puts another in its place
import servogen.compiler
import servogen.pic.assembler
from servogen import isolation
from tests.bench.conftest import Run, run  # noqa: F401 - a fixture

PROGRAM = "#include <xc.h>\nvoid main(void) { TRISB = 0; for (;;) PORTB ^= 1; }\n"


def spin(*_: object) -> None:
    while True:
        pass


def hoard(*_: object) -> None:
    kept = []
    while True:
        kept.append(b"x" * 1_000_000)


def crash(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "main.c"
    path.write_text(PROGRAM)
    return path


@pytest.fixture(params=["compile", "assemble"])
def command(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def replace_tool(monkeypatch: pytest.MonkeyPatch, work: Callable[..., None]) -> None:
    monkeypatch.setattr(servogen.compiler, "compile_sources", work)
    monkeypatch.setattr(servogen.pic.assembler, "assemble", work)
    monkeypatch.setattr("servogen.cli.compile_command.compile_sources", work)
    monkeypatch.setattr("servogen.cli.assembly_commands.link", work)


@pytest.mark.parametrize(
    ("work", "options", "words"),
    [
        (spin, ("--timeout", "0.3"), "compiling it took more than 0.3 s of processor time or 1.2 s"),
        (hoard, ("--memory-mb", "120"), "compiling it needed more than 120 MB of memory"),
        (hoard, (), "compiling it needed more than 300 MB of memory"),
    ],
)
def test_a_source_without_end_is_bad_input(
    run: Run,  # noqa: F811
    source: Path,
    command: str,
    work: Callable[..., None],
    options: tuple[str, ...],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    replace_tool(monkeypatch, work)
    done = run(command, source, *options)
    assert done.code == 2
    assert f"{source}: error: {words} [compile-failed]\n  --timeout and --memory-mb allow more" in done.err
    assert not source.with_suffix(".hex").exists()


def test_the_limits_of_a_normal_compile_are_ten_seconds_and_300_megabytes() -> None:
    assert (isolation.COMPILING.seconds, isolation.COMPILING.memory_mb) == (10, 300)


def test_a_crash_of_the_compiler_is_said_and_is_not_bad_input(
    run: Run,  # noqa: F811
    source: Path,
    command: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    replace_tool(monkeypatch, crash)
    done = run(command, source)
    assert done.code == 3
    assert "servogen failed while compiling it: its process was ended by signal 11" in done.err


@pytest.mark.parametrize("name", ["main.c", "main.asm"])
def test_every_command_that_reads_a_program_has_the_limits(
    run: Run,  # noqa: F811
    tmp_path: Path,
    name: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / name).write_text(PROGRAM)
    replace_tool(monkeypatch, hoard)
    done = run("simulate", tmp_path / name)
    assert done.code == 2
    assert (
        "needed more than 300 MB of memory [compile-failed]\n  servogen compile and servogen assemble take"
        in done.err
    )


def test_the_limits_change_nothing_of_what_is_compiled(
    run: Run,  # noqa: F811
    source: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The same HEX, listing, table and warnings as from a compiler in this process."""
    source.write_text(
        PROGRAM.replace("void main", "int unused(char a) { int x = 300; return x; }\nvoid main")
    )
    listing = source.with_suffix(".lst")
    results = []
    for limited in (True, False):
        if not limited:
            monkeypatch.setattr(isolation, "unix_limits", None)
        done = run("compile", source, "--listing", listing, "--json")
        results.append(
            (done.code, json.loads(done.out), listing.read_text(), source.with_suffix(".hex").read_text())
        )
    assert results[0] == results[1]
    assert results[0][0] == 0


def test_errors_are_those_of_the_compiler(run: Run, source: Path) -> None:  # noqa: F811
    source.write_text("#include <xc.h>\nvoid main(void) { x = 1;\n y = 2; }\n")
    done = run("compile", source)
    assert done.code == 2
    assert f"{source}:2:19: error" in done.err
    assert f"{source}:3:2: error" in done.err


def test_a_system_without_limits_is_said_to_be_one(
    run: Run,  # noqa: F811
    source: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from servogen.cli import files

    files.warn_of_missing_limits.cache_clear()
    monkeypatch.setattr(isolation, "unix_limits", None)
    done = run("compile", source)
    files.warn_of_missing_limits.cache_clear()
    assert done.code == 0
    assert "servogen: warning: linux cannot limit the memory and the open files of a process" in done.err
