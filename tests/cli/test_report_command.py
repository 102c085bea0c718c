"""`servogen report`: a page in a file."""

import json
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

ROOT = Path(__file__).parents[2]

Run = Callable[..., Any]


def test_a_page_is_written(run: Run, tmp_path: Path) -> None:
    ran = run("report", ROOT / "jobs" / "lab9-exercise.toml", "-o", tmp_path / "page.html", "--json")
    assert ran.code == 0
    page = json.loads(ran.out)
    assert page.pop("plan_error")["width_us"] == 0.433  # as report.txt of the same job says
    assert page == {"file": str(tmp_path / "page.html"), "proven": True, "not_built": ""}
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
        f"[motion]\nposes = [{poses}]\n"
    )
    ran = run("report", job, "-o", tmp_path / "page.html")
    assert ran.code == 0
    assert "planned, but more than" in ran.out
    assert "planned, not built" in (tmp_path / "page.html").read_text()


def test_a_capture_that_cannot_be_read_writes_no_page(run: Run, tmp_path: Path) -> None:
    job = ROOT / "jobs" / "lab9-exercise.toml"
    ran = run("report", job, "-o", tmp_path / "page.html", "--capture", tmp_path / "none.vcd")
    assert ran.code == 2
    assert not (tmp_path / "page.html").exists()
