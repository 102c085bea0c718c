"""Jobs of robots: tools and feet by position, straight lines, walks."""

import math
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError, ServogenError
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.pulse import plan

FILES = Path(__file__).parents[2] / "jobs"
SCARA = (FILES / "scara-pick.toml").read_text()
HEXAPOD = Path(__file__).with_name("hexapod.toml").read_text()


def changed(text: str, *replacements: tuple[str, str]) -> str:
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def error_of(text: str) -> str:
    with pytest.raises(ServogenError) as caught:
        plan_job(loads(text, "job.toml"))
    return str(caught.value)


def tool(job: PlannedJob) -> np.ndarray:
    """The SCARA's tool from the servos' angles: the specification's closed form, millimetres and radians."""
    shoulder, elbow, lift, wrist = job.trajectory.angles.T
    q1, q2 = (shoulder - math.pi / 2) / 0.75, (elbow - math.pi / 2) / 0.67
    q3, q4 = np.degrees(lift) / 0.9, (wrist - math.pi / 2) / 0.5
    x = 400 * np.cos(q1) + 300 * np.cos(q1 + q2)
    y = 400 * np.sin(q1) + 300 * np.sin(q1 + q2)
    return np.stack([x, y, 450 - q3, q1 + q2 - q4], axis=1)


def test_the_tool_goes_where_the_poses_say() -> None:
    found = tool(plan_job(load(FILES / "scara-pick.toml")))
    for x, y, z, turn in ((500, 200, 300, 0), (500, 200, 450, 0), (50, 606, 450, 60), (50, 606, 300, 60)):
        assert np.abs(found - [x, y, z, math.radians(turn)]).max(axis=1).min() < 1e-6


def test_the_tool_goes_straight_and_turns_evenly_on_the_way() -> None:
    found = tool(plan_job(load(FILES / "scara-pick.toml")))
    start, end = np.array([500.0, 200, 450]), np.array([50.0, 606, 450])
    arrived = int(np.argmin(np.linalg.norm(found[:, :3] - end, axis=1)))
    crossing = (found[:, 2] > 449.999) & (found[:, 0] > 51) & (found[:, 0] < 499)
    crossing[arrived:] = False
    share = (found[crossing, 0] - start[0]) / (end - start)[0]
    assert crossing.sum() > 50
    assert found[crossing, :3] == pytest.approx(start + share[:, None] * (end - start), abs=1e-6)
    assert found[crossing, 3] == pytest.approx(np.radians(60) * share, abs=1e-6)


def test_no_servo_and_no_joint_is_faster_than_it_can_be() -> None:
    job = plan_job(load(FILES / "scara-pick.toml"))
    speeds = (
        np.abs(np.diff(job.trajectory.angles, axis=0, append=job.trajectory.angles[:1])).max(axis=0) / 0.02
    )
    s3001, tiny = 1.8, math.radians(750)
    joints = [
        math.radians(112.5) * 0.75,
        math.radians(114.5) * 0.67,
        math.radians(200 * 0.9),
        math.radians(112.5),
    ]
    assert (speeds <= np.minimum(joints, [s3001, s3001, tiny, tiny]) * (1 + 1e-9)).all()
    assert plan(job.trajectory, job.servos, job.frame).warnings == ()


def test_the_chord_error_of_each_path_is_noted() -> None:
    notes = plan_job(load(FILES / "scara-pick.toml")).notes
    assert [note.code for note in notes] == ["off-the-path"] * 5
    assert [note.message.split()[:5] for note in notes] == [
        f"the path to pose {n}".split() for n in range(2, 7)
    ]


DOWN = '{ tip_mm = [500, 200, 300], path = "line", hold_s = 0.5 }'
UP = '{ tip_mm = [500, 200, 450], path = "line" }'


def test_an_arc_goes_through_its_point() -> None:
    bow = '{ tip_mm = [300, 400, 450], path = "arc", through_mm = [450, 350, 450] }'
    found = tool(plan_job(loads(changed(SCARA, (DOWN, bow), (f"{UP},\n", "")), "job.toml")))[:, :3]
    assert np.linalg.norm(found - [300, 400, 450], axis=1).min() < 1e-6
    near = np.argsort(np.linalg.norm(found - [450, 350, 450], axis=1))[:2]
    one, other = found[near]
    # The point lies between two frames, as far from the chord as an arc of that length bends.
    assert np.linalg.norm(np.cross(other - one, one - [450, 350, 450])) / np.linalg.norm(other - one) < 1


