"""URDF: out and back gives the same arm; what is no serial chain is refused."""

import re
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import loads
from servogen.kinematics import catalogue, urdf
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk
from servogen.kinematics.transforms import rot
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


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_bytes(b"<robot name='\xff'/>")
    with pytest.raises(InputError) as caught:
        arm(str(path))
    assert str(caught.value) == f"{path}: error: is not UTF-8 text [not-utf8]"


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


def test_a_file_may_be_like_a_urdf_file_beside_it_with_other_limits_and_homes(tmp_path: Path) -> None:
    (tmp_path / "two.urdf").write_text(robot(LINKS, '<link name="jaw"/>', SHOULDER, SLIDE, JAW))
    own = tmp_path / "own.toml"
    joint = '[[joint]]\nname = "shoulder"\nupper_deg = 60\nhome_deg = 20\n'
    own.write_text(f'name = "own"\nlike = "two.urdf#hand"\n{joint}')
    found, whole = arm(str(own)), arm(f"{tmp_path / 'two.urdf'}#hand")
    q = np.array([0.4, 0.05])
    np.testing.assert_allclose(fk(found, q), fk(whole, q), atol=1e-12)
    shoulder, slide = found.joints
    assert (shoulder.lower, shoulder.upper, shoulder.home) == pytest.approx(
        (-1, np.radians(60), np.radians(20))
    )
    assert slide == whole.joints[1]
    own.write_text('name = "own"\nlike = "two.urdf"\n')
    with pytest.raises(InputError, match="it ends in hand, jaw") as error:
        arm(str(own))
    assert error.value.location is not None and (error.value.location.line, error.value.location.key) == (
        2,
        "like",
    )


JAW = """<joint name="grip" type="revolute"><parent link="upper"/><child link="jaw"/>
  <limit lower="0" upper="1" effort="5" velocity="3"/></joint>"""


def joint_of(text: str) -> tuple[float, float, float, float | None]:
    """Return the limits, home and speed of the only joint of a chain."""
    parts = LINKS.replace('<link name="hand"/>', ""), text.replace('"hand"', '"upper"').replace("slide", "j")
    (joint,) = from_urdf(
        robot(*parts).replace('<parent link="upper"', '<parent link="base"'), "j.urdf"
    ).joints
    return joint.lower, joint.upper, joint.home, joint.speed


def test_the_limits_home_and_speed_of_each_kind_of_joint() -> None:
    """A turning joint rests at 0 if it may, a sliding one at its lower end; what is not stated is 0."""
    limit = '<limit lower="-1" upper="2" effort="5" velocity="3"/>'
    assert joint_of(SHOULDER) == (-1, 2, 0, 3)
    assert joint_of(SHOULDER.replace('lower="-1"', 'lower="0.5"')) == (0.5, 2, 0.5, 3)
    assert joint_of(SHOULDER.replace('upper="2"', 'upper="-0.5"')) == (-1, -0.5, -0.5, 3)
    assert joint_of(SHOULDER.replace(' lower="-1"', "")) == (0, 2, 0, 3)
    assert joint_of(SHOULDER.replace(' upper="2"', "")) == (-1, 0, 0, 3)
    assert joint_of(SHOULDER.replace('velocity="3"', 'velocity="0"')) == (-1, 2, 0, None)
    assert joint_of(SLIDE.replace('lower="0"', 'lower="-0.1"')) == (-0.1, 0.1, -0.1, 3)
    endless = SHOULDER.replace("revolute", "continuous")
    assert joint_of(endless) == (-np.pi, np.pi, 0, 3)
    assert joint_of(endless.replace(limit, "")) == (-np.pi, np.pi, 0, None)
    assert joint_of(SHOULDER.replace(limit, "")) == (-np.pi, np.pi, 0, None)
    with pytest.raises(InputError, match="the sliding joint 'slide' has no limits"):
        from_urdf(robot(LINKS, SHOULDER, re.sub("<limit[^>]*>", "", SLIDE)), "made.urdf")
    with pytest.raises(InputError, match=r"the limits of 'j' are not in order: 2\.0 to 2\.0"):
        joint_of(SHOULDER.replace('lower="-1"', 'lower="2"').replace('"shoulder"', '"j"'))


