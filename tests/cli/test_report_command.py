"""`servogen report`: a page in a file."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]

Run = Callable[..., Any]


def test_a_page_is_written(run: Run, tmp_path: Path) -> None:
    ran = run("report", ROOT / "jobs" / "lab9-exercise.toml", "-o", tmp_path / "page.html")
    assert ran.code == 0
    html = (tmp_path / "page.html").read_text()
    assert html.startswith("<!DOCTYPE html>")
    assert "Path</h2>" in html  # the foot's


def test_a_capture_that_cannot_be_read_writes_no_page(run: Run, tmp_path: Path) -> None:
    job = ROOT / "jobs" / "lab9-exercise.toml"
    ran = run("report", job, "-o", tmp_path / "page.html", "--capture", tmp_path / "none.vcd")
    assert ran.code == 2
    assert not (tmp_path / "page.html").exists()
