"""The quasi-static way of a walking robot: against rigid motions, and a search of the same minimum."""

import math

import numpy as np
import pytest

from servogen.motion.gait.quasistatic import rigid_body_path

HEXAGON = (
    np.array([[90, 100, 0], [0, 110, 0], [-90, 100, 0], [90, -100, 0], [0, -110, 0], [-90, -100, 0]]) / 1e3
)


def moved(twist: tuple[float, float, float], frames: int) -> np.ndarray:
    """Feet that stay where they are on the ground while the body goes by a twist in each frame."""
    at, yaw, rows = 0j, 0.0, []
    for _ in range(frames):
        seen = (HEXAGON[:, 0] + 1j * HEXAGON[:, 1] - at) * np.exp(-1j * yaw)
        rows.append(np.column_stack([seen.real, seen.imag, HEXAGON[:, 2]]))
        middle = yaw + twist[2] / 2
        at += complex(twist[0], twist[1]) * np.sinc(twist[2] / 2 / np.pi) * np.exp(1j * middle)
        yaw += twist[2]
    return np.array(rows)


@pytest.mark.parametrize("twist", [(0.001, 0, 0), (0, -0.0005, 0), (0, 0, 0.005), (0.001, 0.0005, -0.004)])
def test_feet_that_stand_still_carry_the_body_exactly(twist: tuple[float, float, float]) -> None:
    way = rigid_body_path(moved(twist, 101), (0.0, 0.0))
    assert way.pose[-1, 2] == pytest.approx(100 * twist[2], abs=1e-5)
    chord = abs(complex(twist[0], twist[1])) * abs(np.sinc(50 * twist[2] / np.pi)) * 100
    assert abs(complex(*way.pose[-1, :2])) == pytest.approx(chord, rel=1e-4, abs=1e-6)
    assert way.slip.max() < 1e-6


def test_the_twist_is_the_one_of_the_least_slip() -> None:
    """Feet that quarrel, against a search of a fine grid around the answer."""
    rng = np.random.default_rng(3)
    feet = np.array([HEXAGON, HEXAGON + np.column_stack([rng.normal(0, 1e-3, (6, 2)), np.zeros(6)])])
    way = rigid_body_path(feet, (0.0, 0.0))
    middle, shift = (feet[0] + feet[1])[:, :2] / 2, (feet[1] - feet[0])[:, :2]

    def work(x: float, y: float, turn: float) -> float:
        slips = shift + [x, y] + turn * np.column_stack([-middle[:, 1], middle[:, 0]])
        return float(forces @ np.linalg.norm(slips, axis=1))

    from servogen.kinematics.statics import foot_forces

    forces = foot_forces(middle[None], np.ones((1, 6), bool), np.zeros(2), 1.0)[0]
    turn = float(way.pose[1, 2])
    step = complex(*way.pose[1, :2]) * np.exp(-0.5j * turn) / np.sinc(turn / 2 / np.pi)
    best = work(step.real, step.imag, turn)
    for _ in range(4000):
        dx, dy, dt = rng.normal(0, 1, 3) * rng.choice([1e-3, 1e-4, 1e-5])
        assert work(step.real + dx, step.imag + dy, turn + 10 * dt) >= best - 1e-9


def test_feet_in_the_air_and_light_feet_have_no_say() -> None:
    feet = moved((0.001, 0.0, 0.0), 11)
    feet[:, 1, 2] += 0.005
    feet[:, 1, 0] += np.linspace(0, 0.1, 11)  # swings
    assert rigid_body_path(feet, (0.0, 0.0)).pose[-1] == pytest.approx([0.01, 0.0, 0.0], abs=1e-7)


def test_a_body_in_the_air_goes_nowhere() -> None:
    feet = moved((0.001, 0.0, 0.0), 3)
    way = rigid_body_path(feet, (0.0, 0.0), np.zeros((3, 6), bool))
    assert way.pose == pytest.approx(0.0) and math.isfinite(way.slip.max())
