"""`JointTrajectory` -> what the player plays: parts, keyframes, and the schedule that comes of them.

In: a trajectory whose joints are the servos, and the frame. Out: `Playing`. Its schedule is what the chip
does, cycle for cycle; how far that is from the trajectory is in the rows of its plan.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np

from servogen.errors import Caution, InputError
from servogen.motion.trajectory import Floats, JointTrajectory
from servogen.pulse.checks import check_calibration, check_motion, check_period
from servogen.pulse.plan import PulsePlan
from servogen.pulse.player.interpolation import Whole, between, excursion
from servogen.pulse.player.layout import Layout, layout
from servogen.pulse.player.parts import ALIKE, Stretch, stretches
from servogen.pulse.player.tracks import MOST_BYTES, Pool, signs
from servogen.pulse.quantise import PARTS, Quantised
from servogen.pulse.schedule import Channel, Pulse, PulseSchedule, Run
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

BEST_US, WORST_US = 1, 35
"""How far a width may be from the planned one: as little as the table of keyframes allows, never more."""

LOOP_WEIGHT = 4
"""How much more an error counts in what is repeated for ever than in what is played once."""

NO_WRAP = 255
"""`Part.wrap` of a part whose tracks do not go round."""

MOST_BITS = 8
LAST_STEP = 7


@dataclass(frozen=True, slots=True)
class Part:
    """`repeats` times `frames` frames; `speed` 256ths of a keyframe a frame, 0 for a whole one.

    `tracks`: for each channel where its keyframes begin and by how many it is ahead. After keyframe
    `wrap` - 1 comes the first again.
    """

    frames: int
    repeats: int
    speed: int
    wrap: int
    silent: bool
    tracks: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Playing:
    """The player's data; `bases`, `signs` and a part's tracks are in order of the servos.

    A width is base + sign · (value between keyframes) · 2**shift.
    """

    plan: PulsePlan
    layout: Layout
    bases: tuple[int, ...]
    signs: tuple[int, ...]
    shift: int
    data: bytes
    parts: tuple[Part, ...]
    loop_part: int


@dataclass(frozen=True, slots=True)
class _Scale:
    """How widths become bytes."""

    first: Floats
    lowest: int
    shift: int
    signs: Whole

    def keys(self, rows: Floats) -> Whole:
        above = (rows - self.first) * self.signs - self.lowest
        return np.clip(np.floor(above / (1 << self.shift) + 0.5 + ALIKE / 2), 0, 255).astype(np.int64)

    def bases(self) -> Whole:
        return np.round(self.first).astype(np.int64) + self.signs * self.lowest

    def widths(self, value: Whole) -> Whole:
        return self.bases() + self.signs * excursion(value, self.shift)


@dataclass(frozen=True, slots=True)
class _Made:
    """A part's keyframes and the widths that they give."""

    stretch: Stretch
    speed: int
    ring: bool
    keys: Whole
    widths: Whole


def playing(
    trajectory: JointTrajectory,
    servos: Sequence[Servo],
    frame: Frame,
    soft_frames: int = 0,
) -> Playing:
    """The player's parts of `trajectory`; `servos` are its joints, in its order. Raises InputError.

    Its first `soft_frames` frames are parts of their own.
    """
    clock = trajectory.clock
    slots = layout(servos, frame, clock)
    rows = _ideal(trajectory, servos, clock)
    pulsed = rows[~np.isnan(rows).any(axis=1)]
    if not len(pulsed):
        raise InputError("the motion has no pulse")
    start = trajectory.loop_start
    lead = [
        *_sections(rows[:soft_frames], rows[soft_frames]),
        *_sections(rows[soft_frames:start], rows[start]),
    ]
    loop = _sections(rows[start:], rows[start])
    scale = _scale(pulsed, [*lead, *loop])
    made = _fitting((*lead, *loop), scale, clock, len(lead))
    pool, parts = _pool(made)
    every = np.concatenate([np.tile(each.widths, (each.stretch.repeats, 1)) for each in made])
    heard = np.concatenate(
        [np.full(each.stretch.frames * each.stretch.repeats, not each.stretch.silent) for each in made]
    )
    first_loop = sum(each.stretch.frames * each.stretch.repeats for each in made[: len(lead)])
    channels = tuple(Channel(servo.name, servo.pin, servo.model.name) for servo in servos)
    rises = [slots.rise(channel) for channel in range(len(servos))]
    schedule = PulseSchedule(
        clock,
        slots.period,
        channels,
        tuple(_runs(every[:first_loop], heard[:first_loop], rises)),
        tuple(_runs(every[first_loop:], heard[first_loop:], rises)),
    )
    quantised = tuple(_worst(servo, every[:, i], rows[:, i], clock) for i, servo in enumerate(servos))
    warnings = _warnings(trajectory, servos, frame, slots)
    return Playing(
        PulsePlan(schedule, quantised, warnings),
        slots,
        tuple(scale.bases().tolist()),
        tuple(scale.signs.tolist()),
        scale.shift,
        pool.data,
        parts,
        len(lead),
    )


