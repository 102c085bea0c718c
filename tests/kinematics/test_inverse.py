"""Inverse kinematics: every solution, limits, the choice rule, what cannot be reached and why."""

import re
from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk, fk_position
from servogen.kinematics.inverse import numerical
from servogen.kinematics.inverse.closed_forms import TargetComponents, spherical, wrist_joints
from servogen.kinematics.inverse.solve import (
    Solutions,
    free_joints,
    ik,
    ik_all,
    nearest_point,
    solve,
    sorted_without_doubles,
)
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.orientation import orientation_matrix
from servogen.kinematics.transforms import wrapped
from servogen.robot.model import Arm, FixedFrame

ROBOTS = Path(__file__).parents[2] / "docs" / "robots.md"


def is_among(q: np.ndarray, solutions: np.ndarray, turning: list[bool]) -> np.ndarray:
    apart = solutions - q[..., None, :]
    apart = np.abs(np.where(turning, wrapped(apart), apart)).max(axis=-1)
    return np.nanmin(apart, axis=-1) < 1e-5


def with_wrist_at_home(found: Arm, q: np.ndarray) -> np.ndarray:
    free = len(found.joints) - wrist_joints(found)
    return np.concatenate(
        [q[:, :free], np.broadcast_to(found.home[free:], (len(q), len(found.home) - free))], axis=1
    )


def check_all(found: Arm, q: np.ndarray, oriented: bool) -> None:
    pose = fk(found, q)
    solutions = solve(found, pose[:, :3, 3], pose[:, :3, :3] if oriented else None)
    assert solutions.valid.any(axis=1).all()
    given = fk(found, np.where(np.isnan(solutions.q), 0.0, solutions.q))
    error = np.abs(given - pose[:, None])[solutions.valid]
    assert (error if oriented else error[..., :3, 3]).max() < 1e-9
    assert is_among(q, solutions.q, [joint.turning for joint in found.joints]).all()
    lower, upper = numerical.limits(found)
    kept = solutions.q[solutions.valid]
    assert (kept >= lower).all() and (kept <= upper).all()


def test_every_pose_comes_back_from_all_its_solutions(closed_arm, configurations) -> None:
    check_all(closed_arm, configurations(closed_arm, 10_000), oriented=True)


def singular(found: Arm, count: int) -> np.ndarray:
    """Configurations whose joints stand at limits, home and quarter turns: stretched, folded, on the axis."""
    random = np.random.default_rng(3)
    lower, upper = numerical.limits(found)
    q = random.uniform(lower, upper, (count, len(lower)))
    for column, joint in enumerate(found.joints):
        special = [joint.lower, joint.upper, joint.home]
        if joint.turning:
            quarters = np.arange(-4, 5) * np.pi / 2
            special += [angle for angle in quarters if joint.lower <= angle <= joint.upper]
        chosen = random.random(count) < 0.6
        q[chosen, column] = random.choice(special, int(chosen.sum()))
    return q


def missed(solutions: np.ndarray, pose: np.ndarray, product_of_rows, found: Arm) -> np.ndarray:
    """How far the best solution of each pose is from it, through the textbook's product of matrices."""
    given = product_of_rows(found, np.where(np.isnan(solutions), 0.0, solutions))
    apart = np.abs(given - pose[:, None]).max(axis=(-1, -2))
    return np.where(np.isnan(solutions[..., 0]), np.inf, apart).min(axis=1)


def test_no_singular_pose_is_lost(any_arm, configurations, product_of_rows) -> None:
    q = np.vstack([configurations(any_arm, 100), singular(any_arm, 300)])
    pose = product_of_rows(any_arm, q)
    solutions = solve(any_arm, pose[:, :3, 3], pose[:, :3, :3]).q
    assert missed(solutions, pose, product_of_rows, any_arm).max() < 1e-8
    lower, upper = numerical.limits(any_arm)
    kept = solutions[~np.isnan(solutions[..., 0])]
    assert (kept >= lower).all() and (kept <= upper).all()


def test_no_singular_pose_is_lost_with_a_base_and_a_tool(any_arm, product_of_rows) -> None:
    base, tool = FixedFrame(0.1, -0.2, 0.3, 0.4, -0.5, 0.6), FixedFrame(0.01, 0.02, 0.03, -0.4, 0.3, 0.2)
    moved = replace(any_arm, base=base, tool=tool)
    pose = product_of_rows(moved, singular(moved, 300))
    solutions = solve(moved, pose[:, :3, 3], pose[:, :3, :3]).q
    assert missed(solutions, pose, product_of_rows, moved).max() < 1e-8


