"""A walking robot under orders.

In: a job with [walk], its ways as start, cycle and stop. Out: `Walker`, frames without a foot that slips.

    standing ─▶ start ─▶ cycle ─▶ cycle … ─▶ stop ─▶ standing     a new order waits for the cycle's end,
       ▲ all ways start and stop standing alike ◀───────┘         and for the feet to stand
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from servogen.drive.commands import STOP, WAYS, Rates, unknown
from servogen.drive.motions import frame_at
from servogen.errors import InputError, Location
from servogen.job import PlannedJob, plan_job
from servogen.kinematics.protocol import WalkingRobot
from servogen.motion.gait.steps import Segment
from servogen.motion.trajectory import Floats

DEFAULT_STRIDE_MM, DEFAULT_TURN_DEG = 40.0, 8.0
MOST_CYCLES = 12
"""A walk is steady by then."""

SAME_RAD = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Gait:
    """Frames (n, servos) from standing, of one cycle, and to standing again."""

    start: Floats
    cycle: Floats
    stop: Floats


def walker(job: PlannedJob, robot: WalkingRobot, rates: Rates) -> Walker:
    """Return a walker of the ways that the legs allow; there is at least one of them."""
    stride = DEFAULT_STRIDE_MM if rates.way_mm is None else rates.way_mm
    angle = DEFAULT_TURN_DEG if rates.turn_deg is None else rates.turn_deg
    ways = {
        word: {"forward_mm": x * stride, "left_mm": y * stride, "turn_deg": turn * angle}
        for word, (x, y, turn) in WAYS.items()
        if robot.sidesteps or not y
    }
    gaits, refused = {}, None
    for word, way in ways.items():
        try:
            gaits[word] = _gait(job, way, [_segment(each) for each in ways.values()])
        except InputError as error:
            refused = refused or error
    if refused and not gaits:
        raise refused
    return Walker(job, gaits)


def _segment(way: Mapping[str, float]) -> Segment:
    """Return what the body does in a cycle of a way."""
    return Segment(way["forward_mm"] / 1000, way["left_mm"] / 1000, math.radians(way["turn_deg"]))


def _gait(job: PlannedJob, way: Mapping[str, float], others: Sequence[Segment]) -> Gait:
    """Return one way as start, cycle and stop, the legs standing at both ends as for all the others.

    Raises InputError where the legs cannot go it.
    """
    endless = plan_job(job, way, others).trajectory
    angles, loop = endless.angles, endless.loop_start
    cycle = len(angles) - loop
    for cycles in range(-(-loop // cycle) + 1, MOST_CYCLES):
        whole = plan_job(job, {**way, "cycles": float(cycles)}, others).trajectory.angles
        if len(whole) > len(angles) and np.allclose(whole[: len(angles)], angles, atol=SAME_RAD):
            return Gait(angles[:loop], angles[loop:], whole[len(angles) :])
    raise InputError(
        "endless-walk", "the walk cannot be stopped: its gait leaves a leg behind", Location(job.file)
    )


@dataclass(slots=True, eq=False)
class Walker:
    """Walks by cycles; `wanted` is the order, `going` the way that is gone now, if any."""

    job: PlannedJob
    gaits: Mapping[str, Gait]
    wanted: str = STOP
    going: str | None = None
    _block: Floats = field(init=False)
    _row: int = 0
    _frame: int = 0

    def __post_init__(self) -> None:
        self._block = next(iter(self.gaits.values())).start[:1]

    @property
    def words(self) -> tuple[str, ...]:
        return (*self.gaits, STOP)

    def order(self, word: str) -> None:
        if word not in self.words:
            raise unknown(word, self.words)
        self.wanted = word

    def at(self, seconds: float) -> Floats | None:
        frame = frame_at(self.job.trajectory, seconds)
        for _ in range(frame - self._frame):
            self._step()
        self._frame = frame
        return np.asarray(self._block[self._row])

    def _step(self) -> None:
        self._row += 1
        if self._row < len(self._block):
            return
        here, self._row = self._block[-1], 0
        if self.going is not None and self.wanted == self.going:
            self._block = self.gaits[self.going].cycle
        elif self.going is not None:
            self._block, self.going = self.gaits[self.going].stop, None
        elif self.wanted == STOP:
            self._block = here[None]
        else:
            self._block, self.going = self.gaits[self.wanted].start, self.wanted
