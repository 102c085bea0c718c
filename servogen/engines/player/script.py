"""The script of a motion: steps from pose to pose as bytes, with repetitions stored once, and their timings.

In: `ScriptStep`s, each with the row of the pose at which it ends, and how to get there. Out: `Script`.

    how                 a step to the pose in the next row: its timing, the legs that it lifts
    AT, row, how        a step to another row
    SPOT, row, how      the first step on the spot: once all have stepped, the legs stand as in that row;
                        steps without a row follow it, and after them one with a row
    AGAIN, back, times  go back by a number of bytes, until that part has been played `times` times
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from servogen.engines.firmware import ResourceError
from servogen.engines.inputs.commands import Commander

AGAIN, SPOT, AT = 0xFF, 0xFD, 0xFC
"""Bytes that do not encode steps; bit 0 of `SPOT` and `AT` tells the chip whether a step is on the spot."""

MAX_TIMES = 255
MAX_BODY = 80
"""The maximum number of steps of a repeated part, of up to three bytes each."""

AGAIN_BYTES = 5
"""The cost of a repetition in bytes: three, and two for the first step of the repeated part."""

MAX_BYTES = 256
"""The maximum size of a table, which is read with an index of one byte."""

STRAIGHT, STAY, SILENT = 0xFF, 0xFE, 0xFC
"""Laws without a table: linear, in the final pose from the first frame on, without pulses."""

HALF = 0x80
"""The initial fraction of a step's time, so that times are rounded to the nearest."""


@dataclass(frozen=True, slots=True)
class StepTiming:
    """The timing of a step: `frames` (at most 256), 65536ths of the step per frame, 256ths at the first
    frame.

    `law` is where the law's table begins, or `STRAIGHT`, `STAY` or `SILENT`.
    """

    frames: int
    speed: int
    start: int = 0
    law: int = STRAIGHT

    def times(self) -> list[int]:
        """Return the time at each frame in 256ths, as the chip counts it."""
        return [(self.start << 8) + HALF + frame * self.speed >> 8 & 0xFF for frame in range(self.frames)]


def timing(frames: int, law: int = STRAIGHT) -> StepTiming:
    """Return the timing of a step of whole frames."""
    return StepTiming(frames, round(65536 / frames) & 0xFFFF, 0, law)


@dataclass(frozen=True, slots=True)
class ScriptStep:
    """A step to the pose `row` (an index of the table of rows) with a timing; `lifted` has a bit for each
    leg.

    `spot` tells whether it is one of the steps on the spot that end in `row`.
    """

    row: int
    timing: StepTiming
    lifted: int = 0
    spot: bool = False


@dataclass(frozen=True, slots=True)
class Script:
    """The steps as bytes; those from byte `loop` on repeat endlessly.

    `third` is the place of the byte after the third pose, the last one of a walk's soft start.
    """

    data: bytes
    loop: int
    timings: tuple[StepTiming, ...]
    third: int
    owners: tuple[int, ...]
    """The step to which each byte belongs, by its number."""


@dataclass(frozen=True, slots=True)
class RowEntry:
    """A row's number and the byte that states how to get there; `goes_on`: on the spot, after another
    step.
    """

    row: int
    how: int
    spot: bool = False
    goes_on: bool = False


LEGS_TIMINGS = 3
"""The highest timing of a walk, whose steps have a bit for each of six legs and two bits for the timing."""


def script(
    lead: Sequence[ScriptStep], loop: Sequence[ScriptStep], stride: int, *, legs: bool, limited: bool = True
) -> Script:
    """Return the script of steps that are played once, followed by steps that repeat endlessly; `stride` is
    the bytes from a row to the next.

    Raises ResourceError if it does not fit a table; unless `limited`, only its size is then right.
    """
    timings = tuple(dict.fromkeys(step.timing for step in (*lead, *loop)))
    maximum = LEGS_TIMINGS + 1 if legs else AT
    lifting = max((step.lifted for step in (*lead, *loop)), default=0)
    if limited and len(timings) > maximum:
        raise ResourceError(
            "does-not-fit", f"the motion has steps of {len(timings)} timings: the player holds {maximum}"
        )

    def entries(steps: Sequence[ScriptStep]) -> list[RowEntry]:
        numbers = [timings.index(step.timing) for step in steps]
        hows = [
            step.lifted << 2 | number if legs else number for step, number in zip(steps, numbers, strict=True)
        ]
        return _entries(steps, hows)

    assert not legs or lifting < ALL_LEGS
    first, owners = _bytes(entries(lead), stride)
    rest, later = _bytes(entries(loop), stride)
    data = first + rest
    if limited and len(data) > MAX_BYTES - 1:
        raise ResourceError(
            "does-not-fit", f"the motion's script has {len(data)} bytes: its table holds {MAX_BYTES - 1}"
        )
    owners += [len(lead) + owner for owner in later]
    return Script(data, len(first), timings, len(_bytes(entries(lead)[:3], stride)[0]), tuple(owners))


ALL_LEGS = 0x3F
"""No step lifts all six legs, so such a byte is `AGAIN` or `AT`."""


def _entries(steps: Sequence[ScriptStep], hows: Sequence[int]) -> list[RowEntry]:
    entries: list[RowEntry] = []
    for step, how in zip(steps, hows, strict=True):
        goes_on = bool(entries) and step.spot and entries[-1].spot and entries[-1].row == step.row
        entries.append(RowEntry(step.row, how, step.spot, goes_on))
    return entries


