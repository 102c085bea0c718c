"""The targets of a test: the simulator, a recording, the bench. Each returns a `SeenPins`: edges of the pins.

In: a program and, if it should follow one, a schedule. Out: edges, and by `check` whether they are the
schedule's, exactly where the chip was simulated and within tolerances where an analyser looked.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum
from math import ceil
from pathlib import Path
from typing import Protocol

import numpy as np

from servogen.bench.analysers.memory import TYPICAL_EDGES, TYPICAL_PERIOD_S
from servogen.bench.inputs.adapter import (
    BoardInput,
    Close,
    DrivePin,
    InputAdapter,
    Send,
    SerialAdapter,
    input_adapter,
)
from servogen.bench.inputs.wiring import MARK_CHANNEL, MCLR, VDD, Contact, InputWiring
from servogen.bench.ports import open_port
from servogen.bench.programmers.flash import flash, objections, read_eeprom
from servogen.bench.programmers.table import ProgrammingRequest, find
from servogen.edges import PINS, EdgeTrace, join
from servogen.engines.board import board_of, inputs_of
from servogen.errors import Diagnostic, InputError, Location, ToolError
from servogen.outputs import write_text
from servogen.pic.device import device, registers
from servogen.pic.image import Image, to_hex
from servogen.pic.isa import decode
from servogen.plan_error import NO_PLAN, PlanError
from servogen.pulse import PulseSchedule
from servogen.simulator import CHIP_DEPENDENT, Machine, SimulatorOptions, Stimuli
from servogen.testing.signals import Signals, pin_index
from servogen.traces import SUFFIXES as EDGE_SUFFIXES
from servogen.traces import read_edges, write_edges
from servogen.traces.captures import SUFFIXES as CAPTURE_SUFFIXES
from servogen.traces.captures import Capture, is_capture, read_capture
from servogen.units import Clock, Cycles
from servogen.verify import CaptureVerdict, Tolerances, Verdict, capture_lines, verdict_lines
from servogen.verify.capture.check import split
from servogen.workflows.capture import CaptureSettings, capture
from servogen.workflows.verification import (
    checked_cycles,
    chip_warnings,
    compared_end,
    hidden_by,
    judge_capture,
    judge_edges,
    judge_file,
    warning_cycle,
)

TYPICAL_EDGES_PER_S = TYPICAL_EDGES / float(TYPICAL_PERIOD_S)
"""The rate of edges for which an analyser's memory is planned."""
FEW_EDGES_PER_S = TYPICAL_EDGES_PER_S / 4
"""The rate assumed for a program that was not captured yet."""
BOARD_LATE_MS, HOST_LATE_MS = 3, 50
"""The maximum lateness of an input that the board plays by its own clock, and that this computer plays."""

ATTEMPTS = 5
"""The maximum number of captures without a schedule until one is long enough."""
MARGIN = 1.25
SAFETY = 2
"""The allowed number of changes in a run as a multiple of the maximum seen so far."""
MIN_PLAYED_S = 0.5
"""The minimum time for whose typical changes the analyser's memory is planned."""
POWER_OFF_S = 0.2
"""The time for which the supply stays off, so that the capacitors at the chip discharge."""
SERIAL_BAUD = 9600
"""The rate of a serial adapter until the first bytes are sent."""
EECON2 = registers()["EECON2"].address


@dataclass(frozen=True, slots=True)
class SeenPins:
    """What the pins did, in memory."""

    trace: EdgeTrace
    source: str
    """A description of where the edges were seen."""
    capture: Capture | None = None
    """The analyser's file, with its own clock, and edges on its samples; None for other sources."""
    span: Cycles | None = None
    """The part that is judged; None: all of it."""
    file: Path | None = None
    """The existing recording, if there is one."""
    hidden: tuple[str, ...] = ()
    """What that file cannot show, so that it is not exact."""
    warnings: tuple[Diagnostic, ...] = ()
    """The warnings of a simulated program."""

    def require(self, pin: int) -> None:
        """Raise InputError unless the pin was looked at: an analyser sees those that are wired to it.

        What a capture contains of a pin begins with its level at time 0.
        """
        if self.capture is not None and not np.any(join(self.trace.chunks).pin == pin):
            raise InputError(
                "bad-wiring",
                f"{PINS[pin]} is not among the pins of {self.source}",
                hint="wire it to a channel of the analyser and capture again",
            )


