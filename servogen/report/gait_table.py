"""Every frame of a walk as CSV: time, joints, feet, which are on the ground, the stability margin.

In: a `Walk`. Out: lines of text, one per frame: seconds, degrees, millimetres of the body's frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from servogen.motion.gait.walk import Walk


def frame_lines(made: Walk) -> Iterator[str]:
    """Yield the header, then one line per frame; the margin is empty for a robot of one or two legs."""
    trajectory = made.trajectory
    angles = [f"{joint}_deg" for joint in trajectory.joints]
    feet = [f"{leg}_{axis}_mm" for leg in made.legs for axis in "xyz"]
    yield ",".join(("time_s", *angles, *feet, *(f"{leg}_ground" for leg in made.legs), "margin_mm"))
    frame_s = trajectory.clock.seconds(trajectory.period)
    numbers = np.hstack((np.degrees(trajectory.angles), 1000 * made.feet.reshape(len(made.feet), -1)))
    rows = zip(numbers.tolist(), made.ground.tolist(), made.margins.tolist(), strict=True)
    for frame, (row, ground, margin) in enumerate(rows):
        cells = [f"{value:z.4f}" for value in row]
        cells += ["1" if down else "0" for down in ground]
        cells.append("" if math.isinf(margin) else f"{1000 * margin:z.4f}")
        yield ",".join((f"{float(frame * frame_s):z.6f}", *cells))