def _bytes(entries: Sequence[RowEntry], stride: int) -> tuple[bytes, list[int]]:
    """Return the entries as bytes, and the number of the entry to which each byte belongs.

    Consecutive repetitions are stored once, with their number.
    """
    data = bytearray()
    owners: list[int] = []
    number = 0
    last: int | None = None
    for body, times in folded(entries):
        begin = len(data)
        for index, entry in enumerate(body):
            again = times > 1 and index == 0 and not _follows(body[-1], entry)
            if entry.spot:
                data += b"" if entry.goes_on else bytes((SPOT, entry.row * stride & 0xFF))
            elif last is None or entry.row != last + 1 or again:
                data += bytes((AT, entry.row * stride & 0xFF))
            data.append(entry.how & 0xFF)
            owners += [number + index] * (len(data) - len(owners))
            last = None if entry.spot else entry.row
        if times > 1:
            data += bytes((AGAIN, len(data) + 3 - begin & 0xFF, times))
            owners += [number + len(body) - 1] * (len(data) - len(owners))
        number += len(body) * times
    return bytes(data), owners


def _follows(one: RowEntry, other: RowEntry) -> bool:
    """Return whether the step `other` needs no row after the step `one`."""
    return not one.spot and not other.spot and other.row == one.row + 1


def chained(lead: Sequence[ScriptStep], loop: Sequence[ScriptStep], rows: int) -> list[int]:
    """Return all row numbers in an order in which as many steps as possible lead to the next row."""
    hows = list(dict.fromkeys((step.timing, step.lifted) for step in (*lead, *loop)))
    wanted: Counter[tuple[int, int]] = Counter()
    for steps in (lead, loop):
        last: int | None = None
        for body, times in folded(
            _entries(steps, [hows.index((step.timing, step.lifted)) for step in steps])
        ):
            for index, entry in enumerate(body):
                between = last is not None and not entry.spot and entry.row != last
                if between and (times == 1 or index > 0):
                    assert last is not None
                    wanted[last, entry.row] += 1
                last = None if entry.spot else entry.row
    # Greedy: the most frequent pairs first, each unless a row would get two followers or a chain would close.
    after: dict[int, int] = {}
    for (one, other), _ in sorted(wanted.items(), key=lambda item: (-item[1], item[0])):
        end = other
        while end in after:
            end = after[end]
        if one not in after and other not in after.values() and end != one:
            after[one] = other
    order = []
    for row in range(rows):
        current = None if row in after.values() else row
        while current is not None:
            order.append(current)
            current = after.get(current)
    return order


def ordered(
    lead: Sequence[ScriptStep], loop: Sequence[ScriptStep], rows: Sequence[tuple[int, ...]], first: int = 0
) -> tuple[list[ScriptStep], list[ScriptStep], list[tuple[int, ...]]]:
    """Return steps and rows in the order of `chained`; `first` rows precede them in the table."""
    order = chained(lead, loop, len(rows))
    place = {row: first + index for index, row in enumerate(order)}
    renamed = [[replace(step, row=place[step.row]) for step in steps] for steps in (lead, loop)]
    return renamed[0], renamed[1], [rows[row] for row in order]


def folded(entries: Sequence[RowEntry]) -> list[tuple[list[RowEntry], int]]:
    """Return the entries as bodies with their numbers of repetitions, so that few bytes remain."""
    best = (0, 0, 0, 0)
    known: dict[RowEntry, int] = {}
    numbers = [known.setdefault(entry, len(known)) for entry in entries]  # cheaper to compare than entries
    begins = [not entry.goes_on for entry in entries]
    for length in range(1, min(len(entries) // 2, MAX_BODY) + 1):
        start = 0
        while start + 2 * length <= len(entries):
            if numbers[start] != numbers[start + length] or not begins[start]:
                start += 1
                continue
            times = 1
            body_numbers = numbers[start : start + length]
            while numbers[start + times * length : start + (times + 1) * length] == body_numbers:
                times += 1
            saved = (min(times, MAX_TIMES) - 1) * length - AGAIN_BYTES
            if saved > best[0]:
                best = (saved, start, length, min(times, MAX_TIMES))
            # Beginnings in between would only shift the same repetition.
            start += max(1, (times - 1) * length)
    saved, start, length, times = best
    if not saved:
        return [(list(entries), 1)] if entries else []
    # The repetition that saves most is taken first; what is before and after it is folded in the same way.
    body = list(entries[start : start + length])
    return [*folded(entries[:start]), (body, times), *folded(entries[start + length * times :])]


ENTRY = 2
"""The bytes of a pose in the script: the place of its row; its lifted legs and the timing of the step to
it.
"""


@dataclass(frozen=True, slots=True)
class DirectionPlaces:
    """The directions of a walk as places in the script, four for each: where its start, its cycle and its
    stop begin, and where it ends. The first four belong to standing, which has only a start.

    Of the directions the first, the third … are read backward, the others and standing forward.
    """

    read: Commander
    names: tuple[str, ...]
    places: tuple[int, ...]
    stance: int
    """The place at which the lead-in ends."""
    spot_timing: int
    """The number of the timing of steps on the spot."""
