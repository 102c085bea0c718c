"""A servo's width is on the straight lines between its calibration points."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.robot.servo import Servo, calibration, servo
from servogen.robot.servo_models import FactKeys, PointTable, names, servo_model

S3001 = servo_model("futaba-s3001")
TINY_S = servo_model("mpx-tiny-s")


def arm(**choices: object) -> Servo:
    return servo("arm", "RB0", S3001, **choices)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("degrees", "s3001_us", "tiny_s_us"),
    [(0, 1000, 1250), (45, 1250, 1375), (90, 1500, 1500), (135, 1750, 1625), (180, 2000, 1750)],
)
def test_the_widths_of_the_labs_servos(degrees: float, s3001_us: float, tiny_s_us: float) -> None:
    angle = math.radians(degrees)
    assert arm().width_us(angle) == pytest.approx(s3001_us, abs=1e-9)
    assert servo("leg", "RB0", TINY_S).width_us(angle) == pytest.approx(tiny_s_us, abs=1e-9)


def test_the_catalogue_holds_the_facts_of_the_two_data_sheets() -> None:
    assert (S3001.speed, S3001.torque_nm) == (1.8, pytest.approx(0.34))
    assert (S3001.idle_a, S3001.max_a) == (pytest.approx(0.008), pytest.approx(0.72))
    assert S3001.mass_kg == pytest.approx(0.0451)
    assert S3001.size_m == pytest.approx((0.041, 0.035, 0.020))
    assert TINY_S.speed == pytest.approx(math.radians(60) / 0.08)
    assert servo_model("mpx-tiny-s", 6.0).speed == pytest.approx(math.radians(60) / 0.06)
    assert (TINY_S.torque_nm, servo_model("mpx-tiny-s", 6).torque_nm) == (0.25, pytest.approx(0.29))
    assert (TINY_S.mass_kg, TINY_S.idle_a) == (pytest.approx(0.017), None)
    assert TINY_S.size_m == pytest.approx((0.030, 0.030, 0.012))


def test_every_model_of_the_catalogue_loads_and_says_its_source() -> None:
    assert {"futaba-s3001", "mpx-tiny-s"} <= set(names())
    assert all(servo_model(name).source for name in names())


def test_an_unknown_model_is_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'mpx-tiny-s'"):
        servo_model("mpx-tinys")


def test_own_facts_go_before_the_catalogues() -> None:
    own = FactKeys(travel_deg=(10.0, 170.0), speed_deg_s=90.0, max_ma=500.0)
    model = servo_model("futaba-s3001", overrides=own)
    assert model.travel == pytest.approx((math.radians(10), math.radians(170)))
    assert model.speed == pytest.approx(math.pi / 2)
    assert (model.max_a, model.idle_a) == (0.5, 0.008)


def test_a_trim_moves_every_width_by_itself() -> None:
    for degrees in (0, 33, 90, 180):
        angle = math.radians(degrees)
        assert arm(trim_us=-12.5).width_us(angle) == pytest.approx(arm().width_us(angle) - 12.5)


def test_a_reversed_servo_counts_from_the_other_end() -> None:
    assert arm(reverse=True).width_us(math.radians(30)) == pytest.approx(arm().width_us(math.radians(150)))


def test_points_may_fall_and_come_in_any_order() -> None:
    falling = calibration(((2.0, 1000.0), (0.0, 2000.0)))
    assert falling.width_us(0.5) == 1750.0
    assert falling.angle(1750.0) == 0.5


@pytest.mark.parametrize(
    ("points", "says"),
    [
        (((0.0, 1000.0),), "at least two points"),
        (((0.0, 1000.0), (0.0, 1500.0)), "the same angle"),
        (((0.0, 1000.0), (1.0, 1500.0), (2.0, 1400.0)), "do not all rise"),
        (((0.0, 1000.0), (1.0, 1000.0)), "do not all rise"),
    ],
)
def test_points_that_are_no_function_are_refused(points: tuple[tuple[float, float], ...], says: str) -> None:
    with pytest.raises(InputError, match=says):
        calibration(points)


def test_nothing_is_guessed_beyond_the_calibration() -> None:
    short = calibration(((math.radians(20), 1100.0), (math.radians(160), 1900.0)))
    limited = arm(points=short)
    assert limited.limits == pytest.approx((math.radians(20), math.radians(160)))
    with pytest.raises(InputError, match="cannot go to 10°: its travel is 20° to 160°"):
        limited.width_us(math.radians(10))
    with pytest.raises(InputError, match="cannot have limits of 10° to 160°"):
        arm(points=short, limits=(math.radians(10), None))


def test_a_reversed_servo_can_reach_the_mirror_image_of_its_calibration() -> None:
    short = calibration(((math.radians(0), 1000.0), (math.radians(120), 1600.0)))
    assert arm(points=short, reverse=True).limits == pytest.approx((math.radians(60), math.radians(180)))


def test_an_angle_beyond_the_limits_is_refused_and_one_on_them_is_not() -> None:
    limited = arm(limits=(math.radians(30), math.radians(120)))
    assert limited.width_us(math.radians(120)) == pytest.approx(1666.6666667)
    with pytest.raises(InputError, match=r"arm cannot go to 120\.1°"):
        limited.width_us(math.radians(120.1))


def test_limits_without_room_are_refused() -> None:
    with pytest.raises(InputError, match="minimum angle of 90° is not below its maximum of 90°"):
        arm(limits=(math.pi / 2, math.pi / 2))


@settings(max_examples=200)
@given(
    angle=st.floats(0, math.pi),
    trim=st.floats(-50, 50),
    reverse=st.booleans(),
    bend=st.floats(1100, 1900),
)
def test_angle_undoes_width(angle: float, trim: float, reverse: bool, bend: float) -> None:
    curve = calibration(((0.0, 1000.0), (1.0, bend), (math.pi, 2000.0)))
    own = arm(points=curve, trim_us=trim, reverse=reverse)
    assert own.angle(own.width_us(angle)) == pytest.approx(angle, abs=1e-9)


@pytest.mark.parametrize("width_us", [0.0, 1.5, 150_000.0])
def test_a_width_in_milliseconds_or_nanoseconds_is_no_width(width_us: float) -> None:
    with pytest.raises(ValueError, match="than or equal to"):
        PointTable(angle_deg=0.0, width_us=width_us)
