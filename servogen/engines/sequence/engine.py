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
            # The compiler: only to make the firmware.
            from servogen.engines.sequence.rendering import angle_texts
            from servogen.engines.sequence.tuning import tune

            angles = angle_texts(planned.widths, job.servos)
            return tune(planned.schedule, dialect, job.device, job.name, angles)

        return EnginePlan(job.trajectory, planned, make)


ENGINE: Engine = SequenceEngine()
