"""`servogen new`: a whole job for each kind of robot and servo, which `check` accepts and `build` builds."""

from __future__ import annotations

import io
import json
import sys
import tomllib
from pathlib import Path

import pytest

from servogen import job
from servogen.job import KINDS, load, loads, plan_job
from servogen.job.starter import starter, template
from servogen.kinematics.registry import KINDS as ROBOT_KINDS
from servogen.workflows.engines import planned
from tests.campaigns import sampled
from tests.cli.conftest import Run
from tests.cli.new_jobs import EVERY, TOO_NARROW, fits_its_chips, planned_without_a_warning

NARROW = """\
title = "Narrow"
points = [{ angle_deg = 60, width_us = 1200 }, { angle_deg = 120, width_us = 1800 }]
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def models(file: str) -> set[str]:
    return {servo["model"] for servo in tomllib.loads(Path(file).read_text("utf-8"))["servo"]}


@pytest.mark.parametrize(("kind", "servo"), sampled(EVERY[::7], 6))
def test_a_robot_with_a_servo_is_planned_without_a_warning(run: Run, kind: str, servo: str) -> None:
    """`python -m tests.cli.new_jobs` plans every one."""
    ran = run("new", "my.toml", "--robot", kind, "--servo", servo)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.splitlines()[1:] == ["  servogen check my.toml", "  servogen watch my.toml"]
    assert models("my.toml") == {servo}
    planned_without_a_warning(Path("my.toml").read_text("utf-8"), servo)


def test_every_kind_of_robot_has_a_job_to_start_from_and_every_such_job_is_offered() -> None:
    assert sorted(file.stem for file in Path(job.__file__).with_name("starters").glob("*.toml")) == sorted(
        KINDS
    )
    robots = (loads(template(kind), f"{kind}.toml").robot for kind in KINDS)
    assert {robot.kind for robot in robots if robot is not None} == {*ROBOT_KINDS}


@pytest.mark.campaign
@pytest.mark.parametrize(("kind", "servo"), EVERY[::21])
def test_a_robot_with_a_servo_fits_its_chips_at_10_us(kind: str, servo: str) -> None:
    """`python -m tests.cli.new_jobs --fits` fits every one."""
    fits_its_chips(starter(kind, servo, Path("my.toml")))


def test_a_body_that_leans_is_played_as_it_is_planned_with_a_wide_servo(run: Run) -> None:
    """Legs that stand turn by the lean's law, of which even steps from one lift to the next are 21 µs off."""
    assert run("new", "my.toml", "--robot", "quadruped", "--servo", "sg90").code == 0
    assert planned(plan_job(load(Path("my.toml")))).plan.schedule.plan_error_us <= 8


@pytest.mark.parametrize(("kind", "servo"), sampled(sorted(TOO_NARROW)))
def test_a_servo_of_less_travel_than_the_robot_needs_is_refused(run: Run, kind: str, servo: str) -> None:
    ran = run("new", "my.toml", "--robot", kind, "--servo", servo)
    assert ran.code == 2 and f"does not fit '{kind}': " in ran.err and "travel" in ran.err


@pytest.mark.parametrize(
    "kind", sampled(["arm", "leg", "hexapod", "hexapod-hip-lift", "quadruped", "omni", "stream"], 3)
)
def test_check_accepts_every_robot_without_a_warning(run: Run, kind: str) -> None:
    assert run("new", "my.toml", "--robot", kind).code == 0
    ran = run("check", "my.toml")
    assert (ran.code, ran.err) == (0, "")


@pytest.mark.parametrize("servo", [(), ("--servo", "sg90")])
def test_a_kind_may_be_written_in_capitals(run: Run, servo: tuple[str, ...]) -> None:
    assert run("new", "my.toml", "--robot", "Servo", *servo).code == 0


def test_a_robot_file_whose_legs_have_other_names_is_told_those_of_the_templates(run: Run) -> None:
    """docs/your-robot.md has one with their names."""
    legs = "".join(f'[[mount]]\nname = "{name}"\nx_mm = 9\ny_mm = 9\n' for name in ("FL", "FR"))
    lengths = "lengths_mm = { coxa = 25, femur = 40, tibia = 60 }"
    Path("own.toml").write_text(
        f'name = "own"\nkind = "hexapod"\nleg = "hip-lift"\n{lengths}\n{legs}', "utf-8"
    )
    ran = run("new", "my.toml", "--robot", "own.toml")
    assert ran.code == 2 and "no job to start from for the joints of 'own.toml'" in ran.err
    assert "quadruped-hip-lift: LF LH RF RH" in ran.err and not Path("my.toml").exists()


