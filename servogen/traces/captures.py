"""Saved captures of logic analysers: VCD, sigrok sessions (.sr), Saleae's CSV.

In: a file. Out: a `Capture`: its edges in the file's own time steps, so that nothing is rounded before the
chip's clock is known. Levels at time 0 are those of the first sample.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from servogen.edges import PIN_NAMES, PINS, UNDRIVEN, EdgeChunk, EdgeTrace
from servogen.errors import InputError, Location
from servogen.inputs import open_input
from servogen.outputs import atomic_write
from servogen.traces.channels import parse_rate, step_clock
from servogen.traces.csv import HEADER as EDGES_HEADER
from servogen.traces.formats import EdgeWriter, read_edges
from servogen.traces.lines import ended, first_lines
from servogen.traces.rows import rescale
from servogen.traces.saleae import read_saleae
from servogen.traces.sigrok import read_session
from servogen.traces.vcd import MADE, PARTIAL, STITCHED, VcdWriter, read_header, read_vcd
from servogen.units import Clock, Cycles

SUFFIXES = (".vcd", ".sr", ".csv")

_PIECES = re.compile(r"(?:\s*\d{1,18}-\d{1,18}(?=\s|\Z))+\s*", re.ASCII)
_RATE = re.compile(r"(?:Acquisition with \d+/\d+ (?:channels|probes)|captured on all channels) at ([^;\n]*)")
"""The comments in which sigrok and `capture_writer` state the sampling rate."""
_CHANGED_COMMENT = "the comment of the file is not as it was written"
_VERSION = re.compile(rb"\$version\s(.*?)\$end", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Capture:
    """`trace` counts time steps as the cycles of an equally fast clock; `sample` is the number of steps per
    sample.

    It is None if the file does not contain the sampling rate. Edges in cycles of a chip, which are not
    samples, are exact to a step.
    """

    trace: EdgeTrace
    sample: float | None
    missing: str | None = None
    """Why the capture is incomplete, if the file says so."""
    pieces: tuple[tuple[int, int], ...] = ()
    """The beginning and end, in steps, of each of several captures; the time between two is not known."""
    file: str | None = None


def read_capture(path: str | Path, wires: Mapping[str, str] | None = None) -> Capture:
    """Return the capture at `path`; `wires` maps channels that are not named after pins, as in {"D0": "RB0"}.

    Raises InputError for a file that is not a capture; a VCD file is checked while its edges are read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".vcd":
        return _read_vcd(path, wires)
    if suffix == ".sr":
        return Capture(read_session(path, wires), 1.0, file=str(path))
    if suffix == ".csv":
        return Capture(read_saleae(path, wires), None, file=str(path))
    hint = f"one of: {', '.join(SUFFIXES)}"
    raise InputError(
        "unknown-suffix", f"'{path.suffix}' is not the suffix of a capture", Location(str(path)), hint
    )


def read_recording(
    path: str | Path, clock: Clock, end: int | None = None, wires: Mapping[str, str] | None = None
) -> EdgeTrace:
    """Return the edges of any recorded file in cycles of `clock`: a capture's are rounded to the nearest.

    `end` and `wires` are those of `read_edges`. Raises as `read_edges` and `read_capture` do.
    """
    path = Path(path)
    if path.suffix.lower() == ".vcd" or not is_capture(path):
        return read_edges(path, clock, end, wires)
    trace = read_capture(path, wires).trace
    ratio = Fraction(clock.hz, trace.clock.hz)
    chunks = tuple(chunk._replace(cycle=rescale(chunk.cycle, ratio)) for chunk in trace.chunks)
    (last,) = rescale(np.array([trace.end], dtype=np.int64), ratio).tolist()
    after = max((int(chunk.cycle[-1]) + 1 for chunk in chunks), default=0)
    return ended(clock, chunks, Cycles(max(last, after)), end)


