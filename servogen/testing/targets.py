"""What a test runs on: the simulator, a recording, the bench. Each gives a `Seen`: what the pins did.

In: an image and the schedule that it should follow. Out: edges, and by `check` whether they are the
schedule's, exactly where the chip was simulated and within tolerances where an analyser looked.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from servogen.bench.programmers.flash import flash, objections
from servogen.bench.programmers.table import Order, find
from servogen.build.capture import capture
from servogen.build.proof import (
    START_FRAMES,
    checked_cycles,
    chip_warnings,
    cycle_of,
    end_of,
    prove,
    prove_capture,
    prove_file,
)
from servogen.edges import PINS, EdgeTrace
from servogen.engines.board import machine_of
from servogen.errors import Diagnostic, InputError, Location
from servogen.outputs import write_text
from servogen.pic.device import device
from servogen.pic.image import Image, to_hex
from servogen.plan_error import NO_PLAN, PlanError
from servogen.pulse import PulseSchedule
from servogen.simulator import CHIP_DEPENDENT
from servogen.traces import SUFFIXES as EDGE_SUFFIXES
from servogen.traces import read_edges, write_edges
from servogen.traces.captures import SUFFIXES as CAPTURE_SUFFIXES
from servogen.traces.captures import Capture, is_capture, read_capture
from servogen.units import Cycles
from servogen.verify import CaptureVerdict, Tolerances, Verdict, capture_lines, verdict_lines


@dataclass(frozen=True, slots=True)
class Seen:
    """What the pins did, in memory."""

    trace: EdgeTrace
    source: str
    """Where it was seen, in words."""
    capture: Capture | None = None
    """All that an analyser's file says: its clock is its own, its edges are on its samples."""
    span: Cycles | None = None
    """How much of it is to be judged; None: all of it."""
    file: Path | None = None
    """Where it is recorded already."""
    warnings: tuple[Diagnostic, ...] = ()
    """Of the program, where it was simulated."""


@dataclass(frozen=True, slots=True)
class Checked:
    """Whether what was seen is the schedule; in words, and as properties of a test report.

    `agrees` without `proven`: nothing that was seen is wrong, but not every different frame was seen.
    """

    proven: bool
    agrees: bool
    lines: tuple[str, ...]
    properties: tuple[tuple[str, str], ...]


class Target(Protocol):
    """Something that runs a program and lets its pins be seen."""

    @property
    def name(self) -> str: ...

    def load(self, image: Image) -> None:
        """Load the program and reset the chip."""

    def capture(self, schedule: PulseSchedule, seconds: float | None) -> Seen:
        """Return what the pins do for some seconds; by default long enough to judge the whole motion."""


class Simulator:
    """The simulated chip: exact edges."""

    name = "sim"

    def __init__(self) -> None:
        self._image: Image | None = None

    def load(self, image: Image) -> None:
        self._image = image

    def capture(self, schedule: PulseSchedule, seconds: float | None) -> Seen:
        if self._image is None:
            raise InputError(
                "no-program", "there is no program on the simulated chip", hint="load an image first"
            )
        span = checked_cycles(schedule) if seconds is None else schedule.clock.round_seconds(seconds)
        limit = Cycles(span + START_FRAMES * schedule.period)
        machine = machine_of(schedule, self._image, tracked=True)
        trace = EdgeTrace(schedule.clock, machine.stream(limit), limit).stored()
        return Seen(trace, "the simulated chip", span=span, warnings=chip_warnings(machine))


@dataclass(frozen=True, slots=True)
class Replay:
    """A recording in `folder`, by the name of the test; what is loaded does not matter."""

    folder: Path
    test: str
    name = "replay"

    def load(self, image: Image) -> None:
        return

    def capture(self, schedule: PulseSchedule, seconds: float | None) -> Seen:
        """Return the recording, all of it whatever `seconds` say. Raises InputError where there is none."""
        suffixes = dict.fromkeys((*CAPTURE_SUFFIXES, *EDGE_SUFFIXES))
        paths = [self.folder / f"{self.test}{suffix}" for suffix in suffixes]
        path = next((path for path in paths if path.is_file()), None)
        if path is None:
            raise InputError(
                "unreadable-file",
                "there is no recording of this test",
                Location(str(self.folder / self.test)),
                f"record it with --servogen-record={self.folder}; it ends in one of {', '.join(suffixes)}",
            )
        source = f"the recording {path}"
        if not is_capture(path):
            return Seen(read_edges(path, schedule.clock).stored(), source, file=path)
        return captured(path, source)


