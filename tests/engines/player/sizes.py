"""Measures what the player's tables hold for the kept jobs.

`python -m tests.engines.player.sizes` prints the rows of the table in docs/firmware.md.
"""

from __future__ import annotations

from servogen.build import planned
from servogen.engines.player.engine import play
from servogen.job import load, plan_job
from tests.engines.player.player_jobs import ROOT

JOBS = ("hexapod-tripod", "hexapod-ripple", "hexapod-wave", "hexapod-turn", "scara-pick", "rvm1-program")


def row(name: str) -> str:
    """Return a job's row: the bytes of its tables, the words of its program, its distance from the plan."""
    job = plan_job(load(ROOT / "jobs" / f"{name}.toml"))
    encoded = play(job)[1].encoded
    made = planned(job)
    error = made.plan.schedule.plan_error
    assert error is not None
    words = made.make("c2c").compilation.words
    counts = (len(encoded.rows), len(encoded.script.data), len(encoded.script.timings), len(encoded.laws))
    return f"| `{name}` | {' | '.join(map(str, counts))} | {words} | {error.width_us:.1f} µs |"


def main() -> None:
    for name in JOBS:
        print(row(name))


if __name__ == "__main__":
    main()
