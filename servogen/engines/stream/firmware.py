"""The C of the stream engine, compiled, with the time that it takes and has to prepare a pulse.

In: a servo stream as the engine receives it, and a dialect. Out: the firmware.
"""

from __future__ import annotations

from dataclasses import replace

from servogen.compiler import Options
from servogen.engines.firmware import Firmware, TimingBudget
from servogen.engines.fitting import compiled_to_fit
from servogen.engines.protocol import EngineJob
from servogen.engines.stream.protocol import BYTES
from servogen.engines.stream.rendering import OVERRUN, render_stream
from servogen.engines.stream.response import response
from servogen.engines.stream.streaming import Streaming
from servogen.pic.listing import Listing
from servogen.units import Cycles

HINT = "fewer servos, or none on the other port"
"""The hint if the chip is too small."""


def compiled(job: EngineJob, streamed: Streaming, dialect: str) -> Firmware:
    """Return the firmware in `dialect`. Raises ResourceError if the chip is too small."""
    built = firmware(render_stream(streamed, dialect, job.device, job.name), job, dialect)
    budgets = timing_budgets(built.compilation.listing, streamed)
    return replace(built, timing_budgets=budgets)


def timing_budgets(listing: Listing, streamed: Streaming) -> tuple[TimingBudget, ...]:
    """Return the time that the C takes to prepare a pulse, and the time that interrupts leave it, on any
    line.
    """
    bound = response(listing, streamed.layout.rounds, streamed.farthest, BYTES * streamed.byte_cycles)
    supply = bound.supply or Cycles(0)
    return (
        TimingBudget("a request and its slot", bound.prepare, supply),
        TimingBudget("the same, after a command", bound.after_command, supply),
    )


def firmware(text: str, job: EngineJob, dialect: str) -> Firmware:
    """Return the compiled C of a stream. Raises ResourceError if the chip is too small."""
    file = f"main.{dialect}.c"
    options = Options(dialect=dialect, device=job.device)
    compilation = compiled_to_fit(text, file, options, job.name, "the stream engine", HINT)
    return Firmware(dialect, file, text, compilation, overrun=compilation.listing.variable(OVERRUN))
