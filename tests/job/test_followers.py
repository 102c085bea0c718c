"""A second servo on a joint: planned with the first one, mirrored or not, in arms, legs and bare servos."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.job.job import Job, PlannedJob
from servogen.twin.rig import twin_rig
from servogen.workflows.engines import planned

ROOT = Path(__file__).parents[2]
CHIP = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'


def servo(name: str, pin: str, *keys: str, model: str = "futaba-s3001") -> str:
    return "\n".join(["[[servo]]", f'name = "{name}"', f'pin = "{pin}"', f'model = "{model}"', *keys, ""])


POSES = """[motion]
poses = [{ tip_mm = [200, 100, 150], hold_s = 0.2 },
         { tip_mm = [250, 60, 200], move_s = 0.6 }]
"""


def arm(*second: str, poses: str = POSES, more: str = "", zero: int = 60) -> str:
    """The catalogue's arm of three joints, its shoulder on two servos."""
    return "\n".join(
        (
            CHIP,
            '[robot]\nname = "anthropomorphic"',
            servo("base", "RB0", 'joint = "q1"', "zero_deg = 90"),
            servo("shoulder", "RB1", 'joint = "q2"', f"zero_deg = {zero}"),
            servo("second", "RB2", *second),
            servo("elbow", "RB3", 'joint = "q3"', "zero_deg = 150"),
            more,
            poses,
        )
    )


MIRRORED = ('follows = "shoulder"', "reverse = true")


def job_of(text: str) -> Job:
    return loads(text, "double.toml")


def plan_of(text: str) -> PlannedJob:
    return plan_job(job_of(text))


def test_a_mirrored_servo_s_pulses_are_the_first_one_s_about_the_middle() -> None:
    """1000 to 2000 µs for 0° to 180°: the two widths add up to 3000 µs in every frame, to a cycle each."""
    schedule = planned(plan_of(arm(*MIRRORED))).plan.schedule
    widths = [run.pulses[1:3] for run in (*schedule.lead_in, *schedule.loop)]
    sums = [first.width + second.width for first, second in widths if first and second]
    assert len(set(widths)) > 5 and set(sums) <= {2999, 3000, 3001}


def test_the_arm_moves_as_it_does_without_its_second_servo() -> None:
    both, one = (
        plan_of(arm(*MIRRORED)),
        plan_of(arm("min_deg = 0").replace("poses = [{", "poses = [{ second_deg = 5,")),
    )
    mine = [0, 1, 3]
    assert np.array_equal(both.trajectory.angles[:, mine], one.trajectory.angles[:, mine])
    assert [pose.angles[1] for pose in both.poses] == [pose.angles[2] for pose in both.poses]
    assert len(both.bindings) == 3 and both.ends[0].columns == (0, 1, 3)


def test_a_horn_that_is_put_on_otherwise_is_an_angle_between_the_two() -> None:
    """Its zero is at 50°, the first one's at 60°: ten degrees less in every frame."""
    angles = np.degrees(plan_of(arm(*MIRRORED, "zero_deg = 50")).trajectory.angles)
    assert np.allclose(angles[:, 2] - angles[:, 1], -10)


def test_the_first_servo_goes_only_where_the_second_one_can() -> None:
    """A second servo 40° further on ends at 180° where the first one is at 140°."""
    job = job_of(arm(*MIRRORED, "zero_deg = 100"))
    low, high = (np.degrees(end) for end in job.servos[1].limits)
    assert high == pytest.approx(140)
    assert [np.degrees(end) - 40 for end in job.servos[2].limits] == pytest.approx([low, high])
    assert job.servos[2].neutral == pytest.approx(job.servos[1].neutral + np.radians(40))
    with pytest.raises(
        InputError, match=r"shoulder cannot go to 150°.*\n  second, which follows it, goes no further"
    ):
        poses = "[motion]\nposes = [{ base_deg = 90, shoulder_deg = 150, elbow_deg = 90, hold_s = 1 }]\n"
        plan_of(arm(*MIRRORED, "zero_deg = 100", poses=poses))


def test_both_servos_turn_the_joint_in_the_twin() -> None:
    rig = twin_rig(plan_of(arm(*MIRRORED, more="").replace("futaba-s3001", "mg996r")))
    turning = [each.name for each in rig.actuators if each.joint == "q2"]
    assert turning == ["shoulder", "second"]
    assert not any("not modelled" in text for text in rig.assumptions)


