"""A twin's result for people: tables, a picture, a film and a CSV.

In: a `TwinVerdict`. Out: rows of text, files; matplotlib only where something is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from servogen.kinematics.protocol import DrivingRobot
from servogen.report.drawing import PALETTE, Chart, path_chart, time_chart
from servogen.report.film import FilmPart, FilmScene
from servogen.report.html import TwinFacts
from servogen.report.pictures import new_figure, plane, save
from servogen.report.sticks import base_outline
from servogen.robot.model import Robot
from servogen.twin.run import SAMPLE_S, Record
from servogen.twin.verdict import TwinVerdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]

MAX_PICTURES = 120
"""The maximum number of pictures in a film."""

FRAME_S = 0.02
"""The time over which torques and currents, which jump with every pulse, are averaged: a usual frame."""

MAX_ROWS = 4000
"""The maximum number of points of a line in a picture; more would only make the file larger."""

PAGE_ROWS, PAGE_DOTS = 1000, 200
"""The same for a line and for dots on a page."""


def comparison_rows(verdict: TwinVerdict) -> Iterator[tuple[str, str, str, str]]:
    """Yield what is compared: its name, as asked, with rigid legs or ideal wheels, as simulated."""
    asked, rigid, travelled = verdict.planned.way, verdict.planned.rigid, verdict.done
    record = verdict.record
    if record.floating:
        for index, (name, factor, unit) in enumerate(
            (("forward", 1000.0, "mm"), ("left", 1000.0, "mm"), ("turn", math.degrees(1), "°"))
        ):
            yield (
                name,
                f"{factor * asked[index]:z.1f} {unit}" if asked else "",
                f"{factor * rigid[-1, index]:z.1f} {unit}" if rigid is not None else "",
                f"{factor * travelled[index]:z.1f} {unit}",
            )
        height = verdict.planned.height
        yield (
            "least body height",
            f"{1000 * height:.1f} mm" if height is not None else "",
            "",
            f"{1000 * record.pose[record.first :, 2].min():z.1f} mm",
        )
    if verdict.tool_error is not None:
        yield "tool, farthest from its path", "", "", f"{1000 * verdict.tool_error:.2f} mm"
    if verdict.tool_rest_error is not None:
        yield "tool, farthest at rest", "", "", f"{1000 * verdict.tool_rest_error:.2f} mm"
    if record.feet.shape[1]:
        leg = f" ({verdict.drag_leg})" if verdict.drag_leg else ""
        yield "longest drag in a stance", "", "", f"{1000 * verdict.drag:.1f} mm{leg}"
    current, supply = record.current, record.rig.supply
    limit = "" if supply.limit_a is None else f"limit {supply.limit_a:g} A"
    yield "current, peak and mean", limit, "", f"{current.max():.2f} A, {current.mean():.2f} A"
    yield "voltage, least", f"{supply.volts:g} V", "", f"{record.voltage.min():.2f} V"


def servo_rows(verdict: TwinVerdict) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield for each servo its peak and rms torque, its stall torque, and how far it lags at most."""
    record = verdict.record
    part = slice(record.first, None)
    for index, servo in enumerate(record.rig.servos):
        torque = record.torque[part, index]
        lag = np.abs(record.target[part, index] - record.angle[part, index])
        drive = record.rig.drives[index]
        yield (
            servo.name,
            f"{np.abs(torque).max():.3f}",
            f"{drive.stall_torque:.3f}",
            f"{np.sqrt(np.mean(torque**2)):.3f}",
            "" if drive.continuous or np.isnan(lag).all() else f"{math.degrees(np.nanmax(lag)):.1f}",
        )


