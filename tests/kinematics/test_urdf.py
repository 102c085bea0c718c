"""URDF: out and back gives the same arm; what is no serial chain is refused."""

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk
from servogen.kinematics.urdf import from_urdf, to_urdf

pytest.importorskip("urdf_parser_py")


def test_every_arm_and_the_leg_come_back(any_arm, configurations) -> None:
    again = from_urdf(to_urdf(any_arm), "arm.urdf")
    assert [joint.name for joint in again.joints] == [joint.name for joint in any_arm.joints]
    for joint, other in zip(any_arm.joints, again.joints, strict=True):
        assert (joint.kind, joint.speed) == (other.kind, other.speed)
        assert (other.lower, other.upper) == pytest.approx((joint.lower, joint.upper))
    q = configurations(any_arm, 100)
    np.testing.assert_allclose(fk(again, q), fk(any_arm, q), atol=1e-11)


LINKS = '<link name="base"/><link name="upper"/><link name="hand"/>'
SHOULDER = """<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
  <origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="2" effort="5" velocity="3"/></joint>"""
SLIDE = """<joint name="slide" type="prismatic"><parent link="upper"/><child link="hand"/>
  <origin xyz="0.2 0 0" rpy="0 0 0"/><axis xyz="2 0 0"/>
  <limit lower="0" upper="0.1" effort="5" velocity="3"/></joint>"""


def robot(*parts: str) -> str:
    return f'<robot name="made">{"".join(parts)}</robot>'


def test_a_description_written_by_hand() -> None:
    found = from_urdf(robot(LINKS, SHOULDER, SLIDE), "made.urdf")
    assert [(joint.name, joint.kind, joint.lower, joint.upper, joint.speed) for joint in found.joints] == [
        ("shoulder", "turning", -1, 2, 3),
        ("slide", "sliding", 0, 0.1, 3),
    ]
    angle, out = 0.4, 0.05
    expected = [0.25 * np.cos(angle), 0, 0.3 - 0.25 * np.sin(angle)]
    assert fk(found, [angle, out])[:3, 3] == pytest.approx(expected)


def test_a_fixed_joint_belongs_to_the_link() -> None:
    fixed = SLIDE.replace("prismatic", "fixed")
    found = from_urdf(robot(LINKS, SHOULDER, fixed), "made.urdf")
    assert fk(found, [0.0])[:3, 3] == pytest.approx([0.2, 0, 0.3])


def test_a_joint_that_mimics_becomes_a_row_with_a_ratio() -> None:
    mimic = SHOULDER.replace("shoulder", "elbow").replace('"base"', '"old"').replace('"upper"/>', '"hand"/>')
    mimic = mimic.replace('"old"', '"upper"').replace(
        "</joint>", '<mimic joint="shoulder" multiplier="-2" offset="0.1"/></joint>'
    )
    found = from_urdf(robot(LINKS, SHOULDER, mimic), "made.urdf")
    assert [row.ratio for row in found.rows] == [1, -2]
    turn = 0.3 + (-2 * 0.3 + 0.1)
    assert fk(found, [0.3])[0, 0] == pytest.approx(np.cos(turn))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot", "is not a URDF file"),
        ('<robot name="made"><link/></robot>', "is not a URDF file"),
        (robot('<link name="base"/>'), "no joints that move"),
        (robot(LINKS, SHOULDER), "ends in upper, hand"),
        (robot(LINKS, SHOULDER, SLIDE.replace("prismatic", "floating")), "is floating"),
        (robot(LINKS, SHOULDER.replace('upper="2"', 'upper="-2"'), SLIDE), "are not in order"),
    ],
)
def test_what_is_no_serial_arm_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        from_urdf(text, "made.urdf")


def test_a_tip_chooses_the_chain_of_a_tree() -> None:
    text = robot(
        LINKS, '<link name="other"/>', SHOULDER, SLIDE, SLIDE.replace("slide", "s2").replace("hand", "other")
    )
    with pytest.raises(InputError, match=r"hand, other[\s\S]*name the tip"):
        from_urdf(text, "tree.urdf")
    assert [joint.name for joint in from_urdf(text, "tree.urdf", "other").joints] == ["shoulder", "s2"]
    with pytest.raises(InputError, match="no link 'ohter'"):
        from_urdf(text, "tree.urdf", "ohter")


@pytest.mark.parametrize(("number", "said"), [("nan", "nan"), ("inf", "inf"), ("-1e7", "-10000000.0")])
@pytest.mark.parametrize("place", ["xyz", "rpy", "axis", "lower"])
def test_numbers_that_no_robot_has_are_refused(number: str, said: str, place: str) -> None:
    text = to_urdf(arm("wrist-arm"))
    marks = {"xyz": 'xyz="', "rpy": 'rpy="', "axis": '<axis xyz="', "lower": 'lower="'}
    head, mark, tail = text.partition(marks[place])
    end = min(tail.index(sign) for sign in ' "' if sign in tail)
    with pytest.raises(InputError, match=f"has the number {said} .*\n  numbers are finite"):
        from_urdf(f"{head}{mark}{number}{tail[end:]}", "made.urdf")
