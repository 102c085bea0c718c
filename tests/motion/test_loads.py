"""A static torque beyond the servo's rated one is one warning, for walking robots and arms alike."""

from dataclasses import replace

import numpy as np
import pytest

from servogen.errors import Location
from servogen.motion.loads import check_torque
from servogen.robot.servo_models import servo_model

S3001 = servo_model("futaba-s3001")  # 34 N·cm


def test_a_torque_beyond_the_rated_one_is_reported_with_its_worst_frame() -> None:
    (found,) = check_torque(
        S3001, "shoulder", np.array([0.1, np.nan, 0.36, 0.35]), place=Location("a.toml", 3)
    )
    assert (found.severity, found.code, found.location) == ("warning", "too-heavy", Location("a.toml", 3))
    assert found.message.startswith("holding shoulder in place needs 0.36 N·m in frame 2, ")
    assert found.message.endswith("is rated 0.34 N·m")


def test_the_servo_and_a_detail_of_the_frame_are_added() -> None:
    (found,) = check_torque(S3001, "shoulder", np.array([0.1, 0.4]), servo="one", detail=lambda n: f"<{n}>")
    assert found.message.startswith("one: holding shoulder ") and found.message.endswith("; <1>")


@pytest.mark.parametrize("torque", [[0.34, 0.1], [0.34 * (1 + 1e-9)], [np.nan, np.nan], [0.0]])
def test_a_torque_that_the_servo_has_is_not_a_warning(torque: list[float]) -> None:
    assert check_torque(S3001, "shoulder", np.array(torque)) == ()


def test_a_model_without_a_stated_torque_is_not_checked() -> None:
    assert check_torque(replace(S3001, torque_nm=None), "shoulder", np.array([9.0])) == ()
