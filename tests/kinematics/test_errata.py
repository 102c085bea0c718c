"""The errata of the sources: for each row, what is printed is wrong and what stands here is right.

Row by row as in the specification's tables: kinematics, then the servo labs, the omni base, the arm language.
"""

from dataclasses import replace
from itertools import pairwise
from math import atan, atan2, cos, degrees, pi, radians, sin, sqrt

import numpy as np
import pytest

from servogen.kinematics import transforms as t
from servogen.kinematics.catalogue import arm, robot
from servogen.kinematics.forward import fk, fk_position, link_frames
from servogen.kinematics.inverse.solve import ik_all
from servogen.kinematics.jacobian import jacobian
from servogen.kinematics.orientation import from_angles, to_angles
from servogen.kinematics.transforms import parse

ANGLES = np.array([0.3, -0.7, 1.1, 0.5, -0.9, 2.0])
(C1, C2, C3, C4, C5, C6), (S1, S2, S3, S4, S5, S6) = np.cos(ANGLES), np.sin(ANGLES)


# ---- kinematics -----------------------------------------------------------------------------------------


def test_lab_2_third_column_of_the_total_matrix() -> None:
    total = parse("Ry(30) Tx(50) Rz(60)")
    assert total[:3, 2] == pytest.approx([0.5, 0, 0.866], abs=5e-4)
    printed = total.copy()
    printed[:3, 2] = 0.5, 0, 0
    assert not t.is_rotation(printed[:3, :3])
    assert t.apply(total, [2, 4, 1]) == pytest.approx([41.6673, 3.7321, -22.9019], abs=5e-5)
    assert t.apply(printed, [2, 4, 1]) != pytest.approx([41.6673, 3.7321, -22.9019], abs=0.1)


def test_lab_2_rotation_about_z_has_a_one_at_3_3() -> None:
    right = t.rot("z", 0.4)
    printed = right.copy()
    printed[2, 2] = 0
    assert t.is_rotation(right)
    assert not t.is_rotation(printed)


def test_lab_2_equation_2_5_turns_about_y_by_the_angle_of_y() -> None:
    theta_x, theta_y = 0.4, 0.9
    printed = np.array([[cos(theta_x), 0, sin(theta_x)], [0, 1, 0], [-sin(theta_x), 0, cos(theta_x)]])
    assert t.rot("y", theta_y)[0, 2] == pytest.approx(sin(theta_y))
    assert np.abs(t.rot("y", theta_y) - printed).max() > 0.1


def test_lab_3_equation_3_2_translations_have_a_one_at_4_4() -> None:
    printed = t.translation(0, 0, 0.3)
    printed[3, 3] = 0
    row = printed @ t.rotation("z", 0.4) @ t.translation(0.2, 0, 0) @ t.rotation("x", 0.5)
    assert row[3, 3] == 0
    right = t.translation(0, 0, 0.3) @ t.rotation("z", 0.4) @ t.translation(0.2, 0, 0) @ t.rotation("x", 0.5)
    assert right[:3, 3] == pytest.approx([0.2 * cos(0.4), 0.2 * sin(0.4), 0.3])
    assert right[3, 3] == 1


def test_lab_3_equations_3_4_and_3_5_have_the_sine_in_y() -> None:
    scara = arm("scara")
    q = np.array([0.4, 0.9, 0.0, 0.0])
    frames = link_frames(scara, q)
    first, second = frames[1], t.inverse(frames[1]) @ frames[2]
    for link, length, angle in ((first, 0.4, 0.4), (second, 0.3, 0.9)):
        assert link[1, 3] == pytest.approx(length * sin(angle))
        assert abs(link[1, 3] - length * cos(angle)) > 0.01


def test_lab_4_matrix_and_coordinates_belong_to_different_angles() -> None:
    scara = arm("scara")
    matrix_at = fk_position(scara, [pi / 3, pi / 3, 0.2, pi])
    printed = fk_position(scara, [pi / 6, pi / 3, 0.2, pi])
    assert matrix_at == pytest.approx([0.05, 0.60622, 0.25], abs=5e-6)
    assert printed == pytest.approx([0.34641, 0.5, 0.25], abs=5e-6)