@dataclass(frozen=True)
class PinCapture(Signals):
    """What the pins did in one test."""

    seen: SeenPins = field(repr=False)
    clock: Clock
    properties: list[tuple[str, object]] = field(repr=False)
    """The properties of the test, which JUnit reports show."""

    @property
    def source(self) -> str:
        """Return where it was seen, in words."""
        return self.seen.source

    def pieces(self) -> Sequence[EdgeTrace]:
        capture = self.seen.capture
        if capture is None or not capture.pieces:
            return (self.seen.trace,)
        return tuple(split(self.seen.trace, capture.pieces))

    @property
    def from_reset(self) -> bool:
        return self.seen.capture is None

    def chip_clock(self) -> Clock:
        return self.clock

    def seen_pin(self, name: str) -> int:
        index = pin_index(name)
        self.seen.require(index)
        return index


@dataclass(frozen=True, slots=True)
class ScheduleCheck:
    """Whether the edges match the schedule, in words and as properties of a test report.

    `agrees` without `passed`: nothing that was seen is wrong, but not every different frame was seen.
    """

    passed: bool
    agrees: bool
    lines: tuple[str, ...]
    properties: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class CaptureRequest:
    """What a test wants to see."""

    clock: Clock
    """The chip's clock."""
    schedule: PulseSchedule | None = None
    seconds: float | None = None
    """The duration; None: long enough to judge the schedule's whole motion."""
    stimuli: Stimuli | None = None
    """The stimuli that drive the pins instead of the schedule's levels."""
    device: str | None = None
    """The chip that the program was built for, where it or the schedule says so."""

    @property
    def cycles(self) -> Cycles:
        """Return how long the pins are looked at. Raises InputError where nothing says."""
        if self.seconds is not None:
            return self.clock.round_seconds(self.seconds)
        if self.schedule is None:
            raise InputError(
                "missing-option",
                "the test states neither a schedule nor a duration",
                hint="@pytest.mark.servogen(..., seconds=0.5)",
            )
        return checked_cycles(self.schedule)


class BenchStart(Enum):
    """How a run of a chip on the bench begins."""

    CONTINUE = "continue"
    RESET = "reset"
    POWER_UP = "power-up"


@dataclass(frozen=True, slots=True)
class BenchRun:
    """One run of a chip on the bench, during which inputs change: moment 0 is its beginning."""

    clock: Clock
    seconds: float
    levels: Mapping[str, int | None] = field(default_factory=dict)
    """The levels that drive the chip's pins from the beginning; None: nothing drives the pin."""
    contacts: Mapping[Contact, bool] = field(default_factory=dict)
    """Whether each contact is closed at the beginning."""
    inputs: tuple[BoardInput, ...] = ()
    start: BenchStart = BenchStart.CONTINUE
    repeatable: bool = False
    """Whether the run may be repeated if the analyser's memory was too small for it."""


class Target(Protocol):
    """Something that runs a program and lets its pins be seen."""

    @property
    def name(self) -> str: ...

    def load(self, image: Image) -> None:
        """Load the program and reset the chip."""

    def capture(self, request: CaptureRequest) -> SeenPins:
        """Return what the pins do."""


class Simulator:
    """The simulated chip: exact edges."""

    name = "sim"

    def __init__(self) -> None:
        self._image: Image | None = None

    def load(self, image: Image) -> None:
        self._image = image

    def capture(self, request: CaptureRequest) -> SeenPins:
        if self._image is None:
            raise InputError(
                "no-program", "there is no program on the simulated chip", hint="load an image first"
            )
        span = limit = request.cycles
        options, stimuli, schedule = SimulatorOptions(), request.stimuli, request.schedule
        if request.device is not None:
            options = replace(options, device=request.device)
        if schedule is not None:
            limit = schedule.run_cycles(span)
            options, stimuli = board_of(schedule, options), stimuli or inputs_of(schedule)
        machine = Machine(self._image, request.clock, options, stimuli, tracked=True)
        trace = EdgeTrace(request.clock, machine.stream(limit), limit).stored()
        return SeenPins(trace, "the simulated chip", span=span, warnings=chip_warnings(machine))


