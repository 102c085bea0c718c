"""The sampling rate of a capture, and whether it suffices to show anything.

    pin        ┌──────────┐           ┌──┐
    samples  ·    ·    ·    ·    ·    ·    ·    a pulse shorter than a sample may be missed;
               0    1    1    0    0    0       a width is known to one sample

The rule: a sample may be no longer than the shortest pulse or gap that counts, `Tolerances.glitch_us`. A
stated rate is believed as long as all edges lie on its grid. If one lies between two samples, there were more
of them, and the tolerances are those of the grid on which all edges do lie. A file that states no rate states
its time step at least. A step of more than a nanosecond is believed, as long as each edge is where it is
scheduled to that step; otherwise edges that all lie on the grid of a slow rate are evidence that samples are
missing.

In: a capture and what its file says. Out: a `Sampling`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from servogen.edges import EdgeTrace, join
from servogen.errors import InputError, Location
from servogen.verify.windows import Ints

TYPICAL_HZ = tuple(
    mantissa * 10.0**power
    for power in range(6)
    for mantissa in (1, 1.2, 1.25, 1.5, 1.6, 2, 2.4, 2.5, 3, 3.2, 4, 4.8, 5, 6, 6.4, 7.5, 8, 9.6)
)
"""Rates at which analysers sample, slowest first; their samples may not be a whole number of steps."""

ROUNDING = 0.51
"""The maximum difference, in steps, between a sample's time and the time in the file."""

NOTATION_US = 0.001
"""A time step of a nanosecond or less is the unit in which a program writes times, not its sampling."""

FIRST_EDGES = 50
"""The number of edges with which a rate is tried first; most rates are rejected by them."""


@dataclass(frozen=True, slots=True)
class Sampling:
    """One sample every `sample_us`; if no rate that its edges allow is `stated`, the maximum it can be."""

    sample_us: float
    stated: bool

    def too_slow(self, longest_us: float) -> bool:
        """Return whether a sample is longer than `longest_us`; rounding errors of times are allowed for."""
        return self.sample_us > longest_us * (1 + 1e-9)

    def check(self, longest_us: float, place: Location | None = None) -> None:
        """Raise InputError if a sample is longer than `longest_us`."""
        if not self.too_slow(longest_us):
            return
        hint = f"a sample may be no longer than {longest_us:g} µs, the shortest pulse or gap that counts"
        if not self.stated:
            hint += "; if it was sampled more often, state the rate: --rate"
        raise InputError("sampling-too-slow", self.words(longest_us), place, hint)

    def words(self, longest_us: float) -> str:
        """Return why the sampling is too slow, and the rate that is needed."""
        needed = f"at least {rate_words(longest_us)} is needed"
        every = f"every {self.sample_us:g} µs ({rate_words(self.sample_us)})"
        if self.stated:
            return f"sampled {every}, too slow to show anything: {needed}"
        return f"does not state its sampling rate, and all its edges are on a grid of {every}: {needed}"


def sampling(captured: EdgeTrace, sample: float | None) -> Sampling:
    """Return the sampling of a capture whose cycles are time steps; times are no finer than steps.

    `sample` is the number of steps from sample to sample if the file contains it.
    """
    step_us = float(captured.clock.cycle_us)
    edges = np.unique(join(captured.driven()).cycle)
    if sample is not None:
        sample = max(sample, 1.0)
        if not len(edges) or _on_grid(edges - edges[0], sample, 2 * ROUNDING):
            return Sampling(sample * step_us, True)
    if not edges.any():
        return Sampling(step_us, False)
    return Sampling(max(int(np.gcd.reduce(edges)) * step_us, _grid_us(edges, step_us)), False)


def _grid_us(edges: Ints, step_us: float) -> float:
    """Return the sample of the slowest usual rate on whose grid all edges lie, rounded to steps; 0 if there
    is none.
    """
    for hz in TYPICAL_HZ:
        sample = 1e6 / hz / step_us
        if sample > 1 and all(_on_grid(part, sample) for part in (edges[:FIRST_EDGES], edges)):
            return sample * step_us
    return 0.0


def _on_grid(edges: Ints, sample: float, rounding: float = ROUNDING) -> bool:
    away = np.abs(edges - np.rint(edges / sample) * sample)
    return bool(away.max() <= rounding)


def rate_words(sample_us: float) -> str:
    """Return the sampling rate, as `100 kHz`."""
    hz = 1e6 / sample_us
    for unit, size in (("MHz", 1e6), ("kHz", 1e3)):
        if hz >= size:
            return f"{hz / size:g} {unit}"
    return f"{hz:g} Hz"
