"""An arm's file value by value: units, defaults, limits from both sides, what `like` takes over."""

from __future__ import annotations

import math

import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm, robot, robot_of
from servogen.robot.model import Arm, FixedFrame, Length
from servogen.toml import file as toml_file

ONE = """name = "a"
convention = "standard"
{more}
[[joint]]
name = "q"
{joint}
[[row]]
joint = "q"
{row}
"""


def read(text: str) -> Arm:
    found = robot_of(toml_file.parse(text, "a.toml"))
    assert isinstance(found, Arm)
    return found


def one(joint: str = "", row: str = "", more: str = "") -> Arm:
    return read(ONE.format(joint=joint, row=row, more=more))


def refusal(text: str) -> str:
    with pytest.raises(InputError) as caught:
        read(text)
    return str(caught.value).split("error: ", 1)[1]


def test_a_turning_joint_has_its_limits_or_a_full_turn_and_rests_at_zero_if_it_may() -> None:
    for joint, expected in [
        ("", (-180, 180, 0, None)),
        ("lower_deg = 10", (10, 180, 10, None)),
        ("upper_deg = -20", (-180, -20, -20, None)),
        ("lower_deg = -30\nupper_deg = 40", (-30, 40, 0, None)),
        ("lower_deg = -30\nupper_deg = 40\nhome_deg = -30\nspeed_deg_s = 90", (-30, 40, -30, 90)),
        ("lower_deg = -30\nupper_deg = 40\nhome_deg = 40", (-30, 40, 40, None)),
    ]:
        (found,) = one(joint).joints
        lower, upper, home, speed = expected
        assert (found.kind, found.turning) == ("turning", True)
        assert [math.degrees(each) for each in (found.lower, found.upper, found.home)] == pytest.approx(
            [lower, upper, home]
        )
        assert found.speed == (None if speed is None else pytest.approx(math.radians(speed)))


def test_a_sliding_joint_is_in_metres_and_rests_at_its_lower_limit() -> None:
    for home, rests in [("", 0.01), ("home_mm = 25", 0.025), ("home_mm = 30", 0.03)]:
        (found,) = one(f'kind = "sliding"\nlower_mm = 10\nupper_mm = 30\nspeed_mm_s = 50\n{home}').joints
        assert (found.lower, found.upper, found.home, found.speed) == pytest.approx((0.01, 0.03, rests, 0.05))


def test_a_joint_that_cannot_be_is_refused_at_its_key() -> None:
    for joint, said in [
        ("lower_deg = 40\nupper_deg = 40", "joint[1]: the limits of 'q' are not in order: lower < upper"),
        ("home_deg = 180.001", "joint[1].home_deg: home is outside the limits"),
        ("home_deg = -180.001", "joint[1].home_deg: home is outside the limits"),
        ("lower_mm = 3", "joint[1].lower_mm: the joint 'q' is turning: use deg"),
        ("speed_mm_s = 3", "joint[1].speed_mm_s: the joint 'q' is turning: use deg"),
        (
            'kind = "sliding"\nlower_mm = 1\nupper_mm = 2\nhome_deg = 1',
            "joint[1].home_deg: the joint 'q' is sliding: use mm",
        ),
        (
            'kind = "sliding"\nlower_mm = 1\nupper_mm = 2\nspeed_deg_s = 1',
            "joint[1].speed_deg_s: the joint 'q' is sliding",
        ),
        ('kind = "sliding"\nlower_mm = 1', "joint[1]: 'upper_mm' is missing"),
        ('kind = "sliding"\nupper_mm = 1', "joint[1]: 'lower_mm' is missing"),
        ("centre_of_mass_mm = [1, 2, 3]", "joint[1].centre_of_mass_mm: the joint 'q' has no mass"),
        (
            "mass_g = 0\ncentre_of_mass_mm = [1, 2, 3]",
            "joint[1].centre_of_mass_mm: the joint 'q' has no mass",
        ),
    ]:
        assert refusal(ONE.format(joint=joint, row="", more="")).startswith(said)