def check_rows(verdict: TwinVerdict) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield each expectation: its name, what was measured and is allowed, the unit, whether it fails."""
    for check in verdict.checks:
        word = "" if check.passed else "FAILS"
        yield check.name, check.shown, f"{check.allowed:g}", check.unit, word


def page_facts(verdict: TwinVerdict) -> TwinFacts:
    """Return what the report's page shows of a run."""
    record = verdict.record
    unsure = verdict.not_guaranteed_from is not None or (verdict.passed and not verdict.judged)
    badge = "open" if unsure else "good" if verdict.passed else "bad"
    rows = slice(None, None, max(1, math.ceil(len(record.time) / PAGE_ROWS)))
    step = float(record.time[rows][1] - record.time[rows][0]) if len(record.time) > 1 else 0.005
    times = np.append(record.time[rows], record.time[rows][-1] + step)
    columns: list[tuple[str, Floats, list[str], str]] = [
        ("torque of the servos", record.torque, [servo.name for servo in record.rig.servos], "N·m"),
        ("current of the supply", record.current[:, None], ["current"], "A"),
        ("voltage of the supply", record.voltage[:, None], ["voltage"], "V"),
    ]
    if record.feet.shape[1]:
        columns.append(("height of the feet", 1000 * record.feet[..., 2], _legs(verdict.record), "mm"))
    charts = [
        (name, time_chart(times, values[rows], names, unit, record.motion[0]))
        for name, values, names, unit in columns
    ]
    path = _page_path(verdict)
    return TwinFacts(
        verdict.word,
        badge,
        record.settings.ground.text(),
        tuple(comparison_rows(verdict)),
        tuple(servo_rows(verdict)),
        tuple(check_rows(verdict)),
        tuple(verdict.reasons()),
        tuple(f"{event.seconds:.2f} s: {event.text}" for event in verdict.events),
        (*record.bodies.assumptions, *record.rig.assumptions),
        ((*path, *charts)),
    )


def _page_path(verdict: TwinVerdict) -> Iterator[tuple[str, Chart]]:
    """Yield the path from above of the body or the tool: planned as a line, simulated as dots."""
    record, planned = verdict.record, verdict.planned
    rows = slice(record.first, None, max(1, math.ceil(len(record.time) / PAGE_DOTS)))
    if record.floating and planned.rigid is not None:
        actual = _seen_from(record.pose[record.first], record.pose[rows, :2])
        yield "path of the body; dots: simulated", _chart("body", planned.rigid[:, :2], actual)
    elif record.tool.shape[1] and planned.tool is not None:
        yield "path of the tool; dots: simulated", _chart("tool", planned.tool[:, :2], record.tool[rows, :2])


def _chart(name: str, planned: Floats, actual: Floats) -> Chart:
    return path_chart([(name, 1000 * planned, 1000 * actual)], "x, mm", "y, mm")


def csv_text(verdict: TwinVerdict) -> str:
    """Return one row per sample: time, pose, supply, and of each servo its angle, target and torque."""
    record = verdict.record
    columns: list[tuple[str, Floats]] = [
        ("time_s", record.time),
        ("x_mm", 1000 * record.pose[:, 0]),
        ("y_mm", 1000 * record.pose[:, 1]),
        ("z_mm", 1000 * record.pose[:, 2]),
        ("yaw_deg", np.degrees(record.pose[:, 3])),
        ("tilt_deg", np.degrees(record.tilt)),
        ("voltage_v", record.voltage),
        ("current_a", record.current),
    ]
    for index, servo in enumerate(record.rig.servos):
        columns += [
            (f"{servo.name}_deg", np.degrees(record.angle[:, index])),
            (f"{servo.name}_target_deg", np.degrees(record.target[:, index])),
            (f"{servo.name}_nm", record.torque[:, index]),
        ]
    for index, limb in enumerate(_legs(verdict.record)):
        columns += [
            (f"{limb}_foot_mm", 1000 * record.feet[:, index, 2]),
            (f"{limb}_force_n", record.force[:, index]),
        ]
    lines = [",".join(name for name, _ in columns)]
    for row in np.column_stack([values for _, values in columns]).tolist():
        lines.append(",".join("" if math.isnan(value) else f"{value:z.5g}" for value in row))
    return "\n".join(lines) + "\n"


