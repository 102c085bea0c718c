"""Configuration vectors W = (p, e^{θ/π} a): of joint positions, and back."""

from dataclasses import replace
from math import cos, exp, pi, radians, sin

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.kinematics.inverse.configuration import configuration_of, has_roll, ik_of_configuration
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.robot.model import FixedFrame
from tests.campaigns import sampled

WITH_ROLL = ("cylindrical", "spherical-wrist", "scara", "wrist-arm", "rv-m1", "irb6400c")


def test_the_vector_of_the_scara_is_the_closed_form() -> None:
    # p = (l1 c1 + l2 c12, l1 s1 + l2 s12, l0 - l3 - d3 - l4), a = (0, 0, -1), roll = θ4
    one, two, slide, four = radians(30), radians(60), 0.2, radians(90)
    expected = [
        0.4 * cos(one) + 0.3 * cos(one + two), 0.4 * sin(one) + 0.3 * sin(one + two), 0.6 - slide - 0.15, 0,
        0, -exp(0.5),
    ]  # fmt: skip
    assert configuration_of(arm("scara"), [one, two, slide, four]) == pytest.approx(expected)


def test_the_approach_of_the_rv_m1_is_the_closed_form() -> None:
    one, three_angles, roll = 0.4, (0.5, -0.9, 1.3), -0.7
    s234, c234 = sin(sum(three_angles)), cos(sum(three_angles))
    found = configuration_of(arm("rv-m1"), [one, *three_angles, roll])[3:]
    assert found == pytest.approx(np.array([cos(one) * s234, sin(one) * s234, -c234]) * exp(roll / pi))


@pytest.mark.parametrize("name", WITH_ROLL)
def test_every_solution_has_the_vector_and_the_asked_positions_are_among_them(name, configurations) -> None:
    found = arm(name)
    assert has_roll(found)
    for q in configurations(found, 5):
        vector = configuration_of(found, q)
        solutions = ik_of_configuration(found, vector)
        np.testing.assert_allclose(configuration_of(found, solutions) - vector, 0, atol=1e-6)
        assert np.abs(solutions - q).max(axis=1).min() < 1e-5


@pytest.mark.parametrize("name", sampled(WITH_ROLL))
def test_a_vector_typed_with_four_digits_is_found(name, configurations) -> None:
    found = arm(name)
    for q in configurations(found, 3):
        vector = configuration_of(found, q)
        solutions = ik_of_configuration(found, np.round(vector, 5))
        np.testing.assert_allclose(configuration_of(found, solutions) - vector, 0, atol=2e-4)
        assert np.abs(solutions - q).max(axis=1).min() < 2e-2


def test_a_vector_that_an_arm_with_five_joints_cannot_have_is_refused() -> None:
    q = np.radians([30, 10, -20, 100, 40])
    vector = configuration_of(arm("rv-m1"), q)
    aside = np.array([-sin(q[0]), cos(q[0]), 0])
    with pytest.raises(Unreachable):
        ik_of_configuration(arm("rv-m1"), vector + np.concatenate([np.zeros(3), 0.01 * aside]))


@pytest.mark.parametrize("name", ["theta-r", "theta1-theta2", "anthropomorphic", "leg", "cartesian"])
def test_an_arm_whose_last_joint_does_not_roll_the_tool_has_no_vector(name: str) -> None:
    assert not has_roll(arm(name))
    with pytest.raises(InputError, match="its last joint does not roll the tool"):
        configuration_of(arm(name), arm(name).home)


def test_a_tool_beside_the_axis_is_not_rolled() -> None:
    assert not has_roll(replace(arm("scara"), tool=FixedFrame(x=0.02)))
    assert has_roll(replace(arm("scara"), tool=FixedFrame(z=0.02)))


def test_a_roll_beyond_the_limits_a_vector_without_approach_and_a_far_point_are_refused() -> None:
    scara = arm("scara")
    beyond = [0.4, 0.3, 0.3, 0, 0, -exp(1.5)]
    with pytest.raises(InputError, match=r"q4 would have to roll the tool to 270\.000°"):
        ik_of_configuration(scara, beyond)
    with pytest.raises(InputError, match="approach vector that is not zero"):
        ik_of_configuration(scara, [0.4, 0.3, 0.3, 0, 0, 0])
    with pytest.raises(Unreachable):
        ik_of_configuration(scara, [0.9, 0.3, 0.3, 0, 0, -1])
    with pytest.raises(Unreachable):
        ik_of_configuration(scara, [0.4, 0.3, 0.3, 0, 0, 1])