def test_lab_5_equation_5_22_must_divide_by_the_length_of_the_arm() -> None:
    lab = arm("wrist-arm")
    q = np.array([0.4, 0.9, 0.3])
    pose = fk(lab, q)
    up, across = pose[2, 3] - lab.length["l1"], sqrt(pose[2, 0] ** 2 + pose[2, 1] ** 2)
    reach = lab.length["l2"] + lab.length["l3"]
    assert atan2(up / reach, across) == pytest.approx(q[1])
    assert abs(atan(up / across) - q[1]) > 0.1
    assert any(np.allclose(each, q) for each in ik_all(lab, pose[:3, 3], pose[:3, :3]))


def test_lab_7_is_in_the_standard_convention() -> None:
    lab = arm("anthropomorphic")
    q = ANGLES[:3]
    right = -(lab.length["l2"] * C2 + lab.length["l3"] * cos(q[1] + q[2])) * S1
    assert fk_position(lab, q)[0] == pytest.approx(right)
    assert abs(fk_position(replace(lab, convention="modified"), q)[0] - right) > 0.01


def test_002_entry_1_3_of_the_rpy_matrix() -> None:
    theta, phi, alpha = 0.4, 0.9, -0.6
    entry = from_angles([theta, phi, alpha], "ZYX")[0, 2]
    assert entry == pytest.approx(sin(theta) * sin(alpha) + cos(theta) * sin(phi) * cos(alpha))
    assert abs(entry - (sin(phi) * sin(alpha) + cos(theta) * sin(phi) * cos(alpha))) > 0.05


def rv_m1_as_printed(q: np.ndarray, sign_of_n_y: float) -> np.ndarray:
    k = arm("rv-m1").length
    c1, s1, c5, s5 = cos(q[0]), sin(q[0]), cos(q[4]), sin(q[4])
    two, three, four = np.cumsum(q[1:4])
    reach = k["a2"] * cos(two) + k["a3"] * cos(three) - k["d5"] * sin(four)
    up = k["d1"] - k["a2"] * sin(two) - k["a3"] * sin(three) - k["d5"] * cos(four)
    c, s = cos(four), sin(four)
    return np.array(
        [
            [c1 * c * c5 + s1 * s5, -c1 * c * s5 + s1 * c5, -c1 * s, c1 * reach],
            [s1 * c * c5 + sign_of_n_y * c1 * s5, -s1 * c * s5 - c1 * c5, -s1 * s, s1 * reach],
            [-s * c5, s * s5, -c, up],
            [0, 0, 0, 1],
        ]
    )


def test_002_closed_form_of_the_rv_m1_counts_three_joints_the_other_way() -> None:
    q = ANGLES[:5]
    pose = fk(arm("rv-m1"), q)
    assert np.abs(rv_m1_as_printed(q, -1.0) - pose).max() > 0.1
    other_way = q * [1, -1, -1, -1, 1]
    np.testing.assert_allclose(rv_m1_as_printed(other_way, -1.0), pose, atol=1e-15)
    assert np.abs(rv_m1_as_printed(other_way, 1.0) - pose).max() > 0.1


def irb_as_printed() -> dict[str, float]:
    k = arm("irb6400c").length
    l1, l2, l3, l4 = k["l1"], k["l2"], k["l3"], k["l4"]
    x1, x2 = C4 * C5 * C6 - S4 * S6, S4 * C5 * C6 + C4 * S6
    w1, w2 = -C4 * C5 * C6 - S4 * S6, -S4 * C5 * C6 + C4 * S6
    return {
        "n_x": (C1 * C2 * S3 + S1 * C3) * x1 + C1 * S2 * x2 + (-C1 * C2 * C3 + S1 * S3) * S5 * C6,
        "n_y": (-S1 * C2 * S3 + S1 * C3) * x1 + S1 * S2 * x2 + (-S1 * C2 * C3 - C1 * S3) * S5 * C6,
        "n_z": -S2 * S3 * x1 + C2 * x2 + S2 * C3 * S5 * C6,
        "o_x": (C1 * C2 * S3 + S1 * C3) * w1 + C1 * S2 * w2 - (-C1 * C2 * C3 + S1 * S3) * S5 * C6,
        "o_y": (-S1 * C2 * S3 + S1 * C3) * w1 + S1 * S2 * w2 - (-S1 * C2 * C3 - C1 * S3) * S5 * C6,
        "o_z": -S2 * S3 * w1 + C2 * w2 - S2 * C3 * S5 * C6,
        "p_x": (C1 * C2 * S3 + S1 * C3) * l4 * C4 * S5
        + C1 * S2 * l4 * S4 * S5
        + (C1 * C2 * C3 + S1 * S3) * (-l4 * C5 + l3)
        - l2 * C1 * C2 * S3
        - l2 * S1 * C3
        - l1 * S1,
        "p_y": (-S1 * C2 * S3 - C1 * C3) * l4 * C4 * S5
        + S1 * S2 * l4 * S4 * S5
        + (-C1 * C2 * C3 - C1 * S3) * (-l4 * C5 + l3)
        - l2 * S1 * C2 * S3
        - l2 * C1 * C3
        + l1 * C1,
        "p_z": -S2 * S3 * l4 * C4 * S5 + C2 * l4 * S4 * S5 + S2 * C3 * (-l4 * C5 + l3) + l2 * S2 * S3,
    }


