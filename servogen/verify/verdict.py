"""`Verdict`: whether observed edges are the scheduled ones, over what span, and if not, where and how they
differ; its reasons as sentences, and the whole as plain lines.

All cycles are instruction cycles. `cycle` counts from reset, as the trace does; an error is observed minus
expected, so that late and long are positive.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

from servogen.edges import HIGH, PINS, Expected
from servogen.errors import Diagnostic
from servogen.plan_error import PlanError, plan_text
from servogen.units import Clock, Cycles, counted
from servogen.verify.coverage import Coverage

if TYPE_CHECKING:
    from servogen.answers import (
        ChannelAnswer,
        DifferenceAnswer,
        OverlapAnswer,
        SpanAnswer,
        StrayPinAnswer,
        VerdictAnswer,
        WorstAnswer,
    )


@dataclass(frozen=True, slots=True)
class ComparedSpan:
    """What was compared, from the first scheduled edge on, and what was requested."""

    asked: Cycles
    compared: Cycles
    frames: int
    lead_in_frames: int
    loop_repeats: int
    """`compared` contains this many whole frames, those of the lead-in included, and whole repeats of the
    loop.
    """
    others: tuple[int, ...] = ()
    """The pins that were not compared: the program moves them for something else."""

    @property
    def whole(self) -> bool:
        return self.compared >= self.asked

    def to_json(self) -> SpanAnswer:
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

    def to_json(self) -> WorstAnswer:
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
    """The time from rise to rise, compared with the schedule's."""
    edge: Worst = Worst()

    def to_json(self) -> ChannelAnswer:
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

    def to_json(self) -> DifferenceAnswer:
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

    def to_json(self) -> OverlapAnswer:
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

    def to_json(self) -> StrayPinAnswer:
        return {"pin": PINS[self.pin], "edges": self.edges, "first_cycle": self.first}


@dataclass(frozen=True, slots=True)
class Judgement:
    """What all verdicts on edges have in common: passed, or why not.

    They are about the edges that were compared. That every chip makes them is a theorem, of `servogen.prove`.
    """

    WORD: ClassVar[str] = "passed"
    NOT: ClassVar[str] = "not passed"

    passed: bool
    """Whether all that was asked for was compared, and nothing differs."""
    reasons: tuple[str, ...]
    """The reasons why it is not passed, as sentences; empty if it is."""
    unseen: tuple[str, ...] = field(default=(), kw_only=True)
    """Those of the reasons that only say that not everything was seen."""

    @property
    def agrees(self) -> bool:
        """Return whether nothing that was seen is wrong."""
        return self.reasons == self.unseen

    @property
    def word(self) -> str:
        """Return the verdict in a few words."""
        if self.passed:
            return self.WORD
        return f"{self.WORD} as far as it was seen" if self.agrees else self.NOT

    def accepted(self, partial: bool) -> bool:
        """Return whether it is passed, or at least, where `partial` is enough, nothing is wrong."""
        return self.passed or (partial and self.agrees)