def _ideal(trajectory: JointTrajectory, servos: Sequence[Servo], clock: Clock) -> Floats:
    """Widths in cycles as planned, (frames, servos); NaN without a pulse."""
    angles = trajectory.angles
    silent = np.isnan(angles)
    if (silent.any(axis=1) & ~silent.all(axis=1)).any():
        number = int(np.argmax(silent.any(axis=1) & ~silent.all(axis=1)))
        raise InputError(
            f"in frame {number} some servos have pulses and some have none",
            hint='the player rests all servos together: engine = "sequence", or the same pauses for all',
        )
    rows = np.full(angles.shape, np.nan)
    for index, servo in enumerate(servos):
        distinct, back = np.unique(angles[:, index], return_inverse=True)
        us = [np.nan if np.isnan(angle) else servo.width_us(angle) for angle in distinct.tolist()]
        rows[:, index] = np.array(us)[back] / float(clock.cycle_us)
    return rows


_Section = tuple[Stretch, Floats]
"""A stretch and its rows, the frame after them included."""


def _sections(rows: Floats, following: Floats) -> list[_Section]:
    if not len(rows):
        return []
    found = []
    for each in stretches(rows, following):
        mine = rows[each.first : each.first + each.frames]
        end = each.first + each.frames
        after = rows[end] if end < len(rows) else following
        after = mine[-1] if np.isnan(after).any() else after
        found.append((each, np.vstack((mine, after))))
    return found


def _scale(pulsed: Floats, sections: list[_Section]) -> _Scale:
    first = np.round(pulsed[0])
    every = pulsed - first
    cycles = [
        (section[1][:-1] - first)
        for section in sections
        if section[0].repeats > 1 and not section[0].silent and section[0].frames > 1
    ]
    ends = np.cumsum([0, *(len(rows) for rows in cycles)]).tolist()
    rings = [(a, b - a) for a, b in pairwise(ends)]
    sign = np.array(signs(np.concatenate(cycles) if cycles else every, rings), dtype=np.int64)
    lowest = int(np.floor((every * sign).min()))
    span = (every * sign).max() - lowest
    for shift in range(LAST_STEP + 1):
        if span <= 255 << shift:
            return _Scale(first, lowest, shift, sign)
    raise InputError("the servos' widths are too far apart for the player")


def _fitting(sections: Sequence[_Section], scale: _Scale, clock: Clock, loop: int) -> list[_Made]:
    """The parts, as near to the plan as their keyframes fit the table; those from `loop` on are for ever.

    Each part begins with as many keyframes as it needs. While all are too many, that part gets fewer whose
    error grows least for the bytes that it saves.
    """
    best, worst = (float(us / clock.cycle_us) for us in (BEST_US, WORST_US))
    choices = [_choices(section, scale, best, worst) for section in sections]
    taken = [0] * len(choices)
    while True:
        made = [each[number][0] for each, number in zip(choices, taken, strict=True)]
        size = len(_pool(made)[0].data)
        if size <= MOST_BYTES:
            return made
        ways = []
        for part, each in enumerate(choices):
            for number in range(taken[part] + 1, len(each)):
                other = [*made[:part], each[number][0], *made[part + 1 :]]
                saved = size - len(_pool(other)[0].data)
                grown = (each[number][1] - best / 2) * (LOOP_WEIGHT if part >= loop else 1)
                if saved > 0:
                    ways.append((grown / saved, part, number))
        if not ways:
            raise InputError(
                f"within {WORST_US} µs of the plan the motion has {size} bytes of keyframes: "
                f"the player's table holds {MOST_BYTES}",
                hint="shorten the motion, or let more of it repeat",
            )
        _, part, taken[part] = min(ways)


def _choices(section: _Section, scale: _Scale, best: float, worst: float) -> list[tuple[_Made, float]]:
    """A part with fewer and fewer keyframes, and its error in cycles, which is at most `worst`."""
    stretch, rows = section
    if stretch.silent:
        keys = np.zeros((1, rows.shape[1]), dtype=np.int64)
        return [(_Made(stretch, 1, True, keys, np.repeat(scale.widths(keys), stretch.frames, axis=0)), 0.0)]
    every = [_sampled(stretch, rows, scale, bits) for bits in range(MOST_BITS + 1)]
    errors = [float(np.abs(made.widths - rows[:-1]).max()) for made in every]
    first = max((bits for bits, error in enumerate(errors) if error <= best), default=0)
    return [
        (every[bits], errors[bits])
        for bits in range(first, MOST_BITS + 1)
        if bits == first or (errors[bits] <= worst and len(every[bits].keys) < len(every[bits - 1].keys))
    ]


