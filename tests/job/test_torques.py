"""A joint that asks for more static torque than its servo is rated for is a warning, frame by frame."""

import math
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.job import PlannedJob, load, plan_job

HEXAPOD = Path(__file__).with_name("hexapod.toml").read_text()

WALKER = """\
name = "heavy"
kind = "hexapod"
like = "hexapod"
mass_g = {mass_g}
"""


def walker(folder: Path, mass_g: float, height_mm: float = 120) -> PlannedJob:
    (folder / "heavy.toml").write_text(WALKER.format(mass_g=mass_g))
    text = HEXAPOD.replace('name = "hexapod"', 'name = "heavy.toml"', 1)
    text = text.replace("[walk]", f"[walk]\nbody_height_mm = {height_mm}", 1)
    (folder / "job.toml").write_text(text)
    return plan_job(load(folder / "job.toml"))


def heavy(job: PlannedJob) -> list[str]:
    return [each.message for each in job.warnings if each.code == "too-heavy"]


def test_a_hexapod_of_2240_g_is_too_heavy_at_120_mm(tmp_path: Path) -> None:
    """cos β = (120 - 80) / 60, so l_BC sin β = 44.7 mm. A third of 21.97 N asks for 0.33 N·m; the middle leg
    of a tripod stands alone on its side and carries half: 0.49 N·m. A Tiny-S is rated 25 N·cm at 4.8 V."""
    lever = math.sqrt(0.06**2 - 0.04**2)
    weight = 2.24 * 9.80665
    assert f"{weight / 3 * lever:.2f} {weight / 2 * lever:.2f}" == "0.33 0.49"
    found = heavy(walker(tmp_path, 2240))
    assert len(found) == 6
    middle = [text for text in found if "L2_beta" in text or "R2_beta" in text]
    assert len(middle) == 2
    for text in middle:
        assert "needs 0.49 N·m in frame " in text
        assert "rated 0.25 N·m" in text
        assert "carries 11.0 of 22.0 N (0.33 N·m if all standing feet shared it equally)" in text


def test_the_middle_legs_are_the_first_to_be_asked_too_much(tmp_path: Path) -> None:
    """Half of the weight on 44.7 mm is 0.25 N·m at 1140 g."""
    assert heavy(walker(tmp_path, 1130)) == []
    found = heavy(walker(tmp_path, 1150))
    assert [text.split(":")[0] for text in found] == ["L2-lift", "R2-lift"]


def test_a_leg_that_stands_straight_down_carries_anything(tmp_path: Path) -> None:
    """At 140 mm β is 0: the weight is on the joint's bearing."""
    assert heavy(walker(tmp_path, 2240, 140)) == []


def test_a_robot_without_a_mass_is_not_judged(tmp_path: Path) -> None:
    (tmp_path / "job.toml").write_text(HEXAPOD.replace("[walk]", "[walk]\nbody_height_mm = 120", 1))
    assert heavy(plan_job(load(tmp_path / "job.toml"))) == []


ARM = """\
name = "mine"
convention = "standard"
payload_g = {payload_g}

[[joint]]
name = "shoulder"
mass_g = 100
centre_of_mass_mm = [-100, 0, 0]

[[joint]]
name = "lift"
kind = "sliding"
lower_mm = 0
upper_mm = 100

[[row]]
alpha_deg = 90

[[row]]
joint = "shoulder"
a_mm = 200
alpha_deg = -90

[[row]]
joint = "lift"
"""
"""A shoulder that turns about a horizontal axis; 200 mm out, a slide."""

ARM_JOB = """\
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[[servo]]
name = "one"
pin = "RB0"
model = "futaba-s3001"
joint = "shoulder"
zero_deg = 90
ratio = {ratio}

[[servo]]
name = "two"
pin = "RB1"
model = "futaba-s3001"
joint = "lift"
zero_deg = 0
deg_per_mm = 1.8

[robot]
name = "arm.toml"

[motion]
repeat = false
poses = [
    {{ one_deg = 180, two_deg = 0, hold_s = 0.5 }},
    {{ one_deg = 90, two_deg = 0, move_s = 1, hold_s = 0.5 }},
]
"""


def arm(folder: Path, payload_g: float, ratio: float = 1) -> PlannedJob:
    (folder / "arm.toml").write_text(ARM.format(payload_g=payload_g))
    (folder / "job.toml").write_text(ARM_JOB.format(ratio=ratio))
    return plan_job(load(folder / "job.toml"))


def test_an_arm_is_asked_for_most_when_it_is_stretched_out(tmp_path: Path) -> None:
    """Horizontal, at the end: 9.80665 (0.1 · 0.1 + 0.2 m) N·m; 34 N·cm hold m = 123 g."""
    assert heavy(arm(tmp_path, 120)) == []
    (found,) = heavy(arm(tmp_path, 200))
    assert found.startswith("one: holding shoulder in place needs 0.49 N·m in frame ")
    assert "rated 0.34 N·m" in found


def test_a_gear_gives_the_servo_its_part_of_the_torque(tmp_path: Path) -> None:
    """A servo that turns half as far as its joint gives twice the joint's torque; that it turns 90° then
    leads the joint to 180°, past the horizontal."""
    (found,) = heavy(arm(tmp_path, 120, 0.5))
    assert "needs 0.67 N·m" in found  # 2 · 9.80665 (0.01 + 0.024)


@pytest.mark.parametrize(
    ("robot", "says"),
    [
        (WALKER.format(mass_g=0), "mass_g"),
        (WALKER.format(mass_g="1e9"), "mass_g"),
        (WALKER.format(mass_g=1) + "payload_g = 5\n", "'payload_g' belongs in a file of kind"),
        (ARM.format(payload_g=-1), "payload_g"),
        (ARM.format(payload_g=0).replace("mass_g = 100\n", ""), "the joint 'shoulder' has no mass"),
        (ARM.format(payload_g=0) + '\n[[mount]]\nname = "x"\nx_mm = 0\ny_mm = 0\n', "'mount' belongs"),
    ],
)
def test_a_mass_that_cannot_be_is_refused(tmp_path: Path, robot: str, says: str) -> None:
    (tmp_path / "arm.toml").write_text(robot)
    (tmp_path / "job.toml").write_text(ARM_JOB.format(ratio=1))
    with pytest.raises(InputError, match=says):
        plan_job(load(tmp_path / "job.toml"))