def test_via_points_are_passed() -> None:
    text = changed(
        SCARA, (DOWN, "{ tip_mm = [500, 200, 400], via = true }"), (UP, "{ tip_mm = [450, 250, 450] }")
    )
    found = tool(plan_job(loads(text, "job.toml")))[:, :3]
    passing = int(np.argmin(np.linalg.norm(found - [500, 200, 400], axis=1)))
    assert np.linalg.norm(found[passing] - [500, 200, 400]) < 3
    assert np.linalg.norm(found[passing + 1] - found[passing]) > 0.5


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('name = "scara"', 'name = "scarra"',
            "9:1: error: robot.name: unknown robot 'scarra' [unknown-robot]\n  did you mean 'scara'?"),
        ('name = "scara"', 'name = "x.toml"', "there is no robot file 'x.toml'"),
        ('joint = "q1"', 'joint = "q9"', "15:1: error: servo[1].joint: the robot has no joint 'q9'"),
        ('joint = "q1"', 'joint = "q2"', "servo[2].joint: two servos turn the joint 'q2'"),
        ('joint = "q1"\n', "", "a position needs an arm"),
        ("deg_per_mm = 0.9", "ratio = 0.9",
            "servo[3].joint: the joint 'q3' slides [wrong-unit]\n  give the servo's deg_per_mm"),
        ("ratio = 0.75", "deg_per_mm = 1",
            "servo[1].joint: the joint 'q1' turns [wrong-unit]\n  give the servo's ratio"),
        ("ratio = 0.75", "ratio = 0", "a joint with a ratio of 0 cannot move"),
        ("ratio = 0.75", "ratio = 3", "needs angles outside the servos' travel"),
        ("tip_mm = [500", "tip_mm = [900",
            "motion.poses[1].tip_mm: the point (900.000, 200.000, 450.000) mm"),
        ("tip_mm = [500, 200, 450], orientation_deg = [0]", "foot_mm = [500, 200, 450]",
            "the positions of this robot are given by tip_mm"),
        ("tip_mm = [500, 200, 450]", "shoulder_deg = 90", "an orientation needs a position"),
        ("orientation_deg = [0]", "orientation_deg = [0, 0]", "motion.poses[1].tip_mm: scara takes roll"),
        ("orientation_deg = [0]", "wrist_deg = 9", "wrist already follows from tip_mm"),
        ('path = "line", hold_s = 0.5', 'path = "arc"', "motion.poses[2].path: an arc needs a point"),
        ('path = "line", hold_s', "through_mm = [1, 2, 3], hold_s", "only an arc goes through a point"),
        ('path = "line", hold_s', 'path = "arc", through_mm = [500, 200, 400], hold_s',
            "through_mm: the three"),
        ('path = "line", hold_s', "via = true, hold_s", "poses[2].hold_s: a via pose has no hold"),
        ('law = "quintic"', 'law = "quintik"', 'motion.law: "quintik" is not allowed here'),
        ("[motion]", "[leg]\nab_mm=1\nbc_mm=1\ncd_mm=1\ndf_mm=1\nalpha='x'\nbeta='y'\n[motion]",
            "[leg] is itself a robot"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_an_arms_job_is_said(old: str, new: str, says: str) -> None:
    assert says in error_of(changed(SCARA, (old, new)))


def test_a_line_out_of_reach_between_its_ends_is_refused() -> None:
    # It passes the shoulder at 200 mm: the elbow would have to bend further than it can.
    text = changed(
        SCARA,
        ("tip_mm = [500, 200, 450], orient", "tip_mm = [200, -450, 450], orient"),
        ("tip_mm = [500, 200, 300], path", "tip_mm = [200, 450, 450], path"),
    )
    assert "the path leaves the reachable space at" in error_of(text)


def test_the_hexapod_walks_in_one_frame_of_twelve_pulses() -> None:
    job = plan_job(load(Path(__file__).with_name("hexapod.toml")))
    made = plan(job.trajectory, job.servos, job.frame)
    assert ([each.code for each in job.warnings], made.warnings) == (["full-height"], ())
    assert len(made.schedule.channels) == 12
    assert made.schedule.lead_in_frames == job.trajectory.loop_start
    # at first each foot steps on the spot, when it is its turn: one cycle
    assert made.schedule.loop_frames == made.schedule.lead_in_frames
    assert [note.code for note in job.notes] == [
        "cycle",
        "spring",
        "slip",
        "lost-motion",
        "lift",
        "stability",
    ]
    rises = [pulse.rise for pulse in made.schedule.loop[0].pulses if pulse]
    assert rises == [slot * 2000 for slot in range(6) for _ in range(2)]


def test_opposite_legs_do_the_same_half_a_cycle_later_with_mirrored_servos() -> None:
    job = plan_job(load(Path(__file__).with_name("hexapod.toml")))
    schedule = plan(job.trajectory, job.servos, job.frame).schedule
    widths = np.array(
        [[pulse.width for pulse in run.pulses if pulse] for run in schedule.loop for _ in range(run.frames)]
    )
    half = len(widths) // 2
    for left, right in ((0, 6), (2, 8), (4, 10)):
        # A mirrored servo's width is as far below the middle as the other's is above it.
        assert np.roll(widths[:, left], half) + widths[:, right] == pytest.approx(
            np.full(2 * half, 3000), abs=1
        )


def test_a_walk_may_turn_go_back_and_end() -> None:
    route = (
        "[{ forward_mm = 40, cycles = 2 }, { turn_deg = 20, cycles = 2 }, { forward_mm = -40, cycles = 2 }]"
    )
    text = changed(
        HEXAPOD, ("[{ forward_mm = 40 }]", route), ("[walk]", '[walk]\nrepeat = false\nend = "release"')
    )
    job = plan_job(loads(text, "job.toml"))
    assert job.trajectory.loop_start == len(job.trajectory.angles) - 1
    assert np.isnan(job.trajectory.angles[-1]).all()
    assert job.trajectory.angles[-2] == pytest.approx(job.trajectory.angles[0], abs=1e-9)


def test_one_leg_walks_on_two_servos() -> None:
    head, walk = HEXAPOD.split("[[servo]]", 1)[0], "[walk]" + HEXAPOD.split("[walk]", 1)[1]
    servos = "".join("[[servo]]" + part for part in HEXAPOD.split("[walk]")[0].split("[[servo]]")[1:3])
    job = plan_job(loads(head + servos + walk.replace("[walk]", '[walk]\nleg = "L1"'), "job.toml"))
    whole = plan_job(load(Path(__file__).with_name("hexapod.toml")))
    loop = job.trajectory.angles[job.trajectory.loop_start :]
    wanted = whole.trajectory.angles[whole.trajectory.loop_start :, :2]
    assert min(np.abs(np.roll(loop, shift, axis=0) - wanted).max() for shift in range(len(loop))) < 1e-6


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"tripod"', '"tripot"', "walk.gait: unknown gait 'tripot' [unknown-name]\n  did you mean 'tripod'?"),
        ("forward_mm = 40", "forward = 40", "'forward' has no unit: write forward_mm"),
        ("forward_mm = 40", "forward_mm = 400", "walk: L1_alpha would have to turn"),
        ("forward_mm = 40", "cycles = 0", "0 is out of range: more than 0"),
        ("lift_mm = 20", "lift_mm = 20\nspring_mm = 0.1", "the springs would have to yield 0.50 mm"),
        ("lift_mm = 20", "lift_mm = 20\ncycle_s = 0.06", "a cycle of 3 frames is too short"),
        (
            "lift_mm = 20",
            "lift_mm = 20\nbody_height_mm = 500",
            "the legs cannot stand 500 mm high and lift their feet by 20 mm [out-of-reach]\n  their feet are",
        ),
        ("lift_mm = 20", "lift_mm = 20\nrepeat = false",
            "a route whose last segment has no cycles never ends"),
        ("lift_mm = 20", 'lift_mm = 20\nend = "hold"', "a motion that repeats has no end"),
        ('joint = "L1_alpha"\n', "", "servo[1]: L1-turn turns no joint of the robot"),
        ('name = "hexapod"', 'name = "omni"', "no robot to which the joint could belong"),
        ("[walk]", "[motion]\nposes = [{ L1-turn_deg = 90, hold_s = 1 }]\n[walk]",
            "walk: a job has one of [motion], [walk]"),
        ("per_slot = 2", "per_slot = 1", "the pulses do not fit a frame: 12, 1 at a time"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_walk_is_said(old: str, new: str, says: str) -> None:
    assert says in error_of(changed(HEXAPOD, (old, new)))


def test_a_walk_needs_a_walking_robot() -> None:
    text = SCARA.split("[motion]")[0] + "[walk]\nroute = [{ forward_mm = 4 }]\n"
    assert "a walk needs a walking robot" in error_of(text)


def test_eighteen_servos_are_refused_with_what_would_drive_them() -> None:
    """A hexapod of three joints a leg is planned by `servogen gait`, but no chip has a pin for each servo."""
    head = '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n[robot]\nname = "hexapod-coxa-femur-tibia"\n'
    pins = [f"RB{bit}" for bit in range(8)] + [f"RA{bit}" for bit in range(4)]
    servos = "".join(
        f'[[servo]]\nname = "{leg}-{joint}"\npin = "{pins[(3 * row + column) % 12]}"\nmodel = "sg90"\n'
        f'joint = "{leg}_{joint}"\n'
        for row, leg in enumerate(("L1", "L2", "L3", "R1", "R2", "R3"))
        for column, joint in enumerate(("coxa", "femur", "tibia"))
    )
    with pytest.raises(
        InputError, match="18 servos, but the chip has 13 pins: two chips are needed"
    ) as caught:
        loads(head + servos + "[walk]\nroute = [{ forward_mm = 30 }]\n", "big.toml")
    assert "write [[chip]] twice" in (caught.value.hint or "")
