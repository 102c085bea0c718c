"""Captures the chip's pins with a logic analyser for as long as the schedule requires, stitched if necessary.

In: the analyser's port, the schedule to be captured, if any, and the settings. Out: a capture file and facts
about it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

from servogen.bench.analysers.memory import (
    MIN_EDGES,
    TYPICAL_EDGES,
    TYPICAL_PERIOD_S,
    CaptureNeeds,
    CapturePlan,
    plan,
)
from servogen.bench.analysers.recording import (
    SampleRecord,
    Stitched,
    check_name,
    edges,
    stitch,
    stitched,
    write_capture,
)
from servogen.bench.analysers.sigrok import SigrokLook, sigrok_wires
from servogen.bench.analysers.sigrok import capture as sigrok_capture
from servogen.bench.analysers.sump import WIDE_BITS, WORD_BITS, wired_channel, wires
from servogen.bench.analysers.sump_client import (
    BAUD,
    AnalyserDescription,
    ReceivedSamples,
    SampleRequest,
    identify,
)
from servogen.bench.analysers.sump_client import capture as sump_capture
from servogen.bench.ports import Port, open_port
from servogen.edges import CHIP_MARKS, PAIR_NAMES, PIN_NAMES
from servogen.errors import Location, ToolError
from servogen.pulse import PulseSchedule, Run
from servogen.pulse.expected import expected
from servogen.traces.sigrok import read_session
from servogen.verify import Sampling, Tolerances

if TYPE_CHECKING:
    from servogen.answers import CaptureAnswer, SigrokAnswer

RATE = 1_000_000
SECONDS = 1.0
SLACK = 1.25
PATIENCE_S = 5.0
"""The time to wait in addition to the duration of the capture itself."""
MAX_DRIFT = Fraction(1, 1000)
"""The maximum slowness of a chip's crystal for which a capture is still long enough."""
BYTE_EDGES = 28
"""The changes of SCL and SDA in a byte with its acknowledge, at most: nine clocks, and SDA around each."""
SUMP_DRIVER = "ols"
"""sigrok's only driver that can count equal samples."""

Progress = Callable[[str, int], AbstractContextManager[Callable[[int], None]]]
"""(label, total) -> a context in which a function is called with the amount done so far."""


