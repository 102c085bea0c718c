"""A trajectory's pulses: whole cycles, fixed slots, run-length frames."""

import math
from fractions import Fraction

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.motion import JointTrajectory
from servogen.pulse import Channel, Frame, Pulse, PulsePlan, Run, plan
from servogen.robot.servo import Servo, servo
from servogen.robot.servo_models import servo_model
from servogen.units import Clock, Cycles

CLOCK = Clock(4_000_000)
PINS = ("RB0", "RB1", "RB2", "RB3", "RB4", "RB5", "RB6", "RB7", "RA0")


def servos(*models: str) -> tuple[Servo, ...]:
    return tuple(
        servo(f"s{index}", pin, servo_model(model))
        for index, (pin, model) in enumerate(zip(PINS, models, strict=False))
    )


def made(
    degrees: list[list[float]], group: tuple[Servo, ...], loop_start: int = 0, clock: Clock = CLOCK
) -> PulsePlan:
    period = clock.round_us(20_000)
    angles = np.radians(np.array(degrees))
    names = tuple(each.name for each in group)
    return plan(JointTrajectory(names, clock, period.cycles, angles, loop_start), group, Frame(period))


def widths(found: PulsePlan) -> list[int]:
    return [pulse.width for run in found.schedule.loop for pulse in run.pulses if pulse]


def test_the_widths_of_exercise_8_4() -> None:
    assert widths(made([[30], [90], [120]], servos("futaba-s3001"))) == [1167, 1500, 1667]


def test_45_degrees_of_each_servo() -> None:
    assert widths(made([[45, 45]], servos("futaba-s3001", "mpx-tiny-s"))) == [1250, 1375]


def test_every_width_says_what_was_asked_for_and_what_it_became() -> None:
    rows = made([[30], [30], [90]], servos("futaba-s3001")).widths
    assert [(row.channel, row.cycles, row.frames) for row in rows] == [("s0", 1167, 2), ("s0", 1500, 1)]
    assert rows[0].requested_us == pytest.approx(1166.6667, abs=1e-9)
    assert rows[0].error_us == pytest.approx(0.3333, abs=1e-9)
    assert rows[1].requested_us == rows[1].achieved_us == 1500


def test_at_another_clock_the_cycles_are_others_and_the_error_too() -> None:
    rows = made([[30]], servos("futaba-s3001"), clock=Clock(10_000_000)).widths
    assert (rows[0].cycles, rows[0].achieved_us) == (2917, Fraction(5834, 5))


def test_equal_frames_in_a_row_are_one_run() -> None:
    schedule = made([[0], [0], [90], [0]], servos("futaba-s3001")).schedule
    assert schedule.loop == (
        Run(2, (Pulse(Cycles(0), Cycles(1000)),)),
        Run(1, (Pulse(Cycles(0), Cycles(1500)),)),
        Run(1, (Pulse(Cycles(0), Cycles(1000)),)),
    )
    assert schedule.channels == (Channel("s0", "RB0", "futaba-s3001"),)


def test_a_frame_without_an_angle_has_no_pulse() -> None:
    schedule = made([[0], [math.nan]], servos("futaba-s3001")).schedule
    assert [run.pulses for run in schedule.loop] == [(Pulse(Cycles(0), Cycles(1000)),), (None,)]


def test_the_lead_in_and_the_loop_are_apart() -> None:
    schedule = made([[0], [0], [0], [0]], servos("futaba-s3001"), loop_start=1).schedule
    assert (schedule.lead_in_frames, schedule.loop_frames) == (1, 3)


def test_each_channel_rises_at_the_same_cycle_of_every_frame() -> None:
    group = servos("futaba-s3001", "mpx-tiny-s", "futaba-s3001")
    schedule = made([[0, 180, 0], [180, 0, 180], [90, 90, 90]], group).schedule
    for channel in range(3):
        assert len({run.pulses[channel].rise for run in schedule.loop if run.pulses[channel]}) == 1


def test_slots_hold_the_longest_pulse_of_their_servo_and_a_gap() -> None:
    pulses = made([[0, 0, 0]], servos("futaba-s3001", "mpx-tiny-s", "futaba-s3001")).schedule.loop[0].pulses
    assert [pulse.rise for pulse in pulses if pulse] == [0, 2250, 2250 + 2000]


def test_pulses_never_overlap_whatever_the_angles() -> None:
    group = servos(*["futaba-s3001"] * 8)
    for run in made([[180] * 8, [0, 180] * 4], group).schedule.loop:
        ends = 0
        for pulse in run.pulses:
            assert pulse is not None
            assert pulse.rise >= ends
            ends = pulse.rise + pulse.width


def test_more_pulses_than_fit_a_frame_are_refused() -> None:
    with pytest.raises(InputError, match="do not fit a frame: 9, 1 at a time, take 20250 µs"):
        made([[90] * 9], servos(*["futaba-s3001"] * 9))


def test_a_clock_too_slow_for_the_pulses_is_named() -> None:
    """At 1 kHz a cycle is 4 ms: the 64 cycles from edge to edge alone are 256 ms."""
    slow = Clock(1000)
    angles = JointTrajectory(("s0",), slow, slow.round_us(20_000).cycles, np.zeros((1, 1)), 0)
    with pytest.raises(InputError, match=r"the frame has 20000 µs; at 1000 Hz the 64 cycles .* 256000 µs"):
        plan(angles, servos("futaba-s3001"), Frame(slow.round_us(20_000)))


def test_a_stated_slot_must_hold_the_pulse() -> None:
    group, period = servos("futaba-s3001", "futaba-s3001"), CLOCK.round_us(20_000)
    angles = JointTrajectory(("s0", "s1"), CLOCK, period.cycles, np.zeros((1, 2)), 0)
    wide = plan(angles, group, Frame(period, slot_us=Fraction(2500))).schedule.loop[0].pulses[1]
    assert wide == Pulse(Cycles(2500), Cycles(1000))
    with pytest.raises(InputError, match="a slot of 2000 µs is too short for s0"):
        plan(angles, group, Frame(period, slot_us=Fraction(2000)))


def test_floating_point_noise_does_not_decide_a_rounding() -> None:
    # 90.09 degrees of the S3001 are 1500.5 µs: a half goes up, whatever the angle's last bits are.
    angle = math.radians(90.09)
    for nudged in (angle, np.nextafter(angle, 0), np.nextafter(angle, 4)):
        assert widths(made([[math.degrees(nudged)]], servos("futaba-s3001"))) == [1501]