@dataclass(frozen=True, slots=True)
class Replay:
    """A recording in `folder`, by the name of the test; what is loaded does not matter."""

    folder: Path
    test: str
    wires: Mapping[str, str] | None = None
    """The pins of the recordings' channels that are not named after them."""
    name = "replay"

    def load(self, image: Image) -> None:
        return

    def capture(self, request: CaptureRequest) -> SeenPins:
        """Return the whole recording, ignoring `seconds`. Raises InputError if there is none."""
        return self.recording(self.test, request.clock)

    def recordings(self, clock: Clock) -> list[SeenPins]:
        """Return what each run of the test's chip showed. Raises InputError where there is no recording."""
        recordings = [self.recording(self.test, clock)]
        while self._path(further(self.test, len(recordings))) is not None:
            recordings.append(self.recording(further(self.test, len(recordings)), clock))
        return recordings

    def _path(self, name: str) -> Path | None:
        suffixes = dict.fromkeys((*CAPTURE_SUFFIXES, *EDGE_SUFFIXES))
        paths = [self.folder / f"{name}{suffix}" for suffix in suffixes]
        return next((path for path in paths if path.is_file()), None)

    def recording(self, name: str, clock: Clock) -> SeenPins:
        """Return the recording of that name. Raises InputError where there is none."""
        path = self._path(name)
        if path is None:
            raise InputError(
                "unreadable-file",
                "there is no recording of this test",
                Location(str(self.folder / name)),
                f"record it with --servogen-record={self.folder}; it ends in one of "
                f"{', '.join(dict.fromkeys((*CAPTURE_SUFFIXES, *EDGE_SUFFIXES)))}",
            )
        source = f"the recording {path}"
        if not is_capture(path):
            trace = read_edges(path, clock, wires=self.wires).stored()
            return SeenPins(trace, source, file=path, hidden=hidden_by(path, clock, self.wires))
        return captured(path, source, self.wires)


@dataclass(frozen=True, slots=True)
class InputPorts:
    """The ports of what drives the chip's inputs, and how it is wired."""

    board: str
    """The port of the Firmata board."""
    wiring: InputWiring
    serial: str | None = None
    """The port of a USB serial adapter; None: there is none."""
    serial_pin: str = ""
    """The pin of the chip that the adapter sends to."""