def test_masses_are_in_kilograms_at_their_centres() -> None:
    found = one("mass_g = 250\ncentre_of_mass_mm = [10, -20, 30]", more="payload_g = 120")
    assert (found.joints[0].mass, found.payload) == (0.25, 0.12)
    assert found.joints[0].centre == pytest.approx((0.01, -0.02, 0.03))
    bare = one("mass_g = 250")
    assert (bare.joints[0].centre, bare.payload) == ((0.0, 0.0, 0.0), 0.0)


def test_a_length_of_a_row_is_a_sum_of_names_and_millimetres() -> None:
    for text, length in [
        ("40", Length((), 0.04)),
        ('"40"', Length((), 0.04)),
        ('"-40.5"', Length((), -0.0405)),
        ('"4e1"', Length((), 0.04)),
        ('"l1"', Length((("l1", 1.0),))),
        ('"-l1+ l2"', Length((("l1", -1.0), ("l2", 1.0)))),
        ('"l2 - 3 + 1 + l1"', Length((("l2", 1.0), ("l1", 1.0)), -0.002)),
    ]:
        found = one(row=f"a_mm = {text}\nd_mm = {text}", more="lengths_mm = { l1 = 12, l2 = 30.5 }")
        for each in (found.rows[0].a, found.rows[0].d):
            assert each.terms == length.terms
            assert each.constant == pytest.approx(length.constant)
        assert found.length == pytest.approx({"l1": 0.012, "l2": 0.0305})


def test_other_texts_are_not_lengths() -> None:
    for text in ["l1 l2", "40 l1", "l1 +", "l1 ++ l2", "1,5", "*", "+"]:
        said = refusal(ONE.format(joint="", row=f'a_mm = "{text}"', more="lengths_mm = { l1 = 12, l2 = 30 }"))
        assert said.startswith(f'row[1].a_mm: "{text}" is not a length')
        said = refusal(ONE.format(joint="", row='d_mm = "l3"', more="lengths_mm = { l1 = 12 }"))
        assert said.startswith("row[1].d_mm: no length 'l3' in [lengths_mm]")


def test_a_row_that_its_joint_does_not_move_is_refused() -> None:
    said = refusal(ONE.format(joint="", row="ratio = 0.0", more=""))
    assert said == "row[1].ratio: a joint does not move a row of ratio 0 [out-of-range]\n  leave out joint"


def test_rows_frames_and_facts_are_in_radians_and_metres() -> None:
    text = ONE.format(
        joint="", row="theta_deg = 30\nalpha_deg = -90\nratio = -0.5", more='title = "T"\nsource = "S"'
    )
    text += "[base]\nx_mm = 1\ny_mm = 2\nz_mm = 3\n[tool]\nrx_deg = 10\nry_deg = 20\nrz_deg = 30\n"
    found = read(text)
    (row,) = found.rows
    assert (row.theta, row.alpha, row.ratio, row.joint) == (
        pytest.approx(math.pi / 6),
        pytest.approx(-math.pi / 2),
        -0.5,
        0,
    )
    assert found.base == FixedFrame(0.001, 0.002, 0.003)
    assert (found.tool.rx, found.tool.ry, found.tool.rz) == pytest.approx(
        [math.radians(each) for each in (10, 20, 30)]
    )
    assert (found.title, found.source, found.dimensions, found.convention) == ("T", "S", "user", "standard")
    assert one().tool == one().base == FixedFrame()


LIKE = 'name = "mine"\nlike = "rv-m1"\n'


