"""[stream] of a job: its defaults, the rates that go with a clock, pins that are free."""

import random
import re
from fractions import Fraction

import pytest

from servogen.engines.inputs.serial import Stream
from servogen.engines.stream.settings import (
    BIT_GAP,
    MASKED,
    SAMPLE_AFTER,
    STAMP,
    START_GAP,
    STOP_AFTER,
    bit_units,
    first_units,
)
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.units import Clock
from servogen.workflows.engines import planned
from tests.campaigns import sampled

CHIP = '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n'


def servos(count: int) -> str:
    pins = [*(f"RB{n}" for n in range(8)), *(f"RA{n}" for n in range(5))]
    return "".join(
        f'[[servo]]\nname = "s{n}"\npin = "{pins[n]}"\nmodel = "futaba-s3001"\n' for n in range(count)
    )


def error_of(text: str) -> str:
    with pytest.raises(InputError) as found:
        plan_job(loads(text, "job.toml"))
    return str(found.value)


def test_a_stream_needs_no_motion_and_has_defaults() -> None:
    for text in ("[stream]\n", '[firmware]\nengine = "stream"\n'):
        job = plan_job(loads(CHIP + servos(2) + text, "job.toml"))
        assert job.stream
        assert (job.stream.baud, job.stream.receive_pin, job.stream.transmit_pin) == (2400, "RA4", None)
        assert (job.stream.silence_s, job.stream.fail_safe) == (Fraction(1), "neutral")
        assert len(job.trajectory.angles) == 1


def test_a_motion_in_a_stream_job_is_read() -> None:
    motion = "[motion]\nposes = [{ s0_deg = 30, hold_s = 1 }, { s0_deg = 90, hold_s = 1 }]\n"
    assert len(plan_job(loads(CHIP + servos(1) + "[stream]\n" + motion, "job.toml")).trajectory.angles) > 1


@pytest.mark.parametrize(
    ("baud", "clock_hz", "units"),
    [
        (2400, 4_000_000, 104),
        (9600, 16_000_000, 104),
        (9600, 20_000_000, 130),
        (4800, 8_000_000, 104),
        (1200, 4_000_000, 208),
    ],
)
def test_rates_whose_bits_are_long_enough_are_received(baud: int, clock_hz: int, units: int) -> None:
    assert bit_units(Stream(baud), Clock(clock_hz)) == units


@pytest.mark.parametrize(
    ("baud", "clock_hz"), [(4800, 4_000_000), (9600, 8_000_000), (9600, 10_000_000), (19_200, 20_000_000)]
)
def test_other_rates_are_refused_with_the_arithmetic(baud: int, clock_hz: int) -> None:
    with pytest.raises(InputError) as found:
        bit_units(Stream(baud), Clock(clock_hz))
    bit = clock_hz / 4 / baud
    assert f"a bit is {bit:.1f} cycles" in found.value.message
    numbers = re.search(
        r"(\d+) cycles apart before a start bit and (\d+) after.* up to (\d+) cycles .*ends after ([\d.]+)",
        found.value.message,
    )
    assert numbers
    start_gap, bit_gap, latest = (int(each) for each in numbers.groups()[:3])
    # Ten bits of a sender that is 2 % fast; nine of a slow one have passed before its stop bit begins.
    assert numbers[4] == f"{10 * bit / 1.02:.1f}"
    assert latest > 10 * bit / 1.02
    # The sample must not come before the stop bit of a slow sender: 9 bits; what else is in it is small.
    assert latest - start_gap - bit_gap == pytest.approx(9 * bit / 0.98, abs=20)


@pytest.mark.parametrize(("baud", "clock_hz"), [(2400, 4_000_000), (9600, 20_000_000), (1200, 4_000_000)])
@pytest.mark.parametrize("error", sampled([-0.02, 0, 0.02]))
def test_every_bit_of_a_sender_within_two_per_cent_is_sampled_while_it_is_on_the_line(
    baud: int, clock_hz: int, error: float
) -> None:
    """The receiver by itself: samples at random distances up to the gaps, times in units of 4 cycles."""
    dice = random.Random(5)
    nominal = Fraction(clock_hz, 4 * baud)
    units, first = bit_units(Stream(baud), Clock(clock_hz)), first_units(nominal)
    bit = float(nominal) / (1 + error)
    for _ in range(3000):
        # The sample that sees the start bit; from then on the remaining units count down to below zero.
        now = dice.choice((0, START_GAP, dice.uniform(0, START_GAP))) + dice.randrange(4) + 1000
        begun = now - dice.uniform(0, START_GAP)
        stamp, left, masked = int(now) + STAMP, first, MASKED
        for k in range(10):
            while left >= 0:
                step = dice.choice((BIT_GAP, dice.randint(20, BIT_GAP)))
                if masked and dice.random() < 0.05:
                    step, masked = step + masked, 0
                left -= ((stamp + step) >> 2) - (stamp >> 2)
                stamp += step
            left += units
            for after in (SAMPLE_AFTER[0], STOP_AFTER if k == 9 else SAMPLE_AFTER[1]):
                assert k * bit <= stamp + after - begun <= (k + 1) * bit


