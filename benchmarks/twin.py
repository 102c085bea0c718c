"""The twin's speed: twelve servos with motors and sag, contacts, steps of 1 ms, against real time.

Run: `python benchmarks/twin.py` on a quiet machine. The job is compiled before. Edges first: the chip runs
ahead by 20 ms; lock-step: it waits for the physics at every millisecond. The runs of each must be identical.
Exit code 1 when a demand is missed.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

from servogen.job import load, plan_job
from servogen.twin import TwinSettings
from servogen.twin.run import Record, simulate
from servogen.workflows.engines import planned

JOB = Path(__file__).parent.parent / "jobs" / "hexapod-turn.toml"
EDGES_FIRST, LOCK_STEP = 25.0, 12.0
ROUNDS = 3


def main() -> int:
    """Measure, print and compare with the demands."""
    job = plan_job(load(JOB))
    found = planned(job)
    image = found.make(job.firmware.dialect).compilation.image
    lead_in = found.job.trajectory.loop_start - job.trajectory.loop_start
    right = True
    for name, chunk_ms, demand in (("edges first", 20, EDGES_FIRST), ("lock-step", 1, LOCK_STEP)):
        settings = replace(TwinSettings(), chunk_ms=chunk_ms)
        best, busy, records = 0.0, 0.0, list[Record]()
        for _ in range(ROUNDS):
            start, begun = time.perf_counter(), time.process_time()
            records.append(simulate(found.job, found.plan.schedule, image, lead_in, settings))
            seconds = float(records[-1].time[-1])
            best = max(best, seconds / (time.perf_counter() - start))
            busy = max(busy, seconds / (time.process_time() - begun))
        identical = len({record.digest() for record in records}) == 1
        right &= identical and best >= demand
        said = "identical runs" if identical else "RUNS DIFFER"
        print(f"{name}: {best:.1f} x real time ({busy:.1f} x of processor time), demanded {demand:g}; {said}")
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
