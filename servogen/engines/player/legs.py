"""A walk as poses at the events of its gait: where feet lift, are highest, or land.

In: the widths of a walk, and which servos turn and lift each leg. Out: `Encoded`; None where the motion is
not a walk of this kind: a leg that lifts or lands while another one is between two of its own events.

    event       lift        middle        land       a pose: a byte for each leg's turn, a bit for "lifted"
    turn         ●╌╌╌╲_______●_______╱╌╌╌●           by the swing's law from the middle to both ends,
    lift         ●____╱╌╌╌╌╌╌●╌╌╌╌╌╌╲____●           and by the lift's; a leg that stands turns evenly

The middle of a swing of an odd number of frames lies between two frames: times are counted in half frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from servogen.engines.player.arithmetic import ENTRIES, Whole, blended, weights
from servogen.engines.player.encoding import Encoded, Legs, Rows, Scale, row_table, scale_of
from servogen.engines.player.laws import lift_table, swing_table
from servogen.engines.player.script import Step, Timing, ordered, script
from servogen.motion.gait.footwork import bump, swing_share
from servogen.motion.trajectory import Floats

MOST_LEGS = 6
STANDS = 1e-3
"""Cycles: a lift that is nearer to its stance is not lifted."""

RISES = 0.25
"""Steps by which a lift must move from the neutral pose to its stance to be worth a row of its own."""

LONGEST = 256
"""Frames of a step."""


@dataclass(frozen=True, slots=True)
class Swing:
    leg: int
    lift: int
    land: int

    @property
    def middle(self) -> int:
        """In half frames."""
        return self.lift + self.land


@dataclass(frozen=True, slots=True)
class WalkEvents:
    """`rows` of all frames, the loop twice; `events` in half frames."""

    rows: Floats
    soft: int
    turns: tuple[int, ...]
    lifts: tuple[int, ...]
    swings: tuple[Swing, ...]
    events: tuple[int, ...]

    def pose(self, event: int) -> Floats:
        """Return all widths at an event; between two frames, their mean."""
        return np.asarray((self.rows[event // 2] + self.rows[(event + 1) // 2]) / 2)

    def lifted(self, event: int) -> int:
        return sum(1 << each.leg for each in self.swings if each.middle == event)


def legs_encoded(
    rows: Floats, loop_start: int, soft: Sequence[int], pairs: Sequence[tuple[int, int]], near: float
) -> Encoded | None:
    """Return the walk `rows` (frames, channels) encoded by its events, None where that cannot be.

    `soft` are the frames at which the soft start's parts end, `pairs` the channels that turn and lift each
    leg, and poses within `near` steps of a row share it.
    """
    if len(pairs) > MOST_LEGS or 2 * len(pairs) != rows.shape[1] or np.isnan(rows[:loop_start]).any():
        return None
    released = bool(np.isnan(rows[loop_start:]).all())
    if released and loop_start:  # at its end the robot stands, and then has no pulses
        rows = rows.copy()
        rows[loop_start:] = rows[loop_start - 1]
    if np.isnan(rows).any():
        return None
    loop = len(rows) - loop_start
    twice = np.concatenate((rows, rows[loop_start:], rows[loop_start : loop_start + 1]))
    walk = walk_events(twice, soft, pairs, (loop_start, loop_start + loop))
    if walk is None:
        return None
    begins = [
        event
        for event in walk.events
        if event >= 2 * loop_start and event % 2 == 0 and event + 2 * loop in walk.events
    ]
    if soft and max(soft[0], soft[-1] - soft[0]) > LONGEST:
        return None
    if not begins:
        return None
    made = _encoded(walk, begins[0], begins[0] + 2 * loop, near)
    return replace(made, silent=np.arange(len(made.frames)) >= made.lead) if released else made


def walk_events(
    rows: Floats, soft: Sequence[int], pairs: Sequence[tuple[int, int]], ends: Sequence[int]
) -> WalkEvents | None:
    """Return the events of the walk `rows` (frames, channels); the frames `ends` are events too.

    `soft` are the frames at which the soft start's parts end, `pairs` the channels that turn and lift each
    leg. None: a leg lifts or lands while another one is between two of its own events.
    """
    turns, lifts = zip(*pairs, strict=True)
    first = soft[-1] if soft else 0
    stands = rows[first, list(lifts)]
    swings = []
    for leg, lift in enumerate(lifts):
        up = np.abs(rows[first:, lift] - stands[leg]) > STANDS
        if not up.any() or up[0]:
            return None
        edges = np.flatnonzero(np.diff(up)) + 1 + first
        swings += [
            Swing(leg, begin - 1, end)
            for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=False)
        ]
    events = {0, *(2 * frame for frame in soft)}
    for each in swings:
        events |= {2 * each.lift, each.middle, 2 * each.land}
    for end in ends:
        if not any(each.lift < end < each.land for each in swings):
            events.add(2 * end)
    last = max((2 * each.land for each in swings), default=0)
    found = sorted(event for event in events if event <= max(last, 2 * ends[-1]))
    for one, other in pairwise(list(found)):
        found += [*range(one + 2 * LONGEST, other, 2 * LONGEST)]
    found.sort()
    for each in swings:
        if [event for event in found if 2 * each.lift < event < 2 * each.land] != [each.middle]:
            return None
    return WalkEvents(rows, first, turns, lifts, tuple(swings), tuple(found))


@dataclass(frozen=True, slots=True, eq=False)
class KeyedWalk:
    """A walk as rows of poses and steps between them: one step to each of `events`, the first to begin at.

    The first `fixed` rows are those of the lifts; rows and steps are numbered alike.
    """

    scale: Scale
    rows: list[tuple[int, ...]]
    fixed: int
    steps: list[Step]
    events: list[int]
    legs: Legs
    laws: bytes


def keyed_walk(walk: WalkEvents, end: int, near: float) -> KeyedWalk:
    """Return the walk up to the event `end`; poses within `near` steps of a row share it."""
    turns, lifts = list(walk.turns), list(walk.lifts)
    tops = _tops(walk)
    scale = scale_of(np.vstack((walk.rows, _at(walk.rows[walk.soft], lifts, tops))))
    kept = Rows(near)
    events = [event for event in walk.events if event <= end]
    numbers = [kept.number(scale.exact(walk.pose(event))[turns]) for event in events]
    stand = scale.exact(walk.rows[walk.soft])[lifts]
    neutral = scale.exact(walk.rows[0])[lifts]
    lift_rows = [stand, scale.exact(_at(walk.rows[0], lifts, tops))[lifts]]
    rises = bool(np.abs(neutral - stand).max() > RISES)
    lift_rows += [neutral] if rises else []
    fixed = [tuple(np.clip(np.floor(row + 0.5), 0, 255).astype(int).tolist()) for row in lift_rows]
    columns, count = len(turns), len(fixed)
    steps = [Step(count + numbers[0], _timing(*events[:2]), walk.lifted(0))]
    steps += [
        Step(count + number, _timing(*ends), walk.lifted(ends[1]))
        for number, ends in zip(numbers[1:], pairwise(events), strict=True)
    ]
    legs = Legs(walk.turns, walk.lifts, 0, columns, 2 * columns if rises else None)
    laws = swing_table(_rate(walk)) + lift_table()
    return KeyedWalk(scale, [*fixed, *kept.kept], count, steps, events, legs, laws)


def _encoded(walk: WalkEvents, begin: int, end: int, near: float) -> Encoded:
    """Return the walk up to the event `end`, of which what follows `begin` is the loop."""
    keyed = keyed_walk(walk, end, near)
    first = keyed.events.index(begin) + 1
    steps = [replace(step, row=step.row - keyed.fixed) for step in keyed.steps]
    lead, loop, kept_rows = ordered(steps[:first], steps[first:], keyed.rows[keyed.fixed :], keyed.fixed)
    rows = row_table([*keyed.rows[: keyed.fixed], *kept_rows])
    made = script(lead, loop, len(walk.turns), legs=True)
    widths = keyed.scale.widths(played_steps([*lead, *loop], rows, keyed.laws, keyed.legs))
    frames = np.arange(end // 2)
    silent = np.zeros(len(frames), dtype=bool)
    return Encoded(keyed.scale, rows, keyed.laws, made, keyed.legs, frames, widths, silent, begin // 2)


def _at(row: Floats, channels: Sequence[int], values: Floats) -> Floats:
    changed = row.copy()
    changed[list(channels)] = values
    return changed


def _tops(walk: WalkEvents) -> Floats:
    """Return the lifts' widths at which the lift's table, which ends at 255, has them highest."""
    tops = walk.rows[walk.soft, list(walk.lifts)].copy()
    for each in walk.swings:
        column = walk.lifts[each.leg]
        frame = each.middle // 2
        share = bump(np.array((frame - each.lift) / (each.land - each.lift))).item()
        stands = walk.rows[walk.soft, column]
        tops[each.leg] = stands + (walk.rows[frame, column] - stands) / share * 256 / 255
    return tops


def _rate(walk: WalkEvents) -> float:
    """Return the rate of the swings' law that is nearest to all swings, in least squares."""
    above = below = 0.0
    for each in walk.swings:
        column = walk.rows[each.lift : each.land + 1, walk.turns[each.leg]]
        u = np.arange(len(column)) / (len(column) - 1)
        way = column[-1] - column[0]
        plain = swing_share(u, 0.0)
        effect = way * (swing_share(u, 1.0) - plain)
        above += float((column - column[0] - way * plain) @ effect)
        below += float(effect @ effect)
    return max(0.0, above / below) if below else 0.0


