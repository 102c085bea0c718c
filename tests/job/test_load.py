"""A job file is a `Job`, or an error that says where it is wrong and what is allowed."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from servogen.engines.registry import ENGINES
from servogen.errors import InputError, ServogenError
from servogen.job import PlannedJob, load, loads, plan_job, template
from servogen.pulse import plan
from servogen.workflows.engines import planned

JOB = """\
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"

[[servo]]
name = "hand"
pin = "RB1"
model = "mpx-tiny-s"

[motion]
poses = [
    { arm_deg = 30, hand_deg = 0, hold_s = 2 },
    { arm_deg = 90, hold_s = 5 },
]

[frame]
period_us = 20_000
"""

LEG = """
[leg]
ab_mm = 25
bc_mm = 40
cd_mm = 40
df_mm = 60
alpha = "arm"
beta = "hand"
"""


def changed(*replacements: tuple[str, str]) -> str:
    text = JOB + LEG
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def foot(*xyz: float) -> str:
    return changed(("arm_deg = 30, hand_deg = 0", f"foot_mm = [{', '.join(str(value) for value in xyz)}]"))


def error_of(text: str) -> str:
    with pytest.raises(ServogenError) as caught:
        plan_job(loads(text, "job.toml"))
    assert caught.value.exit_code == 2
    return str(caught.value)


def degrees(job: PlannedJob, index: int) -> list[float]:
    """The servos' angles in the first (0) or the last (1) of the two poses."""
    return [math.degrees(angle) for angle in job.trajectory.angles[-index].tolist()]


def test_a_job_is_what_its_file_says() -> None:
    job = plan_job(loads(JOB, "folder/walk.toml"))
    assert (job.name, job.device.name, job.clock.hz) == ("walk", "PIC16F84", 4_000_000)
    assert [(servo.name, servo.pin, servo.model.name) for servo in job.servos] == [
        ("arm", "RB0", "futaba-s3001"),
        ("hand", "RB1", "mpx-tiny-s"),
    ]
    assert (job.frame.period.cycles, job.firmware.dialect, job.firmware.engine) == (20_000, "c2c", "auto")
    assert job.trajectory.joints == ("arm", "hand")
    assert len(job.trajectory.angles) == 350
    assert job.warnings == ()


def test_a_servo_that_a_pose_does_not_name_stays() -> None:
    assert degrees(plan_job(loads(JOB, "job.toml")), 1) == pytest.approx([90, 0])


