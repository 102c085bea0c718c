"""What a planned job will do: its frames, what it asks of each servo, where its ends go and how exactly.

In: a planned job and its pulses. Out: `PlanFacts`, in metres, radians and seconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from servogen.job import PlannedJob
from servogen.pulse import PulsePlan
from servogen.report.servo_facts import ServoFacts, facts_of
from servogen.report.tool_error import EndError, errors_of, worst_of
from servogen.report.tracks import Track, tracks_of


@dataclass(frozen=True, slots=True)
class PlanFacts:
    """The facts of one plan; `ends` are the errors of the pulses at the feet, the tool or the base."""

    job: PlannedJob
    plan: PulsePlan
    servos: tuple[ServoFacts, ...]
    tracks: tuple[Track, ...]
    ends: tuple[EndError, ...]

    def seconds(self, frames: int) -> float:
        """Return how long a number of frames lasts."""
        schedule = self.plan.schedule
        return float(schedule.clock.seconds(frames * schedule.period))

    @property
    def worst(self) -> EndError | None:
        """Return the end whose error is greatest; None if the job has no ends."""
        return worst_of(self.ends) if self.ends else None

    def extent(self, end: EndError) -> tuple[list[float], list[float]]:
        """Return the least and the greatest x, y, z that an end is planned at."""
        track = next(each for each in self.tracks if each.name == end.name)
        return np.nanmin(track.planned, axis=0).tolist(), np.nanmax(track.planned, axis=0).tolist()

    def to_json(self) -> dict[str, object]:
        schedule = self.plan.schedule
        return {
            "job": self.job.name,
            "device": self.job.device.name,
            "clock_hz": self.job.clock.hz,
            "period_s": self.seconds(1),
            "lead_in_frames": schedule.lead_in_frames,
            "loop_frames": schedule.loop_frames,
            "lead_in_s": self.seconds(schedule.lead_in_frames),
            "loop_s": self.seconds(schedule.loop_frames),
            "servos": [each.to_json() for each in self.servos],
            "ends": [self._end(each) for each in self.ends],
        }

    def _end(self, end: EndError) -> dict[str, object]:
        least, greatest = self.extent(end)
        error = {**end.to_json(), "time_s": self.seconds(end.frame)}
        return {"name": end.name, "kind": end.kind, "least_m": least, "greatest_m": greatest, "error": error}


def plan_facts(job: PlannedJob, plan: PulsePlan) -> PlanFacts:
    """Return the facts of a job whose pulses are `plan`."""
    tracks = tracks_of(job, plan.schedule)
    return PlanFacts(job, plan, facts_of(job), tracks, errors_of(tracks))
