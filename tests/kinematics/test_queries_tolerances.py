"""How near typed numbers must be to what a robot can do, from both sides, and what answers hold."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import queries as q
from servogen.kinematics import statics
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.jacobian import jacobian, singularity
from servogen.kinematics.orientation import from_angles
from servogen.robot.model import Arm, FixedFrame


@pytest.mark.parametrize(("off_mm", "fits"), [(0.0, True), (0.0099, True), (0.0101, False)])
def test_a_foot_is_typed_with_two_digits_of_a_millimetre(off_mm: float, fits: bool) -> None:
    """A hundredth of a millimetre below the lowest circle of the foot is the digits left out."""
    x, y, z = (1000 * value for value in q.fk_answer("leg", (20, 0))["position_m"])
    target = (x, y, z - off_mm)
    if fits:
        answer = q.ik_answer("leg", target, everything=True)
        assert 1000 * answer["missed_m"] == pytest.approx(abs(off_mm), abs=1e-4)
        assert [*answer["solutions"][0].values()] == pytest.approx([20, 0], abs=1e-3)
    else:
        with pytest.raises(Unreachable):
            q.ik_answer("leg", target)


@pytest.mark.parametrize(("error", "fits"), [(0.9e-3, True), (-0.9e-3, True), (1.1e-3, False)])
def test_a_matrix_is_typed_with_three_digits(error: float, fits: bool) -> None:
    matrix = np.eye(3)
    matrix[0, 0] = math.sqrt(1 + error)
    if fits:
        answer = q.orientation_answer("matrix", matrix.ravel().tolist())
        assert np.array(answer["matrix"]) == pytest.approx(np.eye(3), abs=1e-15)
    else:
        with pytest.raises(InputError, match="the matrix is not a rotation"):
            q.orientation_answer("matrix", matrix.ravel().tolist())


def test_an_orientation_is_the_same_in_every_form() -> None:
    angles = (10.0, -20.0, 30.0)
    rotation = from_angles(np.radians(angles), "ZYX")
    answer = q.orientation_answer("rpy", angles)
    assert np.array(answer["matrix"]) == pytest.approx(rotation, abs=1e-15)
    assert answer["angles_deg"]["ZYX"] == pytest.approx(angles)
    typed: list[tuple[str, list[float]]] = [
        ("axis_angle", [*answer["axis"], answer["angle_deg"]]),
        ("AXIS-ANGLE", [2 * each for each in answer["axis"]] + [answer["angle_deg"]]),
        ("quaternion", [-3 * each for each in answer["quaternion"]]),
        ("matrix", np.ravel(answer["matrix"]).tolist()),
        *((order, answer["second_deg"][order]) for order in answer["second_deg"]),
    ]
    for form, values in typed:
        again = q.orientation_answer(form, values)
        assert np.array(again["matrix"]) == pytest.approx(rotation, abs=1e-12)
    for form, count in (("zyx", 3), ("rpy", 3), ("axis-angle", 4), ("quaternion", 4), ("matrix", 9)):
        for wrong in (count - 1, count + 1):
            with pytest.raises(InputError, match=f"takes {count} numbers, not {wrong}"):
                q.orientation_answer(form, [1.0] * wrong)


def test_joints_count_as_within_their_limits_up_to_rounding() -> None:
    upper = math.degrees(arm("scara").joints[0].upper)
    for beyond, named in ((0.9e-9, []), (1.1e-9, ["q1"]), (-1.0, [])):
        assert q.fk_answer("scara", (upper + math.degrees(beyond), 0, 100, 0))["beyond_limits"] == named
    lower = math.degrees(arm("scara").joints[0].lower)
    assert q.fk_answer("scara", (lower - 1e-6, 0, 100, 0))["beyond_limits"] == ["q1"]


@pytest.mark.parametrize(("bend", "singular"), [(1e-6, False), (1e-12, True), (0.0, True)])
def test_an_arm_is_singular_to_a_billionth_of_its_size(bend: float, singular: bool) -> None:
    """A stretched SCARA: the smallest singular value grows with the bend of its elbow."""
    found = singularity(arm("scara"), [0.3, bend, 0.1, 0.4])
    assert (found.singular, found.rank, found.full_rank) == (singular, 3 if singular else 4, 4)
    assert (len(found.lost), len(found.idle)) == (int(singular), int(singular))
    matrix = jacobian(arm("scara"), [0.3, bend, 0.1, 0.4])
    for direction in found.lost:
        assert np.linalg.norm(direction) == pytest.approx(1)
        assert matrix.T @ direction == pytest.approx(np.zeros(4), abs=1e-9)


def test_a_jacobian_s_answer_is_in_metres_and_radians_per_second() -> None:
    answer = q.jacobian_answer("scara", (10, 20, 100, 30), 0, (180, 0, 50, 0))
    assert (answer["frame"], answer["rank"], answer["singular"]) == (0, 4, False)
    x, y, _ = q.fk_answer("scara", (10, 20, 100, 30))["position_m"]
    assert answer["velocity_m_s"] == pytest.approx([-math.pi * y, math.pi * x, -0.05])
    assert answer["angular_velocity_deg_s"] == pytest.approx([0, 0, 180])
    assert "velocity_m_s" not in q.jacobian_answer("scara", (10, 20, 100, 30))
    base = q.jacobian_answer("omni", ())
    assert np.array(base["jacobian"]) @ np.array(base["inverse"]) == pytest.approx(np.eye(3), abs=1e-12)
    assert base["rank"] == 3
    for ask in ((("omni", (1,)), {}), (("omni", (), 1), {}), (("omni", (), 0, (1,)), {})):
        with pytest.raises(InputError, match="is the same everywhere"):
            q.jacobian_answer(*ask[0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: q.fk_answer("omni", (1, 2)), "has 3 wheels, not 2"),
        (lambda: q.ik_answer("omni", (1, 2)), "takes vx vy turn, not 2 numbers"),
        (lambda: q.ik_answer("scara", (1, 2)), "scara takes x y z or x y z roll, not 2 numbers"),
        (lambda: q.transform_answer("Rx(1)", (1, 2, 1.1e9)), "1.1e+09 is not a number from -1e+09 to 1e+09"),
        (lambda: q.fk_answer("scara", (1, 2, -2e9, 4)), "-2e+09 is not a number from -1e+09 to 1e+09"),
        (lambda: q.fk_answer("scara", (1, 2, math.nan, 4)), "1, 2, nan, 4: every number must be finite"),
        (
            lambda: q.transform_answer("Rx(1)", (1,) * 5),
            "a point has three coordinates, or four homogeneous ones, not 5",
        ),
        (lambda: q.jacobian_symbolic("scara", 1), "in the frame 0 or n, not 1"),
        (lambda: q.fk_symbolic("scara", "html"), "unknown style 'html'"),
        (lambda: q.orientation_answer("zyz2", (1, 2, 3)), "'zyz2' is not a form of an orientation"),
    ],
)
def test_what_cannot_be_asked_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        call()


def test_a_number_may_be_as_large_as_a_thousand_kilometres() -> None:
    assert q.transform_answer("Tx(0)", (1e9, -1e9, 0))["point"] == [1e9, -1e9, 0]


def test_joint_positions_are_shown_in_degrees_and_millimetres() -> None:
    scara = arm("scara")
    assert q.joint_text(q.positions_of(scara, np.array([math.pi / 6, -1e-9, 0.1234567, 0.0]))) == (
        "q1 30.000°  q2 0.000°  q3 123.457 mm  q4 0.000°"
    )


# ---- statics --------------------------------------------------------------------------------------------


def test_masses_of_links_and_payload_load_the_joints_before_them() -> None:
    """Each mass by the height of its centre: differences of m g z, with nothing taken from the Jacobian."""
    base = arm("rv-m1")
    joints = tuple(
        replace(joint, mass=0.5 + index, centre=(0.02 * index, 0.01, -0.03))
        for index, joint in enumerate(base.joints)
    )
    robot = replace(base, joints=joints, payload=0.7)
    at, step = np.array([0.3, 0.5, -0.8, 0.4, 0.2]), 1e-6

    def energy(position: np.ndarray) -> float:
        total = robot.payload * fk(robot, position)[2, 3]
        for index, joint in enumerate(joints):
            cut = replace(robot, rows=robot.rows[: index + 1], tool=FixedFrame(*joint.centre))
            total += joint.mass * fk(cut, position)[2, 3]
        return float(9.80665 * total)

    slopes = [(energy(at + step * unit) - energy(at - step * unit)) / (2 * step) for unit in np.eye(5)]
    assert statics.gravity_torques(robot, at) == pytest.approx(slopes, abs=1e-6)
    assert statics.gravity_torques(base, at).tolist() == [0.0] * 5


def test_an_arm_has_masses_if_any_is_stated() -> None:
    base: Arm = arm("scara")
    one = replace(base, joints=(replace(base.joints[0], mass=0.1), *base.joints[1:]))
    assert [statics.has_masses(each) for each in (base, one, replace(base, payload=0.1))] == [
        False,
        True,
        True,
    ]


@pytest.mark.parametrize(("beyond", "falls"), [(-1e-3, False), (0.9e-6, False), (1e-4, True)])
def test_a_centre_of_mass_on_the_edge_of_the_feet_is_carried_up_to_a_millionth(
    beyond: float, falls: bool
) -> None:
    feet = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]])
    forces = statics.foot_forces(feet, np.ones((1, 3), bool), np.array([-beyond, 0.5]), 10.0)
    assert np.isnan(forces).all() == falls


def test_many_frames_are_solved_in_blocks_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(1)
    feet = random.normal(size=(7, 4, 2))
    down = np.ones((7, 4), bool)
    whole = statics.foot_forces(feet, down, np.zeros(2), 1.0)
    monkeypatch.setattr(statics, "BLOCK", 3)
    np.testing.assert_array_equal(statics.foot_forces(feet, down, np.zeros(2), 1.0), whole)
