"""Wherever a command takes a program, it takes the job that it is built from and the folder of its build."""

import json
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.programs import program_file, read_program
from servogen.watch.subject import check
from tests.cli.conftest import Run

ROOT = Path(__file__).parents[2]
JOB = ROOT / "jobs" / "lab8-exercise.toml"
BUILD = ROOT / "firmware" / "lab8-exercise"
HEX = BUILD / "main.hex"

COMMANDS = {
    "simulate": ("--seconds", 0.3, "--json"),
    "measure": ("--seconds", 0.3, "--json"),
    "verify": ("--against", BUILD / "schedule.json", "--seconds", 1, "--partial", "--json"),
    "prove": ("--json",),
    "disassemble": (),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_job_and_its_build_do_what_the_hex_does(run: Run, command: str) -> None:
    """The committed HEX is the third witness: the build of that job, byte for byte."""
    options = COMMANDS[command]
    outputs = []
    for what in (HEX, BUILD, JOB):
        ran = run(command, what, *options)
        assert ran.code == 0, ran.err
        assert len(ran.out) > 100
        outputs.append(ran.out.replace(str(what), "it").replace(json.dumps(str(what))[1:-1], "it"))
    assert outputs[1] == outputs[0]
    if command != "prove":  # which names the places in the C that a HEX has lost
        assert outputs[2] == outputs[0]


def test_a_folder_has_the_clock_of_its_schedule(tmp_path: Path) -> None:
    (tmp_path / "main.hex").write_bytes(HEX.read_bytes())
    assert read_program(tmp_path).clock is None
    text = (BUILD / "schedule.json").read_text().replace('"clock_hz": 4000000', '"clock_hz": 8000000')
    (tmp_path / "schedule.json").write_text(text)
    clock = read_program(tmp_path).clock
    assert clock is not None and clock.hz == 8_000_000


def test_the_folder_of_a_build_can_be_watched_and_flashed(run: Run, tmp_path: Path) -> None:
    check(BUILD)
    programmer = tmp_path / "pk2cmd"
    programmer.write_text("#!/bin/sh\n")
    programmer.chmod(0o755)
    ran = run("flash", BUILD, "--programmer", programmer, "--dry-run")
    assert ran.code == 0 and str(HEX) in ran.out, ran.err


def test_a_folder_without_a_program_and_a_wrong_job_are_bad_input(run: Run, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is a folder without a main\.hex"):
        program_file(tmp_path)
    for command, options in COMMANDS.items():
        ran = run(command, tmp_path, *options)
        assert ran.code == 2 and "[no-program]" in ran.err, command
    job = tmp_path / "arm.toml"
    job.write_text(JOB.read_text("utf-8").replace('"RB0"', '"RB9"'), "utf-8")
    ran = run("simulate", job)
    assert ran.code == 2 and f"{job}:" in ran.err and "[unknown-pin]" in ran.err
    ran = run("flash", JOB, "--dry-run")
    assert ran.code == 2 and "servogen build" in ran.err