def _timing(one: int, other: int) -> Timing:
    """Return the timing of the frames from one event up to another, in half frames."""
    first, length = (one + 1) // 2, (other - one) / 2
    frames = (other + 1) // 2 - first
    return Timing(frames, round(65536 / length) & 0xFFFF, round(256 * (first - one / 2) / length))


def played_steps(steps: Sequence[Step], rows: bytes, laws: bytes, legs: Legs, soft: bool = True) -> Whole:
    """Return 256 times the values of all channels, frame by frame: what the chip does in these steps.

    The first step only says where the second begins. `soft`: the first two lead to the stance.
    """
    columns = len(legs.turns)
    table = np.frombuffer(rows, dtype=np.uint8).reshape(-1, columns).astype(np.int64)
    swing, lift = laws[:ENTRIES], laws[ENTRIES:]
    stand, lifted = table[legs.stand // columns], table[legs.lifted // columns]
    found = []
    for index, (before, step) in enumerate(pairwise(steps)):
        time = np.array(step.timing.times(), dtype=np.int64)
        one, other = table[before.row], table[step.row]
        parts = np.empty((len(time), 2 * columns), dtype=np.int64)
        for leg in range(columns):
            bit = 1 << leg
            up, down = bool(step.lifted & bit), bool(before.lifted & bit)
            phase = time if up else 255 - time
            turn, raised = legs.turns[leg], legs.lifts[leg]
            if up or down:
                ends = (other[leg], one[leg]) if up else (one[leg], other[leg])
                parts[:, turn] = blended(*ends, weights(list(swing), phase), twice=True)
                weight = weights(list(lift), phase)
            else:
                parts[:, turn] = blended(one[leg], other[leg], time)
                weight = np.zeros_like(time)
            start, end = stand[leg], lifted[leg]
            if soft and legs.neutral is not None and index < 2:
                start, end = table[legs.neutral // columns][leg], stand[leg]
                weight = time if index else np.zeros_like(time)
            parts[:, raised] = blended(start, end, weight)
        found.append(parts)
    return np.concatenate(found)
