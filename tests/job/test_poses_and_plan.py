"""[motion] poses of a job pose by pose, the limits of its servos, and the loads on an arm."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import PlannedJob, loads, plan_job
from servogen.job.job import NamedPose
from servogen.motion.laws import law
from servogen.motion.trajectory import Part

HEAD = '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n'


def servo(name: str, pin: str, more: str = "") -> str:
    return f'[[servo]]\nname = "{name}"\npin = "{pin}"\nmodel = "futaba-s3001"\n{more}\n'


TWO = servo("arm", "RB0") + servo("hand", "RB1")


def planned(
    poses: str, motion: str = "", servos: str = TWO, more: str = "", file: str = "job.toml"
) -> PlannedJob:
    text = f"{HEAD}{servos}{more}\n[motion]\n{motion}\nposes = [\n{poses}\n]\n"
    return plan_job(loads(text, file))


def refusal(poses: str, **parts: str) -> str:
    with pytest.raises(InputError) as caught:
        planned(poses, **parts)
    return str(caught.value).split("error: ", 1)[1]


FIRST = "{ arm_deg = 0, hand_deg = 90, hold_s = 0.1 },\n"


def test_a_move_follows_its_own_law_else_the_motion_s_else_a_line() -> None:
    for own, common, expected in [
        ("move_s = 0.2", "", "linear"),
        ('move_s = 0.2, law = "cubic"', "", "cubic"),
        ("move_s = 0.2", 'law = "quintic"', "quintic"),
        ('move_s = 0.2, law = "s-curve"', 'law = "quintic"', "s-curve"),
    ]:
        made = planned(FIRST + f"{{ arm_deg = 90, {own}, hold_s = 0.1 }}", common + "\nrepeat = false")
        found = np.degrees(made.trajectory.angles[4:15, 0])
        assert found == pytest.approx(90 * law(expected).share(np.arange(11) / 10))
        assert (made.trajectory.angles[:, 1] == math.radians(90)).all()  # a servo that is not named stays


def test_a_move_without_a_time_is_at_once_or_with_a_law_as_fast_as_the_servos_can() -> None:
    for own, common, seconds in [
        ("hold_s = 0.1", "", 0.0),  # at once
        ("hold_s = 0.1", 'law = "linear"', math.radians(90) / 1.8),  # as fast as the servo can
        ('law = "linear"', "", math.radians(90) / 1.8),
        ("move_s = 0.2", 'law = "linear"', 0.2),
    ]:
        made = planned(FIRST + f"{{ arm_deg = 90, {own} }}", common + "\nrepeat = false")
        angles = np.degrees(made.trajectory.angles[:, 0])
        first = int(np.argmax(angles >= 90 - 1e-9))
        assert first - 4 == max(1, math.ceil(seconds / 0.02 - 1e-9))


def test_poses_have_the_names_and_angles_of_the_file_and_parts() -> None:
    made = planned(
        '{ name = "low", arm_deg = 30, hand_deg = 45, move_s = 0.02, hold_s = 0.1 },\n'
        "{ hand_deg = 60, pause_s = 0.04 }"
    )
    assert made.poses == (
        NamedPose("low", pytest.approx((math.radians(30), math.radians(45)))),
        NamedPose(None, pytest.approx((math.radians(30), math.radians(60)))),
    )
    assert made.parts == (Part("pose 1", 0), Part("pose 2", 5), Part("pose 1", 7))
    assert made.trajectory.joints == ("arm", "hand")


def test_a_pose_that_cannot_be_is_refused_at_its_key() -> None:
    for pose, said in [
        ("{ release = true, hold_s = 1 }", "motion.poses[2].release: release = true without a pause"),
        (
            "{ via = true, hold_s = 1, move_s = 1 }",
            "motion.poses[2].hold_s: a via pose has no hold and no pause",
        ),
        (
            "{ via = true, pause_s = 1, move_s = 1 }",
            "motion.poses[2].pause_s: a via pose has no hold and no pause",
        ),
        ("{ tip_mm = [0, 0, 0] }", "motion.poses[2].tip_mm: a position needs an arm"),
        ("{ foot_mm = [0, 0, 0] }", "motion.poses[2].foot_mm: a foot position needs a leg"),
        ('{ path = "line", hold_s = 1 }', 'motion.poses[2].path: path = "line" needs a position'),
        ("{ through_mm = [0, 0, 0] }", "motion.poses[2].through_mm: only an arc goes through a point"),
        ("{ orientation_deg = [0] }", "motion.poses[2].orientation_deg: an orientation needs a position"),
        ("{ arm_deg = 180.001, hold_s = 1 }", "motion.poses[2].arm_deg: arm cannot go to 180.001°"),
        ("{ arm_deg = -0.001, hold_s = 1 }", "motion.poses[2].arm_deg: arm cannot go to -0.001°"),
        ('{ arm_deg = "9", hold_s = 1 }', 'motion.poses[2].arm_deg: "9" is not an angle'),
        ("{ arm_deg = false, hold_s = 1 }", "motion.poses[2].arm_deg: false is not an angle"),
        ("{ arm_deg_s = 5, hold_s = 1 }", "motion.poses[2].arm_deg_s: 'arm_deg_s' is not"),
    ]:
        assert refusal(FIRST + pose).startswith(said)


def test_the_first_pose_states_every_servo_and_no_two_have_a_name() -> None:
    assert refusal("{ arm_deg = 9, hold_s = 1 }").startswith(
        "motion.poses[1]: the first pose does not state the angle of hand [pose-keys]\n  add hand_deg = …"
    )
    same = '{ name = "a", arm_deg = 9, hand_deg = 9, hold_s = 1 },\n' * 2
    assert refusal(same).startswith("motion.poses[2].name: two poses have the name 'a'")


LEG = """[leg]
ab_mm = 25
bc_mm = 40
cd_mm = 40
df_mm = 60
alpha = "arm"
beta = "hand"
beta_zero_deg = {zero}
"""


@pytest.mark.parametrize(("zero", "sign"), [(100, -1), (80, 1)])
def test_the_first_pose_takes_the_solution_nearest_to_the_servos_middle(zero: float, sign: int) -> None:
    """β = ±30° about a zero beside the middle of the travel; later poses stay near the one before."""
    out = math.hypot(65, 40 * math.sin(math.radians(30)))
    height = -60 - 40 * math.cos(math.radians(30))
    foot = f"foot_mm = [0, {out:.9f}, {height:.9f}]"
    made = planned(f"{{ {foot}, hold_s = 0.1 }}", more=LEG.format(zero=zero))
    assert np.degrees(made.poses[0].angles[1]) == pytest.approx(zero + 30 * sign, abs=1e-4)
    other = f"{{ arm_deg = 90, hand_deg = {zero - 30 * sign}, hold_s = 0.1 }},\n{{ {foot}, hold_s = 0.1 }}"
    after = planned(other, more=LEG.format(zero=zero))
    assert np.degrees(after.poses[1].angles[1]) == pytest.approx(zero - 30 * sign, abs=1e-4)


def test_a_line_of_the_foot_is_followed_in_millimetres() -> None:
    """Along the circle about α nothing is lost; across it the spring yields up to the tolerance."""
    start, end = (-10.0, 75.0, -95.0), (10.0, 75.0, -95.0)
    poses = f"{{ foot_mm = {list(start)}, hold_s = 0.1 }},\n"
    poses += f"{{ foot_mm = {list(end)}, path = 'line', move_s = 0.4 }}"
    made = planned(poses, "repeat = false", more=LEG.format(zero=90) + "tolerance_mm = 10\n")
    tip = made.tip
    assert tip is not None
    feet = 1000 * tip.where(made.trajectory.angles)
    assert feet[0, 0] == pytest.approx(-feet[-1, 0], abs=1e-6)
    assert (np.diff(feet[4:25, 0]) > 0).all()
    assert feet[14, 0] == pytest.approx(0, abs=1e-6)


def test_a_servo_that_does_not_move_the_foot_goes_evenly_along_the_line() -> None:
    """From 30° to 80° by the law of the move, whatever the joints of the leg do meanwhile."""
    poses = "{ foot_mm = [-10, 75, -95], grip_deg = 30, hold_s = 0.1 },\n"
    poses += "{ foot_mm = [10, 75, -95], grip_deg = 80, path = 'line', move_s = 0.4, law = 'cubic' }"
    leg = LEG.format(zero=90) + "tolerance_mm = 10\n"
    made = planned(poses, "repeat = false", servos=servo("grip", "RB2") + TWO, more=leg)
    grip = np.degrees(made.trajectory.angles[4:25, 0])
    assert grip == pytest.approx(30 + 50 * law("cubic").share(np.arange(21) / 20))


# ---- servos and joints ----------------------------------------------------------------------------------

LAMP = """name = "lamp"
convention = "standard"
payload_g = {payload}
[lengths_mm]
l = 200
[[joint]]
name = "q"
lower_deg = -90
upper_deg = 90
speed_deg_s = 30
[[row]]
joint = "q"
a_mm = "l"
[base]
rx_deg = 90
"""


def lamp(folder: Path, payload: float, ratio: float, poses: str, end: str = "hold") -> PlannedJob:
    (folder / "lamp.toml").write_text(LAMP.format(payload=payload))
    one = servo("s", "RB0", f'joint = "q"\nratio = {ratio}')
    motion = f'repeat = false\nend = "{end}"'
    return planned(poses, motion, one, '[robot]\nname = "lamp.toml"\n', str(folder / "job.toml"))


# The lamp's arm of 200 mm is level at 0: the torque is m g 0.2 m; a servo with a ratio r holds 1/r of it. An
# S3001 is rated 0.34 N·m, which is 173.35 g at a ratio of 1.
def test_an_arm_s_servo_holds_its_load_by_its_ratio(tmp_path: Path) -> None:
    for payload, ratio, needed in [
        (173.3, 1.0, None),
        (173.4, 1.0, 0.34),
        (400, 1.0, 0.78),
        (400, 2.0, 0.39),
        (400, -2.0, 0.39),
        (400, 2.5, None),
    ]:
        made = lamp(tmp_path, payload, ratio, "{ s_deg = 180, hold_s = 0.1 },\n{ s_deg = 90, hold_s = 0.1 }")
        heavy = [each for each in made.warnings if each.code == "too-heavy"]
        if needed is None:
            assert not heavy
        else:
            (warning,) = heavy
            assert f"s: holding q in place needs {needed:.2f} N·m in frame 5, " in warning.message


def test_a_joint_s_speed_limits_its_servo_by_their_ratio(tmp_path: Path) -> None:
    """30°/s of the joint are 30°/s times the ratio of its servo, which turns 45° here; it could do 103°/s."""
    for ratio, speed in ((1.0, 30.0), (2.0, 60.0), (-2.0, 60.0), (4.0, math.degrees(1.8))):
        made = lamp(tmp_path, 0, ratio, '{ s_deg = 90, hold_s = 0.1 },\n{ s_deg = 135, law = "linear" }')
        frames = math.ceil(45 / speed / 0.02 - 1e-9)
        assert np.degrees(made.trajectory.angles[4 + frames, 0]) == pytest.approx(135)
        assert np.degrees(made.trajectory.angles[3 + frames, 0]) < 135 - 0.1


def test_a_released_frame_carries_nothing(tmp_path: Path) -> None:
    poses = "{ s_deg = 180, hold_s = 0.1 },\n{ s_deg = 90, pause_s = 0.1, release = true }"
    made = lamp(tmp_path, 400, 1.0, poses, "release")
    assert not [each for each in made.warnings if each.code == "too-heavy"]


def test_a_spline_beyond_a_servo_s_travel_is_refused() -> None:
    """Through 0°, 180° and 100° in equal times a spline overshoots 180°."""
    poses = (
        "{ arm_deg = 90, hand_deg = 9, hold_s = 0.1 },\n{ arm_deg = 180, move_s = 1, via = true },\n"
        "{ arm_deg = 178, move_s = 1, via = true },\n{ arm_deg = 90, move_s = 1 }"
    )
    said = refusal(poses, motion="repeat = false")
    assert said.startswith("motion: arm cannot go to ")
    assert float(said.split(" go to ")[1].split("°")[0]) > 180
