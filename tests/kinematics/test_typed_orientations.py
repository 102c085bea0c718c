"""`servogen orientation` and the inverses of `servogen transform`, against laws and values made by hand."""

from __future__ import annotations

from math import radians, sqrt

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import queries
from servogen.kinematics.transforms import parse


def rotation_about(axis: str, degrees: float) -> np.ndarray:
    """The elementary rotations, written out as the textbooks have them."""
    c, s = np.cos(radians(degrees)), np.sin(radians(degrees))
    rows = {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    return np.array(rows[axis])


@pytest.mark.parametrize("order", ["zyx", "zyz", "xyz", "yxy"])
def test_three_angles_are_the_product_of_three_turns_in_that_order(order: str) -> None:
    angles = (20.0, -35.0, 70.0)
    expected = np.eye(3)
    for axis, angle in zip(order, angles, strict=True):
        expected = expected @ rotation_about(axis, angle)
    answer = queries.orientation_answer(order, angles)
    np.testing.assert_allclose(answer["matrix"], expected, atol=1e-12)
    for name in ("angles_deg", "second_deg"):
        for other, found in answer[name].items():
            again = queries.orientation_answer(other, found)
            np.testing.assert_allclose(again["matrix"], expected, atol=1e-12)


def test_roll_pitch_yaw_is_zyx() -> None:
    assert queries.orientation_answer("rpy", (10, 20, 30)) == queries.orientation_answer("zyx", (10, 20, 30))


def test_a_third_of_a_turn_about_the_space_diagonal_exchanges_the_axes() -> None:
    answer = queries.orientation_answer("axis-angle", (1, 1, 1, 120))
    np.testing.assert_allclose(answer["matrix"], [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(answer["quaternion"], [0.5] * 4, atol=1e-12)
    np.testing.assert_allclose(answer["axis"], [1 / sqrt(3)] * 3)
    assert answer["angle_deg"] == pytest.approx(120)
    same = queries.orientation_answer("quaternion", (3, 3, 3, 3))
    np.testing.assert_allclose(same["matrix"], answer["matrix"], atol=1e-12)


def test_a_matrix_typed_with_four_digits_is_made_a_rotation() -> None:
    answer = queries.orientation_answer("matrix", (0.8660, -0.5, 0, 0.5, 0.8660, 0, 0, 0, 1))
    assert answer["angles_deg"]["ZYX"][0] == pytest.approx(30, abs=1e-2)
    np.testing.assert_allclose(
        np.array(answer["matrix"]) @ np.array(answer["matrix"]).T, np.eye(3), atol=1e-12
    )


@pytest.mark.parametrize(
    ("form", "values", "message"),
    [
        ("zzz", (1, 2, 3), "'zzz' is not a form of an orientation"),
        ("rpy", (1, 2), "rpy takes 3 numbers, not 2"),
        ("matrix", (1, 0, 0, 0, 1, 0, 0, 0, -1), "the matrix is not a rotation"),
        ("matrix", (1, 0, 0, 0, 1, 0, 0, 0.01, 1), "the matrix is not a rotation"),
        ("quaternion", (0, 0, 0, 0), "a quaternion of length 0 is not a rotation"),
        ("axis-angle", (0, 0, 0, 30), "an axis of length 0 has no direction"),
        ("rpy", (1, 2, float("nan")), "finite"),
    ],
)
def test_what_is_not_an_orientation_is_refused(form: str, values: tuple[float, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        queries.orientation_answer(form, values)


PRODUCT = "Rz(60) Tx(50) Ry(30)"


@pytest.mark.parametrize("text", [f"inv({PRODUCT})", f"({PRODUCT})^-1", "Ry(30)^-1 Tx(-50) inv(Rz(60))"])
def test_a_product_and_its_inverse_give_the_identity(text: str) -> None:
    np.testing.assert_allclose(parse(PRODUCT) @ parse(text), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(parse(f"{PRODUCT} ({text})"), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(parse(f"inv(inv({PRODUCT}))"), parse(PRODUCT), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("inv(Rx(1)", 1, "not closed"),
        ("Rx(1))", 6, "there is no '\\('"),
        ("(" * 60 + "Rx(1)" + ")" * 60, 51, "nested more than 50 deep"),
        ("Rx(1)^2", 6, "is not a transform"),
    ],
)
def test_parentheses_that_do_not_match_are_shown(text: str, column: int, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        parse(text)
    assert caught.value.location is not None
    assert caught.value.location.column == column


@pytest.mark.parametrize("axis", [(1, 1, 1), (0, 0, -2), (3, -4, 12), (1e-3, 0, 0)])
def test_a_turn_about_any_axis_is_typed_as_a_transform(axis: tuple[float, ...]) -> None:
    """Euler's R v = v cos θ + (a × v) sin θ + a (a·v)(1 - cos θ), for three vectors."""
    unit, angle = np.array(axis) / np.linalg.norm(axis), np.radians(70)
    matrix = np.array(queries.transform_answer(f"Rot({','.join(map(str, axis))},70)")["matrix"])
    for v in np.eye(3) + 0.25:
        turned = (
            v * np.cos(angle) + np.cross(unit, v) * np.sin(angle) + unit * (unit @ v) * (1 - np.cos(angle))
        )
        np.testing.assert_allclose(matrix[:3, :3] @ v, turned, atol=1e-12)
    assert matrix[:3, 3].tolist() == [0, 0, 0]


def test_a_homogeneous_point_is_divided_by_w_and_a_direction_is_not_moved() -> None:
    point = queries.transform_answer("Trans(3,4,3) Ry(90)", (-4, 6, 2, 2))["point"]
    assert point == pytest.approx([8, 14, 10, 2])  # (4, 7, 5), which (-2, 3, 1) moves to
    assert queries.transform_answer("Trans(3,4,3)", (1, 2, 3, 0))["point"] == [1, 2, 3, 0]


@pytest.mark.parametrize("text", ["Rot(0,0,0,30)", "Rot(1,2,3)", "Rot(x,1,2,3)"])
def test_an_axis_without_a_direction_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="column 1"):
        queries.transform_answer(text)