def test_no_singular_position_is_lost_with_the_wrist_at_home(any_arm) -> None:
    position = fk_position(any_arm, with_wrist_at_home(any_arm, singular(any_arm, 300)))
    assert solve(any_arm, position).valid.any(axis=1).all()


def test_no_pose_of_the_rv_m1_over_its_first_axis_is_lost(product_of_rows) -> None:
    robot = arm("rv-m1")
    length, (lower, upper) = robot.length, numerical.limits(robot)
    q = np.random.default_rng(5).uniform(lower, upper, (20_000, 5))
    # K = a2 c2 + a3 c23 + d5 s234 = 0 gives q4
    sine = -(length["a2"] * np.cos(q[:, 1]) + length["a3"] * np.cos(q[:, 1] + q[:, 2])) / length["d5"]
    q = q[np.abs(sine) <= 1]
    sum_ = np.arcsin(sine[np.abs(sine) <= 1])
    q[:, 3] = wrapped(np.where(q[:, 0] > 1.5, np.pi - sum_, sum_) - q[:, 1] - q[:, 2])
    q = q[(q[:, 3] >= lower[3]) & (q[:, 3] <= upper[3])][:300]
    assert len(q) == 300
    pose = product_of_rows(robot, q)
    assert np.hypot(pose[:, 0, 3], pose[:, 1, 3]).max() < 1e-12
    solutions = solve(robot, pose[:, :3, 3], pose[:, :3, :3]).q
    assert missed(solutions, pose, product_of_rows, robot).max() < 1e-8


def test_a_pose_that_is_nearly_right_is_still_refused(product_of_rows) -> None:
    robot = arm("theta1-theta2")
    pose = product_of_rows(robot, np.array([0.3, 0.0]))
    twisted = pose[:3, :3] @ np.array([[1, 0, 0], [0, 1, -1e-6], [0, 1e-6, 1]])
    assert not solve(robot, pose[:3, 3], twisted).valid.any()
    outside = pose[:3, 3] * (1 + 1e-6)
    assert not solve(robot, outside, pose[:3, :3]).valid.any()


def full_turns(found: Arm) -> Arm:
    """The arm without limits but a full turn of each joint."""
    return with_limits(found, **{joint.name: (-180, 180) for joint in found.joints})


def with_limits(found: Arm, **degrees: tuple[float, float]) -> Arm:
    joints = [
        replace(each, lower=radians(degrees[each.name][0]), upper=radians(degrees[each.name][1]))
        if each.name in degrees
        else each
        for each in found.joints
    ]
    return replace(found, joints=tuple(joints))


@pytest.mark.parametrize("closed_form", ["scara", None])
@pytest.mark.parametrize("turns", [-2, -1, 0, 1, 2])
def test_the_turn_nearest_to_near_is_taken(closed_form: str | None, turns: int) -> None:
    robot = replace(with_limits(arm("scara"), q1=(-1000, 1000), q4=(-800, 800)), closed_form=closed_form)
    q = np.array([0.7, 0.9, 0.1, 0.2])
    pose = fk(robot, q)
    wanted = q + 2 * np.pi * np.array([turns, 0, 0, -turns])
    found = ik(robot, pose[:3, 3], pose[:3, :3], near=wanted + np.array([1.0, 0.1, 0.0, -1.0]))
    assert found == pytest.approx(wanted, abs=1e-6)


def test_every_turn_within_the_limits_is_listed_once() -> None:
    robot = with_limits(arm("scara"), q1=(-700, 400), q4=(-180, 900))
    q = np.array([radians(30), radians(60), 0.1, radians(-10)])
    pose = fk(robot, q)
    found = np.degrees(ik_all(robot, pose[:3, 3], pose[:3, :3])[:, [0, 1, 3]])
    right = {(first, 60, fourth) for first in (-690, -330, 30, 390) for fourth in (-10, 350, 710)}
    mirrored = np.degrees(2 * np.arctan2(0.3 * np.sin(radians(60)), 0.4 + 0.3 * np.cos(radians(60))))
    # The mirrored elbow: q1 turns by twice the angle at the shoulder, q4 keeps q1 + q2 - q4
    first, fourth = 30 + mirrored, 30 + mirrored - 60 - 100
    left = {
        (round(first + 360 * a, 6), -60, round(fourth + 360 * b, 6))
        for a in range(-4, 4) for b in range(-4, 4)
        if -700 <= first + 360 * a <= 400 and -180 <= fourth + 360 * b <= 900
    }  # fmt: skip
    assert {tuple(row) for row in np.round(found, 6).tolist()} == right | left
    assert len(found) == len(right | left)


