"""Nothing that is printed or written has a negative zero."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from servogen.cli.show import as_json, begin, json_line
from servogen.errors import InputError
from servogen.kinematics.catalogue import arm, names
from tests.campaigns import sampled

Run = Callable[..., Any]

JOBS = Path(__file__).parents[2] / "jobs"

NEGATIVE_ZERO = re.compile(r"(?<![0-9A-Za-z_.])-0(\.0*)?(?![0-9.A-Za-z])")
"""As -0, -0.00 or -0.0; not as in -0.5, RB-0 or 1e-05."""


def lines_with_one(text: str) -> list[str]:
    return [line for line in text.splitlines() if NEGATIVE_ZERO.search(line)]


def arms() -> Iterator[tuple[str, int]]:
    for name in names():
        try:
            yield name, len(arm(name).joints)
        except InputError:
            continue


def test_the_pattern_finds_what_it_should() -> None:
    found = ["-0", "x -0.00 mm", "[-0.0, 1]", "-0°", "error -0.000"]
    assert [lines_with_one(text) for text in found] == [[text] for text in found]
    for text in ("-0.5", "10-05", "1e-05", "RB-0", "+0.000", "-0.001", "2026-01-02"):
        assert lines_with_one(text) == []


def test_json_has_none(capsys: pytest.CaptureFixture[str]) -> None:
    begin()
    as_json({"a": -0.0, "b": [-0.0, (1, -0.0)], "c": None, "d": True, "e": "-0.0", "f": -0.5})
    assert json.loads(capsys.readouterr().out) == {
        "diagnostics": [], "a": 0, "b": [0, [1, 0]], "c": None, "d": True, "e": "-0.0", "f": -0.5
    }  # fmt: skip
    json_line([-0.0])
    assert capsys.readouterr().out == "[0.0]\n"


@pytest.mark.parametrize(("name", "joints"), sampled(list(arms()), 5))
def test_kinematics_have_none(run: Run, name: str, joints: int) -> None:
    for value in (0, "-0.0", 90, -180, "-0.0000001"):
        for command in ("fk", "jacobian"):
            for options in ((), ("--json",)):
                ran = run(command, name, *[value] * joints, *options)
                assert lines_with_one(ran.out + ran.err) == [], (command, value, options)
    assert lines_with_one(run("robots", name).out) == []


@pytest.mark.parametrize("text", ["Rz(180)", "Ry(-90) Rz(90)", "Tx(-0.00001)", "Rx(-180) Tz(-0.0)"])
def test_transforms_have_none(run: Run, text: str) -> None:
    for options in ((), ("--json",)):
        assert lines_with_one(run("transform", text, 0, 0, "-0.0", *options).out) == []


@pytest.mark.parametrize(
    "options", [("--direction-deg", 180), ("--turn-deg", -10, "--stride-mm", 0), ("--direction-deg", -90)]
)
def test_walks_have_none(run: Run, tmp_path: Path, options: tuple[object, ...]) -> None:
    ran = run("gait", "hexapod", "--gait", "wave", *options, "--csv", tmp_path / "walk.csv")
    assert ran.code == 0
    assert lines_with_one(ran.out) == []
    assert lines_with_one((tmp_path / "walk.csv").read_text()) == []
    assert lines_with_one(run("gait", "hexapod", *options, "--json").out) == []


@pytest.mark.parametrize("job", sampled(["lab9-exercise", "omni-square", "scara-pick", "hexapod-turn"], 2))
def test_plans_have_none(run: Run, tmp_path: Path, job: str) -> None:
    ran = run("plan", JOBS / f"{job}.toml", "--csv", tmp_path / "plan.csv")
    assert ran.code == 0
    assert lines_with_one(ran.out + ran.err) == []
    assert lines_with_one((tmp_path / "plan.csv").read_text()) == []
    assert lines_with_one(run("plan", JOBS / f"{job}.toml", "--json").out) == []


def test_a_width_that_is_a_trifle_short_has_none(run: Run, tmp_path: Path) -> None:
    """90.00002° asks for 1500.0001 µs: the error of 1500 cycles is -0.0001 µs."""
    job = tmp_path / "job.toml"
    job.write_text(
        '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
        '[[servo]]\nname = "arm"\npin = "RB0"\nmodel = "futaba-s3001"\n'
        "[motion]\nposes = [{ arm_deg = 90.00002, hold_s = 0.1 }]\n"
    )
    ran = run("build", job, "-o", tmp_path / "out")
    assert "1500.000" in ran.out
    assert lines_with_one(ran.out) == []
    assert lines_with_one((tmp_path / "out" / "report.txt").read_text()) == []


def test_reports_have_none(run: Run, tmp_path: Path) -> None:
    assert run("report", JOBS / "lab9-exercise.toml", "-o", tmp_path / "page.html").code == 0
    page = re.sub(
        r"<script.*?</script>|<style.*?</style>", "", (tmp_path / "page.html").read_text(), flags=re.S
    )
    assert lines_with_one(re.sub(r"<[^>]*>", " ", page)) == []
