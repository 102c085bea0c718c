"""Things worth saying that the program did, noted in the state vector; each is kept once, with its cycle.

Compiled: called from the instruction loop, but rarely.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.layout import CYCLE, HERE, WARN_COUNT, WARNING_FIELDS, WARNING_SLOTS, WARNINGS


@compiled
def warn(s: Vector, code: int, subject: int) -> None:
    """Note `code` about `subject` (a pin, an address), unless it is noted already or the table is full."""
    key = code << 16 | subject
    count = s[WARN_COUNT]
    for i in range(count):
        if s[WARNINGS + WARNING_FIELDS * i] == key:
            return
    if count < WARNING_SLOTS:
        s[WARNINGS + WARNING_FIELDS * count] = key
        s[WARNINGS + WARNING_FIELDS * count + 1] = s[CYCLE]
        s[WARNINGS + WARNING_FIELDS * count + 2] = s[HERE]
        s[WARN_COUNT] = count + 1
