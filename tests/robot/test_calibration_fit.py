"""The fitted line of a calibration by hand, and every limit of readings from both sides."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.robot.calibration import Reading, angle_of, angles_of, calibration_text, fit, read_csv
from servogen.robot.servo import servo
from servogen.robot.servo_models import servo_model


def readings(*pairs: tuple[float, float]) -> list[Reading]:
    """(width in µs, angle in degrees) pairs."""
    return [Reading(width, math.radians(angle)) for width, angle in pairs]


# Widths -1, 0, 1 about their mean (in ms about 1500) and angles 0, 93, 180: the slope of least squares is
# (180 - 0)/2 per 0.5 ms, the mean 91, the residuals -1, 2, -1 (in degrees).
SAGGING = readings((1000, 0), (1500, 93), (2000, 180))


def test_the_line_of_three_readings_by_hand() -> None:
    made = fit(SAGGING)
    assert made.us_per_rad * math.radians(1) == pytest.approx(1000 / 180)
    # the angle is 91° + 0.18° (w - 1500), which is 0 at 1500 - 91/0.18
    assert made.zero_us == pytest.approx(1500 - 91 / 0.18)
    assert [math.degrees(residual) for residual in made.residuals] == pytest.approx([-1, 2, -1])
    # three readings leave one degree of freedom: √((1 + 4 + 1)/1)
    assert math.degrees(made.rms) == pytest.approx(math.sqrt(6))
    assert made.worst == 1
    assert math.degrees(made.angle(1600)) == pytest.approx(109)
    assert made.width_us(math.radians(109)) == pytest.approx(1600)


def test_the_ends_of_a_line_are_cut_by_the_limits() -> None:
    made = fit(SAGGING)  # from 1° at 1000 µs to 181° at 2000 µs
    (low, first), (high, last) = made.points()
    assert [math.degrees(low), math.degrees(high), first, last] == pytest.approx([1, 181, 1000, 2000])
    (low, first), (high, last) = made.points((math.radians(10), math.radians(100)))
    assert [math.degrees(low), math.degrees(high), first, last] == pytest.approx([10, 100, 1050, 1550])
    for beyond in ((-1.0, math.radians(0.5)), (math.radians(182), 9.0), (low, low)):
        with pytest.raises(InputError, match="all readings lie outside the servo's travel"):
            made.points(beyond)


def test_a_falling_line_has_its_ends_in_the_order_of_the_angles() -> None:
    made = fit(readings((1000, 180), (1500, 90), (2000, 0)))
    (low, first), (high, last) = made.points()
    assert [math.degrees(low), math.degrees(high), first, last] == pytest.approx(
        [0, 180, 2000, 1000], abs=1e-9
    )


# The worst residual of SAGGING is 2°, the reading in its middle.
@pytest.mark.parametrize(("tolerance_deg", "fits"), [(2.001, True), (1.999, False)])
def test_a_reading_may_be_as_far_off_as_the_tolerance(tolerance_deg: float, fits: bool) -> None:
    if fits:
        assert fit(SAGGING, math.radians(tolerance_deg)).worst == 1
        return
    with pytest.raises(InputError) as caught:
        fit(SAGGING, math.radians(tolerance_deg))
    assert caught.value.message == (
        "the readings are not on a straight line: reading 2 (93° at 1500 µs) is 2.0° off it, "
        "1.999° is allowed"
    )


def test_five_degrees_are_allowed_unless_another_tolerance_is_given() -> None:
    def sagging(worst: float) -> list[Reading]:
        return readings((1000, 0), (1500, 90 + 1.5 * worst), (2000, 180))

    assert math.degrees(max(fit(sagging(4.99)).residuals)) == pytest.approx(4.99)
    with pytest.raises(InputError, match=r"is 5\.0° off it, 5° is allowed"):
        fit(sagging(5.01))


def test_speeds_are_named_as_speeds() -> None:
    with pytest.raises(InputError, match=r"reading 2 \(93°/s at 1500 µs\) is 2.0°/s off it, 1°/s is allowed"):
        fit(SAGGING, math.radians(1), speed=True)


# Four widths of which one is wrong: without it the others are on a line. With only three readings nobody can
# say which one is wrong.
def test_an_outlier_needs_three_others_that_agree() -> None:
    wrong = [(1000, 0), (1300, 54), (1600, 108), (2000, 140)]
    with pytest.raises(
        InputError, match=r"reading 4 \(140° at 2000 µs\) is 40.0° off the line of the others"
    ):
        fit(readings(*wrong))
    with pytest.raises(InputError, match="not on a straight line"):
        fit(readings(*wrong[1:], (1300, 54)))


def test_of_several_readings_that_could_be_wrong_the_one_without_which_the_others_fit_best_is_named() -> None:
    pairs = [(1000, 0.0), (1200, 36.2), (1400, 72.0), (1600, 108.1), (1800, 160.0), (2000, 180.0)]
    with pytest.raises(InputError, match=r"reading 5 \(160° at 1800 µs\) is 1[56]\.\d° off the line"):
        fit(readings(*pairs))


def test_equal_widths_are_one_width_and_their_order_does_not_matter() -> None:
    with pytest.raises(InputError, match=r"at least 3 widths are needed .* not 2"):
        fit(readings((1000, 0), (2000, 180), (2000, 181)))
    twice = readings((2000, 181), (1000, 0), (2000, 179), (1500, 90))
    assert math.degrees(fit(twice).angle(1500)) == pytest.approx(90, abs=0.5)


@pytest.mark.parametrize("bad", [Reading(math.inf, 1.0), Reading(1500, math.inf), Reading(math.nan, 1.0)])
def test_a_reading_is_finite(bad: Reading) -> None:
    with pytest.raises(InputError, match=r"reading 3 .* is not a number"):
        fit([*SAGGING[:2], bad])


def test_angles_are_finite_numbers_of_degrees() -> None:
    assert angle_of(" 92.5 ") == pytest.approx(math.radians(92.5))
    assert angles_of("0, 45,-90") == pytest.approx([0, math.pi / 4, -math.pi / 2])
    for text in ("nan", "inf", "x", ""):
        with pytest.raises(InputError, match=f"'{text}' is not a number of degrees"):
            angle_of(text)
    with pytest.raises(InputError, match="reading 2: 'x' is not a number of degrees"):
        angles_of("0,x,y")


def lines(folder: Path, *rows: str, column: str = "angle_deg") -> Path:
    path = folder / "readings.csv"
    path.write_text("\n".join((f"width_us,{column}", *rows)) + "\n")
    return path


def test_a_file_of_readings_takes_widths_and_angles_up_to_its_limits(tmp_path: Path) -> None:
    found = read_csv(lines(tmp_path, "1000000, -1000000", "0.5, 1000000"), speed=False)
    assert [each.width_us for each in found] == [1e6, 0.5]
    assert [math.degrees(each.angle) for each in found] == pytest.approx([-1e6, 1e6])
    (only,) = read_csv(lines(tmp_path, "1500,0", column="speed_deg_s"), speed=True)
    assert only == Reading(1500, 0.0)


@pytest.mark.parametrize("row", ["1000000.5,0", "0,0", "-1,0", "1000,1000000.5", "1000,-1000000.5"])
def test_a_reading_beyond_these_limits_is_refused_at_its_line(tmp_path: Path, row: str) -> None:
    with pytest.raises(InputError, match="is not a reading of a servo") as caught:
        read_csv(lines(tmp_path, "1000,0", row), speed=False)
    assert caught.value.location is not None
    assert caught.value.location.line == 3


def test_a_file_has_up_to_a_thousand_readings_of_two_numbers(tmp_path: Path) -> None:
    assert len(read_csv(lines(tmp_path, *["1000,0"] * 1000), speed=False)) == 1000
    with pytest.raises(InputError, match="has too many readings") as caught:
        read_csv(lines(tmp_path, *["1000,0"] * 1001), speed=False)
    assert caught.value.location is not None
    assert (caught.value.location.line, caught.value.hint) == (1002, "at most 1000")
    with pytest.raises(InputError, match="a reading is two numbers, width_us and angle_deg"):
        read_csv(lines(tmp_path, "1000"), speed=False)
    for speed, column in ((True, "angle_deg"), (False, "speed_deg_s")):
        with pytest.raises(InputError, match="there is no column") as caught:
            read_csv(lines(tmp_path, "1000,0", column=column), speed=speed)
        assert caught.value.location is not None
        assert caught.value.location.line == 1


def test_the_file_of_a_calibration_states_the_line_and_each_reading() -> None:
    own = servo("arm", "RB0", servo_model("futaba-s3001"), trim_us=20.0)
    text = calibration_text(fit(SAGGING), own)
    # the line goes from 1° at 1000 µs; the stop at 180° is at 1000 + 179/0.18 µs; the trim is taken off
    assert f"{{ angle_deg = 1.000000, width_us = {1000 - 20:.4f} }}," in text
    assert f"{{ angle_deg = 180.000000, width_us = {1000 + 179 / 0.18 - 20:.4f} }}," in text
    for line in (
        "readings = 3",
        "us_per_deg = 5.555556",
        f"zero_us = {1500 - 91 / 0.18:.3f}",
        "rms_deg = 2.449",
        "worst_deg = 2.000",
    ):
        assert f"\n{line}\n" in text
    assert text.endswith("[[reading]]\nangle_deg = 180.000\nwidth_us = 2000.000\nresidual_deg = -1.000\n")
