"""How compact the player's keyframes are; `python -m tests.engines.player.compactness` prints docs' table.

In: the kept jobs. Out: for each the bytes of its table, what they would be if no two servos shared a track,
and of its gait's cycle a lower bound: of every different track (mirrored, shifted: the same) the least
number of straight pieces, wherever they begin, that stay as near to the plan as the keyframes do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from servogen.engines.player.engine import play
from servogen.engines.player.fitting import NO_WRAP
from servogen.engines.player.playing import ideal_widths
from servogen.job import load, plan_job
from servogen.motion.trajectory import Floats
from servogen.pulse import PulseSchedule
from tests.engines.player.player_jobs import ROOT

JOBS = ("hexapod-tripod", "hexapod-ripple", "hexapod-wave", "hexapod-turn", "scara-pick")
SAME = 0.01
"""Cycles."""


@dataclass(frozen=True, slots=True)
class Compactness:
    """Of a job: `stored` bytes of keyframes, `unshared` ones, the worst errors before and in the loop.

    Of its longest cycle: `tracks` of `keyframes` each, and the least number of straight `pieces` for all.
    """

    job: str
    stored: int
    unshared: int
    tracks: int
    keyframes: int
    pieces: int
    lead_in_us: float
    loop_us: float

    def row(self) -> str:
        """A row of the table in docs/firmware.md."""
        cycle = f"{self.tracks} × {self.keyframes}" if self.keyframes else "–"
        pieces = str(self.pieces) if self.keyframes else "–"
        errors = f"{self.lead_in_us:.1f} µs | {self.loop_us:.1f} µs"
        return f"| `{self.job}` | {self.unshared} | {self.stored} | {cycle} | {pieces} | {errors} |"


def compactness(name: str) -> Compactness:
    """A kept job's keyframes, counted."""
    job = plan_job(load(ROOT / "jobs" / f"{name}.toml"))
    motion, played = play(job)
    planned = ideal_widths(motion, job.servos, job.clock)
    errors = np.abs(_made(played.plan.schedule) - planned)
    unshared, at, cycle = 0, 0, (0, 0, 0, 0)
    for part in played.parts:
        ring = 1 < part.wrap < NO_WRAP
        # So many frames are a keyframe; one more leads to the next part.
        segments = -(-part.frames * (part.speed or 256) // 256)
        unshared += len(job.servos) * (part.wrap if part.wrap < NO_WRAP else segments + 1)
        if ring and part.frames > cycle[0]:
            tracks = list(_different(planned[at : at + part.frames]))
            error = float(errors[at : at + part.frames].max())
            cycle = (part.frames, len(tracks), part.wrap, sum(_pieces(track, error) for track in tracks))
        at += part.frames * part.repeats
    start, us = played.plan.schedule.lead_in_frames, float(job.clock.cycle_us)
    worst = [float(np.nanmax(each)) * us for each in (errors[:start], errors[start:])]
    return Compactness(name, len(played.data), unshared, *cycle[1:], *worst)


def _made(schedule: PulseSchedule) -> Floats:
    """The widths of the schedule, a row a frame, NaN without a pulse."""
    rows = [
        [pulse.width if pulse else np.nan for pulse in run.pulses]
        for run in (*schedule.lead_in, *schedule.loop)
        for _ in range(run.frames)
    ]
    return np.array(rows)


def _different(rows: Floats) -> Iterator[Floats]:
    """The columns of a cycle that are not another one, mirrored or later."""
    found: list[Floats] = []
    for column in rows.T:
        track = column - column.mean()
        if not any(_same(track, other) for other in found):
            found.append(track)
            yield track


def _same(one: Floats, other: Floats) -> bool:
    turned = [np.roll(one, -ahead) for ahead in range(len(one))]
    return any(bool((np.abs(each - sign * other) < SAME).all()) for each in turned for sign in (1, -1))


def _pieces(track: Floats, error: float) -> int:
    """The least number of straight pieces, one after the other, free in value, within `error` of the track.

    Each piece is as long as a line stays within the error in all its frames: no other choice needs fewer.
    """
    count, start = 0, 0
    while start < len(track):
        end = start + 1
        while end < len(track) and _a_line_fits(track[start : end + 1], error):
            end += 1
        count, start = count + 1, end
    return count


def _a_line_fits(values: Floats, error: float) -> bool:
    """Whether a slope takes all values into a band of twice the error; its width is convex in the slope."""
    times = np.arange(len(values))
    low, high = np.diff(values).min(), np.diff(values).max()
    for _ in range(60):
        third = (high - low) / 3
        if np.ptp(values - (low + third) * times) < np.ptp(values - (high - third) * times):
            high -= third
        else:
            low += third
    return bool(np.ptp(values - low * times) <= 2 * error + 1e-6)


def main() -> None:
    for name in JOBS:
        print(compactness(name).row())


if __name__ == "__main__":
    main()
