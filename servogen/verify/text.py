"""A verdict as plain lines: what was compared, each channel's statistics, and why it is not proven."""

from __future__ import annotations

from servogen.edges import PINS
from servogen.plan_error import plan_words
from servogen.units import counted
from servogen.verify.verdict import ChannelVerdict, Span, Verdict, Worst


def verdict_lines(verdict: Verdict) -> list[str]:
    """Return lines without colour; the first says whether the trace is proven, and how close to the plan it
    is.
    """
    lines = [
        f"{_headline(verdict)}{_span_words(verdict)}; "
        f"{'0 cycles from the schedule; ' if verdict.agrees else ''}{plan_words(verdict.plan_error)}"
    ]
    if verdict.start is not None:
        start = float(verdict.clock.us(verdict.start))
        lines.append(f"first edge {counted(verdict.start, 'cycle')} ({start:g} µs) after reset")
    lines += [_channel_line(channel) for channel in verdict.channels]
    lines += [f"- {reason}" for reason in verdict.reasons]
    return lines + [
        f"warning: {each.sentence}" for each in verdict.warnings if each not in verdict.chip_dependent
    ]


def _headline(verdict: Verdict) -> str:
    """Return the beginning of the first line."""
    if verdict.proven:
        return f"{verdict.word}: "
    return f"{verdict.word}: {verdict.coverage.words()}; " if verdict.agrees else "NOT proven: "


def _span_words(verdict: Verdict) -> str:
    span = verdict.span
    seconds = float(verdict.clock.seconds(span.compared))
    return f"compared {counted(span.compared, 'cycle')} ({seconds:g} s), {_frame_words(span)}, on all 13 pins"


def _frame_words(span: Span) -> str:
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