@dataclass
class Bench:
    """A chip on the bench: a programmer that loads it, where there is one, and an analyser that looks at it.

    Without a programmer the chip keeps its program, and the report does not claim which one was tested.
    """

    port: str
    programmer: str | None
    programmer_port: str | None
    device: str | None
    """The chip's name; None: the one that the program under test was built for."""
    folder: Path
    on_chip: Image | None = None
    """The image that this run has programmed."""
    built_for: str | None = None
    """The device of the test's program, if its schedule or the test states it."""
    captures: int = 0
    """The number of captures made by this run, each in its own file."""
    inputs: InputPorts | None = None
    """What drives the chip's inputs; None: nothing."""
    edges_per_s: float = FEW_EDGES_PER_S
    """The maximum rate of edges in the program's runs so far."""
    name = "bench"
    _open: ExitStack = field(default_factory=ExitStack)
    _adapter: InputAdapter | None = None

    def load(self, image: Image) -> None:
        """Program the chip unless it holds the image already. Raises as `servogen flash` does."""
        if self.programmer is None:
            text = "the program under test is not on the chip: no programmer is named"
            raise InputError("missing-option", text, hint="--servogen-programmer=picpro, with its port")
        if image == self.on_chip and not uses_eeprom(image):
            return
        problems = objections(image)
        if problems:
            raise InputError.of(problems)
        self.on_chip = None
        path = self.folder / "image.hex"
        write_text(path, to_hex(image))
        order = self._order(path)
        if self._adapter is not None:
            self._adapter.release()  # RB6, RB7 and MCLR are the programmer's
        flash(find(self.programmer), order, image)
        self.on_chip = image
        self.edges_per_s = FEW_EDGES_PER_S

    def eeprom(self) -> bytes:
        """Return the chip's data EEPROM, read by the programmer; the program then starts again."""
        if self.on_chip is None:
            raise InputError("missing-option", "no programmer of this run knows the chip's EEPROM")
        if self._adapter is not None:
            self._adapter.release()
        return read_eeprom(find(self.programmer), self._order(self.folder / "eeprom.hex"), self.on_chip)

    def _order(self, path: Path) -> ProgrammingRequest:
        chip = self.device or self.built_for
        if chip is None:
            text = "nothing says which chip it is for"
            raise InputError("missing-option", text, hint="--servogen-device=PIC16F84")
        return ProgrammingRequest(path, device(chip), self.programmer_port)

    def adapter(self) -> InputAdapter | None:
        """Return what drives the inputs, opened at the first call. Raises ToolError."""
        if self._adapter is None and self.inputs is not None:
            self._adapter = self._open.enter_context(opened(self.inputs))
        return self._adapter

    def close(self) -> None:
        """Release the chip's inputs and close the ports."""
        if self._adapter is not None:
            self._adapter.release()
        self._adapter = None
        self._open.close()

    def play(self, segment: BenchRun) -> SeenPins:
        """Return what the pins do while their inputs change. Raises InputError, ToolError."""
        adapter = self.adapter()
        if adapter is None:
            return self.capture(CaptureRequest(segment.clock, seconds=segment.seconds))
        late_ms = BOARD_LATE_MS if adapter.board.scheduler else HOST_LATE_MS
        wanted = segment.seconds + late_ms / 1000
        held = 0.0
        for _ in range(ATTEMPTS if segment.repeatable else 1):
            asked = MIN_PLAYED_S + wanted * SAFETY * self.edges_per_s / TYPICAL_EDGES_PER_S
            begin(adapter, segment)
            settings = CaptureSettings(trigger_channel=MARK_CHANNEL, armed=adapter.start)
            seen = self._capture_with(settings, CaptureRequest(segment.clock), asked)
            held = float(seen.trace.clock.seconds(seen.trace.end))
            watched = min(held, segment.seconds)
            cycles = join(seen.trace.chunks).cycle
            edges = int((cycles <= seen.trace.clock.round_seconds(watched)).sum())
            self.edges_per_s = max(self.edges_per_s, edges / watched)
            if held >= segment.seconds:
                check_inputs(seen.trace, segment, late_ms)
                return seen
        raise _memory_full(held, segment.seconds)

    def capture(self, request: CaptureRequest) -> SeenPins:
        """Return what the analyser captures, by default for the schedule's whole loop. Raises ToolError.

        Without a schedule nothing says which pin moves, and the capture begins at once; nor how often the
        pins change: a capture that is too short is repeated with more of the analyser's memory.
        """
        if request.schedule is not None:
            return self._capture(request, request.seconds)
        wanted = asked = float(request.clock.seconds(request.cycles))
        held = 0.0
        for _ in range(ATTEMPTS):
            seen = self._capture(request, asked)
            held = float(seen.trace.clock.seconds(seen.trace.end))
            if held >= wanted:
                return seen
            asked = max(asked, float(TYPICAL_PERIOD_S)) * MARGIN * wanted / held
        raise _memory_full(held, wanted)

    def _capture(self, request: CaptureRequest, seconds: float | None) -> SeenPins:
        return self._capture_with(CaptureSettings(triggered=request.schedule is not None), request, seconds)

    def _capture_with(
        self, settings: CaptureSettings, request: CaptureRequest, seconds: float | None
    ) -> SeenPins:
        self.captures += 1
        output = self.folder / f"capture-{self.captures}.vcd"
        path = capture(output, self.port, request.schedule, seconds, settings).path
        which = "which this run programmed" if self.on_chip else "which this run did not program"
        return captured(path, f"the bench's chip, {which}, by the analyser on {self.port}")


def _memory_full(held_s: float, wanted_s: float) -> InputError:
    return InputError(
        "analyser-memory",
        f"the analyser's memory was full after {1000 * held_s:.4g} ms, not {1000 * wanted_s:g} ms",
        hint="capture for a shorter time: the pins change too often for a longer capture",
    )


@contextmanager
def opened(ports: InputPorts) -> Iterator[InputAdapter]:
    """Yield the input adapter at its ports. Raises InputError, ToolError."""
    with ExitStack() as stack:
        serial = None
        if ports.serial is not None:
            line = stack.enter_context(open_port(ports.serial, SERIAL_BAUD))
            serial = SerialAdapter(line, ports.serial_pin)
        yield stack.enter_context(input_adapter(ports.board, ports.wiring, serial))


