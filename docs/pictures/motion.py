"""The picture of docs/motion.md that no command draws: the laws of motion.

python docs/pictures/motion.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from servogen.motion.laws import NAMES, law
from servogen.report.pictures import new_figure, save

HERE = Path(__file__).parent
TITLES = ("share of the way", "speed, ways a duration", "acceleration, ways a duration²")


def main() -> None:
    """Way, speed and acceleration of each law over its time."""
    figure = new_figure(13, 4, "laws of motion over the time of a move")
    panels: Any = figure.subplots(1, 3)
    u = np.linspace(0, 1, 1001)
    for name in NAMES:
        shape = law(name)
        panels[0].plot(u, shape.share(u), label=name)
        for order in (1, 2):
            panels[order].plot(u, shape.derivative(u, order), label=f"{name}, peak {shape.peak(order):.3g}")
    for axes, title in zip(panels, TITLES, strict=True):
        axes.set_xlabel("share of the time")
        axes.set_ylabel(title)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    panels[1].set_ylim(-0.1, 3.2)
    panels[2].set_ylim(-12, 19)
    save(figure, HERE / "motion-laws.png")


if __name__ == "__main__":
    main()
