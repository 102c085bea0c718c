"""The CSV of motions: every cell of a few frames made by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.pulse import Channel, Pulse, PulseSchedule, Run
from servogen.report.motion_table import frame_lines, walk_lines, widths_us
from servogen.report.tracks import Track
from servogen.units import Clock, Cycles

NAN = math.nan


def schedule() -> PulseSchedule:
    """Two frames of 20 ms and one more; a cycle is half a microsecond."""
    channels = (Channel("a", "RB0", ""), Channel("w", "RB1", ""))
    lead_in = Run(1, (Pulse(Cycles(0), Cycles(2001)), None))
    loop = Run(2, (Pulse(Cycles(0), Cycles(3000)), Pulse(Cycles(0), Cycles(1))))
    return PulseSchedule(Clock(8_000_000), Cycles(40_000), channels, (lead_in,), (loop,))


def job() -> Any:
    angles = np.radians([[0.0, NAN], [90.00004, -45.0], [90.00006, 0.00001]])
    servos = [
        SimpleNamespace(name="a", model=SimpleNamespace(continuous=False)),
        SimpleNamespace(name="w", model=SimpleNamespace(continuous=True)),
    ]
    return SimpleNamespace(servos=servos, trajectory=SimpleNamespace(angles=angles))


def track(name: str) -> Track:
    planned = np.array([[NAN] * 3, [0.1, -0.02, 0.0], [0.0000001, 0, 0.3]])
    return Track(name, "foot", planned, planned, planned)


def test_widths_are_those_of_the_lead_in_and_the_loop_in_microseconds() -> None:
    assert widths_us(schedule()) == pytest.approx(
        np.array([[1000.5, NAN], [1500, 0.5], [1500, 0.5]]), nan_ok=True
    )


def test_a_line_has_seconds_degrees_microseconds_and_millimetres() -> None:
    assert list(frame_lines(job(), schedule(), [track("L1")])) == [
        "time_s,a_deg,w_deg_s,a_width_us,w_width_us,x_mm,y_mm,z_mm",
        "0.000000,0.0000,,1000.500,,,,",
        "0.020000,90.0000,-45.0000,1500.000,0.500,100.0000,-20.0000,0.0000",
        "0.040000,90.0001,0.0000,1500.000,0.500,0.0001,0.0000,300.0000",
    ]


def test_several_ends_are_named_and_none_has_no_columns() -> None:
    header, *_ = frame_lines(job(), schedule(), [track("L1"), track("R1")])
    points = "L1_x_mm,L1_y_mm,L1_z_mm,R1_x_mm,R1_y_mm,R1_z_mm"
    assert header == f"time_s,a_deg,w_deg_s,a_width_us,w_width_us,{points}"
    header, first, *_ = frame_lines(job(), schedule(), [])
    assert header == "time_s,a_deg,w_deg_s,a_width_us,w_width_us"
    assert first == "0.000000,0.0000,,1000.500,"


def test_a_walk_has_its_joints_its_feet_what_is_on_the_ground_and_its_margin() -> None:
    trajectory = SimpleNamespace(
        joints=("L_a", "R_a"),
        angles=np.radians([[30.0, -30], [0, 45]]),
        clock=Clock(4_000_000),
        period=Cycles(20_000),
    )
    walk: Any = SimpleNamespace(
        trajectory=trajectory,
        legs=("L", "R"),
        feet=np.array([[[0.1, 0.05, -0.1], [0.1, -0.05, -0.1]], [[0.2, 0.05, 0], [0, -0.05, -0.1]]]),
        ground=np.array([[True, True], [False, True]]),
        margins=np.array([0.0123456, -math.inf]),
    )
    feet = "L_x_mm,L_y_mm,L_z_mm,R_x_mm,R_y_mm,R_z_mm"
    assert list(walk_lines(walk)) == [
        f"time_s,L_a_deg,R_a_deg,{feet},L_ground,R_ground,margin_mm",
        "0.000000,30.0000,-30.0000,100.0000,50.0000,-100.0000,100.0000,-50.0000,-100.0000,1,1,12.3456",
        "0.020000,0.0000,45.0000,200.0000,50.0000,0.0000,0.0000,-50.0000,-100.0000,0,1,",
    ]
