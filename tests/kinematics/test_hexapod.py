"""The six-legged robot: mounts, mirrored sides, feet there and back."""

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import hexapod as h
from servogen.kinematics.catalogue import robot
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.transforms import mount_matrix, to_body, to_leg
from servogen.robot.model import Mount

ROBOT = robot("hexapod")
assert isinstance(ROBOT, Hexapod)


def test_equal_angles_put_both_sides_feet_opposite_each_other() -> None:
    feet = h.feet(ROBOT, np.broadcast_to([0.3, -0.4], (6, 2)))
    np.testing.assert_allclose(feet[:3] * [1, -1, 1], feet[3:], atol=1e-15)


def test_left_feet_are_on_the_left_and_all_hang_down() -> None:
    feet = h.feet(ROBOT, np.zeros((6, 2)))
    assert (feet[:3, 1] > 0).all()
    assert (feet[3:, 1] < 0).all()
    assert (feet[:, 2] < 0).all()
    assert [mount.name for mount in ROBOT.mounts] == ["L1", "L2", "L3", "R1", "R2", "R3"]


def test_a_positive_alpha_takes_every_foot_backwards() -> None:
    before, after = (h.feet(ROBOT, np.broadcast_to([alpha, 0.0], (6, 2))) for alpha in (0.0, 0.2))
    assert (after[:, 0] < before[:, 0]).all()


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_mount_takes_points_to_the_body_and_back(mirrored: bool) -> None:
    mount = Mount("m", 0.1, -0.2, 0.05, 0.7, mirrored)
    points = np.random.default_rng(12).normal(size=(20, 3))
    np.testing.assert_allclose(to_leg(mount, to_body(mount, points)), points, atol=1e-15)
    assert np.linalg.det(mount_matrix(mount)[:3, :3]) == pytest.approx(-1 if mirrored else 1)


def test_a_leg_that_is_not_there_is_refused() -> None:
    with pytest.raises(InputError, match="no leg 'L4'"):
        ROBOT.mount("L4")
