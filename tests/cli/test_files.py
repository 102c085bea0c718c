"""Outputs are kept apart from inputs and from each other; warnings of files are shown once."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from servogen import programs
from servogen.cli import files, show
from servogen.cli.files import check_outputs
from servogen.errors import Diagnostic, InputError
from servogen.workflows import job_program


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    files.warn_of_missing_limits.cache_clear()
    show.begin()


@pytest.mark.parametrize(
    ("inputs", "outputs", "message"),
    [
        (["a"], ["b"], ""),
        (["a"], [None, "b", None], ""),
        (["a", "b"], ["b"], "is what is read"),
        (["a"], ["x/../a"], "is what is read"),
        (["link"], ["a"], "is what is read"),
        ([], ["b", "c", "b"], "is written already"),
        (["a"], ["b", None, "./b"], "is written already"),
        ([], [os.devnull, os.devnull], ""),
        ([], ["x", "x"], "is written already"),  # a folder, too
        ([], ["a", "a"], "is written already"),
    ],
)
def test_an_output_is_neither_read_nor_written_twice(
    inputs: list[str], outputs: list[str | None], message: str
) -> None:
    Path("a").write_text("")
    Path("x").mkdir()
    Path("link").symlink_to("a")
    given = [None if name is None else Path(name) for name in outputs]
    if not message:
        check_outputs([Path(name) for name in inputs], *given)
        return
    with pytest.raises(InputError, match=message) as refused:
        check_outputs([Path(name) for name in inputs], *given)
    assert refused.value.first.code == "output-exists"


def test_warnings_of_an_image_are_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("a.hex").write_text(":02000000FFFF00\n:00000001FF\n")
    image = files.read_image(Path("a.hex"))
    assert image.words == 1
    assert "[hex-word]" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "limited", "job"),
    [
        ("a.hex", False, False),
        ("a.c", True, False),
        ("a.asm", True, False),
        ("a.C", True, False),
        ("a.toml", False, True),
    ],
)
def test_a_program_is_read_with_its_remarks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str, limited: bool, job: bool
) -> None:
    """What is compiled is compiled within limits, whose absence is said once."""

    def program(which: str) -> SimpleNamespace:
        return SimpleNamespace(image=which, remarks=(Diagnostic("warning", "remark", which),))

    monkeypatch.setattr(programs, "read_program", lambda path, device: program(f"program {device}"))
    monkeypatch.setattr(job_program, "read_program", lambda path: program("job"))
    monkeypatch.setattr(files, "missing_limits", lambda: "no limits here")
    found = files.read_program(Path(name), "PIC16F84A")
    text = "job" if job else "program PIC16F84A"
    assert found.image == text
    err = capsys.readouterr().err
    assert ("no limits here" in err, f"{text} [remark]" in err) == (limited, True)
    files.read_program(Path(name), "PIC16F84A")
    assert "no limits here" not in capsys.readouterr().err
    if job:
        assert files.read_image(Path(name)) == "job"


def test_nothing_is_said_where_processes_can_be_limited(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(files, "missing_limits", lambda: "")
    files.warn_of_missing_limits()
    assert capsys.readouterr().err == ""


def test_work_within_limits_passes_them_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen: list[object] = []
    monkeypatch.setattr(programs, "within_limits", lambda *given: seen.append(given) or 7)
    monkeypatch.setattr(files, "missing_limits", lambda: "no limits here")
    assert files.within_limits(print, Path("a.c"), hint="more") == 7
    assert seen == [(print, Path("a.c"), files.COMPILING, "more")]
    assert "no limits here" in capsys.readouterr().err
