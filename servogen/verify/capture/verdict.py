"""`CaptureVerdict`: whether captured pulses are the scheduled ones within given tolerances.

Times are in microseconds of the chip's nominal clock: they are corrected for the crystal's error, which is
determined from the capture itself. An error is measured minus scheduled. `scheduled` and `captured` count
complete pulses.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

from servogen.edges import PINS
from servogen.errors import Diagnostic
from servogen.plan_error import PlanError
from servogen.verify.capture.frames import WholeFrames
from servogen.verify.coverage import Coverage
from servogen.verify.verdict import Judgement, StrayPin


@dataclass(frozen=True, slots=True)
class Tolerances:
    """The tolerances beyond one sample of the analyser, which limits every measurement."""

    width_us: float = 0.1
    period_us: float = 0.1
    edge_us: float = 0.5
    """Of a single edge against the line through all edges."""
    crystal_ppm: float = 300.0
    """Of the chip's crystal and the analyser's together."""
    glitch_us: float = 10.0
    """Pulses and gaps shorter than this are glitches, where the schedule has none as short.

    A sample may be no longer: a slower analyser proves nothing.
    """


@dataclass(frozen=True, slots=True)
class Spread:
    """A set of errors: the worst with its sign, their mean, and the number outside the tolerance."""

    worst_us: float = 0.0
    mean_us: float = 0.0
    wrong: int = 0

    def to_json(self) -> dict[str, object]:
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

    def to_json(self) -> dict[str, object]:
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

    def to_json(self) -> dict[str, object]:
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

    def to_json(self) -> dict[str, object]:
        return {
            "begin_us": self.begin_us,
            "duration_us": self.duration_us,
            "first_frame": self.first_frame,
            "frames": self.frames,
            "crystal_ppm": self.ppm,
            "crystal_ppm_error": self.ppm_error,
        }


@dataclass(frozen=True, slots=True)
class CaptureVerdict(Judgement):
    """`proven`: every different frame was captured, and everything captured matches the schedule within
    `tolerances`.

    For several captures in one file, whose distance in time is not known, `pieces` holds each, and the
    figures are those of all together.
    """

    PROVEN: ClassVar[str] = "proven within tolerances"

    tolerances: Tolerances
    sample_us: float
    duration_us: float
    ppm: float | None
    """By how much the chip's clock is faster than its nominal, as the analyser's clock has it."""
    ppm_error: float | None
    """One standard error of it."""
    first_frame: int | None
    """The schedule's frame that the first whole pulse belongs to."""
    frames: int
    """Frames from the first to the last pulse."""
    channels: tuple[CapturedChannel, ...]
    first_mismatch: Mismatch | None = None
    """The first in time."""
    stray: tuple[StrayPin, ...] = ()
    overlap_us: float = 0.0
    """How long pins are high together that the schedule never has so."""
    paired: int = 0
    """Pulses that belong to scheduled ones."""
    whole: WholeFrames | None = None
    """The frames that are in it from the first to the last edge; of several captures, None."""
    coverage: Coverage = field(default_factory=Coverage)
    """Which of the schedule's different frames were seen whole."""
    pieces: tuple[CapturePiece, ...] = ()
    plan_error: PlanError | None = None
    """How far the schedule itself is from the planned motion."""

    def but(self, reason: str) -> CaptureVerdict:
        """Return the same verdict, not proven because of `reason`, which comes first."""
        return replace(self, proven=False, reasons=(reason, *self.reasons))

    def to_json(self) -> dict[str, object]:
        """Return plain values for a JSON file."""
        allowed = self.tolerances
        return {
            "proven": self.proven,
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
            "crystal_ppm_error": self.ppm_error,
            "first_frame": self.first_frame,
            "frames": self.frames,
            **self.coverage.to_json(),
            "pieces": [piece.to_json() for piece in self.pieces],
            "channels": [channel.to_json() for channel in self.channels],
            "first_mismatch": self.first_mismatch.to_json() if self.first_mismatch else None,
            "stray_pins": [PINS[stray.pin] for stray in self.stray],
            "plan_error": self.plan_error.to_json() if self.plan_error else None,
        }
