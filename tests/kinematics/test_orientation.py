"""Orientation: twelve orders there and back, axis and angle, rates, the configuration vector."""

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import orientation as o
from servogen.kinematics.transforms import is_rotation, rot

ALL = ["ZXZ", "XYX", "YZY", "ZYZ", "XZX", "YXY", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"]


def random_rotations(count: int) -> np.ndarray:
    quaternions = np.random.default_rng(4).normal(size=(count, 4))
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def test_all_twelve_orders_are_there() -> None:
    assert sorted(o.ORDERS) == sorted(ALL)


@pytest.mark.parametrize("order", ALL)
def test_the_first_solution_is_where_the_angles_came_from(order: str) -> None:
    random = np.random.default_rng(5)
    low, high = (0.1, 3.0) if order[0] == order[2] else (-1.5, 1.5)
    angles = np.stack(
        [random.uniform(-3, 3, 99), random.uniform(low, high, 99), random.uniform(-3, 3, 99)], -1
    )
    np.testing.assert_allclose(o.to_angles(o.from_angles(angles, order), order), angles, atol=1e-12)


@pytest.mark.parametrize("order", ALL)
@pytest.mark.parametrize("away", [0.0, 1e-15, 1e-13, 1e-9, 1e-5])
def test_at_and_near_the_singular_cases_the_rotation_still_comes_back(order: str, away: float) -> None:
    singular = [0.0, np.pi] if order[0] == order[2] else [np.pi / 2, -np.pi / 2]
    for middle in singular:
        matrix = o.from_angles([0.3, middle + away, 0.9], order)
        angles = o.to_angles(matrix, order)
        np.testing.assert_allclose(o.from_angles(angles, order), matrix, atol=1e-11)
        if away == 0.0:
            assert angles[0] == 0.0


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-4, 1.0, 3.0, np.pi - 1e-8, np.pi - 1e-12, np.pi])
def test_axis_and_angle_are_safe_near_zero_and_pi(angle: float) -> None:
    axis = np.array([2.0, -1.0, 0.5]) / np.linalg.norm([2.0, -1.0, 0.5])
    matrix = o.from_axis_angle(axis, angle)
    assert is_rotation(matrix, 1e-14)
    found_axis, found_angle = o.to_axis_angle(matrix)
    assert found_angle == pytest.approx(angle, abs=1e-15 if angle < 1 else 1e-14)
    np.testing.assert_allclose(o.from_axis_angle(found_axis, found_angle), matrix, atol=2e-15)
    if angle > 1e-4:
        np.testing.assert_allclose(found_axis, axis, atol=1e-11)


def test_no_turn_has_the_axis_z_and_a_half_turn_an_axis_with_a_positive_first_component() -> None:
    axis, angle = o.to_axis_angle(np.eye(3))
    assert (axis.tolist(), float(angle)) == ([0, 0, 1], 0)
    for given in ([-1, 0, 0], [0, -1, 0], [0, 0, -1], [-1, 2, 3]):
        axis, angle = o.to_axis_angle(o.from_axis_angle(given, np.pi))
        unit = -np.array(given) / np.linalg.norm(given)
        assert (axis, angle) == (pytest.approx(unit, abs=1e-15), pytest.approx(np.pi))


def test_the_back_formula_of_the_table_agrees_where_it_is_safe() -> None:
    matrix = o.from_axis_angle([1, 2, -2], 0.8)
    theta = np.arccos((np.trace(matrix) - 1) / 2)
    minors = [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    axis, angle = o.to_axis_angle(matrix)
    assert angle == pytest.approx(theta)
    assert axis == pytest.approx(np.array(minors) / (2 * np.sin(theta)))


def test_slerp_is_that_of_the_quaternions() -> None:
    share = np.linspace(0, 1, 11)
    for first, last in zip(random_rotations(40)[:20], random_rotations(40)[20:], strict=True):
        p, q = o.to_quaternion(first), o.to_quaternion(last)
        q = q if p @ q >= 0 else -q  # of q and -q the nearer: the short way
        angle = np.arccos(p @ q)
        one, other = np.sin((1 - share) * angle)[:, None], np.sin(share * angle)[:, None]
        expected = o.from_quaternion((one * p + other * q) / np.sin(angle))
        np.testing.assert_allclose(o.slerp(first, last, share), expected, atol=1e-12)


def test_slerp_turns_evenly_and_never_by_more_than_half_a_turn() -> None:
    for first, last in zip(random_rotations(40)[:20], random_rotations(40)[20:], strict=True):
        between = o.slerp(first, last, np.linspace(0, 1, 9))
        cosines = (np.trace(np.swapaxes(between[:-1], 1, 2) @ between[1:], axis1=1, axis2=2) - 1) / 2
        whole = np.arccos((np.trace(first.T @ last) - 1) / 2)
        assert np.arccos(cosines) == pytest.approx(np.full(8, whole / 8), abs=1e-7)


@pytest.mark.parametrize(("angle", "turned"), [(170, 170), (180, 180), (190, -170), (340, -20), (0, 0)])
def test_slerp_goes_the_short_way_about_one_axis(angle: float, turned: float) -> None:
    first = rot("y", 0.3)
    between = o.slerp(first, first @ rot("z", np.radians(angle)), [0.0, 0.5, 1.0])
    np.testing.assert_allclose(between[0], first, atol=1e-15)
    np.testing.assert_allclose(between[1], first @ rot("z", np.radians(turned / 2)), atol=1e-12)
    np.testing.assert_allclose(between[2], first @ rot("z", np.radians(angle)), atol=1e-12)


def test_the_configuration_vector_keeps_the_roll_in_the_length_of_the_approach() -> None:
    vector = o.configuration_vector([1, 2, 3], [0, 0.6, 0.8], 2.0)
    assert np.linalg.norm(vector[3:]) == pytest.approx(np.exp(2.0 / np.pi))
    position, approach, roll = o.from_configuration_vector(vector)
    assert position == pytest.approx([1, 2, 3])
    assert approach == pytest.approx([0, 0.6, 0.8])
    assert roll == pytest.approx(2.0)


def test_what_has_no_direction_or_no_order_is_refused() -> None:
    with pytest.raises(InputError, match="no direction"):
        o.from_axis_angle([0, 0, 0], 1.0)
    with pytest.raises(InputError, match="length 0 is not a rotation"):
        o.from_quaternion([0, 0, 0, 0])
    with pytest.raises(InputError, match="not zero"):
        o.from_configuration_vector([1, 2, 3, 0, 0, 0])
    with pytest.raises(InputError, match="'ZZX' is not an order"):
        o.from_angles([1, 2, 3], "ZZX")