def begin(adapter: InputAdapter, segment: BenchRun) -> None:
    """Bring the chip's inputs to what they are at the beginning of a run, and load the run."""
    levels = [DrivePin(name, level) for name, level in segment.levels.items()]
    contacts = [Close(contact, closed) for contact, closed in segment.contacts.items()]
    lines = {
        input_.what.pin: input_.what for input_ in reversed(segment.inputs) if isinstance(input_.what, Send)
    }
    levels = [drive for drive in levels if drive.name not in lines]
    first: list[BoardInput] = []
    adapter.stop()
    if segment.start is BenchStart.POWER_UP:  # nothing may feed the chip through its pins
        adapter.release()
        adapter.apply([DrivePin(VDD, 0)])
        time.sleep(POWER_OFF_S)
        first = [BoardInput(0, DrivePin(VDD, 1)), *(BoardInput(0, drive) for drive in levels)]
    else:
        if segment.start is BenchStart.RESET:
            adapter.apply([DrivePin(MCLR, 0)])
            first = [BoardInput(0, DrivePin(MCLR, 1))]
        adapter.apply([*levels, *contacts])
        for pin, send in lines.items():
            adapter.listen(pin, send.baud)
    adapter.load([*first, *segment.inputs], ceil(1000 * segment.seconds))


def check_inputs(trace: EdgeTrace, segment: BenchRun, late_ms: int) -> None:
    """Raise ToolError where a capture does not show a level that the input board was to drive in time."""
    edges = join(trace.chunks)
    now = dict(segment.levels)
    inputs = sorted(segment.inputs, key=lambda input_: input_.at_ms)
    drives = ((input_.at_ms, input_.what) for input_ in inputs if isinstance(input_.what, DrivePin))
    # of several changes in one millisecond only the last is sure to be seen
    changes = {(ms, drive.name): drive.level for ms, drive in drives if drive.name in PINS}
    for (at_ms, name), level in changes.items():
        before, now[name] = now.get(name), level
        if None in (before, level) or before == level:
            continue
        if not late_ms < at_ms <= 1000 * segment.seconds:
            continue
        own = (edges.pin == PINS.index(name)) & (edges.level == level)
        times = [float(trace.clock.us(int(cycle))) / 1000 for cycle in edges.cycle[own]]
        if not any(abs(ms - at_ms) <= late_ms for ms in times):
            raise ToolError(
                "late-input",
                f"{name} did not become {level} at {at_ms} ms of the run, nor within {late_ms} ms of it",
                hint="is the input board wired to it, does nothing else drive it, is the computer too busy?",
            )


def uses_eeprom(image: Image) -> bool:
    """Return whether a program may write its data EEPROM, which then differs from the image's."""
    decoded = (decode(word) for word in image.program.values())
    return any(
        instruction is not None
        and instruction.instruction.writes_file(instruction.d)
        and instruction.f == EECON2 & 0x7F
        for instruction in decoded
    )


def captured(path: Path, source: str, wires: Mapping[str, str] | None = None) -> SeenPins:
    """Return an analyser's capture in a file."""
    capture = read_capture(path, wires)
    trace = capture.trace.stored()
    return SeenPins(trace, source, replace(capture, trace=trace), file=path)


def check(seen: SeenPins, schedule: PulseSchedule, tolerances: Tolerances | None = None) -> ScheduleCheck:
    """Return whether the pins did what the schedule says."""
    if seen.capture is not None:
        comparison = judge_capture(schedule, seen.capture, tolerances)
        return ScheduleCheck(
            comparison.passed,
            comparison.agrees,
            tuple(capture_lines(comparison)),
            tuple(_of_capture(comparison)),
        )
    if seen.span is None:
        tells_end = seen.file is not None and seen.file.suffix.lower() == ".vcd"
        verdict = judge_file(schedule, seen.trace, tells_end, hidden=seen.hidden)
    else:
        verdict = judge_edges(schedule, seen.trace, seen.span)
    end = compared_end(verdict)
    counted = (warning for warning in seen.warnings if end is None or warning_cycle(warning) < end)
    verdict = verdict.with_warnings(tuple(counted), CHIP_DEPENDENT)
    return ScheduleCheck(
        verdict.passed, verdict.agrees, tuple(verdict_lines(verdict)), tuple(_of_edges(verdict))
    )


def further(name: str, number: int) -> str:
    """Return the name of a test's recording; it has several where its chip was captured several times."""
    return f"{name}-{number + 1}" if number else name


def record(seen: SeenPins, path: Path) -> Path:
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
    yield "servogen_tolerances", verdict.tolerances.words()
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
