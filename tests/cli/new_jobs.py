"""Every robot of `servogen new` with every servo: each job is planned without a warning, or fits its chips.

    python -m tests.cli.new_jobs [--fits]

Prints each kind and servo as it is done: a minute for all, six with `--fits`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from servogen.job import KINDS, loads, plan_job
from servogen.job.starter import starter
from servogen.pulse import plan
from servogen.robot import servo_models
from servogen.workflows.engines import chip_jobs, planned

MODELS = {name: servo_models.servo_model(name) for name in servo_models.names()}
TOO_NARROW = {
    ("arm", "kst-x08h"),
    ("hexapod", "kst-x08h"),
    ("hexapod", "savox-sc-1251mg"),
    ("hexapod", "savox-sc-1256tg"),
    ("hexapod-hip-lift", "kst-x08h"),
}
"""Servos of 90° or 100°, of which these robots need more."""
EVERY = [
    (kind, servo)
    for kind in KINDS
    for servo, model in MODELS.items()
    if model.continuous == (kind == "omni") and (kind, servo) not in TOO_NARROW
]


def planned_without_a_warning(text: str, servo: str) -> None:
    """Every pulse is one of the servo's own widths, too."""
    job = plan_job(loads(text, "my.toml"))
    shortest, longest = MODELS[servo].calibration.widths_us
    assert job.warnings == ()
    for part in chip_jobs(job) if job.chips else (job,):
        pulses = plan(part.trajectory, part.servos, part.frame)
        assert pulses.warnings == ()
        assert all(shortest <= width.requested_us <= longest for width in pulses.widths)


def fits_its_chips(text: str) -> None:
    """Its pulses are within 10 us of the plan, too."""
    job = plan_job(loads(text, "my.toml"))
    for part in chip_jobs(job) if job.chips else (job,):
        played = planned(part)
        assert played.plan.schedule.plan_error_us <= 10
        assert played.make("c2c").compilation.words <= 1024


if __name__ == "__main__":
    for kind, servo in EVERY:
        print(kind, servo, flush=True)
        text = starter(kind, servo, Path("my.toml"))
        if "--fits" in sys.argv:
            fits_its_chips(text)
        else:
            planned_without_a_warning(text, servo)
