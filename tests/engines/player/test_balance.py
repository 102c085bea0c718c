"""Rows off the motion: a chord of a curve is off it on one side, a balanced one half as far on both."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from servogen.engines.player.balance import balance
from servogen.engines.player.encoding import Encoded
from servogen.engines.player.poses import poses_encoded
from servogen.errors import ServogenError
from servogen.job import loads, plan_job
from servogen.job.starter import starter
from servogen.workflows.engines import planned
from servogen.workflows.job_build import build
from tests.engines.player.player_jobs import ROOT

FAR = 8.0
"""How far (cycles) the chords between poses of the motion may be off it."""


def parabola() -> tuple[np.ndarray, Encoded]:
    """A servo's widths and those of one that moves evenly, which no law but the straight one does; the poses
    of their chords.
    """
    frames = np.arange(-48.0, 49.0)
    rows = 1000 + np.column_stack((0.04 * frames**2, frames))
    rows = np.vstack((rows, rows[::-1]))
    return rows, poses_encoded(rows, (0,), 0, FAR, 0.0)


def off(encoded: Encoded, rows: np.ndarray) -> float:
    return float(np.abs(encoded.widths - rows).max())


def test_balanced_chords_are_half_as_far_off_a_curve() -> None:
    """Beside that a byte is rounded by half of its step, a time by a 256th of its way, the pulse by half a
    cycle.
    """
    rows, plain = parabola()
    closer = balance(plain, rows)
    rounding = 2.0 ** int(plain.scale.shifts.max()) / 2 + float(np.ptp(rows)) / 256 + 0.5
    assert FAR - rounding < off(plain, rows)
    assert off(closer, rows) <= FAR / 2 + rounding
    assert closer.size == plain.size and closer.steps == plain.steps


def test_what_is_balanced_already_stays() -> None:
    rows, plain = parabola()
    once = balance(plain, rows)
    assert balance(once, rows).rows == once.rows


def test_a_pose_that_no_frame_has_stays() -> None:
    rows, plain = parabola()
    spare = replace(plain, rows=plain.rows + bytes([7, 7]))
    assert balance(spare, rows).rows[-2:] == bytes([7, 7])
    assert balance(spare, rows).rows[:-2] == balance(plain, rows).rows


def test_frames_without_pulses_pull_no_row() -> None:
    rows = np.vstack((np.full((5, 1), 1000.0), np.full((5, 1), np.nan), np.full((5, 1), 1200.0)))
    made = balance(poses_encoded(rows, (0,), 0, 2.0, 0.0), rows)
    assert made.silent.tolist() == [False] * 5 + [True] * 5 + [False] * 5
    assert np.abs(made.widths - rows)[~made.silent].max() <= 0.5


def crawl(stride_mm: int) -> str:
    """The job of a new quadruped with longer steps than its template's."""
    text = starter("quadruped-coxa-femur-tibia", "mg996r", ROOT / "my.toml")
    text = text.replace("forward_mm = 8 }", f"forward_mm = {stride_mm} }}")
    return text.replace("# cycle_s = 1.28 ", "cycle_s = 0.96 ")


def test_three_joints_a_leg_take_longer_steps_with_balanced_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without them this crawl would be 16 µs from its plan."""
    job = plan_job(loads(crawl(16), "my.toml"))
    done = build(job)
    assert done.exact and [each.firmware.dialect for each in done.programs] == ["c2c", "xc8", "sdcc"]
    assert done.plan.schedule.plan_error_us <= 10
    monkeypatch.setattr(
        import_module("servogen.engines.player.playing"), "balance", lambda encoded, ideal: encoded
    )
    with pytest.raises(ServogenError, match="beyond-max-error"):
        planned(job)