def twin_plot(verdict: TwinVerdict, name: str, path: Path) -> None:
    """Draw the path from above, heading and height, torques, current, voltage and the heights of the feet."""
    record, legs = verdict.record, _legs(verdict.record)
    figure = new_figure(12.5, 9.0, f"{name}: {verdict.word}, {record.settings.ground.text()}")
    grid = figure.add_gridspec(4, 2, width_ratios=(1, 1.5))
    draw_path(figure.add_subplot(grid[:2, 0]), verdict)
    rows = slice(None, None, max(1, len(record.time) // MAX_ROWS))
    time = record.time[rows]
    torque = figure.add_subplot(grid[0, 1])
    for index, servo in enumerate(record.rig.servos):
        colour = PALETTE[index % len(PALETTE)]
        torque.plot(time, _smooth(record.torque[:, index])[rows], lw=0.8, color=colour, label=servo.name)
    torque.set_ylabel("torque, N·m\n(mean of 20 ms)")
    torque.legend(fontsize=6, ncols=1, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    current = figure.add_subplot(grid[1, 1], sharex=torque)
    current.plot(time, record.current[rows], color="0.8", lw=0.5)
    current.plot(time, _smooth(record.current)[rows], color="tab:red", lw=0.8)
    current.set_ylabel("current, A\n(red: mean of 20 ms)")
    voltage = figure.add_subplot(grid[2, 1], sharex=torque)
    voltage.plot(time, record.voltage[rows], color="tab:green", lw=0.8)
    voltage.set_ylabel("voltage, V")
    if record.rig.supply.feeds_chip:
        voltage.axhline(record.rig.supply.chip_minimum_v, color="0.4", ls="--", lw=0.8)
    last = figure.add_subplot(grid[3, 1], sharex=torque)
    heading = figure.add_subplot(grid[2, 0], sharex=torque)
    height = figure.add_subplot(grid[3, 0], sharex=torque)
    if legs:
        for index, leg in enumerate(legs):
            feet = 1000 * record.feet[rows, index, 2]
            last.plot(time, feet, lw=0.8, color=PALETTE[index % len(PALETTE)], label=leg)
        last.set_ylabel("foot height, mm")
        last.legend(fontsize=6, ncols=1, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    else:
        for index, servo in enumerate(record.rig.servos):
            lag = np.degrees(record.target[rows, index] - record.angle[rows, index])
            if not record.rig.drives[index].continuous:
                last.plot(time, lag, lw=0.8, color=PALETTE[index % len(PALETTE)], label=servo.name)
        last.set_ylabel("target - angle, °")
    if record.floating:
        heading.plot(time, np.degrees(record.pose[rows, 3] - record.pose[record.first, 3]), lw=1.0)
        heading.set_ylabel("heading, °")
        height.plot(time, 1000 * record.pose[rows, 2], lw=1.0)
        height.set_ylabel("height of the body, mm")
    else:
        for axes, column, label in ((heading, 1, "y"), (height, 2, "z")):
            if record.tool.shape[1]:
                axes.plot(time, 1000 * record.tool[rows, column], lw=1.0)
            axes.set_ylabel(f"tool, {label}, mm")
    for axes in (torque, current, voltage, last, heading, height):
        axes.grid(alpha=0.3)
        axes.axvspan(*record.motion, color="0.95", zorder=0)
        for event in verdict.events[:1]:
            axes.axvline(event.seconds, color="tab:red", ls=":", lw=1.0)
    last.set_xlabel("time, s; grey: the job's motion")
    height.set_xlabel("time, s")
    save(figure, path)


def _smooth(values: Floats) -> Floats:
    """Return the mean over a frame of 20 ms around each sample."""
    width = max(1, round(FRAME_S / SAMPLE_S))
    return np.asarray(np.convolve(values, np.ones(width) / width, mode="same"))


def draw_path(axes: Axes, verdict: TwinVerdict) -> None:
    record, rigid = verdict.record, verdict.planned.rigid
    if record.floating:
        first = record.pose[record.first]
        places = _seen_from(first, record.pose[record.first :, :2])
        if rigid is not None:
            axes.plot(*(1000 * rigid[:, :2].T), "--", color="0.5", label="rigid legs, ideal wheels")
        axes.plot(*(1000 * places.T), color="black", label="simulated")
        for index, leg in enumerate(_legs(verdict.record)):
            stands = record.force[record.first :, index] > 0.1
            feet = _seen_from(first, record.feet[record.first :, index, :2])[stands]
            axes.plot(*(1000 * feet.T), ".", ms=2, color=PALETTE[index % len(PALETTE)], label=leg)
        if verdict.planned.way is not None:
            x, y, _ = verdict.planned.way
            axes.plot(1000 * x, 1000 * y, "x", color="black", label="asked")
    elif record.tool.shape[1] and verdict.planned.tool is not None:
        axes.plot(*(1000 * verdict.planned.tool[:, :2].T), "--", color="0.5", label="planned")
        axes.plot(*(1000 * record.tool[record.first :, :2].T), color="black", label="simulated")
    plane(axes, "x", "y", "from above; dots: where feet stand" if record.feet.shape[1] else "from above")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=6, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _seen_from(pose: Floats, points: Floats) -> Floats:
    """Return points (n, 2) of the ground in the frame of a pose (x, y, z, yaw)."""
    local = (points[:, 0] + 1j * points[:, 1] - complex(pose[0], pose[1])) * np.exp(-1j * pose[3])
    return np.column_stack([local.real, local.imag])


def twin_scene(verdict: TwinVerdict, name: str) -> FilmScene:
    """Return the film of a run in the world's frame."""
    record = verdict.record
    step = max(1, math.ceil(len(record.time) / MAX_PICTURES))
    parts = body_parts(record, slice(None, None, step))
    picture_s = step * float(record.time[1] - record.time[0])
    return FilmScene(f"{name}: {verdict.word}", tuple(parts), picture_s)


def body_parts(record: Record, rows: slice) -> list[FilmPart]:
    """Return lines through the bodies at some samples, in the world's frame."""
    places = {name: place[rows] for name, place in record.places.items()}
    return lines_through(
        record.rig.robot, places, record.feet[rows], record.tool[rows], record.pose[rows][:, [0, 1, 3]]
    )


def lines_through(
    robot: Robot, places: Mapping[str, Floats], feet: Floats, tool: Floats, pose: Floats
) -> list[FilmPart]:
    """Return lines through bodies in one or more pictures: `pose` has x, y and yaw."""
    parts = []
    legs = [limb.name for limb in robot.limbs if limb.mount is not None]
    if legs:
        middle = np.mean([places[f"{leg}_coxa"][0] for leg in legs], axis=0)
        around = sorted(legs, key=lambda leg: math.atan2(*(places[f"{leg}_coxa"][0] - middle)[1::-1]))
        corners = [places[f"{leg}_coxa"] for leg in (*around, around[0])]
        parts.append(FilmPart(list(np.stack(corners, axis=1)), "0.35", 3.0, marks=False))
    for index, leg in enumerate(legs):
        joints = [places[f"{leg}_{part}"] for part in ("coxa", "thigh", "foot")]
        line = np.stack([*joints, feet[:, index]], axis=1)
        parts.append(FilmPart(list(line), f"C{index % 10}"))
    if isinstance(robot, DrivingRobot):
        parts += [FilmPart(list(outline), "tab:blue", marks=False) for outline in base_outline(robot, pose)]
    elif not legs:
        chain = list(places.values())
        line = np.stack([np.zeros_like(chain[0]), *chain, tool], axis=1)
        parts.append(FilmPart(list(line), "C0"))
    return parts


def _legs(record: Record) -> list[str]:
    return [limb.name for limb in record.rig.robot.limbs if limb.mount is not None]