def test_a_continuous_joint_keeps_its_type_and_an_unset_speed_is_not_0() -> None:
    """Written and read again: no limits; no number below 1e6 for a speed and an effort that nobody stated."""
    endless = re.sub("<limit[^>]*>", "", SHOULDER.replace("revolute", "continuous"))
    slow = SLIDE.replace('velocity="3"', 'velocity="0"')
    found = from_urdf(robot(LINKS, endless, slow), "made.urdf")
    text = to_urdf(found)
    assert [joint.continuous for joint in found.joints] == [True, False]
    assert text.count('type="continuous"') == 1 and 'type="revolute"' not in text
    assert text.count("<limit") == 1
    assert re.findall(r'(?:velocity|effort)="([^"]*)"', text) == ["1000000.0", "1000000.0"]
    again = from_urdf(text, "again.urdf").joints
    assert [(joint.continuous, joint.speed) for joint in again] == [(True, None), (False, None)]
    fast = from_urdf(robot(LINKS, SHOULDER.replace("revolute", "continuous"), SLIDE), "made.urdf")
    assert [joint.speed for joint in from_urdf(to_urdf(fast), "again.urdf").joints] == [3, 3]


def test_what_a_description_does_not_state_is_the_identity_and_the_axis_x() -> None:
    bare = re.sub("<origin[^>]*>|<axis[^>]*>", "", SHOULDER)
    found = from_urdf(robot(LINKS, bare, SLIDE), "made.urdf")
    assert fk(found, [0.5, 0.0])[:3, 1] == pytest.approx([0, np.cos(0.5), np.sin(0.5)])
    assert fk(found, [0.5, 0.0])[:3, 3] == pytest.approx([0.2, 0, 0])
    turned = SHOULDER.replace('rpy="0 0 0"', 'rpy="0.1 0.2 0.3"')
    pose = fk(from_urdf(robot(LINKS, turned, SLIDE), "made.urdf"), [0.0, 0.0])
    assert pose[:3, :3] == pytest.approx(rot("z", 0.3) @ rot("y", 0.2) @ rot("x", 0.1))


def test_a_joint_may_mimic_only_one_of_the_chain_and_a_loop_is_no_tree() -> None:
    mimic = SLIDE.replace("</joint>", '<mimic joint="other"/></joint>')
    with pytest.raises(InputError, match="'slide' mimics 'other', which is not in the chain"):
        from_urdf(robot(LINKS, SHOULDER, mimic), "made.urdf")
    plain = from_urdf(robot(LINKS, SHOULDER, mimic.replace('"other"', '"shoulder"')), "made.urdf")
    assert [(row.joint, row.ratio) for row in plain.rows] == [(0, 1.0), (0, 1.0)]
    back = SHOULDER.replace("shoulder", "back").replace('"base"', '"hand"').replace('"upper"/>', '"base"/>')
    with pytest.raises(InputError, match="closes a loop"):
        from_urdf(robot(LINKS, SHOULDER, SLIDE, back), "made.urdf", "hand")


def test_as_many_joints_as_are_allowed_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(urdf, "MAX_JOINTS", 2)
    assert len(from_urdf(robot(LINKS, SHOULDER, SLIDE), "made.urdf").joints) == 2
    monkeypatch.setattr(urdf, "MAX_JOINTS", 1)
    with pytest.raises(InputError, match="has 2 joints") as caught:
        from_urdf(robot(LINKS, SHOULDER, SLIDE), "made.urdf")
    assert caught.value.hint == "at most 1"


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
    with pytest.raises(InputError, match=r"hand, other[\s\S]*name the link at the tip"):
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


def test_the_tip_of_a_tree_is_named_behind_its_file(tmp_path: Path) -> None:
    """At the command line and in a job alike: the name of a robot is one text."""
    other = SLIDE.replace("slide", "grip").replace('"hand"', '"finger"')
    links = LINKS + '<link name="finger"/>'
    (tmp_path / "two.urdf").write_text(robot(links, SHOULDER, SLIDE, other))
    path = str(tmp_path / "two.urdf")
    with pytest.raises(InputError, match=r"it ends in .*\n.*name the link at the tip behind the file: .*#"):
        catalogue.robot(path)
    for tip, joint in (("hand", "slide"), ("finger", "grip")):
        assert [each.name for each in catalogue.arm(f"{path}#{tip}").joints] == ["shoulder", joint]
    with pytest.raises(InputError, match="no link 'hnd'"):
        catalogue.robot(f"{path}#hnd")
    servos = "".join(
        f'[[servo]]\nname = "{joint}"\npin = "RB{pin}"\nmodel = "futaba-s3001"\njoint = "{joint}"\n{ratio}\n'
        for pin, joint, ratio in ((0, "shoulder", ""), (1, "grip", "deg_per_mm = 1\nzero_deg = 0"))
    )
    job = '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n[robot]\nname = "two.urdf#finger"\n' + servos
    poses = "[motion]\nposes = [{ shoulder_deg = 90, grip_deg = 0, hold_s = 1 }]\n"
    assert loads(job + poses, str(tmp_path / "job.toml")).robot == catalogue.robot(f"{path}#finger")
