"""`check` is read by people: ramps are one row, warnings come last with their number."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]

RAMP = """\
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"

[motion]
poses = [
    { arm_deg = 0, hold_s = 0.2 },
    { arm_deg = 90, move_s = 1, hold_s = 0.2 },
    { arm_deg = 180, move_s = 1, hold_s = 0.2 },
]

[firmware]
engine = "sequence"
"""


@pytest.fixture
def ramp(tmp_path: Path) -> Path:
    path = tmp_path / "ramp.toml"
    path.write_text(RAMP)
    return path


def test_a_ramp_is_one_row_between_the_widths_that_are_held(run: Run, ramp: Path) -> None:
    done = run("check", ramp)
    rows = [line.split() for line in done.out.splitlines() if line.startswith("  arm")]
    assert [row[1] for row in rows] == ["1000.000", *[rows[1][1]], "1500.000", *[rows[3][1]], "2000.000"]
    assert "widths of ramps" in done.out
    whole = json.loads(run("check", ramp, "--json").out)["widths"]
    held = [row for row in whole if row["requested_us"] in (1000, 1500, 2000)]
    passed = sum(row["frames"] for row in whole) - sum(row["frames"] for row in held)
    folded = [row for row in rows if "ramps" in row]
    assert len(folded) == 2
    assert sum(int(row[-1]) for row in folded) == passed
    assert len(whole) > 100


def test_a_job_without_ramps_has_every_row(run: Run, tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    job.write_text(RAMP.replace("move_s = 1, ", ""))
    out = run("check", job).out
    assert "widths of ramps" not in out
    assert [line.split()[1] for line in out.splitlines() if line.startswith("  arm")] == [
        "1000.000",
        "1500.000",
        "2000.000",
    ]


def test_warnings_come_last_with_their_number(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = tmp_path / "job.toml"
    job.write_text(RAMP.replace("move_s = 1", "move_s = 0.2") + "\n[frame]\nperiod_us = 21_000\n")
    written: list[str] = []

    class Screen:
        """Both streams of a terminal."""

        def write(self, text: str) -> int:
            written.append(text)
            return len(text)

        def flush(self) -> None:
            return

        def isatty(self) -> bool:
            return False

    from servogen.cli import job_commands

    screen = Screen()
    monkeypatch.setattr("sys.stdout", screen)
    monkeypatch.setattr("sys.stderr", screen)
    job_commands.check(job)
    lines = "".join(written).splitlines()
    warnings = [line for line in lines if ": warning: " in line]
    assert len(warnings) >= 2
    begin = next(index for index, line in enumerate(lines) if line.endswith(" warnings:"))
    assert begin > max(index for index, line in enumerate(lines) if "─" in line)
    assert [line for line in lines[begin + 1 :] if not line.startswith("  ")] == warnings


def test_a_job_without_warnings_says_no_number(run: Run) -> None:
    assert run("check", Path(__file__).parents[2] / "jobs" / "lab8-exercise.toml").err == ""


@pytest.mark.parametrize("command", ["compile", "simulate"])
def test_other_commands_say_the_number_before_their_warnings(run: Run, tmp_path: Path, command: str) -> None:
    """`1;` has no effect, and RB0 is driven before its latch was written: a warning of either."""
    (tmp_path / "x.c").write_text("void main(void) { 1; while (1); }\n")
    (tmp_path / "x.asm").write_text(" list p=16f84\n org 0\n bsf 3, 5\n bcf 6, 0\n bcf 3, 5\n goto $\n end\n")
    file = tmp_path / ("x.c" if command == "compile" else "x.asm")
    lines = run(command, file).err.splitlines()
    warnings = [line for line in lines if ": warning: " in line]
    number = f"{len(warnings)} warning" + ("s:" if len(warnings) != 1 else ":")
    assert warnings
    assert lines[:2] == [number, warnings[0]]
