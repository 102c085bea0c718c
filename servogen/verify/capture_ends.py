"""The pulses that a capture's beginning and end cut: of each only one edge was seen.

        begin                                    end
    ┌─────┊───┐          ┌───────┐          ┌─────┊───┐
    │     ┊   │          │       │          │     ┊   │
    ┘     ┊   └──────────┘       └──────────┘     ┊   └──
              first fall                    last rise

Such an edge is right when any of the schedule's frames has one of the channel at this time of the frame:
which frame it belongs to cannot be told from one edge.

In: a channel's pulses and the line that joins their times. Out: those edges that no frame has.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from servogen.verify.capture_align import Line
from servogen.verify.pulses import CutPulses, Pulses


def strange_edges(
    cut: CutPulses, wanted: Pulses, line: Line, period: int, limit: float
) -> Iterator[tuple[int, str]]:
    """Yield the step of each edge that is farther than `limit` cycles from where any frame has one."""
    begin = wanted.frame * period
    for step, edges, what in (
        (cut.first_fall, wanted.fall - begin, "ends"),
        (cut.last_rise, wanted.rise - begin, "begins"),
    ):
        if step is None or not len(edges):
            continue
        away = (float(line.cycles(step)) - np.unique(edges)) % period
        if np.minimum(away, period - away).min() > limit:
            yield step, what