@pytest.mark.parametrize("end", [180, -180])
def test_both_ends_of_a_full_turn_are_candidates_and_near_decides(end: int) -> None:
    robot = with_limits(arm("scara"), q1=(-180, 180))
    pose = fk(robot, [np.pi, 0.5, 0.1, 0.2])
    near = np.array([radians(0.9 * end), 0.5, 0.1, 0.2])
    assert ik(robot, pose[:3, 3], near=near)[0] == pytest.approx(radians(end), abs=1e-9)
    both = ik_all(robot, pose[:3, 3], pose[:3, :3], near=near)
    assert both[0, 0] == pytest.approx(radians(end), abs=1e-9)
    assert {180, -180} <= {round(value, 6) for value in np.degrees(both[:, 0]).tolist()}


def test_an_arm_with_too_many_turns_to_list_is_refused() -> None:
    robot = with_limits(arm("scara"), q1=(-1e9, 1e9))
    target = fk_position(robot, [0.7, 0.9, 0.1, 0.2])
    assert ik(robot, target)[0] == pytest.approx(0.7)
    with pytest.raises(InputError, match="in more than 10000 ways"):
        ik_all(robot, target)


def test_as_many_turns_as_are_allowed_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five turns of q1, once for each elbow."""
    monkeypatch.setattr("servogen.kinematics.inverse.solve.MAX_LISTED", 10)
    target = fk_position(arm("scara"), [0.7, 0.9, 0.1, 0.0])
    assert len(ik_all(with_limits(arm("scara"), q1=(-900, 900)), target)) == 10
    with pytest.raises(InputError, match="in more than 10 ways: its joints have so many turns of travel"):
        ik_all(with_limits(arm("scara"), q1=(-900, 1200)), target)


def test_the_nearest_is_so_in_shares_of_the_joints_ranges_and_the_first_of_equals() -> None:
    joints = [
        replace(joint, lower=0.0, upper=upper, home=0.0)
        for joint, upper in zip(arm("scara").joints, (1.0, 4.0, 0.2, 2.0), strict=True)
    ]
    robot = replace(arm("scara"), joints=tuple(joints))
    q = np.array([[0.3, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 0.06, 0], [0.1, 0.4, 0.04, 0.2], [0, 0, 0, 0.5]])
    assert Solutions(robot, q).choose().tolist() == [0, 1.0, 0, 0]  # a quarter of its range, as the last
    assert Solutions(robot, q[::-1]).choose().tolist() == [0, 0, 0, 0.5]
    assert Solutions(robot, q).choose([0.3, 0, 0, 0.1]).tolist() == [0.3, 0, 0, 0]
    q[1:] = np.nan
    assert Solutions(robot, q).valid.tolist() == [True] + [False] * 4
    assert Solutions(robot, q).choose().tolist() == [0.3, 0, 0, 0]
    assert np.isnan(Solutions(robot, q[1:]).choose()).all()
    straight = solve(arm("scara"), [0.5, 0.0, 0.3])
    assert straight.choose()[1] > 0  # both elbows are as near: the first of the branches


def test_solutions_that_differ_by_less_than_a_ten_millionth_count_once() -> None:
    robot = arm("scara")
    first = np.array([0.5, 0.5, 0.1, 0.0])
    for apart, count in ((0.9e-7, 1), (1.1e-7, 2)):
        for joint in range(4):
            rows = np.array([first, first + apart * np.eye(4)[joint]])
            assert len(sorted_without_doubles(robot, rows, None)) == count
    rows = np.array([[0.9, 0, 0, 0], [-0.2, 0, 0, 0], [0.5, 0, 0, 0]])
    assert sorted_without_doubles(robot, rows, None)[:, 0].tolist() == [-0.2, 0.5, 0.9]
    assert sorted_without_doubles(robot, rows, [0.8, 0, 0, 0])[:, 0].tolist() == [0.9, 0.5, -0.2]


def test_the_first_unreachable_target_of_a_grid_is_named_with_its_orientation() -> None:
    targets = np.array([[[0.5, 0.1, 0.3], [0.4, 0.1, 0.3]], [[0.3, 0.3, 0.3], [0.8, 0.0, 0.3]]])
    with pytest.raises(Unreachable) as caught:
        ik(arm("scara"), targets)
    assert caught.value.target == (0.8, 0.0, 0.3)
    turns = np.tile(np.diag([1.0, -1.0, -1.0]), (2, 2, 1, 1))
    turns[1, 0] = np.eye(3)
    targets[1, 1] = [0.3, 0.3, 0.3]
    with pytest.raises(Unreachable, match="not in this orientation") as caught:
        ik(arm("scara"), targets, turns)
    assert caught.value.target == (0.3, 0.3, 0.3) and not caught.value.as_asked
    found = ik(arm("scara"), targets, turns[0, 0])
    assert found.shape == (2, 2, 4)
    assert fk_position(arm("scara"), found) == pytest.approx(targets)


def test_a_limit_that_is_missed_by_rounding_is_kept() -> None:
    """A pose is tried at the limit if it is less than 0.1 mrad beyond it, and met only to a nanometre."""
    robot = with_limits(arm("theta1-theta2"), q1=(-60, 30))
    for beyond, met in ((1e-10, True), (-1e-6, True), (1e-7, False)):
        q = np.array([radians(30) + beyond, 0.4])
        solution = solve(robot, fk_position(arm("theta1-theta2"), q))
        assert bool(np.isclose(solution.q[solution.valid][:, 1], 0.4).any()) == met
        assert (solution.q[solution.valid][:, 0] <= radians(30)).all()


def test_every_position_comes_back_with_the_wrist_at_home(closed_arm, configurations) -> None:
    check_all(closed_arm, with_wrist_at_home(closed_arm, configurations(closed_arm, 10_000)), oriented=False)


def test_with_other_home_values_too(closed_arm, configurations) -> None:
    homes = configurations(closed_arm, 1)[0]
    joints = tuple(
        replace(joint, home=float(home)) for joint, home in zip(closed_arm.joints, homes, strict=True)
    )
    other = replace(closed_arm, joints=joints)
    check_all(other, with_wrist_at_home(other, configurations(other, 500, seed=8)), oriented=False)


def test_with_other_lengths_too(closed_arm, configurations) -> None:
    """In the catalogue some are 0, 1, or equal."""
    lengths = dict(zip(closed_arm.length, (0.37, 0.23, 0.31, 0.17), strict=False))
    other = closed_arm.with_lengths(**lengths)
    check_all(other, configurations(other, 200), oriented=True)
    check_all(other, with_wrist_at_home(other, configurations(other, 200)), oriented=False)


def test_on_the_axis_of_the_first_joint_it_stays_at_home() -> None:
    """Every angle of it is right there; the home positions of the arms differ from 0 and from each other."""
    for name, q in (
        ("theta-r", [0.0, 0.0]),
        ("cylindrical", [0.0, 0.1, -0.08, 0.0]),
        ("cylindrical-r2p", [0.0, 0.1, 0.0]),
        ("spherical", [0.0, 0.0, 0.2]),
        ("wrist-arm", [0.0, np.pi / 2, 0.0]),
        ("anthropomorphic", [0.0, np.pi / 2, 0.0]),
    ):
        joints = tuple(
            replace(
                joint,
                lower=-4.0 if joint.turning else -1.0,
                upper=4.0 if joint.turning else 1.0,
                home=0.4 + 0.2 * index,
            )
            for index, joint in enumerate(arm(name).joints)
        )
        robot = replace(arm(name), joints=joints)
        position = np.round(fk_position(robot, q), 15) + 0.0
        assert (position[:2] == 0).all()
        for solution in ik_all(robot, position):
            assert fk_position(robot, solution) == pytest.approx(position, abs=1e-9)
            assert np.sin(solution[0] - 0.4) == pytest.approx(0, abs=1e-9), name
        assert ik(robot, position)[0] == pytest.approx(0.4)


def test_a_wrist_that_bends_straight_ahead_is_not_stretched() -> None:
    """One of the two components across the wrist's axis is 0, and its fourth joint is not at home."""
    plain = arm("spherical-wrist")
    joints = tuple(
        replace(joint, home=0.3) if index == 3 else joint for index, joint in enumerate(plain.joints)
    )
    robot = replace(plain, joints=joints)
    for fourth in (0.0, np.pi / 2):
        pose = fk(robot, [0.0, 0.0, 0.3, fourth, 0.5, 0.1])
        pose[np.abs(pose) < 1e-15] = 0.0
        solutions = ik_all(robot, pose[:3, 3], pose[:3, :3])
        for q in solutions:
            assert fk(robot, q) == pytest.approx(pose, abs=1e-9)
        assert min(np.abs(q[3] - fourth) for q in solutions) < 1e-9


