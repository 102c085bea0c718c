"""Proves the interrupts of stream jobs for every line: `python tools/prove_streams.py JOB.toml ...`.

It takes minutes for each program; jobs without a serial line are skipped. It prints a table; exit code 1 if
an interrupt's edges are not exact, a bit of a sender within the stated error is not sampled in its time, or
the C may be late.
`--every N` follows every Nth cycle of a fall's round only, for a quick look.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from servogen.engines.stream.engine import compiled, stream
from servogen.engines.stream.settings import BIT_GAP, START_GAP
from servogen.engines.stream.theorem import InterruptChanged, guarantee
from servogen.job import load, plan_job

DIALECTS = ("c2c", "xc8", "sdcc")
HEADINGS = ("program", "answer", "a pulse begins", "samples apart", "left to the C", "taken at most")


def rows(file: Path, every: int) -> list[tuple[tuple[str, ...], bool]]:
    """Return a job's rows of the table, one per dialect, each with whether it is proven."""
    job = plan_job(load(file))
    if job.stream is None:
        return []
    _, streamed = stream(job)
    found = []
    for dialect in DIALECTS:
        made = compiled(job, streamed, dialect)
        name = f"{file.stem}/main.{dialect}.c"
        try:
            holds = guarantee(made.compilation.listing, streamed, range(0, 256, every))
        except InterruptChanged as error:
            found.append(((name, f"not proven: {error}", "", "", "", ""), False))
            continue
        budget = made.timing_budgets[-1]
        good = (
            holds.start_gap <= START_GAP
            and holds.bit_gap <= BIT_GAP
            and all(each.left is not None and each.left >= 0 for each in made.timing_budgets)
        )
        cells = (
            name,
            "proven for every line" if good else "not proven",
            f"cycle {holds.rise}",
            f"{holds.start_gap}, {holds.bit_gap} of {START_GAP}, {BIT_GAP}",
            str(budget.room),
            str(budget.worst),
        )
        found.append((cells, good))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("jobs", type=Path, nargs="+", metavar="JOB.toml")
    parser.add_argument("--every", type=int, default=1, metavar="N")
    args = parser.parse_args()
    fine = True
    print(" | ".join(HEADINGS))
    for file in args.jobs:
        for cells, good in rows(file, args.every):
            fine &= good
            print(" | ".join(cells), flush=True)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
