"""Forward kinematics: the table's closed forms, the worked numbers, the product of the rows."""

from dataclasses import replace
from math import cos, pi, radians, sin

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import BLOCK, fk, fk_position, link_frames, row_axes
from servogen.kinematics.leg import Leg
from servogen.kinematics.transforms import frame_matrix, is_rotation, rotation
from servogen.robot.model import FixedFrame


def test_every_arm_is_the_product_of_its_rows(any_arm, configurations, product_of_rows) -> None:
    q = configurations(any_arm, 300)
    product = product_of_rows(any_arm, q)
    np.testing.assert_allclose(fk(any_arm, q), product, atol=1e-14)
    np.testing.assert_allclose(fk_position(any_arm, q), product[:, :3, 3], atol=1e-14)
    np.testing.assert_allclose(row_axes(any_arm, q)[1], product, atol=1e-14)
    assert is_rotation(fk(any_arm, q)[:, :3, :3], 1e-13)


def test_base_and_tool_stand_before_and_behind_the_rows(any_arm, configurations, product_of_rows) -> None:
    base, tool = FixedFrame(0.1, -0.2, 0.3, 0.4, -0.5, 0.6), FixedFrame(0.01, 0.02, 0.03, -0.4, 0.3, 0.2)
    moved = replace(any_arm, base=base, tool=tool)
    q = configurations(any_arm, 20)
    np.testing.assert_allclose(fk(moved, q), product_of_rows(moved, q), atol=1e-14)
    frames = link_frames(moved, q)
    np.testing.assert_allclose(frames[:, 0], np.broadcast_to(frame_matrix(base), (20, 4, 4)))
    np.testing.assert_allclose(frames[:, -1], fk(moved, q), atol=1e-14)
    np.testing.assert_allclose(frames[:, -2] @ frame_matrix(tool), fk(moved, q), atol=1e-14)


def test_poses_of_any_shape_and_of_more_than_one_block(configurations) -> None:
    robot = arm("rv-m1")
    q = configurations(robot, BLOCK + 3)
    many = fk(robot, q)
    assert many.shape == (BLOCK + 3, 4, 4)
    np.testing.assert_array_equal(many[BLOCK:], fk(robot, q[BLOCK:]))
    assert fk(robot, q[:6].reshape(2, 3, 5)).shape == (2, 3, 4, 4)
    np.testing.assert_allclose(fk(robot, q[0]), many[0], atol=1e-15)
    assert fk(robot, q[:0]).shape == (0, 4, 4)


LENGTHS = {name: arm(name).length for name in ("theta-r", "theta1-theta2", "cylindrical", "scara")}


# name, joint positions (a, b, c, … in radians and metres), the position of the table
TABLE = {
    "theta-r": lambda q,
    k: (q[1] * sin(q[0]), -q[1] * cos(q[0]), k["d1"]),
    "theta1-theta2": lambda q,
    k: (k["l1"] * cos(q[0]) + k["l2"] * cos(q[0] + q[1]), k["l1"] * sin(q[0]) + k["l2"] * sin(q[0] + q[1]),
        0.0),
    "cylindrical": lambda q,
    k: (cos(q[0]) * (q[2] + k["l4"]), sin(q[0]) * (q[2] + k["l4"]), q[1] + k["l1"]),
    "scara": lambda q,
    k: (k["l1"] * cos(q[0]) + k["l2"] * cos(q[0] + q[1]), k["l1"] * sin(q[0]) + k["l2"] * sin(q[0] + q[1]),
        k["l0"] - k["l3"] - q[2] - k["l4"]),
    "wrist-arm": lambda q,
    k: ((k["l2"] + k["l3"]) * cos(q[0]) * cos(q[1]), (k["l2"] + k["l3"]) * sin(q[0]) * cos(q[1]), (k[
        "l2"] + k["l3"]) * sin(q[1]) + k["l1"]),
    "anthropomorphic": lambda q,
    k: (-(k["l2"] * cos(q[1]) + k["l3"] * cos(q[1] + q[2])) * sin(q[0]), (k["l2"] * cos(q[1]) + k[
        "l3"] * cos(q[1] + q[2])) * cos(q[0]), k["l2"] * sin(q[1]) + k["l3"] * sin(q[1] + q[2])),
    "rv-m1": lambda q,
    k: (cos(q[0]) * (k["a2"] * cos(q[1]) + k["a3"] * cos(q[1] + q[2]) + k["d5"] * sin(q[1] + q[2] + q[3])),
        sin(q[0]) * (k["a2"] * cos(q[1]) + k["a3"] * cos(q[1] + q[2]) + k["d5"] * sin(q[1] + q[2] + q[3])),
        k["d1"] + k["a2"] * sin(q[1]) + k["a3"] * sin(q[1] + q[2]) - k["d5"] * cos(q[1] + q[2] + q[3])),
    "cartesian": lambda q, _: (q[2], q[1], q[0]), "cylindrical-r2p": lambda q,
    _: (q[2] * cos(q[0]), q[2] * sin(q[0]), q[1]),
    "spherical": lambda q,
    _: (q[2] * cos(q[0]) * sin(q[1]), q[2] * sin(q[0]) * sin(q[1]), q[2] * cos(q[1])),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLE)
