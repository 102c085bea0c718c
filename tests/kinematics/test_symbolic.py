"""Symbolic kinematics: the table's forms, and the numeric code against it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk
from servogen.kinematics.jacobian import jacobian
from servogen.kinematics.symbolic import SymbolicKinematics, symbolic_fk, symbolic_jacobian, text_of
from servogen.robot.model import DHRow, Length

# what the specification prints, with the joints' and lengths' names
POSITIONS = {
    "theta-r": ["q2*sin(q1)", "-q2*cos(q1)", "d1"],
    "theta1-theta2": ["l1*cos(q1) + l2*cos(q1 + q2)", "l1*sin(q1) + l2*sin(q1 + q2)", "0"],
    "cylindrical": ["cos(q1)*(q3 + l4)", "sin(q1)*(q3 + l4)", "q2 + l1"],
    "scara": ["l1*cos(q1) + l2*cos(q1 + q2)", "l1*sin(q1) + l2*sin(q1 + q2)", "l0 - l3 - q3 - l4"],
    "wrist-arm": ["(l2+l3)*cos(q1)*cos(q2)", "(l2+l3)*sin(q1)*cos(q2)", "(l2+l3)*sin(q2) + l1"],
    "anthropomorphic": ["-(l2*cos(q2) + l3*cos(q2+q3))*sin(q1)", "(l2*cos(q2) + l3*cos(q2+q3))*cos(q1)",
        "l2*sin(q2) + l3*sin(q2+q3)"],
    "rv-m1": ["cos(q1)*(a2*cos(q2) + a3*cos(q2+q3) + d5*sin(q2+q3+q4))",
        "sin(q1)*(a2*cos(q2) + a3*cos(q2+q3) + d5*sin(q2+q3+q4))",
        "d1 + a2*sin(q2) + a3*sin(q2+q3) - d5*cos(q2+q3+q4)"],
    "cartesian": ["q3", "q2", "q1"],
    "cylindrical-r2p": ["q3*cos(q1)", "q3*sin(q1)", "q2"],
    "spherical": ["q3*cos(q1)*sin(q2)", "q3*sin(q1)*sin(q2)", "q3*cos(q2)"],
    "spherical-wrist": ["q3*cos(q1)*sin(q2)", "q3*sin(q1)*sin(q2)", "q3*cos(q2)"],
    "leg": ["-(ab + cd)*sin(alpha) - bc*cos(alpha)*sin(beta)",
        "(ab + cd)*cos(alpha) - bc*sin(alpha)*sin(beta)", "-bc*cos(beta) - df"],
}  # fmt: skip


def real(text: str) -> sympy.Expr:
    names = "q1 q2 q3 q4 q5 q6 d1 d5 a2 a3 l0 l1 l2 l3 l4 ab bc cd df alpha beta"
    return sympy.sympify(text, locals={name: sympy.Symbol(name, real=True) for name in names.split()})


@pytest.mark.parametrize("name", POSITIONS)
def test_the_positions_of_the_table_come_out(name: str) -> None:
    position = links(name).position
    for found, expected in zip(position, POSITIONS[name], strict=True):
        assert sympy.simplify(found - real(expected)) == 0


@pytest.mark.parametrize("name", ["scara", "rv-m1", "anthropomorphic", "wrist-arm"])
def test_the_simplified_product_is_as_short_as_the_printed_one(name: str) -> None:
    position = links(name).position
    printed = sum(sympy.count_ops(real(each)) for each in POSITIONS[name])
    assert sympy.count_ops(position) <= printed + 2


@cache
def links(name: str) -> SymbolicKinematics:
    return symbolic_fk(arm(name))


def numbers(name: str, q: np.ndarray) -> dict[sympy.Symbol, float]:
    robot = arm(name)
    lengths = {sympy.Symbol(key, real=True): value for key, value in robot.length.items()}
    return dict(zip(links(name).joints, map(float, q), strict=True)) | lengths


def test_the_numeric_pose_is_the_symbolic_one(sampled_arm, configurations) -> None:
    product = links(sampled_arm.name).product
    for q in configurations(sampled_arm, 3):
        expected = np.array(product.subs(numbers(sampled_arm.name, q)).evalf(), dtype=float)
        np.testing.assert_allclose(fk(sampled_arm, q), expected, atol=1e-14)


def test_the_product_of_the_links_is_the_product(sampled_arm, configurations) -> None:
    found = links(sampled_arm.name)
    q = configurations(sampled_arm, 1)[0]
    product = np.eye(4)
    for matrix in (found.base, *found.links, found.tool):
        product = product @ np.array(matrix.subs(numbers(sampled_arm.name, q)).evalf(), dtype=float)
    np.testing.assert_allclose(product, fk(sampled_arm, q), atol=1e-14)


@pytest.mark.parametrize("frame", ["0", "n"])
def test_the_numeric_jacobian_is_the_symbolic_one(sampled_arm, configurations, frame: str) -> None:
    symbolic = symbolic_jacobian(sampled_arm, frame)
    for q in configurations(sampled_arm, 2):
        expected = np.array(symbolic.subs(numbers(sampled_arm.name, q)).evalf(), dtype=float)
        np.testing.assert_allclose(jacobian(sampled_arm, q, 0 if frame == "0" else "n"), expected, atol=1e-14)


def test_a_row_without_a_joint_moves_nothing() -> None:
    """A link of l1 with 50 mm at a right angle at its end: the tool's x axis is across the link."""
    plain = arm("theta1-theta2")
    bend = DHRow(theta=np.pi / 2, d=Length((), 0.02), a=Length((), 0.05), alpha=0.0, joint=None)
    robot = replace(plain, joints=plain.joints[:1], rows=(plain.rows[0], bend), closed_form=None)
    across, along = "-l1*sin(q1) - cos(q1)/20", "l1*cos(q1) - sin(q1)/20"
    column = sympy.Matrix([real(across), real(along), 0, 0, 0, 1])
    assert sympy.simplify(symbolic_jacobian(robot) - column) == sympy.zeros(6, 1)
    assert list(symbolic_jacobian(robot, "n")) == [real("l1"), real("1/20"), 0, 0, 0, 1]
    q1 = 0.4
    expected = [-0.3 * np.sin(q1) - 0.05 * np.cos(q1), 0.3 * np.cos(q1) - 0.05 * np.sin(q1), 0, 0, 0, 1]
    assert jacobian(robot, [q1])[:, 0] == pytest.approx(expected)


