"""A picture of a calibration: the readings, their line, the catalogue's line, and the residuals below.

In: a `Fit` and its servo. Out: a PNG, SVG or PDF file.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from servogen.report.pictures import check_suffix, new_figure, save
from servogen.robot.calibration import Fit
from servogen.robot.servo import Servo


def calibration_plot(fit: Fit, servo: Servo, path: Path) -> None:
    """Draw a calibration to `path`. Raises InputError for an unknown ending, ToolError without matplotlib."""
    check_suffix(path)
    unit = servo.model.unit
    figure = new_figure(8, 6, f"{servo.name}: {len(fit.readings)} readings of a {servo.model.title}")
    panes: Any = figure.subplots(2, 1, sharex=True, height_ratios=[2.4, 1])
    angles = [math.degrees(reading.angle) for reading in fit.readings]
    widths = [reading.width_us for reading in fit.readings]
    slope = fit.us_per_rad * math.radians(1)
    label = f"fit: {fit.zero_us:z.1f} µs {'+' if slope > 0 else '−'} {abs(slope):z.3f} µs/{unit}"
    line = [(math.degrees(angle), width) for angle, width in fit.points()]
    panes[0].plot(*zip(*line, strict=True), "C0", label=label)
    before = [(math.degrees(servo.angle(width)), width) for width in (min(widths), max(widths))]
    panes[0].plot(*zip(*before, strict=True), "0.6", ls="--", label="the job until now")
    panes[0].plot(angles, widths, "ko", ms=5, label="read")
    panes[0].set_ylabel("pulse width, µs")
    panes[0].legend(frameon=False)
    residuals = [math.degrees(residual) for residual in fit.residuals]
    panes[1].axhline(0, color="C0", lw=1)
    panes[1].vlines(angles, 0, residuals, color="k", lw=1)
    panes[1].plot(angles, residuals, "ko", ms=5)
    most = 1.2 * max(0.5, *(abs(residual) for residual in residuals))
    panes[1].set_ylim(-most, most)
    panes[1].set_ylabel(f"residual, {unit}")
    panes[1].set_xlabel(f"speed, {unit}" if servo.model.continuous else f"angle seen, {unit}")
    for axes in panes:
        axes.grid(alpha=0.3)
    save(figure, path)
