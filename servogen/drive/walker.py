"""A walking robot under orders.

In: a job with [walk], its ways as start, cycle and stop. Out: `Walker`, frames without a foot that slips.

    standing ─▶ start ─▶ cycle ─▶ cycle … ─▶ stop ─▶ standing     a new order waits for the cycle's end,
       ▲ over to the next way's start ◀─────────────────┘         and for the feet to stand
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from servogen.drive.commands import STOP, WAYS, Rates, unknown
from servogen.drive.motions import frame_at
from servogen.errors import InputError, Location
from servogen.job import PlannedJob, plan_job
from servogen.kinematics.protocol import WalkingRobot
from servogen.motion.trajectory import Floats

OVER_FRAMES = 10
"""From how the feet stand for one way to how they stand for another: a few millimetres at most."""

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
    """The ways that the legs allow; at least one of them."""
    gaits, refused = {}, None
    for word, (x, y, turn) in WAYS.items():
        if y and not robot.sidesteps:
            continue
        stride = DEFAULT_STRIDE_MM if rates.way_mm is None else rates.way_mm
        angle = DEFAULT_TURN_DEG if rates.turn_deg is None else rates.turn_deg
        try:
            gaits[word] = _gait(
                job, {"forward_mm": x * stride, "left_mm": y * stride, "turn_deg": turn * angle}
            )
        except InputError as error:
            refused = refused or error
    if refused and not gaits:
        raise refused
    return Walker(job, gaits)


def _gait(job: PlannedJob, way: Mapping[str, float]) -> Gait:
    """One way as start, cycle and stop. Raises InputError where the legs cannot go it."""
    endless = plan_job(job, way).trajectory
    angles, loop = endless.angles, endless.loop_start
    cycle = len(angles) - loop
    for cycles in range(-(-loop // cycle) + 1, MOST_CYCLES):
        whole = plan_job(job, {**way, "cycles": float(cycles)}).trajectory.angles
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
            gait, self.going = self.gaits[self.wanted], self.wanted
            self._block = np.concatenate((_over(here, gait.start[0]), gait.start))


def _over(here: Floats, there: Floats) -> Floats:
    """A straight way between two poses, without its ends; none where they are the same."""
    if np.allclose(here, there, atol=SAME_RAD):
        return np.empty((0, len(here)))
    shares = np.arange(1, OVER_FRAMES)[:, None] / OVER_FRAMES
    return np.asarray(here + shares * (there - here))
