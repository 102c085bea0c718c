"""A picture of pulses: their widths over the motion, and each distinct frame as an oscilloscope shows it.

In: a schedule and the edges observed. Out: a PNG, SVG or PDF file, drawn by matplotlib (the extra "plot").

    ┌ width over time ──────────┐
    │ ▁▁▁▁▔▔▔▔▔▔▔▔▔             │  what is drawn is the observed trace; the schedule names the channels
    ├ frames ───────────────────┤
    │ __▔▔▔▔▔▔▔_______  0.0 s   │
    │ __▔▔▔▔▔▔▔▔▔▔____  2.0 s   │
    └───────────────────────────┘
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PINS, EdgeTrace, join
from servogen.pulse import Channel, PulseSchedule
from servogen.report.pictures import check_suffix, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_FRAMES_SHOWN = 6
MARGIN_US = 300.0


@dataclass(frozen=True, slots=True)
class Pulses:
    """One channel's observed pulses: `rise` and `width` in cycles, float64."""

    channel: Channel
    rise: npt.NDArray[np.float64]
    width: npt.NDArray[np.float64]


def pulse_plot(schedule: PulseSchedule, trace: EdgeTrace, span: int, path: Path, title: str) -> None:
    """Draws to `path` the `span` cycles of `trace` from its first edge.

    Raises InputError for an unknown ending, ToolError without matplotlib.
    """
    check_suffix(path)
    channels = observed_pulses(schedule, trace, span)
    frames = _distinct_frames(schedule, channels)
    figure = new_figure(9, 2.6 + 0.8 * max(2, len(frames)), title)
    axes = figure.subplots(1 + len(frames), 1, height_ratios=[2.6, *[0.8] * len(frames)], squeeze=False)[:, 0]
    _draw_widths(axes[0], schedule, channels)
    for panel, (start, label) in zip(axes[1:], frames, strict=True):
        _draw_frame(panel, schedule, channels, start, label)
        panel.tick_params(labelbottom=panel is axes[-1])
    axes[-1].set_xlabel("time in the frame, ms")
    save(figure, path)


def observed_pulses(schedule: PulseSchedule, trace: EdgeTrace, span: int) -> list[Pulses]:
    """The whole pulses of each channel that rise within `span` cycles; times count from the first edge."""
    edges = join(trace.driven())
    zero = edges.cycle[0] if len(edges.cycle) else 0
    found = []
    for channel in schedule.channels:
        mine = edges.pin == PINS.index(channel.pin)
        cycle, level = edges.cycle[mine] - zero, edges.level[mine]
        rise, fall = cycle[level == HIGH], cycle[level != HIGH]
        whole = min(int(np.searchsorted(rise, span)), len(fall))
        width = (fall[:whole] - rise[:whole]).astype(np.float64)
        found.append(Pulses(channel, rise[:whole].astype(np.float64), width))
    return found


def _distinct_frames(schedule: PulseSchedule, channels: list[Pulses]) -> list[tuple[float, str]]:
    """(start in cycles, label) of the first frame of each distinct set of widths, the first few."""
    seen: dict[tuple[float, ...], float] = {}
    starts = np.unique(np.concatenate([each.rise // schedule.period for each in channels])) * schedule.period
    for start in starts.tolist():
        widths = tuple(_width_at(each, start, schedule.period) for each in channels)
        seen.setdefault(widths, start)
        if len(seen) == MOST_FRAMES_SHOWN:
            break
    return [(start, f"{float(schedule.clock.seconds(int(start))):g} s") for start in seen.values()]


def _width_at(pulses: Pulses, start: float, period: int) -> float:
    index = int(np.searchsorted(pulses.rise, start))
    inside = index < len(pulses.rise) and pulses.rise[index] < start + period
    return float(pulses.width[index]) if inside else 0.0


def _draw_widths(axes: Axes, schedule: PulseSchedule, channels: list[Pulses]) -> None:
    seconds = float(schedule.clock.seconds(1))
    us = float(schedule.clock.cycle_us)
    for each in channels:
        # A gap of more than a period and a half has no pulses: the line stops there.
        breaks = np.flatnonzero(np.diff(each.rise) > 1.5 * schedule.period) + 1
        times, widths = (
            np.insert(values, breaks, np.nan) for values in (each.rise * seconds, each.width * us)
        )
        axes.step(times, widths, where="post", label=f"{each.channel.name} ({each.channel.pin})")
    axes.set_xlabel("time, s")
    axes.set_ylabel("pulse width, µs")
    axes.margins(y=0.15)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=4, frameon=False, fontsize=9)


def _draw_frame(
    axes: Axes, schedule: PulseSchedule, channels: list[Pulses], start: float, label: str
) -> None:
    us = float(schedule.clock.cycle_us)
    ends = [max(each.rise % schedule.period + each.width, default=0) for each in channels]
    stop = max(ends) * us + MARGIN_US
    for index, each in enumerate(channels):
        at = int(np.searchsorted(each.rise, start))
        if at < len(each.rise) and each.rise[at] < start + schedule.period:
            rise, width = (each.rise[at] - start) * us, each.width[at] * us
            corners = np.array([-MARGIN_US, rise, rise, rise + width, rise + width, stop]) / 1000
            axes.plot(corners, [0, 0, 1, 1, 0, 0], color=f"C{index}")
            axes.text((rise + width / 2) / 1000, 0.45, f"{width:g} µs", ha="center", va="center", fontsize=8)
    axes.set_xlim(-MARGIN_US / 1000, stop / 1000)
    axes.set_ylim(-0.15, 1.25)
    axes.set_yticks([])
    axes.set_ylabel(label, rotation=0, ha="right", va="center")
