"""Transforms, orientations, legs, mobility and URDF at the ends of what they take, by second formulations."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from servogen.errors import InputError, Location, ToolError
from servogen.kinematics import mobility as mob
from servogen.kinematics import orientation as o
from servogen.kinematics import queries as q
from servogen.kinematics import transforms as t
from servogen.kinematics.arm import arm_details, length_text
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk, fk_position, joint_array, link_frames
from servogen.kinematics.inverse.solve import solve
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.jacobian import singularity
from servogen.kinematics.leg import Leg
from servogen.kinematics.symbolic import text_of
from servogen.kinematics.urdf import from_urdf, to_urdf
from servogen.robot.model import Arm, DHRow, FixedFrame, Joint, Length

LEG = Leg(ab=0.03, bc=0.05, cd=0.01, df=0.08)


# ---- a product of transforms ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("Rx(90) )", 8), ("Rx(90) ( Ty(1)", 8), ("  Foo(1)", 3), ("Rx(90) Tx(1e9) Ty(-1000000001)", 16),
        ("Rx(nan)", 1), ("Rot(w, 3)", 1), ("Rot(x)", 1), ("Trans(1, 2, 3, 4)", 1), ("Sx(3)", 1), ("Rw(3)", 1),
        ("Rx(1, 2)", 1), ("inv Rx(3)", 1), ("Ry(30) Qx(5)", 8), ("Ry(30", 1), ("Ry(30) Tx(a)", 8),
        ("Trans(1,2)", 1), ("Rx(inf)", 1),
    ],
)  # fmt: skip
def test_an_error_is_at_the_column_of_its_factor(text: str, column: int) -> None:
    with pytest.raises(InputError, match=f"column {column}") as caught:
        t.parse(text)
    assert caught.value.location == Location(column=column)


@pytest.mark.parametrize(
    ("text", "as_one"),
    [
        ("inv(Rz(30) Tx(5))", "Tx(-5) Rz(-30)"),
        ("(Rz(30) Tx(5))^-1", "Tx(-5) Rz(-30)"),
        ("Rz(30)^-1 * Tx(5) ^ - 1", "Rz(-30) Tx(-5)"),
        ("inv((Rz(30))^-1)", "Rz(30)"),
        ("INV (Tx(5)) · (Ty(1) Tz(2))", "Trans(-5, 1, 2)"),
        ("Rot(Z, 450)", "Rz(90)"),
        ("Trans(1000000000, 0, 0)", "Tx(1000000000)"),
        ("Tx(-1000000000)", "Trans(-1000000000, 0, 0)"),
    ],
)
def test_inverses_and_groups_are_what_they_stand_for(text: str, as_one: str) -> None:
    np.testing.assert_allclose(t.parse(text), t.parse(as_one), atol=1e-12)


def test_a_product_has_a_length_and_a_depth() -> None:
    assert t.parse("Tx(1)" + " " * 9995)[0, 3] == 1
    with pytest.raises(InputError, match="more than 10000 characters"):
        t.parse("Tx(1)" + " " * 9996)
    assert t.parse("(" * 50 + "Tx(1)" + ")" * 50)[0, 3] == 1
    with pytest.raises(InputError, match="nested more than 50 deep"):
        t.parse("(" * 51 + "Tx(1)" + ")" * 51)


@pytest.mark.parametrize("axis", "xyz")
def test_a_rotation_is_the_exponential_of_its_axis(axis: str) -> None:
    """By the series of the matrix exponential."""
    k = t.skew(np.eye(3)["xyz".index(axis)])
    for angle in (-2.0, 0.3, 1.0):
        term = total = np.eye(3)
        for n in range(1, 40):
            term = term @ k * angle / n
            total = total + term
        np.testing.assert_allclose(t.rot(axis, angle), total, atol=1e-14)
        np.testing.assert_allclose(t.rotation(axis, angle)[:3, :3], total, atol=1e-14)


def test_a_frame_turns_about_z_then_y_then_x_and_is_moved() -> None:
    frame = t.frame_matrix(FixedFrame(1.0, 2.0, 3.0, rx=0.1, ry=-0.2, rz=0.3))
    by_hand = t.translation(1, 2, 3) @ t.rotation("z", 0.3) @ t.rotation("y", -0.2) @ t.rotation("x", 0.1)
    np.testing.assert_allclose(frame, by_hand, atol=1e-15)
    right = t.frame_matrix(FixedFrame(rx=math.pi / 2, ry=math.pi, rz=-math.pi / 2))
    assert set(np.abs(right).ravel().tolist()) == {0.0, 1.0}
    exact = [t.exact_cos_sin(angle) for angle in (math.pi / 2 + 1e-14, 1e-14)]
    assert exact[0][0] != 0 and exact[1][1] != 0


def test_a_rotation_is_one_up_to_its_tolerance() -> None:
    for error, tolerance, is_one in ((0.9e-9, None, True), (1.1e-9, None, False), (1.1e-9, 2e-9, True)):
        matrix = np.eye(3) * math.sqrt(1 + error)
        assert t.is_rotation(matrix, *([] if tolerance is None else [tolerance])) == is_one


# ---- orientations ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", o.ORDERS)
def test_both_solutions_of_every_order_give_the_rotation_back(order: str) -> None:
    angles = np.random.default_rng(6).uniform(-3.1, 3.1, (200, 3))
    rotations = o.from_angles(angles, order)
    np.testing.assert_array_equal(o.from_angles(angles, order.lower()), rotations)
    by_hand = t.rot(order[0].lower(), angles[:, 0]) @ t.rot(order[1].lower(), angles[:, 1])
    np.testing.assert_allclose(rotations, by_hand @ t.rot(order[2].lower(), angles[:, 2]), atol=1e-14)
    first, second = o.to_angles(rotations, order), o.to_angles(rotations, order, second=True)
    for found in (first, second):
        np.testing.assert_allclose(o.from_angles(found, order), rotations, atol=1e-13)
        assert (np.abs(found) <= np.pi + 1e-12).all()
    assert (np.abs(t.wrapped(first[:, 0] - second[:, 0])) > 3.1).all()


def test_quaternions_compose_as_rotations_do() -> None:
    """Hamilton's product of the scalar-first quaternions, up to the sign."""
    random = np.random.default_rng(1)
    one, two = (o.from_quaternion(values) for values in random.normal(size=(2, 100, 4)))
    (a, b, c, d), (w, x, y, z) = o.to_quaternion(one).T, o.to_quaternion(two).T
    hamilton = np.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=-1,
    )
    found = o.to_quaternion(one @ two)
    sign = np.sign(np.einsum("ij,ij->i", found, hamilton))[:, None]
    np.testing.assert_allclose(found, sign * hamilton, atol=1e-14)
    assert (found[:, 0] >= 0).all()


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.4, math.pi - 1e-9, math.pi])
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (1, -2, 2), (-1, 1, 0)])
def test_axis_and_angle_and_the_quaternion_are_half_angles(axis: tuple[float, ...], angle: float) -> None:
    unit = np.array(axis, float) / np.linalg.norm(axis)
    rotation = o.from_axis_angle(axis, angle)
    quaternion = o.to_quaternion(rotation)
    expected = np.array([math.cos(angle / 2), *(math.sin(angle / 2) * unit)])
    leading = expected[np.abs(expected) > 1e-12][0]
    np.testing.assert_allclose(quaternion, expected * np.sign(leading), atol=1e-12)
    np.testing.assert_allclose(o.from_quaternion(3 * quaternion), rotation, atol=1e-12)
    found, size = o.to_axis_angle(rotation)
    assert size == pytest.approx(angle, abs=1e-12)
    if angle == 0:
        assert found.tolist() == [0, 0, 1]
    else:
        np.testing.assert_allclose(o.rotation_vector(rotation), size * found, atol=1e-15)
        np.testing.assert_allclose(o.from_axis_angle(found, size), rotation, atol=1e-12)


