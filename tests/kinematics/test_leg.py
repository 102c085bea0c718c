"""The two-joint leg: its formulas, its surface, its stance."""

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.leg import Leg
from servogen.kinematics.transforms import wrapped

LEG = Leg(ab=0.03, bc=0.05, cd=0.01, df=0.08)


def random_angles(count: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(1)
    return random.uniform(-np.pi, np.pi, count), random.uniform(-np.pi, np.pi, count)


def test_the_foot_hangs_beside_the_axis_when_both_angles_are_zero() -> None:
    assert LEG.fk(0, 0) == pytest.approx([0, 0.04, -0.13])


def test_alpha_of_a_right_angle_turns_the_foot_backwards() -> None:
    assert LEG.fk(np.pi / 2, 0) == pytest.approx([-0.04, 0, -0.13])


def test_beta_of_a_right_angle_puts_the_foot_behind_at_the_height_of_the_slider() -> None:
    assert LEG.fk(0, np.pi / 2) == pytest.approx([-0.05, 0.04, -0.08])


def test_the_foot_obeys_the_two_equations_of_its_surface() -> None:
    alpha, beta = random_angles(1000)
    x, y, z = LEG.fk(alpha, beta).T
    np.testing.assert_allclose(x**2 + y**2, 0.04**2 + (0.05 * np.sin(beta)) ** 2, atol=1e-15)
    np.testing.assert_allclose(np.cos(beta), -(z + 0.08) / 0.05, atol=1e-12)


def test_every_solution_gives_the_foot_back_and_one_of_them_is_where_it_came_from() -> None:
    alpha, beta = random_angles(10_000)
    foot = LEG.fk(alpha, beta)
    solutions = LEG.ik(foot)
    assert solutions.shape == (10_000, 2, 2)
    again = LEG.fk(solutions[..., 0], solutions[..., 1])
    assert np.abs(again - foot[:, None, :]).max() < 1e-9
    away = np.abs(wrapped(solutions - np.stack([alpha, beta], axis=-1)[:, None, :])).max(axis=-1)
    assert away.min(axis=-1).max() < 1e-4
    np.testing.assert_array_equal(solutions[:, 0, 1], -solutions[:, 1, 1])


def test_a_point_off_the_surface_is_refused_with_the_reason_and_the_nearest_point() -> None:
    with pytest.raises(Unreachable, match="two joints reach a surface only") as caught:
        LEG.ik([0.0, 0.1, -0.13])
    assert caught.value.nearest[0] == 0.0
    assert LEG.solve([0.0, 0.1, -0.13]).shape == (2, 2)
    assert np.isnan(LEG.solve([0.0, 0.1, -0.13])).all()
    LEG.ik(caught.value.nearest)
    assert "nearest reachable point" in str(caught.value)


def test_no_foot_of_the_leg_is_nearer_than_the_nearest_point() -> None:
    alpha, beta = random_angles(20_000)
    feet = LEG.fk(alpha, beta)
    for target in ([0.1, 0.02, -0.05], [0.0, 0.0, -0.4], [-0.01, -0.01, -0.08], [0.0, 0.0, 0.0]):
        nearest = np.asarray(LEG.nearest(target))
        LEG.ik(nearest)
        here = np.linalg.norm(nearest - target)
        assert here <= np.linalg.norm(feet - target, axis=-1).min() + 1e-9


def test_the_first_unreachable_foot_of_many_is_the_one_named() -> None:
    feet = np.vstack([LEG.fk(0.1, 0.2), [0, 0, 0.5], [0, 9, 9]])
    with pytest.raises(
        Unreachable, match=r"0\.000, 0\.000, 500\.000.*height must be between -130\.000 and -30\.000"
    ):
        LEG.ik(feet)


def test_a_foot_that_is_not_a_number_is_refused() -> None:
    with pytest.raises(InputError, match="finite"):
        LEG.ik([np.nan, 0, 0])


def test_lengths_that_make_no_leg_are_refused() -> None:
    with pytest.raises(InputError, match="bc is -1"):
        Leg(0.03, -1, 0.01, 0.08)
    with pytest.raises(InputError, match="l_BC > 0"):
        Leg(0.03, 0.0, 0.01, 0.08)


def test_a_stance_at_constant_height_turns_only_alpha_and_the_spring_takes_up_the_rest() -> None:
    height, stride = -0.12, 0.03
    wanted = LEG.straight(stride, height, 31)
    stance = LEG.stance(wanted)
    assert np.ptp(stance.beta) < 1e-12
    across = wanted[:, 0] * stance.correction_m[:, 1] - wanted[:, 1] * stance.correction_m[:, 0]
    assert across == pytest.approx(np.zeros(31), abs=1e-15), "the spring yields along the leg"
    np.testing.assert_allclose(stance.foot_m + stance.correction_m, wanted, atol=1e-15)
    rho = np.hypot(0.04, 0.05 * np.sin(LEG.beta_at(height)))
    np.testing.assert_allclose(np.hypot(*stance.foot_m[:, :2].T), rho, atol=1e-12)
    assert stance.largest_correction_m == pytest.approx(stride**2 / (16 * rho), rel=1e-6)


def test_no_other_distance_of_the_line_needs_a_smaller_correction() -> None:
    wanted = LEG.straight(0.03, -0.12, 31)
    least = LEG.stance(wanted).largest_correction_m
    for shift in (-1e-4, 1e-4):
        assert LEG.stance(wanted + np.array([0, shift, 0])).largest_correction_m > least


def test_a_stance_higher_than_the_leg_reaches_is_refused() -> None:
    with pytest.raises(InputError, match="no β gives the height 10"):
        LEG.straight(0.03, 0.01, 11)


def test_the_load_torque_of_the_stance_posture_is_zero_and_grows_with_the_sine() -> None:
    assert LEG.torque(0.0, 3.0) == 0.0
    assert LEG.torque(np.pi / 6, 3.0) == pytest.approx(3.0 * 0.05 * 0.5)


def test_the_torque_is_the_work_of_the_force_per_angle() -> None:
    beta, step = 0.7, 1e-6
    rise = (LEG.fk(0, beta + step) - LEG.fk(0, beta - step))[2] / (2 * step)
    assert LEG.torque(beta, 2.0) == pytest.approx(2.0 * rise, rel=1e-8)


def test_the_nearest_point_to_one_beside_the_surface_is_the_foot_of_its_normal() -> None:
    """Seen in the half plane through the axis of α; to a nanometre where the surface is not curved away."""
    for beta in (0.3, 0.9, 1.5, 2.2):
        rho, height = np.hypot(0.04, 0.05 * np.sin(beta)), -0.05 * np.cos(beta) - 0.08
        along = np.array([0.05**2 * np.sin(beta) * np.cos(beta) / rho, 0.05 * np.sin(beta)])
        normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        aside, up = np.array([rho, height]) + 0.02 * normal
        for turn in (0.4, -2.0):
            target = (aside * np.cos(turn), aside * np.sin(turn), up)
            expected = (rho * np.cos(turn), rho * np.sin(turn), height)
            assert LEG.nearest(target) == pytest.approx(expected, abs=1e-9)


def test_a_stance_keeps_the_sign_of_beta_and_goes_round_without_a_jump_of_alpha() -> None:
    turns = np.linspace(0, 3 * np.pi, 50)
    path = LEG.fk(turns, 0.6)
    for sign in (1, -1):
        stance = LEG.stance(path, sign)
        assert stance.beta == pytest.approx(np.full(50, sign * 0.6))
        assert np.diff(stance.alpha) == pytest.approx(np.diff(turns))
        assert stance.largest_correction_m < 1e-12
    assert LEG.stance(path[0]).foot_m == pytest.approx(path[:1])
    for sign in (0, 2, -2):
        with pytest.raises(InputError, match=f"the sign of β is 1 or -1, not {sign}"):
            LEG.stance(path, sign)
    for height in (-0.131, -0.029):
        with pytest.raises(InputError, match=f"no β gives the height {1000 * height:.3f} mm") as caught:
            LEG.stance([path[0], [0.0, 0.04, height]])
        assert caught.value.hint == "this leg's foot is between -130.000 and -30.000 mm"


def test_a_straight_path_runs_backwards_on_either_side() -> None:
    """Its ends are as far outside the circle of the foot as its middle is inside."""
    rho = np.hypot(0.04, 0.05 * np.sin(LEG.beta_at(-0.1)))
    left, right = LEG.straight(0.02, -0.1, 3), LEG.straight(0.02, -0.1, 3, -1)
    assert left[:, 0] == pytest.approx([0.01, 0, -0.01])
    assert right == pytest.approx(left * [1, -1, 1])
    assert left[1] == pytest.approx([0, rho - 0.02**2 / (16 * rho), -0.1])
    assert np.hypot(*left[0, :2]) - rho == pytest.approx(rho - left[1, 1], rel=0.01)
    assert len(LEG.straight(0.02, -0.1, 2)) == 2
    for samples, side in ((1, 1), (3, 0), (3, 2)):
        with pytest.raises(InputError, match="two samples or more and a side of 1 or -1"):
            LEG.straight(0.02, -0.1, samples, side)


def test_which_lengths_may_be_zero() -> None:
    assert Leg(0.0, 0.05, 0.01, 0.0).r == 0.01 and Leg(0.01, 0.05, 0.0, 0.0).r == 0.01
    with pytest.raises(InputError, match=r"l_AB \+ l_CD > 0"):
        Leg(0.0, 0.05, 0.0, 0.08)
    for name in ("ab", "bc", "cd", "df"):
        with pytest.raises(InputError, match=f"the leg's length {name} is -0.001 m"):
            Leg(**{"ab": 0.03, "bc": 0.05, "cd": 0.01, "df": 0.08} | {name: -0.001})
    with pytest.raises(InputError, match="cannot be negative"):
        Leg(0.03, 0.05, 0.01, np.nan)
