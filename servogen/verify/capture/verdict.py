"""`CaptureVerdict`: whether captured pulses are the scheduled ones within given tolerances, and its text.

Times are in microseconds of the chip's nominal clock: they are corrected for the crystal's error, which is
determined from the capture itself. An error is measured minus scheduled. `scheduled` and `captured` count
complete pulses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

from servogen.edges import PINS
from servogen.errors import Diagnostic
from servogen.plan_error import PlanError, plan_text
from servogen.units import counted
from servogen.verify.capture.alignment import FittedLine, WholeFrames
from servogen.verify.coverage import Coverage
from servogen.verify.verdict import Judgement, StrayPin, unseen_reason

if TYPE_CHECKING:
    from servogen.answers import (
        CapturedChannelAnswer,
        CaptureVerdictAnswer,
        MismatchAnswer,
        PieceAnswer,
        SpreadAnswer,
    )


@dataclass(frozen=True, slots=True)
class Tolerances:
    """The tolerances beyond one sample of the analyser, which limits every measurement."""

    width_us: float = 0.1
    period_us: float = 0.1
    edge_us: float = 0.5
    """The deviation of a single edge from the line through all edges."""
    crystal_ppm: float = 300.0
    """The deviation of the chip's crystal and the analyser's together."""
    glitch_us: float = 10.0
    """Pulses and gaps shorter than this are glitches, unless the schedule has some as short.

    A sample may not be longer: a slower analyser shows nothing.
    """

    def words(self) -> str:
        return (
            f"a sample and {self.width_us:g} µs of width, {self.period_us:g} µs of period and "
            f"{self.edge_us:g} µs of edge"
        )


@dataclass(frozen=True, slots=True)
class Spread:
    """A set of errors: the worst with its sign, their mean, and the number outside the tolerance."""

    worst_us: float = 0.0
    mean_us: float = 0.0
    wrong: int = 0

    def to_json(self) -> SpreadAnswer:
        return {"worst_us": self.worst_us, "mean_us": self.mean_us, "not_allowed": self.wrong}


@dataclass(frozen=True, slots=True)
class CapturedChannel:
    """One channel of the capture; `jitter_us` is the root mean square error of its rises."""

    name: str
    pin: int
    connected: bool
    scheduled: int = 0
    captured: int = 0
    missing: int = 0
    extra: int = 0
    glitches: int = 0
    width: Spread = Spread()
    period: Spread = Spread()
    edge: Spread = Spread()
    mean_period_us: float | None = None
    jitter_us: float = 0.0

    def to_json(self) -> CapturedChannelAnswer:
        return {
            "name": self.name,
            "pin": PINS[self.pin],
            "connected": self.connected,
            "scheduled_pulses": self.scheduled,
            "captured_pulses": self.captured,
            "missing_pulses": self.missing,
            "extra_pulses": self.extra,
            "glitches": self.glitches,
            "width_error": self.width.to_json(),
            "period_error": self.period.to_json(),
            "edge_error": self.edge.to_json(),
            "mean_period_us": self.mean_period_us,
            "jitter_us": self.jitter_us,
        }


@dataclass(frozen=True, slots=True)
class Mismatch:
    """Where the capture is not as scheduled, `time_us` after its beginning by the analyser's clock."""

    time_us: float
    pin: int
    channel: str
    frame: int | None
    diagnostic: Diagnostic

    def to_json(self) -> MismatchAnswer:
        return {
            "time_us": self.time_us,
            "pin": PINS[self.pin],
            "channel": self.channel,
            "frame": self.frame,
            **self.diagnostic.to_json(),
        }


@dataclass(frozen=True, slots=True)
class CapturePiece:
    """One of several captures in one file, judged separately; times are those of the file, in µs of the
    analyser.
    """

    begin_us: float
    duration_us: float
    first_frame: int | None
    frames: int
    ppm: float | None
    ppm_error: float | None
    paired: int

    def to_json(self) -> PieceAnswer:
        return {
            "begin_us": self.begin_us,
            "duration_us": self.duration_us,
            "first_frame": self.first_frame,
            "frames": self.frames,
            "crystal_ppm": self.ppm,
            "crystal_error_ppm": self.ppm_error,
        }


