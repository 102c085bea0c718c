"""Every motion plays from a tape: imported, the fastest along a path, a walk of three joints a leg."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from servogen.engines.inputs.tape import Tape
from servogen.job import PlannedJob, loads, plan_job
from servogen.recordings import read
from servogen.workflows.engines import chip_jobs, planned
from servogen.workflows.importing import imported
from tests.engines.tape.tape_jobs import judged, text

ROOT = Path(__file__).parents[3]


def assert_exact(job: PlannedJob, slack_us: float = 1e-3) -> None:
    """Every edge is the plan's, and that only rounds."""
    played = planned(job)
    verdict = judged(played.make("c2c").compilation.image, played.plan.schedule)
    assert verdict.passed and verdict.worst_edge_error == 0, verdict.reasons
    error = played.plan.schedule.plan_error
    assert error is not None and error.width_us <= float(job.clock.cycle_us) / 2 + slack_us


def test_an_import_keeps_every_frame_of_an_animation(tmp_path: Path) -> None:
    """A Blender export at 50 frames a second, with no law that the player could use."""
    frames = 60
    angles = [
        [90 + 40 * math.sin(0.21 * n + k) * math.cos(0.037 * n * n) for k in range(3)] for n in range(frames)
    ]
    names = ("arm", "hand", "foot")
    positions = [dict(zip(names, (round(value, 3) for value in row), strict=True)) for row in angles]
    export = {"fps": 50, "frames": frames, "seconds": frames / 50, "positions": positions}
    file = tmp_path / "dance.json"
    file.write_text(json.dumps(export))
    base = text().replace("soft_start_s = 0.1", "soft_start_s = 0")
    told: list[str] = []
    result = imported(read(file), ({}, "deg"), base, "t.toml", False, told.append)
    assert told == ["reducing", f"planning {result.poses} poses"]
    assert result.poses >= frames - 2 and result.played is not None
    schedule = result.played.plan.schedule
    rows = [run.pulses for run in (*schedule.lead_in, *schedule.loop) for _ in range(run.frames)]
    servos = result.job.servos
    for row, given in zip(rows, positions, strict=False):
        for pulse, servo in zip(row, servos, strict=True):
            width = servo.width_us(math.radians(given[servo.name]))
            assert pulse is not None and abs(pulse.width - width) <= 0.5 + 1 / 16 + 1e-6
    assert_exact(result.job)


@pytest.mark.campaign
def test_the_fastest_way_along_a_path() -> None:
    pick = (ROOT / "jobs/scara-pick.toml").read_text().replace('law = "quintic"', 'law = "fastest"')
    assert_exact(plan_job(loads(pick + "\n[tape]\n", "pick.toml")))


@pytest.mark.campaign
def test_a_walk_of_three_joints_a_leg() -> None:
    """No chip has room for 12 servos and a bus: the nine of a hexapod's left legs, one chip of two."""
    chip = '[[chip]]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\nwire = "{}"\n'
    pins = [f"RB{bit}" for bit in range(8)] + ["RA0"]
    servos = "".join(
        f'[[servo]]\nname = "{leg}-{joint}"\npin = "{pins[(3 * row + column) % 9]}"\nmodel = "sg90"\n'
        f'joint = "{leg}_{joint}"\n'
        for row, leg in enumerate(("L1", "L2", "L3", "R1", "R2", "R3"))
        for column, joint in enumerate(("coxa", "femur", "tibia"))
    )
    walk = f'[robot]\nname = "hexapod-coxa-femur-tibia"\n{servos}[walk]\nroute = [{{ forward_mm = 60 }}]\n'
    job = plan_job(loads(chip.format("RB0") + chip.format("RA4") + walk, "walk.toml"))
    left, _ = chip_jobs(job)
    assert_exact(replace(left, inputs=(Tape(),), firmware=replace(left.firmware, soft_start_s=Fraction(0))))