def test_a_base_and_a_tool_are_taken_off_first(closed_arm, configurations) -> None:
    base, tool = FixedFrame(0.1, -0.2, 0.3, 0.4, -0.5, 0.6), FixedFrame(0.01, 0.02, 0.03, -0.4, 0.3, 0.2)
    check_all(replace(closed_arm, base=base, tool=tool), configurations(closed_arm, 500), oriented=True)


# robot -> how many solutions a target in general position has, with orientation and without, limits aside
COUNTS = {
    "theta-r": (1, 2), "theta1-theta2": (1, 2), "cylindrical": (1, 2), "cylindrical-r2p": (1, 2),
    "cartesian": (1, 1), "scara": (2, 2), "wrist-arm": (2, 2), "anthropomorphic": (1, 4), "rv-m1": (4, 4),
    "irb6400c": (8, 4), "spherical": (1, 4), "spherical-wrist": (8, 4), "leg": (1, 2), "hip-lift": (1, 1),
    "coxa-femur-tibia": (1, 4),
}  # fmt: skip


def test_the_number_of_solutions_of_each_arm(closed_arm, configurations) -> None:
    wide = tuple(
        replace(joint, lower=-np.pi if joint.turning else -9.0, upper=np.pi if joint.turning else 9.0)
        for joint in closed_arm.joints
    )
    free = replace(closed_arm, joints=wide)
    q = with_wrist_at_home(closed_arm, configurations(closed_arm, 200))
    pose = fk(free, q)
    oriented = solve(free, pose[:, :3, 3], pose[:, :3, :3]).valid.sum(axis=1)
    alone = solve(free, pose[:, :3, 3]).valid.sum(axis=1)
    if closed_arm.name == "coxa-femur-tibia":
        # With the hip turned away the foot is two coxas farther off, for some targets too far.
        assert set(alone.tolist()) == {2, 4}
        alone = np.array([4])
    assert (set(oriented.tolist()), set(alone.tolist())) == tuple(
        {count} for count in COUNTS[closed_arm.name]
    )