def test_an_arm_like_another_keeps_all_that_its_file_does_not_state() -> None:
    model, found = arm("rv-m1"), read(LIKE)
    assert (found.name, found.title, found.source) == ("mine", model.title, model.source)
    assert (found.joints, found.rows, found.lengths, found.dimensions) == (
        model.joints,
        model.rows,
        model.lengths,
        model.dimensions,
    )
    assert (found.closed_form, found.orientation, found.base, found.tool, found.payload) == (
        model.closed_form, model.orientation, model.base, model.tool, model.payload,
    )  # fmt: skip
    own = read(
        LIKE
        + 'title = "T"\nsource = "S"\npayload_g = 300\n[lengths_mm]\nd1 = 350\n'
        + "[tool]\nz_mm = 40\n[base]\nx_mm = 5\n"
    )
    assert (own.title, own.source, own.dimensions, own.payload) == ("T", "S", "user", 0.3)
    assert own.length == model.length | {"d1": 0.35}
    assert (own.tool, own.base) == (FixedFrame(z=0.04), FixedFrame(x=0.005))


def test_a_joint_like_another_s_keeps_what_is_not_stated_and_its_home_if_it_can() -> None:
    model = arm("rv-m1").joints[0]  # -60° to 240°, home 90°
    narrow = read(LIKE + '[[joint]]\nname = "q1"\nlower_deg = 0\nupper_deg = 90\nspeed_deg_s = 10\n').joints[
        0
    ]
    assert [math.degrees(each) for each in (narrow.lower, narrow.upper, narrow.home)] == pytest.approx(
        [0, 90, 90]
    )
    assert narrow.speed == pytest.approx(math.radians(10))
    below = read(LIKE + '[[joint]]\nname = "q1"\nupper_deg = 60\nmass_g = 100\n').joints[0]
    assert [math.degrees(each) for each in (below.lower, below.upper, below.home)] == pytest.approx(
        [-60, 60, 0]
    )
    assert (below.speed, below.mass, below.centre) == (model.speed, 0.1, model.centre)
    rest = read(LIKE + '[[joint]]\nname = "q1"\n').joints
    assert rest == arm("rv-m1").joints
    for text, said in (
        ('[[joint]]\nname = "q9"\n', "joint[1].name: 'rv-m1' has no joint 'q9'"),
        (
            '[[joint]]\nname = "q1"\nkind = "sliding"\nlower_mm = 1\nupper_mm = 2\n',
            "joint[1].kind: the joint 'q1' is turning",
        ),
        ('convention = "standard"\n', "convention: 'convention' is already taken from 'rv-m1'"),
        ('closed_form = "scara"\n', "closed_form: 'closed_form' is already taken from 'rv-m1'"),
        ("[lengths_mm]\nd1_mm = 3\n", "lengths_mm.d1_mm: 'rv-m1' has no length 'd1_mm'"),
    ):
        assert refusal(LIKE + text).startswith(said)
    assert refusal('name = "m"\nlike = "omni"\n').startswith("like: 'omni' is not an arm")


def test_a_file_that_is_not_an_arm_is_refused() -> None:
    for text, said in [
        ('name = "a"\n', "'convention' is missing"),
        ('name = "a"\nconvention = "standard"\n', "'joint' is missing"),
        (
            ONE.format(joint="", row="", more="") + '[[joint]]\nname = "r"\n',
            "joint[2]: no row uses the joint 'r'",
        ),
        (
            ONE.format(joint="", row="", more="") + '[[joint]]\nname = "q"\n',
            "joint[2].name: the name 'q' is used twice",
        ),
        (ONE.format(joint="", row='[[row]]\njoint = "z"', more=""), "row[2].joint: no joint 'z'"),
        ('kind = "boat"\nname = "a"\n', 'kind: "boat" is not allowed here'),
        ('name = "a"\nmount = []\n', "mount: 'mount' belongs in a file of kind = \"hexapod\", not of arm"),
    ]:
        assert refusal(text).startswith(said)


def test_robots_have_other_names_and_paths() -> None:
    assert robot("six-legged") is robot("hexapod")
    assert robot("RV_M1") is robot("rv-m1")
    for name in ("none.toml", "none.urdf", "none.TOML"):
        with pytest.raises(InputError, match="cannot be read"):
            robot(name)
    with pytest.raises(InputError, match="unknown robot 'none'"):
        robot("none")
