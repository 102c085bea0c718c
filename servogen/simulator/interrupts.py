"""Interrupt flags, enables and the moment at which they are sampled. Compiled.

DS35007 section 6.8 (INTCON, section 2.3.3), timing DS30430 figures 6-4 and 8-17: the flags are sampled in Q1
of every cycle. Sampled true in cycle s, the instruction of cycle s still executes, and the one at 0004h
executes in cycle s + 3, whatever the length of the former. `IRQ_AT` is that s, or NEVER.
"""

from __future__ import annotations

from servogen.pic.device import masks
from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.layout import AWAKE_AT, EECON1, INTCON, INTCON_UNKNOWN, IRQ_AT, NEVER
from servogen.simulator.unknown import doubt

GIE, EEIE, T0IE, T0IF, INTF, RBIF = masks("GIE", "EEIE", "T0IE", "T0IF", "INTF", "RBIF")
(EEIF,) = masks("EEIF")
LATENCY = 3


@compiled
def requested(s: Vector) -> bool:
    """Return whether an enabled flag is set, regardless of GIE; this wakes the chip."""
    intcon = s[INTCON]
    if (intcon >> 3) & intcon & 7:
        return True
    return (intcon & EEIE) != 0 and (s[EECON1] & EEIF) != 0


@compiled
def note_flags(s: Vector, cycle: int) -> None:
    """Update the sampling after flags or enables have changed in `cycle`; what was sampled before remains
    valid.
    """
    if s[INTCON_UNKNOWN]:
        doubt(s, False)
    cycle = max(cycle, s[AWAKE_AT])  # a chip that is starting up samples nothing
    if s[INTCON] & GIE and requested(s):
        if s[IRQ_AT] > cycle:
            s[IRQ_AT] = cycle
    elif s[IRQ_AT] >= cycle:
        s[IRQ_AT] = NEVER