def test_the_page_of_the_robots_states_how_many_solutions_each_has() -> None:
    rows = re.findall(r"^\| `([\w-]+)` \|.*\| (\d+|–) \| [^|]*\|$", ROBOTS.read_text(), re.MULTILINE)
    stated = {name: int(count) for name, count in rows if count.isdigit()}
    assert stated == {name: max(counts) for name, counts in COUNTS.items()}


def test_the_numerical_method_reaches_the_same_targets(sampled_arm, configurations) -> None:
    pose = fk(sampled_arm, configurations(sampled_arm, 10_000))
    found = numerical.search(sampled_arm, pose[:, :3, 3], pose[:, :3, :3])
    assert found.within(1e-7).mean() >= 0.999
    alone = numerical.search(sampled_arm, pose[:, :3, 3])
    assert alone.within(1e-7).mean() >= 0.999
    np.testing.assert_allclose(
        fk_position(sampled_arm, alone.q)[alone.within(1e-7)], pose[alone.within(1e-7), :3, 3], atol=1e-7
    )


def test_the_numerical_solution_is_one_of_the_closed_form(configurations) -> None:
    robot = arm("rv-m1")
    pose = fk(robot, configurations(robot, 200))
    found = numerical.search(robot, pose[:, :3, 3], pose[:, :3, :3])
    assert is_among(found.q, solve(robot, pose[:, :3, 3], pose[:, :3, :3]).q, [True] * 5).all()


def test_the_worked_pose_of_the_scara_has_both_elbows() -> None:
    both = ik_all(arm("scara"), [0.3464101615, 0.5, 0.25])
    assert both[0] == pytest.approx([radians(30), radians(60), 0.2, 0.0], abs=1e-8)
    assert both[1][1] == pytest.approx(-radians(60), abs=1e-8)
    assert len(both) == 2


def test_the_chosen_solution_is_the_nearest_to_where_the_arm_is() -> None:
    robot = arm("scara")
    target = [0.3464101615, 0.5, 0.25]
    other = ik_all(robot, target)[1]
    np.testing.assert_allclose(ik(robot, target, near=other + 0.05), other)
    np.testing.assert_allclose(ik_all(robot, target, near=other)[0], other)


def test_a_missing_orientation_leaves_the_wrist_at_home() -> None:
    for solution in ik_all(arm("rv-m1"), [0.2, 0.1, 0.4]):
        assert solution[3:] == pytest.approx([0, np.pi / 2])
        assert fk_position(arm("rv-m1"), solution) == pytest.approx([0.2, 0.1, 0.4], abs=1e-12)


