"""A picture of pulses: their widths over time, and some distinct frames as an oscilloscope shows them.

In: an observed trace, and the schedule that names its channels, if there is one. Out: a PNG, SVG or PDF
file, drawn by matplotlib (the extra "plot").

    ┌ width over time ──────────┐
    │ ▁▁▁▁▔▔▔▔▔▔▔▔▔             │  what is drawn is the observed trace; a schedule tells the channels and
    ├ frames ───────────────────┤  where a frame begins, without one every pin that pulses is a channel
    │ __▔▔▔▔▔▔▔_______  0.0 s   │  and a frame begins with its first pulse
    │ __▔▔▔▔▔▔▔▔▔▔____  2.0 s   │
    └───────────────────────────┘
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS, EdgeTrace
from servogen.errors import InputError
from servogen.pulse import PulseSchedule
from servogen.pulses import pulses
from servogen.report.drawing import PALETTE
from servogen.report.pictures import check_suffix, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]

MAX_FRAMES_SHOWN = 6
"""The maximum number of frames drawn: more are too small to read the widths in them."""
MAX_FRAMES_READ = 50_000
"""The maximum number of frames read: 15 minutes of servo pulses, or a second of a pin that toggles fast."""

LANE = 1.4
"""The distance between rows of pulses, in heights of a pulse."""

MARGIN = 0.04
"""The margin at both ends of a frame, as a share of its time."""


@dataclass(frozen=True, slots=True)
class PlottedPulses:
    """One channel's whole pulses: `rise` and `width` in microseconds, `rise` from the first edge on."""

    label: str
    colour: str
    rise: Floats
    width: Floats

    def within(self, start: float, end: float) -> tuple[float, float] | None:
        """Return (rise, width) of the first pulse that rises in [start, end), or None."""
        index = int(np.searchsorted(self.rise, start))
        if index == len(self.rise) or self.rise[index] >= end:
            return None
        return float(self.rise[index]), float(self.width[index])


@dataclass(frozen=True, slots=True)
class PlottedFrame:
    """The beginning and end of a frame, microseconds; the next may begin later, after a pause."""

    start: float
    end: float


def pulse_plot(
    trace: EdgeTrace, span: int, path: Path, title: str, schedule: PulseSchedule | None = None
) -> None:
    """Draw to `path` the pulses that rise within `span` cycles of the first edge of `trace`.

    Raises InputError for an unknown ending and where there are no pulses, ToolError without matplotlib.
    """
    check_suffix(path)
    save(pulse_figure(trace, span, title, schedule), path)


def pulse_figure(trace: EdgeTrace, span: int, title: str, schedule: PulseSchedule | None = None) -> Figure:
    """Return the picture of the pulses that rise within `span` cycles of the first edge of `trace`.

    Raises InputError where there are no pulses, ToolError without matplotlib.
    """
    channels = observed_pulses(trace, span, schedule)
    if not any(len(channel.rise) for channel in channels):
        raise InputError("no-pulses", "there are no pulses to draw", hint="measure says what the pins do")
    period = float(schedule.clock.us(schedule.period)) if schedule else _period(channels)
    frames = distinct_frames(channels, _starts(channels, period, schedule is None), period)
    lanes = _lanes(channels, frames)
    height = 0.45 + 0.3 * (1 + max(lanes))
    figure = new_figure(9, 3.0 + height * len(frames), title)
    ratios = [2.6, *[height] * len(frames)]
    axes = figure.subplots(1 + len(frames), 1, height_ratios=ratios, squeeze=False)[:, 0]
    _draw_widths(axes[0], channels, period)
    for panel, frame in zip(axes[1:], frames, strict=True):
        _draw_frame(panel, channels, lanes, frame, max(_length(channels, channel) for channel in frames))
        panel.tick_params(labelbottom=panel is axes[-1])
    axes[-1].set_xlabel("time in the frame, ms")
    return figure


def observed_pulses(trace: EdgeTrace, span: int, schedule: PulseSchedule | None) -> list[PlottedPulses]:
    """Return the pulses of each channel of a schedule, or without one of each pin with a whole pulse."""
    us = float(trace.clock.cycle_us)
    seen = pulses(trace)
    zero = int(seen.rise.min(initial=trace.end))
    named = (
        {pin: pin for pin in PINS}
        if schedule is None
        else {channel.pin: channel.name for channel in schedule.channels}
    )
    observed: list[PlottedPulses] = []
    for pin, name in named.items():
        mine = seen.of(PINS.index(pin)).whole()
        mine = mine.take(mine.rise < zero + span)
        if schedule is None and not len(mine.rise):
            continue
        label = pin if name == pin else f"{name} ({pin})"
        times, widths = (np.asarray(cycles * us, np.float64) for cycles in (mine.rise - zero, mine.width))
        observed.append(PlottedPulses(label, PALETTE[len(observed) % len(PALETTE)], times, widths))
    return observed


