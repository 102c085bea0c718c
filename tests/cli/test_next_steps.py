"""Every command that writes a file ends with what to type next, on a line of at most 80 columns."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import ROOT, Run

LAB, HEX = ROOT / "jobs" / "lab8-exercise.toml", ROOT / "firmware" / "lab8-exercise" / "main.hex"


@pytest.fixture(autouse=True)
def beside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Short names, so that the line's length is the command's own."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.toml").write_text(LAB.read_text("utf-8"), "utf-8")
    (tmp_path / "main.hex").write_bytes(HEX.read_bytes())
    (tmp_path / "schedule.json").write_bytes(HEX.with_name("schedule.json").read_bytes())
    (tmp_path / "moves.rvm").write_text("PD 1,0,300,200,-90,90\n10 MO 1\n20 ED\nRN 10\n", "utf-8")


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("plot main.hex -o a.svg --seconds 0.1", "servogen measure main.hex"),
        (
            "plot main.hex -o a.svg --against schedule.json --seconds 0.1",
            "servogen verify main.hex --against schedule.json",
        ),
        ("robots hexapod --mjcf a.xml", "servogen gait hexapod"),
        ("robots scara --mjcf a.xml", "servogen fk scara"),
        ("robots scara --urdf a.urdf", "servogen fk a.urdf"),
        ("robots scara --plot a.svg", "servogen fk scara"),
        ("plan job.toml --csv a.csv", "servogen build job.toml"),
        ("plan job.toml --plot a.svg", "servogen build job.toml"),
        ("gait hexapod --csv a.csv", "servogen new --robot hexapod"),
        ("gait hexapod-coxa-femur-tibia --csv a.csv", "servogen new --robot hexapod-coxa-femur-tibia"),
        ("run-program moves.rvm --csv a.csv", "servogen new --robot arm"),
        ("simulate main.hex --cycles 900 --edges a.csv", "servogen measure a.csv"),
        ("simulate main.hex --cycles 900 --trace a.txt", "servogen watch main.hex"),
        ("simulate main.hex --cycles 900 --eeprom a.hex", "servogen simulate a.hex"),
        (
            "prove main.hex --against schedule.json --certificate a.proof",
            "servogen check-certificate a.proof main.hex --against schedule.json",
        ),
    ],
)
def test_what_is_written_leads_on(run: Run, words: str, line: str) -> None:
    last = run(*words.split()).out.splitlines()[-1]
    assert last == f"next: {line}"
    assert len(last) <= 80


def test_a_schema_says_where_an_editor_takes_it(run: Run) -> None:
    (line,) = run("schema", "job", "-o", "a.json").out.splitlines()
    assert line == 'a.json: the schema; next: "#:schema a.json" as the first line of a file, in an editor'
    assert len(line) <= 80 + len("a.json")
