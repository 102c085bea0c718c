"""Widths, limits and facts of servos at the ends of their ranges, by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError, Location
from servogen.robot.binding import Binding
from servogen.robot.model import Arm, DHRow, FixedFrame, Joint, Length, Limb, Mount
from servogen.robot.servo import Calibration, Motor, Servo, calibration, servo
from servogen.robot.servo_models import FactKeys, servo_model

S3001 = servo_model("futaba-s3001")  # 0° 1000 µs, 90° 1500 µs, 180° 2000 µs
NANO = 1e-9

BENT = calibration(((0.0, 1000.0), (1.0, 1400.0), (3.0, 2000.0), (4.0, 2100.0)))
FALLING = calibration(((0.0, 2100.0), (1.0, 1700.0), (3.0, 1100.0), (4.0, 1000.0)))


def arm(**choices: object) -> Servo:
    return servo("arm", "RB0", S3001, **choices)  # type: ignore[arg-type]


# ---- the line between points ----------------------------------------------------------------------------

# angle, width of BENT; the first and the last are beyond its ends: on the lines of the nearest segments
ON_BENT = [
    (-0.5, 800.0), (0.0, 1000.0), (0.25, 1100.0), (1.0, 1400.0), (1.5, 1550.0), (2.5, 1850.0), (3.0, 2000.0),
    (3.5, 2050.0), (4.0, 2100.0), (5.0, 2200.0),
]  # fmt: skip


def test_a_width_is_on_the_line_of_its_segment_and_back() -> None:
    for angle, width in ON_BENT:
        assert BENT.width_us(angle) == pytest.approx(width, abs=1e-9)
        assert BENT.angle(width) == pytest.approx(angle, abs=1e-12)
        # the same servo turned round: 3100 µs minus each width
        assert FALLING.width_us(angle) == pytest.approx(3100 - width, abs=1e-9)
        assert FALLING.angle(3100 - width) == pytest.approx(angle, abs=1e-12)


def test_the_ends_of_a_calibration_and_its_mean_slope() -> None:
    for curve in (BENT, FALLING):
        assert curve.angles == (0.0, 4.0)
        assert curve.widths_us == (1000.0, 2100.0)
        assert curve.per_us == pytest.approx(4.0 / 1100.0)


def test_falling_widths_that_stop_falling_are_no_calibration() -> None:
    for last in [1500.0, 1499.0, 1000.0]:
        with pytest.raises(InputError, match="do not all rise, or all fall"):
            calibration(((0.0, 2000.0), (1.0, 1000.0), (2.0, last)))


# ---- limits ---------------------------------------------------------------------------------------------


def test_an_angle_counts_as_within_a_limit_up_to_a_nanoradian_beyond_it() -> None:
    limited = arm(limits=(0.5, 2.5))
    inside = [0.5 - 0.9 * NANO, 0.5, 1.0, 2.5, 2.5 + 0.9 * NANO]
    outside = [0.5 - 1.1 * NANO, 2.5 + 1.1 * NANO, -1.0, 9.0]
    assert [limited.allows(angle) for angle in inside] == [True] * 5
    assert [limited.allows(angle) for angle in outside] == [False] * 4
    assert limited.allows_each(np.array(inside)).all()
    assert not limited.allows_each(np.array([*outside, math.nan])).any()


def test_a_limit_may_be_beyond_the_travel_by_rounding_only() -> None:
    for end in [0, 1]:
        for beyond in [0.9 * NANO, 1.1 * NANO, 0.1]:
            limits: list[float | None] = [None, None]
            limits[end] = -beyond if end == 0 else math.pi + beyond
            if beyond < NANO:
                assert arm(limits=tuple(limits)).limits[end] == limits[end]
            else:
                with pytest.raises(InputError, match="cannot have limits of"):
                    arm(limits=tuple(limits))


def test_one_limit_at_the_other_end_of_the_travel_leaves_no_room() -> None:
    for limits in ((math.pi, None), (None, 0.0)):
        with pytest.raises(
            InputError, match=r"cannot have limits of .*: travel and calibration allow 0° to 180°"
        ):
            arm(limits=limits)
    with pytest.raises(InputError, match="minimum angle of 90° is not below its maximum of 60°"):
        arm(limits=(math.pi / 2, math.pi / 3))
    assert arm(limits=(1.0, 1.0 + NANO)).limits == (1.0, 1.0 + NANO)


def test_errors_are_at_the_key_that_causes_them() -> None:
    places = {name: Location(name) for name in ("place", "limits_place", "trim_place")}
    asked: list[tuple[dict[str, object], str]] = [
        ({"limits": (2.0, 1.0)}, "limits_place"),
        ({"limits": (-1.0, None)}, "limits_place"),
        ({"trim_us": -1000.0}, "trim_place"),
    ]
    for choices, place in asked:
        for given, expected in ((places, place), ({"place": Location("place")}, "place")):
            with pytest.raises(InputError) as caught:
                arm(**choices, **given)
            assert caught.value.location == Location(expected)
    own = arm(place=Location("place"))
    with pytest.raises(InputError) as caught:
        own.width_us(9.0)
    assert caught.value.location == Location("place")
    with pytest.raises(InputError) as caught:
        own.check(9.0, Location("pose"))
    assert caught.value.location == Location("pose")


def test_a_trim_must_leave_a_pulse() -> None:
    assert arm(trim_us=-999.5).widths_us == (0.5, 1000.5)
    with pytest.raises(InputError, match="shortest pulse would be 0 µs: its trim is -1000 µs"):
        arm(trim_us=-1000.0)


def test_the_widths_of_the_limits_include_trim_and_mounting() -> None:
    quarter = (math.radians(45), math.radians(90))
    assert arm(limits=quarter, trim_us=10.0).widths_us == pytest.approx((1260, 1510))
    # 45° of the mounted servo is 135° of its shaft
    assert arm(limits=quarter, trim_us=10.0, reverse=True).widths_us == pytest.approx((1510, 1760))


def test_neutral_is_the_middle_of_the_travel_or_the_nearest_limit() -> None:
    for limits, neutral in [((0.0, 3.0), math.pi / 2), ((2.0, 3.0), 2.0), ((0.5, 1.0), 1.0)]:
        assert arm(limits=limits).neutral == pytest.approx(neutral)


def test_neutral_of_a_travel_that_does_not_begin_at_zero_is_its_middle() -> None:
    model = servo_model("futaba-s3001", overrides=FactKeys(travel_deg=(20.0, 140.0)))
    assert servo("arm", "RB0", model).neutral == pytest.approx(math.radians(80))
    mirrored = servo("arm", "RB0", model, reverse=True)
    # 30° from one end of the travel is 30° from the other
    assert mirrored.mounted(math.radians(50)) == pytest.approx(math.radians(110))


def test_a_wheel_is_neutral_at_standstill() -> None:
    wheel = servo("wheel", "RB0", servo_model("continuous"))
    assert wheel.neutral == 0.0
    assert servo("wheel", "RB0", servo_model("continuous"), limits=(1.0, 2.0)).neutral == 1.0
    assert [math.degrees(end) for end in wheel.limits] == pytest.approx([-300, 300])


def test_a_servo_loses_its_dead_band_twice_and_its_backlash_once() -> None:
    for motor, lost in [
        (Motor(), 0.0),
        (Motor(dead_band_us=2.0), 2 * 2.0 * math.pi / 1000),
        (Motor(backlash=0.01), 0.01),
        (Motor(dead_band_us=3.0, backlash=0.01), 2 * 3.0 * math.pi / 1000 + 0.01),
    ]:
        curve = calibration(((0.0, 1000.0), (math.pi, 2000.0)))
        assert replace(S3001, motor=motor).lost_motion(curve) == pytest.approx(lost)


# ---- models ---------------------------------------------------------------------------------------------

FILE = """\
title = "Two supplies"
points = [ {{ angle_deg = 0, width_us = 600 }}, {{ angle_deg = 180, width_us = 2400 }} ]
acceleration_deg_s2 = 360
idle_ma = 6
max_ma = 700
mass_g = 9
size_mm = [23, 25, 12]
{more}

