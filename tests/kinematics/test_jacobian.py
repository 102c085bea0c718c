"""Jacobians against differences, frames, singularities, statics."""

from dataclasses import replace

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk, fk_position, link_frames
from servogen.kinematics.jacobian import jacobian, manipulability, singularity, static_torques

STEP = 1e-6


def differences(robot, q: np.ndarray) -> np.ndarray:
    columns = []
    for joint in range(len(q)):
        ahead, behind = (fk(robot, q + sign * STEP * np.eye(len(q))[joint]) for sign in (1, -1))
        change = (ahead - behind) / (2 * STEP)
        spin = change[:3, :3] @ fk(robot, q)[:3, :3].T
        columns.append([*change[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]])
    return np.array(columns).T


def test_the_geometric_jacobian_is_what_small_steps_do(any_arm, configurations) -> None:
    for q in configurations(any_arm, 5):
        np.testing.assert_allclose(jacobian(any_arm, q), differences(any_arm, q), atol=1e-8)


def test_many_configurations_at_once(any_arm, configurations) -> None:
    q = configurations(any_arm, 6)
    many = jacobian(any_arm, q.reshape(2, 3, -1))
    assert many.shape == (2, 3, 6, len(any_arm.joints))
    np.testing.assert_allclose(many[1, 2], jacobian(any_arm, q[5]), atol=1e-15)


def test_in_another_frame_both_halves_are_turned(any_arm, configurations) -> None:
    q = configurations(any_arm, 1)[0]
    plain = jacobian(any_arm, q)
    for frame in (1, len(any_arm.rows)):
        turn = link_frames(any_arm, q)[frame, :3, :3]
        found = jacobian(any_arm, q, frame)
        np.testing.assert_allclose(turn @ found[:3], plain[:3], atol=1e-14)
        np.testing.assert_allclose(turn @ found[3:], plain[3:], atol=1e-14)
    turn = fk(any_arm, q)[:3, :3]
    np.testing.assert_allclose(turn @ jacobian(any_arm, q, "n")[:3], plain[:3], atol=1e-14)
    with pytest.raises(InputError, match="has no frame '99'"):
        jacobian(any_arm, q, 99)


def test_the_spherical_arms_determinant_is_its_manipulability(configurations) -> None:
    robot = arm("spherical")
    for q in configurations(robot, 10):
        assert manipulability(robot, q) == pytest.approx(q[2] ** 2 * abs(np.sin(q[1])))


def test_the_manipulability_of_six_joints_is_the_determinant(configurations) -> None:
    robot = arm("irb6400c")
    for q in configurations(robot, 5):
        assert manipulability(robot, q) == pytest.approx(abs(np.linalg.det(jacobian(robot, q))))


def test_a_stretched_anthropomorphic_arm_cannot_go_outwards() -> None:
    robot = arm("anthropomorphic")
    regular, stretched = singularity(robot, [0.3, 0.4, 0.5]), singularity(robot, [0.3, 0.4, 0.0])
    assert (regular.rank, regular.singular) == (3, False)
    assert regular.lost == ()
    assert stretched.full_rank == 3
    assert manipulability(robot, [0.3, 0.4, 0.0]) == 0
    outwards = fk_position(robot, [0.3, 0.4, 0.0])
    assert jacobian(robot, [0.3, 0.4, 0.0])[:3].T @ outwards == pytest.approx([0, 0, 0], abs=1e-15)


def test_an_upright_wrist_arm_and_a_stretched_wrist_are_singular() -> None:
    assert singularity(arm("wrist-arm"), [0.3, np.pi / 2, 0.5]).singular
    assert not singularity(arm("wrist-arm"), [0.3, 0.4, 0.5]).singular
    found = singularity(arm("irb6400c"), [0.3, 0.4, 0.5, 0.6, 0.0, 0.7])
    assert (found.rank, found.full_rank, len(found.lost), len(found.idle)) == (5, 6, 1, 1)
    np.testing.assert_allclose(np.abs(found.idle[0]), [0, 0, 0, np.sqrt(0.5), 0, np.sqrt(0.5)], atol=1e-9)
    lost = jacobian(arm("irb6400c"), [0.3, 0.4, 0.5, 0.6, 0.0, 0.7]).T @ found.lost[0]
    assert np.abs(lost).max() < 1e-12