def test_pitch_and_roll_of_the_rv_m1_are_those_of_its_command_language() -> None:
    robot, target = full_turns(arm("rv-m1")), [0.2, 0.1, 0.4]
    turn = orientation_matrix(robot, target, [radians(-60), radians(25)])
    first = [q for q in ik_all(robot, target, turn) if abs(q[0] - np.arctan2(0.1, 0.2)) < 1e-9]
    assert len(first) == 2
    for q in first:
        assert np.sin(q[1] + q[2] + q[3] - np.pi / 2 - radians(-60)) == pytest.approx(0, abs=1e-9)
        assert q[4] == pytest.approx(radians(25))


def test_the_roll_of_each_small_arm_is_its_last_angle() -> None:
    for name, target in (("scara", [0.4, 0.2, 0.3]), ("cylindrical", [0.2, 0.1, 0.3])):
        robot = arm(name)
        turn = orientation_matrix(robot, target, [0.4])
        for q in ik_all(robot, target, turn):
            roll = q[0] + q[1] - q[3] if name == "scara" else q[3]
            assert roll == pytest.approx(0.4)
    robot = arm("wrist-arm")
    target = fk_position(robot, [0.3, 0.5, 0.0])
    q = ik(robot, target, orientation_matrix(robot, target, [0.4]))
    assert q == pytest.approx([0.3, 0.5, 0.4])


def test_an_arm_says_what_it_takes_beside_the_position() -> None:
    with pytest.raises(InputError, match="rv-m1 takes pitch, roll besides x, y, z, not 1 values"):
        orientation_matrix(arm("rv-m1"), [0.2, 0.1, 0.4], [1.0])
    with pytest.raises(InputError, match="theta-r takes nothing"):
        orientation_matrix(arm("theta-r"), [0.2, 0.1, 0.4], [1.0])


def test_above_its_first_axis_the_rv_m1_takes_the_plane_of_its_tool() -> None:
    robot = full_turns(arm("rv-m1"))
    for q in ([0.7, 1.0, 1.2, 0.4, 0.3], [0.7, np.pi / 2, 0.0, np.pi / 2, 0.3]):
        q = np.array(q)
        pose = fk(robot, q)
        if abs(pose[0, 3]) > 1e-9:
            inner = -robot.length["a2"] * np.cos(q[1]) - robot.length["a3"] * np.cos(q[1] + q[2])
            q[3] = np.arcsin(inner / robot.length["d5"]) - q[1] - q[2] if abs(inner) < 0.072 else q[3]
            pose = fk(robot, q)
        for solution in ik_all(robot, pose[:3, 3], pose[:3, :3]):
            np.testing.assert_allclose(fk(robot, solution), pose, atol=1e-9)


def test_a_stretched_wrist_keeps_its_fourth_joint_at_home() -> None:
    robot = arm("irb6400c")
    pose = fk(robot, [0.3, 0.4, 0.5, 0.6, 0.0, 0.7])
    for q in ik_all(robot, pose[:3, 3], pose[:3, :3]):
        np.testing.assert_allclose(fk(robot, q), pose, atol=1e-9)
    assert any(abs(q[3]) < 1e-12 and abs(q[4]) < 1e-7 for q in ik_all(robot, pose[:3, 3], pose[:3, :3]))


def test_a_target_out_of_reach_names_the_distance_and_the_nearest_point() -> None:
    with pytest.raises(Unreachable, match=r"300\.000 mm from what the 4 joints reach") as caught:
        ik(arm("scara"), [1.0, 0.0, 0.3])
    assert caught.value.nearest == pytest.approx((0.7, 0.0, 0.3), abs=1e-6)
    assert "nearest reachable point" in (caught.value.hint or "")


def test_a_target_beyond_a_limit_names_the_joint_and_its_limits() -> None:
    with pytest.raises(
        Unreachable, match=r"q3 would have to be at 250\.000 mm, its limits are 0 mm to 200 mm"
    ) as caught:
        ik(arm("scara"), [0.5, 0.1, 0.2])
    assert caught.value.nearest == pytest.approx((0.5, 0.1, 0.25), abs=1e-6)


def test_an_orientation_that_the_joints_cannot_give_is_named() -> None:
    with pytest.raises(Unreachable, match="reach the point, but not in this orientation") as caught:
        ik(arm("scara"), [0.5, 0.1, 0.3], np.eye(3))
    assert caught.value.nearest == pytest.approx((0.5, 0.1, 0.3), abs=1e-6)


