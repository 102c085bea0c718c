"""Rows of poses moved off the motion, so that the largest distance from it is as small as it can be.

In: a motion encoded with the poses of some of its frames, and its widths. Out: the same steps between other
poses.

    poses of the motion  ●╌╌╌╌╌╌╌╌╌●        a chord is off a curve on one side only
                           ‾‾‾‾‾‾‾
    balanced              ___                half as far off, on both sides: so the steps may be longer
                         ●╌╌╌╌╌╌╌╌╌●

All sums are of integers, so that every machine finds the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from servogen.engines.player.arithmetic import FRACTION, Whole
from servogen.engines.player.encoding import Encoded
from servogen.engines.player.poses import blends, played
from servogen.motion.trajectory import Floats

SWEEPS = 40
"""How often all rows are moved, at most, for each measure."""


def _fourth_powers(away: Whole) -> Whole:
    """Return a measure in which many frames far off count, so that neighbouring rows move together."""
    return np.asarray((away**4).sum(axis=0))


def _largest(away: Whole) -> Whole:
    return np.asarray(np.abs(away).max(axis=0))


def balance(encoded: Encoded, ideal: Floats) -> Encoded:
    """Return the motion with rows moved by whole steps; `ideal` (frames, channels) are the widths of its
    frames in cycles.
    """
    scale, columns = encoded.scale, len(encoded.scale.bases)
    rows = np.frombuffer(encoded.rows, dtype=np.uint8).reshape(-1, columns).astype(np.int64)
    shares = np.zeros((len(rows), len(ideal)), dtype=np.int64)
    first = 0
    for start, end, weight in blends(encoded.steps, encoded.laws):
        frames = slice(first, first + len(weight))
        shares[start, frames] += (1 << FRACTION) - weight
        shares[end, frames] += weight
        first = frames.stop
    shares[:, encoded.silent] = 0
    # The chip rounds down to whole cycles: half a cycle more is nearest.
    wanted = np.round(scale.exact(np.nan_to_num(ideal) + 0.5) * (1 << FRACTION)).astype(np.int64)
    away = shares.T @ rows - wanted
    for measure in (_fourth_powers, _largest):
        for _ in range(SWEEPS):
            if not _swept(rows, shares, away, measure):
                break
    values, _ = played(encoded.steps, rows.tolist(), encoded.laws)
    return replace(encoded, rows=bytes(rows.ravel().tolist()), widths=scale.widths(values))


def _swept(rows: Whole, shares: Whole, away: Whole, measure: Callable[[Whole], Whole]) -> bool:
    """Move each byte by a step where that makes the measure smaller; return whether any was moved."""
    moved = False
    for row, share in zip(rows, shares, strict=True):
        frames = np.flatnonzero(share)
        if not frames.size:  # a step of one frame ends where the next one begins
            continue
        part, change = away[frames], share[frames, None]
        for step in (-1, 1):
            better = (measure(part + step * change) < measure(part)) & (row + step >= 0) & (row + step <= 255)
            if better.any():
                row += step * better
                part += step * change * better
                moved = True
        away[frames] = part
    return moved
