"""Frames that differ one by one, as rows of tables of widths.

In: the parts of a schedule. Out: the same, in which neighbours of few frames are one part that plays rows.

A row's pulse is a delay by a loop of `turn` cycles and one of `turn` + 1, which together reach every cycle:
n = turn·q + r is q - r turns of the first and r + 1 of the second, but for a constant (`wait_turns` in
`templates/sequence/main.c.j2`). The delay after it is what is left of the longest width.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby

from servogen.engines.sequence.programs import WidthTable
from servogen.pulse import PulseSchedule, Run
from servogen.units import Cycles

FEW_FRAMES = 8
"""The frames of the longest run that is rows: two words for each are fewer than a call of a function."""

FEW_ROWS = 6
"""The smallest number of different frames that are a table: fewer are shorter C one by one."""

MAX_ROWS = 255
"""Rows are counted in a byte."""

TURNS = (8, 16, 32, 64)
"""The cycles of a turn: the fewest with which a byte counts the turns of the longest pulse."""

FUNCTION_WORDS = 50
"""About the words of a function that plays a table."""

FIXED = Cycles(160)
"""The part of each width that is no loop: more cycles than the statements of `wait_turns` take."""


@dataclass(frozen=True, slots=True)
class SchedulePart:
    """A run that is repeated `turns` times, or `run.frames` rows of a table from row `first` on."""

    run: Run
    turns: int = 1
    table: WidthTable | None = None
    first: int = 0


def pulsed(run: Run) -> bool:
    """Return whether a run has a pulse."""
    return any(run.pulses)


def in_tables(
    schedule: PulseSchedule, lead_in: tuple[SchedulePart, ...], loop: tuple[SchedulePart, ...]
) -> tuple[tuple[SchedulePart, ...], tuple[SchedulePart, ...]]:
    """Return the parts of the lead-in and of the loop with rows in place of frames that differ."""
    tables: dict[int, WidthTable] = {}
    sides = [
        [part for piece in _pieces(side) for part in _placed(schedule, piece, tables)]
        for side in (lead_in, loop)
    ]
    lead_in, loop = (
        tuple(replace(part, table=tables[part.table.number]) if part.table else part for part in side)
        for side in sides
    )
    return lead_in, loop


def _pieces(parts: tuple[SchedulePart, ...]) -> Iterator[tuple[SchedulePart, ...]]:
    """Yield neighbours that can be rows of one table, a frame each, and the other parts."""

    def short(part: SchedulePart) -> bool:
        return pulsed(part.run) and part.turns == 1 and part.run.frames <= FEW_FRAMES

    for are_short, group in groupby(parts, short):
        together = tuple(group)
        if not are_short or len({part.run.pulses for part in together}) < FEW_ROWS:
            yield from ((part,) for part in together)
            continue
        rows = [
            SchedulePart(replace(part.run, frames=1)) for part in together for _ in range(part.run.frames)
        ]
        yield from (tuple(rows[first : first + MAX_ROWS]) for first in range(0, len(rows), MAX_ROWS))


def _placed(
    schedule: PulseSchedule, piece: tuple[SchedulePart, ...], tables: dict[int, WidthTable]
) -> Iterator[SchedulePart]:
    """Yield the parts of a piece: one that plays rows of one of `tables`; where there can be no table,
    equal neighbours together.
    """
    rows = tuple(part.run for part in piece)
    number, first = _found(rows, tables) if len(rows) > 1 else (0, 0)
    last = tables.get(len(tables))
    if len(rows) > 1 and not number:
        alone = _table(schedule, len(tables) + 1, rows)
        wider = _table(schedule, len(tables), (*last.rows, *rows)) if last and alone else None
        if wider and last and alone and wider.words < last.words + alone.words + FUNCTION_WORDS:
            number, first, tables[len(tables)] = len(tables), len(last.rows), wider
        elif alone:
            number, tables[len(tables) + 1] = alone.number, alone
    if number:
        yield SchedulePart(Run(len(rows), rows[0].pulses), table=tables[number], first=first)
        return
    for _, equal in groupby(piece, lambda part: part.run.pulses):
        same = tuple(equal)
        yield replace(same[0], run=replace(same[0].run, frames=sum(part.run.frames for part in same)))


def _found(rows: tuple[Run, ...], tables: dict[int, WidthTable]) -> tuple[int, int]:
    """Return the number of the table in which these rows already are, and the first of them; 0 if in none."""
    for number, table in tables.items():
        for first in range(len(table.rows) - len(rows) + 1):
            if table.rows[first : first + len(rows)] == rows:
                return number, first
    return 0, 0


def _table(schedule: PulseSchedule, number: int, rows: tuple[Run, ...]) -> WidthTable | None:
    """Return the table of these rows; None if they are too many, or their pulses are not one after the other
    with time for the statements between them.
    """
    pulses = list(zip(*(row.pulses for row in rows), strict=True))
    if len(rows) > MAX_ROWS or any(len({pulse and pulse.rise for pulse in each}) > 1 for each in pulses):
        return None
    widths = [[pulse.width if pulse else 0 for pulse in each] for each in pulses]
    moving = tuple(channel for channel, each in enumerate(widths) if len(set(each)) > 1)
    if not moving:
        return None
    widest, narrowest = max(map(max, widths)), min(min(widths[channel]) for channel in moving)
    turn = next((turn for turn in TURNS if MAX_ROWS * turn >= widest), None)
    if turn is None or narrowest - FIXED < turn**2:
        return None
    table = WidthTable(number, rows, moving, Cycles(turn))
    ends = sorted(
        (pulse.rise, pulse.rise + (table.longest(channel) + FIXED if channel in moving else pulse.width))
        for channel, pulse in enumerate(rows[0].pulses)
        if pulse
    )
    starts = [*(rise for rise, _ in ends[1:]), schedule.period]
    return table if all(end <= start for (_, end), start in zip(ends, starts, strict=True)) else None
