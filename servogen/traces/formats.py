"""Selects the format of a file by its suffix. Heavy readers and writers are imported only when needed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Protocol

from servogen.edges import EdgeChunk, EdgeTrace
from servogen.errors import InputError, Location
from servogen.outputs import atomic_write
from servogen.traces.inputs import NO_INPUTS, Inputs
from servogen.units import Clock, Cycles

SUFFIXES = (".csv", ".jsonl", ".vcd")


class EdgeWriter(Protocol):
    """Takes a trace's chunks in order, then its end."""

    def add(self, chunk: EdgeChunk) -> None: ...

    def finish(self, end: Cycles) -> None: ...


@contextmanager
def edge_writer(
    path: str | Path, clock: Clock, servos: Mapping[str, str] | None = None, inputs: Inputs = NO_INPUTS
) -> Iterator[EdgeWriter]:
    """Yield a writer to `path`; the file exists when the block ends.

    `servos` names pins, as in {"RB0": "arm"}. CSV and VCD also contain the changes of `inputs`. Raises
    InputError for an unknown suffix or a path that cannot be written, ToolError if writing fails.
    """
    suffix = _suffix(Path(path))
    with atomic_write(path, "wb") as file:
        yield _writer(file, suffix, clock, servos, inputs)


def write_edges(
    trace: EdgeTrace,
    *paths: str | Path,
    servos: Mapping[str, str] | None = None,
    inputs: Inputs = NO_INPUTS,
) -> None:
    """Write `trace` to each of `paths` in one pass. Raises as `edge_writer` does."""
    with ExitStack() as stack:
        writers = [stack.enter_context(edge_writer(path, trace.clock, servos, inputs)) for path in paths]
        for _ in recorded(trace, writers).chunks:
            pass


def recorded(trace: EdgeTrace, writers: Iterable[EdgeWriter]) -> EdgeTrace:
    """Return the same trace, passed to each of `writers` while it is read; read it once and completely."""
    return EdgeTrace(trace.clock, _pass_to_writers(trace, tuple(writers)), trace.end)


def _pass_to_writers(trace: EdgeTrace, writers: tuple[EdgeWriter, ...]) -> Iterator[EdgeChunk]:
    for chunk in trace.chunks:
        for writer in writers:
            writer.add(chunk)
        yield chunk
    for writer in writers:
        writer.finish(trace.end)


def read_edges(
    path: str | Path, clock: Clock, end: int | None = None, wires: Mapping[str, str] | None = None
) -> EdgeTrace:
    """Return the edges of the file at `path` in cycles of `clock`.

    `end` is the cycle at which the trace ends if the file does not contain it (CSV, JSONL), or at which it is
    cut. `wires` maps the wires of a VCD file that are not named after pins to pins, {"D0": "RB0"}. Raises
    InputError for an unknown suffix or malformed file, for some formats when the edges are iterated.
    """
    path = Path(path)
    suffix = _suffix(path)
    if wires is not None and suffix != ".vcd":
        raise InputError(
            "conflicting-options", "its rows name the pins themselves", Location(str(path), key="--wire")
        )
    if suffix == ".csv":
        from servogen.traces.csv import read_csv

        return read_csv(path, clock, end)
    if suffix == ".jsonl":
        from servogen.traces.jsonl import read_jsonl

        return read_jsonl(path, clock, end)
    from servogen.traces.vcd import read_vcd

    return read_vcd(path, clock, end, wires)


def _writer(
    file: IO[bytes], suffix: str, clock: Clock, servos: Mapping[str, str] | None, inputs: Inputs
) -> EdgeWriter:
    if suffix == ".csv":
        from servogen.traces.csv import CsvWriter

        return CsvWriter(file, inputs)
    if suffix == ".jsonl":
        from servogen.traces.jsonl import JsonlWriter

        return JsonlWriter(file)
    from servogen.traces.vcd import VcdWriter

    return VcdWriter(file, clock, servos, inputs=inputs)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            "unknown-suffix",
            f"'{path.suffix}' is not the suffix of an edge file",
            Location(str(path)),
            f"one of: {', '.join(SUFFIXES)}",
        )
    return suffix
