"""The script of a motion: steps from pose to pose as bytes, what repeats of them once, and their timings.

In: `Step`s, each with the row of the pose that it ends at, and how it gets there. Out: `Script`.

    how                 a step to the pose in the row after the last one: its timing, the legs that it lifts
    AT, row, how        a step to another row
    AGAIN, back, times  so many bytes back, until what is there was played so often
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from servogen.engines.firmware import ResourceError

AGAIN, AT = 0xFF, 0xFE
MOST_TIMES = 255
MOST_BODY = 80
"""Steps that are played again, of three bytes each at most."""

AGAIN_BYTES = 5
"""What playing again costs: three bytes, and two of the body's first step."""

MOST_BYTES = 256
"""A table is read with an index of one byte."""

STRAIGHT, STAY, SILENT = 0xFF, 0xFE, 0xFC
"""Laws that need no table: evenly, at the end's pose from the first frame on, without pulses."""

HALF = 0x80
"""The fraction of a step's time at its beginning: times are rounded to the nearest."""


@dataclass(frozen=True, slots=True)
class Timing:
    """How a step takes its time: `frames` (256 at most), 65536ths of the step a frame, 256ths at its first.

    `law` is where the law's table begins, or `STRAIGHT`, `STAY` or `SILENT`.
    """

    frames: int
    speed: int
    start: int = 0
    law: int = STRAIGHT

    def times(self) -> list[int]:
        """Return the time at each frame in 256ths, as the chip counts it."""
        return [(self.start << 8) + HALF + frame * self.speed >> 8 & 0xFF for frame in range(self.frames)]


def timing(frames: int, law: int = STRAIGHT) -> Timing:
    """Return the timing of a step of whole frames."""
    return Timing(frames, round(65536 / frames) & 0xFFFF, 0, law)


@dataclass(frozen=True, slots=True)
class Step:
    """A step to the pose `row` (a number of the table of rows) by a timing; `lifted`: a bit for each leg."""

    row: int
    timing: Timing
    lifted: int = 0


@dataclass(frozen=True, slots=True)
class Script:
    """The steps as bytes; after the last one those from byte `loop` on follow, for all time.

    `third` is the place of the byte after the third pose, the last of a walk's soft start.
    """

    data: bytes
    loop: int
    timings: tuple[Timing, ...]
    third: int


Entry = tuple[int, int]
"""A row's number and the byte that says how to get there."""

LEGS_TIMINGS = 3
"""The last of the timings of a walk, whose steps hold a bit for each of six legs and two for the timing."""


def script(lead: Sequence[Step], loop: Sequence[Step], columns: int, *, legs: bool) -> Script:
    """Return the script of steps that are played once, and of those that are repeated for all time.

    Raises ResourceError where its bytes are more than a table holds.
    """
    timings = tuple(dict.fromkeys(step.timing for step in (*lead, *loop)))
    most = LEGS_TIMINGS + 1 if legs else AT
    lifting = max((step.lifted for step in (*lead, *loop)), default=0)
    if len(timings) > most:
        raise ResourceError(
            "does-not-fit", f"the motion has steps of {len(timings)} timings: the player holds {most}"
        )

    def entries(steps: Sequence[Step]) -> list[Entry]:
        found = []
        for step in steps:
            number = timings.index(step.timing)
            found.append((step.row, step.lifted << 2 | number if legs else number))
        return found

    assert not legs or lifting < ALL_LEGS
    first = _bytes(entries(lead), columns)
    data = first + _bytes(entries(loop), columns)
    if len(data) > MOST_BYTES - 1:
        raise ResourceError(
            "does-not-fit", f"the motion's script has {len(data)} bytes: its table holds {MOST_BYTES - 1}"
        )
    return Script(data, len(first), timings, len(_bytes(entries(lead)[:3], columns)))


ALL_LEGS = 0x3F
"""No step lifts all six legs: a byte that says so is `AGAIN` or `AT`."""


def _bytes(entries: Sequence[Entry], columns: int) -> bytes:
    """Return the entries as bytes; what follows itself again and again is there once, with how often."""
    made = bytearray()
    last: int | None = None
    for body, times in folded(entries):
        begin = len(made)
        for index, (row, how) in enumerate(body):
            # A body that is played again begins after its own last row then.
            if last is None or row != last + 1 or (times > 1 and index == 0):
                made += bytes((AT, row * columns))
            made.append(how)
            last = row
        if times > 1:
            made += bytes((AGAIN, len(made) + 3 - begin, times))
    return bytes(made)


def chained(lead: Sequence[Step], loop: Sequence[Step], rows: int) -> list[int]:
    """Return the numbers of all rows in an order in which as many steps as possible go to the next row."""
    hows = list(dict.fromkeys((step.timing, step.lifted) for step in (*lead, *loop)))
    wanted: Counter[tuple[int, int]] = Counter()
    for steps in (lead, loop):
        last: int | None = None
        for body, times in folded([(step.row, hows.index((step.timing, step.lifted))) for step in steps]):
            for index, (row, _) in enumerate(body):
                if last is not None and row != last and (times == 1 or index > 0):
                    wanted[last, row] += 1
                last = row
    after: dict[int, int] = {}
    for (one, other), _ in sorted(wanted.items(), key=lambda each: (-each[1], each[0])):
        end = other
        while end in after:
            end = after[end]
        if one not in after and other not in after.values() and end != one:
            after[one] = other
    order = []
    for row in range(rows):
        at = None if row in after.values() else row
        while at is not None:
            order.append(at)
            at = after.get(at)
    return order


def ordered(
    lead: Sequence[Step], loop: Sequence[Step], rows: Sequence[tuple[int, ...]], first: int = 0
) -> tuple[list[Step], list[Step], list[tuple[int, ...]]]:
    """Return steps and rows in the order of `chained`; `first` rows come before them in the table."""
    order = chained(lead, loop, len(rows))
    place = {row: first + index for index, row in enumerate(order)}
    renamed = [[replace(step, row=place[step.row]) for step in steps] for steps in (lead, loop)]
    return renamed[0], renamed[1], [rows[row] for row in order]


def folded(entries: Sequence[Entry]) -> list[tuple[list[Entry], int]]:
    """Return the entries as bodies, each with how often it is played, so that few bytes are left."""
    best = (0, 0, 0, 0)
    for length in range(1, min(len(entries) // 2, MOST_BODY) + 1):
        start = 0
        while start + 2 * length <= len(entries):
            times = 1
            one = entries[start : start + length]
            while entries[start + times * length : start + (times + 1) * length] == one:
                times += 1
            saved = (min(times, MOST_TIMES) - 1) * length - AGAIN_BYTES
            if saved > best[0]:
                best = (saved, start, length, min(times, MOST_TIMES))
            start += max(1, (times - 1) * length)
    saved, start, length, times = best
    if not saved:
        return [(list(entries), 1)] if entries else []
    body = list(entries[start : start + length])
    return [*folded(entries[:start]), (body, times), *folded(entries[start + length * times :])]
