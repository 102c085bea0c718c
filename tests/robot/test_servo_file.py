"""A servo that the catalogue does not know is a file in the catalogue's form."""

import math
from pathlib import Path

import pytest

from servogen.errors import InputError, Location
from servogen.job import load, plan_job
from servogen.robot.servo_models import servo_model

SERVO = """\
title = "Micro servo"
points = [ { angle_deg = 0, width_us = 550 }, { angle_deg = 170, width_us = 2400 } ]
"""

JOB = """\
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[[servo]]
name = "hand"
pin = "RB0"
model = "servos/micro.toml"

[motion]
poses = [ { hand_deg = 0, hold_s = 1 }, { hand_deg = 85, hold_s = 1 } ]
"""


def written(folder: Path, servo: str = SERVO, job: str = JOB) -> Path:
    (folder / "servos").mkdir()
    (folder / "servos" / "micro.toml").write_text(servo)
    (folder / "job.toml").write_text(job)
    return folder / "job.toml"


def error_of(path: Path) -> tuple[str, Location]:
    with pytest.raises(InputError) as caught:
        plan_job(load(path))
    assert caught.value.location is not None
    return caught.value.message, caught.value.location


def test_a_job_takes_the_file_beside_it(tmp_path: Path) -> None:
    servo = plan_job(load(written(tmp_path))).servos[0]
    assert (servo.model.name, servo.model.title) == ("micro", "Micro servo")
    assert servo.width_us(math.radians(85)) == pytest.approx((550 + 2400) / 2)


def test_without_stops_its_travel_is_what_its_points_hold(tmp_path: Path) -> None:
    assert plan_job(load(written(tmp_path))).servos[0].limits == pytest.approx((0, math.radians(170)))


def test_without_a_supply_speed_and_torque_hold_at_any(tmp_path: Path) -> None:
    path = written(tmp_path, SERVO + "speed_deg_s = 600\ntorque_ncm = 18\n")
    model = servo_model(str(path.parent / "servos" / "micro.toml"), 7.4)
    assert model.speed == pytest.approx(math.radians(600))
    assert model.torque_nm == pytest.approx(0.18)


def test_its_own_pulses_are_no_pulses_beyond_the_model(tmp_path: Path) -> None:
    assert not [each for each in plan_job(load(written(tmp_path))).warnings if each.code == "width-range"]


def test_a_file_that_is_not_there_is_told_in_the_job(tmp_path: Path) -> None:
    path = written(tmp_path, job=JOB.replace("micro.toml", "macro.toml"))
    message, place = error_of(path)
    assert message == f"there is no servo file '{tmp_path}/servos/macro.toml'"
    assert (place.file, place.line, place.key) == (str(path), 8, "servo[1].model")


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("title =", "titel =", 1, "unknown key 'titel'"),
        ("width_us = 2400", "width_us = 2.4", 2, "2.4 is out of range: at least 100 is allowed"),
        ("width_us = 2400", "width_us = 550", 2, "the widths of the calibration points do not all rise"),
        ("title", "travel_deg = [90, 0]\ntitle", 1, "travel_deg does not rise"),
    ],
)
def test_a_mistake_in_the_file_is_told_with_its_line_there(
    tmp_path: Path, old: str, new: str, line: int, message: str
) -> None:
    found, place = error_of(written(tmp_path, SERVO.replace(old, new)))
    assert found.startswith(message)
    assert (place.file, place.line) == (str(tmp_path / "servos" / "micro.toml"), line)


def test_an_unknown_model_says_that_a_file_can_be_given(tmp_path: Path) -> None:
    path = written(tmp_path, job=JOB.replace("servos/micro.toml", "sg91"))
    with pytest.raises(InputError, match=r'model = "my-servo\.toml"'):
        plan_job(load(path))
