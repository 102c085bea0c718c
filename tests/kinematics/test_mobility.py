"""Mobility by Kutzbach and Grübler."""

import pytest

from servogen.errors import InputError
from servogen.kinematics import mobility as m
from servogen.kinematics.catalogue import arm, robot
from servogen.kinematics.registry import KINDS


def of_robot(name: str) -> m.Mobility:
    found = robot(name)
    return KINDS[found.kind].mobility(found)


def test_the_scara_has_five_elements_four_joints_and_four_degrees_of_freedom() -> None:
    found = m.of_arm(arm("scara"))
    assert (found.elements, len(found.joints), found.mobility) == (5, 4, 4)
    assert (found.manoeuvrability, found.verdict) == (-2, "deficient")


@pytest.mark.parametrize(
    ("name", "mobility", "verdict"),
    [("rv-m1", 5, "deficient"), ("irb6400c", 6, "exact"), ("leg", 2, "deficient"), ("omni", 3, "deficient")],
)
def test_the_mobility_of_other_robots(name: str, mobility: int, verdict: str) -> None:
    found = of_robot(name)
    assert (found.mobility, found.verdict) == (mobility, verdict)


def test_a_serial_robot_has_the_sum_of_its_joints(any_arm) -> None:
    assert m.of_arm(any_arm).mobility == len(any_arm.joints)


def test_six_legs_of_two_joints_have_twelve() -> None:
    assert of_robot("hexapod").mobility == 12


def test_the_mobilities_of_the_joints() -> None:
    one = {kind for kind, value in m.JOINT_MOBILITY.items() if value == 1}
    assert one == {"turning", "sliding", "screw"}
    assert (
        m.JOINT_MOBILITY["cylindrical"],
        m.JOINT_MOBILITY["universal"],
        m.JOINT_MOBILITY["spherical"],
    ) == (
        2,
        2,
        3,
    )


def test_a_mechanism_of_elements_and_joints_names_its_closed_loops() -> None:
    four_bar = m.of_mechanism(4, ["turning"] * 4, plane=True)
    assert (four_bar.mobility, four_bar.closed_loops, four_bar.manoeuvrability) == (1, 1, -5)
    slider_crank = m.of_mechanism(4, ["turning"] * 3 + ["sliding"], plane=True)
    assert slider_crank.mobility == 1
    # the same four bars counted in space: 6 (4 - 1 - 4) + 4
    in_space = m.of_mechanism(4, ["turning"] * 4)
    assert in_space.mobility == -2
    assert "count such a mechanism in the plane" in in_space.note
    # a body on three legs with two turning joints each, its feet spherical joints: 6 (8 - 1 - 9) + 6 + 9
    standing = m.of_mechanism(8, ["turning"] * 6 + ["spherical"] * 3)
    assert (standing.mobility, standing.closed_loops) == (3, 2)
    assert (m.of_mechanism(5, ["turning"] * 3 + ["screw"]).mobility, m.of_mechanism(1, []).mobility) == (4, 0)


@pytest.mark.parametrize(
    ("elements", "joints", "plane", "message"),
    [
        (5, ["turning"] * 3, False, "3 joints do not connect 5 elements"),
        (3, ["turning", "spherical"], True, "a spherical joint cannot be part of a plane mechanism"),
        (2, ["truning"], True, "unknown kind of joint 'truning'"),
        (0, [], False, "at least one element"),
    ],
)
def test_what_is_not_a_mechanism_is_refused(
    elements: int, joints: list[str], plane: bool, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        m.of_mechanism(elements, joints, plane=plane)


def test_a_platform_on_six_legs_moves_in_all_six_ways() -> None:
    legs = ["universal", "sliding", "spherical"] * 6
    assert m.kutzbach(14, legs) == 6


def test_a_redundant_arm() -> None:
    assert m.verdict(m.manoeuvrability(m.kutzbach(8, ["turning"] * 7))) == "redundant"