@dataclass(frozen=True, slots=True)
class Verdict(Judgement):
    """`exact`: from reset to the end of the asked span, every driven edge of this run is the schedule's, in
    its cycle, on all pins.

    For a program, it also means that no warning is `chip_dependent`.

    `start` is the cycle of the first scheduled edge: reported, not judged; None when no scheduled pin rises.
    After a difference, the channels' errors cover the trace up to `span.compared`, which is then shortened if
    necessary.
    """

    WORD: ClassVar[str] = "exact"
    NOT: ClassVar[str] = "not exact"

    clock: Clock
    start: Cycles | None
    span: ComparedSpan
    channels: tuple[ChannelVerdict, ...]
    difference: Difference | None = None
    overlap: Overlap | None = None
    stray: tuple[StrayPin, ...] = ()
    plan_error: PlanError | None = None
    """The deviation of the schedule itself from the planned motion."""
    coverage: Coverage = field(default_factory=Coverage)
    """Which of the schedule's different frames were compared."""

    def __repr__(self) -> str:
        return f"<Verdict: {self.word}>"

    def not_all(self, reason: str) -> Verdict:
        """Return the same verdict, not exact because of something that was not seen, too."""
        unseen = (*self.unseen, reason) if self.agrees else self.unseen
        return replace(self, passed=False, reasons=(*self.reasons, reason), unseen=unseen)

    warnings: tuple[Diagnostic, ...] = ()
    """The warnings of the program that ran; edges alone have none."""
    chip_dependent: tuple[Diagnostic, ...] = ()
    """The warnings of behaviour that differs between chips, or at the next power-up of the same chip."""

    @property
    def edges_agree(self) -> bool:
        """Return whether the observed edges are the schedule's, regardless of warnings."""
        explained = len(self.chip_dependent) + len(self.unseen)
        return len(self.reasons) == explained

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
            passed=self.passed and not reasons,
            reasons=self.reasons + reasons,
            warnings=warnings,
            chip_dependent=refuting,
        )

    @property
    def worst_edge_error(self) -> int:
        """Return the absolute value of the largest edge error of any channel, in cycles."""
        return max((abs(channel.edge.error) for channel in self.channels), default=0)

    def to_json(self) -> VerdictAnswer:
        """Return plain values for a JSON file."""
        return {
            "exact": self.passed,
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


_MOTION = {True: "rise", False: "fall"}


def frame_words(frame: int, lead_in: int, loop: int) -> str:
    """Return `frame 7 (of the lead-in)`, `frame 512 (frame 12 of repeat 1 of the loop)`; all counted
    from 0.
    """
    if frame < lead_in:
        return f"frame {frame} (of the lead-in)"
    repeat, inside = divmod(frame - lead_in, loop) if loop else (0, frame)
    if inside == frame:
        return f"frame {frame}"
    if repeat:
        return f"frame {frame} (frame {inside} of repeat {repeat} of the loop)"
    return f"frame {frame} (frame {inside} of the loop)"


def difference_reason(difference: Difference, expected: Expected) -> str:
    """Return cycle, pin, channel, frame, and what was expected and observed."""
    pin = PINS[difference.pin]
    motion = _MOTION[difference.level == HIGH]
    first = f"first difference at cycle {difference.cycle}"
    if difference.channel is None:
        return f"{first}: {pin}, which the schedule does not drive, {motion}s"
    where = f"{pin} ({difference.channel})"
    if difference.frame is not None:
        where += f", {frame_words(difference.frame, expected.lead_in, expected.loop)}"
    head = f"{first}, {where}:"
    if difference.observed is None:
        return f"{head} should {motion} at cycle {difference.expected} and does not"
    if difference.expected is None:
        return f"{head} {motion}s, where the schedule has no change"
    late = difference.observed - difference.expected
    word = "late" if late > 0 else "early"
    return (
        f"{head} should {motion} at cycle {difference.expected}, {motion}s at cycle {difference.observed}, "
        f"{counted(abs(late), 'cycle')} {word}"
    )


def channel_reasons(channels: Iterable[ChannelVerdict], expected: Expected) -> list[str]:
    """Return what is wrong with each channel's pulses."""
    reasons = []
    for channel in channels:
        facts = []
        for number, noun in (
            (channel.missing, "missing pulse"),
            (channel.extra, "extra pulse"),
            (channel.glitches, "glitch"),
        ):
            if number:
                facts.append(counted(number, noun))
        for worst, noun in ((channel.width, "width"), (channel.period, "period"), (channel.edge, "edge")):
            if worst.count:
                facts.append(_worst_words(worst, noun, expected))
        if facts:
            reasons.append(f"{PINS[channel.pin]} ({channel.name}): {', '.join(facts)}")
    return reasons


def overlap_reason(overlap: Overlap) -> str:
    pins = " and ".join(PINS[pin] for pin in overlap.pins)
    return (
        f"pulses overlap where the schedule has none together: {counted(overlap.count, 'time')}, "
        f"first at cycle {overlap.first} ({pins}), for at most {counted(overlap.longest, 'cycle')}"
    )


def stray_reason(stray: StrayPin) -> str:
    return (
        f"{PINS[stray.pin]}, which the schedule does not drive, changes {counted(stray.edges, 'time')}, "
        f"first at cycle {stray.first}"
    )


def short_reason(missing: int, end: int, clock: Clock) -> str:
    """Return the reason for a trace whose `end` is `missing` cycles before that of the requested span."""
    seconds = float(clock.seconds(missing))
    short = f"{counted(missing, 'cycle')} ({seconds:.6g} s)"
    return f"the trace ends at cycle {end}, {short} before the end of the check"


def unseen_reason(coverage: Coverage) -> str:
    """Return what is missing if not every different frame was seen."""
    missing = len(coverage.different) - len(coverage.seen)
    were = "was" if missing == 1 else "were"
    return f"{counted(missing, 'different frame')} of the schedule {were} not seen whole"


def unseen_motion_reason(frames: int, whole: int) -> str:
    """Return what is missing if less than the `whole` motion was compared."""
    missing = whole - frames
    are = "is" if missing == 1 else "are"
    return f"of the motion's {counted(whole, 'frame')} the last {missing} {are} missing in what was compared"


def silent_reason(pin: int) -> str:
    return f"no scheduled pin ever rises; {PINS[pin]} should be the first"


def _worst_words(worst: Worst, noun: str, expected: Expected) -> str:
    frame = "" if worst.frame is None else f" in {frame_words(worst.frame, expected.lead_in, expected.loop)}"
    return f"{counted(worst.count, f'wrong {noun}')}, worst {worst.error:+d} {_cycles(worst.error)}{frame}"


def _cycles(number: int) -> str:
    return "cycle" if abs(number) == 1 else "cycles"


def verdict_lines(verdict: Verdict) -> list[str]:
    """Return lines without colour; the first says whether the trace is exact, and how close to the plan it
    is.
    """
    lines = [
        f"{_headline(verdict)}{_span_words(verdict)}; "
        f"{'0 cycles from the schedule; ' if verdict.agrees else ''}{plan_text(verdict.plan_error)}"
    ]
    if verdict.start is not None:
        start = float(verdict.clock.us(verdict.start))
        lines.append(f"first edge {counted(verdict.start, 'cycle')} ({start:g} µs) after reset")
    lines += [_channel_line(channel) for channel in verdict.channels]
    lines += [f"- {reason}" for reason in verdict.reasons]
    return lines + [
        f"warning: {warning.sentence}"
        for warning in verdict.warnings
        if warning not in verdict.chip_dependent
    ]


def _headline(verdict: Verdict) -> str:
    """Return the beginning of the first line."""
    if verdict.passed:
        return f"{verdict.word}: "
    return f"{verdict.word}: {verdict.coverage.words()}; " if verdict.agrees else "NOT exact: "


def _span_words(verdict: Verdict) -> str:
    span = verdict.span
    seconds = float(verdict.clock.seconds(span.compared))
    beside = " and ".join(PINS[pin] for pin in span.others)
    pins = f"all pins but the bus {beside}" if beside else "all 13 pins"
    return f"compared {counted(span.compared, 'cycle')} ({seconds:g} s), {_frame_words(span)}, on {pins}"


def _frame_words(span: ComparedSpan) -> str:
    inside = [f"lead-in of {span.lead_in_frames}"] if span.lead_in_frames else []
    inside += [f"{counted(span.loop_repeats, 'repeat')} of the loop"] if span.loop_repeats else []
    frames = counted(span.frames, "frame")
    return f"{frames} ({', '.join(inside)})" if inside else frames


def _channel_line(channel: ChannelVerdict) -> str:
    errors = f"width {_error(channel.width)}, period {_error(channel.period)}, edge {_error(channel.edge)}"
    count = counted(channel.observed, "pulse")
    if channel.observed != channel.scheduled:
        count += f" of {channel.scheduled}"
    return f"{PINS[channel.pin]} {channel.name}: {count}; worst errors in cycles: {errors}"


def _error(worst: Worst) -> str:
    return f"{worst.error:+d}" if worst.error else "0"
