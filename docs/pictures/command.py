"""The picture of a walk on command in docs/firmware.md: the path from above, as the simulated chip walks it.

python docs/pictures/command.py
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from servogen.drive.commands import script
from servogen.drive.on_command import CommandedDrive, CommandedFrame, Twin
from servogen.drive.serial_link import VirtualTime
from servogen.job import load, plan_job
from servogen.report.pictures import new_figure, save

HERE = Path(__file__).parent
JOB = HERE.parents[1] / "jobs" / "hexapod-command.toml"
COMMANDS = """
wait 2.5
forward
wait 4
left
wait 6
forward
wait 3.5
back
wait 4
right
wait 3
stop
wait 4
"""
COLOURS = {"forward": "tab:blue", "back": "tab:orange", "left": "tab:green", "right": "tab:red"}
STANDS_M = 0.0015
"""A foot this near to the lowest stands."""


def feet(states: list[CommandedFrame]) -> np.ndarray:
    """Return the feet (frames, legs, 3) in the body's frame, metres, from the widths of the pulses."""
    job = plan_job(load(JOB))
    widths = np.array([list(state.widths_us.values()) for state in states])
    columns = [
        [servo.angle(width) for width in column]
        for servo, column in zip(job.servos, widths.T.tolist(), strict=True)
    ]
    return np.stack([end.points(np.array(columns).T) for end in job.ends], axis=1)


def path(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the body's positions and headings as complex numbers: standing feet do not move."""
    flat = points[:, :, 0] + 1j * points[:, :, 1]
    stands = points[:, :, 2] < points[:, :, 2].min(axis=1, keepdims=True) + STANDS_M
    at, turn = [0j], [1 + 0j]
    for one, other, both in zip(flat, flat[1:], stands[:-1] & stands[1:], strict=False):
        before, after = one[both], other[both]
        middle, centre = before.mean(), after.mean()
        rotation = np.vdot(after - centre, before - middle)
        rotation /= abs(rotation)
        at.append(at[-1] + turn[-1] * (middle - rotation * centre))
        turn.append(turn[-1] * rotation)
    return np.array(at), np.array(turn)


def main() -> None:
    states: list[CommandedFrame] = []
    CommandedDrive(Twin(plan_job(load(JOB))), script(COMMANDS), VirtualTime().time(), states.append).run(60)
    states = states[100:]  # the robot stands
    points = feet(states)
    at, turn = path(points)
    figure = new_figure(13, 6, "hexapod-command: a commanded walk on the simulated chip, from its pulses")
    grid = figure.add_gridspec(1, 2, width_ratios=(1, 1.15))
    above: Any = figure.add_subplot(grid[0])
    over: Any = figure.add_subplot(grid[1])
    directions = [state.direction for state in states]
    changes = [n for n in range(1, len(directions)) if directions[n] != directions[n - 1]]
    ends = [0, *changes, len(directions) - 1]
    shown = set()
    for first, end in pairwise(ends):
        direction = directions[first]
        if direction in COLOURS:
            piece = 1000 * at[first : end + 1]
            label = direction if direction not in shown else None
            shown.add(direction)
            above.plot(piece.real, piece.imag, color=COLOURS[direction], linewidth=2, label=label)
            over.axvspan(
                states[first].seconds, states[end].seconds, color=COLOURS[direction], alpha=0.18, linewidth=0
            )
    stands = points[:, :, 2] < points[:, :, 2].min(axis=1, keepdims=True) + STANDS_M
    ground = 1000 * (at[:, None] + turn[:, None] * (points[:, :, 0] + 1j * points[:, :, 1]))
    above.plot(ground[stands].real, ground[stands].imag, ".", color="0.75", markersize=1.5, zorder=0)
    for n in ends:
        nose = 1000 * (at[n] + 0.03 * turn[n])
        here = 1000 * at[n]
        above.annotate("", (nose.real, nose.imag), (here.real, here.imag), arrowprops={"arrowstyle": "->"})
    above.set_aspect("equal")
    above.set_xlabel("x, mm; grey: where feet stand; arrows: the body's heading between the directions")
    above.set_ylabel("y, mm")
    above.legend()
    above.grid(alpha=0.3)
    seconds = [state.seconds for state in states]
    ticks = []
    for index, name in enumerate(("L1-turn", "L1-lift", "R1-turn", "R1-lift")):
        widths = np.array([state.widths_us[name] for state in states])
        base = -300 * index
        over.plot(seconds, widths - widths.min() + base, color="0.2", linewidth=0.9)
        ticks.append((base + np.ptp(widths) / 2, f"{name}\n{widths.min():.0f} to\n{widths.max():.0f} µs"))
    over.set_yticks(*zip(*ticks, strict=True), fontsize=8)
    over.set_xlabel("s; the widths of four pulses, coloured by the direction that is walked")
    save(figure, HERE / "walk-on-command.png")


if __name__ == "__main__":
    main()