@pytest.mark.parametrize("entry", ["n_x", "n_y", "n_z", "o_x", "o_y", "o_z", "p_x", "p_y", "p_z"])
def test_002_all_nine_printed_entries_of_the_irb_6400c_are_wrong(entry: str, product_of_rows) -> None:
    irb = arm("irb6400c")
    pose = fk(irb, ANGLES)
    value = pose["xyz".index(entry[2]), "noap".index(entry[0])]
    assert value == pytest.approx(product_of_rows(irb, ANGLES)["xyz".index(entry[2]), "noap".index(entry[0])])
    assert abs(irb_as_printed()[entry] - value) > 1e-3


def test_004_the_last_angle_of_rpy_comes_from_a() -> None:
    phi, theta, eta = 0.4, -0.9, 1.3
    _, o, a = from_angles([phi, theta, eta], "ZYX").T
    below = -o[0] * sin(phi) + o[1] * cos(phi)
    assert atan2(a[0] * sin(phi) - a[1] * cos(phi), below) == pytest.approx(eta)
    assert abs(atan2(o[0] * sin(phi) - o[1] * cos(phi), below) - eta) > 0.1
    assert to_angles(from_angles([phi, theta, eta], "ZYX"), "ZYX")[2] == pytest.approx(eta)


def test_004_sine_of_the_double_angle() -> None:
    x, y = 0.4, 0.9
    assert sin(2 * x) == pytest.approx(2 * sin(x) * cos(x))
    assert abs(sin(2 * x) - 2 * sin(x) * cos(y)) > 0.1


def test_000_cosine_rule_with_a_plus_has_the_outer_angle() -> None:
    a, b, inner = 3.0, 2.0, 0.8
    c = np.hypot(a - b * cos(inner), b * sin(inner))
    outer = pi - inner
    assert c**2 == pytest.approx(a * a + b * b + 2 * a * b * cos(outer))
    assert abs(c**2 - (a * a + b * b + 2 * a * b * cos(inner))) > 1


def test_step_8_of_dh_takes_where_x_k_meets_the_z_before() -> None:
    frames = link_frames(arm("irb6400c"), ANGLES)
    for before, after in pairwise(frames[:-1]):
        # b_k lies on z_{k-1}, and going a_k along x_k from it ends at the origin of k
        step = after[:3, 3] - before[:3, 3]
        d = step @ before[:3, 2]
        b = before[:3, 3] + d * before[:3, 2]
        assert np.cross(after[:3, 3] - b, after[:3, 0]) == pytest.approx([0, 0, 0], abs=1e-12)
    # X_k meets its own Z_k at the origin of k: that would make a_k 0 for every link
    lengths = [row.a.value(arm("irb6400c").length) for row in arm("irb6400c").rows]
    assert any(lengths)


def test_step_13_of_dh_goes_up_to_k_equal_n(product_of_rows) -> None:
    irb = arm("irb6400c")
    shortened = replace(irb, rows=irb.rows[:-1])
    assert np.abs(product_of_rows(shortened, ANGLES) - fk(irb, ANGLES)).max() > 0.1


def test_002_properties_1_and_2_of_a_rotation_are_swapped() -> None:
    b_in_a = t.rot("z", 0.4) @ t.rot("x", 0.9)  # takes points of {B} to {A}
    x_of_b, x_of_a = np.array([1.0, 0, 0]), np.array([1.0, 0, 0])
    assert b_in_a @ x_of_b == pytest.approx(b_in_a[:, 0])  # the columns are {B}'s unit vectors in {A}
    assert b_in_a.T @ x_of_a == pytest.approx(b_in_a[0])  # the rows are {A}'s unit vectors in {B}
    assert b_in_a[0] != pytest.approx(b_in_a[:, 0], abs=0.1)


