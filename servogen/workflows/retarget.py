"""Tunes the C of a sequence for another compiler: measures what that compiler adds, and corrects the delays.

In: a job, the other compiler's HEX, the C that it was compiled from. Out: `Tuned`: the verdict on the HEX,
the cycles of each path through the program and, unless the HEX is exact, the C to compile next.

The delays in the C are known from servogen's own compiler: on each path they are the cycles of its HEX of the
same C minus those of its statements. The remaining cycles of the other HEX are those of the other compiler.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from servogen.compiler import Options, Source, compile_sources
from servogen.edges import PINS, join
from servogen.engines.sequence.programs import START, DelayPath, Hold, Move, Overheads, SilentStep
from servogen.engines.sequence.programs import Sequence as Program
from servogen.engines.sequence.rendering import comments_of, render
from servogen.engines.sequence.sequencing import MARGIN, sequence
from servogen.engines.sequence.tables import FIXED
from servogen.engines.sequence.tuning import TunedFirmware, edges_to_watch
from servogen.errors import InputError, Location
from servogen.job import PlannedJob
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.units import Cycles
from servogen.verify import Verdict
from servogen.workflows.engines import planned
from servogen.workflows.verification import checked_cycles, judge_image, motion_cycles, running

if TYPE_CHECKING:
    from servogen.answers import AddedAnswer, TunedAnswer


@dataclass(frozen=True, slots=True)
class Added:
    """The cycles of statements on a path through the program: the other compiler's, and servogen's."""

    path: str
    theirs: int
    ours: int

    def to_json(self) -> AddedAnswer:
        return {"path": self.path, "their_cycles": self.theirs, "servogen_cycles": self.ours}


@dataclass(frozen=True, slots=True)
class Tuned:
    """`source` is the C to compile next; empty if the HEX is exact."""

    verdict: Verdict
    added: tuple[Added, ...]
    source: str

    def to_json(self) -> TunedAnswer:
        """Return the result without the C to compile next."""
        return {
            "exact": self.verdict.passed,
            "added": [overhead.to_json() for overhead in self.added],
            "verdict": self.verdict.to_json(),
        }


@dataclass(frozen=True, slots=True)
class Write:
    """A port write that changes pins: its cycle, and the new levels, such as "RB0 high"."""

    cycle: int
    changes: str


def tune_to(
    job: PlannedJob, theirs: Image, hex_file: str, dialect: str, source: Source | None = None
) -> Tuned:
    """Measure `theirs`, compiled from `source` (default: the C that `build` writes), and render the next C.

    Raises InputError if the HEX is not that C's, takes different times on the same path, or leaves no time
    for a delay.
    """
    played = planned(job)
    if played.engine != "sequence":
        raise InputError(
            "engine-unsupported",
            f"{job.name}: its pulses come from the {played.engine}, which is exact with any compiler",
            hint=f"there is nothing to tune: servogen verify {hex_file} --against schedule.json",
        )
    schedule, firmware = played.plan.schedule, played.make(dialect)
    assert isinstance(firmware, TunedFirmware)
    source = source or Source(firmware.text, firmware.file)
    known = compile_sources([source], Options(dialect=dialect, device=job.device)).image
    program = sequence(schedule, firmware.overheads)
    wanted = edges_to_watch(program)
    built, ours, seen = (
        _writes(schedule, image, wanted) for image in (firmware.compilation.image, known, theirs)
    )
    _compare(ours, built, source.file, f"a program of {job.name}")
    _compare(seen, ours, hex_file, f"{source.file} compiled")
    overheads = _overheads(program, firmware.overheads, ours, seen, (hex_file, source.file))
    told = _path_texts(program)
    added = [Added(told[path], cost, firmware.overheads.of(path)) for path, cost in overheads.cycles.items()]
    span = checked_cycles(schedule)
    verdict = judge_image(schedule, theirs, span)
    if verdict.edges_agree:
        return Tuned(verdict, tuple(added), "")
    comments = comments_of(job, played.plan)
    following = render(sequence(schedule, overheads), dialect, job.device, job.name, comments)
    return Tuned(verdict, tuple(added), following)


def _overheads(
    program: Program,
    known: Overheads,
    ours: Sequence[Write],
    seen: Sequence[Write],
    files: tuple[str, str],
) -> Overheads:
    """Return the cycles of the statements on each path of the program that made `seen`.

    `files` are the names of the HEX and its C.
    """
    told = _path_texts(program)
    costs: dict[DelayPath, int] = {}
    most = MARGIN + (FIXED if program.moves else 0)  # the statements around the loop that waits for a width
    for index, (path, _) in enumerate(islice(program.walk(), len(ours))):
        delays, taken, cycle = _since(ours, index) - known.of(path), _since(seen, index), seen[index].cycle
        cost = taken - delays
        if path != START and not 0 <= cost <= most:
            raise InputError(
                "foreign-program",
                f"is not compiled from {files[1]}: {told[path]} it takes {taken} cycles up to cycle {cycle}, "
                f"where the C's delays are {delays}",
                Location(files[0]),
                f"a compiler adds 0 to {most} cycles; name the C of the HEX with --c",
            )
        if costs.setdefault(path, cost) != cost:
            raise InputError(
                "foreign-program",
                f"{told[path]} its statements take {cost} cycles up to cycle {cycle}, "
                f"before that {costs[path]}",
                Location(files[0]),
                "a delay can only compensate for a constant: let the compiler optimise, or use the player",
            )
    return Overheads(costs)


def _writes(schedule: PulseSchedule, image: Image, wanted: int) -> list[Write]:
    """Return the first `wanted` port writes that change pins."""
    span = Cycles(2 * motion_cycles(schedule))
    edges = join(running(schedule, image, span).driven())
    starts = np.flatnonzero(np.diff(edges.cycle, prepend=-1))[: wanted + 1].tolist()
    ends = [*starts[1:], len(edges.cycle)]
    return [
        Write(
            int(edges.cycle[start]),
            " and ".join(
                f"{PINS[pin]} {'high' if level else 'low'}"
                for pin, level in sorted(zip(edges.pin[start:end], edges.level[start:end], strict=True))
            ),
        )
        for start, end in zip(starts[:wanted], ends, strict=False)
    ]


def _since(writes: Sequence[Write], index: int) -> int:
    """Return the cycles since the previous write, or since reset."""
    return writes[index].cycle - (writes[index - 1].cycle if index else 0)


def _compare(seen: Sequence[Write], wanted: Sequence[Write], file: str, name: str) -> None:
    """Raise InputError for the first write that differs."""
    for number, (here, there) in enumerate(zip(seen, wanted, strict=False), 1):
        if here.changes != there.changes:
            raise InputError(
                "foreign-program",
                f"is not {name}: the port write {number}, at cycle {here.cycle}, makes {here.changes}, "
                f"not {there.changes}",
                Location(file),
            )
    if len(seen) < len(wanted):
        raise InputError(
            "foreign-program",
            f"is not {name}: it writes {len(seen)} times to its pins, not {len(wanted)} times",
            Location(file),
        )


def _path_texts(program: Program) -> Mapping[DelayPath, str]:
    """Return a description of each path, to follow a subject."""
    told = {START: "from reset to the first edge"}
    for step in (*program.lead_in, *program.loop):
        if not isinstance(step, SilentStep):
            told.update(_step_path_texts(step, program.schedule))
    return told


def _step_path_texts(step: Hold | Move, schedule: PulseSchedule) -> Iterator[tuple[DelayPath, str]]:
    if isinstance(step, Move):
        frame, owner, inner, again = step.function.frame, step.function.table.number, "row", "next"
        name = f"move_{owner}"
    else:
        frame, inner, again = step.frame, "in", "again"
        owner = step.position.number if step.position else -step.number
        name = f"position_{owner}" if step.position else f"the frame of step {step.number + 1}"
    for index, edge in enumerate(frame.edges):
        words = " and ".join(
            f"{schedule.channels[channel].name} {'high' if level else 'low'}"
            for channel, level in edge.changes
        )
        yield DelayPath(inner, owner, index), f"in {name} after {words}"
    yield DelayPath(again, owner), f"from one {name} to the next"
    yield DelayPath("turn", step.number), f"from a call of step {step.number + 1} to its next"
    yield DelayPath("after", step.number), f"from step {step.number + 1} to the next"