def test_lab_7_in_its_own_end_frame() -> None:
    expected = [
        ["0", "l2*sin(q3)", "0"], ["0", "l2*cos(q3) + l3", "l3"], ["-(l2*cos(q2) + l3*cos(q2+q3))", "0", "0"],
        ["sin(q2+q3)", "0", "0"], ["cos(q2+q3)", "0", "0"], ["0", "1", "1"],
    ]  # fmt: skip
    found = symbolic_jacobian(arm("anthropomorphic"), "n")
    for row in range(6):
        for column in range(3):
            assert sympy.simplify(found[row, column] - real(expected[row][column])) == 0


def test_the_position_columns_of_the_spherical_arm_with_a_wrist() -> None:
    expected = [
        ["-q3*sin(q1)*sin(q2)", "q3*cos(q1)*cos(q2)", "cos(q1)*sin(q2)"],
        ["q3*cos(q1)*sin(q2)", "q3*sin(q1)*cos(q2)", "sin(q1)*sin(q2)"],
        ["0", "-q3*sin(q2)", "cos(q2)"],
    ]
    found = symbolic_jacobian(arm("spherical-wrist"))
    for row in range(3):
        for column in range(3):
            assert sympy.simplify(found[row, column] - real(expected[row][column])) == 0
        assert list(found[row, 3:]) == [0, 0, 0]


def test_text_latex_and_c() -> None:
    position = symbolic_fk(arm("theta-r")).position
    assert text_of(position) == "[ q2*sin(q1)  ]\n[ -q2*cos(q1) ]\n[ d1          ]"
    assert text_of(position, "c", "p") == "p[0] = q2*sin(q1);\np[1] = -q2*cos(q1);\np[2] = d1;"
    assert "\\sin" in text_of(position, "latex")
    product = symbolic_fk(arm("theta-r")).product
    assert text_of(product, "c").splitlines()[1] == "T[0][1] = -cos(q1);"
    assert text_of(position[0], "c", "x") == "x = q2*sin(q1);"
    assert text_of(position[0]) == "q2*sin(q1)"
    with pytest.raises(InputError, match="is not a style"):
        text_of(position, "html")