[[supply]]
supply_v = 6.0
speed_rad_s = 8.0
torque_ncm = 40

[[supply]]
supply_v = 4.0
speed_rad_s = 6.0
torque_ncm = 20

[motor]
stall_ma = 650
no_load_ma = 120
efficiency = 0.5
dead_band_us = 4
full_drive_us = 30
lost_ms = 50
start_ms = 20
backlash_deg = 0.9
assumed = ["start_ms"]
"""


def described(folder: Path, more: str = "", before: str = "", after: str = "") -> str:
    path = folder / "two.toml"
    path.write_text(FILE.format(more=more).replace(before, after) if before else FILE.format(more=more))
    return str(path)


def test_every_fact_of_a_file_is_in_si_units(tmp_path: Path) -> None:
    model = servo_model(described(tmp_path))
    assert (model.name, model.title, model.continuous, model.unit) == ("two", "Two supplies", False, "°")
    assert model.acceleration == pytest.approx(2 * math.pi)
    assert (model.idle_a, model.max_a, model.mass_kg) == pytest.approx((0.006, 0.7, 0.009))
    assert model.size_m == pytest.approx((0.023, 0.025, 0.012))
    assert model.travel == pytest.approx((0, math.pi))
    motor = model.motor
    assert (motor.stall_a, motor.no_load_a, motor.efficiency) == pytest.approx((0.65, 0.12, 0.5))
    assert (motor.dead_band_us, motor.full_drive_us) == (4, 30)
    assert (motor.lost_s, motor.start_s) == pytest.approx((0.05, 0.02))
    assert motor.backlash == pytest.approx(math.radians(0.9))
    assert motor.assumed == ("start_ms",)


# Halfway between two voltages is halfway between their facts; without a voltage the lowest holds.
def test_speed_and_torque_lie_between_those_of_the_neighbouring_voltages(tmp_path: Path) -> None:
    for volts, speed, torque in [
        (None, 6.0, 0.2),
        (4.0, 6.0, 0.2),
        (4.5, 6.5, 0.25),
        (5.0, 7.0, 0.3),
        (6.0, 8.0, 0.4),
    ]:
        model = servo_model(described(tmp_path), volts)
        assert (model.speed, model.torque_nm) == pytest.approx((speed, torque))
        assert model.supply_v == (4.0 if volts is None else volts)


@pytest.mark.parametrize("volts", [3.99, 6.01])
def test_a_voltage_beyond_the_specified_ones_is_refused(tmp_path: Path, volts: float) -> None:
    with pytest.raises(InputError, match=f"{volts:g} V is outside the servo's supply") as caught:
        servo_model(described(tmp_path), volts, place=Location("job", 7))
    assert caught.value.location == Location("job", 7)
    assert caught.value.hint == "Two supplies: 4 to 6 V"


def test_a_fact_that_one_voltage_lacks_is_not_known_between_the_two(tmp_path: Path) -> None:
    name = described(tmp_path, before="torque_ncm = 40\n", after="\n")
    assert (servo_model(name, 5.0).speed, servo_model(name, 5.0).torque_nm) == (pytest.approx(7.0), None)
    assert servo_model(name, 4.0).torque_nm == pytest.approx(0.2)


def test_the_fact_of_the_file_goes_before_that_of_a_voltage_and_the_job_s_before_both(tmp_path: Path) -> None:
    name = described(tmp_path, more="speed_deg_s = 90\ntorque_ncm = 7")
    assert (servo_model(name).speed, servo_model(name).torque_nm) == pytest.approx((math.pi / 2, 0.07))
    own = FactKeys(speed_deg_s=45.0, torque_ncm=9.0, idle_ma=0.0)
    model = servo_model(name, overrides=own)
    assert (model.speed, model.torque_nm, model.idle_a) == pytest.approx((math.pi / 4, 0.09, 0.0))


@pytest.mark.parametrize("travel", [(90.0, 90.0), (90.0, 80.0)])
def test_a_travel_rises(travel: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="travel_deg does not rise") as caught:
        servo_model("futaba-s3001", overrides=FactKeys(travel_deg=travel), place=Location("job", 3))
    assert caught.value.location == Location("job", 3)


def test_an_assumption_is_about_a_key_of_the_file(tmp_path: Path) -> None:
    name = described(tmp_path, before='["start_ms"]', after='["mass_g", "start_s"]')
    with pytest.raises(InputError, match="there is no key 'start_s' whose value could be assumed") as caught:
        servo_model(name)
    assert caught.value.location is not None
    assert caught.value.location.line == FILE.format(more="").splitlines().index('assumed = ["start_ms"]') + 1


# ---- bindings and robots as data ------------------------------------------------------------------------


def test_a_binding_is_a_line_and_its_inverse() -> None:
    binding = Binding("q", "s", 0.5, -2.0)
    assert binding.servo_angle([0.0, 1.0, -0.25]).tolist() == [0.5, -1.5, 1.0]
    assert binding.position([0.5, -1.5, 1.0]).tolist() == [0.0, 1.0, -0.25]
    plain = Binding("q", "s")
    assert (plain.zero, plain.ratio) == (0.0, 1.0)


TURN = Joint("turn", "turning", -1.0, 2.0, 0.25, mass=0.5, centre=(0.1, 0.0, 0.0))
SLIDE = Joint("slide", "sliding", 0.125, 0.5, 0.25)
ROWS = (DHRow(0.0, Length(), Length((("l1", 1.0), ("l2", -1.0)), 0.5), 0.0, 0),)
TWO = Arm("two", "", "standard", (TURN, SLIDE), ROWS, lengths=(("l1", 2.0), ("l2", 0.25)))


def test_lengths_are_sums_of_signed_names_and_a_constant() -> None:
    (row,) = TWO.rows
    assert row.a.value(TWO.length) == 2.25
    assert [length.zero for length in (row.a, row.d, Length((), 1.0), Length((("l1", 1.0),)))] == [
        False,
        True,
        False,
        False,
    ]
    longer = TWO.with_lengths(l2=1.0)
    assert (longer.length, longer.dimensions) == ({"l1": 2.0, "l2": 1.0}, "user")
    with pytest.raises(InputError, match="two has no length 'l3'"):
        TWO.with_lengths(l3=1.0)


def test_home_reference_and_limbs_of_an_arm() -> None:
    assert TWO.home == (0.25, 0.25)
    assert TWO.reference == (0.0, 0.125)
    (limb,) = TWO.limbs
    assert (limb.name, limb.end, limb.arm, limb.mount) == ("tool", "tool", TWO, None)
    assert list(limb.joints) == ["turn", "slide"]
    assert list(Limb("L1", "foot", TWO, Mount("L1", 0.0, 0.0)).joints) == ["L1_turn", "L1_slide"]
    assert [joint.turning for joint in TWO.joints] == [True, False]


def test_a_frame_is_its_parent_s_if_nothing_moves_it() -> None:
    for key in ["x", "y", "z", "rx", "ry", "rz"]:
        assert FixedFrame().identity
        assert not FixedFrame(**{key: 1e-12}).identity
        assert TWO.with_tool(FixedFrame(**{key: 1.0})).tool == FixedFrame(**{key: 1.0})


def test_what_a_model_does_not_state_is_not_known() -> None:
    joint = Joint("q", "turning", -1.0, 1.0, 0.0)
    assert (joint.speed, joint.mass, joint.centre) == (None, 0.0, (0.0, 0.0, 0.0))
    mount = Mount("m", 1.0, 2.0)
    assert (mount.z, mount.heading, mount.mirrored) == (0.0, 0.0, False)
    assert (TWO.payload, TWO.closed_form, TWO.orientation, TWO.base, TWO.tool) == (
        0.0, None, (), FixedFrame(), FixedFrame(),
    )  # fmt: skip
    assert isinstance(BENT, Calibration)