@dataclass(frozen=True, slots=True)
class CaptureVerdict(Judgement):
    """`agrees`: every different frame was captured, and everything captured matches the schedule within
    `tolerances`.

    For several captures in one file, whose distance in time is not known, `pieces` holds each, and the
    figures are those of all together.
    """

    WORD: ClassVar[str] = "agrees"
    NOT: ClassVar[str] = "does not agree"

    tolerances: Tolerances
    sample_us: float
    duration_us: float
    ppm: float | None
    """The deviation of the chip's clock from its nominal frequency, by the analyser's clock."""
    ppm_error: float | None
    """Its standard error."""
    first_frame: int | None
    """The schedule's frame that the first whole pulse belongs to."""
    frames: int
    """Frames from the first to the last pulse."""
    channels: tuple[CapturedChannel, ...]
    first_mismatch: Mismatch | None = None
    """The first in time."""
    stray: tuple[StrayPin, ...] = ()
    overlap_us: float = 0.0
    """The time for which pins are high together that never are in the schedule."""
    paired: int = 0
    """The number of pulses that belong to scheduled ones."""
    whole: WholeFrames | None = None
    """The frames that the capture contains completely; None for several captures."""
    line: FittedLine | None = None
    """Where the scheduled edges, counted from the first one, lie in the capture; None where none was found,
    and for several captures.
    """
    coverage: Coverage = field(default_factory=Coverage)
    """Which of the schedule's different frames were seen completely."""
    pieces: tuple[CapturePiece, ...] = ()
    plan_error: PlanError | None = None
    """The deviation of the schedule itself from the planned motion."""

    def but(self, reason: str) -> CaptureVerdict:
        """Return the same verdict, not passed because of `reason`, which comes first."""
        return replace(self, passed=False, reasons=(reason, *self.reasons))

    def to_json(self) -> CaptureVerdictAnswer:
        """Return plain values for a JSON file."""
        allowed = self.tolerances
        return {
            "agrees": self.passed,
            "verdict": self.word,
            "reasons": list(self.reasons),
            "tolerances": {
                "width_us": allowed.width_us,
                "period_us": allowed.period_us,
                "edge_us": allowed.edge_us,
                "crystal_ppm": allowed.crystal_ppm,
                "glitch_us": allowed.glitch_us,
            },
            "sample_us": self.sample_us,
            "duration_us": self.duration_us,
            "crystal_ppm": self.ppm,
            "crystal_error_ppm": self.ppm_error,
            "first_frame": self.first_frame,
            "frames": self.frames,
            **self.coverage.to_json(),
            "pieces": [piece.to_json() for piece in self.pieces],
            "channels": [channel.to_json() for channel in self.channels],
            "first_mismatch": self.first_mismatch.to_json() if self.first_mismatch else None,
            "stray_pins": [PINS[stray.pin] for stray in self.stray],
            "plan_error": self.plan_error.to_json() if self.plan_error else None,
        }


MIN_PULSES = 2
"""The number of scheduled pulses that a verdict on one capture needs."""

CLOCK_PPM = 5.0
"""The allowed difference between the clocks of several captures, in addition to four standard errors."""


def with_reasons(verdict: CaptureVerdict) -> CaptureVerdict:
    """Return the verdict: it agrees if nothing speaks against it and every different frame was seen."""
    why = tuple(_reasons(verdict))
    unseen = () if why or verdict.coverage.complete else (unseen_reason(verdict.coverage),)
    return replace(verdict, passed=not why and not unseen, reasons=why or unseen, unseen=unseen)


def _reasons(verdict: CaptureVerdict) -> Iterator[str]:
    if verdict.pieces:
        for number, piece in enumerate(verdict.pieces, 1):
            if not piece.paired:
                yield f"piece {number} holds none of the schedule's pulses"
    elif verdict.paired < MIN_PULSES:
        yield "the capture holds too few of the schedule's pulses to be judged"
    if verdict.first_mismatch:
        first = verdict.first_mismatch
        yield f"first at {first.time_us / 1e6:z.6f} s{_of_piece(verdict)}, {first.diagnostic.message}"
    for channel in verdict.channels:
        yield from _channel_reasons(channel)
    if verdict.overlap_us:
        yield f"pulses overlap where the schedule has none together, for at most {verdict.overlap_us:z.2f} µs"
    for stray in verdict.stray:
        name = PINS[stray.pin]
        yield f"{name}, which the schedule does not drive, changes {counted(stray.edges, 'time')}"
    if verdict.ppm is None or verdict.ppm_error is None:
        return
    allowed = verdict.tolerances.crystal_ppm
    if abs(verdict.ppm) > allowed + 2 * verdict.ppm_error:
        yield f"the chip's clock is off by {verdict.ppm:+z.1f} ppm, allowed ±{allowed:g} ppm"
    for number, piece in enumerate(verdict.pieces, 1):
        if _differs(piece, verdict.ppm):
            yield (
                f"by piece {number} alone the chip's clock is off by {piece.ppm:+z.1f} ppm, "
                f"by all {verdict.ppm:+z.1f} ppm: its periods are not those of the others"
            )


