"""From samples to a capture file: one capture, or several of one motion where one is too short.

In: `Runs` of an analyser's channels, and the wires. Out: edges of the chip's pins in a VCD file that
`servogen verify` reads. A capture that was cut short is kept under another name and says in the file that
it is not whole. Of several captures each is cut to whole frames of the schedule and remains a record of its
own, because what the pins did between two is not known; one in which something is wrong stays uncut.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from servogen.bench.analysers.memory import CapturePlan
from servogen.bench.analysers.sump import Runs
from servogen.bench.analysers.sump_client import ReceivedSamples
from servogen.bench.ports import Unplugged
from servogen.edges import PIN_NAMES, UNDRIVEN, EdgeChunk, EdgeTrace, Expected, edge_chunk, join, part
from servogen.errors import InputError, Location, ToolError
from servogen.traces.captures import capture_writer
from servogen.units import OSCILLATOR_PERIODS_PER_CYCLE, Clock, Cycles
from servogen.verify import CaptureVerdict, verify_capture

SUFFIX = ".vcd"
PARTIAL = ".partial"
SEAMS_A_SECOND = 1000
"""Between two captures in one file nothing is known: a millisecond without a level stands for it."""


@dataclass(frozen=True, slots=True)
class SampleRecord:
    """The changes in samples, up to sample `end`; `pieces` are the limits of each of several captures."""

    chunk: EdgeChunk
    end: int
    pieces: tuple[tuple[int, int], ...] = ()


def edges(runs: Runs, wires: Mapping[int, int]) -> EdgeChunk:
    """Return the changes of the wired pins in samples, with the level of each at sample 0."""
    times, pins, levels = [], [], []
    for channel, pin in sorted(wires.items(), key=lambda wire: wire[1]):
        level = (runs.value >> np.uint32(channel) & np.uint32(1)).astype(np.uint8)
        changed = np.ones(len(level), dtype=bool)
        changed[1:] = level[1:] != level[:-1]
        times.append(runs.start[changed])
        levels.append(level[changed])
        pins.append(np.full(int(changed.sum()), pin, dtype=np.uint8))
    time = np.concatenate(times)
    order = np.argsort(time, kind="stable")
    return edge_chunk(time[order], np.concatenate(pins)[order], np.concatenate(levels)[order])


def check_name(path: Path) -> None:
    """Raise InputError if a capture cannot be written to `path`, before anything is captured."""
    if path.suffix.lower() != SUFFIX:
        raise InputError(
            "unknown-suffix",
            f"'{path.suffix}' is not a suffix of the captures that are written",
            Location(str(path)),
            SUFFIX,
        )
    if not path.parent.is_dir():
        raise InputError("unwritable-file", "there is no such directory", Location(str(path.parent)))


def partial_name(path: Path) -> Path:
    """Return the path for an incomplete capture: run.partial.vcd."""
    return path.with_name(f"{path.stem}{PARTIAL}{path.suffix}")


def cut(record: SampleRecord, begin: int, end: int) -> SampleRecord:
    """Return the samples from `begin` up to `end` of one capture."""
    chunk = record.chunk
    before = int(np.searchsorted(chunk.cycle, begin, side="right"))
    level = dict(zip(chunk.pin[:before].tolist(), chunk.level[:before].tolist(), strict=True))
    inside = part(chunk, slice(before, int(np.searchsorted(chunk.cycle, end))))
    at_begin = edge_chunk([0] * len(level), list(level), list(level.values()))
    return SampleRecord(join((at_begin, inside._replace(cycle=inside.cycle - begin))), end - begin)


def stitched(records: Sequence[SampleRecord], rate: int) -> SampleRecord:
    """Return one record of several captures, one after the other, without levels between them."""
    if len(records) == 1:
        return records[0]
    gap = -(-rate // SEAMS_A_SECOND)
    chunks, pieces, now = [], [], 0
    for record in records:
        chunks.append(record.chunk._replace(cycle=record.chunk.cycle + now))
        pieces.append((now, now + record.end))
        wired = np.unique(record.chunk.pin)
        now += record.end
        chunks.append(edge_chunk(np.full(len(wired), now), wired, np.full(len(wired), UNDRIVEN)))
        now += gap
    return SampleRecord(join(chunks[:-1]), now - gap, tuple(pieces))


def write_capture(
    path: Path,
    rate: int,
    record: SampleRecord,
    servos: Mapping[str, str],
    missing: str | None = None,
    pins: Mapping[int, str] = PIN_NAMES,
) -> Path:
    """Write edges in samples, and return the path of the file, which differs if something is `missing`."""
    target = path if missing is None else partial_name(path)
    with capture_writer(target, rate, servos, missing, record.pieces, pins) as writer:
        writer.add(record.chunk)
        writer.finish(Cycles(record.end))
    return target


MAX_ROUNDS = 4
"""The maximum number of captures until each frame of the loop has been seen, in multiples of the minimum."""

LENGTHS = 3
"""The number of lengths that take turns, so that a loop as long as a capture is also seen whole."""


@dataclass(frozen=True, slots=True)
class Stitched:
    """`missing` is the reason why the last capture is incomplete; `unseen` counts the frames of the loop that
    no capture contains.
    """

    records: tuple[SampleRecord, ...]
    missing: str | None
    unseen: int


def stitch(
    look: Callable[[CapturePlan, int], ReceivedSamples],
    planned: CapturePlan,
    frames: int,
    whole_loop: bool,
    expected: Expected,
    wired: Mapping[int, int],
) -> Stitched:
    """Capture until there are `frames` whole frames and, for the `whole_loop`, each different one has been
    seen.

    `look` makes a capture; it takes a plan and the capture's number, from 1 on. `expected.chunks` is read
    again for each. If a capture fails, those before it are kept.
    """
    records: list[SampleRecord] = []
    seen: frozenset[int] = frozenset()
    different: frozenset[int] = frozenset()
    whole = 0
    most = MAX_ROUNDS * -(-frames // planned.frames)
    while len(records) < most and (whole < frames or (whole_loop and different - seen)):
        number = len(records)
        try:
            capture = look(planned.shorter(number % LENGTHS), number + 1)
        except (ToolError, Unplugged) as error:
            if not records:
                raise
            return Stitched(tuple(records), error.message, len(different - seen))
        record = SampleRecord(edges(capture.runs, wired), capture.runs.end)
        if capture.missing is not None:
            return Stitched((*records, record), capture.missing, len(different - seen))
        verdict = _verdict(record, planned, expected)
        seen, different = seen | verdict.coverage.seen, verdict.coverage.different
        whole += verdict.whole.count if verdict.whole else planned.frames
        records.append(_whole_frames(record, verdict))
    return Stitched(tuple(records), None, len(different - seen))


def _verdict(record: SampleRecord, planned: CapturePlan, expected: Expected) -> CaptureVerdict:
    clock = Clock(int(planned.rate * OSCILLATOR_PERIODS_PER_CYCLE))
    trace = EdgeTrace(clock, (record.chunk,), Cycles(record.end))
    return verify_capture(expected, trace, sample=1, pieces=((0, record.end),))


def _whole_frames(record: SampleRecord, verdict: CaptureVerdict) -> SampleRecord:
    if not verdict.agrees or verdict.whole is None:
        return record
    return cut(record, verdict.whole.begin, verdict.whole.end)