def _period(channels: Sequence[PlottedPulses]) -> float:
    """Return the median time from pulse to pulse."""
    gaps = np.concatenate([np.diff(channel.rise) for channel in channels])
    return (
        float(np.median(gaps))
        if len(gaps)
        else max(float(channel.width.max(initial=0)) for channel in channels) * 2
    )


def _starts(channels: Sequence[PlottedPulses], period: float, free: bool) -> Floats:
    """Return when frames with pulses begin; `free`: at a pulse half a period or more after the last one."""
    rises = np.sort(np.concatenate([channel.rise for channel in channels]))
    if not free:
        return np.asarray(np.unique(np.floor(rises / period + 1e-9)) * period)
    starts: list[float] = []
    for rise in rises.tolist():
        if not starts or rise - starts[-1] > period / 2:
            starts.append(rise)
    return np.asarray(starts)


def distinct_frames(channels: Sequence[PlottedPulses], starts: Floats, period: float) -> list[PlottedFrame]:
    """Return the first frame of each set of widths; of many, a few spread from the first to the last."""
    starts = starts[:MAX_FRAMES_READ]
    ends = np.append(np.minimum(starts[1:], starts[:-1] + period), starts[-1] + period)
    seen: dict[tuple[float, ...], PlottedFrame] = {}
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        widths = tuple(
            round(pulse[1], 3) if (pulse := channel.within(start, end)) else 0.0 for channel in channels
        )
        seen.setdefault(widths, PlottedFrame(start, end))
    frames = list(seen.values())
    if len(frames) <= MAX_FRAMES_SHOWN:
        return frames
    last = len(frames) - 1
    return [frames[round(last * number / (MAX_FRAMES_SHOWN - 1))] for number in range(MAX_FRAMES_SHOWN)]


def _lanes(channels: Sequence[PlottedPulses], frames: Sequence[PlottedFrame]) -> list[int]:
    """Return each channel's row, 0 at the top: channels whose pulses overlap get rows of their own."""
    lanes: list[int] = []
    for index, channel in enumerate(channels):
        occupied = {
            lanes[earlier]
            for earlier in range(index)
            for frame in frames
            if _overlap(
                channel.within(frame.start, frame.end), channels[earlier].within(frame.start, frame.end)
            )
        }
        lanes.append(next(lane for lane in range(len(channels)) if lane not in occupied))
    return lanes


def _overlap(first: tuple[float, float] | None, second: tuple[float, float] | None) -> bool:
    """Return whether two pulses, each its rise and width, are high at the same time."""
    return first is not None and second is not None and first[0] < sum(second) and second[0] < sum(first)


def _length(channels: Sequence[PlottedPulses], frame: PlottedFrame) -> float:
    """Return the time from the frame's beginning to its last falling edge."""
    pulses = [channel.within(frame.start, frame.end) for channel in channels]
    return max(sum(pulse) - frame.start for pulse in pulses if pulse)


def _draw_widths(axes: Axes, channels: Sequence[PlottedPulses], period: float) -> None:
    for channel in channels:
        # A gap of more than a period and a half has no pulses: the line stops there.
        breaks = np.flatnonzero(np.diff(channel.rise) > 1.5 * period) + 1
        times, widths = (np.insert(values, breaks, np.nan) for values in (channel.rise / 1e6, channel.width))
        axes.step(times, widths, where="post", label=channel.label, color=channel.colour)
    axes.set_xlabel("time, s")
    axes.set_ylabel("pulse width, µs")
    axes.ticklabel_format(axis="y", style="plain", useOffset=False)
    axes.margins(y=0.15)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=4, frameon=False, fontsize=9)


def _draw_frame(
    axes: Axes, channels: Sequence[PlottedPulses], lanes: Sequence[int], frame: PlottedFrame, length: float
) -> None:
    first, last = -MARGIN * length, (1 + MARGIN) * length
    for lane in set(lanes):
        axes.axhline(-LANE * lane, color="0.6", lw=1, zorder=0)
    for channel, lane in zip(channels, lanes, strict=True):
        pulse = channel.within(frame.start, frame.end)
        if pulse is None:
            continue
        rise, width = pulse[0] - frame.start, pulse[1]
        corners = np.array([rise, rise, rise + width, rise + width]) / 1000
        axes.plot(corners, np.array([0, 1, 1, 0]) - LANE * lane, color=channel.colour)
        middle = (rise + width / 2) / 1000
        axes.text(middle, 0.45 - LANE * lane, f"{width:g} µs", ha="center", va="center", fontsize=8)
    axes.set_xlim(first / 1000, last / 1000)
    axes.set_ylim(-0.15 - LANE * max(lanes), 1.25)
    axes.set_yticks([])
    axes.set_ylabel(f"{frame.start / 1e6:.4g} s", rotation=0, ha="right", va="center")
