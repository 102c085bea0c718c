"""`Verdict`: whether observed edges are the scheduled ones, over what span, and if not, where and how they
differ.

All cycles are instruction cycles. `cycle` counts from reset, as the trace does; an error is observed minus
expected, so that late and long are positive.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

from servogen.edges import PINS
from servogen.errors import Diagnostic
from servogen.plan_error import PlanError
from servogen.units import Clock, Cycles
from servogen.verify.coverage import Coverage

AGREES = "agrees as far as it was seen"
"""The verdict where nothing that was seen is wrong, and not everything was seen."""


@dataclass(frozen=True, slots=True)
class Span:
    """What was compared, from the first scheduled edge on, and what was requested."""

    asked: Cycles
    compared: Cycles
    frames: int
    lead_in_frames: int
    loop_repeats: int
    """Whole frames, those of the lead-in among them, and whole repeats of the loop, in `compared`."""

    @property
    def whole(self) -> bool:
        return self.compared >= self.asked

    def to_json(self) -> dict[str, object]:
        return {
            "asked_cycles": self.asked,
            "compared_cycles": self.compared,
            "frames": self.frames,
            "lead_in_frames": self.lead_in_frames,
            "loop_repeats": self.loop_repeats,
        }


@dataclass(frozen=True, slots=True)
class Worst:
    """The largest of a set of errors in cycles, their number, and the frame and cycle of the largest."""

    error: int = 0
    count: int = 0
    frame: int | None = None
    cycle: Cycles | None = None

    def to_json(self) -> dict[str, object]:
        return {"error_cycles": self.error, "count": self.count, "frame": self.frame, "cycle": self.cycle}


@dataclass(frozen=True, slots=True)
class ChannelVerdict:
    """One channel: its pulses, and the worst errors of those that are paired with a scheduled one."""

    name: str
    pin: int
    scheduled: int
    observed: int
    missing: int = 0
    extra: int = 0
    glitches: int = 0
    width: Worst = Worst()
    period: Worst = Worst()
    """Rise to rise, against the schedule's."""
    edge: Worst = Worst()

    def to_json(self) -> dict[str, object]:
        return {
            "name": self.name,
            "pin": PINS[self.pin],
            "scheduled_pulses": self.scheduled,
            "observed_pulses": self.observed,
            "missing_pulses": self.missing,
            "extra_pulses": self.extra,
            "glitches": self.glitches,
            "worst_width": self.width.to_json(),
            "worst_period": self.period.to_json(),
            "worst_edge": self.edge.to_json(),
        }


@dataclass(frozen=True, slots=True)
class Difference:
    """The first edge that is not as scheduled. A cycle is None if that side never changes the pin in this
    way.
    """

    pin: int
    channel: str | None
    frame: int | None
    level: int
    expected: Cycles | None
    observed: Cycles | None

    @property
    def cycle(self) -> Cycles:
        """Return the cycle since reset at which the two first differ."""
        return min(cycle for cycle in (self.expected, self.observed) if cycle is not None)

    def to_json(self) -> dict[str, object]:
        return {
            "cycle": self.cycle,
            "pin": PINS[self.pin],
            "channel": self.channel,
            "frame": self.frame,
            "level": self.level,
            "expected_cycle": self.expected,
            "observed_cycle": self.observed,
        }


@dataclass(frozen=True, slots=True)
class Overlap:
    """Two pins high together that never are in the schedule: how often, the longest, and the first time."""

    count: int
    longest: Cycles
    first: Cycles
    pins: tuple[int, ...]

    def to_json(self) -> dict[str, object]:
        return {
            "count": self.count,
            "longest_cycles": self.longest,
            "first_cycle": self.first,
            "pins": [PINS[pin] for pin in self.pins],
        }


@dataclass(frozen=True, slots=True)
class StrayPin:
    """A pin that changes although the schedule does not drive it: how often, and when first."""

    pin: int
    edges: int
    first: Cycles

    def to_json(self) -> dict[str, object]:
        return {"pin": PINS[self.pin], "edges": self.edges, "first_cycle": self.first}


