"""Transforms: the worked numbers, inverses, coordinates that are not Cartesian."""

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import transforms as t

RIGHT = np.pi / 2


def test_a_translated_and_turned_frame_carries_its_point() -> None:
    frame = t.translation(3, 4, 3) @ t.rotation("y", RIGHT)
    assert t.apply(frame, [-2, 3, 1]) == pytest.approx([4, 7, 5], abs=1e-12)


def test_the_order_of_turning_and_translating_matters() -> None:
    moved, turn = t.translation(3, 3, 3), t.rotation("y", RIGHT)
    assert (moved @ turn)[:3, 3] == pytest.approx([3, 3, 3])
    assert (turn @ moved)[:3, 3] == pytest.approx([3, 3, -3])


def test_the_worked_inverse() -> None:
    frame = np.array([[0, -1, 0, 0], [1, 0, 0, 2], [0, 0, 1, 2], [0, 0, 0, 1]], float)
    assert t.inverse(frame)[:3, 3] == pytest.approx([-2, 0, -2])
    assert t.apply(t.inverse(frame), [0, 1, 0]) == pytest.approx([-1, 0, -2])


def test_an_inverse_undoes_many_transforms_at_once() -> None:
    random = np.random.default_rng(2)
    frames = t.translation(*random.normal(size=(3, 50))) @ t.rotation("z", random.normal(size=50))
    frames = frames @ t.rotation("x", random.normal(size=50))
    np.testing.assert_allclose(t.inverse(frames) @ frames, np.broadcast_to(np.eye(4), (50, 4, 4)), atol=1e-14)
    assert t.is_rotation(frames[:, :3, :3])


def test_a_homogeneous_vector_has_a_scale() -> None:
    assert t.homogeneous([1, 2, 3], 2.0) == pytest.approx([2, 4, 6, 2])
    assert t.homogeneous([1, 2, 3], 0.0) == pytest.approx([1, 2, 3, 0])


def test_a_direction_turns_but_does_not_move() -> None:
    frame = t.translation(5, 6, 7) @ t.rotation("z", RIGHT)
    assert frame @ t.homogeneous([1, 0, 0], 0.0) == pytest.approx([0, 1, 0, 0], abs=1e-15)


def test_a_mirror_is_no_rotation() -> None:
    assert t.is_rotation(np.eye(3))
    assert not t.is_rotation(np.diag([1, 1, -1]))
    assert not t.is_rotation(2 * np.eye(3))


def test_cylindrical_coordinates_are_a_product() -> None:
    r, alpha, c = 2.0, 0.4, -1.0
    product = t.translation(0, 0, c) @ t.rotation("z", alpha) @ t.translation(r, 0, 0)
    np.testing.assert_allclose(t.cylindrical(r, alpha, c), product, atol=1e-15)
    kept = product @ t.rotation("z", -alpha)
    np.testing.assert_allclose(t.cylindrical(r, alpha, c, keep_orientation=True), kept, atol=1e-15)


def test_spherical_coordinates_are_a_product() -> None:
    r, beta, gamma = 2.0, 0.4, -1.0
    product = t.rotation("z", gamma) @ t.rotation("y", beta) @ t.translation(0, 0, r)
    np.testing.assert_allclose(t.spherical(r, beta, gamma), product, atol=1e-15)
    kept = product @ t.rotation("y", -beta) @ t.rotation("z", -gamma)
    np.testing.assert_allclose(t.spherical(r, beta, gamma, keep_orientation=True), kept, atol=1e-15)


def test_the_skew_matrix_makes_the_cross_product() -> None:
    a, b = np.random.default_rng(3).normal(size=(2, 20, 3))
    np.testing.assert_allclose((t.skew(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-15)


def test_the_half_angle_gives_the_cosine_and_the_sine_of_every_angle() -> None:
    angles = np.concatenate([np.linspace(-7, 7, 20_001), np.arange(-8, 9) * RIGHT, [1e-300, 1e-9]])
    cosine, sine = t.cos_sin(angles)
    assert np.abs(cosine - np.cos(angles)).max() < 2e-15
    assert np.abs(sine - np.sin(angles)).max() < 2e-15


def test_multiples_of_a_right_angle_are_exact() -> None:
    quarter = [t.exact_cos_sin(turn * RIGHT) for turn in range(-4, 5)]
    one = [(1, 0), (0, 1), (-1, 0), (0, -1)]
    assert quarter == [*one, *one, (1, 0)]


def test_wrapped_angles_are_above_minus_pi_and_up_to_pi() -> None:
    assert t.wrapped([np.pi, -np.pi, 3 * np.pi, 0.5, -7.0]) == pytest.approx(
        [np.pi, np.pi, np.pi, 0.5, -7.0 + 2 * np.pi]
    )


def test_an_axis_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="'w' is not an axis"):
        t.rot("w", 1.0)
