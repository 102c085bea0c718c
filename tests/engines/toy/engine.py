"""A fourth engine, to show what one takes: it holds one servo in one position, once a jumper is set, if there
is one.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from servogen.compiler import Options
from servogen.engines.c_text import ports_of, render_template
from servogen.engines.firmware import Firmware
from servogen.engines.fitting import compiled_to_fit
from servogen.engines.inputs import given
from servogen.engines.protocol import Engine, EngineJob, EnginePlan
from servogen.engines.sequence.waits import CALLS
from servogen.engines.toy.section import Jumper
from servogen.errors import InputError
from servogen.pic.device import config_word, oscillator_for
from servogen.pulse.plan import plan
from servogen.pulse.schedule import Input
from servogen.units import Cycles

FALL = 1
"""CLRF takes the pin low in one cycle (DS30430 table 9-2)."""

BACK = 4
"""GOTO, MOVLW, MOVWF: from the end of the frame to the next rise."""


class ToyEngine:
    """Plays a motion that is one position of one servo."""

    title = "the toy engine"

    def plan(self, job: EngineJob) -> EnginePlan:
        """Plans the one pulse. Raises InputError for any other motion."""
        made = plan(job.trajectory, job.servos, job.frame)
        schedule = made.schedule
        runs = {run.pulses for run in (*schedule.lead_in, *schedule.loop)}
        (pulses, *others) = runs
        if others or len(pulses) != 1 or pulses[0] is None:
            raise InputError("does-not-fit", f"{job.name}: {self.title} holds one servo in one position")
        width = pulses[0].width
        jumper = given(job.inputs, Jumper)
        if jumper is not None:
            made = replace(made, schedule=replace(schedule, inputs=(Input(jumper.pin, 1),)))

        def make(dialect: str) -> Firmware:
            pin = job.servos[0].pin
            file = f"main.{dialect}.c"
            text = render_template(
                "toy/main.c.j2",
                dialect=dialect,
                device=job.device.name,
                clock_hz=job.clock.hz,
                oscillator=oscillator_for(job.clock.hz),
                configuration=f"0x{config_word(oscillator_for(job.clock.hz)):04X}",
                ports=list(ports_of(schedule)),
                jumper=jumper and {"port": jumper.pin[1], "mask": f"0x{1 << int(jumper.pin[2]):02X}"},
                port=pin[1],
                mask=f"0x{1 << int(pin[2]):02X}",
                high=_wait(width - FALL, dialect, job),
                low=_wait(schedule.period - width - BACK, dialect, job),
            )
            options = Options(dialect=dialect, device=job.device)
            compilation = compiled_to_fit(text, file, options, job.name, self.title, "there is no less")
            return Firmware(dialect, file, text, compilation)

        return EnginePlan(job.trajectory, made, cache(make))


def _wait(cycles: int, dialect: str, job: EngineJob) -> str:
    return " ".join(str(call) for call in CALLS[dialect](Cycles(cycles), job.clock))


ENGINE: Engine = ToyEngine()