@dataclass
class Bench:
    """A chip on the bench: a programmer that loads it, where there is one, and an analyser that looks at it.

    Without a programmer the chip keeps its program, and the report does not claim which one was tested.
    """

    port: str
    programmer: str | None
    programmer_port: str | None
    device: str | None
    """None: what the program under test was built for."""
    folder: Path
    on_chip: Image | None = None
    """What was programmed by this run."""
    built_for: str | None = None
    """The device of the test's schedule."""
    name = "bench"

    def load(self, image: Image) -> None:
        """Program the chip unless it holds the image already. Raises as `servogen flash` does."""
        if self.programmer is None:
            text = "the program under test is not on the chip: no programmer is named"
            raise InputError("missing-option", text, hint="--servogen-programmer=picpro, with its port")
        if image == self.on_chip:
            return
        problems = objections(image)
        chip = self.device or self.built_for
        if chip is None:
            text = "nothing says which chip it is for"
            problems += (Diagnostic("error", "missing-option", text, hint="--servogen-device=PIC16F84"),)
        if problems or chip is None:
            raise InputError.of(problems)
        self.on_chip = None
        path = self.folder / "image.hex"
        write_text(path, to_hex(image))
        flash(find(self.programmer), Order(path, device(chip), self.programmer_port), image)
        self.on_chip = image

    def capture(self, schedule: PulseSchedule, seconds: float | None) -> Seen:
        """Return what the analyser captures, by default for the whole loop. Raises ToolError."""
        path = capture(self.folder / "capture.vcd", self.port, schedule, seconds).path
        which = "which this run programmed" if self.on_chip else "which this run did not program"
        return captured(path, f"the bench's chip, {which}, by the analyser on {self.port}")


def captured(path: Path, source: str) -> Seen:
    """Return an analyser's capture in a file."""
    found = read_capture(path)
    trace = found.trace.stored()
    return Seen(trace, source, replace(found, trace=trace), file=path)


def check(seen: Seen, schedule: PulseSchedule, tolerances: Tolerances | None = None) -> Checked:
    """Return whether the pins did what the schedule says."""
    if seen.capture is not None:
        found = prove_capture(schedule, seen.capture, tolerances)
        return Checked(found.proven, found.agrees, tuple(capture_lines(found)), tuple(_of_capture(found)))
    if seen.span is None:
        tells_end = seen.file is not None and seen.file.suffix.lower() == ".vcd"
        verdict = prove_file(schedule, seen.trace, tells_end)
    else:
        verdict = prove(schedule, seen.trace, seen.span)
    end = end_of(verdict)
    counted = (warning for warning in seen.warnings if end is None or cycle_of(warning) < end)
    verdict = verdict.with_warnings(tuple(counted), CHIP_DEPENDENT)
    return Checked(verdict.proven, verdict.agrees, tuple(verdict_lines(verdict)), tuple(_of_edges(verdict)))


def record(seen: Seen, path: Path) -> Path:
    """Write what was seen to `path`, or beside it with the suffix of the file that already holds it.

    `Replay` and `servogen verify` read it.
    """
    if seen.file is None:
        write_edges(seen.trace, path)
        return path
    copied = path.with_suffix(seen.file.suffix)
    if not (copied.exists() and copied.samefile(seen.file)):
        shutil.copyfile(seen.file, copied)
    return copied


def _of_edges(verdict: Verdict) -> Iterator[tuple[str, str]]:
    yield "servogen_verdict", verdict.word
    yield "servogen_different_frames", verdict.coverage.words()
    yield "servogen_seconds", f"{float(verdict.clock.seconds(verdict.span.compared)):g}"
    yield "servogen_frames", str(verdict.span.frames)
    yield from _of_plan(verdict.plan_error)
    for channel in verdict.channels:
        pin = PINS[channel.pin]
        yield f"servogen_{pin}_pulses", str(channel.observed)
        yield f"servogen_{pin}_worst_width_error_cycles", str(channel.width.error)
        yield f"servogen_{pin}_worst_period_error_cycles", str(channel.period.error)


def _of_plan(error: PlanError | None) -> Iterator[tuple[str, str]]:
    yield "servogen_plan_error", NO_PLAN if error is None else error.text()


def _of_capture(verdict: CaptureVerdict) -> Iterator[tuple[str, str]]:
    yield "servogen_verdict", verdict.word
    yield "servogen_different_frames", verdict.coverage.words()
    yield "servogen_seconds", f"{verdict.duration_us / 1e6:g}"
    yield "servogen_frames", str(verdict.frames)
    yield from _of_plan(verdict.plan_error)
    if verdict.pieces:
        yield "servogen_captures_stitched", str(len(verdict.pieces))
    if verdict.ppm is not None:
        yield "servogen_crystal_ppm", f"{verdict.ppm:z.1f}"
    for channel in verdict.channels:
        pin = PINS[channel.pin]
        yield f"servogen_{pin}_pulses", str(channel.captured)
        yield f"servogen_{pin}_worst_width_error_us", f"{channel.width.worst_us:z.3f}"
        yield f"servogen_{pin}_jitter_us", f"{channel.jitter_us:z.3f}"