@pytest.mark.parametrize("mhz", [1, 2, 4, 8, 10, 12, 16, 20])
def test_a_refusal_names_the_rates_that_the_clock_can_receive(mhz: int) -> None:
    clock = Clock(mhz * 1_000_000)
    with pytest.raises(InputError) as found:
        bit_units(Stream(38_400), clock)
    assert found.value.hint and found.value.hint.startswith("at this clock: ")
    named = [int(each) for each in re.findall(r"\d+", found.value.hint)]
    assert named
    for baud in (300, 600, 1200, 2400, 4800, 9600, 19_200):
        if baud in named:
            bit_units(Stream(baud), clock)
        else:
            with pytest.raises(InputError):
                bit_units(Stream(baud), clock)


def test_a_rate_too_slow_for_the_receiver_s_byte_is_refused() -> None:
    with pytest.raises(InputError, match="the receiver counts 892 at most"):
        bit_units(Stream(1200), Clock(20_000_000))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('receive_pin = "RB0"\n', "stream.receive_pin: RB0 is in use: s0"),
        ('receive_pin = "RC0"\n', "unknown pin 'RC0'"),
        ('transmit_pin = "RA4"\nreceive_pin = "RA0"\n', "RA4 is an open drain"),
        ('transmit_pin = "RA4"\n', "RA4 is in use: receive_pin"),
        ('transmit_pin = "RB7"\n', "RB7 is on the port of s0"),
        ("silence_s = 0\n", "silence_s"),
        ('fail_safe = "stop"\n', "fail_safe"),
        ("parity = 1\n", "parity"),
    ],
)
def test_what_the_line_cannot_be_is_said(text: str, message: str) -> None:
    assert message in error_of(CHIP + servos(2) + "[stream]\n" + text)


def test_another_engine_hears_no_line() -> None:
    text = CHIP + servos(2) + '[stream]\n[firmware]\nengine = "player"\n'
    assert "the player engine does not read a serial line" in error_of(text)


def test_twelve_servos_and_the_line_take_all_pins_and_a_longer_frame() -> None:
    """One after the other: 12 slots of the 9 rounds of 256 cycles that the C takes are 27 648."""
    line = "[stream]\n[frame]\nperiod_us = {}\n"
    with pytest.raises(InputError, match="period_us = 27648"):
        planned(plan_job(loads(CHIP + servos(12) + line.format(20_000), "job.toml")))
    found = planned(plan_job(loads(CHIP + servos(12) + line.format(28_000), "job.toml")))
    assert found.plan.schedule.period == 27_648
    assert "RA4" in error_of(CHIP + servos(13) + "[stream]\n")


def soft_start(seconds: float) -> str:
    return CHIP + servos(2) + f"[firmware]\nsoft_start_s = {seconds!r}\n[stream]\n"


def test_a_soft_start_longer_than_a_group_counts_is_refused_and_not_shortened() -> None:
    """A group of positions counts its frames in a byte of which 255 is a command: 254 at most."""
    made = planned(plan_job(loads(soft_start(1.0), "job.toml")))
    period_s = float(made.job.clock.seconds(made.plan.schedule.period))
    longest = planned(plan_job(loads(soft_start(254 * period_s), "job.toml")))
    silence = round(1.0 / period_s)
    assert longest.plan.schedule.lead_in_frames == silence + 254
    with pytest.raises(InputError, match=r"a soft start of 5\.\d+ s is 255 frames") as found:
        planned(plan_job(loads(soft_start(255 * period_s), "job.toml")))
    assert found.value.location is not None
    assert found.value.location.key == "firmware.soft_start_s"


def test_no_soft_start_takes_one_frame_and_says_so() -> None:
    made = planned(plan_job(loads(soft_start(0.0), "job.toml")))
    assert [each.message for each in made.plan.warnings if each.code == "soft-start-rounded"] == [
        f"going to the neutral pose takes one frame, "
        f"{float(made.job.clock.seconds(made.plan.schedule.period)):g} s, not 0 s"
    ]
    usual = planned(plan_job(loads(soft_start(1.0), "job.toml")))
    assert "soft-start-rounded" not in [each.code for each in usual.plan.warnings]


@pytest.mark.parametrize("button", ["start_pin", "stop_pin"])
def test_a_serial_line_and_buttons_are_more_than_any_engine_reads(button: str) -> None:
    text = CHIP + servos(2) + f'[firmware]\n{button} = "RA3"\n[stream]\n'
    error = error_of(text)
    assert f"firmware.{button}: no engine reads both a serial line and buttons" in error
    assert "remove [stream]" in error
    loads(text.replace("[stream]\n", "[motion]\nposes = [{ s0_deg = 9, s1_deg = 9 }]\n"), "job.toml")
    loads(text.replace(f'{button} = "RA3"\n', ""), "job.toml")