@pytest.mark.parametrize(
    ("given", "shown"),
    [(0.0, 0.0), (3.0, 3.0), (3.5, 3.5 - 2 * math.pi), (-9.0, -9 + 2 * math.pi), (13.0, 13 - 4 * math.pi)],
)
def test_the_short_way_is_at_most_half_a_turn(given: float, shown: float) -> None:
    assert o.short_way(given) == pytest.approx(shown)


# ---- the leg --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("foot", "reason"),
    [
        ((0, 0.04, -0.1301), "the height must be between -130.000 and -30.000 mm"),
        ((0, 0.04, -0.0299), "the height must be between -130.000 and -30.000 mm"),
        # β = 90°: at -80 mm the foot is √(40² + 50²) from the axis
        ((0.0, 0.06, -0.08),
            "two joints reach a surface only, and at this height the foot is 64.031 mm from the axis of α, "
            "not 60.000 mm"),
        # cos β = (110 - 80)/50: sin β is 0.8
        ((0.03, 0.04, -0.11),
            f"the foot is {1000 * math.hypot(0.04, 0.04):.3f} mm from the axis of α, not 50.000 mm"),
    ],
)  # fmt: skip
def test_a_foot_off_the_leg_s_surface_is_told_where_the_surface_is(
    foot: tuple[float, ...], reason: str
) -> None:
    with pytest.raises(Unreachable) as caught:
        LEG.ik(foot)
    assert reason in caught.value.reason
    assert caught.value.target == foot


