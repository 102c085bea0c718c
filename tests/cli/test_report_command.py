"""`servogen report`: a page in a file."""

import json
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]

Run = Callable[..., Any]


def test_a_page_is_written(run: Run, tmp_path: Path) -> None:
    ran = run("report", ROOT / "jobs" / "lab9-exercise.toml", "-o", tmp_path / "page.html", "--json")
    assert ran.code == 0
    page = json.loads(ran.out)
    assert page.pop("plan_error")["width_us"] == 0.433  # as report.txt of the same job says
    not_asked = {"capture": None, "twin": None}
    assert page == {"file": str(tmp_path / "page.html"), "exact": True, "diagnostics": [], **not_asked}
    html = (tmp_path / "page.html").read_text()
    assert html.startswith("<!DOCTYPE html>")
    assert "Path</h2>" in html  # the foot's


def test_a_job_that_no_chip_can_hold_has_a_page_of_its_plan(run: Run, tmp_path: Path) -> None:
    """2000 positions in no order are more than 1024 words can say in any way."""
    angles = Random(1)
    poses = ", ".join(f"{{ arm_deg = {angles.randrange(181)}, hold_s = 0.02 }}" for _ in range(2000))
    job = tmp_path / "long.toml"
    job.write_text(
        '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
        '[[servo]]\nname = "arm"\npin = "RB0"\nmodel = "futaba-s3001"\n'
        f'[motion]\nposes = [{poses}]\n[firmware]\nengine = "sequence"\n'
    )
    ran = run("report", job, "-o", tmp_path / "page.html")
    assert ran.code == 0
    assert "planned, but more than" in ran.out
    assert "planned, not built" in (tmp_path / "page.html").read_text()


SQUARE = (
    '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
    '[[servo]]\nname = "arm"\npin = "RB0"\nmodel = "futaba-s3001"\n'
    "[motion]\nrepeat = true\nposes = [{ arm_deg = 0, hold_s = 0.1 }, { arm_deg = 180, hold_s = 0.1 }]\n"
)
"""Pulses of 1000 and 2000 µs, 20 ms apart: every edge on the grid of 1 kHz."""


@pytest.fixture
def square(tmp_path: Path) -> Path:
    job = tmp_path / "square.toml"
    job.write_text(SQUARE)
    return job


def test_a_capture_that_cannot_be_read_writes_no_page(run: Run, tmp_path: Path, square: Path) -> None:
    ran = run("report", square, "-o", tmp_path / "page.html", "--capture", tmp_path / "none.vcd")
    assert ran.code == 2
    assert not (tmp_path / "page.html").exists()


@pytest.mark.parametrize(("moved", "code"), [(0, 0), (1, 1)])
def test_report_and_verify_agree_on_edges_in_cycles(
    run: Run, tmp_path: Path, square: Path, moved: int, code: int
) -> None:
    """Edges that servogen wrote are not samples: round times are not slow ones, and one cycle is an error."""
    assert run("build", square, "-o", tmp_path / "square").code == 0
    made = tmp_path / "square" / "main.vcd"
    text = made.read_text()
    # The seventh fall is moved, one line of a time stamp.
    stamps = [line for line in text.splitlines() if line.startswith("#")]
    edges = tmp_path / "edges.vcd"
    edges.write_text(text.replace(f"\n{stamps[14]}\n", f"\n#{int(stamps[14][1:]) + moved}\n"))
    verified = run("verify", edges, "--against", tmp_path / "square" / "schedule.json")
    reported = run("report", square, "-o", tmp_path / "page.html", "--capture", edges)
    assert (verified.code, reported.code) == (code, code), (verified.out, reported.out)


def test_report_takes_the_rate_of_a_capture_that_does_not_say_it(
    run: Run, tmp_path: Path, square: Path
) -> None:
    """A capture of two loops, of 10 frames each, with times in whole milliseconds."""
    rows = ["Time [s],RB0", "0,0"]
    for frame in range(25):
        width_ms = 1 if frame % 10 < 5 else 2
        rise_ms = 20 * frame + 7
        rows += [f"{rise_ms / 1000},1", f"{(rise_ms + width_ms) / 1000},0"]
    capture = tmp_path / "run.csv"
    capture.write_text("\n".join(rows) + "\n")
    page = ("report", square, "-o", tmp_path / "page.html", "--capture", capture)
    refused = run(*page)
    assert refused.code == 2
    assert "does not state its sampling rate" in refused.err and "--rate" in refused.err
    assert run(*page, "--rate", "24000000").code == 0
    assert run(*page, "--rate", "1000").code == 2


def test_a_rate_is_of_a_capture(run: Run, tmp_path: Path, square: Path) -> None:
    ran = run("report", square, "-o", tmp_path / "page.html", "--rate", "24000000")
    assert ran.code == 2
    assert "--rate: only a capture has a sampling rate" in ran.err
    assert run("build", square, "-o", tmp_path / "square").code == 0
    edges = tmp_path / "square" / "main.vcd"
    ran = run("report", square, "-o", tmp_path / "page.html", "--capture", edges, "--rate", "24000000")
    assert ran.code == 2
    assert "--rate: only a capture has a sampling rate" in ran.err
