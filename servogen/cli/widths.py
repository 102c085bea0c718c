"""The table of a plan's pulse widths."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from servogen.cli.show import table
from servogen.pulse import Quantised

MAX_WIDTH_ROWS = 16
"""The largest number of widths of which each has a row."""

MIN_FOLDED = 3
"""A ramp of fewer widths is shown row by row."""


def width_table(widths: Sequence[Quantised], unfolded: str = "--json") -> None:
    """Print one row for each width, and one for each ramp; of many, one for each servo."""
    folded = list(_rows_and_ramps(widths))
    many = len(folded) > MAX_WIDTH_ROWS
    if many:
        servos = dict.fromkeys(row.channel for row in widths)
        rising = sorted(widths, key=lambda row: row.requested_us)
        folded = [[row for row in rising if row.channel == servo] for servo in servos]
    examples = any(row.which for row in widths) and not many
    table(
        "Pulse widths",
        ("servo", *(["pulse"] if examples else []), "requested µs", "cycles", "error µs", "frames"),
        [_width_cells(rows, examples, "widths" if many else "widths of ramps") for rows in folded],
        least=("requested µs",),
    )
    if many:
        print(f"{len(widths)} widths, a row for each servo: {unfolded} has them all")


def _rows_and_ramps(widths: Sequence[Quantised]) -> Iterator[list[Quantised]]:
    """Yield each row alone, but neighbouring widths that no pose holds together: they are a ramp's."""
    for (_, held), group in groupby(widths, key=lambda row: (row.channel, row.held)):
        rows = list(group)
        if held or len(rows) < MIN_FOLDED:
            yield from ([row] for row in rows)
        else:
            yield rows


def _width_cells(rows: list[Quantised], examples: bool, what: str) -> tuple[object, ...]:
    first, last = rows[0], rows[-1]
    if len(rows) == 1:
        which = [first.which] if examples else []
        error = f"{float(first.error_us):+z.3f}"
        return (first.channel, *which, f"{float(first.requested_us):z.3f}", first.cycles, error, first.frames)
    errors = [float(row.error_us) for row in rows]
    return (
        f"{first.channel}, {len(rows)} {what}",
        *([""] if examples else []),
        f"{float(first.requested_us):z.3f} to {float(last.requested_us):z.3f}",
        f"{first.cycles} to {last.cycles}",
        f"{min(errors):+z.3f} to {max(errors):+z.3f}",
        sum(row.frames for row in rows),
    )