def _of_piece(verdict: CaptureVerdict) -> str:
    """Return which piece the first mismatch is in."""
    if not verdict.pieces or verdict.first_mismatch is None:
        return ""
    time = verdict.first_mismatch.time_us
    return f" (piece {sum(piece.begin_us <= time for piece in verdict.pieces)})"


def _differs(piece: CapturePiece, ppm: float) -> bool:
    if piece.ppm is None or piece.ppm_error is None:
        return False
    return abs(piece.ppm - ppm) > CLOCK_PPM + 4 * piece.ppm_error


def _channel_reasons(channel: CapturedChannel) -> list[str]:
    """Return the problems of the channel as a whole."""
    who = f"{PINS[channel.pin]} ({channel.name})"
    if not channel.connected:
        return [f"{who} was not captured: no wire of the capture is {PINS[channel.pin]}"]
    counts = (
        (channel.missing, "missing pulse"),
        (channel.extra, "extra pulse"),
        (channel.glitches, "glitch"),
    )
    facts = [counted(number, noun) for number, noun in counts if number]
    for spread, noun in ((channel.width, "width"), (channel.period, "period"), (channel.edge, "edge")):
        if spread.wrong and not (noun == "edge" and facts):
            facts.append(f"{counted(spread.wrong, f'wrong {noun}')}, worst {spread.worst_us:+z.2f} µs")
    return [f"{who}: {', '.join(facts)}"] if facts else []


def capture_lines(verdict: CaptureVerdict) -> list[str]:
    """Return lines without colour; the first says whether the capture agrees, the last ones why not."""
    return capture_summary(verdict) + [f"- {reason}" for reason in verdict.reasons]


def capture_summary(verdict: CaptureVerdict) -> list[str]:
    """Return the lines without the reasons."""
    seconds = verdict.duration_us / 1e6
    within = f"within {verdict.tolerances.words()}; " if verdict.agrees else ""
    first = "" if verdict.first_frame is None else f" from frame {verdict.first_frame} on"
    lines = [
        f"{_headline(verdict)}{counted(verdict.frames, 'frame')}{first} in {seconds:g} s, "
        f"a sample every {verdict.sample_us:g} µs; {within}{plan_text(verdict.plan_error)}",
        _clock_words(verdict),
    ]
    if verdict.pieces:
        lines.append(_seams_words(verdict))
    if verdict.agrees:
        lines.append(_seen_words(verdict.coverage))
    lines += [_channel_line(channel) for channel in verdict.channels if channel.connected]
    return lines


def _headline(verdict: CaptureVerdict) -> str:
    """Return the beginning of the first line."""
    return f"{verdict.word}: {verdict.coverage.words()}; " if verdict.agrees else "does NOT agree: "


def _seen_words(coverage: Coverage) -> str:
    """Return how much of the schedule was seen completely."""
    whose, seen = "schedule" if coverage.once else "loop", len(coverage.seen)
    different = counted(len(coverage.different), "different frame")
    words = f"of the {whose}'s {different} {seen} {'was' if seen == 1 else 'were'} seen whole"
    if len(coverage.loop_seen) < coverage.loop_frames and not coverage.once:
        words += f", in {len(coverage.loop_seen)} of its {counted(coverage.loop_frames, 'frame')}"
    if coverage.lead_in:
        words += (
            f"; of the {counted(len(coverage.lead_in), 'different frame')} that only the lead-in has, "
            f"{len(coverage.lead_in_seen)}: the verdict is on the loop"
        )
    return words


def _seams_words(verdict: CaptureVerdict) -> str:
    return (
        f"stitched from {len(verdict.pieces)} captures: the time between two is not known; each is aligned "
        "to the schedule by itself, and nothing is measured across a seam"
    )


def _clock_words(verdict: CaptureVerdict) -> str:
    if verdict.ppm is None:
        return "the capture is too short to measure the chip's clock: its nominal frequency is assumed"
    return (
        f"the chip's clock is {abs(verdict.ppm):z.1f} ± {verdict.ppm_error:z.1f} ppm "
        f"{'fast' if verdict.ppm >= 0 else 'slow'}; what follows is corrected for it"
    )


def _channel_line(channel: CapturedChannel) -> str:
    count = counted(channel.captured, "pulse")
    if channel.captured != channel.scheduled:
        count += f" of {channel.scheduled}"
    words = (
        f"{PINS[channel.pin]} {channel.name}: {count}; "
        f"width error {channel.width.worst_us:+z.2f} µs at most, "
        f"{channel.width.mean_us:+z.2f} µs on average; jitter {channel.jitter_us:z.2f} µs"
    )
    if channel.mean_period_us is None:
        return words
    return f"{words}; period {channel.mean_period_us:z.2f} µs, {channel.period.worst_us:+z.2f} µs at most"
