"""The reasons why a trace is not proven, as sentences.

In: the findings of the comparison. Out: one sentence per fact, the first difference first.
"""

from __future__ import annotations

from collections.abc import Iterable

from servogen.edges import HIGH, PINS, Expected
from servogen.units import Clock, counted
from servogen.verify.coverage import Coverage
from servogen.verify.verdict import ChannelVerdict, Difference, Overlap, StrayPin, Worst

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
