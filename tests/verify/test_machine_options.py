"""`verify` has the machine's options, and an EEPROM write takes the time of the schedule's chip."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from servogen.edges import HIGH
from servogen.engines.firmware import Firmware
from servogen.errors import InputError
from servogen.programs import read_program, read_schedule
from servogen.simulator import Machine, SimulatorOptions
from servogen.testing.targets import CaptureRequest, Simulator, check
from servogen.units import Clock, Cycles
from servogen.workflows.job_build import judge_firmware
from servogen.workflows.power_ups import BOARD
from servogen.workflows.verification import judge_forever, judge_image
from tests.campaigns import sampled
from tests.cli.conftest import Ran, run  # noqa: F401 - a fixture

CASES = Path(__file__).parent
PROGRAM = CASES / "eeprom_time" / "program.asm"
SCHEDULE = CASES / "start_state" / "schedule.json"
START_STATE = CASES / "start_state"
Run = Callable[..., Ran]


def schedule_for(folder: Path, device: str | None) -> Path:
    path = folder / "schedule.json"
    path.write_text(replace(read_schedule(SCHEDULE), device=device).json_text())
    return path


@pytest.mark.parametrize(
    ("device", "options", "code"),
    sampled(
        [
            (None, (), 0),
            ("PIC16F84", (), 0),
            ("PIC16F84A", (), 1),
            (None, ("--device", "PIC16F84A"), 1),
            ("PIC16F84A", ("--eeprom-write-us", 10_000), 0),
            ("PIC16F84", ("--eeprom-write-us", 4_000), 1),
        ],
        4,
    ),
)
@pytest.mark.parametrize("forever", [(), ("--forever",)])
def test_an_eeprom_write_takes_the_time_of_the_schedules_chip(
    run: Run,  # noqa: F811
    tmp_path: Path,
    device: str | None,
    options: tuple[object, ...],
    code: int,
    forever: tuple[str, ...],
) -> None:
    """The program's frames are of 20 000 cycles where a write takes 10 ms: DS30430 and DS35007, D122."""
    against = schedule_for(tmp_path, device)
    ran = run("verify", PROGRAM, "--against", against, *options, *forever)
    assert ran.code == code
    assert ran.out.startswith("NOT exact" if code else "exact")


def test_a_build_a_proof_for_all_time_and_a_test_of_firmware_do_too() -> None:
    program = read_program(PROGRAM)
    for device, right in (("PIC16F84", True), ("PIC16F84A", False)):
        schedule = replace(read_schedule(SCHEDULE), device=device)
        assert judge_image(schedule, program.image).passed == right
        assert judge_forever(schedule, program.image, Cycles(1_000_000)).passed == right
        chip = Simulator()
        chip.load(program.image)
        assert check(chip.capture(CaptureRequest(schedule.clock, schedule)), schedule).passed == right
        made = Firmware("c2c", "main.c2c.c", "", program)
        assert judge_firmware(schedule, made).exact == right


@pytest.mark.parametrize(
    ("board", "period"), [(BOARD, 20_000), (SimulatorOptions(device="PIC16F84A"), 14_000)]
)
def test_a_write_of_the_other_chip_is_6_ms_shorter_and_grading_is_for_the_pic16f84(
    board: SimulatorOptions, period: int
) -> None:
    """Programs to be graded are compiled for the PIC16F84."""
    edges = Machine(read_program(PROGRAM).image, Clock(4_000_000), board).run(100_000)
    rises = edges.cycle[(edges.pin == 5) & (edges.level == HIGH)]
    assert set(np.diff(rises).tolist()) == {period}


def test_the_default_is_the_devices_typical_time() -> None:
    assert SimulatorOptions().eeprom_us == SimulatorOptions(device="PIC16F84").eeprom_us == 10_000
    assert SimulatorOptions(device="16f84a").eeprom_us == 4_000
    assert SimulatorOptions(device="PIC16F84A", eeprom_write_us=8_000).eeprom_us == 8_000
    for wrong in (0, 1_000_001):
        with pytest.raises(InputError, match="eeprom_write_us"):
            SimulatorOptions(eeprom_write_us=wrong)
    with pytest.raises(InputError, match="PIC16F85"):
        SimulatorOptions(device="PIC16F85")


