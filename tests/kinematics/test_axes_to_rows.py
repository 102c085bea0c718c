"""DH rows from joint axes: whatever the axes, the arm of the rows is the arm of the axes."""

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk, row_axes
from servogen.kinematics.orientation import from_axis_angle
from servogen.kinematics.transforms import rotation, transform, translation
from servogen.kinematics.urdf import JointAxis, arm_of_axes
from servogen.robot.model import Arm, Joint


def product_of_screws(axes: list[JointAxis], kinds: list[str], tool: np.ndarray, q: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    for axis, kind, value in zip(axes, kinds, q, strict=True):
        unit = np.array(axis.direction) / np.linalg.norm(axis.direction)
        if kind == "turning":
            back, there = translation(*(-np.array(axis.point))), translation(*axis.point)
            pose = pose @ there @ transform(from_axis_angle(unit, value), np.zeros(3)) @ back
        else:
            pose = pose @ translation(*(value * unit))
    return pose @ tool


def made(axes: list[JointAxis], kinds: list[str], tool: np.ndarray) -> Arm:
    joints = [Joint(f"j{index}", kind, -3.0, 3.0, 0.0) for index, kind in enumerate(kinds)]
    return arm_of_axes("made", joints, axes, tool)


def check(directions: list, points: list, kinds: list[str]) -> Arm:
    axes = [
        JointAxis(tuple(map(float, point)), tuple(map(float, direction)), index)
        for index, (point, direction) in enumerate(zip(points, directions, strict=True))
    ]
    tool = transform(from_axis_angle([0.3, -0.8, 0.5], 1.1), [0.4, -0.1, 0.7])
    robot = made(axes, kinds, tool)
    random = np.random.default_rng(9)
    for q in random.uniform(-2, 2, (10, len(axes))):
        np.testing.assert_allclose(fk(robot, q), product_of_screws(axes, kinds, tool, q), atol=1e-12)
    return robot


X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
CASES = {
    "skew": ([(1, 2, 3), (-1, 0.5, 2), (0.3, 1, -0.2)], [(0, 0, 1), (1, 0, 0), (0.2, 0.7, 0.1)]),
    "meeting": ([Z, Y, X], [(0, 0, 0), (0, 0, 1), (0, 0, 1)]),
    "parallel": ([Y, Y, Y], [(0, 0, 0), (1, 5, 0), (2, -3, 1)]),
    "against": ([Z, (0, 0, -1), Z], [(0, 0, 0), (1, 0, 2), (1, 1, 0)]),
    "collinear": ([Z, Z, X], [(0, 0, 0), (0, 0, 3), (0, 0, 1)]),
    "the base's own axis": ([Z, X, Z], [(0, 0, 5), (0, 0, 1), (2, 2, 2)]),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("kinds", [["turning"] * 3, ["turning", "sliding", "turning"], ["sliding"] * 3])
def test_axes_of_every_kind_of_place(case: str, kinds: list[str]) -> None:
    directions, points = CASES[case]
    check(directions, points, kinds)


def test_random_axes() -> None:
    random = np.random.default_rng(10)
    for _ in range(20):
        kinds = [("turning", "sliding")[int(each)] for each in random.integers(0, 2, 6)]
        check(list(random.normal(size=(6, 3))), list(random.normal(size=(6, 3))), kinds)


def test_parallel_axes_take_the_normal_through_the_previous_origin() -> None:
    robot = check([Z, Z, Z], [(0, 0, 0), (1, 0, 7), (2, 0, 9)], ["turning"] * 3)
    assert [row.d.constant for row in robot.rows[:2]] == [0.0, 0.0]
    assert [row.a.constant for row in robot.rows[:2]] == pytest.approx([1.0, 1.0])


def test_the_rows_of_a_catalogue_arm_come_back_from_its_axes(any_arm, configurations) -> None:
    zero = np.zeros(len(any_arm.joints))
    found, tool = row_axes(any_arm, zero)
    axes = [
        JointAxis(tuple(each.point), tuple(each.direction), each.row.joint, each.row.ratio) for each in found
    ]
    again = arm_of_axes(any_arm.name, any_arm.joints, axes, tool)
    q = configurations(any_arm, 100)
    np.testing.assert_allclose(fk(again, q), fk(any_arm, q), atol=1e-12)


def test_the_irb_6400c_has_its_printed_lengths_and_twists() -> None:
    robot = arm("irb6400c")
    found, tool = row_axes(robot, np.zeros(6))
    axes = [JointAxis(tuple(each.point), tuple(each.direction), each.row.joint) for each in found]
    again = arm_of_axes("again", robot.joints, axes, tool)
    for row, printed in zip(again.rows, robot.rows, strict=True):
        assert abs(row.a.constant) == pytest.approx(abs(printed.a.value(robot.length)))
        assert abs(row.d.constant) == pytest.approx(abs(printed.d.value(robot.length)))
        assert abs(row.alpha) == pytest.approx(abs(printed.alpha))


def test_axes_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match="no direction"):
        made([JointAxis((0, 0, 0), (0, 0, 0), 0)], ["turning"], np.eye(4))
    with pytest.raises(InputError, match="no joints that move"):
        made([], [], rotation("x", 0.0))
