"""`make prove`: the table of the committed programs, their certificates, and what is not proven."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tools.prove_firmware import main

FIRMWARE = Path(__file__).parent.parent.parent / "firmware"


def test_each_program_of_a_job_is_proven_and_its_certificate_valid(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(FIRMWARE), str(tmp_path), "lab9-program"]) == 0
    rows = [line.split(" | ") for line in capsys.readouterr().out.splitlines()[1:]]
    assert [row[0] for row in rows] == [
        f"lab9-program/{name}.hex" for name in ("main", "main.sdcc", "main.xc8")
    ]
    assert all(row[-1] == "proven, checked" for row in rows)
    sizes = [path.stat().st_size for path in tmp_path.rglob("*.*") if path.is_file()]
    assert len(sizes) == 3
    assert max(sizes) < 200_000


def test_a_program_that_is_not_the_schedules_makes_the_exit_code_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "wrong"
    folder.mkdir()
    shutil.copy(FIRMWARE / "lab9-program" / "schedule.json", folder)
    shutil.copy(FIRMWARE / "lab8-program" / "main.hex", folder)
    assert main([str(tmp_path), str(tmp_path / "out")]) == 1
    assert "counterexample: " in capsys.readouterr().out
    assert not (tmp_path / "out").exists()


def test_a_job_that_is_not_there_is_bad_input(tmp_path: Path) -> None:
    assert main([str(FIRMWARE), str(tmp_path), "lab99"]) == 2
