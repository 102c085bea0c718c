"""The limits of a robot's joints hold for every way to command the servos that turn them."""

import math
import re
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from servogen.drive.controller import job_controller
from servogen.drive.motions import find_pose
from servogen.drive.steering import Rates, job_steering
from servogen.drive.sweep import positions
from servogen.engines.stream.protocol import travel
from servogen.errors import InputError
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.job.starter import template
from servogen.watch.editing import Editor
from servogen.watch.subject import Setting
from tests.job.test_robot_jobs import changed

ARM = """name = "narrow"
convention = "standard"
lengths_mm = { l1 = 100, l2 = 80 }
joint = [{ name = "a", lower_deg = -30, upper_deg = 30 }, { name = "b", lower_deg = -45.55, upper_deg = 45 }]
row = [{ joint = "a", a_mm = "l1" }, { joint = "b", a_mm = "l2" }]
"""

JOB = """[chip]
device = "PIC16F84A"
clock_hz = 4_000_000
[robot]
name = "narrow.toml"
[[servo]]
name = "sa"
pin = "RB0"
model = "futaba-s3001"
joint = "a"
zero_deg = 90
[[servo]]
name = "sb"
pin = "RB1"
model = "futaba-s3001"
joint = "b"
zero_deg = 90
reverse = true
[motion]
poses = [{ sa_deg = 90, sb_deg = 90, hold_s = 1 }, { sa_deg = 120, sb_deg = 45, hold_s = 1 }]
"""

STREAM = "[stream]\nbaud = 2400\n"


def planned(folder: Path, *replacements: tuple[str, str], also: str = "") -> PlannedJob:
    (folder / "narrow.toml").write_text(ARM)
    (folder / "job.toml").write_text(changed(JOB, *replacements) + also)
    return plan_job(load(folder / "job.toml"))


def test_a_pose_of_servo_angles_may_not_turn_a_joint_beyond_its_limits(tmp_path: Path) -> None:
    """±30° about 90°, and ±45° about 90°: the poses at the limits are allowed."""
    assert len(planned(tmp_path).poses) == 2
    for change in (("sa_deg = 120", "sa_deg = 120.1"), ("sb_deg = 45", "sb_deg = 44.4")):
        with pytest.raises(InputError, match=r"\[servo-limit\]\n  the joint [ab] allows -") as caught:
            planned(tmp_path, change)
        assert "poses[2]" in str(caught.value)


def test_positions_of_a_line_and_a_sweep_end_at_the_joints_limits(tmp_path: Path) -> None:
    """The S3001 turns 180° from 1000 to 2000 µs, the second one the other way round."""
    job = planned(tmp_path, also=STREAM)
    ends = [(1000 + angle / 0.18) for angle in (60, 120, 180 - 135, 180 - 44.45)]
    found = [
        width
        for servo in job.servos
        for width in (travel(servo, job.clock).minimum, travel(servo, job.clock).maximum)
    ]
    assert found == pytest.approx(ends, abs=1)
    _, controller = job_controller(job, None, None, 0)
    channel = controller.channels[0]
    swept = [channel.widths_us[position] for position in positions(channel, None, None, 5)]
    assert (min(swept), max(swept)) == pytest.approx((ends[0], ends[1]), abs=channel.step_us)


def test_keys_and_poses_drive_no_joint_beyond_its_limits(tmp_path: Path) -> None:
    job = planned(tmp_path, also=STREAM)
    with pytest.raises(InputError, match="sa cannot go to 121°"):
        find_pose(job, "sa=121")
    jog = job_steering(job, Rates())
    for command in ("coarser", "coarser", "coarser", *"+" * 9):
        jog.command(command)
    angles = jog.at(100)
    assert angles is not None and math.degrees(angles[0]) == pytest.approx(120)


def test_a_pose_recorded_from_sliders_beyond_the_limits_can_be_built(tmp_path: Path) -> None:
    """It is at the limits, which are rounded inward: 90° - 45.55° is 44.45°."""
    planned(tmp_path)
    editor = Editor(tmp_path / "job.toml", Setting())
    found, _ = editor.handle({"do": "record", "text": JOB, "angles": [3.0, 0.1]}, Event())
    assert "{ sa_deg = 120, sb_deg = 44.5, hold_s = 1 }" in found["text"]
    assert editor.handle({"do": "check", "text": found["text"]}, Event())[0]["good"]


def test_a_servo_that_cannot_turn_its_joint_within_its_limits_is_refused_where_it_is_mounted(
    tmp_path: Path,
) -> None:
    with pytest.raises(
        InputError, match=r"sa cannot turn the joint a within its limits: its limits are -30°"
    ):
        planned(tmp_path, ("zero_deg = 90", "zero_deg = -31"))


TURNTABLE = """<robot name="turntable"><link name="b"/><link name="l1"/><link name="l2"/><link name="tip"/>
<joint name="turn" type="continuous"><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/><parent link="b"/>
<child link="l1"/></joint>
<joint name="up" type="revolute"><axis xyz="0 -1 0"/><limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>
<parent link="l1"/><child link="l2"/></joint>
<joint name="f" type="fixed"><origin xyz="0.1 0 0"/><parent link="l2"/><child link="tip"/></joint></robot>"""


def test_a_continuous_joint_turns_wherever_its_servo_does(tmp_path: Path) -> None:
    """Across 180°: the servo, at 80° and 100°, turns the joint to 170° and to 190°, which is -170°."""
    (tmp_path / "table.urdf").write_text(TURNTABLE)
    x, y = (1000 * 0.1 * function(math.radians(170)) for function in (math.cos, math.sin))
    text = changed(
        JOB,
        ("narrow.toml", "table.urdf"),
        ('joint = "a"\nzero_deg = 90', 'joint = "turn"\nzero_deg = -90'),
        ('joint = "b"', 'joint = "up"'),
        ("reverse = true\n", ""),
        ("sa_deg = 90, sb_deg = 90", f"tip_mm = [{x}, {y}, 100]"),
        ("sa_deg = 120, sb_deg = 45", f"tip_mm = [{x}, {-y}, 100]"),
    )
    (tmp_path / "job.toml").write_text(text)
    job = plan_job(load(tmp_path / "job.toml"))
    assert np.degrees([pose.angles for pose in job.poses]) == pytest.approx(np.array([[80, 90], [100, 90]]))


@pytest.mark.parametrize(
    ("facts", "advice"),
    [
        pytest.param("zero_deg = 175", "servogen plan JOB --fit writes zero_deg", id="a horn turned"),
        pytest.param("min_deg = 89\nmax_deg = 91", "shorten the stride or the turn", id="too little travel"),
    ],
)
def test_a_walk_beyond_a_servo_s_travel_is_told_what_mends_it(facts: str, advice: str) -> None:
    text = re.sub(r'(joint = "L1_hip"[^\n]*\n)', rf"\1{facts}\n", template("hexapod-hip-lift"), count=1)
    assert facts in text
    with pytest.raises(InputError, match="cannot go to") as error:
        plan_job(loads(text, "walk.toml"))
    assert error.value.hint is not None and advice in error.value.hint
