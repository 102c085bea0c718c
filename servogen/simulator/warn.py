"""Things worth saying that the program did, noted in the state vector; each is kept once, with its cycle.

Compiled: called from the instruction loop, but rarely.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.layout import CYCLE, WARN_COUNT, WARNING_SLOTS, WARNINGS


@compiled
def warn(s: Vector, code: int, subject: int) -> None:
    """Note `code` about `subject` (a pin, an address), unless it is noted already or the table is full."""
    key = code << 16 | subject
    count = s[WARN_COUNT]
    for i in range(count):
        if s[WARNINGS + 2 * i] == key:
            return
    if count < WARNING_SLOTS:
        s[WARNINGS + 2 * count] = key
        s[WARNINGS + 2 * count + 1] = s[CYCLE]
        s[WARN_COUNT] = count + 1