def _sampled(stretch: Stretch, rows: Floats, scale: _Scale, bits: int) -> _Made:
    """A keyframe every 2**bits frames: those whose interpolation is nearest to the rows, in least squares."""
    frames, apart = stretch.frames, 1 << bits
    segments = -(-frames // apart)
    same = bool((np.abs(rows - rows[0]) < ALIKE).all())
    ring = same or (bool((np.abs(rows[-1] - rows[0]) < ALIKE).all()) and frames % apart == 0)
    count = 1 if same else segments + (not ring)
    times = np.arange(frames + (not ring))  # a round's last row is its first one
    one, other = times // apart % count, (times // apart + 1) % count
    share = times % apart / apart
    shares = np.zeros((len(times), count))
    np.add.at(shares, (times, one), 1 - share)
    np.add.at(shares, (times, other), share)
    nearest = np.linalg.lstsq(shares, rows[: len(times)] - scale.first, rcond=None)[0] + scale.first
    keys = scale.keys(nearest)
    widths = np.stack(
        [
            scale.widths(between(keys[a], keys[b], int(time % apart) << MOST_BITS - bits))
            for time, a, b in zip(times[:frames], one, other, strict=False)
        ]
    )
    return _Made(stretch, 256 >> bits & 0xFF, ring, keys, widths)


def _pool(made: list[_Made]) -> tuple[Pool, tuple[Part, ...]]:
    """The tracks of all parts; those that go round first, since others may be found in them."""
    pool = Pool()
    columns = [[bytes(column) for column in each.keys.T.tolist()] for each in made]
    pairs = list(zip(made, columns, strict=True))
    rings = sorted((keys for each, mine in pairs if each.ring for keys in mine), key=len, reverse=True)
    for keys in rings:
        pool.place(keys, ring=True)
    pool.place_all({keys for each, mine in pairs if not each.ring for keys in mine})
    tracks = [tuple(pool.place(keys, ring=each.ring) for keys in mine) for each, mine in pairs]
    parts = tuple(
        Part(
            each.stretch.frames,
            each.stretch.repeats,
            each.speed,
            len(each.keys) if each.ring else NO_WRAP,
            each.stretch.silent,
            tracks[number],
        )
        for number, each in enumerate(made)
    )
    return pool, parts


def _runs(widths: Whole, heard: np.ndarray, rises: Sequence[Cycles]) -> Iterator[Run]:
    """Equal frames in a row as one run."""
    if not len(widths):
        return
    table = np.where(heard[:, None], widths, 0)
    changes = (np.flatnonzero((table[1:] != table[:-1]).any(axis=1)) + 1).tolist()
    for first, end in zip([0, *changes], [*changes, len(table)], strict=True):
        pulses = tuple(
            Pulse(rise, Cycles(width)) if width else None
            for rise, width in zip(rises, table[first].tolist(), strict=True)
        )
        yield Run(end - first, pulses)


def _worst(servo: Servo, made: Whole, ideal: Floats, clock: Clock) -> Quantised:
    """The frame in which a channel is furthest from what was planned; `frames` counts all of them."""
    pulsed = np.flatnonzero(~np.isnan(ideal))
    frame = int(pulsed[np.argmax(np.abs(made[pulsed] - ideal[pulsed]))])
    asked = Fraction(round(ideal[frame] * float(clock.cycle_us) * PARTS), PARTS)
    cycles = Cycles(int(made[frame]))
    return Quantised(servo.name, servo.angle(float(asked)), asked, cycles, clock.us(cycles), len(pulsed))


def _warnings(
    trajectory: JointTrajectory, servos: Sequence[Servo], frame: Frame, slots: Layout
) -> tuple[Caution, ...]:
    clock = trajectory.clock
    found = [*check_period(frame.period, frame.place)]
    if slots.period != frame.period.cycles:
        found.append(
            Caution(
                "period-rounded",
                f"the player's period is {float(clock.us(slots.period)):g} µs, a multiple of 32 cycles",
                frame.place,
            )
        )
    for index, servo in enumerate(servos):
        found += check_calibration(servo)
        found += check_motion(
            servo, trajectory.angles[:, index], trajectory.loop_start, float(clock.seconds(slots.period))
        )
    return tuple(found)
