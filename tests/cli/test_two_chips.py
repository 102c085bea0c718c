"""What each command does with a job of two chips, or which one it names instead."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Run, wrong
from tests.two_chips import ARM, TWO


@pytest.fixture
def job(tmp_path: Path) -> Path:
    path = tmp_path / "arm.toml"
    path.write_text(TWO + ARM.format(elbow="RB0"))
    return path


def test_check_shows_the_pulses_of_both(run: Run, job: Path) -> None:
    ran = run("check", job)
    assert ran.code == 0 and "2 servos" in ran.out
    assert all(servo in ran.out for servo in ("shoulder", "elbow"))
    shown = json.loads(run("check", job, "--json").out)
    assert wrong("check", json.dumps(shown)) == []
    assert [chip["job"] for chip in shown["chips"]] == ["arm-chip1", "arm-chip2"]


@pytest.mark.parametrize("command", ["simulate", "measure", "plot", "disassemble", "demo"])
def test_a_command_of_one_program_names_the_builds_of_both(run: Run, job: Path, command: str) -> None:
    ran = run(command, job, *(("-o", job.with_suffix(".png")) if command == "plot" else ()))
    said = " ".join((ran.out + ran.err).split())
    assert ran.code == 2 and "Traceback" not in said
    assert (
        "the job is for two chips" in said and "`servogen build` writes both programs into one folder" in said
    )


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("twin", "--stimulus", "x.toml"), "two chips read nothing that --stimulus could change"),
        (("twin", "--hex", "other"), "other does not have the programs of two chips"),
        (("rig", "--hex", "other"), "--hex takes the folder that `servogen build` writes for the job"),
        (("report", "--twin"), "servogen twin JOB.toml"),
    ],
)
def test_an_option_that_two_chips_do_not_have_is_refused(
    run: Run, job: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], says: str
) -> None:
    monkeypatch.chdir(job.parent)
    Path("x.toml").write_text("[[reset]]\npressed_us = 10\nreleased_us = 20\n")
    command, *options = words
    ran = run(command, job.name, *options)
    assert ran.code == 2 and says in " ".join(ran.err.split()), ran.err