def test_a_foot_counts_as_on_the_surface_up_to_a_tolerance() -> None:
    foot = LEG.fk(0.3, 0.7)
    out = np.array([foot[0], foot[1], 0]) / math.hypot(foot[0], foot[1])
    assert not np.isnan(LEG.ik(foot + 0.9e-9 * out)).any()
    assert np.isnan(LEG.solve(foot + 1.1e-9 * out)).all()
    assert not np.isnan(LEG.solve(foot + 0.9e-3 * out, 1e-3)).any()
    with pytest.raises(Unreachable):
        LEG.ik(foot + 1.1e-3 * out, 1e-3)


@pytest.mark.parametrize("height", [-0.13, -0.11, -0.08, -0.03])
def test_beta_at_a_height_is_its_arc_cosine_and_its_ends_are_taken(height: float) -> None:
    assert LEG.fk(0.0, LEG.beta_at(height))[2] == pytest.approx(height)
    for beyond in (-0.130001, -0.029999):
        with pytest.raises(InputError, match=f"no β gives the height {1000 * beyond:.3f} mm") as caught:
            LEG.beta_at(beyond)
        assert caught.value.hint == "this leg's foot is between -130.000 and -30.000 mm"


@pytest.mark.parametrize("bc", [0.03, 0.035, 0.05, 0.0555, 0.07])
@pytest.mark.parametrize("df", [0.0, 0.013, 0.05, 0.083])
def test_the_lowest_and_the_highest_foot_are_reached_whatever_the_rounding_of_their_height(
    bc: float, df: float
) -> None:
    """Within a nanometre, the tolerance of every foot; β is 0 at the lowest and π at the highest."""
    leg = Leg(0.01, bc, 0.02, df)
    for stands in (0.01, 0.02, 0.033, 0.047):
        assert leg.beta_at(-stands + (stands + bc - df)) == math.pi
        assert leg.beta_at(-stands - (bc + df - stands)) == 0
    for away in (0.9e-9, -0.9e-9):
        assert (leg.beta_at(bc - df + away), leg.beta_at(-bc - df + away)) == (math.pi, 0)
    for beyond in (bc - df + 1.1e-9, -bc - df - 1.1e-9, math.nan):
        with pytest.raises(InputError, match="no β gives the height"):
            leg.beta_at(beyond)


