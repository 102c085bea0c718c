"""The wire between two chips: a servo's signal of the first chip is an input of the second.

In: its pin on a chip, and on which side that is. Out: what the program of each side does about it.

    wire      ____▔▔__________▔▔__________▔▔__________▔▔__________▔▔__________▔▔____   rises once a frame
    frame         0           1           2           3           4           5
    second    quiet: begin    └ three frames find the cycle ──────┘ pulses, the rise checked in every frame

Both chips count the same cycles, so the phase that the second one finds stays. A loop of four cycles sees the
first rise 0 to 3 cycles late; in each of the next three frames the wire is read one cycle before it rises,
and the program catches up by one cycle if it is high. From then on it is read in the cycle before it rises
and in the two after, once a frame; unless it is low, high and high there, the pulses are released until the
first chip begins anew, which it does with a wire that is low for longer than a frame.

Chips with a crystal each have no phase to find. From the frame after the first rise on, the second one looks
for the rise every two cycles, around its time by as much as the crystals may be off, and counts the frame
from the look that sees it. If there is none, or the first look is high already, no pulses follow, as above.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from servogen.units import Clock, Cycles

LOOKED_LATE = 3
"""The number of cycles by which the loop that waits for the first rise may see it late."""

QUIET_LOOKS, QUIET_C = 256, 7
"""The looks at a wire that is low until its rise is awaited, and the cycles of each beside its pause."""

QUIET_S = Fraction(1, 4)
"""The time in which the first chip keeps the wire low before its motion: the second one's power-up timer may
end up to 104 ms after its own (DS35007, parameter 33: 28 to 132 ms), and then waits for a quiet frame."""


RESTART_CYCLES = Cycles(768)
"""The cycles for which a second chip that begins pulls the first one's MCLR low: 154 us at 20 MHz, where 2 us
are enough (DS35007, parameter 30); a capacitor there takes more.
"""


def quiet_pause(period: Cycles) -> int:
    """Return the turns of 3 cycles between two of the 256 looks at the wire that together are longer than a
    frame.
    """
    return (period // QUIET_LOOKS - QUIET_C) // 3 + 1


def quiet_cycles(period: Cycles) -> Cycles:
    """Return the cycles from the first look at a quiet wire to the first one that awaits its rise."""
    return Cycles(QUIET_LOOKS * (3 * quiet_pause(period) + QUIET_C) - 1)


@dataclass(frozen=True, slots=True)
class FrameWire:
    """The end of the wire at a chip's `pin`: the second chip `follows` it, the first one drives it with the
    pulses of a servo. `other` is the pin of its other end; `restart` the second chip's pin that is wired to
    the first one's MCLR.
    """

    kind: ClassVar[str] = "the wire of another chip"

    pin: str
    follows: bool
    other: str
    restart: str | None = None
    crystal_ppm: int = 0
    """How far each chip's crystal may be off; 0 if they share one."""

    @property
    def joining_frames(self) -> int:
        """Return the first chip's frames, from its first one on, in which the second has no pulses yet."""
        return 1 if self.crystal_ppm else LOOKED_LATE + 1

    def quiet_frames(self, clock: Clock, period: Cycles) -> int:
        """Return the frames without pulses with which the first chip begins."""
        return -int(-QUIET_S // clock.seconds(period))

    def text(self) -> tuple[str, ...]:
        """Return the wiring of the pin, as text for the header of the C."""
        if self.follows:
            return (
                f"{self.pin}: the wire from the first chip's {self.other}, 10 kOhm pull-down to ground.",
                "The motion begins after a quiet frame; no pulses unless it rises in its cycle of each."
                if not self.crystal_ppm
                else f"The motion begins after a quiet frame; each begins at its rise: own crystal, "
                f"{self.crystal_ppm} ppm.",
                *[f"{self.restart}: to the first chip's MCLR: low at the beginning, so that both begin anew."]
                * bool(self.restart),
            )
        return f"{self.pin}: also the wire to the second chip's {self.other}.", "Quiet before the motion."