def is_capture(path: str | Path) -> bool:
    """Return whether the file at `path` holds an analyser's samples rather than edges in cycles of a chip."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".csv":
        return first_lines(path, 1)[0].strip() != EDGES_HEADER.encode()
    if suffix == ".vcd":
        with open_input(path) as file:
            version = _VERSION.search(file.read(1 << 16))
        return version is None or version.group(1).strip() != MADE.encode()
    return suffix in SUFFIXES


def sampled_at(capture: Capture, samples_per_second: int) -> Capture:
    """Return the capture with a sampling rate in Hz. Raises InputError if its file contains one."""
    if capture.file is not None and not is_capture(capture.file):
        raise InputError(
            "conflicting-options", "only a capture has a sampling rate", Location(capture.file, key="--rate")
        )
    if capture.sample is not None:
        step_us = float(capture.trace.clock.cycle_us)
        rate = 1e6 / (capture.sample * step_us)
        raise InputError(
            "conflicting-options",
            f"contains its sampling rate, {rate:g} Hz",
            Location(capture.file, key="--rate"),
            "omit --rate",
        )
    steps = float(capture.trace.clock.cycles_per_second) / samples_per_second
    return replace(capture, sample=steps)


@contextmanager
def capture_writer(
    path: str | Path,
    samples_per_second: int,
    servos: Mapping[str, str] | None = None,
    missing: str | None = None,
    pieces: Sequence[tuple[int, int]] = (),
    pins: Mapping[int, str] = PIN_NAMES,
) -> Iterator[EdgeWriter]:
    """Yield a writer of a capture, whose cycles are samples, to a VCD file that `read_capture` recognises.

    `missing` is the reason why the capture is incomplete, `pieces` are the first and last sample of each of
    several; both are written to the file. `pins` are the names of those that are written, by their numbers.
    """
    with atomic_write(path, "wb") as file:
        clock = step_clock(Fraction(samples_per_second), Location(str(path)))
        yield VcdWriter(file, clock, servos, captured=True, missing=missing, pieces=pieces, pins=pins)


def _read_vcd(path: Path, wires: Mapping[str, str] | None) -> Capture:
    header = read_header(path, wires)
    clock = step_clock(1 / header.step_s, Location(str(path)))
    rates = (stated[1] for comment in header.comments if (stated := _RATE.match(comment)))
    rate = next((parse_rate(text.strip(), Location(str(path))) for text in rates), None)
    sample = None if rate is None else float(1 / (rate * header.step_s))
    is_made = not is_capture(path)
    if is_made:
        sample = 1.0
    missing = next((text.partition(PARTIAL)[2] for text in header.comments if PARTIAL in text), None)
    steps = Fraction(1) if rate is None else 1 / (rate * header.step_s)
    trace = read_vcd(path, clock, wires=wires, from_first=not is_made)
    place = Location(str(path))
    pieces = _pieces(header.comments, steps, place)
    if pieces:
        _check_pieces(pieces, trace.end, place)
        trace = replace(trace, chunks=_EdgesOfPieces(trace.chunks, pieces, path))
    return Capture(
        trace=trace,
        sample=sample,
        missing=missing,
        pieces=pieces,
        file=str(path),
    )


def _check_pieces(pieces: Sequence[tuple[int, int]], end: int, place: Location) -> None:
    """Raise InputError for pieces that are empty, not one after the other, or not within the file."""
    before = 0
    for number, (begin, until) in enumerate(pieces, 1):
        if not before <= begin < until <= end:
            message = f"capture {number} in it, from {begin} to {until}, is not between {before} and {end}"
            raise InputError("vcd-syntax", message, place, _CHANGED_COMMENT)
        before = until


@dataclass(frozen=True, slots=True)
class _EdgesOfPieces:
    """The edges of several captures. Raises InputError for a level where none of them recorded anything."""

    chunks: Iterable[EdgeChunk]
    pieces: Sequence[tuple[int, int]]
    path: Path

    def __iter__(self) -> Iterator[EdgeChunk]:
        begins, ends = (np.array(limits) for limits in zip(*self.pieces, strict=True))
        for chunk in self.chunks:
            piece = np.searchsorted(begins, chunk.cycle, side="right") - 1
            outside = (piece < 0) | (chunk.cycle >= ends[piece])
            wrong = np.flatnonzero(outside & (chunk.level != UNDRIVEN))
            if len(wrong):
                pin, step = PINS[chunk.pin[wrong[0]]], chunk.cycle[wrong[0]]
                message = f"{pin} has a level at step {step}, outside of the captures that the file states"
                raise InputError("vcd-syntax", message, Location(str(self.path)), _CHANGED_COMMENT)
            yield chunk


def _pieces(comments: Iterable[str], steps: Fraction, place: Location) -> tuple[tuple[int, int], ...]:
    """Return the beginning and end of each piece, in time steps, of which `steps` make a sample. Raises
    InputError for a comment that names pieces without their limits.
    """
    mark = STITCHED.rstrip()
    stated = next((text.partition(mark)[2].partition(";")[0] for text in comments if mark in text), None)
    if stated is None:
        return ()
    if not _PIECES.fullmatch(stated):
        raise InputError("vcd-syntax", "does not say which captures are in it", place, _CHANGED_COMMENT)
    ranges = (tuple(map(int, span.split("-"))) for span in stated.split())
    return tuple((round(begin * steps), round(end * steps)) for begin, end in ranges)
