"""The edges in a file, whether it is a program that is run or a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from servogen.edges import PINS
from servogen.errors import InputError, Location
from servogen.programs import Program, clock_of, read_program, read_schedule
from servogen.robot.servo_models import servo_model
from servogen.simulator import SimulatorOptions
from servogen.units import Clock, Cycles
from servogen.workflows.signals import (
    MEASURED_SECONDS,
    device_for,
    is_program,
    program_for,
    scheduled_edges,
    servos_named,
    unscheduled_edges,
)

ROOT = Path(__file__).parents[2]
HEX, SCHEDULE = (ROOT / "firmware" / "lab8-exercise" / name for name in ("main.hex", "schedule.json"))
RECORDING = "cycle,pin,level\n10,RB0,1\n1510,RB0,0\n"


@pytest.mark.parametrize(
    ("name", "run"), [("a.HEX", True), ("a.c", True), ("a.asm", True), ("a.csv", False), ("a.sr", False)]
)
def test_the_suffix_says_whether_a_file_is_run(name: str, run: bool) -> None:
    assert is_program(Path(name)) == run


def test_another_suffix_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"'\.txt' is not the suffix") as error:
        is_program(Path("a.txt"))
    assert ".hex" in (error.value.hint or "")


def test_the_device_is_the_schedules_and_may_not_be_another() -> None:
    schedule = read_schedule(SCHEDULE)
    old, new, none = (replace(schedule, device=name) for name in ("PIC16F84", "PIC16F84A", None))
    assert device_for(new, SCHEDULE, None) == device_for(new, SCHEDULE, "16f84a") == "PIC16F84A"
    assert device_for(none, SCHEDULE, None) == "PIC16F84"
    assert device_for(none, SCHEDULE, "PIC16F84A") == "PIC16F84A"
    with pytest.raises(InputError, match="was built for a PIC16F84, --device is PIC16F84A"):
        device_for(old, SCHEDULE, "PIC16F84A")


@pytest.mark.parametrize(
    ("device", "asked", "hz", "chosen"),
    [
        (None, None, 10_000_000, "PIC16F84"),
        (None, None, 10_000_001, "PIC16F84A"),
        (None, None, 20_000_001, None),
        (None, "PIC16F84", 10_000_001, None),
        ("PIC16F84", None, 10_000_000, "PIC16F84"),
        ("PIC16F84", None, 10_000_001, None),
        ("PIC16F84A", None, 20_000_000, "PIC16F84A"),
        ("PIC16F84A", None, 20_000_001, None),
    ],
)
def test_a_schedule_is_for_a_chip_that_is_fast_enough(
    device: str | None, asked: str | None, hz: int, chosen: str | None
) -> None:
    """DS30430 section 8.1: 10 MHz at most; DS35007 section 6.1: 20 MHz."""
    schedule = replace(read_schedule(SCHEDULE), device=device, clock=Clock(hz))
    if chosen is None:
        with pytest.raises(InputError, match=f"is for {hz} Hz, the chip runs at no more than"):
            device_for(schedule, SCHEDULE, asked)
    else:
        assert device_for(schedule, SCHEDULE, asked) == chosen


def test_a_program_with_another_clock_than_the_schedules_is_refused() -> None:
    image = read_program(HEX).image
    schedule = read_schedule(SCHEDULE)
    assert program_for(schedule, HEX, "PIC16F84", lambda path, device: Program(image)).image is image
    with pytest.raises(InputError, match="states 8000000 Hz, the schedule is for 4000000 Hz"):
        program_for(schedule, HEX, "PIC16F84", lambda path, device: Program(image, None, Clock(8_000_000)))


def test_a_program_runs_as_long_as_asked_and_a_recording_ends_where_it_does(tmp_path: Path) -> None:
    program = read_program(HEX)
    assert unscheduled_edges(HEX, program, 0.5, None, SimulatorOptions()).end == 500_000
    long = unscheduled_edges(HEX, program, None, 8_000_000, SimulatorOptions())
    assert long.end == 2_000_000 * MEASURED_SECONDS
    recording = tmp_path / "edges.csv"
    recording.write_text(RECORDING)
    assert [
        int(cycle)
        for chunk in unscheduled_edges(recording, None, None, None, SimulatorOptions()).chunks
        for cycle in chunk.cycle
    ]


def test_edges_against_a_schedule_have_its_clock(tmp_path: Path) -> None:
    schedule = replace(read_schedule(SCHEDULE), clock=Clock(8_000_000))
    recording = tmp_path / "edges.csv"
    recording.write_text(RECORDING)
    for file in (recording, HEX):
        assert scheduled_edges(file, schedule, Cycles(20_000), SimulatorOptions()).clock == Clock(8_000_000)


def test_a_clock_that_is_asked_for_comes_before_the_programs_own() -> None:
    image = read_program(HEX).image
    own = Program(image, None, Clock(10_000_000))
    assert clock_of(own, 8_000_000) == Clock(8_000_000)
    assert clock_of(own) == Clock(10_000_000)
    assert clock_of(Program(image)) == clock_of(None) == Clock(4_000_000)


def test_servo_models_are_named_for_a_pin_or_for_all() -> None:
    models = servos_named(["futaba-s3001", "RA2=mpx-tiny-s"])
    assert set(models) == set(PINS)
    assert models.pop("RA2") == servo_model("mpx-tiny-s")
    assert set(models.values()) == {servo_model("futaba-s3001")}


def test_a_servo_model_of_a_pin_that_does_not_exist_is_refused() -> None:
    with pytest.raises(InputError, match="unknown pin 'RB8'") as refused:
        servos_named(["RB8=futaba-s3001"])
    told = refused.value.first
    assert (told.code, told.location) == ("unknown-pin", Location(key="--servo"))
    assert told.hint is not None and "RB" in told.hint
