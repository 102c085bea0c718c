"""A continuous-rotation servo: 1.5 ms is stop, the width beside it is the speed."""

import math

import pytest

from servogen.errors import InputError
from servogen.pulse.lint import check_motion, check_widths
from servogen.robot.servo import Servo, servo
from servogen.robot.servo_models import FactKeys, PointTable, points_of, servo_model

MODEL = servo_model("continuous")


def wheel(**choices: object) -> Servo:
    return servo("wheel", "RB0", MODEL, **choices)  # type: ignore[arg-type]


def test_one_and_a_half_milliseconds_is_stop() -> None:
    assert wheel().width_us(0.0) == 1500
    assert wheel().angle(1500) == 0


@pytest.mark.parametrize(("deg_s", "us"), [(-300, 1300), (-150, 1400), (75, 1550), (300, 1700)])
def test_the_width_beside_stop_is_the_speed(deg_s: float, us: float) -> None:
    assert wheel().width_us(math.radians(deg_s)) == pytest.approx(us)
    assert wheel().angle(us) == pytest.approx(math.radians(deg_s))


def test_a_servo_that_sits_the_other_way_round_turns_the_other_way_and_still_stops() -> None:
    assert wheel(reverse=True).width_us(0.0) == 1500
    assert wheel(reverse=True).width_us(math.radians(75)) == pytest.approx(1450)


def test_a_trim_moves_the_stop() -> None:
    assert wheel(trim_us=12.0).width_us(0.0) == 1512


def test_a_speed_beyond_the_calibration_is_refused_as_a_speed() -> None:
    with pytest.raises(InputError) as caught:
        wheel().width_us(math.radians(301))
    assert str(caught.value) == (
        "servogen: error: wheel cannot turn at 301°/s: its speeds are -300°/s to 300°/s [servo-limit]\n"
        "  the servo's calibration points set it"
    )


def test_its_own_points_are_speeds() -> None:
    points = (PointTable(speed_deg_s=-100, width_us=1600), PointTable(speed_deg_s=100, width_us=1400))
    assert wheel(points=points_of(points, None, continuous=True)).width_us(math.radians(50)) == 1450


@pytest.mark.parametrize("continuous", [True, False])
def test_points_of_the_other_kind_are_refused(continuous: bool) -> None:
    wrong = PointTable(angle_deg=0, width_us=1500) if continuous else PointTable(speed_deg_s=0, width_us=1500)
    wanted = "speed_deg_s" if continuous else "angle_deg"
    with pytest.raises(InputError, match=f"a calibration point of this servo is {{ {wanted} = …"):
        points_of((wrong, wrong), None, continuous)


def test_it_has_no_travel() -> None:
    with pytest.raises(InputError, match="it turns continuously and has no travel"):
        servo_model("continuous", overrides=FactKeys(travel_deg=(0, 180)))


def test_the_catalogue_says_that_its_speeds_are_an_example() -> None:
    assert "points" in MODEL.motor.assumed
    assert (MODEL.continuous, MODEL.speed, servo_model("futaba-s3001").continuous) == (True, None, False)


def test_checks_speak_of_speeds() -> None:
    import numpy as np

    texts = [str(each) for each in check_widths(wheel(), [1800.0])]
    assert (
        texts[1] == "servogen: warning: wheel: 1800 µs would be 450°/s, outside its speeds of -300°/s to "
        "300°/s [angle-range]"
    )
    assert check_motion(wheel(), np.array([0.0, 5.0, -5.0]), 0, 0.02) == ()
