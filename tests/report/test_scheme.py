"""The kinematic scheme: where each joint's axis is, and the file that shows it."""

import re
from pathlib import Path

import numpy as np
import pytest

from servogen.kinematics.catalogue import arm, robot
from servogen.report.scheme import joint_axes, scheme_plot


def test_the_axes_of_a_scara_are_vertical_and_its_arms_apart() -> None:
    """Three joints turn about verticals and one slides along one; l1 = 400 mm, l2 = 300 mm (the notes)."""
    scara = arm("scara")
    home = np.array([[joint.home for joint in scara.joints]])
    found = list(joint_axes(scara, home))
    assert [name for name, *_ in found] == [joint.name for joint in scara.joints]
    assert sorted(kind for _, kind, *_ in found) == ["sliding", "turning", "turning", "turning"]
    assert all(abs(axis[2]) == pytest.approx(1) for *_, axis in found)
    turning = [at for _, kind, at, _ in found if kind == "turning"]
    assert np.hypot(*(turning[1] - turning[0])[:2]) == pytest.approx(0.4)
    assert np.hypot(*(turning[2] - turning[1])[:2]) == pytest.approx(0.3)


@pytest.mark.parametrize("name", ["scara", "rv-m1", "leg"])
def test_a_scheme_is_drawn_with_the_name_of_each_joint(tmp_path: Path, name: str) -> None:
    pytest.importorskip("matplotlib")
    file = tmp_path / "scheme.svg"
    scheme_plot(arm(name), file)
    text = file.read_text("utf-8")
    labels = [label.split(", ") for label in re.findall("<!-- (.*?) -->", text)]
    for joint in arm(name).joints:
        rows = sum(row.joint is not None and arm(name).joints[row.joint] is joint for row in arm(name).rows)
        assert sum(label.count(joint.name) for label in labels) == 2 * rows, "once in each view"


def labels_of(name: str, file: Path) -> list[str]:
    scheme_plot(robot(name), file)
    return [
        name for label in re.findall("<!-- (.*?) -->", file.read_text("utf-8")) for name in label.split(", ")
    ]


@pytest.mark.parametrize("name", ["hexapod", "quadruped-coxa-femur-tibia"])
def test_a_walking_robot_has_every_foot_by_name_and_the_joints_of_one_leg(tmp_path: Path, name: str) -> None:
    pytest.importorskip("matplotlib")
    found = labels_of(name, tmp_path / "scheme.svg")
    for limb in robot(name).limbs:
        assert found.count(limb.name) == 2, "once in each view"
    for joint in robot(name).limbs[0].arm.joints:
        assert found.count(joint.name) in (2, 4), "the lab's leg has two parallel axes of one joint"


def test_a_base_is_drawn_from_above_with_its_wheels_by_number(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    found = labels_of("omni", tmp_path / "scheme.svg")
    assert [found.count(f"wheel {number}") for number in (1, 2, 3, 4)] == [1, 1, 1, 0]
    assert "from above" in found and "from the side" not in found