@pytest.mark.parametrize(
    ("options", "period_us"),
    [((), 20_000), (("--device", "PIC16F84A"), 14_000), (("--eeprom-write-us", 4_000), 14_000)],
)
def test_measure_runs_the_chip_that_is_asked_for(
    run: Run,  # noqa: F811
    options: tuple[object, ...],
    period_us: int,
) -> None:
    found = json.loads(run("measure", PROGRAM, "--seconds", 1, *options, "--json").out)
    (pin,) = found["pins"]
    assert pin["period_cycles"] == period_us  # at 4 MHz a cycle is a microsecond


@pytest.mark.campaign
def test_plot_draws_the_chip_that_is_asked_for(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """Pictures of different pulses differ, and the same pulses give the same file."""

    def picture(*options: object) -> bytes:
        path = tmp_path / "pulses.svg"
        assert run("plot", PROGRAM, "-o", path, "--seconds", 0.1, *options).code == 0
        return path.read_bytes()

    usual = picture()
    assert picture("--device", "PIC16F84") == usual
    assert picture("--eeprom-write-us", 4_000) != usual
    with_schedule = picture("--against", SCHEDULE)
    assert picture("--against", SCHEDULE, "--eeprom-write-us", 4_000) != with_schedule


@pytest.mark.parametrize(
    "option", [("--start", "ram=1"), ("--device", "PIC16F84A"), ("--tmr0-phase", 1), ("--ra4-pull-up",)]
)
@pytest.mark.parametrize("command", ["verify", "measure", "plot"])
def test_a_recording_has_no_chip_to_choose(
    run: Run,  # noqa: F811
    tmp_path: Path,
    command: str,
    option: tuple[object, ...],
) -> None:
    recording = tmp_path / "edges.csv"
    recording.write_text("cycle,pin,level\n10,RB0,1\n1510,RB0,0\n")
    extra = {"verify": ("--against", SCHEDULE), "measure": (), "plot": ("-o", tmp_path / "a.svg")}[command]
    ran = run(command, recording, *extra, *option)
    assert ran.code == 2
    assert "the simulator's options are for programs" in ran.err


def test_another_device_than_the_schedules_is_refused(run: Run, tmp_path: Path) -> None:  # noqa: F811
    against = schedule_for(tmp_path, "PIC16F84A")
    ran = run("verify", PROGRAM, "--against", against, "--device", "PIC16F84")
    assert ran.code == 2
    assert "was built for a PIC16F84A, --device is PIC16F84" in ran.err
    ran = run("verify", PROGRAM, "--against", schedule_for(tmp_path, "PIC16F628"))
    assert ran.code == 2
    assert "schedule.json" in ran.err
    assert "PIC16F628" in ran.err


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("ram", ("--start", "ram=255")),
        ("floatin", ("--floating", 1)),
        ("ram", ("--start-seed", 1)),
        ("good", ("--watchdog-us", 7_000)),
        ("good", ("--power-up", "--power-up-us", 132_000)),
        ("good", ("--no-oscillator-start-up",)),
        ("good", ("--tmr0-phase", 3)),
    ],
)
def test_no_value_of_an_option_makes_a_verdict_of_what_no_chip_promises(
    run: Run,  # noqa: F811
    name: str,
    options: tuple[object, ...],
) -> None:
    """A program that is wrong on some chips stays so, whatever one chip is said to hold at its start."""
    ran = run("verify", START_STATE / f"{name}.asm", "--against", SCHEDULE, *options)
    assert (ran.code, ran.out.startswith("exact")) == ((0, True) if name == "good" else (1, False))


def test_start_ram_and_floating_pins_reach_the_machine(run: Run) -> None:  # noqa: F811
    """With these values the two programs hang before their first pulse."""

    def pulses(name: str, *options: object) -> bool:
        ran = run("verify", START_STATE / f"{name}.asm", "--against", SCHEDULE, "--json", *options)
        return json.loads(ran.out)["start_cycle"] is not None

    assert pulses("ram")
    assert not pulses("ram", "--start", "ram=255")
    assert pulses("floatin")
    assert not pulses("floatin", "--floating", 1)


@pytest.mark.parametrize(
    ("option", "value"), [("--start", "ram=256"), ("--floating", 2), ("--tmr0-phase", 4)]
)
def test_a_value_that_no_chip_has_is_refused(run: Run, option: str, value: object) -> None:  # noqa: F811
    ran = run("verify", START_STATE / "good.asm", "--against", SCHEDULE, option, value)
    assert ran.code == 2
    assert str(value).split("=")[-1] in ran.err
