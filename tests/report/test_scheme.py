"""The kinematic scheme: where each joint's axis is, and the file that shows it."""

import re
from pathlib import Path

import numpy as np
import pytest

from servogen.kinematics.catalogue import arm
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
