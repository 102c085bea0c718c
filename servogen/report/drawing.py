"""Charts as numbers that a template only has to write down: SVG paths, ticks and labels.

In: columns of values. Out: a `Chart` in its own units of a pixel, y downwards; nothing is computed after it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

PALETTE = (
    *("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2"),
    *("#7f7f7f", "#bcbd22", "#003f5c", "#a05195", "#4d7c0f"),
)
"""A colour for each of the thirteen pins."""

LEFT, RIGHT, TOP, BOTTOM = 58.0, 12.0, 10.0, 34.0
"""The margins of a chart in pixels: room for the numbers on the left and for numbers and label below."""


@dataclass(frozen=True, slots=True)
class Tick:
    """A line across the chart and its label."""

    at: str
    label: str


@dataclass(frozen=True, slots=True)
class Polyline:
    path: str
    colour: str
    label: str
    kind: str = "line"
    """A class of the page's style: line, thin, dots."""


@dataclass(frozen=True, slots=True)
class Chart:
    width: str
    height: str
    frame: tuple[str, str, str, str]
    """x, y, width, height of the area that is drawn in."""
    lines: tuple[Polyline, ...]
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    x_label: str
    y_label: str
    middle: tuple[str, str]
    """x and y of the middle of the area."""
    mark: str | None = None
    """x of a dashed line: where the loop begins."""


@dataclass(frozen=True, slots=True)
class Axis:
    """Values from `low` to `high` on pixels from `first` to `last`."""

    low: float
    high: float
    first: float
    last: float

    def at(self, values: npt.ArrayLike) -> Floats:
        share = (np.asarray(values, dtype=np.float64) - self.low) / (self.high - self.low)
        return np.asarray(self.first + share * (self.last - self.first))

    def ticks(self, count: int) -> tuple[Tick, ...]:
        """Return ticks at round numbers, about `count` at most."""
        step = nice((self.high - self.low) / count)
        numbers = np.arange(math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9) + 1)
        return tuple(Tick(px(self.at(number * step)), f"{number * step:.10g}") for number in numbers.tolist())


def px(value: npt.ArrayLike) -> str:
    """Return a coordinate as text, with one decimal at most."""
    return f"{float(np.asarray(value)):z.1f}".removesuffix(".0").replace("-0", "0") or "0"


def nice(step: float) -> float:
    """Return the smallest of 1, 2, 5 × 10ⁿ that is not less than `step`."""
    if step <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(step))
    return next((power * factor for factor in (1, 2, 5) if power * factor >= step * (1 - 1e-9)), 10 * power)


def steps_path(times: Floats, values: Floats) -> str:
    """Return a path of steps in pixels: value n from time n to time n + 1; NaN leaves a gap."""
    parts, before = [], math.nan
    for start, end, value in zip(times[:-1].tolist(), times[1:].tolist(), values.tolist(), strict=True):
        if math.isnan(value):
            before = value
            continue
        if math.isnan(before):
            parts.append(f"M{px(start)} {px(value)}")
        elif value != before:
            parts.append(f"V{px(value)}")
        # A horizontal that goes on is one command, not many.
        if parts[-1].startswith("H"):
            parts.pop()
        parts.append(f"H{px(end)}")
        before = value
    return "".join(parts)


def points_path(x: Floats, y: Floats) -> str:
    """Return a path through points in pixels; NaN leaves a gap."""
    parts, pen = [], "M"
    for across, up in zip(x.tolist(), y.tolist(), strict=True):
        if math.isnan(across) or math.isnan(up):
            pen = "M"
            continue
        parts.append(f"{pen}{px(across)} {px(up)}")
        pen = "L"
    return "".join(parts)


def dots_path(x: Floats, y: Floats) -> str:
    """Return a path with a dot at each distinct point: a line of no length, of which the round caps show."""
    seen = dict.fromkeys(
        (px(across), px(up))
        for across, up in zip(x.tolist(), y.tolist(), strict=True)
        if not (math.isnan(across) or math.isnan(up))
    )
    return "".join(f"M{one} {other}h0" for one, other in seen)


def time_chart(
    times: Floats,
    columns: Floats,
    names: Sequence[str],
    y_label: str,
    mark: float | None,
    height: float = 220.0,
) -> Chart:
    """Return a chart of one stepped line per column; `times` has one entry more than there are rows."""
    width = 960.0
    x = Axis(float(times[0]), float(times[-1]), LEFT, width - RIGHT)
    y = Axis(*_around(columns), height - BOTTOM, TOP)
    lines = tuple(
        Polyline(steps_path(x.at(times), y.at(columns[:, index])), PALETTE[index % len(PALETTE)], name)
        for index, name in enumerate(names)
    )
    return Chart(
        width=px(width),
        height=px(height),
        frame=(px(LEFT), px(TOP), px(width - LEFT - RIGHT), px(height - TOP - BOTTOM)),
        lines=lines,
        x_ticks=x.ticks(12),
        y_ticks=y.ticks(6),
        x_label="time, s",
        y_label=y_label,
        middle=(px((LEFT + width - RIGHT) / 2), px((TOP + height - BOTTOM) / 2)),
        mark=None if mark is None else px(x.at(mark)),
    )


def path_chart(
    tracks: Sequence[tuple[str, Floats, Floats]], x_label: str, y_label: str, largest: float = 400.0
) -> Chart:
    """Return a chart of paths in a plane, to one scale: (name, planned (n, 2), made (n, 2)) each."""
    every = np.vstack([points for _, planned, achieved in tracks for points in (planned, achieved)])
    ends = [_around(every[:, column]) for column in (0, 1)]
    spans = [high - low for low, high in ends]
    scale = largest / max(spans)
    width, height = (max(span * scale, 90.0) for span in spans)
    x = Axis(*_margins_around(ends[0], width / scale), LEFT, LEFT + width)
    y = Axis(*_margins_around(ends[1], height / scale), TOP + height, TOP)
    lines = []
    for index, (name, planned, achieved) in enumerate(tracks):
        colour = PALETTE[index % len(PALETTE)]
        lines.append(Polyline(points_path(x.at(planned[:, 0]), y.at(planned[:, 1])), colour, name))
        lines.append(Polyline(dots_path(x.at(achieved[:, 0]), y.at(achieved[:, 1])), colour, "", "dots"))
    return Chart(
        width=px(width + LEFT + RIGHT),
        height=px(height + TOP + BOTTOM),
        frame=(px(LEFT), px(TOP), px(width), px(height)),
        lines=tuple(lines),
        x_ticks=x.ticks(max(2, int(width / 70))),
        y_ticks=y.ticks(max(3, int(height / 40))),
        x_label=x_label,
        y_label=y_label,
        middle=(px(LEFT + width / 2), px(TOP + height / 2)),
    )


def _around(values: Floats) -> tuple[float, float]:
    """Return the smallest and the largest value, with some room around them."""
    seen = values[~np.isnan(values)]
    low, high = (float(seen.min()), float(seen.max())) if seen.size else (0.0, 1.0)
    room = 0.06 * (high - low) or max(1.0, 0.02 * abs(high))
    return low - room, high + room


def _margins_around(ends: tuple[float, float], span: float) -> tuple[float, float]:
    spare = max(0.0, span - (ends[1] - ends[0])) / 2
    return ends[0] - spare, ends[1] + spare
