"""The tape engine of a job with a serial EEPROM: its plan; `firmware` has the C."""

from __future__ import annotations

from functools import cache

from servogen.engines.firmware import Firmware
from servogen.engines.protocol import Engine, EngineJob, EnginePlan
from servogen.engines.tape.taping import length_note, taped


class TapeEngine:
    """Plays frames of widths from a serial EEPROM."""

    title = "the tape engine"

    def plan(self, job: EngineJob) -> EnginePlan:
        """Plan the job's frames; a dialect's C is compiled when its firmware is requested."""
        made = taped(job)

        @cache
        def make(dialect: str) -> Firmware:
            from servogen.engines.tape.firmware import compiled  # the compiler: only to make the firmware

            return compiled(job, made, dialect)

        return EnginePlan(made.trajectory, made.plan, make, tour=made.tour, notes=(length_note(made),))


ENGINE: Engine = TapeEngine()
