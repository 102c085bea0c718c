"""Horns: what part of its travel a motion uses, and the zero with which it is in the middle."""

import json
import math
import re
import tomllib
from pathlib import Path

import pytest

from servogen.errors import ServogenError
from servogen.job import load, loads, plan_job
from servogen.job.starter import starter
from servogen.workflows.horns import centre_horns, edits, job_horns, rewritten
from tests.cli.conftest import Run

ARM = """\
name = "own"
like = "anthropomorphic"

[[joint]]
name = "q1"
lower_deg = -90
upper_deg = 90
"""
JOB = """\
# my arm
[chip]
device = "PIC16F84A"
clock_hz = 4_000_000

[robot]
name = "own.toml"

[[servo]]
name = "base"
pin = "RB0"
model = "futaba-s3003"
joint = "q1" # turns it
zero_deg = 170 # a guess

[[servo]] # the shoulder
name = "shoulder"
pin = "RB1"
model = "futaba-s3003"
joint = "q2"
# not measured

[[servo]]
name = "elbow"
pin = "RB2"
model = "futaba-s3003"
joint = "q3"
zero_deg = 170

[motion]
law = "cubic"
poses = [{ tip_mm = [0, 150, 100] }, { tip_mm = [100, 120, 40] }, { tip_mm = [-100, 120, 40] }]
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "own.toml").write_text(ARM, "utf-8")
    made = tmp_path / "job.toml"
    made.write_text(JOB, "utf-8")
    return made


def test_a_job_that_its_horns_alone_make_impossible_is_told_how_to_turn_them(run: Run, file: Path) -> None:
    """The base would have to go to 209.8°; the tips are 39.8° to both sides, so that 90° is in the middle of
    its travel. From 170°, teeth of 14.4° lead to 98 and 83.6.
    """
    ran = run("plan", str(file))
    assert ran.code == 2 and "needs angles outside the servos' travel: base 209.8°" in ran.err
    assert "put the horns on other teeth: base zero_deg = 83.6 (now 170)" in ran.err
    assert file.read_text("utf-8") == JOB


def test_fit_writes_the_zeros_and_keeps_all_else(run: Run, file: Path) -> None:
    assert run("plan", str(file), "--fit").code == 0
    made = file.read_text("utf-8")
    servos = tomllib.loads(made)["servo"]
    assert servos[0]["zero_deg"] == pytest.approx(170 - 6 * 14.4)
    kept = re.sub(r"zero_deg = [\d.]+", "zero_deg = …", made).splitlines()
    asked = re.sub(r"zero_deg = [\d.]+", "zero_deg = …", JOB).splitlines()
    asked.insert(asked.index("# not measured"), "zero_deg = …")
    assert kept == asked
    planned = plan_job(load(file))
    for horn in job_horns(planned):
        assert sum(horn.used) == pytest.approx(math.pi, abs=math.tau / 25)  # nearer to 90° than half a tooth
    before = made
    file.write_text(JOB, "utf-8")
    said = json.loads(run("plan", str(file), "--fit", "--json").out)
    assert said["horns"][0]["zero_deg"] == pytest.approx(170 - 6 * 14.4) and file.read_text("utf-8") == made
    ran = run("plan", str(file), "--fit")
    assert (ran.code, file.read_text("utf-8")) == (0, before)
    assert "every horn is on the tooth that centres the motion best" in ran.out


def test_the_plan_says_what_is_used_of_each_travel(run: Run, file: Path) -> None:
    file.write_text(
        JOB.replace("zero_deg = 170 # a guess", "zero_deg = 100").replace('"q2"', '"q2"\nzero_deg = 50')
    )
    ran = run("plan", str(file), "--json")
    horn = json.loads(ran.out)["horns"][0]
    assert [round(end, 1) for end in horn["used_deg"]] == [60.2, 139.8]
    assert [round(horn[key], 1) for key in ("zero_deg", "centred_zero_deg")] == [100, 85.6]
    assert (horn["spline_teeth"], round(horn["off_centre_deg"], 1)) == (25, 4.4)
    shown = run("plan", str(file)).out
    assert re.search(r"base +0 to 180° +60\.2 to 139\.8° +100 +85\.6 +-1 of 25 +4\.4", shown)


def test_a_horn_goes_on_in_the_steps_of_its_own_spline(file: Path) -> None:
    """Of 8 teeth, 45° apart, none comes nearer to 90 than 80; a motion of 170° needs 85 to 95."""
    ten = JOB.replace("zero_deg = 170 # a guess", "zero_deg = 170\nspline_teeth = 8")
    ten = ten.replace('"q2"', '"q2"\nzero_deg = 50')
    horns, _ = centre_horns(loads(ten, str(file)))
    assert [math.degrees(horns[0].zero + horns[0].turn), horns[0].steps] == [pytest.approx(80), -2]
    wide = ten.replace("[0, 150, 100]", "[-100, 10, 100]").replace("[100, 120, 40]", "[100, 10, 100]")
    with pytest.raises(ServogenError) as refused:
        centre_horns(loads(wide, str(file)))
    assert (
        "base needs zero_deg" in (refused.value.first.hint or "")
        and "of 8 is at 80" in refused.value.first.hint
    )


def test_the_file_gets_the_zero_that_was_planned() -> None:
    """To the tenth of a thousandth of a degree, also above 100°: 90° and a tooth of 21."""
    planned = round(90 + 360 / 21, 4)
    assert (
        tomllib.loads(rewritten(JOB, {("servo", 0, "zero_deg"): planned}))["servo"][0]["zero_deg"] == planned
    )


def test_limits_turn_with_the_horn_and_commanded_angles_hold_it(file: Path) -> None:
    zero = "zero_deg = 110\nmin_deg = 60\nmax_deg = 175"
    limited = JOB.replace("zero_deg = 170 # a guess", zero).replace('"q2"', '"q2"\nzero_deg = 50')
    job = loads(limited, str(file))
    values = edits(job, job_horns(plan_job(job)))
    assert [values["servo", 0, key] for key in ("zero_deg", "min_deg", "max_deg")] == pytest.approx(
        [110 - 14.4, 60 - 14.4, 175 - 14.4]
    )
    first = "{ base_deg = 100, shoulder_deg = 90, elbow_deg = 90 }"
    held = job_horns(plan_job(loads(limited.replace("poses = [", f"poses = [{first}, "), str(file))))[0]
    assert held.fixed and held.turn == 0


def test_a_servo_that_turns_on_and_on_has_no_horn_to_turn() -> None:
    assert job_horns(plan_job(load(Path(__file__).parents[2] / "jobs/omni-square.toml"))) == ()


def test_what_no_horn_can_mend_keeps_its_error(run: Run, file: Path) -> None:
    far = JOB.replace("[-100, 120, 40]", "[-500, 120, 40]")
    with pytest.raises(ServogenError, match="cannot be reached"):
        centre_horns(loads(far, str(file)))
    file.write_text(far, "utf-8")
    ran = run("plan", str(file), "--fit")
    assert ran.code == 2 and "horns" not in ran.err and file.read_text("utf-8") == far


@pytest.mark.parametrize(
    ("servo", "has", "warned"), [("R2-turn", "reverse = true", "has no reverse"), ("", "", None)]
)
def test_a_servo_that_differs_from_its_side_is_warned_of(
    tmp_path: Path, servo: str, has: str, warned: str | None
) -> None:
    text = starter("hexapod", "mpx-tiny-s", tmp_path / "job.toml")
    if servo:
        blocks = text.split("[[servo]]")
        text = "[[servo]]".join(
            block.replace(has, "") if f'"{servo}"' in block else block for block in blocks
        )
    found = plan_job(loads(text, str(tmp_path / "job.toml"))).warnings
    messages = [each.message for each in found if each.code == "reverse-differs"]
    assert bool(messages) == bool(warned)
    assert all(f"{servo} {warned}, unlike R1-turn and R3-turn" in message for message in messages)
