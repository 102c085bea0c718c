"""The errata of the servo labs and of the arm language's table: the printed value is wrong, ours is right."""

from math import degrees, radians

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.movemaster.language import COMMANDS, MISPRINTS
from servogen.pic.device import PACKAGE
from servogen.robot.servo_models import servo_model

FUTABA, TINY = servo_model("futaba-s3001").calibration, servo_model("mpx-tiny-s").calibration


def test_lab_8_45_degrees_is_1250_microseconds() -> None:
    assert FUTABA.width_us(radians(45)) == pytest.approx(1250)
    assert FUTABA.width_us(radians(45)) != pytest.approx(1375)
    assert TINY.width_us(radians(45)) == pytest.approx(1375)


def test_lab_8_pin_17_is_ra0() -> None:
    pins = {pin.number: pin.name for pin in PACKAGE}
    assert (pins[17], pins[1]) == ("RA0", "RA2")


def test_lab_8_two_milliseconds_is_the_right_limit() -> None:
    assert (degrees(FUTABA.angle(1000)), degrees(FUTABA.angle(2000))) == pytest.approx((0, 180))


def test_the_ratio_of_pulse_and_period_sets_no_speed() -> None:
    # 1 ms of 20 and 2 ms of 40 are the same ratio, and two different places to stand at
    assert FUTABA.angle(1000) != FUTABA.angle(2000)
    # 1 ms of 20 and 1 ms of 40 are different ratios, and one place: only a change of width moves the shaft
    assert len({FUTABA.angle(1000) for _period_ms in (20, 40)}) == 1


BODY = (
    "\nvoid main(void) { set_bit(STATUS, RP0); TRISB = 0; clear_bit(STATUS, RP0); PORTB = 1; delay_ms(1); }\n"
)


@pytest.mark.parametrize(
    "head",
    [
        "#pragma CLOCK_FREQ 4000000",
        "# pragma CLOCK_FREQ 4000000",
        "#ifndef _CLOCK_FREQ\n#define _CLOCK_FREQ 4000000\n#endif",
    ],
)
def test_labs_8_and_9_every_way_to_state_the_clock_gives_the_same_program(head: str) -> None:
    found = compile_sources([Source(head + BODY)], Options(dialect="c2c"))
    right = compile_sources([Source("#pragma CLOCK_FREQ 4000000" + BODY)], Options(dialect="c2c"))
    assert found.clock is not None
    assert found.clock.hz == 4_000_000
    assert dict(found.image.program) == dict(right.image.program)


def test_the_arm_language_names_rn_and_counts_rt_as_41() -> None:
    numbers = {name: command.number for name, command in COMMANDS.items()}
    assert (MISPRINTS["RV"], MISPRINTS["52"]) == ("RN", "RT")
    assert "RV" not in numbers
    assert (numbers["RN"], numbers["RT"]) == (40, 41)