@contextmanager
def silent(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """Yield a function that shows no progress."""
    yield lambda completed: None


@dataclass(frozen=True, slots=True)
class CaptureSettings:
    """The settings of a capture."""

    rate: int = RATE
    """Samples per second."""
    fixed_rate: bool = True
    """Whether that rate is wanted, rather than one at which everything fits the analyser's memory."""
    rle: bool = True
    """Whether the analyser may count equal samples."""
    memory: int | None = None
    """The analyser's memory in bytes; None: as much as the analyser reports."""
    trigger: str | None = None
    """The pin whose rising edge begins the capture; None: the first servo's."""
    wire: Sequence[str] = ()
    """CHANNEL=PIN where the wiring is not the default."""
    stitch: bool = True
    """Whether several captures may be joined if one is too short."""
    triggered: bool = True
    """Whether the capture waits for the trigger, or begins at once."""
    trigger_channel: int | None = None
    """The analyser's channel whose rising edge begins the capture, instead of a pin's."""
    armed: Callable[[], None] = lambda: None
    """Called when the analyser waits for the trigger."""


@dataclass(frozen=True, slots=True)
class Captured:
    """A complete capture, written to a file."""

    path: Path
    analyser: AnalyserDescription
    plan: CapturePlan
    seen: Stitched

    @property
    def captures(self) -> int:
        """Return the number of captures that were stitched."""
        return len(self.seen.records)

    @property
    def seconds(self) -> float:
        """Return the captured time, without the gaps between captures."""
        return sum(record.end for record in self.seen.records) / float(self.plan.rate)

    def to_json(self) -> CaptureAnswer:
        return {
            "file": str(self.path),
            "analyser": self.analyser.name,
            "memory_bytes": self.analyser.memory,
            "samples_per_second": int(self.plan.rate),
            "rle": self.plan.rle,
            "seconds": self.seconds,
            "captures": self.captures,
        }


@dataclass(frozen=True, slots=True)
class SigrokCaptured:
    """A capture that sigrok-cli wrote."""

    path: Path
    look: SigrokLook
    samples: int
    """The number of samples in the session, which may be fewer than were asked for."""
    rate: Fraction
    """Samples per second, as the session states it."""
    wanted_s: float
    """The duration of what was to be recorded."""

    @property
    def seconds(self) -> float:
        return float(self.samples / self.rate)

    @property
    def shortage(self) -> str | None:
        """Return what is missing; None if everything was recorded."""
        if self.seconds >= self.wanted_s:
            return None
        return (
            f"{self.look.driver} returned {self.samples} of {self.look.samples} samples: "
            f"{self.seconds:.3g} of {self.wanted_s:.3g} s"
        )

    def to_json(self) -> SigrokAnswer:
        return {
            "file": str(self.path),
            "analyser": self.look.driver,
            "samples_per_second": float(self.rate),
            "seconds": self.seconds,
            "wanted_seconds": self.wanted_s,
        }


def capture(
    output: Path,
    port: str,
    schedule: PulseSchedule | None = None,
    seconds: float | None = None,
    looking: CaptureSettings = CaptureSettings(),
    progress: Progress = silent,
    second: PulseSchedule | None = None,
) -> Captured:
    """Capture the pins for `seconds`, by default for the schedule's whole loop, and write the capture; with
    the schedule of a `second` chip those of both, in one capture.

    Raises InputError for a request that would show nothing, ToolError if the analyser fails; the data that it
    sent until then are kept beside `output`.
    """
    wanted, pair = capture_needs(schedule, seconds), second is not None
    if second is not None:
        wanted = wanted.beside(capture_needs(second, seconds))
    if schedule is not None:
        check_rate(looking.rate)
    check_name(output)
    wired = wires(looking.wire, pair)
    bits = WIDE_BITS if pair else WORD_BITS
    first = f"{CHIP_MARKS[0] if pair else ''}{schedule.channels[0].pin if schedule else 'RB0'}"
    pin = looking.trigger or first
    channel = looking.trigger_channel
    if channel is None and looking.triggered:
        channel = wired_channel(pin, wired, pair)
    with open_port(port, BAUD) as line:
        device = identify(line)
        several = looking.stitch and schedule is not None and not pair
        fastest = min(looking.rate, device.fastest or looking.rate)
        if schedule is not None:
            check_rate(fastest)
        planned = plan(looking.memory or device.memory, fastest, looking.rle, wanted, several, bits)
        look = partial(_look, line, channel=channel, armed=looking.armed, progress=progress, bits=bits)
        seen = _looks(look, planned, wanted.frames, wired, None if pair else schedule, seconds is None)
    servos = {channel.pin: channel.name for channel in schedule.channels} if schedule and not pair else {}
    names = {pin: PAIR_NAMES[pin] for pin in sorted(wired.values())} if pair else PIN_NAMES
    whole = stitched(seen.records, int(planned.rate))
    path = write_capture(output, int(planned.rate), whole, servos, seen.missing, names)
    if seen.missing is not None:
        raise ToolError(
            "capture-failed",
            seen.missing,
            Location(port),
            f"the incomplete capture is kept in {path}",
        )
    return Captured(path, device, planned, seen)


def capture_by_sigrok(
    output: Path,
    driver: str,
    schedule: PulseSchedule | None = None,
    seconds: float | None = None,
    looking: CaptureSettings = CaptureSettings(),
) -> SigrokCaptured:
    """Capture the pins through sigrok-cli, for `seconds` or the schedule's whole loop.

    The capture is two frames longer, because sigrok may begin anywhere in a frame, and allows for a slow
    crystal. If fewer samples come back, the analyser's memory is taken to hold no more: unless the rate is
    fixed, it is captured again at the fastest usual rate at which everything fits, if there is one. Raises
    InputError for a request that shows nothing, ToolError if sigrok-cli fails.
    """
    if schedule is not None:
        check_rate(looking.rate)
    wanted = capture_needs(schedule, seconds)
    longest_s = (wanted.frames + 2) * wanted.period_s * (1 + MAX_DRIFT)
    counts_equal_samples = looking.rle and driver.partition(":")[0] == SUMP_DRIVER
    look = SigrokLook(
        driver=driver,
        rate=looking.rate,
        samples=ceil(looking.rate * longest_s),
        wires=sigrok_wires(looking.wire),
        rle=counts_equal_samples,
    )
    wanted_s = float(wanted.frames * wanted.period_s)
    captured = _by_sigrok(look, output, wanted_s)
    slower = [rate for rate in USUAL_RATES if rate < look.rate and rate * longest_s <= captured.samples]
    if captured.shortage and slower and not looking.fixed_rate and not counts_equal_samples:
        again = replace(look, rate=slower[0], samples=ceil(slower[0] * longest_s))
        return _by_sigrok(again, output, wanted_s)
    return captured


USUAL_RATES = (500_000, 250_000, 200_000, 100_000)
"""Slower rates that many analysers have, all of which `verify` accepts; fastest first."""


def _by_sigrok(look: SigrokLook, output: Path, wanted_s: float) -> SigrokCaptured:
    sigrok_capture(look, output)
    trace = read_session(output)
    return SigrokCaptured(output, look, int(trace.end), trace.clock.cycles_per_second, wanted_s)


def check_rate(rate: int) -> None:
    """Raise InputError if a capture at this rate (samples per second) would show nothing."""
    Sampling(1e6 / rate, True).check(Tolerances().glitch_us, Location(key="--rate"))


def _looks(
    look: Callable[[CapturePlan, str], ReceivedSamples],
    planned: CapturePlan,
    frames: int,
    wired: Mapping[int, int],
    schedule: PulseSchedule | None,
    whole_loop: bool,
) -> Stitched:
    """Return one capture or, if it is too short, as many as are needed."""
    if schedule is None or planned.frames >= frames:
        seen = look(planned, "capture")
        return Stitched((SampleRecord(edges(seen.runs, wired), seen.runs.end),), seen.missing, 0)
    about = -(-frames // planned.frames)
    return stitch(
        lambda plan, number: look(plan, f"capture {number} of about {about}"),
        planned,
        frames,
        whole_loop,
        expected(schedule),
        wired,
    )


def _look(
    line: Port,
    planned: CapturePlan,
    label: str,
    *,
    channel: int | None,
    armed: Callable[[], None],
    progress: Progress,
    bits: int,
) -> ReceivedSamples:
    patience = SLACK * float(planned.seconds) + PATIENCE_S
    look = SampleRequest(
        rate=planned.rate,
        words=planned.words,
        rle=planned.rle,
        channel=channel,
        patience_s=patience,
        bits=bits,
    )
    with progress(label, planned.words) as completed:
        return sump_capture(line, look, completed, armed)


def capture_needs(schedule: PulseSchedule | None, seconds: float | None) -> CaptureNeeds:
    """Return what is to be captured: by default the whole loop of the schedule, and a lead-in before it."""
    if schedule is None:
        frames = ceil(_exact(seconds or SECONDS) / TYPICAL_PERIOD_S)
        return CaptureNeeds(
            period_s=TYPICAL_PERIOD_S,
            edges=Fraction(TYPICAL_EDGES),
            frames=frames,
            fewest=Fraction(MIN_EDGES),
            most=TYPICAL_EDGES,
        )
    period = schedule.clock.seconds(schedule.period)
    loop, maximum = _moments(schedule.loop)
    begin, more = _moments(schedule.lead_in)
    # The analyser's channels are also on the bus of a tape: at most a full record, and the way back to it.
    bus = 0 if schedule.tape is None else BYTE_EDGES * (2 * len(schedule.channels) + 8)
    edges, frames = (
        (max(loop, begin), schedule.lead_in_frames + schedule.loop_frames)
        if seconds is None
        else (Fraction(max(maximum, more)), ceil(_exact(seconds) / period))
    )
    return CaptureNeeds(
        period_s=period,
        edges=edges + bus,
        frames=frames,
        fewest=min(loop, begin or loop),
        most=max(maximum, more) + bus,
    )


def _moments(runs: Sequence[Run]) -> tuple[Fraction, int]:
    """Return the mean (at least a tenth) and the maximum number of times at which a pin changes in a frame.

    Without frames both are 0.
    """
    moments = [
        (run.frames, len({time for p in run.pulses if p for time in (p.rise, p.rise + p.width)}))
        for run in runs
    ]
    if not moments:
        return Fraction(0), 0
    total = sum(frames * edges for frames, edges in moments)
    mean = max(Fraction(1, 10), Fraction(total, sum(frames for frames, _ in moments)))
    return mean, max(1, *(edges for _, edges in moments))


def _exact(seconds: float) -> Fraction:
    """Return the decimal number that was typed, without the error of its binary representation."""
    return Fraction(str(seconds))