def test_002_height_of_the_theta_r_arm_is_d1() -> None:
    theta_r = arm("theta-r")
    assert fk_position(theta_r, [0.4, 0.25])[2] == pytest.approx(theta_r.length["d1"])
    assert theta_r.length["d1"] != 0.25


def test_lab_4_final_height_is_0_25() -> None:
    scara = arm("scara")
    assert fk_position(scara, [pi / 6, pi / 3, 0.2, pi])[2] == pytest.approx(0.25)
    assert fk_position(scara, [0, 0, 0, 0])[2] == pytest.approx(0.45)


def test_lab_5_atan2_goes_from_minus_180_to_180_and_is_pi_on_the_negative_axis() -> None:
    def printed(s: float, c: float) -> float:
        sign = (s > 0) - (s < 0)
        if c == 0:
            return pi / 2 * sign
        return atan(s / c) + (pi * sign if c < 0 else 0.0)

    assert printed(0, -1) == 0
    assert atan2(0, -1) == pi
    assert t.rot("z", pi)[0, 0] == -1
    assert degrees(atan2(-1, -1)) == -135
    assert t.wrapped(radians(225)) == pytest.approx(radians(-135))


def test_lab_7_entry_1_2_of_the_jacobian_in_its_own_frame() -> None:
    lab = arm("anthropomorphic")
    q = ANGLES[:3]
    entry = jacobian(lab, q, "n")[0, 1]
    assert entry == pytest.approx(lab.length["l2"] * S3)
    assert abs(entry - lab.length["l2"] * (S2 + C2)) > 0.05


def test_004_cylindrical_matrix_has_the_height_c() -> None:
    r, alpha, c = 0.4, 0.7, 0.9
    assert t.cylindrical(r, alpha, c)[2, 3] == c
    assert c != r


def test_004_spherical_matrix() -> None:
    beta, gamma = 0.7, -0.5
    matrix = t.spherical(0.4, beta, gamma)
    assert matrix[1, 0] == pytest.approx(cos(beta) * sin(gamma))
    assert matrix[0, 1] == pytest.approx(-sin(gamma))
    for place, wrong in (((1, 0), cos(beta) * cos(gamma)), ((0, 1), sin(gamma))):
        printed = matrix[:3, :3].copy()
        printed[place] = wrong
        assert not t.is_rotation(printed)


def test_004_only_the_rotation_times_its_transpose_is_one() -> None:
    frame = t.translation(1, 2, 3) @ t.rotation("z", 0.4)
    assert np.abs(frame @ frame.T - np.eye(4)).max() > 1
    np.testing.assert_allclose(frame[:3, :3] @ frame[:3, :3].T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(frame @ t.inverse(frame), np.eye(4), atol=1e-15)


def test_004_rectangular_is_3p_and_cylindrical_r2p() -> None:
    kinds = {name: [joint.kind for joint in arm(name).joints] for name in ("cartesian", "cylindrical-r2p")}
    assert kinds["cartesian"] == ["sliding"] * 3
    assert kinds["cylindrical-r2p"] == ["turning", "sliding", "sliding"]


# ---- omni base ------------------------------------------------------------------------------------------


def test_10_3_to_10_5_swap_rows_and_columns_and_10_5_loses_a_minus() -> None:
    base = robot("omni")
    assert not hasattr(base, "joints")
    r, distance, half = base.wheel_radius, base.wheel_distance, sqrt(3) / 2
    body = np.array([0.3, -0.2, 0.7])
    printed = np.array([[half, -distance, -0.5], [0, -distance, 1], [-half, -distance, -0.5]]) / r
    direct = r * np.array(
        [[1 / sqrt(3), -1 / sqrt(3), 0], [-1 / 3, -1 / 3, 2 / 3], [-1 / (3 * distance)] * 3]
    )
    np.testing.assert_allclose(direct @ base.wheel_speeds(body), body, atol=1e-12)
    assert np.abs(direct @ printed @ body - body).max() > 0.1
    swapped = printed[[0, 2, 1]][:, [0, 2, 1]]
    np.testing.assert_allclose(swapped @ body, base.wheel_speeds(body), atol=1e-12)
    without_minus = printed.copy()
    without_minus[1, 1] = distance / r
    assert np.abs(without_minus[[0, 2, 1]][:, [0, 2, 1]] @ body - base.wheel_speeds(body)).max() > 0.1
