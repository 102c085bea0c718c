"""A walk on command as the player plays it: its directions as one chain of poses, read forward and backward.

In: the stance and the directions of a walk, its servos, and the frame. Out: `Playing`, whose schedule is that
of a robot that stands while the line is at rest, with the frames of every direction; and a schedule of all
these frames.

      lead-in    forward ──▶                    left ──▶
    ●────●────●─●───────●──────────●──────●───────●──────────●──────●
              │ │ start │  cycle   │ stop │ start │  cycle   │ stop │
           stance                 ◀── back                ◀── right
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from servogen.engines.firmware import ResourceError
from servogen.engines.inputs.commands import Commander
from servogen.engines.player.encoding import Encoded, row_table
from servogen.engines.player.layout import Used, layout
from servogen.engines.player.legs import LONGEST, MAX_LEGS, KeyedWalk, keyed_walk, played_steps, walk_events
from servogen.engines.player.playing import (
    NEAR,
    Playing,
    ideal_widths,
    leg_channels,
    plan_error_of,
    rows_of,
    warnings_of,
)
from servogen.engines.player.script import ENTRY, LEGS_TIMINGS, MAX_BYTES, DirectionPlaces, Script, ScriptStep
from servogen.errors import InputError
from servogen.motion.gait.commands import CommandedDirection
from servogen.motion.trajectory import JointTrajectory
from servogen.pulse.plan import PulsePlan, joined_runs
from servogen.pulse.schedule import Channel, CommandRule, DirectionRuns, PulseSchedule, Run
from servogen.pulse.slots import Frame
from servogen.robot.binding import Binding
from servogen.robot.servo import Servo
from servogen.units import Cycles


@dataclass(frozen=True, slots=True)
class _Cuts:
    """The frames at which a direction that is read forward begins, its cycle begins and ends, and it ends."""

    first: int
    begin: int
    end: int
    last: int

    @property
    def forward(self) -> tuple[int, int, int, int]:
        return self.first, self.begin, self.end, self.last

    @property
    def backward(self) -> tuple[int, int, int, int]:
        return self.last, self.end, self.begin, self.first


def commanded(
    lead_in: JointTrajectory,
    directions: Sequence[CommandedDirection],
    read: Commander,
    servos: Sequence[Servo],
    bindings: Sequence[Binding],
    frame: Frame,
    soft: Sequence[int],
    max_bytes: int,
) -> tuple[Playing, PulseSchedule]:
    """Return how the player plays a walk on command, and a schedule of all frames that it can play.

    `lead_in` ends with one frame of the stance; `soft` are the frames at which parts of it end. The playing's
    trajectory is that of the second schedule: the lead-in, the stance, and one direction after the other.
    Raises InputError.
    """
    clock = lead_in.clock
    stance = len(lead_in.angles) - 1
    whole = np.vstack((lead_in.angles, *(direction.angles[:-1] for direction in directions)))
    tour = replace(lead_in, angles=whole, loop_start=stance)
    ideal = ideal_widths(tour, servos, clock)
    encoded, chain = encoded_directions(lead_in, directions, read, servos, bindings, soft, max_bytes)
    widths = encoded.widths
    used = [Used(Cycles(int(channel.min())), Cycles(int(channel.max()))) for channel in widths.T]
    slots = layout(servos, used, frame, clock, encoded.scale.doublings, legs=True)
    rises = [slots.rise(channel) for channel in range(len(servos))]

    def runs(first: int, end: int) -> tuple[Run, ...]:
        return joined_runs(widths[first:end], rises)

    published = []
    begins_at = stance + 1
    for direction in directions:
        first, begin, end, last = (
            begins_at + row for row in (0, direction.first, direction.end, len(direction.angles) - 1)
        )
        parts = runs(first, begin), runs(begin, end), runs(end, last)
        if read.has(direction.name):
            published.append(DirectionRuns(direction.name, read.selector(direction.name), *parts))
        begins_at = last
    schedule = PulseSchedule(
        clock,
        slots.period,
        tuple(Channel(servo.name, servo.pin, servo.model.name) for servo in servos),
        runs(0, stance),
        runs(stance, stance + 1),
        inputs=read.inputs,
        plan_error=plan_error_of(tour, servos, widths, ideal, clock),
        commands=CommandRule(read.rule, tuple(published)),
    )
    played = replace(schedule, loop=runs(stance, len(widths)), inputs=(), commands=None)
    warnings = warnings_of(tour, servos, frame, slots)
    plan = PulsePlan(schedule, tuple(rows_of(servos, widths, ideal, clock)), warnings)
    return Playing(tour, plan, slots, encoded, chain), played


def encoded_directions(
    lead_in: JointTrajectory,
    directions: Sequence[CommandedDirection],
    read: Commander,
    servos: Sequence[Servo],
    bindings: Sequence[Binding],
    soft: Sequence[int],
    max_bytes: int,
    *,
    limited: bool = True,
) -> tuple[Encoded, DirectionPlaces]:
    """Return the first encoding that has at most `max_bytes`, or the smallest one.

    Raises InputError, also if the tables are `limited` and cannot hold it.
    """
    pairs = leg_channels(servos, bindings)
    ahead = directions[::2]
    """The directions that are read forward."""
    angles = [lead_in.angles, ahead[0].angles, *(direction.angles[1:] for direction in ahead[1:])]
    # The last frame occurs twice, because events need a frame after them.
    chained = replace(lead_in, angles=np.vstack((*angles, angles[-1][-1:])))
    rows = ideal_widths(chained, servos, lead_in.clock)
    cuts, frame = [], len(lead_in.angles)
    for direction in ahead:
        cuts.append(
            _Cuts(frame, frame + direction.first, frame + direction.end, frame + len(direction.angles) - 1)
        )
        frame = cuts[-1].last
    walk = None
    if 2 * len(pairs) == rows.shape[1] and len(pairs) <= MAX_LEGS:
        walk = walk_events(rows, soft, pairs, [mark for cut in cuts for mark in cut.forward])
    wanted = [2 * mark for cut in cuts for mark in cut.forward]
    if walk is None or any(event % 2 for event in walk.events) or not {*wanted} <= {*walk.events}:
        raise InputError(
            "engine-unsupported",
            "the player walks on command only if legs that are in the air together lift and land together, "
            f"within {2 * LONGEST} frames",
            hint='write gait = "tripod", or a shorter cycle_s',
        )
    smallest: tuple[Encoded, DirectionPlaces] | None = None
    for near in NEAR:
        candidate = _with_rows(
            keyed_walk(walk, wanted[-1], near),
            directions,
            cuts,
            read,
            len(lead_in.angles) - 1,
            soft,
            limited=limited,
        )
        if smallest is None or candidate[0].size < smallest[0].size:
            smallest = candidate
        if candidate[0].size <= max_bytes:
            return candidate
    assert smallest is not None
    return smallest


def _with_rows(
    keyed: KeyedWalk,
    directions: Sequence[CommandedDirection],
    cuts: Sequence[_Cuts],
    read: Commander,
    stance: int,
    soft: Sequence[int],
    *,
    limited: bool,
) -> tuple[Encoded, DirectionPlaces]:
    """Return the encoding with the rows of `keyed`.

    Raises ResourceError if it is `limited` and does not fit the tables.
    """
    steps = list(keyed.steps)
    entry = {event // 2: number for number, event in enumerate(keyed.events)}
    # A pose that the chip reaches from two sides is stored once.
    for one, other in [(cut.begin, cut.end) for cut in cuts] + [
        (stance, mark) for cut in cuts for mark in (cut.first, cut.last)
    ]:
        steps[entry[other]] = replace(steps[entry[other]], row=steps[entry[one]].row)
        assert steps[entry[other]].lifted == steps[entry[one]].lifted
    columns = len(keyed.legs.turns)
    rows = row_table(keyed.rows, limited=limited)
    kinds = list(dict.fromkeys((step.timing, step.spot) for step in steps))
    timings = tuple(timing for timing, _ in kinds)
    data = b"".join(
        bytes((step.row * columns & 0xFF, step.lifted << 2 & 0xFF | kinds.index((step.timing, step.spot))))
        for step in steps
    )
    spots = [number for number, (_, spot) in enumerate(kinds) if spot]
    if limited and (len(timings) > LEGS_TIMINGS + 1 or len(data) > MAX_BYTES or len(spots) > 1):
        raise ResourceError(
            "does-not-fit",
            f"the walk on command has {len(data)} bytes of steps with {len(timings)} timings: the player "
            f"holds {MAX_BYTES} and {LEGS_TIMINGS + 1}",
        )
    places = [entry[stance], entry[stance + 1], 0, 0]
    sequences = [steps[: entry[stance] + 1]] if entry[stance] else []
    sequences.append(_read(steps, *places[:2]))
    places_of: list[list[int]] = []
    for cut in cuts:
        for marks in (cut.forward, cut.backward):
            joined = [entry[mark] for mark in marks]
            places_of.append(joined)
            sequences += [_read(steps, *pair) for pair in pairwise(joined)]
    values = [
        played_steps(part, rows, keyed.laws, keyed.legs, soft=bool(soft) and number == 0)
        for number, part in enumerate(sequences)
    ]
    widths = keyed.scale.widths(np.concatenate(values))
    encoded = Encoded(
        keyed.scale,
        rows,
        keyed.laws,
        Script(data, 0, timings, ENTRY * entry[stance], tuple(index // ENTRY for index in range(len(data)))),
        keyed.legs,
        np.arange(len(widths)),
        widths,
        np.zeros(len(widths), dtype=bool),
        stance,
        tuple(steps),
    )
    order = [number ^ 1 for number in range(len(directions))]
    places += [place for number in order for place in places_of[number]]
    names = tuple(directions[number].name for number in order)
    return encoded, DirectionPlaces(
        read, names, tuple(ENTRY * place for place in places), ENTRY * entry[stance], *spots[:1]
    )


def _read(steps: Sequence[ScriptStep], first: int, last: int) -> list[ScriptStep]:
    """Return the steps from one pose of the chain to another, backward if that one comes first.

    The later of two poses determines the step between them; steps on the spot end where the part ends.
    """
    poses = list(range(first, last + 1) if first <= last else range(first, last - 1, -1))
    joined = [replace(steps[first], spot=False)]
    for one, other in pairwise(poses):
        later = steps[max(one, other)]
        row = steps[last].row if later.spot else steps[other].row
        joined.append(replace(steps[other], row=row, timing=later.timing, spot=later.spot))
    return joined
