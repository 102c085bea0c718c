"""Arms of six turning joints: all solutions where three axes meet, and those of many starts elsewhere."""

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from servogen.kinematics import queries
from servogen.kinematics.forward import fk
from servogen.kinematics.inverse.checked_forms import has_closed_form
from servogen.kinematics.inverse.solve import ik, ik_all
from servogen.robot.model import FixedFrame, Length
from tests.kinematics.random_arms import KINDS, RIGHT, apart, arm_of, compare, drawn, newton, poses_of

ALL_AROUND = np.full(6, pi)
PUMA = [
    [0.0, 0.0, 0.0, -RIGHT], [0.0, 0.15, 0.432, 0.0], [0.0, 0.0, 0.02, RIGHT], [0.0, 0.433, 0.0, -RIGHT],
    [0.0, 0.0, 0.0, RIGHT], [0.0, 0.056, 0.0, 0.0],
]  # fmt: skip

OWN = """
name = "own"
kind = "arm"
convention = "standard"
orientation = ["rpy"]
{joints}
[[row]]
joint = "q1"
d_mm = 90
alpha_deg = 90

[[row]]
joint = "q2"
a_mm = 110

[[row]]
joint = "q3"
a_mm = 12
alpha_deg = 90

[[row]]
joint = "q4"
d_mm = 105
alpha_deg = -90

[[row]]
joint = "q5"
alpha_deg = 90

[[row]]
joint = "q6"
d_mm = 60
"""


@pytest.mark.parametrize("kind", ["puma-like", "last three meet", "first three meet"])
def test_every_solution_that_newton_finds_is_listed(kind: str) -> None:
    random = np.random.default_rng(31)
    count = compare(drawn(kind, random), ALL_AROUND, targets=2, starts=80, poses=200, random=random)
    assert count.listed == count.found > 4
    assert count.refused == 0


def test_the_eight_solutions_of_a_puma_are_the_poses_that_paul_s_matrices_give() -> None:
    q = np.array([0.4, -0.7, 2.1, 0.5, 0.8, -1.0])
    target = poses_of(PUMA, q[None])[0][0]
    found = ik_all(arm_of(PUMA, ALL_AROUND), target[:3, 3], target[:3, :3])
    assert len(found) == 8
    assert np.abs(poses_of(PUMA, found)[0] - target).max() < 1e-9
    assert apart(q, found).min() < 1e-9


@pytest.mark.parametrize(
    "q",
    [
        pytest.param([0.3, 0.5, -0.4, 0.6, 0.0, -0.2], id="stretched wrist"),
        pytest.param([0.3, 0.5, np.arctan2(0.433, 0.02) - pi, 0.6, 0.9, -0.2], id="stretched elbow"),
        pytest.param([0.0] * 6, id="all at 0"),
    ],
)
def test_a_singular_pose_is_reached(q: list[float]) -> None:
    robot = arm_of(PUMA, ALL_AROUND)
    target = fk(robot, q)
    for found in ik_all(robot, target[:3, 3], target[:3, :3]):
        assert np.abs(fk(robot, found) - target).max() < 1e-9


def test_an_arm_is_recognised_by_its_axes_with_base_tool_and_joints_that_count_backwards() -> None:
    robot = arm_of(PUMA, np.linspace(2.0, 3.0, 6))
    robot = replace(
        robot,
        base=FixedFrame(0.1, -0.2, 0.3, 0.4, 0.5, 0.6),
        tool=FixedFrame(0.05, 0.02, 0.1, 0.2, 0.9, -0.3),
        rows=tuple(replace(row, ratio=-1.0 if index % 2 else 1.0) for index, row in enumerate(robot.rows)),
    )
    assert has_closed_form(robot, oriented=True)
    q = np.random.default_rng(2).uniform(-1.5, 1.5, (50, 6))
    for own, target in zip(q, fk(robot, q), strict=True):
        found = ik_all(robot, target[:3, 3], target[:3, :3])
        assert apart(own, found).min() < 1e-8
        assert (np.abs(found) <= np.linspace(2.0, 3.0, 6) + 1e-12).all()


def test_axes_that_miss_each_other_by_a_micrometre_do_not_meet() -> None:
    """Nor does a sliding joint turn, and a wrist's axes that are parallel bring no orientation."""
    robot = arm_of(PUMA, ALL_AROUND)
    fifth = replace(robot.rows[4], d=Length(constant=1e-6))
    slide = replace(robot.joints[1], kind="sliding", lower=0.0, upper=0.3)
    others = {
        "missed": replace(robot, rows=(*robot.rows[:4], fifth, robot.rows[5])),
        "sliding": replace(robot, joints=(robot.joints[0], slide, *robot.joints[2:])),
        "geared": replace(robot, rows=(*robot.rows[:5], replace(robot.rows[5], ratio=2.0))),
        "straight wrist": replace(
            robot, rows=(*robot.rows[:4], replace(robot.rows[4], alpha=0.0), robot.rows[5])
        ),
    }
    assert has_closed_form(robot, oriented=True)
    assert not has_closed_form(robot, oriented=False)
    assert not any(has_closed_form(other, oriented=True) for other in others.values())


def test_the_list_of_an_own_arm_with_such_a_wrist_is_complete(tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    joints = "".join(f'[[joint]]\nname = "q{number}"\n' for number in range(1, 7))
    file.write_text(OWN.format(joints=joints))
    answer = queries.ik_answer(str(file), (120, 40, 150, 30, 80, 10), everything=True)
    assert answer["complete"]
    assert answer["found"] == len(answer["solutions"]) >= 8
    file.write_text(OWN.format(joints=joints).replace("d_mm = 105", "d_mm = 105\na_mm = 5"))
    assert not queries.ik_answer(str(file), (120, 40, 150, 30, 80, 10))["complete"]


def test_no_solution_of_an_arm_without_such_axes_is_missed_and_no_pose_within_narrow_limits_refused() -> None:
    random = np.random.default_rng(4)
    rows = KINDS["generic"](random)
    q = np.array([0.5, -1.0, 1.2, 0.8, -1.5, 0.3])
    target = poses_of(rows, q[None])[0][0]
    known = newton(rows, target, random.uniform(-pi, pi, (60, 6)))
    found = ik_all(arm_of(rows, ALL_AROUND), target[:3, 3], target[:3, :3])
    assert len(known) > 2
    assert all(apart(one, found).min() < 1e-5 for one in known)
    narrow = arm_of(rows, np.full(6, 1.75))
    assert np.abs(fk(narrow, ik(narrow, target[:3, 3], target[:3, :3])) - target).max() < 1e-6
