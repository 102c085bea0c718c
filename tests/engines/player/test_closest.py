"""Without max_error_us the player is as close to the plan as flash allows, and says what less would give."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from servogen.engines.firmware import ResourceError
from servogen.engines.player import engine
from servogen.engines.player import firmware as compiling
from servogen.job import PlannedJob, load, plan_job
from servogen.workflows.engines import PlayedJob, planned

ARM = """\
name = "arm3"
like = "anthropomorphic"

[lengths_mm]
l2 = 120
l3 = 95

[base]
z_mm = 70
"""
JOB = """\
[chip]
device = "PIC16F84A"
clock_hz = 4_000_000

[robot]
name = "arm3.toml"

[[servo]]
name = "base"
pin = "RB0"
model = "sg90"
joint = "q1"

[[servo]]
name = "shoulder"
pin = "RB1"
model = "sg90"
joint = "q2"
zero_deg = 20

[[servo]]
name = "elbow"
pin = "RB2"
model = "sg90"
joint = "q3"
zero_deg = 170

[motion]
law = "cubic"
poses = [
    { tip_mm = [0, 150, 100], hold_s = 0.5 },
    { tip_mm = [100, 120, 40], path = "line", hold_s = 0.5 },
    { base_deg = 90, move_s = 1 },
]

[firmware]
engine = "player"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("arm")
    (made / "arm3.toml").write_text(ARM, "utf-8")
    return made


def job(folder: Path, more: str = "") -> PlannedJob:
    (folder / "job.toml").write_text(JOB + more, "utf-8")
    return plan_job(load(folder / "job.toml"))


def notes(played: PlayedJob) -> list[str]:
    return [note.message for note in played.job.notes if note.code == "closest"]


def test_a_job_without_a_limit_is_closer_and_says_what_a_smaller_program_would_give(folder: Path) -> None:
    usual, closest = planned(job(folder, "max_error_us = 10\n")), planned(job(folder))
    errors = [played.plan.schedule.plan_error_us for played in (closest, usual)]
    assert errors[0] < 0.8 * errors[1]
    assert closest.data_bytes > usual.data_bytes
    (note,) = notes(closest)
    figures = re.findall(r"([\d.]+) µs, (\d+) bytes of motion", note)
    assert figures == [
        (f"{error:g}", str(played.data_bytes)) for error, played in zip(errors, (closest, usual), strict=True)
    ]
    assert "with max_error_us = 10" in note and notes(usual) == []


def test_what_does_not_fit_flash_is_not_taken(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = job(folder)
    _, usual, _ = engine.play(asked)

    def full(which: object, played: engine.Playing, dialect: str) -> None:
        if played.encoded.size > usual.encoded.size:
            raise ResourceError("does-not-fit", "full")

    monkeypatch.setattr(compiling, "compiled", full)
    played = engine.ENGINE.plan(asked)
    assert (played.data_bytes, played.notes) == (usual.encoded.size, ())
