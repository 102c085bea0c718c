"""Commands where names, folders, locales and terminals are not what one is used to."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.campaigns import sampled
from tests.cli.conftest import Run

JOB = Path(__file__).parents[2] / "jobs" / "lab9-program.toml"


def in_ascii(*args: object) -> subprocess.CompletedProcess[bytes]:
    """A command in a locale that knows neither µ nor box drawings."""
    environment = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    command = [sys.executable, "-m", "servogen", *map(str, args)]
    return subprocess.run(command, capture_output=True, env=environment | {"PYTHONIOENCODING": "ascii"})


@pytest.mark.parametrize("args", sampled([["--help"], ["check", JOB], ["gait"], ["check", "no µ.toml"]]))
def test_a_locale_without_a_sign_gets_another_in_its_place(args: list[object]) -> None:
    ran = in_ascii(*args)
    assert ran.returncode == (2 if "no µ.toml" in args else 0), ran.stderr
    assert b"Traceback" not in ran.stderr
    (ran.stdout + ran.stderr).decode("ascii")


def test_json_is_whole_in_every_locale() -> None:
    ran = in_ascii("plan", JOB, "--json")
    assert json.loads(ran.stdout)["job"] == "lab9-program"


def test_names_may_have_blanks_and_any_letter(run: Run, tmp_path: Path) -> None:
    job = tmp_path / "dir with blank" / "roboțel 1.toml"
    job.parent.mkdir()
    shutil.copy(JOB, job)
    out = tmp_path / "out ü" / "x"
    built = run("build", job, "-o", out, "--json")
    assert built.code == 0 and json.loads(built.out)["job"] == "roboțel 1"
    assert run("verify", out / "main.hex", "--against", out / "schedule.json").code == 0


def test_a_file_where_the_folder_of_a_build_is_to_be_says_so(run: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    for target in (tmp_path / "file", tmp_path / "file" / "below", Path("/dev/null")):
        ran = run("build", JOB, "-o", target)
        assert ran.code == 2 and "but a folder is to be created there" in ran.err, ran.err
    assert (tmp_path / "file").read_text() == "mine"


def test_a_job_that_is_not_there_does_not_hide_the_others(run: Run, tmp_path: Path) -> None:
    ran = run("demo", JOB, tmp_path / "no.toml", "-o", tmp_path / "out")
    assert ran.code == 2 and "no.toml" in ran.err
    assert [made.name for made in (tmp_path / "out").iterdir()] == ["lab9-program"]


def test_several_jobs_as_json(run: Run, tmp_path: Path) -> None:
    ran = run("demo", JOB, "-o", tmp_path / "out", "--json")
    told = json.loads(ran.out)
    assert [(job["job"], job["exact"]) for job in told["jobs"]] == [("lab9-program", True)]
    assert not [each for each in told["diagnostics"] if each["severity"] == "error"]


@pytest.mark.parametrize("name", ["...toml", "a\nb.toml"])
@pytest.mark.parametrize("command", ["build", "demo", "check"])
def test_a_job_whose_name_is_not_a_folder_writes_nothing(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, command: str
) -> None:
    work = tmp_path / "a" / "work"
    work.mkdir(parents=True)
    shutil.copy(JOB, work / name)
    monkeypatch.chdir(work)
    ran = run(command, name)
    assert ran.code == 2 and "which cannot be a folder" in ran.err, ran.err
    assert [entry.name for entry in tmp_path.rglob("*")] == ["a", "work", name]
