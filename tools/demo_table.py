"""Prints the table of the kept firmware as Markdown, a row for each job: what `make demo` says of the jobs.

    python tools/demo_table.py

Reads firmware/*/report.txt. A test compares the page that shows the table with what this prints.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

FIRMWARE = Path(__file__).parent.parent / "firmware"
COLUMNS = ("job", "engine", "words: c2c", "xc8", "sdcc", "left", "RAM", "frames")
COLUMNS += ("worst edge error", "from the plan", "one run")


def row(report: Path) -> tuple[str, ...]:
    """Return the cells of a job. Raises ValueError if its dialects' programs differ in more than size."""
    text = report.read_text()
    programs = re.findall(r"^(?:c2c|xc8|sdcc) +\S+ +\S+ +(\d+) +(\d+) +(\d+) of 68", text, re.M)
    words, left, ram = zip(*(map(int, program) for program in programs), strict=True)
    (engine,) = re.findall(r"^Engine: (\w+)$", text, re.M)
    ((verdict, frames, cycles, distance),) = set(
        re.findall(
            r"^  (\w+): compared .*?, (\d+) frames.*; (\d+ cycles) from .* within (.+) of the plan",
            text,
            re.M,
        )
    )
    sizes = (*map(str, words), str(min(left)), str(max(ram)))
    return (report.parent.name, engine, *sizes, frames, cycles, distance, verdict)


def lines() -> Iterator[str]:
    """Yield the table's lines."""
    rows = [row(report) for report in sorted(FIRMWARE.glob("*/report.txt"))]
    for cells in (COLUMNS, ("---",) * len(COLUMNS), *rows):
        yield f"| {' | '.join(cells)} |".replace(" --- ", "---")


if __name__ == "__main__":
    print("\n".join(lines()))
