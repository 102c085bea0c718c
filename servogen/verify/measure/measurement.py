"""`Measurement`: what a HEX file does on its pins, without a schedule for comparison. All times are in
cycles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from servogen.edges import PINS
from servogen.units import Clock, Cycles
from servogen.verify.verdict import Overlap


@dataclass(frozen=True, slots=True)
class Run:
    """Consecutive pulses of one width, without a pause between them; the periods are those within the run."""

    first: Cycles
    pulses: int
    width: Cycles
    shortest_period: Cycles | None
    longest_period: Cycles | None

    def to_json(self) -> dict[str, object]:
        return {
            "first_cycle": self.first,
            "pulses": self.pulses,
            "width_cycles": self.width,
            "shortest_period_cycles": self.shortest_period,
            "longest_period_cycles": self.longest_period,
        }


@dataclass(frozen=True, slots=True)
class FrameKind:
    """The frames of one pulse width: their number and the most frequent period."""

    width: Cycles
    frames: int
    period: Cycles

    def to_json(self) -> dict[str, object]:
        return {"width_cycles": self.width, "frames": self.frames, "period_cycles": self.period}


@dataclass(frozen=True, slots=True)
class Pause:
    """A time without pulses longer than three periods: from a fall to the next rise."""

    begin: Cycles
    length: Cycles
    count: int = 1
    """So many pauses of this length follow one another, with a pulse between each two."""

    def to_json(self) -> dict[str, object]:
        return {"begin_cycle": self.begin, "length_cycles": self.length, "count": self.count}


@dataclass(frozen=True, slots=True)
class PinMeasurement:
    """The pulses of one pin. A pulse that the end of the trace cuts off is not counted; it rises at
    `open_rise`.
    """

    pin: int
    pulses: int
    first: Cycles
    widths: Mapping[Cycles, int]
    """How many pulses of each width, by width."""
    periods: Mapping[Cycles, int]
    """How many of each time from rise to rise, pauses left out, by time."""
    period: Cycles | None
    """The median of the times from rise to rise."""
    kinds: tuple[FrameKind, ...]
    """Of each width that two or more frames have, by width."""
    pauses: tuple[Pause, ...]
    runs: tuple[Run, ...]
    open_rise: Cycles | None

    @property
    def frame_difference(self) -> Cycles:
        """Return by how much the kinds of frame differ in length."""
        periods = [kind.period for kind in self.kinds]
        return Cycles(max(periods) - min(periods)) if periods else Cycles(0)

    def widths_in_order(self) -> list[Cycles]:
        """Return one width per pulse, as needed for a check of the motion."""
        return [run.width for run in self.runs for _ in range(run.pulses)]

    def to_json(self) -> dict[str, object]:
        return {
            "pin": PINS[self.pin],
            "pulses": self.pulses,
            "first_cycle": self.first,
            "widths": [{"cycles": width, "pulses": count} for width, count in self.widths.items()],
            "periods": [{"cycles": period, "frames": count} for period, count in self.periods.items()],
            "period_cycles": self.period,
            "frame_kinds": [kind.to_json() for kind in self.kinds],
            "frame_difference_cycles": self.frame_difference,
            "pauses": [pause.to_json() for pause in self.pauses],
            "runs": [run.to_json() for run in self.runs],
            "open_rise_cycle": self.open_rise,
        }


@dataclass(frozen=True, slots=True)
class Measurement:
    """What the pins do from reset to cycle `end`; pins that never pulse are omitted.

    `complete` is False if the pulses repeat so rarely that the measurement stopped before the end of the
    trace.
    """

    clock: Clock
    end: Cycles
    pins: tuple[PinMeasurement, ...]
    overlap: Overlap | None
    """Two pins high at once: how often, how long at most, and first when."""
    complete: bool

    def us(self, cycles: int) -> Fraction:
        return self.clock.us(cycles)

    def to_json(self) -> dict[str, object]:
        """Return plain values for a JSON file."""
        return {
            "clock_hz": self.clock.hz,
            "end_cycle": self.end,
            "complete": self.complete,
            "pins": [pin.to_json() for pin in self.pins],
            "overlap": self.overlap.to_json() if self.overlap else None,
        }
