"""Differential motion: Δ, seen from other frames, cylindrical and spherical speeds."""

import numpy as np
import pytest

from servogen.kinematics import jacobian as diff
from servogen.kinematics import transforms as t
from servogen.kinematics.orientation import from_axis_angle

FRAME = t.translation(0.3, -0.2, 0.5) @ t.rotation("z", 0.4) @ t.rotation("x", -0.9)
D, DELTA = np.array([0.2, -0.4, 0.1]), np.array([0.3, 0.5, -0.2])


def moved(scale: float) -> np.ndarray:
    turn = from_axis_angle(DELTA, scale * np.linalg.norm(DELTA))
    return t.transform(turn, scale * D) @ FRAME


def test_the_change_is_what_a_small_motion_does() -> None:
    step = 1e-6
    np.testing.assert_allclose(
        diff.change(FRAME, D, DELTA), (moved(step) - moved(-step)) / (2 * step), atol=1e-9
    )


def test_the_motion_seen_from_the_frame_makes_the_same_change() -> None:
    d, delta = diff.seen_from(FRAME, D, DELTA)
    np.testing.assert_allclose(FRAME @ diff.differential(d, delta), diff.change(FRAME, D, DELTA), atol=1e-15)
    np.testing.assert_allclose(
        diff.differential(d, delta), t.inverse(FRAME) @ diff.differential(D, DELTA) @ FRAME, atol=1e-15
    )


def test_the_components_are_those_of_the_formula() -> None:
    n, o, a, p = (FRAME[:3, column] for column in range(4))
    d, delta = diff.seen_from(FRAME, D, DELTA)
    assert delta == pytest.approx([DELTA @ n, DELTA @ o, DELTA @ a])
    assert d == pytest.approx([axis @ (np.cross(DELTA, p) + D) for axis in (n, o, a)])


def test_the_motion_is_found_again_from_the_change() -> None:
    d, delta = diff.motion_of(diff.change(FRAME, D, DELTA), FRAME)
    assert (d, delta) == (pytest.approx(D), pytest.approx(DELTA))


def test_a_stack_of_frames_is_treated_frame_by_frame() -> None:
    frames = np.stack([FRAME, np.eye(4), moved(1.0)])
    for function in (diff.change, diff.seen_from):
        together, apart = function(frames, D, DELTA), [function(frame, D, DELTA) for frame in frames]
        np.testing.assert_allclose(together, np.moveaxis(apart, 0, -3 if function is diff.change else -2))
    found = diff.motion_of(diff.change(frames, D, DELTA), frames)
    np.testing.assert_allclose(found, [[D] * 3, [DELTA] * 3])


def test_small_rotations_commute_to_first_order() -> None:
    small = 1e-4
    one, two = t.rot("x", small), t.rot("y", small)
    assert np.abs(one @ two - two @ one).max() <= 1.01 * small**2
    np.testing.assert_allclose(one @ two, np.eye(3) + t.skew([small, small, 0]), atol=1.01 * small**2)