def test_facts_of_a_servo_can_be_given_in_the_job() -> None:
    more = 'model = "futaba-s3001"\ntrim_us = -10\nreverse = true\nmax_deg = 170\nspeed_deg_s = 90\n'
    points = "points = [{ angle_deg = 0, width_us = 985 }, { angle_deg = 180, width_us = 2010 }]\n"
    arm = plan_job(loads(changed(('model = "futaba-s3001"\n', more + points)), "job.toml")).servos[0]
    assert arm.width_us(math.radians(170)) == pytest.approx(985 + 1025 * 10 / 180 - 10)
    assert arm.model.speed == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[chip]", "[chip", "job.toml:1:6: error: TOML syntax"),
        ("[chip]", "[chap]",
            "job.toml:1:1: error: chap: unknown key 'chap' [unknown-key]\n  did you mean 'chip'?"),
        ('device = "PIC16F84"', 'device = "PIC16F88"',
            "2:1: error: chip.device: unknown device 'PIC16F88' [unknown-device]\n  known: PIC16F84,"),
        ("4_000_000", "20_000_000", "3:1: error: chip.clock_hz: 20000000 Hz is above the PIC16F84's limit"),
        ("clock_hz", "clock", "3:1: error: chip.clock: 'clock' has no unit: write clock_hz"),
        ('pin = "RB1"', 'pin = "RB0"', "12:1: error: servo[2].pin: two servos are on pin RB0: arm and hand"),
        ('pin = "RB1"', 'pin = "RB8"',
            "12:1: error: servo[2].pin: unknown pin 'RB8' [unknown-pin]\n  did you mean"),
        ('pin = "RB1"', 'pin = "RA4"', "12:1: error: servo[2].pin: RA4 is an open drain"),
        ('pin = "RB1"', 'pin = "RB1"\nopen_drain = true',
            "13:1: error: servo[2].open_drain: RB1 is not an open drain"),
        ('name = "hand"', 'name = "arm"', "11:1: error: servo[2].name: two servos have the name 'arm'"),
        ('name = "hand"', 'name = "2nd"', '11:1: error: servo[2].name: "2nd" is not a name'),
        ("mpx-tiny-s", "mpx-tinys",
            "13:1: error: servo[2].model: unknown servo model 'mpx-tinys' [unknown-servo-model]\n  "
            "did you mean"),
        ('"mpx-tiny-s"', '"mpx-tiny-s"\nsupply_v = 12', "14:1: error: servo[2].supply_v: 12 V is outside"),
        ('"mpx-tiny-s"', '"mpx-tiny-s"\nmax_deg = 200',
            "14:1: error: servo[2].max_deg: hand cannot have limits"),
        ('"mpx-tiny-s"', '"mpx-tiny-s"\ntrim = 5',
            "14:1: error: servo[2].trim: 'trim' has no unit: write trim_us"),
        ('"mpx-tiny-s"', '"mpx-tiny-s"\ntrim_us = -2000',
            "14:1: error: servo[2].trim_us: hand's shortest pulse"),
        ('"mpx-tiny-s"', '"mpx-tiny-s"\npoints = [{ angle_deg = 0, width_us = 1000 }]',
            "14:1: error: servo[2].points: has 1 value [wrong-type]\n  at least 2"),
        ("arm_deg = 90", "arm_deg = 181", "18:7: error: motion.poses[2].arm_deg: arm cannot go to 181°"),
        ("arm_deg = 90", "arm = 90", "18:7: error: motion.poses[2].arm: 'arm' has no unit: write arm_deg"),
        ("arm_deg = 90", "arm_rad = 1",
            "18:7: error: motion.poses[2].arm_rad: 'arm_rad' is not given in rad"),
        ("arm_deg = 90", "hnd_deg = 1", "there is no servo 'hnd' [unknown-servo]\n  did you mean 'hand'?"),
        ("arm_deg = 90", "arm_deg = true", "18:7: error: motion.poses[2].arm_deg: true is not an angle"),
        ("arm_deg = 90", "arm_deg = nan", "nan is not an angle"),
        ("arm_deg = 90", f"arm_deg = {10**400}",
            "is too large [out-of-range]\n  whole numbers are those of 64 bits"),
        (", hand_deg = 0", "",
            "17:5: error: motion.poses[1]: the first pose does not state the angle of hand"),
        ("hold_s = 5", "hold_s = -5", "18:21: error: motion.poses[2].hold_s: -5 is out of range: at least 0"),
        ("hold_s = 5", "hold = 5", "18:21: error: motion.poses[2].hold: 'hold' has no unit: write hold_s"),
        ("hold_s = 5", "hold_ms = 5", "'hold_ms' is not given in ms: write hold_s"),
        ("hold_s = 5", "hold_s = 0", "18:5: error: motion.poses[2]: a pose takes no time"),
        ("hold_s = 5", "hold_s = 1e300", "1e+300 is out of range: at most 1e+06 is allowed"),
        ("hold_s = 5", "hold_s = 65536",
            "18:5: error: motion.poses[2]: with hold_s = 65536 the motion is more than 500000 frames "
            "long, 10000 s"),
        ("hold_s = 5", "move_s = 65536", "with move_s = 65536 the motion is more than 500000 frames long"),
        ("hold_s = 5", "hold_s = 9999, pause_s = 9999",
            "with this pose the motion is more than 500000 frames"),
        ("[motion]", "[firmware]\nsoft_start_s = 5000\n[motion]",
            "16:1: error: firmware.soft_start_s: the motion and a soft start of 5000 s are 500"),
        ("hold_s = 5", "hold_s = 5, release = true", "release = true without a pause"),
        ("[motion]", '[motion]\nend = "hold"', "16:1: error: motion.end: a motion that repeats has no end"),
        ("[motion]", "[motion]\nrepeat = 0", "16:1: error: motion.repeat: 0 is not true or false"),
        ("period_us = 20_000", "period = 20_000",
            "22:1: error: frame.period: 'period' has no unit: write period_us"),
        ("period_us = 20_000", "period_ms = 20", "'period_ms' is not given in ms: write period_us"),
        ("period_us = 20_000", "period_us = 1e-9", "1e-09 µs is not longer than a pulse"),
        ("period_us = 20_000", "period_us = 20",
            "period_us: 20 µs is not longer than a pulse [out-of-range]\n  20 ms is 20_000"),
        ("[frame]\nperiod_us = 20_000", '[firmware]\nengine = "sequence"\n[frame]\nperiod_us = 3_000',
            "frame.period_us: the pulses do not fit a frame"),
        ("clock_hz = 4_000_000", "clock_hz = 4", "clock_hz: 4 Hz is slower than any crystal"),
        ("clock_hz = 4_000_000", "clock_hz = 4e6", "without a point and an exponent: 4_000_000"),
        ('"mpx-tiny-s"', '"mpx-tiny-s"\nmin_deg = 90\nmax_deg = 9',
            "14:1: error: servo[2].min_deg: hand's minimum angle"),
        ("[chip]", "[chipp]", "unknown key 'chipp' [unknown-key]\n  did you mean 'chip'?"),
        ("period_us = 20_000", "period_us = inf", "inf is not a finite number"),
        ('alpha = "arm"', 'alpha = "amr"',
            "29:1: error: leg.alpha: there is no servo 'amr' [unknown-servo]\n  did you mean 'arm'?"),
        ('alpha = "arm"', 'alpha = "hand"', "'hand' is the servo of both joints"),
        ("bc_mm = 40", "bc_mm = 0", "26:1: error: leg.bc_mm: 0 is out of range: at least 0.001"),
        ("bc_mm = 40", "bc = 40", "26:1: error: leg.bc: 'bc' has no unit: write bc_mm"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_place(old: str, new: str, says: str) -> None:
    assert says in error_of(changed((old, new)))


def test_a_frame_too_short_for_the_motions_pulses_is_refused_when_it_is_planned() -> None:
    job = plan_job(loads(changed(("period_us = 20_000", "period_us = 2_000")), "job.toml"))
    with pytest.raises(InputError, match=r"22:1: error: frame\.period_us: the pulses do not fit a frame"):
        planned(job)


def test_a_foot_position_needs_a_leg() -> None:
    text = JOB.replace("arm_deg = 30, hand_deg = 0", "foot_mm = [25, 60, -100]")
    assert "17:7: error: motion.poses[1].foot_mm: a foot position needs a leg" in error_of(text)


def test_a_foot_position_is_the_servos_angles() -> None:
    # r = 65 mm: the foot at (25, 60) with the leg down is alpha = -asin(25/65), beta = 0; both zeros are 90°.
    job = plan_job(loads(foot(25, 60, -100), "job.toml"))
    assert degrees(job, 0) == pytest.approx([90 - math.degrees(math.asin(25 / 65)), 90])


def test_an_unreachable_foot_position_says_why_and_what_is_nearest() -> None:
    error = error_of(foot(25, 60, -150))
    assert (
        "17:7: error: motion.poses[1].foot_mm: the point (25.000, 60.000, -150.000) mm cannot be reached"
        in error
    )
    assert "the nearest reachable point is (" in error


def test_a_foot_position_beyond_the_servos_travel_is_refused() -> None:
    error = error_of(foot(-25, -60, -100))
    assert "needs angles outside the servos' travel" in error


def test_a_pose_takes_the_foot_or_its_servos_not_both() -> None:
    text = changed(("arm_deg = 30, hand_deg = 0", "foot_mm = [25, 60, -100], arm_deg = 90"))
    assert "arm already follows from foot_mm" in error_of(text)


def test_of_two_solutions_the_one_nearest_to_the_pose_before_is_taken() -> None:
    # sin beta = ±0.6: s = ±24, Z = -92; the foot at alpha = 0 and beta > 0 is at (-24, 65, -92).
    down, up = "foot_mm = [0, 65, -100]", "foot_mm = [-24, 65, -92]"
    text = changed(("arm_deg = 30, hand_deg = 0", down), ("arm_deg = 90", up))
    assert degrees(plan_job(loads(text, "job.toml")), 1) == pytest.approx(
        [90, 90 + math.degrees(math.asin(0.6))], abs=1e-6
    )


def test_the_sign_of_beta_can_be_fixed() -> None:
    down, up = "foot_mm = [0, 65, -100]", "foot_mm = [-24, 65, -92]"
    text = changed(("arm_deg = 30, hand_deg = 0", down), ("arm_deg = 90", up))
    job = plan_job(loads(text + 'beta_sign = "negative"\n', "job.toml"))
    assert degrees(job, 1)[1] == pytest.approx(90 - math.degrees(math.asin(0.6)), abs=1e-6)


def test_ra4_is_taken_when_its_pull_up_is_stated() -> None:
    text = changed(('pin = "RB1"', 'pin = "RA4"\nopen_drain = true'))
    assert plan_job(loads(text, "job.toml")).servos[1].pin == "RA4"


def test_a_hold_that_is_not_whole_frames_warns_at_its_pose() -> None:
    (warning,) = plan_job(loads(changed(("hold_s = 5", "hold_s = 5.005")), "job.toml")).warnings
    assert warning.code == "frames-rounded"
    assert str(warning).startswith(
        "job.toml:18:5: warning: motion.poses[2]: hold_s = 5.005 is not a whole number"
    )


def test_a_motion_may_end() -> None:
    text = changed(("[motion]", '[motion]\nrepeat = false\nend = "release"'))
    job = plan_job(loads(text, "job.toml"))
    assert job.trajectory.loop_start == 350
    assert plan(job.trajectory, job.servos, job.frame).schedule.loop[0].pulses == (None, None)


def test_the_template_loads_without_a_warning(tmp_path: Path) -> None:
    file = tmp_path / "new.toml"
    file.write_text(template(), encoding="utf-8")
    job = plan_job(load(file))
    assert job.warnings == ()
    assert plan(job.trajectory, job.servos, job.frame).warnings == ()


def test_what_the_template_comments_out_is_right_too() -> None:
    text = template()
    for comment in ("min_deg", "max_deg", "points", "gap_us"):
        assert f"# {comment} = " in text
        text = text.replace(f"# {comment} = ", f"{comment} = ")
    assert plan_job(loads(text, "new.toml")).servos[0].limits == pytest.approx(
        (math.radians(10), math.radians(170))
    )


def test_a_foot_on_a_straight_line_strays_by_what_its_spring_gives() -> None:
    # On the ground (beta = 0) the foot goes on a circle of 65 mm: 65 - 60 = 5 mm off a chord of 50 mm.
    text = changed(
        ("arm_deg = 30, hand_deg = 0", "foot_mm = [25, 60, -100]"),
        ("arm_deg = 90, hold_s = 5", 'foot_mm = [-25, 60, -100], path = "line", move_s = 0.4'),
    )
    assert "the path leaves the reachable space at" in error_of(text)
    job = plan_job(loads(text + "tolerance_mm = 5.01\n", "job.toml"))
    (note,) = job.notes
    assert note.code == "off-the-path"
    assert 4.9 < float(note.message.split()[-2]) < 5.01
    turned = job.trajectory.angles[99:120, 0] - math.pi / 2
    # Each frame goes the same way along the line: tan(alpha) = -x / 60.
    assert [60 * math.tan(angle) for angle in turned] == pytest.approx(
        [-25 + 2.5 * k for k in range(21)], abs=1e-4
    )


def test_poses_are_kept_with_their_names_and_no_two_have_the_same() -> None:
    low = ("{ arm_deg = 30,", '{ name = "low", arm_deg = 30,')
    poses = plan_job(loads(changed(low), "job.toml")).poses
    assert [pose.name for pose in poses] == ["low", None]
    assert [round(math.degrees(angle)) for angle in poses[1].angles] == [90, 0]
    both = changed(low, ("{ arm_deg = 90,", '{ name = "low", arm_deg = 90,'))
    assert "job.toml:18:7: error: motion.poses[2].name: two poses have the name 'low'" in error_of(both)


def test_a_walk_can_go_another_way_and_only_so_far() -> None:
    path = Path(__file__).parents[2] / "jobs" / "hexapod-tripod.toml"
    job = load(path)
    endless = plan_job(job, {"turn_deg": 8.0}).trajectory
    far = plan_job(job, {"turn_deg": 8.0, "cycles": 5.0}).trajectory
    assert endless.loop_start < len(endless.angles)
    assert (endless.angles == far.angles[: len(endless.angles)]).all()
    assert far.loop_start == len(far.angles) - 1, "it stands at its end"
    with pytest.raises(InputError, match=r"the job does not walk: .motion. moves its servos"):
        plan_job(load(path.with_name("lab8-exercise.toml")), {"turn_deg": 8.0})
    with pytest.raises(InputError, match=r"hexapod-tripod.toml:\d+:\d+: error: walk.route.1..turn_deg: "):
        plan_job(job, {"turn_deg": 361.0})


def test_a_job_is_loaded_without_planning_and_the_planner_names_the_line() -> None:
    """No angles of the leg reach the point, which only planning finds out."""
    text = foot(25, 60, -1000)
    job = loads(text, "job.toml")
    with pytest.raises(ServogenError) as caught:
        plan_job(job)
    place = caught.value.location
    assert place is not None
    assert (place.file, place.key) == ("job.toml", "motion.poses[1].foot_mm")
    assert "foot_mm" in text.splitlines()[(place.line or 0) - 1]


def test_which_frames_an_engine_refuses_is_asked_of_its_line_in_the_registry(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(servos: object, frame: object, clock: object) -> None:
        raise InputError("frame-too-short", "this engine plays no frames at all")

    stubborn = {**ENGINES, "player": replace(ENGINES["player"], check_frame=refuse)}
    monkeypatch.setattr("servogen.job.reader.ENGINES", stubborn)
    for engine in ("sequence", "auto"):
        loads(JOB + f'[firmware]\nengine = "{engine}"\n', "job.toml")
    with pytest.raises(InputError, match="plays no frames at all"):
        loads(JOB + '[firmware]\nengine = "player"\n', "job.toml")
