"""Every key with a range takes its ends and refuses what is just beyond, in jobs, robot and servo files.

Where the numbers come from: lengths up to 100 m, times up to 11.6 days, masses up to 10 t, torques up to
1000 N·m and currents up to 1000 A are beyond anything that a servo moves; a turn is at most once round in
each cycle; the PIC16F84 has 13 I/O pins (DS30430D, section 5), so 13 servos.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pytest
from pydantic import ValidationError

from servogen.engines.stream.section import StreamTable
from servogen.errors import InputError
from servogen.job import schema
from servogen.kinematics.hexapod import HexapodTable, MountTable
from servogen.kinematics.omni import OmniTable
from servogen.robot import arm_file, servo_models
from servogen.toml import file as toml_file
from servogen.toml.file import Table

TINY = 5e-324
METRES, DAYS, TONNES = 100_000.0, 1_000_000.0, 1e7

# The keys that a table needs besides the one that is tried.
NEEDED: Mapping[type[Table], Mapping[str, Any]] = {
    schema.ChipTable: {"device": "PIC16F84A", "clock_hz": 4},
    schema.ServoTable: {"name": "a", "pin": "RB0", "model": "m"},
    schema.LegTable: {"ab_mm": 1.0, "bc_mm": 1.0, "cd_mm": 1.0, "df_mm": 1.0, "alpha": "a", "beta": "b"},
    schema.ProgramTable: {"file": "a.rvm"},
    schema.RoutineTable: {"name": "turn"},
    schema.DriveTable: {"wheels": ("a",), "speed_mm_s": 1.0},
    schema.SupplyTable: {"voltage_v": 5.0},
    schema.SensorTable: {"pin": "RA0", "kind": "foot"},
    servo_models.PointTable: {"width_us": 1000.0},
    servo_models.SupplyTable: {"supply_v": 5.0},
    arm_file.JointTable: {"name": "q"},
    OmniTable: {"name": "o", "wheel_diameter_mm": 1.0, "wheel_distance_mm": 1.0},
    HexapodTable: {"name": "h"},
    arm_file.ArmTable: {"name": "a"},
}

ABOVE_0 = (TINY, 0.0)
"""The lowest number that is taken, and the highest that is not."""
FROM_0 = (0.0, -TINY)
NONE = (None, None)


def up_to(last: float) -> tuple[float, float]:
    return last, math.nextafter(last, math.inf)


def down_to(first: float) -> tuple[float, float]:
    return first, math.nextafter(first, -math.inf)


Ends = tuple[Any, Any]
RANGES: list[tuple[type[Table], str, Ends, Ends]] = [
    (schema.ChipTable, "clock_hz", (1, 0), NONE),
    (schema.ServoTable, "supply_v", ABOVE_0, NONE),
    *((schema.LegTable, key, FROM_0, up_to(METRES)) for key in ("ab_mm", "cd_mm", "df_mm", "tolerance_mm")),
    (schema.LegTable, "bc_mm", down_to(0.001), up_to(METRES)),
    *((schema.PoseTable, key, FROM_0, up_to(DAYS)) for key in ("move_s", "hold_s", "pause_s")),
    *((schema.SegmentTable, key, down_to(-METRES), up_to(METRES)) for key in ("forward_mm", "left_mm")),
    (schema.SegmentTable, "turn_deg", down_to(-360.0), up_to(360.0)),
    (schema.SegmentTable, "cycles", ABOVE_0, up_to(10_000.0)),
    (schema.CommandsTable, "forward_mm", ABOVE_0, up_to(METRES)),
    (schema.CommandsTable, "turn_deg", ABOVE_0, up_to(360.0)),
    (schema.WalkTable, "duty", ABOVE_0, (math.nextafter(1.0, 0.0), 1.0)),
    (schema.WalkTable, "cycle_s", ABOVE_0, up_to(DAYS)),
    *(
        (schema.WalkTable, key, ABOVE_0, up_to(METRES))
        for key in ("lift_mm", "body_height_mm", "stance_width_mm")
    ),
    (schema.WalkTable, "spring_mm", FROM_0, up_to(METRES)),
    (schema.WalkTable, "gap_mm", FROM_0, up_to(METRES)),
    (schema.ProgramTable, "max_commands", (1, 0), NONE),
    (schema.ProgramTable, "max_s", ABOVE_0, up_to(DAYS)),
    (schema.RoutineTable, "direction_deg", down_to(-360.0), up_to(360.0)),
    (schema.RoutineTable, "turn_deg", down_to(-36_000.0), up_to(36_000.0)),
    (schema.RoutineTable, "distance_mm", down_to(-METRES), up_to(METRES)),
    (schema.DriveTable, "speed_mm_s", down_to(0.001), up_to(METRES)),
    *((schema.DriveTable, key, FROM_0, up_to(DAYS)) for key in ("pause_s", "ramp_s")),
    (schema.FrameTable, "period_us", ABOVE_0, up_to(1_000_000.0)),
    *((schema.FrameTable, key, ABOVE_0, NONE) for key in ("gap_us", "slot_us")),
    *((schema.FrameTable, key, (1, 0), (13, 14)) for key in ("per_slot", "max_together")),
    (schema.FirmwareTable, "soft_start_s", FROM_0, up_to(DAYS)),
    (schema.FirmwareTable, "max_error_us", ABOVE_0, up_to(1000.0)),
    (StreamTable, "baud", (1, 0), NONE),
    (StreamTable, "silence_s", ABOVE_0, up_to(DAYS)),
    (schema.SupplyTable, "voltage_v", ABOVE_0, up_to(100.0)),
    (schema.SupplyTable, "resistance_ohm", FROM_0, up_to(100.0)),
    (schema.SupplyTable, "limit_a", ABOVE_0, up_to(1000.0)),
    (schema.SensorTable, "force_n", ABOVE_0, up_to(1000.0)),
    (schema.SensorTable, "at_deg", down_to(-360.0), up_to(360.0)),
    (schema.SensorTable, "at_mm", down_to(-METRES), up_to(METRES)),
    (schema.SensorTable, "above_a", ABOVE_0, up_to(1000.0)),
    *((schema.ExpectTable, key, ABOVE_0, up_to(METRES)) for key in ("robot_within_mm", "end_within_mm")),
    (schema.ExpectTable, "turn_within_deg", ABOVE_0, up_to(360.0)),
    (schema.ExpectTable, "drag_mm", ABOVE_0, up_to(METRES)),
    *((schema.ExpectTable, key, ABOVE_0, up_to(1000.0)) for key in ("torque_nm", "current_a")),
    (schema.ExpectTable, "within_s", ABOVE_0, up_to(DAYS)),
    (servo_models.PointTable, "width_us", down_to(100.0), up_to(10_000.0)),
    *(
        (servo_models.FactKeys, key, ABOVE_0, NONE)
        for key in ("speed_deg_s", "acceleration_deg_s2", "torque_ncm", "max_ma", "mass_g")
    ),
    (servo_models.FactKeys, "idle_ma", FROM_0, NONE),
    *(
        (servo_models.SupplyTable, key, ABOVE_0, NONE)
        for key in ("supply_v", "speed_deg_s", "speed_rad_s", "torque_ncm")
    ),
    (servo_models.MotorTable, "stall_ma", ABOVE_0, NONE),
    (servo_models.MotorTable, "no_load_ma", FROM_0, NONE),
    (servo_models.MotorTable, "efficiency", ABOVE_0, up_to(1.0)),
    (servo_models.MotorTable, "dead_band_us", FROM_0, up_to(100.0)),
    (servo_models.MotorTable, "full_drive_us", ABOVE_0, up_to(1000.0)),
    (servo_models.MotorTable, "lost_ms", ABOVE_0, up_to(100_000.0)),
    (servo_models.MotorTable, "start_ms", down_to(1.0), up_to(10_000.0)),
    (servo_models.MotorTable, "backlash_deg", FROM_0, up_to(30.0)),
    *((arm_file.JointTable, key, ABOVE_0, NONE) for key in ("speed_deg_s", "speed_mm_s")),
    (arm_file.JointTable, "mass_g", FROM_0, up_to(TONNES)),
    (arm_file.ArmTable, "payload_g", FROM_0, up_to(TONNES)),
    *((OmniTable, key, ABOVE_0, NONE) for key in ("wheel_diameter_mm", "wheel_distance_mm", "gear")),
    (OmniTable, "counts_per_turn", (1, 0), NONE),
    (OmniTable, "sensors", (0, -1), NONE),
    *((table, "mass_g", ABOVE_0, up_to(TONNES)) for table in (OmniTable, HexapodTable)),
    (HexapodTable, "spring_n_m", ABOVE_0, up_to(1e7)),
]


def taken(table: type[Table], key: str, value: object) -> bool:
    """Return whether the table takes the value, and fail for any error at another key."""
    try:
        table.model_validate({**NEEDED.get(table, {}), key: value})
    except ValidationError as error:
        assert all(each["loc"][0] == key for each in error.errors())
        return False
    return True


def test_the_ends_of_a_range_are_taken_and_what_is_beyond_is_not() -> None:
    wrong = [
        f"{table.__module__}.{table.__name__}.{key}: {inside} is taken, {outside} is not"
        for table, key, *ends in RANGES
        for inside, outside in ends
        if inside is not None and (taken(table, key, inside), taken(table, key, outside)) != (True, False)
    ]
    assert not wrong


# What needs a whole value: a point, a mapping, an array.
WHOLE: list[tuple[type[Table], str, object, object]] = [
    (schema.PoseTable, "tip_mm", (METRES, -METRES, 0.0), (0.0, 0.0, METRES + 1e-6)),
    (schema.PoseTable, "foot_mm", (METRES, -METRES, 0.0), (-METRES - 1e-6, 0.0, 0.0)),
    (schema.DriveTable, "corners_mm", ((METRES, -METRES), (0.0, 0.0)), ((0.0, 0.0),)),
    (schema.DriveTable, "corners_mm", ((0.0, 0.0),) * 2, ((0.0, METRES + 1e-6), (0.0, 0.0))),
    (schema.DriveTable, "routines", ({"name": "turn"},), ()),
    (schema.DriveTable, "wheels", ("a",), ()),
    (schema.MotionTable, "poses", ({},), ()),
    (servo_models.FactKeys, "points", ({"width_us": 1e3},) * 2, ({"width_us": 1e3},)),
    (arm_file.JointTable, "centre_of_mass_mm", (METRES, -METRES, 0.0), (0.0, METRES + 1e-6, 0.0)),
    (arm_file.JointTable, "centre_of_mass_mm", (-METRES, 0.0, 0.0), (-METRES - 1e-6, 0.0, 0.0)),
    (arm_file.ArmTable, "lengths_mm", {"l1": 0.0, "l2": METRES}, {"l1": -TINY}),
    (arm_file.ArmTable, "lengths_mm", {"l1": METRES}, {"l1": METRES + 1e-6}),
    (HexapodTable, "leg_mass_g", {"coxa": TINY, "thigh": TONNES}, {"coxa": 0.0}),
    (HexapodTable, "leg_mass_g", {"foot": TONNES}, {"foot": math.nextafter(TONNES, math.inf)}),
]


def test_the_values_inside_a_value_have_the_same_ranges() -> None:
    for table, key, inside, outside in WHOLE:
        assert taken(table, key, inside), (table, key)
        assert not taken(table, key, outside), (table, key)


# The defaults as docs/robots.md and docs/twin.md state them, and what a table means that is left out.
DEFAULTS: list[tuple[type[Table], Mapping[str, object]]] = [
    (schema.PoseTable, {"path": "joint", "via": False, "hold_s": 0, "pause_s": 0, "release": False}),
    (schema.SegmentTable, {"forward_mm": 0, "left_mm": 0, "turn_deg": 0, "cycles": None}),
    (MountTable, {"z_mm": 0, "heading_deg": 0, "mirrored": False}),
    (HexapodTable, {"leg": None, "centre_of_mass_mm": None, "mass_g": None, "spring_n_m": None}),
    (OmniTable, {"gear": 1, "counts_per_turn": 1, "sensors": 0, "mass_g": None}),
    (arm_file.RowTable, {"ratio": 1, "theta_deg": 0, "d_mm": "0", "a_mm": "0", "alpha_deg": 0}),
    (arm_file.FrameTable, dict.fromkeys(("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"), 0)),
]


def test_a_key_that_is_left_out_changes_nothing() -> None:
    for table, expected in DEFAULTS:
        needed = NEEDED.get(table, {"name": "m", "x_mm": 0.0, "y_mm": 0.0} if table is MountTable else {})
        found = table.model_validate(needed)
        assert {key: getattr(found, key) for key in expected} == expected


def test_a_number_out_of_range_is_refused_with_its_key_and_what_is_allowed() -> None:
    document = toml_file.parse("[supply]\nvoltage_v = 5\nresistance_ohm = 100.5\n", "job.toml")
    with pytest.raises(InputError) as caught:
        toml_file.validate(document, schema.SupplyTable, ("supply",))
    assert str(caught.value) == (
        "job.toml:3:1: error: supply.resistance_ohm: 100.5 is out of range: at most 100 is allowed "
        "[out-of-range]"
    )
