"""Measures the cycles that a compiler adds between two edges, and renders the C again with shorter delays.

In: a schedule, a dialect, a device. Out: `Firmware`: C text and HEX image in which every delay compensates
for the statements around it. The overheads are measured on the simulator, never assumed: render, compile,
simulate, render, until the measured overheads are those of the rendering.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from servogen.compiler import Compilation, Options
from servogen.edges import EdgeChunk, EdgeTrace
from servogen.engines.board import board_of
from servogen.engines.firmware import Firmware, ResourceError
from servogen.engines.fitting import compiled_to_fit
from servogen.engines.sequence.programs import DelayPath, Overheads, Sequence
from servogen.engines.sequence.rendering import NO_COMMENTS, Comments, render
from servogen.engines.sequence.sequencing import sequence
from servogen.errors import ServogenError
from servogen.pic.device import PROGRAM_WORDS, Device
from servogen.pulse import PulseSchedule
from servogen.simulator import Machine
from servogen.units import Cycles, counted

ROUNDS = 3
"""Renderings: one to measure, one to confirm, a third if the first delays were too short to wait."""

SLACK_FRAMES = 4

SHORTER = "fewer positions, shorter moves between them, or holds in place of moves"
"""The hint for a sequence that does not fit."""


class TuningError(ServogenError):
    """Compiled code whose cycles vary, so that delays cannot compensate for them."""


@dataclass(frozen=True, slots=True)
class TunedFirmware(Firmware):
    """Firmware with the cycles that were subtracted from its delays."""

    overheads: Overheads = field(default_factory=Overheads)


def tune(
    schedule: PulseSchedule, dialect: str, device: Device, title: str, comments: Comments = NO_COMMENTS
) -> TunedFirmware:
    """Return the firmware of a schedule with every delay corrected, with its `comments`.

    Raises InputError if a delay has no time left, ResourceError if the chip is too small, TuningError if the
    overheads do not settle.
    """
    overheads = Overheads()
    for _ in range(ROUNDS):
        program = sequence(schedule, overheads)
        steps, table = (
            len(program.lead_in) + len(program.loop),
            sum(move.table.words for move in program.moves),
        )
        if steps + table > PROGRAM_WORDS:  # every step is at least one call: refused before it is compiled
            words = f" and {table} words of widths" if table else ""
            raise ResourceError(
                "does-not-fit",
                f"{title}: planned, but more than the sequence engine can hold: {steps} steps of one word or "
                f"more each{words}, the chip has {PROGRAM_WORDS}",
                hint=SHORTER,
            )
        file = f"main.{dialect}.c"
        text = render(program, dialect, device, title, comments)
        options = Options(dialect=dialect, device=device)
        compilation = compiled_to_fit(text, file, options, title, "the sequence engine", SHORTER)
        measured = measure(program, compilation)
        if measured == overheads:
            return TunedFirmware(dialect, file, text, compilation, overheads=overheads)
        overheads = measured
    raise TuningError(
        "tuning-failed", f"{file}: the cycles between the delays did not settle in {ROUNDS} rounds"
    )


def measure(program: Sequence, compilation: Compilation) -> Overheads:
    """Return the cycles of each path of `program` beyond its delays, over its lead-in and one loop."""
    schedule = program.schedule
    frames = sum(run.frames for run in (*schedule.lead_in, *schedule.loop))
    wanted = edges_to_watch(program)
    limit = Cycles(2 * (frames + SLACK_FRAMES) * schedule.period)
    machine = Machine(compilation.image, schedule.clock, board_of(schedule))
    trace = EdgeTrace(schedule.clock, machine.stream(limit), limit)
    times = _times(trace.driven(), wanted)
    paths = list(islice(program.walk(), wanted))
    if len(times) < len(paths):
        raise TuningError(
            "tuning-failed", f"the program made {len(times)} edges in {limit} cycles, not {len(paths)}"
        )
    cycles: dict[DelayPath, int] = {}
    before = 0
    for time, (path, asked) in zip(times, paths, strict=False):
        extra = time - before - asked
        before = time
        if cycles.setdefault(path, extra) != extra:
            raise TuningError(
                "tuning-failed",
                f"at cycle {time} the statements took {counted(extra, 'cycle')}, "
                f"before that {cycles[path]} ({path})",
            )
    return Overheads(cycles)


def edges_to_watch(program: Sequence) -> int:
    """Return the number of port writes of the lead-in, of one loop and the first of the next."""
    schedule = program.schedule
    writes = sum(
        run.frames
        * len({time for pulse in run.pulses if pulse for time in (pulse.rise, pulse.rise + pulse.width)})
        for run in (*schedule.lead_in, *schedule.loop)
    )
    repeats = any(any(run.pulses) for run in schedule.loop)
    return writes + int(repeats)


def _times(chunks: Iterable[EdgeChunk], count: int) -> list[int]:
    """Return the cycles of the first `count` port writes that change a pin."""
    times: list[int] = []
    for chunk in chunks:
        new = np.unique(chunk.cycle).tolist()
        times += new[1:] if times and new and new[0] == times[-1] else new
        if len(times) > count:
            break
    return times[:count]
