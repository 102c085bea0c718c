"""A capture's verdict as plain lines: the clock, each channel's statistics, and why it is not proven."""

from __future__ import annotations

from servogen.edges import PINS
from servogen.plan_error import plan_words
from servogen.units import counted
from servogen.verify.capture.verdict import CapturedChannel, CaptureVerdict
from servogen.verify.coverage import Coverage


def capture_lines(verdict: CaptureVerdict) -> list[str]:
    """Return lines without colour; the first says whether the capture is proven."""
    seconds = verdict.duration_us / 1e6
    first = "" if verdict.first_frame is None else f" from frame {verdict.first_frame} on"
    lines = [
        f"{_headline(verdict)}{counted(verdict.frames, 'frame')}{first} in {seconds:g} s, "
        f"a sample every {verdict.sample_us:g} µs; {plan_words(verdict.plan_error)}",
        _clock_words(verdict),
    ]
    if verdict.pieces:
        lines.append(_seams_words(verdict))
    if verdict.agrees:
        lines.append(_seen_words(verdict.coverage))
    lines += [_channel_line(channel) for channel in verdict.channels if channel.connected]
    return lines + [f"- {reason}" for reason in verdict.reasons]


def _headline(verdict: CaptureVerdict) -> str:
    """Return the beginning of the first line."""
    if verdict.proven:
        return f"{verdict.word}: "
    return f"{verdict.word}: {verdict.coverage.words()}; " if verdict.agrees else "NOT proven: "


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
        f"stitched of {len(verdict.pieces)} captures: the time between two is not known; each is aligned to "
        "the schedule by itself, and nothing is measured across a seam"
    )


def _clock_words(verdict: CaptureVerdict) -> str:
    if verdict.ppm is None:
        return "the capture is too short to measure the chip's clock: its nominal frequency is taken"
    return (
        f"the chip's clock is {abs(verdict.ppm):z.1f} ± {verdict.ppm_error:z.1f} ppm "
        f"{'fast' if verdict.ppm >= 0 else 'slow'}; it is taken out of what follows"
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
