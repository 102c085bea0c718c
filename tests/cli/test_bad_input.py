"""Each kind of bad input has its own message, its place, exit code 2, no traceback and leaves no file."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

JOB = """\
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"

[motion]
repeat = true
poses = [ { arm_deg = 30, hold_s = 2 }, { arm_deg = 90, hold_s = 5 } ]

[frame]
period_us = 20_000
"""

LEG = """\
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[[servo]]
name = "hip"
pin = "RB0"
model = "mpx-tiny-s"

[[servo]]
name = "knee"
pin = "RB1"
model = "mpx-tiny-s"

[leg]
ab_mm = 25
bc_mm = 40
cd_mm = 40
df_mm = 60
alpha = "hip"
beta = "knee"
alpha_zero_deg = 90
beta_zero_deg = 90

[motion]
poses = [ { foot_mm = [0, 900, 0], hold_s = 1 } ]
"""

SECOND_SERVO = '\n[[servo]]\nname = "hand"\npin = "RB0"\nmodel = "futaba-s3001"\n\n[motion]\n'

BAD_JOBS = {
    "a syntax error": (JOB.replace("[chip]", "[chip"), ":1:", "expected"),
    "an unknown key": (JOB.replace("trim", "x").replace("model =", "modle ="), ":8:", "'model'"),
    "a missing unit": (JOB.replace("period_us", "period"), ":15:", "period_us"),
    "an angle out of travel": (JOB.replace("arm_deg = 90", "arm_deg = 190"), ":12:", "180"),
    "an unreachable foot position": (LEG, ":26:", "reach"),
    "two servos on one pin": (
        JOB.replace("\n[motion]\n", SECOND_SERVO).replace("arm_deg = 30,", "arm_deg = 30, hand_deg = 30,"),
        ":12:",
        "RB0",
    ),
    "RA4 without open drain": (JOB.replace("RB0", "RA4"), ":7:", "open_drain"),
    "an unknown device": (JOB.replace('"PIC16F84"', '"PIC16F88"'), ":2:", "PIC16F84"),
    "a clock above the chip's": (JOB.replace("4_000_000", "20_000_000"), ":3:", "10"),
}


@pytest.mark.parametrize("kind", BAD_JOBS)
@pytest.mark.parametrize("command", ["check", "build"])
def test_a_bad_job_is_told_with_its_line(
    run: Callable[..., Any], tmp_path: Path, kind: str, command: str
) -> None:
    text, line, word = BAD_JOBS[kind]
    job = tmp_path / "job.toml"
    job.write_text(text)
    out = tmp_path / "out"
    ran = run(command, job, *(["-o", out] if command == "build" else []))
    assert ran.code == 2, kind
    assert f"job.toml{line}" in ran.err, ran.err
    assert word in ran.err, ran.err
    assert "Traceback" not in ran.err
    assert not out.exists()


def test_every_bad_job_has_its_own_message(run: Callable[..., Any], tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    messages = set()
    for text, _, _ in BAD_JOBS.values():
        job.write_text(text)
        messages.add(run("check", job).err)
    assert len(messages) == len(BAD_JOBS)


GOOD_HEX = ":020000000028D6\n:02400E00F13F80\n:00000001FF\n"

BAD_HEX = {
    "a wrong checksum": (GOOD_HEX.replace("28D6", "28D7"), ":1", "checksum"),
    "no end": (GOOD_HEX.replace(":00000001FF\n", ""), "", "truncated"),
    "a truncated record": (GOOD_HEX.replace(":020000000028D6", ":0200000000"), ":1", "truncated"),
    "an address beyond the chip": (":0210000000" + "28C6\n:00000001FF\n", ":1", "beyond"),
    "not a HEX file": ("MZ this is a program\n", ":1", "Intel HEX"),
}


@pytest.mark.parametrize("kind", BAD_HEX)
def test_a_bad_hex_file_is_told_with_its_line(run: Callable[..., Any], tmp_path: Path, kind: str) -> None:
    text, line, word = BAD_HEX[kind]
    file = tmp_path / "bad.hex"
    file.write_text(text)
    ran = run("simulate", file, "--edges", tmp_path / "edges.csv")
    assert ran.code == 2
    assert f"bad.hex{line}" in ran.err and word in ran.err, ran.err
    assert "Traceback" not in ran.err
    assert not (tmp_path / "edges.csv").exists()


def test_the_good_hex_file_of_these_tests_is_good(run: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "good.hex").write_text(GOOD_HEX)
    assert run("simulate", tmp_path / "good.hex").code == 0


BAD_C = {
    "too many words": ("void main(void) { " + "PORTB = 1; PORTA = 2; " * 600 + "}", "1024"),
    "too much RAM": ("char a[60]; char b[20]; void main(void) { a[PORTA] = 1; b[PORTA] = 2; }", "68"),
    "a syntax error": ("void main(void) { PORTB = ; }", ":1:"),
    "an unknown name": ("void main(void) { PROTB = 1; }", "PORTB"),
    "no clock for a delay": ("void main(void) { delay_ms(1); }", "clock"),
}


@pytest.mark.parametrize("kind", BAD_C)
def test_bad_c_is_told_and_leaves_no_hex(run: Callable[..., Any], tmp_path: Path, kind: str) -> None:
    text, word = BAD_C[kind]
    (tmp_path / "bad.c").write_text(text)
    ran = run("compile", tmp_path / "bad.c", "-o", tmp_path / "bad.hex", "--dialect", "c2c")
    assert ran.code == 2, ran
    assert "bad.c" in ran.err and word in ran.err, ran.err
    assert "Traceback" not in ran.err
    assert not (tmp_path / "bad.hex").exists()


def test_a_file_that_is_not_there_is_exit_code_2(run: Callable[..., Any], tmp_path: Path) -> None:
    for command in (
        ["check", tmp_path / "no.toml"],
        ["simulate", tmp_path / "no.hex"],
        ["compile", tmp_path / "no.c"],
        ["assemble", tmp_path / "no.asm"],
        ["disassemble", tmp_path / "no.hex"],
        ["verify", tmp_path / "no.hex", "--against", tmp_path / "no.json"],
    ):
        ran = run(*command)
        assert ran.code == 2 and "no." in ran.err, ran


def test_an_unknown_command_or_option_is_exit_code_2(run: Callable[..., Any]) -> None:
    assert run("explode").code == 2
    assert run("simulate", "--wat").code == 2


def test_a_defect_is_no_verdict(
    run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "good.hex").write_text(GOOD_HEX)
    monkeypatch.setattr("servogen.simulator.machine.Machine.stream", lambda *_: 1 / 0)
    ran = run("simulate", tmp_path / "good.hex")
    assert ran.code == 3 and "ZeroDivisionError" in ran.err


def test_an_interrupt_is_exit_code_130(
    run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    (tmp_path / "good.hex").write_text(GOOD_HEX)
    monkeypatch.setattr("servogen.simulator.machine.Machine.stream", interrupted)
    assert run("simulate", tmp_path / "good.hex", "--vcd", tmp_path / "x.vcd").code == 130
    assert [path.name for path in tmp_path.iterdir()] == ["good.hex"]


def test_an_unknown_choice_is_answered_with_the_choices(run: Callable[..., Any]) -> None:
    ran = run("schema", "foo")
    assert ran.code == 2 and "'kind': 'foo' is not one of 'job', 'robot', 'servo', 'lab'" in ran.err


def test_an_option_without_its_values_leads_to_the_help_of_its_command(run: Callable[..., Any]) -> None:
    ran = run("statics", "leg", 10, 30, "--force-n", 0, 0)
    assert ran.code == 2 and "see: servogen statics --help" in ran.err
    ran = run("statics", "check", 10, 30, "--force-n", 0, 0)
    assert ran.code == 2 and "see: servogen statics --help" in ran.err
    ran = run("explode", "--force-n")
    assert ran.code == 2 and "see: servogen --help" in ran.err
