"""What people type who know other tools: the message says what is meant here."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import ROOT, Run

LAB8 = (ROOT / "jobs" / "lab8-exercise.toml").read_text()


@pytest.mark.parametrize(
    ("arguments", "said", "never"),
    [
        (("upload", "main.hex"), "did you mean 'flash'?", "plot"),
        (("sim", "main.hex"), "did you mean 'simulate'?", "--help"),
        (
            ("simulate", "-o", "x.csv", "firmware/lab8-exercise/main.hex"),
            "files are written by --edges, --vcd, --trace, --eeprom",
            "--help",
        ),
        (("biuld", "job.toml"), "Did you mean 'build'?", "flash"),
        (("check", "--chip", "PIC16F84A", "job.toml"), "see: servogen check --help", "Possible options"),
        (
            ("gait", "hexapod", "--gait", "jump"),
            "known: crawl, ripple, tetrapod, tripod, trot, wave",
            "did you",
        ),
        (("gait", "hexapod", "--gait", "tripd"), "did you mean 'tripod'?", "known:"),
        (
            ("flash", "firmware/lab8-exercise/main.hex", "--programmer", "k150"),
            "a K150 is used by picpro",
            "known:",
        ),
        (
            ("rig", "firmware/lab8-exercise/main.hex"),
            "takes a job file (TOML) [not-allowed]\n  simulate, watch and verify take programs;"
            " servogen rig JOB.toml --hex FILE",
            "syntax",
        ),
        (("drive", "jobs/scara-pick.toml", "--port", "x"), "the job has no [stream]", "internal"),
        (("jacobian", "scara", "0", "0", "0", "0", "--frame", "9" * 5000), "no frame", "internal"),
    ],
)
def test_a_command_of_another_tool_is_understood(
    run: Run, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], said: str, never: str
) -> None:
    monkeypatch.chdir(ROOT)
    ran = run(*arguments)
    assert ran.code == 2
    assert said in ran.err and never not in ran.err


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("hold_s = 2 }", "hold_ms = 2000 }", "write hold_s = 2 ["),
        ("period_us = 20_000", "period_ms = 20", "write period_us = 20000 ["),
        ("clock_hz = 4_000_000", "clock_mhz = 3.579545", "write clock_hz = 3579545 ["),
        ("hold_s = 2 }", 'hold_ms = "long" }', "write hold_s ["),
        ('device = "PIC16F84"', 'device = "PIC16F628A"', "known: PIC16F84, PIC16F84A"),
    ],
)
def test_a_job_in_other_units_or_for_another_chip(
    run: Run, tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert old in LAB8
    job = tmp_path / "job.toml"
    job.write_text(LAB8.replace(old, new))
    ran = run("check", job)
    assert ran.code == 2 and said in ran.err
