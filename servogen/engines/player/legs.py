"""A walk as poses at the events of its gait: where feet lift, are highest, or land.

In: the widths of a walk, and the servos that turn and lift each leg. Out: `Encoded`; None if the motion is
not a walk of this kind, because a leg lifts or lands while another one is between two of its own events.

    event       lift        middle        land       a pose: a byte for each leg's turn, a bit for "lifted"
    turn         ●╌╌╌╲_______●_______╱╌╌╌●           by the swing's law from the middle to both ends,
    lift         ●____╱╌╌╌╌╌╌●╌╌╌╌╌╌╲____●           and by the lift's; a leg that stands turns evenly

    on the spot  ●______╲____○______╲___●           by a law of its own from one standing pose to another,
                                                    without a row between the two

A body that leans has the legs that stand turn by a smooth law: the lean is divided into steps, too.

The middle of a swing of an odd number of frames lies between two frames: times are counted in half frames.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from servogen.engines.firmware import ResourceError
from servogen.engines.player.arithmetic import ENTRIES, Whole, blended, weights
from servogen.engines.player.encoding import Encoded, Legs, Rows, WidthScale, row_table, scale_of, shift_of
from servogen.engines.player.knees import STEPS, Knees
from servogen.engines.player.laws import lift_table, spot_table, swing_table
from servogen.engines.player.script import ScriptStep, StepTiming, ordered, script
from servogen.motion.gait.footwork import bump, swing_share
from servogen.motion.trajectory import Floats

MAX_LEGS = 6
STANDS = 1e-3
"""A lift closer than this (cycles) to its stance is not lifted."""

RISES = 0.25
"""The minimum distance, in steps, of a lift's neutral pose from its stance to be worth a row of its own."""

LONGEST = 256
"""The maximum number of frames of a step."""

EVEN, MOST_PARTS = 6.0, 6
"""How far (cycles) a standing leg's turn may be from even in a step; the steps of a lean at most."""

RESTS = 1e-6
"""The change of a pulse (cycles) per frame below which a servo is at rest."""


@dataclass(frozen=True, slots=True)
class Swing:
    leg: int
    lift: int
    land: int

    @property
    def middle(self) -> int:
        """Return the middle of the swing in half frames."""
        return self.lift + self.land


@dataclass(frozen=True, slots=True)
class _Spot:
    """Steps on the spot, each leg at most once; both ends are events, in half frames."""

    begin: int
    end: int