LAMP = """name = "lamp"
convention = "standard"
payload_g = 300
[lengths_mm]
l = 200
[[joint]]
name = "q"
lower_deg = -90
upper_deg = 90
[[row]]
joint = "q"
a_mm = "l"
[base]
rx_deg = 90
"""


def test_servos_of_one_joint_share_what_it_needs(tmp_path: Path) -> None:
    """0.3 kg · g · 0.2 m are 0.59 N·m: too much for one S3001 of 0.34 N·m, and 0.29 N·m for each of two."""
    (tmp_path / "lamp.toml").write_text(LAMP)
    motion = "[motion]\nrepeat = false\nposes = [{ a_deg = 90, hold_s = 1 }]\n"
    one = CHIP + '[robot]\nname = "lamp.toml"\n' + servo("a", "RB0", 'joint = "q"')
    two = one + servo("b", "RB1", 'follows = "a"', "reverse = true")
    codes = [
        [each.code for each in plan_job(loads(text + motion, str(tmp_path / "job.toml"))).warnings]
        for text in (one, two)
    ]
    assert codes == [["too-heavy"], []]


def test_a_leg_and_servos_without_a_robot_have_followers_too() -> None:
    lab = (ROOT / "jobs" / "lab9-exercise.toml").read_text()
    leg = lab.replace(
        "# EXAMPLE lengths",
        servo("second", "RB2", 'follows = "vertical"', "reverse = true", model="mpx-tiny-s")
        + "# EXAMPLE lengths",
    )
    angles = plan_of(leg).trajectory.angles
    assert np.array_equal(angles[:, 0], angles[:, 2]) and np.ptp(angles[:, 0]) > 0.1
    played = planned(plan_of(leg))
    assert played.engine == "sequence"
    alone = (
        CHIP
        + servo("a", "RB0")
        + servo("b", "RB1", 'follows = "a"')
        + ("[motion]\nposes = [{ a_deg = 30, hold_s = 1 }, { a_us = 1500, hold_s = 1 }]\n")
    )
    assert np.degrees(plan_of(alone).trajectory.angles[[0, -1]]).round(6).tolist() == [[30, 30], [90, 90]]


def test_two_servos_that_are_not_mirrored_are_warned_of() -> None:
    same, mirrored = plan_of(arm('follows = "shoulder"')), plan_of(arm(*MIRRORED))
    assert [each.code for each in same.warnings] == ["not-mirrored"]
    assert "second and shoulder turn the same joint the same way" in same.warnings[0].message
    assert not mirrored.warnings


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (
            ('joint = "q2"',),
            r"two servos turn the joint 'q2'.*\n  write follows = \"shoulder\" in place of joint",
        ),
        (('follows = "sholder"',), r"there is no servo 'sholder'.*\n  did you mean 'shoulder'"),
        (('follows = "second"',), "second follows second, which itself follows second"),
        ((*MIRRORED, 'joint = "q2"'), "second follows shoulder: joint is that of shoulder"),
        ((*MIRRORED, "ratio = -1"), "second follows shoulder: ratio is that of shoulder"),
        ((*MIRRORED, "zero_deg = 240"), "second cannot follow shoulder: its travel is 0° to 180°"),
    ],
)
def test_what_cannot_follow_is_refused_with_its_line(second: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        job_of(arm(*second))
    place = error.value.location
    assert place is not None and place.line is not None
    assert arm(*second).splitlines()[place.line - 1].split(" ")[0] in ("joint", "follows", "ratio")


def test_a_pose_cannot_place_a_servo_that_follows() -> None:
    pose = "base_deg = 90, shoulder_deg = 90, second_us = 1500, elbow_deg = 90, hold_s = 1"
    poses = f"[motion]\nposes = [{{ {pose} }}]\n"
    with pytest.raises(InputError, match=r"second follows shoulder: its angle is not its own"):
        plan_of(arm(*MIRRORED, poses=poses))


def test_a_wheel_cannot_follow_a_servo_with_angles() -> None:
    text = CHIP + servo("a", "RB0") + servo("b", "RB1", 'follows = "a"', model="continuous")
    with pytest.raises(InputError, match="b cannot follow a: one of the two turns continuously"):
        job_of(text + "[motion]\nposes = [{ a_deg = 30, hold_s = 1 }]\n")
