"""The analytic Jacobian is the derivative of position and angles by the joints' positions."""

from __future__ import annotations

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.kinematics import queries
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk
from servogen.kinematics.jacobian import FrameName
from servogen.kinematics.orientation import to_angles

AT = (20.0, 35.0, -30.0, 40.0, 50.0)
STEP = 1e-6


@pytest.mark.parametrize("order", ["zyx", "zyz", "xyz", "yxy", "rpy"])
def test_its_columns_are_differences_of_position_and_angles(order: str) -> None:
    robot, q = arm("rv-m1"), np.radians(AT)

    def seen(joints: np.ndarray) -> np.ndarray:
        pose = fk(robot, joints)
        return np.concatenate(
            [pose[:3, 3], to_angles(pose[:3, :3], "ZYX" if order == "rpy" else order.upper())]
        )

    steps = STEP * np.eye(len(q))
    columns = [(seen(q + step) - seen(q - step)) / (2 * STEP) for step in steps]
    found = queries.jacobian_answer("rv-m1", AT, analytic=order)["jacobian"]
    np.testing.assert_allclose(found, np.stack(columns, axis=1), atol=1e-6)


def test_where_two_axes_are_parallel_the_angles_have_no_rates() -> None:
    """A SCARA's tool points down: the second of its ZYZ angles is 180°."""
    with pytest.raises(InputError, match="zyz angles have no rates here"):
        queries.jacobian_answer("scara", (10, 20, 30, 40), analytic="zyz")


@pytest.mark.parametrize(
    ("name", "at", "frame", "order", "says"),
    [
        ("rv-m1", AT, 0, "zz", "order of three"),
        ("rv-m1", AT, "n", "zyx", "base's frame"),
        ("omni", (), 0, "zyx", "no positions, frame or angles"),
    ],
)
def test_what_is_no_order_or_has_no_angles_is_refused(
    name: str, at: tuple[float, ...], frame: FrameName, order: str, says: str
) -> None:
    with pytest.raises(InputError, match=says):
        queries.jacobian_answer(name, at, frame, analytic=order)