@dataclass(frozen=True, eq=False)
class WalkEvents:
    """`rows` of all frames, the loop twice; `events` in half frames."""

    rows: Floats
    soft: int
    turns: tuple[int, ...]
    lifts: tuple[int, ...]
    swings: tuple[Swing, ...]
    events: tuple[int, ...]
    spots: tuple[_Spot, ...]

    def spot(self, begin: int, end: int) -> _Spot | None:
        """Return the steps on the spot to which the frames between two events belong; None if to none."""
        return next((spot for spot in self.spots if spot.begin <= begin and end <= spot.end), None)

    def pose(self, event: int) -> Floats:
        """Return all widths at an event; between two frames, the mean of both."""
        return np.asarray((self.rows[event // 2] + self.rows[(event + 1) // 2]) / 2)

    def lifted(self, event: int) -> int:
        """Return the legs whose swing has its middle at an event, as a bit set."""
        return self._lifted.get(event, 0)

    # The two that every encoding of the walk needs, however close: long walks have thousands of swings.

    @cached_property
    def _lifted(self) -> Mapping[int, int]:
        legs: Counter[int] = Counter()
        for swing in self.swings:
            legs[swing.middle] += 1 << swing.leg
        return legs

    @cached_property
    def laws(self) -> bytes:
        """Return the tables of the laws by which the legs turn and lift."""
        return swing_table(*_swing_law(self)) + lift_table() + (spot_table() if self.spots else b"")


def legs_encoder(
    rows: Floats,
    loop_start: int,
    soft: Sequence[int],
    pairs: Sequence[tuple[int, int]],
    *,
    knees: Knees | None = None,
    limited: bool = True,
) -> Callable[[float], Encoded] | None:
    """Return a function that encodes the walk `rows` (frames, channels) by its events; None if that is
    impossible.

    `soft` are the frames at which the parts of the soft start end, `pairs` the channels that turn and lift
    each leg. With `knees`, those of bent calibrations, it is as close as it can be. The function takes
    `near`: poses within so many steps of a row share it. It raises ResourceError if the walk is `limited` and
    does not fit the tables.
    """
    if len(pairs) > MAX_LEGS or 2 * len(pairs) != rows.shape[1] or np.isnan(rows[:loop_start]).any():
        return None
    released = bool(np.isnan(rows[loop_start:]).all())
    if released and loop_start:  # the robot stands at the end and then has no pulses
        rows = rows.copy()
        rows[loop_start:] = rows[loop_start - 1]
    if np.isnan(rows).any():
        return None
    if knees is not None:
        rows = knees.straightened(rows)
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
    ends = begins[0], begins[0] + 2 * loop

    def encoded(near: float) -> Encoded:
        made = _encoded(walk, *ends, near, knees, limited=limited)
        return replace(made, silent=np.arange(len(made.frames)) >= made.lead) if released else made

    return encoded


def walk_events(
    rows: Floats, soft: Sequence[int], pairs: Sequence[tuple[int, int]], ends: Sequence[int]
) -> WalkEvents | None:
    """Return the events of the walk `rows` (frames, channels); the frames `ends` are events too.

    `soft` are the frames at which the parts of the soft start end, `pairs` the channels that turn and lift
    each leg. The result is None if a leg lifts or lands while another is between two of its own events.
    """
    turns, lifts = zip(*pairs, strict=True)
    first = soft[-1] if soft else 0
    stands = rows[first, list(lifts)]
    swings = []
    for leg, lift in enumerate(lifts):
        up = np.abs(rows[first:, lift] - stands[leg]) > STANDS
        # A leg that never lifts, or is in the air already, has no whole swing.
        if not up.any() or up[0]:
            return None
        edges = np.flatnonzero(np.diff(up)) + 1 + first
        swings += [
            Swing(leg, begin - 1, end)
            for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=False)
        ]
    events = {0, *(2 * frame for frame in soft)}
    for swing in swings:
        events |= {2 * swing.lift, swing.middle, 2 * swing.land}
    for end in ends:
        if not any(swing.lift < end < swing.land for swing in swings):
            events.add(2 * end)
    last = max((2 * swing.land for swing in swings), default=0)
    times = sorted(event for event in events if event <= max(last, 2 * ends[-1]))
    for one, other in pairwise(list(times)):
        if not any(2 * swing.lift < other and one < 2 * swing.land for swing in swings):
            times += _uneven(rows[:, list(turns)], -(-one // 2), other // 2)
    times.sort()
    # A step has at most LONGEST frames: what lasts longer is divided.
    for one, other in pairwise(list(times)):
        times += [*range(one + 2 * LONGEST, other, 2 * LONGEST)]
    times.sort()
    for swing in swings:
        if [event for event in times if 2 * swing.lift < event < 2 * swing.land] != [swing.middle]:
            return None
    return WalkEvents(
        rows, first, turns, lifts, tuple(swings), tuple(times), tuple(_spots(rows, turns, swings))
    )


def _uneven(turns: Floats, first: int, last: int) -> list[int]:
    """Return events that divide the time between two frames into equal steps in which legs that stand turn
    nearly evenly; a body that leans has them turn by a smooth law. None where no such number of steps exists.
    """
    frames = last - first
    for parts in (each for each in range(1, MOST_PARTS + 1) if not frames % each):
        places = np.linspace(first, last, parts + 1).astype(int)
        away = [
            np.abs(turns[one : other + 1] - np.linspace(turns[one], turns[other], other - one + 1)).max()
            for one, other in pairwise(places.tolist())
        ]
        if max(away) <= EVEN:
            return [2 * place for place in places[1:-1].tolist()]
    return []


def _spots(rows: Floats, turns: Sequence[int], swings: Sequence[Swing]) -> Iterator[_Spot]:
    """Yield the groups of swings during which no leg on the ground turns, as large as one row can end."""
    moves = np.abs(np.diff(rows[:, list(turns)], axis=0)) > RESTS
    for member in swings:
        moves[member.lift : member.land, member.leg] = False
    walked = np.concatenate(([0], np.cumsum(moves.any(axis=1))))
    group: list[Swing] = []
    for member in sorted(swings, key=lambda swing: (swing.lift, swing.leg)):
        if group and (
            walked[group[0].lift] != walked[member.land] or any(member.leg == other.leg for other in group)
        ):
            yield from _spot(group, swings)
            group = []
        if walked[member.lift] == walked[member.land]:
            group.append(member)
    yield from _spot(group, swings)


def _spot(group: Sequence[Swing], swings: Sequence[Swing]) -> Iterator[_Spot]:
    """Yield the steps on the spot of a group, unless another swing overlaps them."""
    if not group:
        return
    first, last = group[0].lift, max(swing.land for swing in group)
    if not any(swing.lift < last and swing.land > first and swing not in group for swing in swings):
        yield _Spot(2 * first, 2 * last)


@dataclass(frozen=True, slots=True, eq=False)
class KeyedWalk:
    """A walk as rows of poses and steps between them: one step to each of `events`, the first being the
    start.

    The first `fixed` rows are those of the lifts; rows and steps have the same numbers.
    """

    scale: WidthScale
    rows: list[tuple[int, ...]]
    fixed: int
    steps: list[ScriptStep]
    events: list[int]
    legs: Legs
    laws: bytes


def keyed_walk(walk: WalkEvents, end: int, near: float, phases: Whole | None = None) -> KeyedWalk:
    """Return the walk up to the event `end`; poses within `near` steps of a row share it.

    Steps on the spot have the row in which all of them end. The bases of the turns are lower by the cycles
    `phases`, on which it depends how their bytes are rounded.
    """
    turns, lifts = list(walk.turns), list(walk.lifts)
    tops = _tops(walk)
    scale = _scale(walk, tops)
    if phases is not None:
        scale = scale.moved(turns, -phases)
    pose_rows = Rows(near)
    events = [event for event in walk.events if event <= end]
    stand = scale.exact(walk.rows[walk.soft])[lifts]
    neutral = scale.exact(walk.rows[0])[lifts]
    lift_rows = [stand, scale.exact(_at(walk.rows[0], lifts, tops))[lifts]]
    rises = bool(np.abs(neutral - stand).max() > RISES)
    lift_rows += [neutral] if rises else []
    fixed = [tuple(np.clip(np.floor(row + 0.5), 0, 255).astype(int).tolist()) for row in lift_rows]
    columns, count = len(turns), len(fixed)

    def number(event: int) -> int:
        return count + pose_rows.number(scale.exact(walk.pose(event))[turns])

    steps = [ScriptStep(number(0), _timing(*events[:2]), walk.lifted(0))]
    for ends in pairwise(events):
        spot = walk.spot(*ends)
        row = number(spot.end if spot else ends[1])
        steps.append(ScriptStep(row, _timing(*ends), walk.lifted(ends[1]), spot is not None))
    legs = Legs(walk.turns, walk.lifts, 0, columns, 2 * columns if rises else None)
    return KeyedWalk(scale, [*fixed, *pose_rows.kept], count, steps, events, legs, walk.laws)


def _encoded(
    walk: WalkEvents,
    begin: int,
    end: int,
    near: float,
    knees: Knees | None,
    *,
    limited: bool,
) -> Encoded:
    """Return the walk up to the event `end`; its loop begins at the event `begin`."""
    keyed = keyed_walk(walk, end, near)
    row_table(keyed.rows, limited=limited)  # the first to be full: a walk that is too long ends here
    if knees is not None:
        step = 1 << int(keyed.scale.shifts.min())
        if knees.bends.any() and step not in STEPS:
            raise ResourceError("does-not-fit", "the servos' widths are too far apart for knees")
        keyed = keyed_walk(walk, end, near, _phases(walk, end, near, step))
    first = keyed.events.index(begin) + 1
    steps = [replace(step, row=step.row - keyed.fixed) for step in keyed.steps]
    lead, loop, kept_rows = ordered(steps[:first], steps[first:], keyed.rows[keyed.fixed :], keyed.fixed)
    rows = row_table([*keyed.rows[: keyed.fixed], *kept_rows], limited=limited)
    encoded_script = script(lead, loop, len(walk.turns), legs=True, limited=limited)
    values = played_steps([*lead, *loop], rows, keyed.laws, keyed.legs)
    frames = np.arange(end // 2)
    turns = list(walk.turns)
    away = (keyed.scale.widths(values) - walk.rows[frames])[:, turns]
    # Make the largest distances above and below the plan equal, to within a cycle at each end.
    middle = np.trunc((away.max(axis=0) + away.min(axis=0)) / 2).astype(np.int64)
    scale = keyed.scale.moved(turns, -middle)
    if knees is not None:
        scale = scale.with_knees(knees)
    silent = np.zeros(len(frames), dtype=bool)
    return Encoded(
        scale,
        rows,
        keyed.laws,
        encoded_script,
        keyed.legs,
        frames,
        scale.widths(values),
        silent,
        begin // 2,
        (*lead, *loop),
    )


def _phases(walk: WalkEvents, end: int, near: float, step: int) -> Whole:
    """Return by how many cycles the base of each turn is best lowered, for its bytes to be rounded best."""
    turns = list(walk.turns)
    spreads = []
    for phase in range(step):
        keyed = keyed_walk(walk, end, near, phases=np.full(len(turns), phase))
        values = played_steps(keyed.steps, row_table(keyed.rows, limited=False), keyed.laws, keyed.legs)
        spreads.append(np.ptp((keyed.scale.widths(values) - walk.rows[: end // 2])[:, turns], axis=0))
    return np.asarray(np.argmin(spreads, axis=0))


def _scale(walk: WalkEvents, tops: Floats) -> WidthScale:
    """Return the scale of all rows, in which the steps of the lifts are at least those of the turns.

    The lifts' stances are whole numbers of steps from their bases.
    """
    turns, lifts = list(walk.turns), list(walk.lifts)
    pulsed = np.vstack((walk.rows, _at(walk.rows[walk.soft], lifts, tops)))
    shifts = np.empty(pulsed.shape[1], dtype=np.int64)
    shifts[turns] = shift_of(pulsed[:, turns])
    shifts[lifts] = max(shift_of(pulsed[:, lifts]), int(shifts[turns[0]]))
    scale = scale_of(pulsed, shifts)
    stand = walk.rows[walk.soft, lifts]
    steps = np.floor(scale.exact(walk.rows[walk.soft])[lifts]).astype(np.int64) << shifts[lifts]
    return scale.moved(lifts, np.floor(stand + 0.5).astype(np.int64) - steps - scale.bases[lifts])


def _at(row: Floats, channels: Sequence[int], values: Floats) -> Floats:
    changed = row.copy()
    changed[list(channels)] = values
    return changed


def _tops(walk: WalkEvents) -> Floats:
    """Return the widths for which the lifts are highest at the end of the lift's table, which is 255."""
    tops = walk.rows[walk.soft, list(walk.lifts)].copy()
    for swing in walk.swings:
        column = walk.lifts[swing.leg]
        frame = swing.middle // 2
        share = bump(np.array((frame - swing.lift) / (swing.land - swing.lift))).item()
        stands = walk.rows[walk.soft, column]
        tops[swing.leg] = stands + (walk.rows[frame, column] - stands) / share * 256 / 255
    return tops


def _swing_law(walk: WalkEvents) -> tuple[float, float]:
    """Return `rate` and `beyond` of the law that fits all walking swings best, by least squares."""
    squares, products = np.zeros((2, 2)), np.zeros(2)
    for swing in walk.swings:
        if walk.spot(2 * swing.lift, 2 * swing.land):
            continue
        turn = walk.turns[swing.leg]
        column = walk.rows[swing.lift : swing.land + 1, turn]
        u = np.arange(len(column)) / (len(column) - 1)
        middle = walk.pose(swing.middle)[turn]
        # If the body starts or stops during a swing, one half of the swing has no length.
        path = np.where(u < 0.5, middle - column[0], column[-1] - middle)
        plain, faster, farther = (2 * swing_share(u, *law) - 1 for law in ((0.0,), (1.0,), (0.0, 1.0)))
        # The law is linear in `rate` and `beyond`, so what each adds to the plain one is a column of the fit.
        effects = path * np.stack([faster - plain, farther - plain])
        squares += effects @ effects.T
        products += effects @ (column - middle - path * plain)
    rate, beyond = np.linalg.lstsq(squares, products, rcond=None)[0].tolist()
    return max(0.0, rate), max(0.0, beyond)


def _timing(one: int, other: int) -> StepTiming:
    """Return the timing of the frames from one event up to another, in half frames."""
    first, length = (one + 1) // 2, (other - one) / 2
    frames = (other + 1) // 2 - first
    return StepTiming(frames, round(65536 / length) & 0xFFFF, round(256 * (first - one / 2) / length))


def played_steps(
    steps: Sequence[ScriptStep], rows: bytes, laws: bytes, legs: Legs, soft: bool = True
) -> Whole:
    """Return 256 times the values of all channels, frame by frame, as the chip computes them in these steps.

    The first step only states where the second begins. With `soft`, the first two lead to the stance.
    """
    table = np.frombuffer(rows, dtype=np.uint8).reshape(-1, len(legs.turns)).astype(np.int64)
    known: dict[tuple[int, int, int, int, ScriptStep], Whole] = {}  # most steps are those of a cycle, again
    values = []
    here, landed = steps[0].row, 0
    for index, (before, step) in enumerate(pairwise(steps)):
        if not (before.spot and step.spot and step.row == before.row):
            here, landed = before.row, 0
        if step.spot:
            landed ^= before.lifted
        part = index if soft and legs.neutral is not None and index < 2 else 2
        key = here, before.lifted, landed, part, step
        if key not in known:
            known[key] = _played_step(table, laws, legs, *key)
        values.append(known[key])
    return np.concatenate(values)


def _played_step(
    table: Whole, laws: bytes, legs: Legs, here: int, before: int, landed: int, part: int, step: ScriptStep
) -> Whole:
    """Return the values of one step from the row `here`; `before` are the legs that are lifted when it
    begins, `landed` those that have landed on the spot. Parts 0 and 1 are those of the soft start.
    """
    columns = len(legs.turns)
    swing, lift, on_spot = laws[:ENTRIES], laws[ENTRIES : 2 * ENTRIES], laws[2 * ENTRIES :]
    time = np.array(step.timing.times(), dtype=np.int64)
    one, other = table[here], table[step.row]
    law = on_spot if step.spot else swing
    values = np.empty((len(time), 2 * columns), dtype=np.int64)
    for leg in range(columns):
        bit = 1 << leg
        up, down = bool(step.lifted & bit), bool(before & bit)
        phase = time if up else 255 - time
        turn, raised = legs.turns[leg], legs.lifts[leg]
        back = landed & bit if step.spot else up
        ends = (other[leg], one[leg]) if back else (one[leg], other[leg])
        if up or down:
            values[:, turn] = blended(*ends, weights(list(law), phase), twice=not step.spot)
            weight = weights(list(lift), phase)
        else:
            values[:, turn] = blended(*ends, np.zeros_like(time) if step.spot else time)
            weight = np.zeros_like(time)
        start, end = table[legs.stand // columns][leg], table[legs.lifted // columns][leg]
        if part < 2:
            assert legs.neutral is not None
            start, end = table[legs.neutral // columns][leg], table[legs.stand // columns][leg]
            weight = time if part else np.zeros_like(time)
        values[:, raised] = blended(start, end, weight)
    return values