def test_check_shows_the_pulses_of_both_chips(run: Run) -> None:
    assert run("new", "my.toml", "--robot", "hexapod-coxa-femur-tibia").code == 0
    ran = run("check", "my.toml")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.splitlines()[-1].startswith("my.toml: 18 servos, loop of 64 frames, 1.28 s; ")
    facts = json.loads(run("check", "my.toml", "--json").out)
    assert [each["job"] for each in facts["chips"]] == ["my-chip1", "my-chip2"]


def test_a_new_job_is_built(run: Run) -> None:
    assert run("new", "one.toml", "--robot", "servo", "--servo", "SG90").code == 0
    assert run("check", "one.toml").err == ""
    assert run("build", "one.toml").code == 0


@pytest.mark.parametrize("spelling", ["SG90", "sg90", "towerpro-sg90", "Tower Pro SG90", "TowerPro_SG90"])
def test_a_servo_has_the_spellings_of_the_field(run: Run, spelling: str) -> None:
    assert run("new", "my.toml", "--servo", spelling).code == 0
    assert models("my.toml") == {"sg90"}


@pytest.mark.parametrize("spelling", ["90", "sg91", "s", "-"])
def test_a_part_that_could_be_any_servo_is_none(run: Run, spelling: str) -> None:
    ran = run("new", "my.toml", f"--servo={spelling}")
    assert ran.code == 2
    assert f"unknown servo model '{spelling}'" in ran.err
    assert not Path("my.toml").exists()


@pytest.mark.parametrize(
    ("robot", "servo", "message", "hint"),
    [
        (
            "octopus",
            "sg90",
            "no job to start from for 'octopus'",
            "arm, hexapod, hexapod-coxa-femur-tibia, hexapod-hip-lift, leg, omni, "
            "quadruped-coxa-femur-tibia, quadruped-hip-lift, servo, stream",
        ),
        (
            "omni",
            "sg90",
            "'omni' needs continuous-rotation servos",
            "continuous fits; `servogen servos` lists",
        ),
        ("leg", "continuous", "'leg' needs a servo with angles", "mpx-tiny-s fits; `servogen servos`"),
        ("arm", "narrow.toml", "Narrow does not fit 'arm': ", "futaba-s3001 fits; `servogen servos`"),
    ],
)
def test_what_does_not_fit_is_refused_with_what_fits(
    run: Run, robot: str, servo: str, message: str, hint: str
) -> None:
    Path("narrow.toml").write_text(NARROW, "utf-8")
    ran = run("new", "my.toml", "--robot", robot, "--servo", servo)
    first, second = ran.err.splitlines()[:2]
    assert ran.code == 2
    assert message in first
    assert hint in second
    assert not Path("my.toml").exists()


def test_a_servo_file_is_found_from_the_job(run: Run) -> None:
    """The job names it relative to itself."""
    Path("jobs").mkdir()
    Path("narrow.toml").write_text(NARROW, "utf-8")
    assert run("new", "jobs/serial.toml", "--robot", "stream", "--servo", "narrow.toml").code == 0
    assert models("jobs/serial.toml") == {"../narrow.toml"}
    assert run("check", "jobs/serial.toml").code == 0


def test_the_angles_are_shares_of_a_travel_whose_middle_is_the_usual_one(run: Run) -> None:
    Path("narrow.toml").write_text(NARROW, "utf-8")
    assert run("new", "my.toml", "--servo", "narrow.toml").code == 0
    poses = tomllib.loads(Path("my.toml").read_text("utf-8"))["motion"]["poses"]
    assert [pose["arm_deg"] for pose in poses] == [70, 90, 110]


def test_a_file_is_overwritten_only_by_force(run: Run) -> None:
    Path("my.toml").write_text("mine", "utf-8")
    assert run("new", "my.toml", "--robot", "leg").code == 2
    assert Path("my.toml").read_text("utf-8") == "mine"
    assert run("new", "my.toml", "--robot", "leg", "--force").code == 0
    assert "[leg]" in Path("my.toml").read_text("utf-8")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_on_a_terminal_it_asks_for_robot_and_servo(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = Terminal()
    monkeypatch.setattr(sys, "stdin", Terminal("leg\nSG90\n"))
    monkeypatch.setattr(sys, "stdout", shown)
    assert run("new").code == 0
    assert "robot (" in shown.getvalue()
    assert models("job.toml") == {"sg90"}
    assert "[leg]" in Path("job.toml").read_text("utf-8")


@pytest.mark.parametrize("stream", ["stdin", "stdout"])
def test_elsewhere_it_asks_nothing(run: Run, monkeypatch: pytest.MonkeyPatch, stream: str) -> None:
    monkeypatch.setattr(sys, stream, Terminal("leg\nSG90\n"))
    assert run("new").code == 0
    assert models("job.toml") == {"futaba-s3001"}
