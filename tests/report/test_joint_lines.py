"""The joints of an arm frame by frame as CSV, in degrees and millimetres."""

from __future__ import annotations

import math

import numpy as np

from servogen.kinematics.catalogue import arm
from servogen.motion.trajectory import JointTrajectory
from servogen.report.motion_table import joint_lines
from servogen.units import Clock, Cycles


def test_turning_joints_are_in_degrees_and_sliding_ones_in_millimetres() -> None:
    scara = arm("scara")
    kinds = [joint.turning for joint in scara.joints]
    assert True in kinds
    assert False in kinds
    row = [math.radians(30) if turning else 0.025 for turning in kinds]
    frames = np.array([[0.0] * len(row), row])
    names = tuple(joint.name for joint in scara.joints)
    trajectory = JointTrajectory(
        joints=names, angles=frames, period=Cycles(20_000), clock=Clock(4_000_000), loop_start=0
    )
    header, first, second = joint_lines(trajectory, scara)
    units = ["deg" if turning else "mm" for turning in kinds]
    assert header.split(",") == [
        "time_s",
        *(f"{name}_{unit}" for name, unit in zip(names, units, strict=True)),
    ]
    assert first.split(",") == ["0", *["0.000000"] * len(row)]
    assert second.split(",") == ["0.02", *("30.000000" if turning else "25.000000" for turning in kinds)]