def test_the_nearest_point_that_is_advised_is_reached_as_it_is_said(sampled_arm, configurations) -> None:
    poses = fk(sampled_arm, configurations(sampled_arm, 4, seed=9))
    said = set()
    for pose, other in zip(poses, poses[::-1], strict=True):
        for oriented in (False, True):
            turn = other[:3, :3] if oriented else None
            try:
                ik(sampled_arm, 1.3 * pose[:3, 3] + 0.05, turn)
            except Unreachable as error:
                reached = solve(sampled_arm, error.nearest, turn, tolerance=1e-6).valid.any()
                assert ("in another orientation" in (error.hint or "")) == (not reached)
                said.add(oriented)
    assert said == {False, True}


def test_a_point_that_only_its_orientation_forbids_is_not_advised_again() -> None:
    with pytest.raises(Unreachable) as caught:
        ik(arm("scara"), [0.5, 0.1, 0.3], np.eye(3))
    assert caught.value.hint == "the point can be reached in another orientation"
    robot = arm("rv-m1")
    pose = fk(full_turns(robot), [0.3, 0.4, -0.9, -1.0, 0.2])
    with pytest.raises(Unreachable, match="q4 would have to be at -57"):
        ik(robot, pose[:3, 3], pose[:3, :3])


def test_the_first_unreachable_target_of_many_is_the_one_named() -> None:
    targets = [[0.5, 0.1, 0.3], [2.0, 0.0, 0.3], [3.0, 0.0, 0.3]]
    with pytest.raises(Unreachable, match=r"2000\.000"):
        ik(arm("scara"), targets)
    assert solve(arm("scara"), targets).valid.any(axis=1).tolist() == [True, False, False]


def test_no_configuration_is_nearer_than_the_nearest_point(sampled_arm, configurations) -> None:
    cloud = fk_position(sampled_arm, configurations(sampled_arm, 4_000))
    for target in ([2.5, 0.3, 0.2], [0.0, 0.0, -3.0], [0.0, 0.0, 0.0]):
        here = np.linalg.norm(np.subtract(nearest_point(sampled_arm, target), target))
        assert here <= np.linalg.norm(cloud - target, axis=1).min() + 1e-6


@pytest.mark.campaign
def test_the_nearest_point_inside_a_cylindrical_arm_is_straight_out() -> None:
    """Its points are 180 to 480 mm from the axis and 200 to 500 mm high: q3 from 100 to 400, and l4 = 80."""
    for x, y, z in np.random.default_rng(1).uniform((-0.1, -0.1, 0.0), (0.1, 0.1, 0.7), (30, 3)):
        out, up = np.hypot(x, y), np.clip(z, 0.2, 0.5)
        nearest = (0.18 * x / out, 0.18 * y / out, up)
        assert nearest_point(arm("cylindrical"), (x, y, z)) == pytest.approx(nearest, abs=1e-7)


@pytest.mark.parametrize(
    ("name", "target", "free"),
    [
        ("anthropomorphic", (0, 0, 300), ("q1",)),
        ("anthropomorphic", (1, 0, 300), ()),
        ("scara", (400, 0, 300), ()),
        ("spherical", (0, 0, 200), ("q1",)),
        ("cylindrical", (200, 0, 300), ()),
    ],
)
def test_a_joint_is_free_if_the_target_is_on_its_axis(
    name: str, target: tuple[float, ...], free: tuple[str, ...]
) -> None:
    solutions = ik_all(arm(name), np.array(target) / 1000)
    assert free_joints(arm(name), solutions, oriented=False) == free


def test_a_stretched_wrist_has_two_free_joints_and_a_stretched_elbow_none() -> None:
    """Only q4 + q6 is determined where q5 = 0; the elbow's fold would pull the hand back."""
    robot = arm("spherical-wrist")
    for bent, free in ((0.0, ("q4", "q6")), (0.3, ())):
        middle = np.array([(joint.lower + joint.upper) / 2 for joint in robot.joints])
        pose = fk(robot, [0.3, 0.4, middle[2], 0.2, bent, 0.1])
        solutions = ik_all(robot, pose[:3, 3], pose[:3, :3])
        assert free_joints(robot, solutions, oriented=True) == free
    robot = arm("anthropomorphic")
    reach = robot.length["l2"] + robot.length["l3"]
    for point, alone in (((0.0, reach, 0.0), ()), ((0.0, 0.0, reach), ("q1",))):
        assert free_joints(robot, ik_all(robot, point), oriented=False) == alone


