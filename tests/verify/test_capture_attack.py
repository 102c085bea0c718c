"""A sample of the attack on recordings: `python -m tests.verify.capture_attack` is the whole."""

from __future__ import annotations

from pathlib import Path

from tests.verify.capture_attack import attack


def test_no_recording_that_differs_agrees(tmp_path: Path) -> None:
    """And every unchanged one does, in each format."""
    counts, wrong = attack(7, 3, tmp_path)
    assert (sum(counts.values()), wrong) == (7, [])
