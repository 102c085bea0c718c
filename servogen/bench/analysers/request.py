"""From samples to a capture file: runs of an analyser's channels as edges of the chip's pins.

In: `Runs` and the wires. Out: a VCD file that `servogen verify` reads. A capture that was cut short is kept
under another name and says in the file that it is not whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from servogen.bench.analysers.sump import Runs
from servogen.edges import UNDRIVEN, EdgeChunk, edge_chunk, join, part
from servogen.errors import InputError, Location
from servogen.traces.captures import capture_writer
from servogen.units import Cycles

SUFFIX = ".vcd"
PARTIAL = ".partial"
SEAMS_A_SECOND = 1000
"""Between two captures in one file nothing is known: a millisecond without a level stands for it."""


@dataclass(frozen=True, slots=True)
class Record:
    """The contents of the file: the changes in samples, up to sample `end`; `pieces` if it consists of
    several captures.
    """

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
            f"'{path.suffix}' is not the ending of a capture that is written",
            Location(str(path)),
            SUFFIX,
        )
    if not path.parent.is_dir():
        raise InputError("unwritable-file", "there is no such directory", Location(str(path.parent)))


def partial_name(path: Path) -> Path:
    """Return the path for an incomplete capture: run.partial.vcd."""
    return path.with_name(f"{path.stem}{PARTIAL}{path.suffix}")


def cut(record: Record, begin: int, end: int) -> Record:
    """Return the samples from `begin` up to `end` of one capture."""
    chunk = record.chunk
    before = int(np.searchsorted(chunk.cycle, begin, side="right"))
    level = dict(zip(chunk.pin[:before].tolist(), chunk.level[:before].tolist(), strict=True))
    inside = part(chunk, slice(before, int(np.searchsorted(chunk.cycle, end))))
    at_begin = edge_chunk([0] * len(level), list(level), list(level.values()))
    return Record(join((at_begin, inside._replace(cycle=inside.cycle - begin))), end - begin)


def stitched(records: Sequence[Record], rate: int) -> Record:
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
    return Record(join(chunks[:-1]), now - gap, tuple(pieces))


def write_capture(
    path: Path, rate: int, record: Record, servos: Mapping[str, str], missing: str | None = None
) -> Path:
    """Write edges in samples, and return the path of the file, which differs if something is `missing`."""
    target = path if missing is None else partial_name(path)
    with capture_writer(target, rate, servos, missing, record.pieces) as writer:
        writer.add(record.chunk)
        writer.finish(Cycles(record.end))
    return target