def test_limits_are_hard(configurations) -> None:
    robot = arm("scara")
    tight = replace(robot, joints=tuple(replace(joint, lower=0.0) for joint in robot.joints))
    pose = fk(robot, configurations(tight, 1000))
    solutions = solve(tight, pose[:, :3, 3])
    assert np.nanmin(solutions.q) >= 0.0
    assert (solutions.valid.sum(axis=1) <= 1).all()


def test_targets_at_the_edge_of_reach_and_at_the_limits_themselves_are_reached() -> None:
    robot = arm("scara")
    lower, upper = numerical.limits(robot)
    for q in (lower, upper, [0, 0, 0, 0], [upper[0], lower[1], upper[2], 0]):
        target = fk_position(robot, np.where([1, 1, 1, 0], q, 0.0))
        assert fk_position(robot, ik(robot, target)) == pytest.approx(target, abs=1e-9)


def test_an_arm_without_a_closed_form_is_solved_numerically(configurations) -> None:
    robot = replace(full_turns(arm("rv-m1")), closed_form=None)
    pose = fk(robot, configurations(robot, 50))
    q = ik(robot, pose[:, :3, 3], pose[:, :3, :3])
    np.testing.assert_allclose(fk(robot, q), pose, atol=2e-7)
    assert len(ik_all(robot, pose[0, :3, 3], pose[0, :3, :3])) == 4
    with pytest.raises(Unreachable, match="from what the 5 joints reach"):
        ik(robot, [1.0, 0.0, 0.3])


def test_a_tool_beside_the_axis_needs_the_numerical_method_when_no_orientation_is_given() -> None:
    robot = arm("anthropomorphic").with_tool(FixedFrame(x=0.02, y=0.03))
    target = fk_position(robot, [0.3, 0.4, 0.5])
    for q in ik_all(robot, target):
        assert fk_position(robot, q) == pytest.approx(target, abs=1e-7)


def test_a_closed_form_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match=r"no closed form 'rvm1'.*\n.*rv-m1"):
        ik(replace(arm("rv-m1"), closed_form="rvm1"), [0.2, 0.1, 0.4])


def test_a_closed_form_of_other_rows_is_refused() -> None:
    with pytest.raises(InputError, match=r"rows of 'theta-r' are not those[\s\S]*like = \"scara\""):
        ik(replace(arm("theta-r"), closed_form="scara"), [0.2, 0.1, 0.4])


def test_an_arm_that_has_lost_a_link_is_solved_numerically() -> None:
    robot = arm("scara").with_lengths(l2=0.0)
    assert fk_position(robot, ik(robot, [0.4, 0.0, 0.3])) == pytest.approx([0.4, 0.0, 0.3], abs=1e-7)


def test_an_orientation_that_is_no_rotation_is_refused() -> None:
    with pytest.raises(InputError, match="is not a rotation"):
        ik(arm("scara"), [0.5, 0.1, 0.3], np.diag([1.0, 1.0, -1.0]))


def test_targets_that_are_no_points_are_refused() -> None:
    for wrong in ([1.0, 2.0], [np.nan, 0.0, 0.0]):
        with pytest.raises(InputError, match="three finite coordinates"):
            ik(arm("scara"), wrong)
    with pytest.raises(InputError, match="rotation matrix"):
        ik(arm("scara"), [0.5, 0.1, 0.3], [1.0, 2.0])
    with pytest.raises(InputError, match="rotation matrix"):
        ik(arm("scara"), [0.5, 0.1, 0.3], np.full((3, 3), np.inf))
    with pytest.raises(InputError, match="one target at a time"):
        ik_all(arm("scara"), [[0.5, 0.1, 0.3]] * 2)


def test_all_four_branches_of_the_spherical_arm_lead_to_the_point() -> None:
    """p = q3 (c1 s2, s1 s2, c2), also where q3 is negative, which the joint limits of most arms exclude."""
    points = np.array([[0.3, 0.4, 0.5], [-0.2, 0.1, 0.6], [0.1, -0.7, -0.2]]).T
    branches = spherical(arm("spherical"), TargetComponents((points[0], points[1], points[2])))
    assert len(branches) == 4
    for one, two, three in branches:
        reached = three * np.array([np.cos(one) * np.sin(two), np.sin(one) * np.sin(two), np.cos(two)])
        assert reached == pytest.approx(points)
    signs = {
        (bool((three > 0).all()), bool((np.cos(one) * points[0] > 0).all())) for one, _, three in branches
    }
    assert len(signs) == 4
