"""`SeenChip`: a chip that a test can only look at, on the bench or in a recording.

In: a `Look`, which captures its pins. Out: the same measurements as of a simulated `Chip`. A test that does
more with it is skipped there, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NoReturn

import pytest

from servogen.edges import EdgeTrace, join
from servogen.errors import InputError
from servogen.testing.chip import Chip
from servogen.testing.signals import Signals
from servogen.testing.targets import Bench, CaptureRequest, Replay, Seen
from servogen.testing.waves import at_the_pins, wave_lines
from servogen.units import Clock

Look = Callable[[float], Sequence[Seen]]
"""Looks at the pins for some seconds; returns what was not seen before."""


class SeenChip(Signals):
    """A chip whose pins are seen, and nothing else."""

    def __init__(self, name: str, clock: Clock, look: Look) -> None:
        self.name = name
        self.clock = clock
        self.seen: list[Seen] = []
        self._look = look

    def run_s(self, s: float) -> None:
        """Look at the pins for so long."""
        self.seen += self._look(s)

    def run_ms(self, ms: float) -> None:
        self.run_s(ms / 1000)

    def run_us(self, us: float) -> None:
        self.run_s(us / 1_000_000)

    def run_cycles(self, cycles: int) -> None:
        self.run_s(float(self.clock.seconds(cycles)))

    def pieces(self) -> Sequence[EdgeTrace]:
        return tuple(seen.trace for seen in self.seen)

    def chip_clock(self) -> Clock:
        return self.clock

    def report(self) -> list[str]:
        """Return the waves of the last capture."""
        if not self.seen:
            return ["nothing was captured"]
        last = self.seen[-1].trace
        return wave_lines(at_the_pins(join(last.chunks), ()), int(last.end), last.clock)

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("_") or not hasattr(Chip, name):
            raise AttributeError(f"a chip has no '{name}'")
        pytest.skip(
            f"needs the simulated chip: chip.{name}; on the bench and on recordings a chip only runs, "
            "and its edges, widths, periods and bytes are measured"
        )


def bench_look(bench: Bench, clock: Clock) -> Look:
    """Return a look at the chip on the bench: a capture of at least the time asked for."""

    return lambda s: [bench.capture(CaptureRequest(clock, seconds=s))]


def replay_look(replay: Replay, clock: Clock) -> Look:
    """Return a look at recordings, which shows all that was recorded at the first time."""
    shown = False

    def look(s: float) -> Sequence[Seen]:
        nonlocal shown
        found = [] if shown else replay.recordings(clock)
        for seen in found:
            if seen.capture is not None and seen.capture.missing:
                text = f"{seen.source} is incomplete: {seen.capture.missing}"
                raise InputError("capture-failed", text)
        shown = True
        return found

    return look
