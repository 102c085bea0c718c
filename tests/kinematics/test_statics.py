"""Static torques follow from the potential energy, foot forces from the balance of forces and moments."""

from dataclasses import replace

import numpy as np
import pytest

from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk_position
from servogen.kinematics.statics import GRAVITY, foot_forces, gravity_torques, has_masses
from servogen.robot.model import Arm, FixedFrame


def with_masses(name: str) -> Arm:
    """Every link has a mass of its own, off its frame's axes."""
    found = arm(name)
    joints = tuple(
        replace(joint, mass=0.2 + 0.1 * number, centre=(0.01 * number, -0.02, 0.03))
        for number, joint in enumerate(found.joints)
    )
    return replace(found, joints=joints, payload=0.35)


def test_the_shoulder_of_an_rv_m1_carries_its_payload_by_the_closed_form() -> None:
    """z = d1 + a2 s2 + a3 s23 - d5 c234, so that ∂z/∂q2 = a2 c2 + a3 c23 + d5 s234; q1 turns about z."""
    robot = replace(arm("rv-m1"), payload=1.2)
    q = np.radians([[10, 20, -35, 15, 0], [90, 0, 0, 0, 90], [0, -90, 0, 0, 0]])
    _, q2, q3, q4, _ = q.T
    third = 0.160 * np.cos(q2 + q3) + 0.072 * np.sin(q2 + q3 + q4)
    torque = gravity_torques(robot, q)
    assert torque[:, 0] == pytest.approx([0, 0, 0], abs=1e-12)
    assert torque[:, 1] == pytest.approx(1.2 * GRAVITY * (0.250 * np.cos(q2) + third))
    assert torque[:, 2] == pytest.approx(1.2 * GRAVITY * third)


def test_a_links_own_mass_hangs_on_the_joints_before_it_only() -> None:
    """The upper arm's mass in the middle of its 250 mm: half of them from the shoulder."""
    robot = arm("rv-m1")
    joints = list(robot.joints)
    joints[1] = replace(joints[1], mass=2.0, centre=(-0.125, 0.0, 0.0))
    torque = gravity_torques(replace(robot, joints=tuple(joints)), [0.0, 0.0, 1.0, 0.5, 0.0])
    assert torque == pytest.approx([0, 2.0 * GRAVITY * 0.125, 0, 0, 0], abs=1e-12)


def test_a_sliding_joint_that_stands_upright_carries_the_weight() -> None:
    """The third joint of a SCARA goes down as it grows."""
    torque = gravity_torques(replace(arm("scara"), payload=0.5), [0.3, 0.4, 0.1, 0.0])
    assert torque == pytest.approx([0, 0, -0.5 * GRAVITY, 0], abs=1e-12)


@pytest.mark.parametrize("name", ["anthropomorphic", "irb6400c", "wrist-arm", "spherical-wrist", "scara"])
def test_the_torques_are_the_slope_of_the_potential_energy(name: str) -> None:
    """By differences of the height of each mass, which forward kinematics gives."""
    robot = with_masses(name)

    def energy(q: np.ndarray) -> float:
        total = robot.payload * fk_position(robot, q)[2]
        for index, joint in enumerate(robot.joints):
            last = [row.joint for row in robot.rows].index(index)
            link = replace(robot, rows=robot.rows[: last + 1], tool=FixedFrame(*joint.centre))
            total += joint.mass * fk_position(link, q)[2]
        return float(GRAVITY * total)

    dice = np.random.default_rng(3)
    for _ in range(5):
        q = dice.uniform(-1, 1, len(robot.joints))
        steps = 1e-6 * np.eye(len(q))
        slope = [(energy(q + step) - energy(q - step)) / 2e-6 for step in steps]
        assert gravity_torques(robot, q) == pytest.approx(slope, abs=1e-6)


def test_an_arm_without_masses_asks_for_nothing() -> None:
    assert not has_masses(arm("rv-m1"))
    assert has_masses(with_masses("rv-m1"))
    assert gravity_torques(arm("rv-m1"), np.ones((3, 5))).tolist() == [[0.0] * 5] * 3


SQUARE = np.array([[[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]])
ALL = np.ones((1, 4), dtype=bool)


def test_a_tripod_gives_half_of_the_weight_to_the_lonely_leg() -> None:
    """Moments about the line through the two feet of one side: 1 m away the body, 2 m away the third foot."""
    feet = np.array([[[0.3, 1.0], [-0.3, 1.0], [0.0, -1.0]]])
    forces = foot_forces(feet, np.ones((1, 3), dtype=bool), np.zeros(2), 12.0)
    assert forces[0] == pytest.approx([3.0, 3.0, 6.0])


def test_four_equal_legs_share_alike_and_lean_to_where_the_weight_is() -> None:
    """On springs the load is linear in the place of the foot: W/4 (1 + x x_c + y y_c) for this square."""
    assert foot_forces(SQUARE, ALL, np.zeros(2), 8.0)[0] == pytest.approx([2.0] * 4)
    forces = foot_forces(SQUARE, ALL, np.array([0.25, 0.5]), 8.0)[0]
    assert forces == pytest.approx([3.5, 2.5, 0.5, 1.5])


def test_a_foot_that_would_have_to_pull_carries_nothing() -> None:
    centre = np.array([0.8, 0.8])
    forces = foot_forces(SQUARE, ALL, centre, 10.0)[0]
    assert forces.min() == 0.0
    assert forces.sum() == pytest.approx(10.0)
    assert forces @ SQUARE[0] == pytest.approx(10.0 * centre)


def test_a_foot_in_the_air_carries_nothing_and_who_falls_is_not_judged() -> None:
    ground = np.array([[True, True, True, False], [True, True, False, False], [False] * 4])
    forces = foot_forces(np.tile(SQUARE, (3, 1, 1)), ground, np.array([-0.5, 0.5]), 10.0)
    assert forces[0, 3] == 0.0
    assert forces[0] @ SQUARE[0] == pytest.approx([-5.0, 5.0])
    assert np.isnan(forces[1:]).all()