def test_the_positions_of_the_table_are_reproduced(name: str, configurations) -> None:
    robot = arm(name)
    for q in configurations(robot, 20):
        assert fk_position(robot, q) == pytest.approx(TABLE[name](q, robot.length), abs=1e-14)


def test_the_orientation_entries_of_the_table() -> None:
    q1, q2, q3, q4, q5 = 0.3, -0.4, 0.9, 0.2, 1.3
    n = fk(arm("cylindrical"), [q1, 0.1, 0.2, q4])[:3, 0]
    assert n == pytest.approx([-sin(q1) * cos(q4), cos(q1) * cos(q4), sin(q4)])
    last = fk(arm("wrist-arm"), [q1, q2, q3])[2]
    assert (last[0], last[1]) == pytest.approx((cos(q2) * cos(q3), -cos(q2) * sin(q3)))
    a = fk(arm("rv-m1"), [q1, q2, q3, q4, q5])[:3, 2]
    pitch = q2 + q3 + q4
    assert a == pytest.approx([cos(q1) * sin(pitch), sin(q1) * sin(pitch), -cos(pitch)])


def test_the_irb_6400c_is_its_printed_third_frame_and_wrist() -> None:
    robot = arm("irb6400c")
    l1, l2, l3, l4 = (robot.length[name] for name in ("l1", "l2", "l3", "l4"))
    q = np.array([0.3, -0.7, 1.1, 0.5, -0.9, 2.0])
    (c1, c2, c3, c4, c5, _), (s1, s2, s3, s4, s5, _) = np.cos(q), np.sin(q)
    third = np.array(
        [
            [c1 * c2 * s3 + s1 * c3, c1 * s2, s1 * s3 - c1 * c2 * c3],
            [s1 * c2 * s3 - c1 * c3, s1 * s2, -s1 * c2 * c3 - c1 * s3],
            [-s2 * s3, c2, s2 * c3],
        ]
    )
    np.testing.assert_allclose(link_frames(robot, q)[3, :3, :3], third, atol=1e-15)
    tip = third @ [l4 * c4 * s5, l4 * s4 * s5, l4 * c5 + l3]
    tip += [
        -l1 * s1 - l2 * (c1 * c2 * s3 + s1 * c3),
        l1 * c1 + l2 * (c1 * c3 - s1 * c2 * s3),
        l2 * s2 * s3,
    ]
    assert fk_position(robot, q) == pytest.approx(tip)


SCARA_WORKED = [
    ((0, 0, 0, 0), (0.7, 0, 0.45)),
    ((30, 60, 0.2, 0), (0.34641, 0.5, 0.25)),
    ((60, 60, 0.2, 0), (0.05, 0.60622, 0.25)),
]


@pytest.mark.parametrize(("joints", "position"), SCARA_WORKED)
def test_the_worked_positions_of_the_scara(joints, position) -> None:
    one, two, down, roll = joints
    found = fk_position(arm("scara"), [radians(one), radians(two), down, radians(roll)])
    assert found == pytest.approx(position, abs=5e-6)


def test_the_scaras_orientation_is_one_angle_and_its_tool_points_down() -> None:
    one, two, roll = 0.4, 0.9, -0.3
    angle = one + two - roll
    expected = [[cos(angle), sin(angle), 0], [sin(angle), -cos(angle), 0], [0, 0, -1]]
    np.testing.assert_allclose(fk(arm("scara"), [one, two, 0.1, roll])[:3, :3], expected, atol=1e-15)


def test_the_first_row_of_lab_4() -> None:
    row = fk(arm("scara"), [pi / 3, pi / 3, 0.2, pi])[0, :3]
    assert row == pytest.approx([0.5, -0.86603, 0], abs=5e-6)


def test_the_leg_as_rows_is_the_leg_in_closed_form(configurations) -> None:
    robot = arm("leg")
    q = configurations(robot, 200)
    np.testing.assert_allclose(fk_position(robot, q), Leg.of(robot.length).fk(q[:, 0], q[:, 1]), atol=1e-15)


def test_the_legs_foot_part_stays_vertical(configurations) -> None:
    robot = arm("leg")
    q = configurations(robot, 50)
    np.testing.assert_allclose(fk(robot, q), fk_with_turn(q), atol=1e-15)


def fk_with_turn(q: np.ndarray) -> np.ndarray:
    pose = rotation("z", q[:, 0])
    pose[:, :3, 3] = Leg.of(arm("leg").length).fk(q[:, 0], q[:, 1])
    return pose


def test_the_wrong_number_of_joints_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="rv-m1 has 5 joints, not 4"):
        fk(arm("rv-m1"), [0, 0, 0, 0])
    with pytest.raises(InputError, match="must be numbers"):
        fk(arm("rv-m1"), ["a"] * 5)