def test_above_the_axis_the_nearest_point_is_straight_out() -> None:
    """From (0, 0, -0.3) the lowest circle of the surface: radius 40 mm at -130 mm."""
    assert LEG.nearest([0.0, 0.0, -0.3]) == pytest.approx((0.0, 0.04, -0.13))
    assert LEG.nearest([-0.3, 0.0, -0.08]) == pytest.approx((-math.hypot(0.04, 0.05), 0.0, -0.08))
    assert LEG.torque([0.5, -0.5], [2.0, 4.0]) == pytest.approx(
        [2 * 0.05 * math.sin(0.5), -4 * 0.05 * math.sin(0.5)]
    )


# ---- mobility -------------------------------------------------------------------------------------------


RIGID = "1 closed loop, {constraints} constraints each; rigid, unless some constraints repeat others"


@pytest.mark.parametrize("legs", range(1, 9))
def test_a_standing_body_loses_a_freedom_with_each_leg(legs: int) -> None:
    """6 - m for m legs of two joints on spherical feet, and all six with a spring in each."""
    assert mob.standing(legs, 2) == 6 - legs
    assert mob.standing(legs, 3) == 6


@pytest.mark.parametrize(
    ("elements", "joints", "plane", "freedom", "note"),
    [
        (4, ["turning"] * 3, False, 3, "open chain: the sum of the joints' mobilities"),
        (4, ["turning"] * 4, True, 1, "1 closed loop, 3 constraints each"),
        (3, ["turning"] * 3, True, 0, RIGID.format(constraints=3)),
        (2, ["spherical"] * 2, False, 0, RIGID.format(constraints=6) + ", as those of parallel axes do"),
        (5, ["cylindrical"] * 6, False, 0, "2 closed loops, 6 constraints each; rigid"),
    ],
)
def test_the_mobility_of_a_mechanism_and_what_is_said_about_it(
    elements: int, joints: list[str], plane: bool, freedom: int, note: str
) -> None:
    found = mob.of_mechanism(elements, joints, plane=plane)
    assert (found.mobility, found.manoeuvrability, found.passive) == (freedom, freedom - 6, 0)
    assert found.note.startswith(note)


# ---- forward and inverse kinematics ---------------------------------------------------------------------


def test_joint_positions_are_numbers_one_for_each_joint() -> None:
    scara = arm("scara")
    for wrong in (5.0, [1, 2, 3], [[1, 2, 3, 4, 5]]):
        with pytest.raises(InputError, match="scara has 4 joints, not") as caught:
            joint_array(scara, wrong)
        assert caught.value.hint == "q1, q2, q3, q4"
    with pytest.raises(InputError, match="scara has 4 joints, not 0"):
        fk(scara, 5.0)
    for wrong in (["a"] * 4, [[1, 2], [3]]):
        with pytest.raises(InputError, match="joint positions must be numbers"):
            fk(scara, wrong)


def test_more_poses_than_a_block_are_each_their_own() -> None:
    scara = arm("scara")
    many = np.random.default_rng(3).uniform(0, 0.2, (16_384 + 7, 4))
    poses, points = fk(scara, many), fk_position(scara, many)
    for index in (0, 16_383, 16_384, 16_390):
        np.testing.assert_allclose(poses[index], fk(scara, many[index]), atol=1e-15)
        np.testing.assert_allclose(points[index], poses[index][:3, 3], atol=1e-15)
    assert (poses[:, 3] == [0, 0, 0, 1]).all()
    found = solve(scara, points)
    again = fk_position(scara, found.choose())
    assert np.abs(again - points).max() < 1e-9


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_frames_of_both_conventions_are_the_products_of_their_rows(convention: str) -> None:
    random = np.random.default_rng(5)
    joints = tuple(
        Joint(f"j{i}", kind, -3.0, 3.0, 0.0) for i, kind in enumerate(["turning", "sliding", "turning"])
    )
    theta, d, a, alpha = random.uniform(-2, 2, (4, 5)).tolist()
    follows = ((0, 1.0), (1, -2.0), (2, 0.5), (0, -1.0), (None, 1.0))
    rows = tuple(
        DHRow(theta[i], Length((), d[i]), Length((), a[i]), alpha[i], joint, ratio)
        for i, (joint, ratio) in enumerate(follows)
    )
    robot = Arm(
        "r", "", convention, joints, rows, base=FixedFrame(x=0.1, ry=0.4), tool=FixedFrame(z=0.2, rx=1.0)
    )
    q_ = random.uniform(-1, 1, 3)
    pose, frames = t.frame_matrix(robot.base), [t.frame_matrix(robot.base)]
    for row in rows:
        moved = 0.0 if row.joint is None else row.ratio * q_[row.joint]
        slides = row.joint == 1
        screw = t.rotation("z", row.theta + (0 if slides else moved)) @ t.translation(
            0, 0, row.d.constant + (moved if slides else 0)
        )
        across = t.translation(row.a.constant, 0, 0) @ t.rotation("x", row.alpha)
        pose = pose @ (screw @ across if convention == "standard" else across @ screw)
        frames.append(pose)
    frames.append(pose @ t.frame_matrix(robot.tool))
    np.testing.assert_allclose(link_frames(robot, q_), frames, atol=1e-14)
    np.testing.assert_allclose(fk(robot, q_), frames[-1], atol=1e-14)


