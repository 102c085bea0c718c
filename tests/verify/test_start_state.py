"""Programs that are right only on some chips are not exact, whoever is asked; a program right on all is."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from servogen.programs import read_program, read_schedule
from servogen.testing.targets import CaptureRequest, Simulator, check
from servogen.units import Cycles
from servogen.workflows.verification import checked_cycles, judge_edges, judge_forever, judge_image, running
from tests.cli.conftest import Ran, run  # noqa: F401 - a fixture

CASES = Path(__file__).parent / "start_state"
SCHEDULE = CASES / "schedule.json"
WRONG = {
    # kind, address, line, cycle: counted by hand in the sources
    "ram": ("unknown-start", 0x004, 10, 4),
    "floatin": ("unknown-start", 0x004, 10, 4),
    "latch": ("driven-before-written", 0x001, 7, 1),
    "wdt_pre2": ("watchdog-margin", None, None, None),
    "rc": ("oscillator", 0x2007, None, 0),
}
Run = Callable[..., Ran]


@pytest.mark.parametrize("options", [(), ("--forever",), ("--seconds", "1")])
def test_a_program_right_on_every_chip_is_proven(run: Run, options: tuple[str, ...]) -> None:  # noqa: F811
    ran = run("verify", CASES / "good.asm", "--against", SCHEDULE, *options)
    assert (ran.code, ran.out.startswith("exact")) == (0, True)


@pytest.mark.parametrize("name", WRONG)
def test_a_program_right_on_some_chips_is_not_proven_and_the_place_is_named(run: Run, name: str) -> None:  # noqa: F811
    ran = run("verify", CASES / f"{name}.asm", "--against", SCHEDULE, "--json")
    verdict = json.loads(ran.out)
    assert (ran.code, verdict["exact"]) == (1, False)
    (warning,) = verdict["warnings"]
    kind, address, line, cycle = WRONG[name]
    assert warning["code"] == kind
    if address is not None:
        assert (warning["address"], warning["line"], warning["cycle"]) == (address, line, cycle)
    assert warning["message"] in verdict["reasons"][0]
    text = run("verify", CASES / f"{name}.asm", "--against", SCHEDULE).out
    assert text.startswith("NOT exact")
    assert f"0x{warning['address']:03X}" in text


def test_the_watchdog_is_named_where_it_would_bite() -> None:
    """CLRWDT, then in 1500 cycles the next, and 1:2 of 7 ms after that one."""
    program = read_program(CASES / "wdt_pre2.asm")
    verdict = judge_image(read_schedule(SCHEDULE), program.image, None, program.listing)
    (warning,) = verdict.warnings
    assert verdict.start is not None
    assert (
        warning.location.cycle == verdict.start + 1500 + 1 + 1 + 14_000
    )  # BCF, CLRWDT, and two periods after it
    assert warning.location.line is not None


@pytest.mark.parametrize("name", WRONG)
def test_forever_does_not_silence_it(run: Run, name: str) -> None:  # noqa: F811
    ran = run("verify", CASES / f"{name}.asm", "--against", SCHEDULE, "--forever")
    assert ran.code == 1
    assert all(line.startswith(("NOT exact", "first", "RB0", "-")) for line in ran.out.splitlines())
    program = read_program(CASES / f"{name}.asm")
    found = judge_forever(read_schedule(SCHEDULE), program.image, Cycles(10_000_000))
    assert not found.passed


@pytest.mark.parametrize("name", WRONG)
def test_a_test_of_firmware_fails(name: str) -> None:
    chip, schedule = Simulator(), read_schedule(SCHEDULE)
    chip.load(read_program(CASES / f"{name}.asm").image)
    found = check(chip.capture(CaptureRequest(schedule.clock, schedule)), schedule)
    assert not found.passed
    assert ("servogen_verdict", "not exact") in found.properties
    chip.load(read_program(CASES / "good.asm").image)
    assert check(chip.capture(CaptureRequest(schedule.clock, schedule)), schedule).passed


@pytest.mark.parametrize("name", WRONG)
def test_the_edges_alone_are_the_schedules(name: str) -> None:
    """The simulator's own values hide it: this is why edges are not enough."""
    schedule, image = read_schedule(SCHEDULE), read_program(CASES / f"{name}.asm").image
    span = checked_cycles(schedule)
    assert judge_edges(schedule, running(schedule, image, span), span).passed
    verdict = judge_image(schedule, image)
    assert verdict.edges_agree
    assert not verdict.passed


@pytest.mark.parametrize("name", WRONG)
def test_it_is_not_flashed_without_force(run: Run, tmp_path: Path, name: str) -> None:  # noqa: F811
    target = tmp_path / "main.hex"
    assert run("assemble", CASES / f"{name}.asm", "-o", target).code == 0
    ran = run("flash", target, "--against", SCHEDULE, "--device", "PIC16F84", "--port", "/dev/null")
    assert ran.code == 2
    assert "not exact" in ran.err or "configuration" in ran.err


def test_a_warning_that_does_not_depend_on_the_chip_is_shown_and_proves_nothing_false(
    run: Run,  # noqa: F811
    tmp_path: Path,
) -> None:
    """WR without its sequence does nothing on every chip; it is said all the same."""
    source = (
        (CASES / "good.asm")
        .read_text()
        .replace("frame   bsf", "        bsf 3,5\n bsf 8,1\n bcf 3,5\nframe   bsf")
    )
    program = tmp_path / "program.asm"
    program.write_text(source)
    shutil.copy(CASES / "frame.inc", tmp_path)
    ran = run("verify", program, "--against", SCHEDULE)
    assert ran.code == 0
    assert "warning: " in ran.out and "cycle 5, address 0x005: " in ran.out
