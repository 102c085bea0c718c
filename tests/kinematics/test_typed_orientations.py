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