def test_a_singularity_is_one_configuration_s() -> None:
    with pytest.raises(InputError, match="one configuration at a time"):
        singularity(arm("scara"), np.zeros((2, 4)))


# ---- answers, details, URDF -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("length", "text"),
    [
        (Length(), "0 mm"),
        (Length((), 0.04), "40 mm"),
        (Length((), -0.0405), "-40.5 mm"),
        (Length((("a", 1.0), ("b", -1.0)), 0.0), "a - b"),
        (Length((("a", -1.0),), 0.04), "-a + 40 mm"),
        (Length((("a", -1.0), ("b", 1.0)), -0.002), "-a + b - 2 mm"),
    ],
)
def test_a_length_is_shown_as_it_is_written(length: Length, text: str) -> None:
    assert length_text(length) == text


def test_the_details_of_an_arm_are_its_file_s() -> None:
    details = arm_details(arm("rv-m1"))
    assert [joint["name"] for joint in details["joints"]] == ["q1", "q2", "q3", "q4", "q5"]
    assert [row["joint"] for row in details["rows"]] == ["q1", "q2", "q3", "q4", "q5"]
    # docs/robots.md, the RV-M1: q1 from -60° to 240°, home 90°
    first = details["joints"][0]
    assert [first[key] for key in ("lower_deg", "upper_deg", "home_deg")] == pytest.approx([-60, 240, 90])
    leg = arm_details(arm("leg"))
    assert [row["joint"] for row in leg["rows"]].count(None) == sum(
        row.joint is None for row in arm("leg").rows
    )
    assert details["target"] == ["x", "y", "z", "pitch", "roll"]
    assert details["base"] == {"position_m": [0, 0, 0], "rz_ry_rx_deg": [0, 0, 0]}


@pytest.mark.parametrize("beyond", [1e9 + 1, -1e9 - 1])
def test_typed_numbers_have_a_limit(beyond: float) -> None:
    assert q.transform_answer("Tx(1)", (1e9, -1e9, 0))["point"] == [1e9 + 1, -1e9, 0]
    with pytest.raises(InputError, match=r"is not a number from -1e\+09 to 1e\+09"):
        q.transform_answer("Tx(1)", (0, 0, beyond))


@pytest.mark.parametrize(("text", "count"), [("turning", 1), ("turning:1", 1), ("turning:1000", 1000)])
def test_joints_of_a_mechanism_are_counted_up_to_a_thousand(text: str, count: int) -> None:
    assert len(q.mechanism_answer(count + 1, [text])["joints"]) == count
    for wrong in ("turning:0", "turning:1001", "turning:99999999"):
        with pytest.raises(InputError, match="is not 1 to 1000 joints"):
            q.mechanism_answer(2, [wrong])


