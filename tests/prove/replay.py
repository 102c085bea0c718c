"""Counterexamples of `servogen prove`, run again on the plain simulator."""

from __future__ import annotations

from servogen.edges import EdgeTrace, edge_chunk, join
from servogen.pic.image import Image
from servogen.prove import Counterexample
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.simulator import Machine, parse_stimuli
from servogen.units import Clock, Cycles
from servogen.verify import verify


def is_wrong(image: Image, schedule: PulseSchedule, found: Counterexample) -> bool:
    """Return whether a plain run, as the stimulus file and the options say, differs from the schedule."""
    clock = Clock(found.clock_hz or schedule.clock.hz)
    text = found.stimulus(schedule.clock)
    stimuli = parse_stimuli(text, "found.toml", clock) if text else None
    machine = Machine(image, clock, found.options, stimuli)
    chunk = join(machine.stream(found.cycle + 2 * schedule.period))
    begun = 0 if found.reset is None else found.reset + 1
    late = chunk.cycle > begun
    seen = edge_chunk(chunk.cycle[late] - begun, chunk.pin[late], chunk.level[late])
    span = Cycles(found.cycle + 2 * schedule.period - begun)
    return not verify(expected(schedule), EdgeTrace(schedule.clock, [seen], span), span).agrees
