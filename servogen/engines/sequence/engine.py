"""The sequence engine of a job: pulses rounded to the nearest whole cycles, delays tuned on the simulator."""

from __future__ import annotations

from functools import cache

from servogen.engines.firmware import Firmware
from servogen.engines.protocol import Engine, EngineJob, EnginePlan
from servogen.pulse.plan import plan


class SequenceEngine:
    """Plays a motion as port writes with delays between them."""

    title = "the sequence engine"

    def plan(self, job: EngineJob) -> EnginePlan:
        """Plan the pulses; a dialect's delays are tuned when its firmware is requested."""
        planned = plan(job.trajectory, job.servos, job.frame)

        @cache
        def make(dialect: str) -> Firmware:
            from servogen.engines.sequence.rendering import comments_of
            from servogen.engines.sequence.tuning import tune  # the compiler: only to make the firmware

            comments = comments_of(job, planned)
            return tune(planned.schedule, dialect, job.device, job.name, comments)

        return EnginePlan(job.trajectory, planned, make)


ENGINE: Engine = SequenceEngine()