@pytest.mark.parametrize(("axis", "kind"), [("z", "revolute"), ("z", "prismatic")])
def test_urdf_keeps_limits_speed_and_ratio(axis: str, kind: str) -> None:
    pytest.importorskip("urdf_parser_py")
    turning = kind == "revolute"
    joint = Joint("j", "turning" if turning else "sliding", -0.5, 1.5, 0.0, speed=2.0)
    rows = (
        DHRow(0.3, Length((), 0.2), Length((), 0.1), 0.4, 0),
        DHRow(0.1, Length(), Length((), 0.3), 0.0, 0, -0.5),
    )
    text = to_urdf(Arm("two", "", "standard", (joint,), rows))
    assert f'type="{kind}"' in text
    limits = re.findall(r"<limit ([^>]*?)/?>", text)
    numbers = [{key: float(value) for key, value in re.findall(r'(\w+)="([^"]+)"', each)} for each in limits]
    own, follower = numbers
    assert (own["lower"], own["upper"], own["velocity"]) == (-0.5, 1.5, 2.0)
    # the follower turns the other way by half: its ends are exchanged
    assert (follower["lower"], follower["upper"], follower["velocity"]) == (-0.75, 0.25, 1.0)
    assert re.search(r'<mimic[^>]*multiplier="-0\.5"', text)
    back = from_urdf(text, "two.urdf")
    for value in (-0.4, 0.0, 1.2):
        np.testing.assert_allclose(
            fk(back, [value]), fk(Arm("two", "", "standard", (joint,), rows), [value]), atol=1e-12
        )
    with pytest.raises(InputError, match=r"the first row of 'j' has the ratio -0\.5, URDF needs 1"):
        to_urdf(Arm("two", "", "standard", (joint,), rows[::-1]))


def described(kind: str, inside: str, links: int = 2) -> str:
    """A robot of links a, b, … of which each is moved by a joint of this kind, the last one as stated."""
    names = "abcdefg"[:links]
    plain = '<limit lower="0" upper="1" effort="1" velocity="1"/>'
    parts = [f'<link name="{name}"/>' for name in names]
    for parent, child in pairwise(names):
        parts.append(
            f'<joint name="{parent}{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f"{inside if child == names[-1] else plain}</joint>"
        )
    return f'<robot name="r">{"".join(parts)}</robot>'


@pytest.mark.parametrize(
    ("kind", "inside", "message"),
    [
        ("revolute", '<limit lower="-1000001" upper="1" effort="1" velocity="1"/>',
            "has the number -1000001.0"),
        ("revolute", '<limit lower="0" upper="1" effort="1" velocity="1000001"/>',
            "has the number 1000001.0"),
        ("revolute", '<origin xyz="0 0 1000001"/>', "has the number 1000001.0"),
        ("revolute", '<mimic joint="zz" multiplier="1000001"/>', "has the number 1000001.0"),
        ("revolute", '<mimic joint="zz" offset="1000001"/>', "has the number 1000001.0"),
    ],
)  # fmt: skip
def test_a_urdf_joint_that_cannot_be_is_refused(kind: str, inside: str, message: str) -> None:
    pytest.importorskip("urdf_parser_py")
    with pytest.raises(InputError, match=re.escape(message)):
        from_urdf(described(kind, inside), "r.urdf")


def test_a_urdf_number_may_be_a_million() -> None:
    pytest.importorskip("urdf_parser_py")
    far = described(
        "revolute", '<origin xyz="0 0 1000000"/><limit lower="0" upper="1" effort="1" velocity="1"/>'
    )
    assert fk_position(from_urdf(far, "r.urdf"), [0.0])[2] == pytest.approx(1e6)


@pytest.mark.parametrize(
    ("module", "call", "extra"),
    [("urdf_parser_py", lambda: to_urdf(arm("leg")), "urdf"), ("sympy", lambda: text_of(1), "symbolic")],
)
def test_a_missing_library_is_named_with_its_extra(
    module: str, call: Callable[[], object], extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ToolError) as caught:
        call()
    assert (caught.value.code, caught.value.hint) == ("tool-missing", f"pip install 'servogen[{extra}]'")
