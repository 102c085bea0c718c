"""Lines and arcs of a job's tool: on one branch of the inverse kinematics, the orientation the short way."""

import math
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import ServogenError
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.queries import ik_answer
from servogen.motion import follow, moves

FILES = Path(__file__).with_name("paths")


def made(text: str) -> PlannedJob:
    return plan_job(loads(text, str(FILES / "job.toml")))


def error_of(text: str) -> str:
    with pytest.raises(ServogenError) as caught:
        made(text)
    return str(caught.value)


def read(name: str, *replacements: tuple[str, str]) -> str:
    text = (FILES / name).read_text("utf-8")
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    return text


def quaternion(order: list[float]) -> np.ndarray:
    """The quaternion of Rot(z, φ) Rot(y, θ) Rot(x, η), degrees: the product of the three, w x y z."""
    (a, b, c), (d, e, f) = np.cos(np.radians(order) / 2), np.sin(np.radians(order) / 2)
    return np.array(
        [
            a * b * c + d * e * f,
            a * b * f - d * e * c,
            a * e * c + d * b * f,
            d * b * c - a * e * f,
        ]
    )


def matrix(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def angles_between(rotations: np.ndarray) -> np.ndarray:
    """How far each rotation is turned from the one before it, degrees."""
    steps = np.swapaxes(rotations[:-1], 1, 2) @ rotations[1:]
    # 4 sin²(angle / 2) is half the square of the distance from no turn
    away = np.linalg.norm(steps - np.eye(3), axis=(1, 2)) / math.sqrt(8)
    return np.degrees(2 * np.arcsin(np.minimum(away, 1.0)))


def poses_of(job: PlannedJob) -> np.ndarray:
    return fk(arm("irb6400c"), job.trajectory.angles[:200] - math.pi)


def test_the_orientation_goes_the_short_way_along_a_line() -> None:
    job = plan_job(load(FILES / "ir.toml"))
    poses = poses_of(job)
    first, last = quaternion([0, 40, 170]), quaternion([0, 40, -170])
    # From η = 170° to -170° by 20° about the tool's own x axis; the other way round it would be 340°.
    whole = 2 * math.degrees(math.acos(abs(float(first @ last))))
    assert whole == pytest.approx(20)
    assert angles_between(poses[:, :3, :3]).sum() == pytest.approx(whole * 199 / 200, abs=1e-3)
    last = last if first @ last > 0 else -last
    half = math.radians(whole / 2)
    for frame in range(200):
        share = (frame + 1) / 200
        between = (math.sin((1 - share) * half) * first + math.sin(share * half) * last) / math.sin(half)
        np.testing.assert_allclose(poses[frame, :3, :3], matrix(between), atol=1e-7)
        assert poses[frame, :3, 3] == pytest.approx([1, 0.5 + 0.1 * share, 0.8], abs=1e-7)


def test_a_first_pose_takes_the_nearest_solution_from_which_its_lines_can_be_followed() -> None:
    # In the solution nearest to the servos' middles q6 comes to its end on the way.
    job = plan_job(load(FILES / "ir.toml"))
    servos = np.degrees(job.trajectory.angles[:200])
    assert np.abs(np.diff(servos, axis=0)).max() < 0.2
    (note,) = (each for each in job.notes if each.code == "off-the-path")
    assert note.message == "the path to pose 2 is followed within 0.000 mm"
    assert not job.warnings


def test_a_line_that_would_change_the_branch_is_refused_with_its_place_and_both_branches() -> None:
    # The elbow goes to 60° and no further: there the tool is √(400² + 300² + 2 · 400 · 300 cos 60°) mm from
    # the axis. The line goes from the pose s1 = -20°, s2 = 50° to (300, 100).
    first, both = math.radians(-20), math.radians(30)
    start = np.array(
        [400 * math.cos(first) + 300 * math.cos(both), 400 * math.sin(first) + 300 * math.sin(both)]
    )
    way = np.array([300, 100]) - start
    a, b, c = way @ way, 2 * start @ way, start @ start - (400**2 + 300**2 + 400 * 300)
    share = (-b - math.sqrt(b * b - 4 * a * c)) / (2 * a)
    x, y = start + share * way
    z = 400 - share * 50
    said = error_of(read("sc-job.toml"))
    place = f"({x:.3f}, {y:.3f}, {z:.3f}) mm"
    assert "motion.poses[2].path: the path would change the branch of the inverse kinematics at " in said
    assert f"{place}: from s1 " in said
    assert "s2 240.0°, " in said.split(" to ")[0]
    assert "s2 120.0°, " in said.split(" to ")[1]
    assert said.endswith('\n  path = "joint" goes to this pose, but not along the path')


def test_the_hint_of_a_refused_line_is_true() -> None:
    job = made(read("sc-job.toml", ('path = "line", ', 'path = "joint", ')))
    assert np.degrees(job.trajectory.angles[-1])[1] < 180


def test_the_same_line_without_a_time_is_refused_as_well() -> None:
    text = read("sc-job.toml", (", move_s = 2", ""), ('law = "linear"', 'law = "cubic"'))
    assert "would change the branch" in error_of(text)


def test_an_arc_that_would_change_the_branch_is_refused() -> None:
    text = read("sc-job.toml", ('path = "line"', 'path = "arc", through_mm = [500, 50, 370]'))
    assert "poses[2].path: the path would change the branch of the inverse kinematics at (" in error_of(text)


def test_a_line_that_closes_a_loop_on_another_branch_is_refused_at_its_end() -> None:
    # Out with the elbow bent to one side, back on a line to a pose that has it on the other side.
    text = read(
        "sc-job.toml",
        ('name = "sc.toml"', 'name = "scara"'),
        ('repeat = false\nend = "hold"\n', "repeat = true\n"),
        (
            "{ s1_deg = 160, s2_deg = 230, s3_deg = 50, s4_deg = 180 },",
            '{ tip_mm = [500, 0, 400], path = "line", move_s = 1 }, '
            "{ s1_deg = 160, s2_deg = 240, s3_deg = 50, s4_deg = 180, move_s = 1 },",
        ),
        ("{ tip_mm = [300, 100, 350], path", "{ tip_mm = [500, 100, 400], path"),
    )
    said = error_of(text)
    assert "motion.poses[1].path: the path would change the branch" in said
    assert "at its end, (500.000, 0.000, 400.000) mm" in said


def test_the_pose_at_the_end_of_a_line_keeps_the_elbow_that_the_line_has() -> None:
    """The line takes q1 from 60° to -30° with the elbow at 30° at both ends. With the elbow at -30° the last
    point would be nearer: q1 would go to -30° + 2 atan2(300 sin 30°, 400 + 300 cos 30°) = -4.4°.
    """
    tip = 400 * np.exp(1j * math.radians(-30)) + 300
    job = made(
        read(
            "sc-job.toml",
            ('name = "sc.toml"', 'name = "scara"'),
            ("s1_deg = 160, s2_deg = 230", "s1_deg = 240, s2_deg = 210"),
            (
                "{ tip_mm = [300, 100, 350],",
                f"{{ tip_mm = [{tip.real:.9f}, {tip.imag:.9f}, 350],",
            ),
            ("move_s = 2 },\n", "move_s = 2 },\n{ s3_deg = 60, move_s = 0.1 },\n"),
        )
    )
    angles = np.degrees(job.trajectory.angles)
    assert angles[99] == pytest.approx([150, 210, 100, 180], abs=1e-6)
    assert angles[-1] == pytest.approx([150, 210, 60, 180], abs=1e-6)
    assert (angles[:, 1] > 209.9).all()


def test_a_point_that_is_reached_in_too_many_ways_is_refused_at_its_key(tmp_path: Path) -> None:
    """Two elbows, and 150 turns of each of two joints: 45,000 ways."""
    (tmp_path / "turns.toml").write_text(
        'name = "turns"\nlike = "theta1-theta2"\n'
        + "".join(f'[[joint]]\nname = "q{n}"\nlower_deg = 0\nupper_deg = 54_000\n' for n in (1, 2))
    )
    (tmp_path / "far.toml").write_text(read("big.toml", ("angle_deg = 360", "angle_deg = 54_000")))
    servos = "".join(
        f'[[servo]]\nname = "s{n}"\npin = "RB{n}"\nmodel = "far.toml"\njoint = "q{n}"\nzero_deg = 0\n'
        for n in (1, 2)
    )
    with pytest.raises(ServogenError) as caught:
        plan_job(
            loads(
                f'[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n[robot]\nname = "turns.toml"\n{servos}'
                "[motion]\nposes = [\n    { tip_mm = [300, 100, 0] },\n]\n",
                str(tmp_path / "job.toml"),
            )
        )
    assert str(caught.value).replace(f"{tmp_path}/", "") == (
        "job.toml:20:7: error: motion.poses[1].tip_mm: turns reaches this target in more than 10000 ways: "
        "its joints have so many turns of travel [out-of-reach]\n  narrow the limits of its joints"
    )


def test_a_path_too_steep_for_the_joints_limits_is_given_up_with_a_true_hint(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # It passes the first axis at a hundredth of a millimetre: there q1 turns by half a turn, nearly at once.
    monkeypatch.setattr(moves, "MAX_PATH_FRAMES", 2048)
    servos = "".join(
        f'[[servo]]\nname = "s{n}"\npin = "RB{n}"\nmodel = "big.toml"\njoint = "q{n}"\nzero_deg = 180\n'
        for n in (1, 2, 3)
    )
    head = '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n[robot]\nname = "anthropomorphic"\n'
    move = '{ tip_mm = [-200, 0.01, 100], path = "line"'
    text = (
        f'{head}{servos}[motion]\nlaw = "cubic"\nrepeat = false\nend = "hold"\n'
        f"poses = [{{ tip_mm = [200, 0.01, 100] }}, {move} }}]\n"
    )
    assert (
        "the path to pose 2 cannot be followed within the joints' limits: not even in 2048 frames, "
        "40.96 s [path-too-fast]\n"
        "  state its time, move_s" in error_of(text)
    )
    made(text.replace(move, f"{move}, move_s = 2"))


def test_a_path_in_too_few_frames_is_warned_of_with_a_time_that_is_enough() -> None:
    text = read("ir.toml", ("move_s = 4", "move_s = 0.04"), ("[1000, 600,", "[1000, 1200,"))
    (warning,) = (each for each in made(text).warnings if each.code == "off-the-path")
    told = warning.message.split("; move_s = ")
    assert float(told[0].split()[-2]) > 1
    seconds, _, millimetres = told[1].partition(" keeps it within ")
    job = made(text.replace("move_s = 0.04", f"move_s = {seconds}"))
    assert f"is followed within {millimetres}" in job.notes[0].message
    assert float(millimetres.removesuffix(" mm")) <= 1


TURNS = """
name = "turns"
like = "irb6400c"
[[joint]]
name = "q6"
lower_deg = -180
upper_deg = 540
"""


@pytest.mark.parametrize(("before", "low", "high"), [(670, 640, 675), (310, 280, 315)])
def test_a_joint_with_more_turns_takes_the_one_nearest_to_the_pose_before(
    tmp_path: Path, before: int, low: int, high: int
) -> None:
    (tmp_path / "turns.toml").write_text(TURNS)
    (tmp_path / "big.toml").write_text(read("big.toml", ("= 360,", "= 720,")), "utf-8")
    # Near one of the eight solutions, in which s6 is at 315° or, a turn further, at 675°
    near = f"{{ s1_deg = 78, s2_deg = 231, s3_deg = 190, s4_deg = 342, s5_deg = 48, s6_deg = {before} }}"
    text = read(
        "ir.toml",
        ('"irb6400c"', '"turns.toml"'),
        ("{ tip_mm = [1000, 500, 800], ", near + ", { tip_mm = [1000, 500, 800], move_s = 1, "),
    )
    angles = np.degrees(plan_job(loads(text, str(tmp_path / "job.toml"))).trajectory.angles)
    assert np.abs(np.diff(angles[:, 5])).max() < 1
    assert low < angles[-1, 5] < high


def test_lines_are_traced_with_few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(follow, "MAX_SAMPLES", 3000)
    plan_job(load(FILES / "ir.toml"))
    assert "would change the branch" in error_of(read("sc-job.toml"))


def test_an_arm_draws_a_whole_circle_back_to_its_start() -> None:
    """Every frame of the tool is 30 mm from the centre, on both sides of it."""
    text = """[chip]
device = "PIC16F84A"
clock_hz = 4_000_000
[robot]
name = "anthropomorphic"
SERVOS[motion]
repeat = false
poses = [
    { tip_mm = [230, 0, 150], hold_s = 0.1 },
    { tip_mm = [230, 0, 150], path = "arc", through_mm = [170, 0, 150], move_s = 2 },
]
"""
    servo = (
        '[[servo]]\nname = "s{0}"\npin = "RB{0}"\nmodel = "futaba-s3001"\njoint = "q{0}"\nzero_deg = {1}\n'
    )
    servos = "".join(servo.format(number, zero) for number, zero in ((1, 180), (2, 0), (3, 180)))
    job = plan_job(loads(text.replace("SERVOS", servos), "circle.toml"))
    assert job.tip is not None
    away = job.tip.where(job.trajectory.angles) - [0.2, 0, 0.15]
    assert np.linalg.norm(away[:, :2], axis=1) == pytest.approx(0.03, abs=1e-6)
    assert (away[:, 1].min(), away[:, 1].max()) == pytest.approx((-0.03, 0.03), abs=1e-4)


@pytest.mark.parametrize(("off_mm", "reached"), [(0.008, True), (0.0004, True), (0.012, False)])
def test_a_typed_position_may_be_as_far_from_a_surface_in_a_job_as_in_ik(
    off_mm: float, reached: bool
) -> None:
    """Two joints reach a plane only: a hundredth of a millimetre is what people leave out."""
    text = """[chip]
device = "PIC16F84A"
clock_hz = 4_000_000
[robot]
name = "theta1-theta2"
[[servo]]
name = "a"
pin = "RB0"
model = "futaba-s3001"
joint = "q1"
[[servo]]
name = "b"
pin = "RB1"
model = "futaba-s3001"
joint = "q2"
[motion]
poses = [{ tip_mm = [300, 200, Z], hold_s = 1 }]
"""
    for ask in (
        lambda: made(text.replace("Z", str(off_mm))),
        lambda: ik_answer("theta1-theta2", (300, 200, off_mm)),
    ):
        if reached:
            ask()
        else:
            with pytest.raises(
                ServogenError, match=r"the nearest reachable point is \(300.000, 200.000, 0.000\)"
            ):
                ask()


def test_the_target_itself_is_never_named_as_the_nearest_point() -> None:
    """0.0002 mm are not seen in three decimals."""
    off = Unreachable((0.3, 0.2, 2e-7), "it lies beside the plane", (0.3, 0.2, 0.0))
    assert str(off).endswith("the nearest reachable point is 0.0002 mm away")