@dataclass(frozen=True, slots=True)
class Judgement:
    """What every verdict says: proven, or why not."""

    PROVEN: ClassVar[str] = "proven"

    proven: bool
    reasons: tuple[str, ...]
    """Why it is not proven, in sentences; empty when it is."""
    unseen: tuple[str, ...] = field(default=(), kw_only=True)
    """Those of the reasons that only say that not everything was seen."""

    @property
    def agrees(self) -> bool:
        """Return whether nothing that was seen is wrong."""
        return self.reasons == self.unseen

    @property
    def word(self) -> str:
        """Return the verdict in a few words."""
        if self.proven:
            return self.PROVEN
        return AGREES if self.agrees else "not proven"

    def accepted(self, partial: bool) -> bool:
        """Return whether it is proven, or at least, where `partial` is enough, nothing is wrong."""
        return self.proven or (partial and self.agrees)


@dataclass(frozen=True, slots=True)
class Verdict(Judgement):
    """`proven`: from reset to the end of the asked span the driven edges are the schedule's, on all pins.

    For a program, it also means that no warning is `chip_dependent`.

    `start` is the cycle of the first scheduled edge: reported, not judged; None when no scheduled pin rises.
    After a difference, the channels' errors cover the trace up to `span.compared`, which is then shortened if
    necessary.
    """

    clock: Clock
    start: Cycles | None
    span: Span
    channels: tuple[ChannelVerdict, ...]
    difference: Difference | None = None
    overlap: Overlap | None = None
    stray: tuple[StrayPin, ...] = ()
    plan_error: PlanError | None = None
    """How far the schedule itself is from the planned motion."""
    coverage: Coverage = field(default_factory=Coverage)
    """Which of the schedule's different frames were compared."""

    def not_all(self, reason: str) -> Verdict:
        """Return the same verdict, not proven also because of something that was not seen."""
        unseen = (*self.unseen, reason) if self.agrees else self.unseen
        return replace(self, proven=False, reasons=(*self.reasons, reason), unseen=unseen)

    warnings: tuple[Diagnostic, ...] = ()
    """Of the program that ran; edges alone have none."""
    chip_dependent: tuple[Diagnostic, ...] = ()
    """Those of the warnings by which other chips, or the same one at its next power-up, may make other edges.
    """

    @property
    def edges_agree(self) -> bool:
        """Return whether the observed edges are the schedule's, regardless of warnings."""
        others = len(self.chip_dependent) + len(self.unseen)
        return len(self.reasons) == others

    def with_warnings(
        self, warnings: tuple[Diagnostic, ...], chip_dependent: frozenset[str] = frozenset()
    ) -> Verdict:
        """Return this verdict for a program that ran with `warnings`; one whose code is among
        `chip_dependent` refutes it.
        """
        refuting = tuple(warning for warning in warnings if warning.code in chip_dependent)
        reasons = tuple(f"other chips may make other edges: {warning.sentence}" for warning in refuting)
        return replace(
            self,
            proven=self.proven and not reasons,
            reasons=self.reasons + reasons,
            warnings=warnings,
            chip_dependent=refuting,
        )

    @property
    def worst_edge_error(self) -> int:
        """Return the absolute value of the largest edge error of any channel, in cycles."""
        return max((abs(channel.edge.error) for channel in self.channels), default=0)

    def to_json(self) -> dict[str, object]:
        """Return plain values for a JSON file."""
        return {
            "proven": self.proven,
            "verdict": self.word,
            "reasons": list(self.reasons),
            "clock_hz": self.clock.hz,
            "start_cycle": self.start,
            "span": self.span.to_json(),
            **self.coverage.to_json(),
            "channels": [channel.to_json() for channel in self.channels],
            "first_difference": self.difference.to_json() if self.difference else None,
            "overlap": self.overlap.to_json() if self.overlap else None,
            "stray_pins": [stray.to_json() for stray in self.stray],
            "warnings": [
                {**warning.to_json(), "chip_dependent": warning in self.chip_dependent}
                for warning in self.warnings
            ],
            "plan_error": self.plan_error.to_json() if self.plan_error else None,
        }