@pytest.mark.parametrize("q1", [0.0, 0.5, -1.2])
def test_a_stretched_scara_loses_the_direction_along_its_arm(q1: float) -> None:
    """Nor can it turn about x or y, but that it cannot anywhere."""
    found = singularity(arm("scara"), [q1, 0.0, 0.1, 0.3])
    assert (found.rank, found.full_rank) == (3, 4)
    (lost,) = found.lost
    along = np.array([np.cos(q1), np.sin(q1), 0, 0, 0, 0])
    assert np.abs(np.array(lost) @ along) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "q", "lost"),
    [
        ("anthropomorphic", (0, np.pi / 6, 0), (0, -np.cos(np.pi / 6), -0.5)),  # outwards
        ("theta1-theta2", (np.pi / 6, 0), (np.cos(np.pi / 6), 0.5, 0)),  # outwards
        ("spherical", (np.pi / 6, 0, 0.2), (0.5, -np.cos(np.pi / 6), 0)),  # upright: sideways to the slide
    ],
)
def test_a_positioning_arm_is_singular_where_its_position_loses_a_direction(
    name: str, q: tuple[float, ...], lost: tuple[float, ...]
) -> None:
    """Although it still turns in as many directions as it has joints."""
    found = singularity(arm(name), q)
    assert (found.rank, found.full_rank) == (len(q) - 1, len(q))
    ((*direction, a, b, c),) = found.lost
    assert abs(np.dot(direction, lost)) == pytest.approx(1, abs=1e-6) and (a, b, c) == (0, 0, 0)


def test_a_leg_loses_where_its_neighbours_go() -> None:
    """At β = 0 both joints move the foot one way; the planes in which it moves beside that are nearly one."""
    leg = arm("leg")
    (lost,) = singularity(leg, [0.2, 0.0]).lost
    for beta in (0.001, -0.001):
        normal = np.cross(*jacobian(leg, [0.2, beta])[:3].T)
        assert abs(normal @ lost[:3]) < 1e-6 * np.linalg.norm(normal)
    assert jacobian(leg, [0.2, 0.0]).T @ lost == pytest.approx([0, 0], abs=1e-15)


def test_a_tool_on_the_first_axis_of_five_joints_cannot_go_sideways() -> None:
    """The first joint still turns the tool, so all six rows keep their rank."""
    robot, q = arm("rv-m1"), np.array([0.4, 0.5, -0.6, 0.3, 0.2])
    out = np.array([np.cos(0.4), np.sin(0.4), 0])
    back = fk_position(robot, q) @ out / (fk(robot, q)[:3, 2] @ out)  # along the axis of the roll
    robot = robot.with_tool(replace(robot.tool, z=robot.tool.z - back))
    assert fk_position(robot, q)[:2] == pytest.approx([0, 0], abs=1e-12)
    found = singularity(robot, q)
    assert (found.rank, found.full_rank, manipulability(robot, q)) == (4, 5, 0)
    assert np.abs(found.lost[0]) == pytest.approx(np.abs([np.sin(0.4), np.cos(0.4), 0, 0, 0, 0]), abs=1e-6)


def test_manipulability_is_0_where_the_rank_falls_and_nowhere_else(any_arm, configurations) -> None:
    straight = np.where([joint.turning for joint in any_arm.joints], 0.0, 0.1)
    for q in [straight, *configurations(any_arm, 5)]:
        found = singularity(any_arm, q)
        assert bool(manipulability(any_arm, q) == 0) is found.singular
        assert len(found.lost) == found.full_rank - found.rank


def test_static_loads_are_the_work_of_the_force_per_joint_step(any_arm, configurations) -> None:
    force = np.array([3.0, -2.0, 5.0])
    for q in configurations(any_arm, 5):
        loads = static_torques(any_arm, q, force)
        for joint in range(len(q)):
            step = STEP * np.eye(len(q))[joint]
            way = (fk_position(any_arm, q + step) - fk_position(any_arm, q - step)) / (2 * STEP)
            assert loads[joint] == pytest.approx(force @ way, abs=1e-7)


def test_a_moment_loads_the_joints_by_their_axes() -> None:
    loads = static_torques(arm("scara"), [0.1, 0.2, 0.1, 0.3], [0, 0, 0], [0, 0, 2.0])
    assert loads == pytest.approx([2, 2, 0, -2])


def test_the_legs_load_is_the_formula() -> None:
    robot = arm("leg")
    for beta in (0.0, 0.4, -0.7):
        loads = static_torques(robot, [0.3, beta], [0, 0, 4.0])
        assert loads == pytest.approx([0, 4.0 * robot.length["bc"] * np.sin(beta)], abs=1e-15)


def test_an_arm_may_have_more_than_ten_joints() -> None:
    """Two arms of six joints, one on the tool of the other, move in all six directions."""
    one = arm("irb6400c")
    rows = [replace(row, joint=None if row.joint is None else row.joint + 6) for row in one.rows]
    both = replace(one, joints=one.joints * 2, rows=(*one.rows, *rows), closed_form=None)
    found = singularity(both, np.linspace(0.1, 1.2, 12))
    assert (found.rank, found.full_rank, len(found.idle)) == (6, 6, 6)
